//! Random and adversarial plants, with studies that ask for a claim about them.

mod forms;
mod implicit;
mod settings;
mod terms;

use super::case::{Asked, Case, Input, Kind, Role, Side, number};
use crate::numbers::Numbers;
use terms::{Reads, round};

/// The case of that number.
pub fn case(numbers: &mut Numbers, kind: Kind) -> Case {
    let mut draft = Draft::new(numbers);
    let mut case = match kind {
        Kind::Triangular => draft.chains(kind, false),
        Kind::BlockTriangular => draft.chains(kind, true),
        Kind::Designed => {
            let across = draft.numbers.chance(0.4);
            draft.chains(kind, across)
        }
        Kind::StateAffine => draft.blocks(),
        Kind::DriftObservable => draft.free(),
        Kind::UnknownInput => draft.layers(),
        Kind::Filter => draft.followed(),
    };
    draft.unmeasured(&mut case);
    draft.hostile(&mut case);
    draft.implicit(&mut case);
    let is_filter = kind == Kind::Filter;
    if is_filter || draft.numbers.chance(TUBES) {
        // a filter's tube has many more dimensions
        let most = if is_filter { (0.1, 2.0) } else { (0.4, 8.0) };
        case.tube = Some(asked(draft.numbers, &case, most));
    }
    settings::choose(draft.numbers, &mut case);
    if !is_filter && draft.numbers.chance(FOLLOWED) {
        settings::followed(draft.numbers, &mut case);
    }
    case
}

/// The share of the studies that ask for a tube, and of those of them that say along which samples.
const TUBES: f64 = 0.3;
const FOLLOWED: f64 = 0.7;

/// Where the plant may start, about the middle of the box, and for how long: unknown constants where they are declared,
/// or in a part of that.
fn asked(numbers: &mut Numbers, case: &Case, (widest, latest): (f64, f64)) -> Asked {
    let share = numbers.size(1e-3, widest);
    let is_constant = |input: &&Input| input.role == Role::Unknown(None) && input.declared;
    let constants = case.inputs.iter().filter(is_constant).map(|i| &i.side);
    let constants: Vec<&Side> = constants.filter(|_| numbers.chance(0.5)).collect();
    let mut part = |side: &Side| {
        let wide = match numbers.below(4) {
            0 => 0.0,
            _ => share * numbers.unit() * side.width(),
        };
        let middle = side.middle() + 0.3 * numbers.between(-1.0, 1.0) * side.width();
        let within = |x: f64| x.clamp(side.low, side.high);
        Side {
            name: side.name.clone(),
            low: within(middle - 0.5 * wide),
            high: within(middle + 0.5 * wide),
        }
    };
    let start = case.states.iter().chain(constants).map(&mut part).collect();
    Asked {
        start,
        until: round(numbers.size(0.1, latest)),
    }
}

/// How rough a plant is.
#[derive(Clone, Copy, PartialEq)]
enum Manner {
    Smooth,
    Kinked,
    Hostile,
}

struct Draft<'n> {
    numbers: &'n mut Numbers,
    manner: Manner,
    /// weights of nonlinear terms
    strength: f64,
}

impl<'n> Draft<'n> {
    fn new(numbers: &'n mut Numbers) -> Self {
        let manner = match numbers.below(20) {
            0..12 => Manner::Smooth,
            12..15 => Manner::Kinked,
            _ => Manner::Hostile,
        };
        // strong ones are often stable where their slopes are not at their worst all at once
        let strength = match numbers.unit() {
            0.0..0.04 => numbers.size(1e-7, 1e3),
            0.04..0.2 => numbers.size(0.5, 5.0),
            _ => numbers.size(0.004, 0.5),
        };
        Self {
            numbers,
            manner,
            strength,
        }
    }

    fn sides(&mut self, count: usize) -> Vec<Side> {
        let numbers = &mut *self.numbers;
        let scale = match numbers.chance(0.04) {
            true => numbers.size(1e-5, 1e4),
            false => 1.0,
        };
        let side = |i: usize| {
            let half = round(scale * numbers.size(0.3, 2.5));
            let middle = match numbers.below(3) {
                0 => half + round(scale * numbers.between(0.0, 1.0)),
                1 => round(scale * numbers.between(-0.5, 0.5)),
                _ => 0.0,
            };
            Side {
                name: format!("x{}", i + 1),
                low: round(middle - half),
                high: round(middle + half),
            }
        };
        (0..count).map(side).collect()
    }

    fn known(&mut self, most: usize) -> Vec<Input> {
        let count = self.numbers.below(most + 1);
        (1..=count)
            .map(|i| Input {
                side: self.range(format!("u{i}")),
                role: Role::Known,
                declared: true,
            })
            .collect()
    }

    fn range(&mut self, name: String) -> Side {
        let numbers = &mut *self.numbers;
        let high = round(numbers.size(0.1, 2.0));
        let low = match numbers.chance(0.7) {
            true => -high,
            false => round(numbers.between(-1.0, 0.9) * high),
        };
        Side { name, low, high }
    }

