//! The rank of the outputs' coefficients at one random point, order by order.

use std::time::Instant;

use crate::echelon::Echelon;
use crate::field::{Modular, Random};
use crate::invariance::symmetries;
use crate::local::{Model, Role, Symbol};
use crate::series::{Functions, Run, Stop};
use crate::start::Start;
use crate::{Answer, Asked, Limits, Question, Verdict};

/// A point, the series there and the rank so far.
pub(crate) struct Search<'a> {
    model: &'a Model,
    run: Run<'a>,
    /// coefficients of signals
    random: Random,
    start: &'a Start,
    width: usize,
    highest: usize,
    /// the rank at which nothing more can come, where that is known
    enough: Option<usize>,
    /// per symbol: its latest coefficient with sensitivities
    coefficients: Vec<(Modular, Vec<Modular>)>,
    rows: Echelon,
    /// the rows' part in the columns of unknown inputs
    signals: Echelon,
    /// gradients of the expressions asked about, at the start
    about: Vec<Vec<Modular>>,
    /// values of the named quantities at the start
    point: Vec<Modular>,
    order: usize,
    /// no later derivative can change the answer
    closed: bool,
}

impl<'a> Search<'a> {
    pub fn new(model: &'a Model, limits: Limits, start: &'a Start, deadline: Instant) -> Self {
        let named = model.named.len();
        let highest = start.highest(model);
        let width = named + model.unknown_inputs * highest;
        let room = limits.memory / size_of::<Modular>();
        let functions = Functions::new(start.seed, &start.turned);
        Self {
            run: Run::new(&model.program, width, functions, deadline, room),
            coefficients: vec![(Modular::ZERO, vec![]); model.symbols.len()],
            rows: Echelon::new(width),
            signals: Echelon::new(width),
            about: vec![],
            point: vec![Modular::ZERO; named],
            order: 0,
            closed: false,
            enough: None,
            random: Random::new(start.seed.wrapping_mul(0x1000_0000_01b3) + 7),
            start,
            model,
            width,
            highest,
        }
    }

    /// The rank at which nothing more can come.
    pub fn expect(&mut self, rank: Option<usize>) {
        self.enough = rank;
    }

    pub fn rank(&self) -> usize {
        self.rows.rank()
    }

    /// Adds orders until the answer can no longer change, or there are no more.
    pub fn run(&mut self) -> Result<(), Stop> {
        for k in 0..=self.highest {
            self.next_coefficients(k);
            let coefficients = std::mem::take(&mut self.coefficients);
            let advanced = self.run.advance(&|place| coefficients[place].clone());
            self.coefficients = coefficients;
            advanced?;
            self.order = k;
            let before = self.settled();
            self.add_outputs();
            if k == 0 {
                let first = self.model.states + self.model.outputs;
                let gradient = |i: usize| self.run.root(first + i).1;
                self.about = (0..self.model.about).map(gradient).collect();
            }
            self.closed = self.complete()
                || self.enough.is_some_and(|enough| self.rows.rank() >= enough)
                || self.start.is_generic(self.model) && k > 0 && self.settled() == before;
            if self.closed {
                return Ok(());
            }
        }
        // at a generic point the states' and parameters' number of orders is enough
        self.closed = self.start.is_generic(self.model);
        Ok(())
    }

    /// The rank of what is seen of states and parameters whatever the unknown inputs do.
    /// Derivatives of it, with those of the outputs, give all of the next order's: at a
    /// generic point, what did not grow once never grows.
    fn settled(&self) -> usize {
        self.rows.rank() - self.signals.rank()
    }

    fn add_outputs(&mut self) {
        let named = self.model.named.len();
        let first = named - self.model.unknown_inputs;
        for output in 0..self.model.outputs {
            let mut row = self.run.root(self.model.states + output).1;
            self.rows.add(&row);
            if self.model.unknown_inputs > 0 {
                row.iter_mut().take(first).for_each(|x| *x = Modular::ZERO);
                self.signals.add(&row);
            }
        }
    }

    /// Whether everything is observable: then nothing more can be learnt.
    fn complete(&self) -> bool {
        let named = self.model.named.len();
        self.rows.rank() >= named
            && (self.model.unknown_inputs == 0
                || (0..named).all(|column| self.rows.contains(&self.unit(column))))
    }

    fn unit(&self, column: usize) -> Vec<Modular> {
        let mut unit = vec![Modular::ZERO; self.width];
        unit[column] = Modular::ONE;
        unit
    }

