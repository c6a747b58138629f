//! Evaluation of tapes over Taylor models.

use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Algebra, Binary, Implicit, Interval, Jet, Jets, Unary};

use super::model::{Model, raised};
use super::ring::Ring;

/// The algebra of [`Model`]s with powers of τ up to `degree`.
///
/// Smooth functions are expanded around the constant part, with Lagrange's remainder over the whole
/// range. What bends or jumps within the range is enclosed by the two branches.
#[derive(Clone, Copy, Debug)]
pub(super) struct Models<'r> {
    pub ring: &'r Ring,
    pub degree: usize,
}

/// The Taylor coefficients of a function of one variable, from those of the variable.
type Series<'f> = &'f dyn Fn(&Jets<'_, Intervals>, &Jet<Interval>) -> Jet<Interval>;

impl Models<'_> {
    fn times(&self, x: &Model, y: &Model) -> Model {
        x.times(y, self.ring, self.degree)
    }

    fn number(&self, value: f64) -> Model {
        Model::constant(self.ring, value)
    }

    fn within(&self, range: Interval) -> Model {
        Model::within(self.ring, range)
    }

    fn range(&self, x: &Model) -> Interval {
        x.range(self.ring)
    }

    fn half(&self, x: &Model) -> Model {
        self.times(x, &self.number(0.5))
    }

    /// f(c + δ) = Σ f⁽ⁱ⁾(c)/i! δⁱ + f⁽ᵖ⁺¹⁾(ξ)/(p + 1)! δᵖ⁺¹ with ξ between c and c + δ.
    fn expanded(&self, x: &Model, f: Series<'_>) -> Model {
        let power = self.ring.order().max(self.degree);
        let centre = Interval::point(x.coefficients[0]);
        let coefficients = |at: Interval, order: usize| {
            let jets = Jets {
                inner: &Intervals,
                order,
            };
            f(&jets, &vec![at, Interval::ONE])
        };
        if x.is_number() {
            let value = coefficients(centre, 1);
            return self.within(value[0]);
        }
        let range = self.range(x).hull(centre);
        let all = coefficients(range, power + 1);
        if !range.is_bounded() {
            return Model::unknown(self.ring);
        }
        // where derivatives have no bounds, the values may have; where these have none, nothing has
        if !all.iter().all(|c| c.is_bounded()) {
            return self.within(all[0]);
        }
        let reach = (range - centre).magnitude();
        let rest = |power: usize| {
            let last = all.get(power + 1).copied().unwrap_or(Interval::ZERO);
            (Interval::point(reach).powi(power as i32 + 1) * last).magnitude()
        };
        // what rounding takes is not worth another power
        let enough = f64::EPSILON / 16.0 * all[0].magnitude();
        let power = (1..power)
            .find(|&power| rest(power) <= enough)
            .unwrap_or(power);
        let series = coefficients(centre, power);
        let mut offset = x.clone();
        offset.coefficients[0] = 0.0;
        let mut sum = self.number(0.0);
        for &coefficient in series.iter().rev() {
            sum = self.times(&sum, &offset).plus(&self.within(coefficient));
        }
        sum.rest = raised(sum.rest + rest(power), 2);
        sum
    }

    fn quotient(&self, x: &Model, y: &Model) -> Model {
        let one = vec![Interval::ONE];
        self.times(
            x,
            &self.expanded(y, &|jets, t| jets.binary(Binary::Div, &one, t)),
        )
    }

    fn power(&self, x: &Model, y: &Model) -> Model {
        if y.is_number() {
            let exponent = vec![Interval::point(y.coefficients[0])];
            return self.expanded(x, &|jets, t| jets.binary(Binary::Pow, t, &exponent));
        }
        let logarithm = self.unary(Unary::Ln, x);
        self.unary(Unary::Exp, &self.times(y, &logarithm))
    }

    /// |x|: where the sign is not known, a line from end to end and half the distance below it.
    fn abs(&self, x: &Model) -> Model {
        let range = self.range(x);
        match (range.lo() >= 0.0, range.hi() <= 0.0) {
            (true, _) => x.clone(),
            (_, true) => x.negated(),
            _ if !range.is_bounded() => Model::unknown(self.ring),
            _ => {
                let slope = (range.hi() + range.lo()) / (range.hi() - range.lo());
                let slope = slope.clamp(-1.0, 1.0);
                // |x| − slope·x lies between zero and its value at the higher end
                let end =
                    |x: f64, s: f64| Interval::point(x) * (Interval::ONE - Interval::point(s));
                let most = end(range.hi(), slope).hull(end(-range.lo(), -slope));
                let gap = Interval::ZERO.hull(most);
                self.times(x, &self.number(slope)).plus(&self.within(gap))
            }
        }
    }

    /// The value of either, of which it is not known which.
    fn either(&self, x: &Model, y: &Model) -> Model {
        let difference = self.half(&x.minus(y));
        let mut middle = self.half(&x.plus(y));
        middle.rest = raised(middle.rest + difference.norm() + difference.rest, 3);
        middle
    }

    /// (x + y ∓ |x − y|)/2
    fn smaller(&self, x: &Model, y: &Model) -> Model {
        let difference = x.minus(y);
        let range = self.range(&difference);
        match (range.hi() <= 0.0, range.lo() >= 0.0) {
            (true, _) => x.clone(),
            (_, true) => y.clone(),
            _ => self.half(&x.plus(y).minus(&self.abs(&difference))),
        }
    }

    fn angle(&self, y: &Model, x: &Model) -> Model {
        let right = Interval::PI * Interval::point(0.5);
        let of = |y: &Model, x: &Model| self.unary(Unary::Atan, &self.quotient(y, x));
        if self.range(x).is_positive() {
            of(y, x)
        } else if self.range(y).is_positive() {
            self.within(right).minus(&of(x, y))
        } else if self.range(y).is_negative() {
            self.within(-right).minus(&of(x, y))
        } else {
            self.within(self.range(y).atan2(self.range(x)))
        }
    }

    /// The estimate of condition of a matrix with this determinant: the ratio of the last to the first diagonal entry of R in
    /// A = QR with column pivots. The last is at least σ_n, the first at most ‖A‖_F, and the other singular values have a
    /// product of at most (‖A‖_F²/(n − 1))^((n−1)/2).
    fn condition(&self, a: &[Model], determinant: &Model, n: usize) -> Interval {
        let squares = a.iter().map(|a| self.powi(a, 2));
        let whole = squares.reduce(|sum, square| sum.plus(&square));
        let whole = whole
            .map_or(Interval::ZERO, |whole| self.range(&whole))
            .sqrt();
        let others = Interval::point(n as f64 - 1.0).powi(n as i32 - 1).sqrt();
        let least =
            Interval::point(self.range(determinant).mignitude()) * others / whole.powi(n as i32);
        let least = if least.is_bounded() { least.lo() } else { 0.0 };
        Interval::point(least.clamp(0.0, 1.0)).hull(Interval::ONE)
    }

    /// Gaussian elimination; a pivot that may be zero leaves nothing known. And the determinant but for its sign.
    fn eliminated(&self, a: &[Model], b: &[Model]) -> (Vec<Model>, Model) {
        let n = b.len();
        let mut determinant = self.number(1.0);
        let mut rows: Vec<Vec<Model>> = (0..n)
            .map(|i| a[i * n..][..n].iter().chain([&b[i]]).cloned().collect())
            .collect();
        for k in 0..n {
            let size = |i: &usize| rows[*i][k].coefficients[0].abs();
            let best = (k..n)
                .max_by(|i, j| size(i).total_cmp(&size(j)))
                .unwrap_or(k);
            rows.swap(k, best);
            determinant = self.times(&determinant, &rows[k][k]);
            let pivot: Vec<Model> = rows[k][k + 1..]
                .iter()
                .map(|x| self.quotient(x, &rows[k][k]))
                .collect();
            for i in (0..n).filter(|i| *i != k) {
                let factor = rows[i][k].clone();
                for (x, p) in rows[i][k + 1..].iter_mut().zip(&pivot) {
                    *x = x.minus(&self.times(&factor, p));
                }
            }
            rows[k].truncate(k + 1);
            rows[k].extend(pivot);
        }
        let found = rows.into_iter().filter_map(|mut row| row.pop());
        (found.collect(), determinant)
    }
}

