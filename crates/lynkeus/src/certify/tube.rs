//! Whether the plant stays in the box, from the starts that a study asks about.

use std::ops::ControlFlow;

use lynkeus_expr::{Budget, Interval, Node, Tape};
use lynkeus_model::{Home, Variable};
use lynkeus_proof::tube::{End, Problem, Segment, reach};
use lynkeus_structure::{AugmentedPlant, Standing};
use lynkeus_study::Name;
use serde::Serialize;

use crate::Error;
#[cfg(test)]
use lynkeus_experiment::entries::Named;
use lynkeus_experiment::prepare::Prepared;
use lynkeus_experiment::prepare::systems::starts;
use lynkeus_experiment::words::{explain, number};
pub use seen::Row;
pub(super) use seen::{Seen, outward};

mod seen;
pub(crate) mod told;

/// Segments of a tube from one point, with which the search for a counterexample ends.
const SEGMENTS: usize = 2000;

/// How often the start set is halved.
const HALVINGS: usize = 8;

/// Corners of the start set that are tried.
const CORNERS: usize = 16;

/// Where quantities are, by their names.
pub type Ranges = Vec<(String, Interval)>;

/// What is proved of the plant's way from a set of starts.
#[derive(Clone, Debug)]
pub struct Tube {
    /// whether it stays in the box
    pub verdict: Standing,
    /// when it starts
    pub from: f64,
    /// until when it is asked
    pub until: f64,
    /// until when its ranges are proved
    pub reached: f64,
    /// ranges of the states at the start
    pub start: Ranges,
    /// unknown inputs that are constant
    pub constants: Ranges,
    /// inputs that may vary as they like within their ranges
    pub inputs: Ranges,
    /// ranges of the states over all of the time that is reached
    pub range: Ranges,
    /// ranges of the states at the end of it
    pub end: Ranges,
    /// the tube: from when, to when, and where each state is between
    pub rows: Vec<Row>,
    /// why it is not proved
    pub obstacle: Option<String>,
    /// a run that leaves the box
    pub witness: Option<Witness>,
    /// what it leaves aside
    pub notes: Vec<String>,
}

/// A run that leaves the box for certain.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema), schemars(rename = "TubeWitness"))]
pub struct Witness {
    /// where states and constants start, and what the inputs are all the time
    #[serde(serialize_with = "by_name")]
    #[cfg_attr(test, schemars(with = "Named<f64>"))]
    pub at: Vec<(String, f64)>,
    /// the state that is outside
    pub state: String,
    /// when
    pub time: f64,
    /// where it is then, for certain
    pub value: [f64; 2],
}

fn by_name<S: serde::Serializer>(values: &[(String, f64)], to: S) -> Result<S::Ok, S::Error> {
    to.collect_map(values.iter().map(|(name, value)| (name, value)))
}

/// A tube that was followed to its end.
struct Followed {
    seen: Seen,
    /// why it proves nothing of the box
    obstacle: Option<String>,
    /// from when on no step could be proved
    stuck: Option<f64>,
}

/// The plant, what is known of it, and where it has to stay.
struct Question {
    /// the states, with their sides of the box
    states: Vec<Variable>,
    constants: Vec<Variable>,
    inputs: Vec<Variable>,
    problem: Problem,
    until: f64,
}

impl Tube {
    /// The tube that the study asks for, in the box of `place`; none where it asks for none.
    ///
    /// # Errors
    /// Names of `start` that are neither states nor unknown inputs; no `until`, or one before the start.
    pub(super) fn of(
        prepared: &Prepared<'_>,
        place: &AugmentedPlant<'_>,
    ) -> Result<Option<Self>, Error> {
        let settings = &prepared.study().certify;
        let Some(start) = &settings.start else {
            return match settings.until {
                None => Ok(None),
                Some(_) => {
                    let message = "`until` of [certify] needs `start`: from where does the plant start? e.g. start = { x = [0, 1] }";
                    Err(Error::input(message).at(&prepared.study().file))
                }
            };
        };
        let question = Question::of(prepared, place, start)?;
        let budget = place.graph().budget();
        let mut found = question.answered(excluded(prepared), &budget);
        found.notes = notes(prepared);
        Ok(Some(found))
    }
}

