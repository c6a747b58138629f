//! The forms that the families take, filled with random terms.

use super::super::case::{Case, Input, Kind, Noise, Role, Side, Sum, number};
use super::terms::{Reads, round};
use super::{Draft, sides_of};

impl Draft<'_> {
    fn reads<'a>(&mut self, states: &'a [Side], inputs: &'a [Side]) -> Reads<'a> {
        let time = self.numbers.chance(0.2);
        Reads {
            states,
            inputs,
            time,
        }
    }

    fn output(&mut self, state: &Side, inputs: &[Side]) -> Sum {
        let name = &state.name;
        match self.numbers.below(8) {
            0 => vec![format!("2*{name}"), "1".into()],
            1 => vec![format!("-0.5*{name}")],
            2 if !inputs.is_empty() => vec![name.clone(), inputs[0].name.clone()],
            _ => vec![name.clone()],
        }
    }

    /// One chain of states per sensor.
    pub fn chains(&mut self, kind: Kind, several: bool) -> Case {
        let one: &[&[usize]] = &[&[1], &[2], &[2], &[2], &[3], &[3], &[4], &[1, 1], &[2, 1]];
        let many: &[&[usize]] = &[
            &[1, 1],
            &[2, 1],
            &[2, 1],
            &[1, 2],
            &[2, 2],
            &[1, 1, 1],
            &[3, 1],
        ];
        let lengths = *self.numbers.of(if several { many } else { one });
        let states = self.sides(lengths.iter().sum());
        let mut inputs = self.known(1);
        let known = sides_of(&inputs);
        let (mut equations, mut outputs, mut start) = (vec![], vec![], 0);
        let heads: Vec<Side> = heads(lengths).map(|i| states[i].clone()).collect();
        for &length in lengths {
            outputs.push(self.output(&states[start], &known));
            for i in start..start + length {
                let last = i + 1 == start + length;
                let mut seen = match (several, last) {
                    (false, true) => states.clone(),
                    (false, false) => states[start..=i].to_vec(),
                    (true, _) => [&states[..=i], &heads].concat(),
                };
                if kind == Kind::Triangular && self.numbers.chance(0.97) {
                    seen = states[start..=i].to_vec();
                }
                let mut sum = vec![self.damped(&states[i])];
                if !last {
                    sum.push(self.link(&states[i + 1], &known));
                }
                for _ in 0..self.numbers.below(3) {
                    let reads = self.reads(&seen, &known);
                    sum.push(self.weighted(&reads));
                }
                equations.push(sum);
            }
            start += length;
        }
        if self.numbers.chance(0.2) && inputs.len() < 2 {
            let (input, term) = self.unknown();
            equations[start - 1].push(term);
            inputs.push(input);
        }
        case(kind, states, inputs, equations, outputs)
    }

    /// An input that nobody measures, with the term it enters by.
    fn unknown(&mut self) -> (Input, String) {
        let side = self.range("v".into());
        let slew = match self.numbers.chance(0.5) {
            true => Some(round(self.numbers.size(0.02, 1.0))),
            false => None,
        };
        let a = number(round(self.numbers.signed(0.4, 2.0)));
        let input = Input {
            side,
            role: Role::Unknown(slew),
            declared: self.numbers.chance(0.85),
        };
        (input, format!("{a}*v"))
    }

    /// A small plant for a filter, now and then with a pole far from the others.
    pub fn followed(&mut self) -> Case {
        let several = self.numbers.chance(0.3);
        let most = if self.numbers.chance(0.2) { 3 } else { 2 };
        let mut case = self.free();
        if self.numbers.chance(0.6) {
            case = self.chains(Kind::Filter, several);
        }
        while case.states.len() > most {
            case = self.chains(Kind::Filter, several);
        }
        case.kind = Kind::Filter;
        if self.numbers.chance(0.25) {
            let place = self.numbers.below(case.states.len());
            let k = number(round(-self.numbers.size(5.0, 60.0)));
            let side = &case.states[place];
            let term = format!("{k}*({} - {})", side.name, number(side.middle()));
            case.equations[place].push(term);
        }
        case
    }

    /// Blocks that read the next one through a matrix.
    pub fn blocks(&mut self) -> Case {
        let sizes: &[usize] = match self.numbers.below(6) {
            0 => &[1],
            1 | 2 => &[1, 1],
            3 => &[1, 2],
            4 => &[2, 1],
            _ => &[1, 1, 1],
        };
        let states = self.sides(sizes.iter().sum());
        let inputs = self.known(1);
        let known = sides_of(&inputs);
        let mut equations = vec![];
        let mut start = 0;
        let moving = self.numbers.chance(0.25);
        for (k, &size) in sizes.iter().enumerate() {
            let end = start + size;
            for i in start..end {
                let mut sum = vec![self.damped(&states[i])];
                let next = sizes.get(k + 1).copied().unwrap_or(0);
                for state in &states[end..end + next] {
                    let a = number(round(self.numbers.signed(0.4, 2.0)));
                    let factor = match (moving, known.first()) {
                        (true, Some(u)) => format!("{}*", u.name),
                        (true, None) => "cos(time)*".to_owned(),
                        _ => String::new(),
                    };
                    sum.push(format!("{a}*{factor}{}", state.name));
                }
                for _ in 0..self.numbers.below(3) {
                    let reads = self.reads(&states[..end], &known);
                    sum.push(self.weighted(&reads));
                }
                equations.push(sum);
            }
            start = end;
        }
        let first = &states[..sizes[0]];
        let outputs = first.iter().map(|s| self.output(s, &[])).collect();
        case(Kind::StateAffine, states, inputs, equations, outputs)
    }

    /// No form at all, or a chain in disguise; affine in the inputs.
    pub fn free(&mut self) -> Case {
        // the map's Jacobian grows quickly, and with it the time for its proofs
        let count = *self.numbers.of(&[1, 1, 1, 2, 2, 2, 2, 2, 2, 3]);
        let states = self.sides(count);
        let inputs = self.known(1);
        let mut equations = vec![];
        let chained = self.numbers.chance(0.75);
        for i in 0..count {
            let mut sum = vec![self.damped(&states[i])];
            if i + 1 < count {
                sum.push(self.link(&states[i + 1], &[]));
            }
            let seen = if chained { i + 1 } else { count };
            for _ in 0..self.numbers.below(3) {
                let reads = self.reads(&states[..seen], &[]);
                sum.push(self.weighted(&reads));
            }
            equations.push(sum);
        }
        if let Some(input) = inputs.first() {
            let place = match self.numbers.chance(0.7) {
                true => count - 1,
                false => self.numbers.below(count),
            };
            let u = &input.side.name;
            let w = number(round(self.strength));
            let factor = match self.numbers.below(4) {
                0 => format!("{w}*{u}*{}", states[self.numbers.below(count)].name),
                1 => format!("{u}*(1 + {w}*sin({}))", states[0].name),
                _ => u.clone(),
            };
            equations[place].push(factor);
        }
        let mut outputs = vec![self.output(&states[0], &[])];
        if self.numbers.chance(0.15) && count > 1 {
            outputs.push(vec![states[count - 1].name.clone()]);
        }
        if self.numbers.chance(0.1) {
            let w = number(round(self.strength));
            outputs[0].push(format!("{w}*sin({})", states[0].name));
        }
        case(Kind::DriftObservable, states, inputs, equations, outputs)
    }

    /// Layers behind the measured states, an unknown input in several equations.
    pub fn layers(&mut self) -> Case {
        let depth = self.numbers.below(3);
        let states = self.sides(2 + depth);
        let (unknown, _) = self.unknown();
        let mut inputs = vec![unknown];
        inputs.extend(self.known(1));
        let known = sides_of(&inputs[1..]);
        let mut equations = vec![];
        for i in 0..states.len() {
            let mut sum = vec![self.damped(&states[i])];
            if i >= 1 && i + 1 < states.len() {
                sum.push(self.link(&states[i + 1], &known));
            }
            let seen = (i + 1).max(2);
            for _ in 0..self.numbers.below(3) {
                let reads = self.reads(&states[..seen], &known);
                sum.push(self.weighted(&reads));
            }
            if i == 0 || self.numbers.chance(0.4) {
                let g = number(round(self.numbers.signed(0.2, 1.5)));
                let w = number(round(self.strength));
                sum.push(match self.numbers.below(5) {
                    0 => format!("{g}*(1 + {w}*sin({}))*v", states[0].name),
                    1 if !known.is_empty() => format!("{g}*(1 + {w}*cos({}))*v", known[0].name),
                    _ => format!("{g}*v"),
                });
            }
            equations.push(sum);
        }
        let outputs = states[..2].iter().map(|s| self.output(s, &[])).collect();
        case(Kind::UnknownInput, states, inputs, equations, outputs)
    }
}

fn heads(lengths: &[usize]) -> impl Iterator<Item = usize> {
    lengths.iter().scan(0, |start, length| {
        let head = *start;
        *start += length;
        Some(head)
    })
}

fn case(
    kind: Kind,
    states: Vec<Side>,
    inputs: Vec<Input>,
    equations: Vec<Sum>,
    outputs: Vec<Sum>,
) -> Case {
    Case {
        kind,
        noise: vec![Noise::default(); outputs.len()],
        process: vec![],
        states,
        inputs,
        equations,
        couplings: vec![],
        outputs,
        slope: None,
        tube: None,
        course: None,
        observer: vec![],
    }
}
