//! Runs of the plant that try to leave its tube: from corners and ends of what is declared, with inputs that push it
//! away from the middle of the tube wherever it is.

use lynkeus::Tube;
use lynkeus::expr::{Evaluator, Interval, MissingInput, Node, Tape};
use lynkeus::model::{Plant, Variable};
use lynkeus::structure::Standing;

use super::case::{self, Case};
use super::facts;
use super::integrate::{Flow, Limits, follow};
use super::signals::{self, Signal};
use crate::numbers::Numbers;

/// What a run may be off for reasons of its own, beside the sizes of its states.
const SLACK: f64 = 1e-8;
/// The same for a run along a witness, which may slide along a surface.
const SLIDING: f64 = 1e-6;
/// Steps of a run, and of one that is looked at again.
const STEPS: [usize; 2] = [600, 40_000];

/// Everything that the adversary chooses.
#[derive(Clone, Debug)]
struct Plan {
    /// places in the ranges of the start, from 0 to 1
    start: Vec<f64>,
    inputs: Vec<Signal>,
}

/// What was seen of runs.
#[derive(Clone, Debug, Default)]
pub struct Worst {
    /// the largest distance from the middle of the tube, in halves of its width
    pub ratio: f64,
    pub what: String,
    /// whether a run came to the end of the tube
    pub is_whole: bool,
}

pub struct Attack<'a> {
    case: &'a Case,
    tube: &'a Tube,
    /// (time, x, inputs) → x'
    plant: Evaluator,
    /// the sizes of the states
    scale: Vec<f64>,
}

impl<'a> Attack<'a> {
    pub fn new(case: &'a Case, tube: &'a Tube, plant: &Plant) -> Result<Self, MissingInput> {
        let nodes = |of: &[Variable]| -> Vec<Node> { of.iter().map(|v| v.node).collect() };
        let (states, inputs) = (nodes(&plant.states), nodes(&plant.inputs));
        let symbols = [&[plant.time], &states[..], &inputs].concat();
        let width = |v: &Variable| {
            let [low, high] = facts::finite(v.min, v.max);
            high - low
        };
        Ok(Self {
            case,
            tube,
            plant: Tape::new(&plant.graph, &symbols, &plant.derivatives)?.evaluator(),
            scale: plant.states.iter().map(width).collect(),
        })
    }

    /// The worst of so many runs, seen again at a tighter tolerance.
    pub fn search(&mut self, numbers: &mut Numbers, runs: usize) -> Worst {
        let mut best: Option<(Plan, Worst)> = None;
        let mut is_whole = false;
        for run in 0..runs {
            let plan = match &best {
                Some((plan, _)) if run > runs / 3 => self.changed(numbers, plan),
                _ => self.plan(numbers),
            };
            let worst = self.run(&plan, 1e-8, STEPS[0]);
            is_whole |= worst.is_whole;
            if best.as_ref().is_none_or(|(_, b)| worst.ratio > b.ratio) {
                best = Some((plan, worst));
            }
            if best.as_ref().is_some_and(|(_, b)| b.ratio > 1.0) {
                break;
            }
        }
        let Some((plan, mut worst)) = best else {
            return Worst::default();
        };
        if worst.ratio > 1.0 {
            worst = self.run(&plan, 1e-12, STEPS[1]);
            worst.what = format!("{} (ratio {})\n{plan:#?}", worst.what, worst.ratio);
        }
        worst.is_whole |= is_whole;
        worst
    }