/// What no tube here can count.
fn excluded(prepared: &Prepared<'_>) -> Option<String> {
    let plant = prepared.plant();
    let delay = plant.delays.first().map(|delay| {
        format!(
            "{} is held by {} states, which are not all of the delay: nothing is proved of the plant",
            delay.text, delay.count
        )
    });
    let jumps = !plant.whens.is_empty();
    let jumps = jumps
        .then(|| "the plant's states jump at events (`when`), which no tube follows".to_owned());
    delay.or(jumps)
}

/// What a tube leaves aside.
fn notes(prepared: &Prepared<'_>) -> Vec<String> {
    let noise = prepared.declared().process_noise.acts();
    let noise = noise.then(|| {
        "without the process noise, which is Gaussian: under it nothing stays in a box for certain".to_owned()
    });
    noise.into_iter().collect()
}

impl Question {
    fn of(
        prepared: &Prepared<'_>,
        place: &AugmentedPlant<'_>,
        start: &[(Name, f64, f64)],
    ) -> Result<Self, Error> {
        let plant = prepared.plant();
        let (from, until) = until(prepared)?;
        let slew = &prepared.declared().slew;
        let (states, unknown) = place.states.split_at(place.plant_states());
        let (wandering, constants): (Vec<Variable>, Vec<Variable>) = unknown
            .iter()
            .cloned()
            .partition(|v| slew.of(&v.name).is_some());
        let known = |v: &&Variable| {
            place.inputs.iter().all(|u| u.node != v.node)
                && unknown.iter().all(|u| u.node != v.node)
        };
        // disturbances keep to what the plant declares
        let disturbances = plant.inputs.iter().filter(known).cloned();
        let inputs: Vec<Variable> = place
            .inputs
            .iter()
            .cloned()
            .chain(wandering.iter().cloned())
            .chain(disturbances)
            .collect();
        let given: Vec<(Name, Interval)> = start
            .iter()
            .filter_map(|(name, low, high)| Some((name.clone(), Interval::new(*low, *high).ok()?)))
            .collect();
        // one that wanders may start anywhere in its range here
        let named = states.iter().chain(&constants).chain(&wandering);
        refuse_others(&given, &plant.name, named)?;
        let usual = first_of(prepared)?;
        let first = |(state, usual): (&Variable, f64)| {
            let own = Name::best(&given, &state.name).copied();
            own.unwrap_or(Interval::point(usual))
        };
        let constant = |v: &Variable| Name::best(&given, &v.name).copied().unwrap_or(side(v));
        let problem = Problem {
            right: right(plant, states, &constants, &inputs)?,
            from,
            start: states.iter().zip(usual).map(first).collect(),
            constants: constants.iter().map(constant).collect(),
            inputs: bounded(prepared, &inputs)?,
        };
        Ok(Self {
            states: states.to_vec(),
            constants,
            inputs,
            problem,
            until,
        })
    }

    /// What has no bounds, which leaves nothing to be proved.
    fn unbounded(&self) -> Option<String> {
        let problem = &self.problem;
        let names = self
            .states
            .iter()
            .chain(&self.constants)
            .chain(&self.inputs);
        let ranges = problem
            .start
            .iter()
            .chain(&problem.constants)
            .chain(&problem.inputs);
        let (found, _) = names.zip(ranges).find(|(_, range)| !range.is_bounded())?;
        let name = &found.name;
        Some(format!(
            "{name} has no bounds: give its range, `min` and `max` in the model or {name} = [smallest, largest] in [box]"
        ))
    }