    /// The first coefficients alone: whether the point is a good one.
    pub fn first(&mut self) -> Result<(), Stop> {
        self.next_coefficients(0);
        let coefficients = std::mem::take(&mut self.coefficients);
        self.run.advance(&|place| (coefficients[place].0, vec![]))
    }

    /// Coefficient k of every symbol: of states from the derivative's last one.
    fn next_coefficients(&mut self, k: usize) {
        let model = self.model;
        let mut unknown_input = 0;
        for (place, symbol) in model.symbols.iter().enumerate() {
            self.coefficients[place] = match symbol.role {
                _ if k == 0 => self.start(place, symbol),
                Role::State(i) => {
                    let inverse = Modular::new(k as u64).inverse().unwrap_or_default();
                    let (value, row) = self.run.root(i);
                    (value * inverse, row.iter().map(|x| *x * inverse).collect())
                }
                Role::Known => (self.random.element(), vec![]),
                Role::Time if k == 1 => (Modular::ONE, vec![]),
                Role::Constant | Role::Zero | Role::Time => (Modular::ZERO, vec![]),
                Role::Unknown => {
                    let column = model.named.len() + unknown_input * self.highest + k - 1;
                    unknown_input += 1;
                    (self.random.element(), self.unit(column))
                }
            };
        }
    }

    fn start(&mut self, place: usize, symbol: &Symbol) -> (Modular, Vec<Modular>) {
        let value = match symbol.role {
            Role::Zero => Modular::ZERO,
            _ => self.start.value(place, symbol),
        };
        match symbol.column {
            Some(column) => {
                self.point[column] = value;
                (value, self.unit(column))
            }
            None => (value, vec![]),
        }
    }

    /// Directions of the named quantities that the outputs do not see, each with the
    /// column that moves in no other of them, and the point.
    pub fn hidden(&self) -> (Vec<(usize, Vec<Modular>)>, &[Modular]) {
        let named = self.model.named.len();
        let mut hidden = Echelon::new(named);
        for direction in self.rows.kernel() {
            hidden.add(&direction[..named]);
        }
        (hidden.reduced_rows(), &self.point)
    }

    /// The verdicts.
    pub fn answer(&self, question: &Question, stop: Option<Stop>, deadline: Instant) -> Answer {
        let decided = |row: &[Modular]| match (self.rows.contains(row), stop) {
            (true, _) => Verdict::Observable,
            (false, None) => Verdict::Unobservable,
            (false, Some(_)) => Verdict::Undecided,
        };
        let quantities = self
            .model
            .named
            .iter()
            .enumerate()
            .map(|(column, (name, kind))| {
                let verdict = decided(&self.unit(column));
                let name = name.clone();
                (Asked { name, verdict }, *kind)
            });
        let about = question
            .about
            .iter()
            .zip(&self.about)
            .map(|(name, row)| Asked {
                name: name.clone(),
                verdict: decided(row),
            });
        let mut about: Vec<Asked> = about.collect();
        let unread = question.about.iter().skip(about.len());
        about.extend(unread.map(|name| Asked {
            name: name.clone(),
            verdict: Verdict::Undecided,
        }));
        Answer {
            quantities: quantities.collect(),
            about,
            symmetries: match stop {
                None => symmetries(self.model, question, self, deadline),
                Some(_) => vec![],
            },
            order: self.order,
            rank: self.rows.rank(),
            unknowns: self.model.named.len() + self.model.unknown_inputs * self.order,
            notes: self.notes(stop),
        }
    }

    fn notes(&self, stop: Option<Stop>) -> Vec<String> {
        let mut notes = vec![self.method()];
        if let Some(stop) = stop {
            let what = stop.word();
            notes.push(format!("the limit of {what} struck after {} derivatives of the outputs: what is called observable is so, the rest is undecided", self.order));
        } else if !self.closed {
            notes.push(format!("start values are given: {} derivatives of the outputs were taken, and what would first show in a later one is missed", self.order));
        }
        notes
    }

    fn method(&self) -> String {
        let functions = &self.model.program.functions;
        match functions.is_empty() {
            true => "exact arithmetic in a prime field at a random point: \"observable\" is certain, \"unobservable\" is wrong with a probability below 1e-12".to_owned(),
            false => format!(
                "exact arithmetic in a prime field at a random point; {} enter through their differential equations, with values drawn at random that keep the usual identities",
                functions.join(", ")
            ),
        }
    }
}
