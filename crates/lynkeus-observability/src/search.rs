//! The rank of the outputs' coefficients at one random point, order by order.

use std::time::Instant;

use crate::echelon::Echelon;
use crate::field::{Modular, Random};
use crate::invariance::symmetries;
use crate::local::{Model, Role, Symbol};
use crate::series::{Run, Stop};
use crate::{Answer, Asked, Question, Verdict};

/// A point, the series there and the rank so far.
pub(crate) struct Search<'a> {
    model: &'a Model,
    run: Run<'a>,
    random: Random,
    width: usize,
    highest: usize,
    /// per symbol: its latest coefficient with sensitivities
    coefficients: Vec<(Modular, Vec<Modular>)>,
    rows: Echelon,
    /// gradients of the expressions asked about, at the start
    about: Vec<Vec<Modular>>,
    /// values of the named quantities at the start
    point: Vec<Modular>,
    order: usize,
}

impl<'a> Search<'a> {
    pub fn new(model: &'a Model, question: &Question, seed: u64, deadline: Instant) -> Self {
        let named = model.named.len();
        // as many derivatives as unknowns decide; each brings a further unknown
        // coefficient of every unknown input
        let highest = named.max(1);
        let width = named + model.unknown_inputs * highest;
        let random = Random::new(seed.wrapping_mul(0x1000_0000_01b3) + 7);
        let room = question.limits.memory / size_of::<Modular>();
        Self {
            run: Run::new(
                &model.program,
                width,
                Random::new(seed + 0x9e37),
                deadline,
                room,
            ),
            coefficients: vec![(Modular::ZERO, vec![]); model.symbols.len()],
            rows: Echelon::new(width),
            about: vec![],
            point: vec![Modular::ZERO; named],
            order: 0,
            model,
            random,
            width,
            highest,
        }
    }

    /// Adds orders until the answer no longer changes.
    pub fn run(&mut self) -> Result<(), Stop> {
        let targets = self.model.named.len();
        for k in 0..=self.highest {
            self.next_coefficients(k)?;
            let coefficients = std::mem::take(&mut self.coefficients);
            let advanced = self.run.advance(&|place| coefficients[place].clone());
            self.coefficients = coefficients;
            advanced?;
            self.order = k;
            let before = self.rows.rank();
            for output in 0..self.model.outputs {
                let (_, row) = self.run.root(self.model.states + output);
                let row = row.to_vec();
                self.rows.add(&row);
            }
            if k == 0 {
                let first = self.model.states + self.model.outputs;
                let gradient = |i: usize| self.run.root(first + i).1.to_vec();
                self.about = (0..self.model.about).map(gradient).collect();
            }
            let settled = self.model.generic && self.model.unknown_inputs == 0;
            let complete = self.rows.rank() >= targets && self.sees_all();
            if complete || settled && self.rows.rank() == before {
                break;
            }
        }
        Ok(())
    }

    fn unit(&self, column: usize) -> Vec<Modular> {
        let mut unit = vec![Modular::ZERO; self.width];
        unit[column] = Modular::ONE;
        unit
    }

    fn sees_all(&self) -> bool {
        (0..self.model.named.len()).all(|column| self.rows.contains(&self.unit(column)))
    }

    /// Coefficient k of every symbol: of states from the derivative's last one.
    fn next_coefficients(&mut self, k: usize) -> Result<(), Stop> {
        let model = self.model;
        let named = model.named.len();
        let mut unknown_input = 0;
        for (place, symbol) in model.symbols.iter().enumerate() {
            self.coefficients[place] = match symbol.role {
                Role::State(i) if k > 0 => {
                    let inverse = Modular::new(k as u64).inverse().ok_or(Stop::Point)?;
                    let (value, row) = self.run.root(i);
                    (value * inverse, row.iter().map(|x| *x * inverse).collect())
                }
                Role::State(_) | Role::Constant => self.start(symbol, k),
                Role::Known => (self.random.element(), vec![]),
                Role::Zero => (Modular::ZERO, vec![]),
                Role::Unknown => {
                    let later = named + unknown_input * self.highest + k.saturating_sub(1);
                    unknown_input += 1;
                    let column = if k == 0 { symbol.column } else { Some(later) };
                    let value = self.random.element();
                    match column.filter(|c| *c < self.width) {
                        Some(column) => {
                            if k == 0 {
                                self.point[column] = value;
                            }
                            (value, self.unit(column))
                        }
                        None => (value, vec![]),
                    }
                }
                Role::Time => match k {
                    0 => (self.random.element(), vec![]),
                    1 => (Modular::ONE, vec![]),
                    _ => (Modular::ZERO, vec![]),
                },
            };
        }
        Ok(())
    }

    fn start(&mut self, symbol: &Symbol, k: usize) -> (Modular, Vec<Modular>) {
        if k > 0 {
            return (Modular::ZERO, vec![]);
        }
        let value = symbol.start.unwrap_or_else(|| self.random.element());
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
        let functions = &self.model.program.functions;
        let method = match functions.is_empty() {
            true => "exact arithmetic in a prime field at a random point: \"observable\" is certain, \"unobservable\" is wrong with a probability below 1e-12".to_owned(),
            false => format!(
                "exact arithmetic in a prime field at a random point; {} enter through their differential equations, as quantities without algebraic relations to the rest",
                functions.join(", ")
            ),
        };
        let limit = stop.map(|stop| {
            let what = match stop {
                Stop::Memory => "memory",
                _ => "time",
            };
            format!("the limit of {what} struck after {} derivatives of the outputs: what is called observable is so, the rest is undecided", self.order)
        });
        std::iter::once(method).chain(limit).collect()
    }
}
