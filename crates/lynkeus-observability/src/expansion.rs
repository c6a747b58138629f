//! The power series of a model's solution from one point, order by order.

use std::collections::BTreeSet;
use std::ops::Range;

use crate::model::{First, Model, Role};
use crate::series::{Functions, Run, Stop};
use lynkeus_expr::modular::{Modular, Random, unit};

/// The unknowns with respect to which a series is differentiated, as columns: the named
/// quantities, the derivatives of unknown inputs, directions in which known starts move.
#[derive(Clone, Debug)]
pub(crate) struct Columns {
    pub named: usize,
    unknown_inputs: usize,
    /// derivatives of the unknown inputs
    orders: usize,
    moving: Affine,
}

impl Columns {
    /// For series of at most that order.
    pub fn new(model: &Model, orders: usize) -> Self {
        Self {
            named: model.named.len(),
            unknown_inputs: model.unknown_inputs,
            orders: if model.unknown_inputs > 0 { orders } else { 0 },
            moving: vec![],
        }
    }

    /// The same and one column for each direction of a set.
    pub fn moving(self, set: &Affine) -> Self {
        let moving = set.clone();
        Self { moving, ..self }
    }

    pub fn width(&self) -> usize {
        self.named + self.unknown_inputs * self.orders + self.moving.len()
    }

    /// The columns of the unknown inputs' k-th derivatives.
    pub fn of_inputs(&self, k: usize) -> Range<usize> {
        let first = match k {
            0 => self.named - self.unknown_inputs,
            k => self.named + self.unknown_inputs * (k - 1),
        };
        first..first + self.unknown_inputs
    }

    /// All columns of unknown inputs and their derivatives.
    pub fn inputs(&self) -> Range<usize> {
        let first = self.named - self.unknown_inputs;
        first..first + self.unknown_inputs * (self.orders + 1)
    }

    pub fn unit(&self, column: usize) -> Vec<Modular> {
        unit(self.width(), column)
    }
}

/// The series at one start.
pub(crate) struct Expansion<'a> {
    model: &'a Model,
    start: &'a Start,
    pub columns: Columns,
    run: Run<'a>,
    /// coefficients of signals
    random: Random,
    /// starts that are expressions in the parameters
    computed: Run<'a>,
    /// per symbol: its latest coefficient with sensitivities
    coefficients: Vec<(Modular, Vec<Modular>)>,
    /// values of the named quantities at the start
    pub point: Vec<Modular>,
    next: usize,
}

impl<'a> Expansion<'a> {
    pub fn new(model: &'a Model, start: &'a Start, columns: Columns) -> Self {
        let functions = Functions::new(start.seed, &start.turned);
        let width = columns.width();
        let none = Functions::new(start.seed, &Default::default());
        Self {
            run: Run::new(&model.program, width, functions, &model.budget),
            computed: Run::new(&model.starts, width, none, &model.budget),
            coefficients: vec![(Modular::ZERO, vec![]); model.symbols.len()],
            point: vec![Modular::ZERO; columns.named],
            random: Random::new(start.seed.wrapping_mul(0x1000_0000_01b3) + 7),
            next: 0,
            columns,
            start,
            model,
        }
    }

    /// Computes the next coefficient of everything.
    pub fn advance(&mut self) -> Result<(), Stop> {
        self.next_coefficients()?;
        self.run.advance(&|place| self.coefficients[place].clone())
    }

    /// The first coefficients without sensitivities: whether the start is a good one.
    pub fn first(&mut self) -> Result<(), Stop> {
        self.next_coefficients()?;
        self.run
            .advance(&|place| (self.coefficients[place].0, vec![]))
    }

    /// The latest coefficient of a root, as the derivative of the state of that number is one, with its sensitivities.
    pub fn root(&self, root: usize) -> (Modular, Vec<Modular>) {
        self.run.root(root)
    }

    /// Sensitivities of the latest coefficient of a symbol; empty where nothing moves it.
    pub fn symbol(&self, place: usize) -> &[Modular] {
        &self.coefficients[place].1
    }

    /// Sensitivities of the latest coefficient of an output.
    pub fn output(&self, output: usize) -> Vec<Modular> {
        self.root(self.model.states + output).1
    }

