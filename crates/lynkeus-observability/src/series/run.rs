//! Coefficients and sensitivities, order by order.

use std::collections::BTreeMap;

use lynkeus_expr::{Budget, Spent};

use crate::series::functions::Function;
use crate::series::program::Step;
use crate::series::{Functions, Program};
use lynkeus_expr::modular::{Modular, Wide};

/// Why a run ended early.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stop {
    /// a division by zero, or a root that does not exist, at this random point: the slot
    Point(usize),
    /// the time is up
    Time,
    /// the memory is used up
    Memory,
}

impl Stop {
    /// Ends the work whose budget is spent.
    pub fn where_spent(budget: &Budget) -> Result<(), Self> {
        match budget.spent() {
            None => Ok(()),
            Some(Spent::Memory(_)) => Err(Stop::Memory),
            Some(_) => Err(Stop::Time),
        }
    }

    /// `time`, `memory` or `the point`.
    pub fn word(self) -> &'static str {
        match self {
            Stop::Time => "time",
            Stop::Memory => "memory",
            Stop::Point(_) => "the point",
        }
    }
}

/// Bytes of a series where nothing limits the memory.
const ROOM: usize = 1 << 30;

/// A program under evaluation.
pub(crate) struct Run<'a> {
    program: &'a Program,
    width: usize,
    slots: Vec<Series>,
    functions: Functions,
    budget: Budget,
    /// numbers that may still be stored
    room: usize,
}

impl<'a> Run<'a> {
    pub fn new(program: &'a Program, width: usize, functions: Functions, budget: &Budget) -> Self {
        Self {
            program,
            width,
            slots: vec![Series::default(); program.steps.len()],
            functions,
            budget: budget.clone(),
            room: budget.room().unwrap_or(ROOM) / size_of::<Modular>(),
        }
    }

    /// Computes the next coefficient of every slot. `symbol(place)` gives the symbols'
    /// coefficient of that order and its sensitivities (empty: none).
    pub fn advance(
        &mut self,
        symbol: &dyn Fn(usize) -> (Modular, Vec<Modular>),
    ) -> Result<(), Stop> {
        let k = self.slots.first().map_or(0, |s| s.values.len());
        let program = self.program;
        for (slot, step) in program.steps.iter().enumerate() {
            if slot % 64 == 0 {
                Stop::where_spent(&self.budget)?;
            }
            // the second of a pair is computed with the first
            if matches!(step, Step::Cos) {
                continue;
            }
            let (value, tangent) = match *step {
                Step::Constant(c) => (if k == 0 { c } else { Modular::ZERO }, vec![]),
                Step::Symbol(place) => symbol(place),
                Step::Sin(a) => {
                    self.pair(slot, a, k)?;
                    continue;
                }
                _ => self.rational(slot, *step, k)?,
            };
            self.store(slot, value, tangent)?;
        }
        Ok(())
    }

    /// The latest coefficient of a root with its sensitivities, none if nothing moves it.
    pub fn root(&self, i: usize) -> (Modular, Vec<Modular>) {
        let slot = self.program.roots[i];
        let series = &self.slots[slot];
        let last = series.values.len().saturating_sub(1);
        let mut tangent = Sum::default();
        if last < series.tangents.len() {
            self.add(&mut tangent, Modular::ONE, slot, last);
        }
        (
            series.values.get(last).copied().unwrap_or_default(),
            tangent.into_row(),
        )
    }

    fn store(&mut self, slot: usize, value: Modular, tangent: Vec<Modular>) -> Result<(), Stop> {
        let tangent = Row::new(tangent);
        let size = 1 + size_of::<Row>() / size_of::<Modular>() + tangent.size();
        self.room = self.room.checked_sub(size).ok_or(Stop::Memory)?;
        let series = &mut self.slots[slot];
        series.values.push(value);
        series.tangents.push(tangent);
        Ok(())
    }

    fn value(&self, slot: usize, k: usize) -> Modular {
        self.slots[slot].values[k]
    }

    /// sum += factor·(sensitivities of coefficient k)
    fn add(&self, sum: &mut Sum, factor: Modular, slot: usize, k: usize) {
        sum.add(factor, &self.slots[slot].tangents[k], self.width);
    }

    fn rational(
        &mut self,
        slot: usize,
        step: Step,
        k: usize,
    ) -> Result<(Modular, Vec<Modular>), Stop> {
        let one = Modular::ONE;
        let mut tangent = Sum::default();
        let value = match step {
            Step::Neg(a) => {
                self.add(&mut tangent, -one, a, k);
                -self.value(a, k)
            }
            Step::Add(a, b) => {
                self.add(&mut tangent, one, a, k);
                self.add(&mut tangent, one, b, k);
                self.value(a, k) + self.value(b, k)
            }
            Step::Sub(a, b) => {
                self.add(&mut tangent, one, a, k);
                self.add(&mut tangent, -one, b, k);
                self.value(a, k) - self.value(b, k)
            }
            Step::Mul(a, b) => self.product(&mut tangent, a, b, k),
            Step::Div(a, b) => self.quotient(&mut tangent, slot, a, b, k)?,
            Step::Sqrt(a) => self.root_of(&mut tangent, slot, a, k)?,
            Step::Integral { a, h, of } => self.integral(&mut tangent, slot, (a, h), of, k)?,
            _ => Modular::ZERO,
        };
        Ok((value, tangent.into_row()))
    }