    /// What is wrong with the witness of a refutation: it starts elsewhere, is not where it is said to be, or is not
    /// outside of the box.
    pub fn misled(&mut self) -> Option<String> {
        let tube = self.tube;
        let witness = tube.witness.as_ref()?;
        let allowed = [&tube.start, &tube.constants, &tube.inputs];
        let is_allowed = |(name, x): &(String, f64)| {
            let mut ranges = allowed.into_iter().flatten();
            ranges.any(|(own, range)| own == name && range.contains(*x))
        };
        if let Some((name, x)) = witness.at.iter().find(|at| !is_allowed(at)) {
            return Some(format!("the witness has {name} = {x:?}"));
        }
        let at = |name: &str| witness.at.iter().find(|(n, _)| n == name).map(|(_, x)| *x);
        let states = &self.case.states;
        let start: Option<Vec<f64>> = states.iter().map(|s| at(&s.name)).collect();
        let inputs = self.case.inputs.iter().map(|i| at(&i.side.name));
        let inputs: Option<Vec<Signal>> = inputs.map(|u| u.map(Signal::Constant)).collect();
        let state = states.iter().position(|s| s.name == witness.state);
        let (Some(start), Some(inputs), Some(state)) = (start, inputs, state) else {
            return Some("the witness does not say where everything is".into());
        };
        let (side, [low, high]) = (&states[state], witness.value);
        let until = [tube.from, witness.time];
        let reached = self
            .along(&start, &inputs, until, (1e-11, STEPS[1]), false)
            .1?;
        let x = reached[state];
        let slack = SLIDING * (x.abs() + self.scale[state]);
        let is_there = low - slack <= x && x <= high + slack;
        let is_out = high < side.low || low > side.high;
        (!is_there || !is_out).then(|| {
            format!(
                "{} is {x:e} at {}, the witness {:?} has {low:e} to {high:e}, the box {side:?}",
                witness.state, witness.time, witness.at
            )
        })
    }

    fn plan(&self, numbers: &mut Numbers) -> Plan {
        let is_corner = numbers.chance(0.6);
        let mut place = || match (is_corner, numbers.unit()) {
            (true, x) => f64::from(u8::from(x < 0.5)),
            (false, x) => x,
        };
        let start = self.tube.start.iter().map(|_| place()).collect();
        let inputs = self.case.inputs.iter();
        Plan {
            start,
            inputs: inputs.map(|input| self.signal(numbers, input)).collect(),
        }
    }

    /// What is constant stays at a number in its range, all else does whatever it likes.
    fn signal(&self, numbers: &mut Numbers, input: &case::Input) -> Signal {
        let side = &input.side;
        let constant = self.tube.constants.iter().find(|(n, _)| *n == side.name);
        let Some((_, range)) = constant else {
            // a study with a simulation may ask about its inputs alone
            let own = self.tube.inputs.iter().find(|(n, _)| *n == side.name);
            let own = own.map_or([side.low, side.high], |(_, range)| [range.lo(), range.hi()]);
            return signals::free(numbers, own, self.case.states.len());
        };
        Signal::Constant(match numbers.below(3) {
            0 => range.lo(),
            1 => range.hi(),
            _ => numbers.between(range.lo(), range.hi()),
        })
    }

    /// The plan with one of its parts changed.
    fn changed(&self, numbers: &mut Numbers, plan: &Plan) -> Plan {
        let mut plan = plan.clone();
        match (numbers.below(3), plan.inputs.len()) {
            (0, _) => plan.start = self.plan(numbers).start,
            (1, 1..) => {
                let one = numbers.below(plan.inputs.len());
                plan.inputs[one] = self.signal(numbers, &self.case.inputs[one]);
            }
            _ => {
                let one = numbers.below(plan.start.len());
                let moved = plan.start[one] + 0.3 * numbers.normal();
                plan.start[one] = moved.clamp(0.0, 1.0);
            }
        }
        plan
    }

    fn run(&mut self, plan: &Plan, tolerance: f64, steps: usize) -> Worst {
        let within = |(share, (_, range)): (&f64, &(String, Interval))| {
            (range.lo() + share * range.width()).clamp(range.lo(), range.hi())
        };
        let start: Vec<f64> = plan
            .start
            .iter()
            .zip(&self.tube.start)
            .map(within)
            .collect();
        let until = [self.tube.from, self.tube.reached];
        self.along(&start, &plan.inputs, until, (tolerance, steps), true)
            .0
    }