    /// Sensitivities of the latest coefficient of an expression asked about.
    pub fn about(&self, expression: usize) -> Vec<Modular> {
        let first = self.model.states + self.model.outputs;
        self.root(first + expression).1
    }

    /// The next coefficient of every symbol: of states from the derivative's last one.
    fn next_coefficients(&mut self) -> Result<(), Stop> {
        let k = self.next;
        self.next += 1;
        if k == 0 {
            // a row for every symbol
            let numbers = self
                .columns
                .width()
                .saturating_mul(self.model.symbols.len());
            let budget = &self.model.budget;
            budget.affords(numbers.saturating_mul(size_of::<Modular>()));
            Stop::where_spent(budget)?;
            return self.first_coefficients();
        }
        let mut unknown_input = 0;
        for (place, symbol) in self.model.symbols.iter().enumerate() {
            self.coefficients[place] = match symbol.role {
                Role::State(i) => {
                    let inverse = Modular::new(k as u64).inverse().unwrap_or_default();
                    let (value, row) = self.run.root(i);
                    (value * inverse, row.iter().map(|x| *x * inverse).collect())
                }
                Role::Known => (self.random.element(), vec![]),
                Role::Time if k == 1 => (Modular::ONE, vec![]),
                Role::Constant | Role::Zero | Role::Time => (Modular::ZERO, vec![]),
                Role::Unknown => {
                    let column = self.columns.of_inputs(k).start + unknown_input;
                    unknown_input += 1;
                    (self.random.element(), self.columns.unit(column))
                }
            };
        }
        Ok(())
    }

    fn first_coefficients(&mut self) -> Result<(), Stop> {
        self.constants();
        let computed = self
            .computed
            .advance(&|place| self.coefficients[place].clone());
        // no number of the search can mend a start that is not defined
        computed.map_err(|stop| match stop {
            Stop::Point(_) => Stop::Point(usize::MAX),
            stop => stop,
        })?;
        let roots = 0..self.model.starts.roots();
        let (values, rows): (Vec<_>, Vec<_>) = roots.map(|i| self.computed.root(i)).unzip();
        for (place, symbol) in self.model.symbols.iter().enumerate() {
            let value = self.start.value(self.model, place, &values);
            let row = match (symbol.column, symbol.first) {
                (Some(column), _) => self.columns.unit(column),
                (None, First::Computed(i)) => self.moved(place, rows[i].clone()),
                (None, _) => self.moved(place, vec![]),
            };
            if let Some(column) = symbol.column {
                self.point[column] = value;
            }
            self.coefficients[place] = (value, row);
        }
        Ok(())
    }

    /// What starts are computed from.
    fn constants(&mut self) {
        for (place, symbol) in self.model.symbols.iter().enumerate() {
            let row = symbol.column.map(|column| self.columns.unit(column));
            let value = self.start.value(self.model, place, &[]);
            self.coefficients[place] = (value, row.unwrap_or_default());
        }
    }

    /// A row of sensitivities with those to the directions in which known starts move.
    fn moved(&self, place: usize, mut row: Vec<Modular>) -> Vec<Modular> {
        let first = self.columns.width() - self.columns.moving.len();
        for (i, direction) in self.columns.moving.iter().enumerate() {
            if !direction[place].is_zero() {
                row.resize(self.columns.width(), Modular::ZERO);
                row[first + i] = direction[place];
            }
        }
        row
    }
}

/// An affine set c + span(d₁, d₂, …) in the coordinates of the model's symbols, by its directions: c are the known
/// starts; what is free is free in it as well.
pub(crate) type Affine = Vec<Vec<Modular>>;

/// Where a series starts: random numbers, redrawn one by one where they do not suit.
#[derive(Clone, Debug)]
pub(crate) struct Start {
    pub seed: u64,
    /// how often each symbol, then each direction of the set, was drawn anew
    draws: Vec<u64>,
    /// roots and logarithms of numbers that have none in this field
    pub turned: BTreeSet<usize>,
    /// the known starts are those of a random point of this set
    set: Affine,
    /// time starts at zero, and not at any moment
    pub at_zero: bool,
}