    fn product(&self, tangent: &mut Sum, a: usize, b: usize, k: usize) -> Modular {
        let mut value = Modular::ZERO;
        for j in 0..=k {
            let (x, y) = (self.value(a, j), self.value(b, k - j));
            value = value + x * y;
            // of a square both halves are the same
            if a == b {
                self.add(tangent, y + y, a, j);
                continue;
            }
            self.add(tangent, y, a, j);
            self.add(tangent, x, b, k - j);
        }
        value
    }

    /// c = a/b from a = c·b.
    fn quotient(
        &self,
        tangent: &mut Sum,
        c: usize,
        a: usize,
        b: usize,
        k: usize,
    ) -> Result<Modular, Stop> {
        let inverse = self.value(b, 0).inverse().ok_or(Stop::Point(c))?;
        let mut value = self.value(a, k);
        self.add(tangent, Modular::ONE, a, k);
        for j in 0..k {
            value = value - self.value(c, j) * self.value(b, k - j);
            self.add(tangent, -self.value(b, k - j), c, j);
            self.add(tangent, -self.value(c, j), b, k - j);
        }
        let value = value * inverse;
        self.add(tangent, -value, b, 0);
        tangent.scale(inverse);
        Ok(value)
    }

    /// c = √a from a = c².
    fn root_of(&self, tangent: &mut Sum, c: usize, a: usize, k: usize) -> Result<Modular, Stop> {
        let sign = match self.functions.is_turned(c) {
            true => -Modular::ONE,
            false => Modular::ONE,
        };
        let mut value = sign * self.value(a, k);
        self.add(tangent, sign, a, k);
        let two = Modular::new(2);
        let missing = Stop::Point(c);
        if k == 0 {
            let root = value.root().ok_or(missing)?;
            let inverse = (two * root).inverse().ok_or(missing)?;
            tangent.scale(inverse);
            return Ok(root);
        }
        for j in 1..k {
            value = value - self.value(c, j) * self.value(c, k - j);
        }
        let inverse = (two * self.value(c, 0)).inverse().ok_or(missing)?;
        let value = value * inverse;
        for j in 0..k {
            let other = if j == 0 { value } else { self.value(c, k - j) };
            self.add(tangent, -two * other, c, j);
        }
        tangent.scale(inverse);
        Ok(value)
    }

    /// y_k from y' = h·a', with the coefficients of h below k: Σ j·a_j·h_{k−j}/k.
    fn integrated(&self, a: usize, h: usize, k: usize) -> Modular {
        let mut value = Modular::ZERO;
        for j in 1..=k {
            value = value + Modular::new(j as u64) * self.value(a, j) * self.value(h, k - j);
        }
        // there are fewer orders than elements of the field
        value * Modular::new(k as u64).inverse().unwrap_or_default()
    }

    /// dy = h·da
    fn chained(&self, tangent: &mut Sum, a: usize, h: &dyn Fn(usize) -> Modular, k: usize) {
        for j in 0..=k {
            self.add(tangent, h(k - j), a, j);
        }
    }

    /// The first value of a slot as a sum: e^(x + y + z) is a product of three, however many
    /// terms there are.
    fn terms(&self, slot: usize) -> Vec<Modular> {
        let mut open = BTreeMap::from([(slot, Modular::ONE)]);
        let mut terms = vec![];
        // operands come before what is made of them: each slot is opened once
        while let Some((slot, factor)) = open.pop_last() {
            let mut add = |slot: usize, factor: Modular| {
                let sum = open.entry(slot).or_default();
                *sum = *sum + factor;
            };
            match self.program.steps[slot] {
                Step::Neg(a) => add(a, -factor),
                Step::Add(a, b) => {
                    add(a, factor);
                    add(b, factor);
                }
                Step::Sub(a, b) => {
                    add(a, factor);
                    add(b, -factor);
                }
                Step::Mul(a, b) if self.is_constant(a) => add(b, factor * self.value(a, 0)),
                Step::Mul(a, b) if self.is_constant(b) => add(a, factor * self.value(b, 0)),
                _ => terms.push(factor * self.value(slot, 0)),
            }
        }
        terms
    }

    fn is_constant(&self, slot: usize) -> bool {
        matches!(self.program.steps[slot], Step::Constant(_))
    }