    fn answered(&self, excluded: Option<String>, budget: &Budget) -> Tube {
        let named = |variables: &[Variable], ranges: &[Interval]| -> Ranges {
            let names = variables.iter().map(|v| v.name.clone());
            names.zip(ranges.iter().copied()).collect()
        };
        let problem = &self.problem;
        let mut tube = Tube {
            verdict: Standing::Undecided,
            from: problem.from,
            until: self.until,
            reached: problem.from,
            start: named(&self.states, &problem.start),
            constants: named(&self.constants, &problem.constants),
            inputs: named(&self.inputs, &problem.inputs),
            range: named(&self.states, &problem.start),
            end: named(&self.states, &problem.start),
            rows: vec![],
            obstacle: excluded.or_else(|| self.unbounded()),
            witness: None,
            notes: vec![],
        };
        if tube.obstacle.is_some() {
            return tube;
        }
        let whole = self.followed(&self.problem, false, budget);
        let mut seen = whole.seen;
        match whole.obstacle {
            None => tube.verdict = Standing::Proved,
            Some(obstacle) => {
                if let Some(witness) = self.leaves(budget) {
                    (tube.verdict, tube.witness) = (Standing::Refuted, Some(witness));
                } else if let Some(parts) = self.in_parts(whole.stuck, budget) {
                    (tube.verdict, seen) = (Standing::Proved, parts);
                }
                tube.obstacle = Some(obstacle).filter(|_| tube.verdict == Standing::Undecided);
            }
        }
        seen.cut();
        tube.reached = seen.reached;
        tube.range = named(&self.states, &seen.range());
        tube.end = named(&self.states, &seen.end);
        tube.rows = seen.rows;
        tube
    }