    /// Follows a run, along the tube or wherever it goes; and where it ends.
    fn along(
        &mut self,
        start: &[f64],
        inputs: &[Signal],
        [from, until]: [f64; 2],
        (tolerance, budget): (f64, usize),
        is_judged: bool,
    ) -> (Worst, Option<Vec<f64>>) {
        let small: Vec<f64> = self.scale.iter().map(|width| 1e-2 * width).collect();
        let mut run = Run {
            case: self.case,
            tube: self.tube,
            plant: &mut self.plant,
            scale: &self.scale,
            inputs,
            arguments: vec![0.0; 1 + start.len() + inputs.len()],
            away: vec![0.0; start.len()],
            is_judged,
            worst: Worst::default(),
        };
        let limits = Limits {
            tolerance,
            scale: &small,
            budget,
        };
        if !run.seen(from, start) {
            return (run.worst, None);
        }
        let end = follow(&mut run, start, [from, until], &limits);
        if let (Some(end), true) = (&end, is_judged) {
            run.worst.is_whole = true;
            let ranges: Vec<Interval> = run.tube.end.iter().map(|(_, range)| *range).collect();
            run.judge(until, end, &ranges, "at its end");
        }
        (run.worst, end)
    }
}

/// One run, judged at every step.
struct Run<'a> {
    case: &'a Case,
    tube: &'a Tube,
    plant: &'a mut Evaluator,
    scale: &'a [f64],
    inputs: &'a [Signal],
    arguments: Vec<f64>,
    /// from the middle of the tube, in halves of its width
    away: Vec<f64>,
    is_judged: bool,
    worst: Worst,
}

impl<'a> Run<'a> {
    /// The ranges of the part of the tube that has this time.
    fn ranges(&self, t: f64) -> Option<&'a [Interval]> {
        let rows = &self.tube.rows;
        let row = rows.get(rows.partition_point(|row| row.1 < t));
        row.map(|row| &row.2[..])
            .filter(|ranges| ranges.len() == self.scale.len())
    }

    /// From the middle of a range, in halves of its width.
    fn off(&self, i: usize, x: f64, range: Interval) -> f64 {
        let slack = SLACK * (x.abs() + self.scale[i]);
        (x - range.midpoint()) / (0.5 * range.width() + slack)
    }

    fn judge(&mut self, t: f64, x: &[f64], ranges: &[Interval], place: &str) {
        for (i, (x, range)) in x.iter().zip(ranges).enumerate() {
            let ratio = match self.off(i, *x, *range).abs() {
                // what is no number is outside
                none if none.is_nan() => f64::INFINITY,
                ratio => ratio,
            };
            if ratio > self.worst.ratio {
                self.worst.ratio = ratio;
                let name = &self.case.states[i].name;
                self.worst.what = format!("{name} = {x:e} at {t}, the tube has {range} {place}");
            }
        }
    }
}

impl Flow for Run<'_> {
    fn slope(&mut self, t: f64, x: &[f64], out: &mut [f64]) {
        if let Some(ranges) = self.ranges(t) {
            for (i, (x, range)) in x.iter().zip(ranges).enumerate() {
                self.away[i] = self.off(i, *x, *range);
            }
        }
        self.arguments[0] = t;
        self.arguments[1..=x.len()].copy_from_slice(x);
        for (k, signal) in self.inputs.iter().enumerate() {
            self.arguments[1 + x.len() + k] = signal.value(t, &self.away);
        }
        self.plant.eval(&self.arguments, out);
    }

    fn next_break(&self, t: f64) -> f64 {
        let signals = self.inputs.iter();
        signals.fold(f64::INFINITY, |next, signal| next.min(signal.next_break(t)))
    }

    fn seen(&mut self, t: f64, x: &[f64]) -> bool {
        if !self.is_judged {
            return true;
        }
        let Some(ranges) = self.ranges(t) else {
            self.worst.ratio = f64::INFINITY;
            self.worst.what = format!("no part of the tube has {t}");
            return false;
        };
        self.judge(t, x, ranges, "there");
        if self.tube.verdict == Standing::Proved {
            let side = |s: &case::Side| Interval::new(s.low, s.high).unwrap_or(Interval::ENTIRE);
            let sides: Vec<Interval> = self.case.states.iter().map(side).collect();
            self.judge(t, x, &sides, "as the box");
        }
        self.worst.ratio <= 3.0
    }
}