    fn integral(
        &mut self,
        tangent: &mut Sum,
        slot: usize,
        (a, h): (usize, usize),
        of: Function,
        k: usize,
    ) -> Result<Modular, Stop> {
        let value = match k {
            0 => self.first_value(slot, (a, h), of)?,
            _ => self.integrated(a, h, k),
        };
        // the exponential is its own derivative: of that the last coefficient is this one
        let of_h = |j: usize| match (h, j) == (slot, k) {
            true => value,
            false => self.value(h, j),
        };
        self.chained(tangent, a, &of_h, k);
        Ok(value)
    }

    /// The first value, from the argument and the derivative there.
    fn first_value(
        &mut self,
        slot: usize,
        (a, h): (usize, usize),
        of: Function,
    ) -> Result<Modular, Stop> {
        let argument = self.value(a, 0);
        Ok(match of {
            Function::Exponential => self.functions.exponential(&self.terms(a)),
            // one has its powers and roots, or need not
            Function::Logarithm if argument.is_positive() || self.functions.is_turned(slot) => {
                self.functions.logarithm(argument)
            }
            Function::Logarithm => return Err(Stop::Point(slot)),
            // 1/√(1 − a²) has the cosine below, 1/(1 + a²) is its square
            Function::Arcsine => {
                let is_cosine = |c: &Modular| *c * *c + argument * argument == Modular::ONE;
                let cosine = self.value(h, 0).inverse().filter(is_cosine);
                self.functions.arc(of, argument, cosine)
            }
            Function::Arctangent => {
                let cosine = self.value(h, 0).root();
                self.functions.arc(of, argument, cosine)
            }
        })
    }

    /// s' = c·a', c' = −s·a'
    fn pair(&mut self, s: usize, a: usize, k: usize) -> Result<(), Stop> {
        let c = s + 1;
        let (x, y) = match k {
            0 => self.functions.angle(&self.terms(a)),
            _ => (self.integrated(a, c, k), -self.integrated(a, s, k)),
        };
        let (mut dx, mut dy) = (Sum::default(), Sum::default());
        let cosine = |j: usize| if j == k { y } else { self.value(c, j) };
        let sine = |j: usize| -(if j == k { x } else { self.value(s, j) });
        self.chained(&mut dx, a, &cosine, k);
        self.chained(&mut dy, a, &sine, k);
        self.store(s, x, dx.into_row())?;
        self.store(c, y, dy.into_row())
    }
}

/// Coefficients of one slot with their sensitivities.
#[derive(Clone, Debug, Default)]
pub(super) struct Series {
    pub values: Vec<Modular>,
    /// per order one row of sensitivities; empty for what no unknown moves
    pub tangents: Vec<Row>,
}

/// A row of sensitivities; most quantities of a large model feel few of its unknowns.
#[derive(Clone, Debug)]
pub(super) enum Row {
    Dense(Vec<Modular>),
    /// (column, what is not zero there)
    Sparse(Vec<(usize, Modular)>),
}

impl Row {
    pub fn new(row: Vec<Modular>) -> Self {
        let filled = row.iter().filter(|x| !x.is_zero()).count();
        if 3 * filled > row.len() {
            return Row::Dense(row);
        }
        let entries = row.into_iter().enumerate();
        // collected anew: a list filtered in place would keep the row's memory
        let mut sparse = Vec::with_capacity(filled);
        sparse.extend(entries.filter(|(_, x)| !x.is_zero()));
        Row::Sparse(sparse)
    }

    /// In numbers of the field.
    pub fn size(&self) -> usize {
        match self {
            Row::Dense(row) => row.len(),
            Row::Sparse(row) => 2 * row.len(),
        }
    }

    pub fn is_empty(&self) -> bool {
        self.size() == 0
    }

    /// sum += factor·row
    fn add_to(&self, sum: &mut [Wide], factor: Modular) {
        match self {
            Row::Dense(row) => {
                for (s, r) in sum.iter_mut().zip(row) {
                    s.add_product(factor, *r);
                }
            }
            Row::Sparse(row) => {
                for &(column, r) in row {
                    if let Some(s) = sum.get_mut(column) {
                        s.add_product(factor, r);
                    }
                }
            }
        }
    }
}

/// A combination of rows, reduced where it has to be.
#[derive(Debug, Default)]
pub(super) struct Sum {
    wide: Vec<Wide>,
    products: usize,
}

impl Sum {
    /// Adds factor·row, of that many columns.
    pub fn add(&mut self, factor: Modular, row: &Row, width: usize) {
        if row.is_empty() || factor.is_zero() {
            return;
        }
        if self.wide.is_empty() {
            self.wide.resize(width, Wide::default());
        }
        self.products += 1;
        if self.products >= Wide::PRODUCTS {
            self.wide.iter_mut().for_each(|x| *x = x.folded());
            // what was folded counts as one
            self.products = 2;
        }
        row.add_to(&mut self.wide, factor);
    }

    pub fn scale(&mut self, factor: Modular) {
        for x in &mut self.wide {
            *x = Wide::from(x.value() * factor);
        }
        self.products = 1;
    }

    pub fn into_row(self) -> Vec<Modular> {
        self.wide.into_iter().map(Wide::value).collect()
    }
}