impl Algebra for Models<'_> {
    type Value = Model;

    fn constant(&self, value: f64) -> Model {
        self.number(value)
    }

    fn unary(&self, op: Unary, x: &Model) -> Model {
        match op {
            Unary::Neg => x.negated(),
            Unary::Abs => self.abs(x),
            Unary::Sign | Unary::Floor | Unary::Not => {
                self.within(Intervals.unary(op, &self.range(x)))
            }
            _ => self.expanded(x, &|jets, t| jets.unary(op, t)),
        }
    }

    fn powi(&self, x: &Model, n: i32) -> Model {
        // the power 0 of what has no value has none
        if !x.rest.is_finite() {
            return Model::unknown(self.ring);
        }
        // a mere range: an even power is not negative
        if x.coefficients[1..].iter().all(|c| *c == 0.0) {
            return self.within(self.range(x).powi(n));
        }
        if n < 0 {
            return self.expanded(x, &|jets, t| jets.powi(t, n));
        }
        let (mut square, mut left) = (x.clone(), n);
        let mut power = self.number(1.0);
        while left > 0 {
            if left & 1 == 1 {
                power = self.times(&power, &square);
            }
            left >>= 1;
            if left > 0 {
                square = self.times(&square, &square);
            }
        }
        power
    }

    fn binary(&self, op: Binary, x: &Model, y: &Model) -> Model {
        match op {
            Binary::Add => x.plus(y),
            Binary::Sub => x.minus(y),
            Binary::Mul => self.times(x, y),
            Binary::Div => self.quotient(x, y),
            Binary::Pow => self.power(x, y),
            Binary::Atan2 => self.angle(x, y),
            Binary::Min => self.smaller(x, y),
            Binary::Max => self.smaller(&x.negated(), &y.negated()).negated(),
            Binary::Less | Binary::LessEq | Binary::Equal => {
                let difference = self.range(&x.minus(y));
                self.within(Intervals.binary(op, &difference, &Interval::ZERO))
            }
            Binary::And | Binary::Or => {
                self.within(Intervals.binary(op, &self.range(x), &self.range(y)))
            }
        }
    }

    fn select(&self, condition: &Model, x: &Model, y: &Model) -> Model {
        let truth = self.range(condition);
        if !truth.is_bounded() {
            Model::unknown(self.ring)
        } else if !truth.contains_zero() {
            x.clone()
        } else if truth.is_zero() {
            y.clone()
        } else {
            self.either(x, y)
        }
    }

    fn solve(&self, a: &[Model], b: &[Model]) -> (Vec<Model>, Model) {
        let (x, determinant) = self.eliminated(a, b);
        let rcond = self.condition(a, &determinant, b.len());
        (x, self.within(rcond))
    }

    fn implicit(&self, function: &Implicit, p: &[Model]) -> Vec<Model> {
        let ranges: Vec<Interval> = p.iter().map(|p| self.range(p)).collect();
        let roots = Intervals.implicit(function, &ranges);
        roots.into_iter().map(|root| self.within(root)).collect()
    }
}
