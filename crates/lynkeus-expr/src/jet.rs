//! Truncated Taylor series over any algebra, and derivatives along a flow.

use crate::{Algebra, Binary, Implicit, Unary};

/// Taylor coefficients x(t₀+τ) = Σ cₖτᵏ, at least one. Coefficients beyond the
/// last are zero: a constant is a jet of one coefficient.
pub type Jet<V> = Vec<V>;

/// Truncated Taylor series whose coefficients are values of an inner algebra:
/// numbers give derivatives at a point, intervals enclose them on a box, nodes
/// give them as expressions. The recurrences are the classical ones (e.g.
/// Griewank & Walther, *Evaluating Derivatives*, ch. 13).
#[derive(Clone, Copy, Debug)]
pub struct Jets<'a, A> {
    /// the algebra of the coefficients
    pub inner: &'a A,
    /// highest power kept
    pub order: usize,
}

impl<A: Algebra> Jets<'_, A> {
    fn two(&self, op: Binary, x: &A::Value, y: &A::Value) -> A::Value {
        self.inner.binary(op, x, y)
    }

    fn mul(&self, x: &A::Value, y: &A::Value) -> A::Value {
        self.two(Binary::Mul, x, y)
    }

    fn scaled(&self, factor: usize, x: &A::Value) -> A::Value {
        self.mul(&self.inner.constant(factor as f64), x)
    }

    fn neg(&self, x: &A::Value) -> A::Value {
        self.inner.unary(Unary::Neg, x)
    }

    /// Σ; none for no terms, so that structural zeros leave no trace.
    fn sum(&self, terms: impl IntoIterator<Item = A::Value>) -> Option<A::Value> {
        let mut terms = terms.into_iter();
        let first = terms.next()?;
        Some(terms.fold(first, |sum, term| self.two(Binary::Add, &sum, &term)))
    }

    /// The k-th coefficient of x·y where both have it, for i in `from..=to`
    /// being the index into x.
    fn convolution(
        &self,
        x: &[A::Value],
        y: &[A::Value],
        k: usize,
        from: usize,
        to: usize,
    ) -> Option<A::Value> {
        let first = from.max((k + 1).saturating_sub(y.len()));
        let last = to.min(k).min(x.len() - 1);
        self.sum((first..=last).map(|i| self.mul(&x[i], &y[k - i])))
    }

    /// (1/k) Σ_{j=1..k} j·x_j·g_{k−j}: the k-th coefficient of ∫ g dx.
    fn integral(&self, x: &[A::Value], g: &[A::Value], k: usize) -> Option<A::Value> {
        let first = (k + 1).saturating_sub(g.len()).max(1);
        let last = k.min(x.len() - 1);
        let sum = self.sum((first..=last).map(|j| self.mul(&self.scaled(j, &x[j]), &g[k - j])))?;
        Some(self.two(Binary::Div, &sum, &self.inner.constant(k as f64)))
    }

    /// x − y, where what is none is zero.
    fn difference(&self, x: Option<&A::Value>, y: Option<A::Value>) -> A::Value {
        match (x, y) {
            (Some(x), None) => x.clone(),
            (Some(x), Some(y)) => self.two(Binary::Sub, x, &y),
            (None, Some(y)) => self.neg(&y),
            (None, None) => self.inner.constant(0.0),
        }
    }

    fn or_zero(&self, value: Option<A::Value>) -> A::Value {
        value.unwrap_or_else(|| self.inner.constant(0.0))
    }

    fn add(&self, x: &[A::Value], y: &[A::Value]) -> Jet<A::Value> {
        let both = |k| x.get(k).into_iter().chain(y.get(k)).cloned();
        let places = 0..x.len().max(y.len());
        places.map(|k| self.or_zero(self.sum(both(k)))).collect()
    }

    fn sub(&self, x: &[A::Value], y: &[A::Value]) -> Jet<A::Value> {
        let places = 0..x.len().max(y.len());
        places
            .map(|k| self.difference(x.get(k), y.get(k).cloned()))
            .collect()
    }

    fn product(&self, x: &[A::Value], y: &[A::Value]) -> Jet<A::Value> {
        let last = (x.len() + y.len() - 2).min(self.order);
        (0..=last)
            .map(|k| self.or_zero(self.convolution(x, y, k, 0, k)))
            .collect()
    }

    fn quotient(&self, x: &[A::Value], y: &[A::Value]) -> Jet<A::Value> {
        let last = if y.len() == 1 {
            x.len() - 1
        } else {
            self.order
        };
        let mut q: Jet<A::Value> = Vec::with_capacity(last + 1);
        for k in 0..=last {
            // Σ_{j≥1} y_j q_{k−j}
            let known = self.convolution(y, &q, k, 1, k);
            let numerator = self.difference(x.get(k), known);
            q.push(self.two(Binary::Div, &numerator, &y[0]));
        }
        q
    }

    fn sqrt(&self, x: &[A::Value]) -> Jet<A::Value> {
        let root = self.inner.unary(Unary::Sqrt, &x[0]);
        let twice = self.scaled(2, &root);
        let mut s = vec![root];
        for k in 1..=self.order {
            let known = self.convolution(&s, &s, k, 1, k - 1);
            let numerator = self.difference(x.get(k), known);
            s.push(self.two(Binary::Div, &numerator, &twice));
        }
        s
    }

    /// The function with value f₀ whose derivative with respect to x is the jet g.
    fn primitive(&self, f0: A::Value, x: &[A::Value], g: &[A::Value]) -> Jet<A::Value> {
        let rest = (1..=self.order).map(|k| self.or_zero(self.integral(x, g, k)));
        std::iter::once(f0).chain(rest).collect()
    }

    /// e with e' = e·x'.
    fn exp(&self, x: &[A::Value]) -> Jet<A::Value> {
        let mut e = vec![self.inner.unary(Unary::Exp, &x[0])];
        for k in 1..=self.order {
            e.push(self.or_zero(self.integral(x, &e, k)));
        }
        e
    }

    /// (s, c) with s' = c·x' and c' = ∓s·x': sine and cosine, or the hyperbolic pair.
    fn circular(&self, x: &[A::Value], s: Unary, c: Unary) -> (Jet<A::Value>, Jet<A::Value>) {
        let hyperbolic = s == Unary::Sinh;
        let mut sine = vec![self.inner.unary(s, &x[0])];
        let mut cosine = vec![self.inner.unary(c, &x[0])];
        for k in 1..=self.order {
            let ds = self.or_zero(self.integral(x, &cosine, k));
            let dc = self.or_zero(self.integral(x, &sine, k));
            sine.push(ds);
            cosine.push(if hyperbolic { dc } else { self.neg(&dc) });
        }
        (sine, cosine)
    }

    /// t with t' = (1 ± t²)·x': tangent (+) or its hyperbolic sister (−).
    fn tangent(&self, op: Unary, x: &[A::Value]) -> Jet<A::Value> {
        let sign = if op == Unary::Tan {
            Binary::Add
        } else {
            Binary::Sub
        };
        let one = self.inner.constant(1.0);
        let mut t = vec![self.inner.unary(op, &x[0])];
        let mut slope = vec![self.two(sign, &one, &self.mul(&t[0], &t[0]))];
        for k in 1..=self.order {
            t.push(self.or_zero(self.integral(x, &slope, k)));
            let square = self.or_zero(self.convolution(&t, &t, k, 0, k));
            slope.push(if op == Unary::Tan {
                square
            } else {
                self.neg(&square)
            });
        }
        t
    }

    /// The derivative of an inverse circular function as a jet.
    fn inverse_slope(&self, op: Unary, x: &[A::Value]) -> Jet<A::Value> {
        let one = vec![self.inner.constant(1.0)];
        let square = self.product(x, x);
        match op {
            Unary::Atan => self.quotient(&one, &self.add(&one, &square)),
            _ => {
                let root = self.sqrt(&self.sub(&one, &square));
                let slope = self.quotient(&one, &root);
                match op {
                    Unary::Acos => slope.iter().map(|v| self.neg(v)).collect(),
                    _ => slope,
                }
            }
        }
    }

    /// xᵇ for a constant exponent: p' x = b x' p.
    fn constant_power(&self, x: &[A::Value], b: &A::Value) -> Jet<A::Value> {
        let mut p = vec![self.two(Binary::Pow, &x[0], b)];
        for k in 1..=self.order {
            let terms = (1..=k.min(x.len() - 1)).map(|j| {
                let weight = self.two(
                    Binary::Sub,
                    &self.scaled(j, b),
                    &self.inner.constant((k - j) as f64),
                );
                self.mul(&self.mul(&weight, &x[j]), &p[k - j])
            });
            let sum = self.or_zero(self.sum(terms));
            p.push(self.two(Binary::Div, &sum, &self.scaled(k, &x[0])));
        }
        p
    }

    /// f with f' = (x y' − y x')/(x² + y²).
    fn atan2(&self, y: &[A::Value], x: &[A::Value]) -> Jet<A::Value> {
        let f0 = self.two(Binary::Atan2, &y[0], &x[0]);
        let norm = self.add(&self.product(x, x), &self.product(y, y));
        let along_y = self.primitive(f0, y, &self.quotient(x, &norm));
        let zero = self.inner.constant(0.0);
        let along_x = self.primitive(zero, x, &self.quotient(y, &norm));
        let rest = (1..=self.order).map(|k| self.two(Binary::Sub, &along_y[k], &along_x[k]));
        std::iter::once(along_y[0].clone()).chain(rest).collect()
    }

    fn choose(&self, c: &A::Value, x: &[A::Value], y: &[A::Value]) -> Jet<A::Value> {
        let zero = self.inner.constant(0.0);
        (0..x.len().max(y.len()))
            .map(|k| {
                self.inner
                    .select(c, x.get(k).unwrap_or(&zero), y.get(k).unwrap_or(&zero))
            })
            .collect()
    }

    /// The series of an implicit function's z from those of p, order by order. With z known below
    /// order k, the k-th coefficient of g(z, p) lacks only g_z·z_k, whose matrix is that of the base
    /// point: g_z z_k = −(what is there).
    fn root(&self, function: &Implicit, p: &[Jet<A::Value>]) -> Vec<Jet<A::Value>> {
        let inner = self.inner;
        let base: Vec<A::Value> = p.iter().map(|jet| jet[0].clone()).collect();
        let z = inner.implicit(function, &base);
        let mut at: Vec<Jet<A::Value>> = z.iter().map(|z| vec![z.clone()]).collect();
        if self.is_spent() || p.iter().all(|jet| jet.len() == 1) {
            return at;
        }
        let matrix = function.matrix(inner, &[z, base].concat());
        at.extend(p.iter().cloned());
        for order in 1..=self.order {
            for (short, jet) in at[function.size()..].iter_mut().zip(p) {
                *short = jet[..jet.len().min(order + 1)].to_vec();
            }
            let g = function.residual(&Jets { inner, order }, &at);
            let right: Vec<A::Value> = g
                .iter()
                .map(|g| self.difference(None, g.get(order).cloned()))
                .collect();
            let (next, _) = inner.solve(&matrix, &right);
            for (jet, value) in at.iter_mut().zip(next) {
                jet.push(value);
            }
        }
        at.truncate(function.size());
        at
    }
}