    /// coefficient·(term), of the plant's strength.
    fn weighted(&mut self, reads: &Reads<'_>) -> String {
        let weight = number(round(self.strength * self.numbers.signed(0.3, 2.0)));
        let kinked = self.manner == Manner::Kinked && self.numbers.chance(0.4);
        let term = match kinked {
            true => reads.kinked(self.numbers),
            false => reads.smooth(self.numbers),
        };
        format!("{weight}*{term}")
    }

    /// About the middle of the box, mostly damped: many plants then stay in it.
    fn damped(&mut self, side: &Side) -> String {
        let k = match self.numbers.chance(0.85) {
            true => -self.numbers.size(0.1, 2.0),
            false => self.numbers.between(-0.1, 0.3),
        };
        let (k, name) = (number(round(k)), &side.name);
        match side.middle() == 0.0 {
            true => format!("{k}*{name}"),
            false => format!("{k}*({name} - {})", number(side.middle())),
        }
    }

    /// What reveals the next state: monotone in it, zero in the middle of the box.
    fn link(&mut self, next: &Side, inputs: &[Side]) -> String {
        let a = number(round(self.numbers.signed(0.4, 2.5)));
        let x = match next.middle() == 0.0 {
            true => next.name.clone(),
            false => format!("({} - {})", next.name, number(next.middle())),
        };
        // now and then it is not monotone at all: the condition has to be refuted
        if self.numbers.chance(0.12) {
            return match (self.numbers.below(3), inputs.first()) {
                (0, Some(u)) => format!("{a}*{}*{x}", u.name),
                (1, _) => format!("{a}*sin(3*{x})"),
                _ => format!("{a}*{x}^2"),
            };
        }
        let w = self.strength.min(0.3);
        let w = number(round(w));
        match self.numbers.below(12) {
            0 => format!("{a}*({x} + {w}*{x}^3)"),
            1 => format!("{a}*({x} + {w}*sin({x}))"),
            2 => format!("{a}*tanh(0.7*{x})"),
            3 => format!("{a}*sinh({x})"),
            4 if !inputs.is_empty() => format!("{a}*(1 + {w}*sin({}))*{x}", inputs[0].name),
            5 => format!("{a}*(1 + {w}*cos(time))*{x}"),
            6 => format!("{a}*({x} + {w}*abs({x}))"),
            _ => format!("{a}*{x}"),
        }
    }

    /// Unknown influences: disturbances in states and outputs, unknown inputs, noise.
    fn unmeasured(&mut self, case: &mut Case) {
        if self.numbers.chance(0.25) {
            let mut side = self.range("d".into());
            (side.low, side.high) = (0.1 * side.low, 0.1 * side.high);
            let declared = self.numbers.chance(0.9);
            let state = self.numbers.of(&case.states).name.clone();
            let term = match self.numbers.below(5) {
                0 => format!("d*{state}"),
                1 => "0.1*sin(d)".to_owned(),
                2 => "d^2".to_owned(),
                _ => "d".to_owned(),
            };
            let hit = match self.numbers.chance(0.35) {
                true => &mut case.outputs,
                false => &mut case.equations,
            };
            let place = self.numbers.below(hit.len());
            hit[place].push(term);
            case.inputs.push(Input {
                side,
                role: Role::Disturbance,
                declared,
            });
        }
        for noise in &mut case.noise {
            if self.numbers.chance(0.3) {
                noise.size = self.numbers.size(1e-4, 1e-2);
                noise.is_uniform = self.numbers.chance(0.2);
            }
        }
        // no bound for certain is left then
        if self.numbers.chance(0.08) {
            let unknown = |i: &&Input| matches!(i.role, Role::Unknown(_));
            let unknown = case.inputs.iter().filter(unknown).map(|i| &i.side);
            for side in case.states.iter().chain(unknown) {
                let density = self.numbers.size(1e-8, 1e-3) * side.width().powi(2);
                case.process.push((side.name.clone(), round(density)));
            }
        }
    }

    /// A term that no theorem allows, in an equation or an output.
    fn hostile(&mut self, case: &mut Case) {
        if self.manner != Manner::Hostile {
            return;
        }
        let names = |role: fn(&Role) -> bool| -> Vec<Side> {
            let inputs = case.inputs.iter().filter(|i| role(&i.role));
            inputs.map(|i| i.side.clone()).collect()
        };
        let known = names(|role| *role == Role::Known);
        let weight = number(round(self.numbers.signed(0.05, 1.0)));
        let in_output = self.numbers.chance(0.15);
        let hit = match in_output {
            true => &mut case.outputs,
            false => &mut case.equations,
        };
        let place = self.numbers.below(hit.len());
        // readable by the chain's equation, or by any
        let count = match self.numbers.chance(0.7) {
            true => place + 1,
            false => case.states.len(),
        };
        let reads = Reads {
            states: &case.states[..count.min(case.states.len())],
            inputs: &known,
            time: false,
        };
        let term = match self.numbers.chance(0.6) {
            true => reads.jumping(self.numbers),
            false => reads.undefined(self.numbers),
        };
        hit[place].push(format!("{weight}*{term}"));
    }
}

fn sides_of(inputs: &[Input]) -> Vec<Side> {
    inputs.iter().map(|i| i.side.clone()).collect()
}