impl Start {
    /// The known starts as given.
    pub fn new(model: &Model, seed: u64) -> Self {
        Self {
            seed,
            draws: vec![0; model.symbols.len()],
            turned: BTreeSet::new(),
            set: vec![],
            at_zero: false,
        }
    }

    /// Time starts at zero.
    pub fn at_zero(self, at_zero: bool) -> Self {
        Self { at_zero, ..self }
    }

    /// The same numbers for another branch of the model, whose roots and logarithms are others.
    pub fn elsewhere(&self) -> Self {
        Self {
            turned: BTreeSet::new(),
            ..self.clone()
        }
    }

    /// Whether it has the same numbers.
    pub fn is_at(&self, other: &Self) -> bool {
        (self.seed, &self.draws) == (other.seed, &other.draws)
    }

    /// The known starts anywhere in a set.
    pub fn within(self, model: &Model, set: &Affine) -> Self {
        Self {
            draws: vec![0; model.symbols.len() + set.len()],
            set: set.clone(),
            ..self
        }
    }

    /// The number that belongs to a draw.
    fn drawn(&self, draw: usize) -> Modular {
        let again = self.draws.get(draw).copied().unwrap_or_default();
        let stream = self.seed.wrapping_mul(0x1000_0000_01b3) ^ (draw as u64) << 32;
        Random::new(stream.wrapping_add(again)).element()
    }

    /// A square for what is positive at the reference point, the negative of one for what is
    /// negative: with the signs of numbers, √(x²) is x where x is positive, and log x exists.
    fn free(&self, place: usize, negative: bool) -> Modular {
        let root = self.drawn(place);
        match negative {
            true => -(root * root),
            false => root * root,
        }
    }

    /// The first value of a symbol, `computed` being the values of starts that are
    /// expressions.
    pub fn value(&self, model: &Model, place: usize, computed: &[Modular]) -> Modular {
        let symbol = &model.symbols[place];
        let base = match (symbol.role, symbol.first) {
            (Role::Zero, _) => Modular::ZERO,
            (Role::Time, _) if self.at_zero => Modular::ZERO,
            (_, First::Given(value)) => value,
            (_, First::Computed(i)) => computed.get(i).copied().unwrap_or_default(),
            (_, First::Free) => self.free(place, symbol.negative),
        };
        base + self.moved_by(model, place)
    }

    /// How far the point of the set is from the known start.
    pub fn moved_by(&self, model: &Model, place: usize) -> Modular {
        let directions = self.set.iter().enumerate();
        directions.fold(Modular::ZERO, |sum, (i, direction)| {
            match direction[place].is_zero() {
                true => sum,
                false => sum + direction[place] * self.drawn(model.symbols.len() + i),
            }
        })
    }

    /// The draws on which the first value of a symbol depends.
    fn draws_of(&self, model: &Model, place: usize) -> Vec<usize> {
        let symbol = &model.symbols[place];
        let free = match symbol.role {
            Role::Zero => false,
            Role::Time => !self.at_zero,
            _ => matches!(symbol.first, First::Free),
        };
        let directions = self.set.iter().enumerate();
        let moving = directions.filter(|(_, direction)| !direction[place].is_zero());
        let moving = moving.map(|(i, _)| model.symbols.len() + i);
        free.then_some(place).into_iter().chain(moving).collect()
    }

    /// Draws a number anew that a slot depends on, if possible one that no earlier
    /// slot with a domain depends on; false if there is none.
    pub fn redraw(&mut self, model: &Model, failed: usize, random: &mut Random) -> bool {
        let free = |slot: usize| -> BTreeSet<usize> {
            let support = model.program.support(slot);
            let draws = support.into_iter();
            draws
                .flat_map(|place| self.draws_of(model, place))
                .collect()
        };
        let of = free(failed);
        let partial = model.program.partial();
        let earlier: BTreeSet<usize> = partial
            .filter(|slot| *slot < failed)
            .flat_map(free)
            .collect();
        let fresh: Vec<usize> = of.difference(&earlier).copied().collect();
        let among: Vec<usize> = match fresh.is_empty() {
            true => of.into_iter().collect(),
            false => fresh,
        };
        let Some(&draw) = among.get(random.below(among.len())) else {
            return false;
        };
        self.draws[draw] += 1;
        true
    }
}