    /// Goes along a tube to its end, or only as far as it is inside the box; where it is not is an obstacle.
    fn followed(&self, problem: &Problem, inside: bool, budget: &Budget) -> Followed {
        let mut seen = Seen::new(problem.from, self.until);
        seen.end.clone_from(&problem.start);
        let outside = |time: f64, ranges: &[Interval]| {
            let i = self.outside(ranges)?;
            Some(self.beyond(i, time, ranges[i]))
        };
        let mut obstacle = outside(problem.from, &problem.start);
        let (end, reached) = reach(problem, self.until, budget, &mut |segment: &Segment| {
            let range = segment.range();
            if obstacle.is_none() {
                obstacle = outside(segment.from(), &range);
            }
            seen.add(segment.from(), segment.to(), &range);
            seen.end = segment.end();
            match inside && obstacle.is_some() {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        });
        seen.reached = reached;
        let stuck = (end == End::Stuck).then_some(reached);
        let ended = match end {
            End::Reached | End::Stopped => None,
            End::Stuck => Some(format!(
                "from {} on no step could be proved: the ranges are too wide there, or the plant has no value in them",
                number(reached)
            )),
            End::Spent(spent) => Some(format!("it had come to {}: {spent}", number(reached))),
        };
        let obstacle = obstacle.or(ended);
        Followed {
            seen,
            obstacle,
            stuck,
        }
    }

    /// The tubes of halves of the start set, halves of these, and so on, if all are proved: a smaller part
    /// has a narrower tube.
    fn in_parts(&self, stuck: Option<f64>, budget: &Budget) -> Option<Seen> {
        let halves = |part: &Part, stuck| part.halves(&self.problem, stuck);
        let mut open = Vec::from(halves(&Part::whole(&self.problem), stuck)?);
        let mut all: Option<Seen> = None;
        while let Some(part) = open.pop() {
            let found = self.followed(&part.problem, true, budget);
            if found.obstacle.is_some() {
                open.extend(halves(&part, found.stuck)?);
            } else if let Some(all) = &mut all {
                all.join(&found.seen);
            } else {
                all = Some(found.seen);
            }
        }
        all
    }

    /// The first state that may be outside of its side.
    fn outside(&self, ranges: &[Interval]) -> Option<usize> {
        let states = self.states.iter().zip(ranges);
        states
            .into_iter()
            .position(|(state, range)| !range.is_subset(side(state)))
    }

    fn beyond(&self, i: usize, time: f64, range: Interval) -> String {
        let state = &self.states[i];
        let allowed = side(state);
        format!(
            "from {} on {} may leave the box: it is known to be in {}, the box has {}",
            number(time),
            state.name,
            outward(range),
            outward(allowed)
        )
    }

    /// A run that is outside of the box for certain: its own tube, from a point and with inputs that stay
    /// the same, is.
    fn leaves(&self, budget: &Budget) -> Option<Witness> {
        let problem = &self.problem;
        let starts = problem.start.iter().chain(&problem.constants);
        let wide = starts.filter(|range| !range.is_point()).count();
        let corners = 1_usize << wide.min(CORNERS.ilog2() as usize);
        let inputs: &[Option<bool>] = match problem.inputs.iter().all(|u| u.is_point()) {
            true => &[None],
            false => &[None, Some(false), Some(true)],
        };
        let middle = std::iter::once(None);
        let corners = (0..corners).filter(|_| wide > 0).map(Some);
        let places = middle.chain(corners);
        places
            .flat_map(|corner| inputs.iter().map(move |end| (corner, *end)))
            .find_map(|(corner, end)| self.run_from(corner, end, budget))
    }

    /// From the middle or a corner of the start set, with inputs in the middle or at an end.
    fn run_from(
        &self,
        corner: Option<usize>,
        end: Option<bool>,
        budget: &Budget,
    ) -> Option<Witness> {
        let at = |range: &Interval, high: Option<bool>| match high {
            None => range.midpoint(),
            Some(true) => range.hi(),
            Some(false) => range.lo(),
        };
        let mut place = 0;
        let mut chosen = |range: &Interval| {
            let high = corner.map(|corner| corner >> (place % CORNERS.ilog2() as usize) & 1 == 1);
            place += usize::from(!range.is_point());
            at(range, high)
        };
        let all = &self.problem;
        let starts: Vec<f64> = all.start.iter().map(&mut chosen).collect();
        let constants: Vec<f64> = all.constants.iter().map(&mut chosen).collect();
        let inputs: Vec<f64> = all.inputs.iter().map(|range| at(range, end)).collect();
        let points = |values: &[f64]| values.iter().map(|&x| Interval::point(x)).collect();
        let problem = Problem {
            start: points(&starts),
            constants: points(&constants),
            inputs: points(&inputs),
            ..all.clone()
        };
        let mut found = None;
        let mut segments = 0;
        reach(&problem, self.until, budget, &mut |segment: &Segment| {
            segments += 1;
            let ranges = segment.end();
            let is_out = |(state, range): (&Variable, &Interval)| {
                state.home == Home::Line && range.intersection(side(state)).is_empty()
            };
            let out = self.states.iter().zip(&ranges).position(is_out);
            found = out.map(|i| (i, segment.to(), ranges[i]));
            match found.is_some() || segments >= SEGMENTS {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        });
        let (i, time, value) = found?;
        let names = self
            .states
            .iter()
            .chain(&self.constants)
            .chain(&self.inputs);
        let values = starts.iter().chain(&constants).chain(&inputs);
        Some(Witness {
            at: names.map(|v| v.name.clone()).zip(values.copied()).collect(),
            state: self.states[i].name.clone(),
            time,
            value: [value.lo(), value.hi()],
        })
    }
}

/// A part of a start set.
#[derive(Clone, Debug)]
pub(super) struct Part {
    pub problem: Problem,
    /// how often it may be halved
    left: usize,
    /// when what it is a half of got stuck
    stuck: f64,
    /// how often halving has not moved that
    in_vain: usize,
}

impl Part {
    /// All of it.
    pub fn whole(problem: &Problem) -> Self {
        Self {
            problem: problem.clone(),
            left: HALVINGS,
            stuck: f64::NEG_INFINITY,
            in_vain: 0,
        }
    }

    /// Both halves along the side that is widest beside the whole, of a part that gets stuck at a time, if it does; none where
    /// so much was halved, or every wide side in vain.
    pub fn halves(&self, whole: &Problem, stuck: Option<f64>) -> Option<[Self; 2]> {
        let widths = |problem: &Problem| -> Vec<f64> {
            let ranges = problem.start.iter().chain(&problem.constants);
            ranges.map(|range| range.width()).collect()
        };
        let all = widths(whole).into_iter().zip(widths(&self.problem));
        let shares = all.map(|(whole, part)| if whole > 0.0 { part / whole } else { 0.0 });
        let shares: Vec<f64> = shares.collect();
        let wide = shares.iter().filter(|share| **share > 0.0).count();
        let widest = |a: &(usize, &f64), b: &(usize, &f64)| a.1.total_cmp(b.1).then(b.0.cmp(&a.0));
        let (place, _) = shares.iter().enumerate().max_by(widest)?;
        let moved = stuck.is_none_or(|time| time > self.stuck);
        let in_vain = if moved { 0 } else { self.in_vain + 1 };
        let left = self.left.checked_sub(1)?;
        let half = |upper: bool| {
            let mut problem = self.problem.clone();
            let ranges = problem.start.iter_mut().chain(&mut problem.constants);
            for range in ranges.skip(place).take(1) {
                let (low, high) = range.bisect();
                *range = if upper { high } else { low };
            }
            Self {
                problem,
                left,
                stuck: stuck.map_or(self.stuck, |time| time.max(self.stuck)),
                in_vain,
            }
        };
        (in_vain < wide).then(|| [half(true), half(false)])
    }
}

/// The ranges of inputs: of one that has no bounds of its own, those of the simulation.
pub(super) fn bounded(
    prepared: &Prepared<'_>,
    inputs: &[Variable],
) -> Result<Vec<Interval>, Error> {
    let simulated = prepared.simulated_inputs()?;
    let range = |input: &Variable| {
        let mut run = simulated.iter().filter(|(name, ..)| *name == input.name);
        let run = run.find_map(|(_, low, high)| Interval::new(*low, *high).ok());
        Some(side(input))
            .filter(|own| own.is_bounded())
            .or(run)
            .unwrap_or(side(input))
    };
    Ok(inputs.iter().map(range).collect())
}

/// From when until when the study asks.
///
/// # Errors
/// No `until`, or one before the start.
pub(super) fn until(prepared: &Prepared<'_>) -> Result<(f64, f64), Error> {
    let study = prepared.study();
    let run = study.simulate.as_ref();
    let from = run.map_or(0.0, |run| run.start);
    let until = study.certify.until.or(run.map(|run| run.until));
    let until = until.filter(|until| *until > from && until.is_finite());
    let until = until.ok_or_else(|| {
        let message = format!(
            "`start` of [certify] needs `until`: a time after {}",
            number(from)
        );
        Error::input(message).at(&study.file)
    })?;
    Ok((from, until))
}

/// Where the plant starts where nothing else is said.
pub(super) fn first_of(prepared: &Prepared<'_>) -> Result<Vec<f64>, Error> {
    let run = prepared.study().simulate.as_ref();
    starts(prepared.plant(), run.map_or(&[], |run| &run.initial))
}

/// Its side of the box.
pub(super) fn side(variable: &Variable) -> Interval {
    Interval::new(variable.min, variable.max).unwrap_or(Interval::ENTIRE)
}

/// x' of the states, constants and inputs.
fn right(
    plant: &lynkeus_model::Plant,
    states: &[Variable],
    constants: &[Variable],
    inputs: &[Variable],
) -> Result<Tape, Error> {
    let nodes = |of: &[Variable]| of.iter().map(|v| v.node).collect::<Vec<Node>>();
    let symbols = [
        nodes(states),
        vec![plant.time],
        nodes(constants),
        nodes(inputs),
    ]
    .concat();
    Tape::new(&plant.graph, &symbols, &plant.derivatives).map_err(explain)
}

/// Every name has to be a state or an unknown input that is constant.
pub(super) fn refuse_others<'v>(
    given: &[(Name, Interval)],
    plant: &str,
    variables: impl Iterator<Item = &'v Variable> + Clone,
) -> Result<(), Error> {
    let is_none =
        |(name, _): &&(Name, Interval)| !variables.clone().any(|v| name.is_or_has(&v.name));
    let Some((name, _)) = given.iter().find(is_none) else {
        return Ok(());
    };
    let names: Vec<&str> = variables.map(|v| v.name.as_str()).collect();
    let message = format!(
        "`start` of [certify]: the plant '{plant}' has no state and no constant unknown input named \"{name}\"; it has {}",
        names.join(", ")
    );
    Err(name.blame(Error::input(message)))
}