impl<A: Algebra> Algebra for Jets<'_, A> {
    type Value = Jet<A::Value>;

    fn constant(&self, value: f64) -> Self::Value {
        vec![self.inner.constant(value)]
    }

    fn unary(&self, op: Unary, x: &Self::Value) -> Self::Value {
        let value = || self.inner.unary(op, &x[0]);
        if x.len() == 1 || self.is_spent() {
            return vec![value()];
        }
        match op {
            Unary::Neg => x.iter().map(|v| self.neg(v)).collect(),
            Unary::Sign | Unary::Floor | Unary::Not => vec![value()],
            Unary::Abs => {
                let sign = self.inner.unary(Unary::Sign, &x[0]);
                let rest = x[1..].iter().map(|v| self.mul(&sign, v));
                std::iter::once(value()).chain(rest).collect()
            }
            Unary::Sqrt => self.sqrt(x),
            Unary::Exp => self.exp(x),
            Unary::Ln => {
                let slope = self.quotient(&self.constant(1.0), x);
                self.primitive(value(), x, &slope)
            }
            Unary::Sin => self.circular(x, Unary::Sin, Unary::Cos).0,
            Unary::Cos => self.circular(x, Unary::Sin, Unary::Cos).1,
            Unary::Sinh => self.circular(x, Unary::Sinh, Unary::Cosh).0,
            Unary::Cosh => self.circular(x, Unary::Sinh, Unary::Cosh).1,
            Unary::Tan | Unary::Tanh => self.tangent(op, x),
            Unary::Asin | Unary::Acos | Unary::Atan => {
                self.primitive(value(), x, &self.inverse_slope(op, x))
            }
        }
    }

    fn powi(&self, x: &Self::Value, n: i32) -> Self::Value {
        let value = self.inner.powi(&x[0], n);
        if x.len() == 1 || n == 0 || self.is_spent() {
            return vec![value];
        }
        let (mut square, mut left) = (x.clone(), n.unsigned_abs());
        let mut power = self.constant(1.0);
        while left > 0 {
            if left & 1 == 1 {
                power = self.product(&power, &square);
            }
            left >>= 1;
            if left > 0 {
                square = self.product(&square, &square);
            }
        }
        if n < 0 {
            power = self.quotient(&self.constant(1.0), &power);
        }
        power[0] = value;
        power
    }

    fn binary(&self, op: Binary, x: &Self::Value, y: &Self::Value) -> Self::Value {
        match op {
            _ if self.is_spent() => vec![self.two(op, &x[0], &y[0])],
            Binary::Add => self.add(x, y),
            Binary::Sub => self.sub(x, y),
            Binary::Mul => self.product(x, y),
            Binary::Div => self.quotient(x, y),
            Binary::Pow if x.len() == 1 && y.len() == 1 => vec![self.two(op, &x[0], &y[0])],
            Binary::Pow if y.len() == 1 => self.constant_power(x, &y[0]),
            Binary::Pow => {
                let mut power = self.exp(&self.product(y, &self.unary(Unary::Ln, x)));
                power[0] = self.two(op, &x[0], &y[0]);
                power
            }
            Binary::Atan2 if x.len() == 1 && y.len() == 1 => vec![self.two(op, &x[0], &y[0])],
            Binary::Atan2 => self.atan2(x, y),
            Binary::Min | Binary::Max => {
                let (low, high) = if op == Binary::Min { (x, y) } else { (y, x) };
                let first = self.two(Binary::LessEq, &low[0], &high[0]);
                let mut chosen = self.choose(&first, x, y);
                chosen[0] = self.two(op, &x[0], &y[0]);
                chosen
            }
            Binary::Less | Binary::LessEq | Binary::Equal | Binary::And | Binary::Or => {
                vec![self.two(op, &x[0], &y[0])]
            }
        }
    }

    fn select(&self, c: &Self::Value, x: &Self::Value, y: &Self::Value) -> Self::Value {
        self.choose(&c[0], x, y)
    }

    fn is_spent(&self) -> bool {
        self.inner.is_spent()
    }

    fn implicit(&self, function: &Implicit, p: &[Self::Value]) -> Vec<Self::Value> {
        self.root(function, p)
    }

    /// A₀ xₖ = bₖ − Σ_{j≥1} Aⱼ x_{k−j}.
    fn solve(&self, a: &[Self::Value], b: &[Self::Value]) -> (Vec<Self::Value>, Self::Value) {
        let n = b.len();
        let constant = self.is_spent() || a.iter().chain(b).all(|jet| jet.len() == 1);
        let a0: Vec<A::Value> = a.iter().map(|jet| jet[0].clone()).collect();
        let mut x: Vec<Self::Value> = vec![vec![]; n];
        let mut rcond = None;
        for k in 0..=if constant { 0 } else { self.order } {
            let right: Vec<A::Value> = (0..n)
                .map(|i| {
                    let known = (1..=k).flat_map(|j| (0..n).map(move |l| (j, l)));
                    let terms = known
                        .filter_map(|(j, l)| Some(self.mul(a[i * n + l].get(j)?, &x[l][k - j])));
                    self.difference(b[i].get(k), self.sum(terms))
                })
                .collect();
            let (xk, estimate) = self.inner.solve(&a0, &right);
            rcond.get_or_insert(estimate);
            for (jet, value) in x.iter_mut().zip(xk) {
                jet.push(value);
            }
        }
        (x, vec![rcond.unwrap_or_else(|| self.inner.constant(1.0))])
    }
}
