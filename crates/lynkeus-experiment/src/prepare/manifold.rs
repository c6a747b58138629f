//! Angles and rotations: `[manifold]`.

use std::f64::consts::TAU;

use lynkeus_expr::{Node, Tape};
use lynkeus_model::{Home, Parameter, Plant, Variable};
use lynkeus_run::Manifold;
use lynkeus_run::manifold::{unit, wrapped};
use lynkeus_structure::AugmentedPlant;

use crate::words::number;
use crate::{Error, Study, near};
use lynkeus_study::Name;

/// A declared range is a turn up to so much, in radians: its ends are written with a few digits.
const SLACK: f64 = 5e-3;

/// No element of a unit quaternion is larger, rounding counted.
const UNIT: f64 = 1.0 + 1e-9;

/// What rounding leaves of a difference that vanishes, as a share of the values.
const ROUNDING: f64 = 1e-7;

/// Places at which it is seen whether the equations know of turns.
const TRIED: usize = 12;

/// The plant with its angles and rotations. An angle has no ends: its declared turn is where it is shown.
///
/// # Errors
/// A name that is no state and no output, a range that is no turn, what is no array of four states; equations for
/// which a turn is not nothing, or under which a quaternion does not keep its length.
pub(super) fn placed(study: &Study, mut plant: Plant) -> Result<Plant, Error> {
    let settings = &study.manifold;
    for name in &settings.quaternions {
        place_rotation(study, &mut plant, name)?;
    }
    for name in &settings.circles {
        let is_own = |v: &&mut Variable| name.is_or_has(&v.name);
        let (states, outputs) = (&mut plant.states, &mut plant.outputs);
        let own = states.iter_mut().chain(outputs).filter(is_own);
        let own: Vec<&mut Variable> = own.collect();
        if own.is_empty() {
            let known = plant.states.iter().chain(&plant.outputs);
            let message =
                format!("`circle` of [manifold]: no state and no output is called \"{name}\"");
            let hint = near::suggest(&name.text, known.map(|v| v.name.as_str()));
            return Err(name.blame(Error::input(message).at(&study.file).hint(hint)));
        }
        for variable in own {
            if variable.home != Home::Line {
                let message = format!("[manifold] names {} twice", variable.name);
                return Err(name.blame(Error::input(message).at(&study.file).hint("keep one")));
            }
            let from = turn(study, name, variable)?;
            (variable.min, variable.max) = (f64::NEG_INFINITY, f64::INFINITY);
            variable.home = Home::Circle { from };
        }
    }
    if !settings.is_empty() {
        Turns::new(study, &plant).place(&mut plant)?;
    }
    Ok(plant)
}

/// Where the turn begins that is declared for an angle; none without a range.
fn turn(study: &Study, name: &Name, variable: &Variable) -> Result<Option<f64>, Error> {
    let mut narrower = study.narrower.iter();
    let own = narrower.find(|(own, ..)| own.is_or_has(&variable.name));
    let (low, high) = match own {
        Some((_, low, high)) => (*low, *high),
        None => (variable.min, variable.max),
    };
    if !low.is_finite() && !high.is_finite() {
        return Ok(None);
    }
    if ((high - low) - TAU).abs() <= SLACK {
        return Ok(Some(low));
    }
    let degrees = match ((high - low) - 360.0).abs() < 1.0 {
        true => {
            "; angles are in radians: have the model in them, and convert the log's columns under [log]"
        }
        false => "",
    };
    let message = format!(
        "`circle` of [manifold]: {} is declared in [{}, {}], which is {} wide: expected one turn of 2π = 6.2832, or no range{degrees}",
        variable.name,
        number(low),
        number(high),
        number(high - low)
    );
    let hint = format!(
        "give {} min = -3.14159 and max = 3.14159, or no min and max to see it unwrapped; where it cannot turn around it is a real number, without [manifold]",
        variable.name
    );
    Err(name.blame(Error::input(message).at(&study.file).hint(hint)))
}

fn place_rotation(study: &Study, plant: &mut Plant, name: &Name) -> Result<(), Error> {
    let refuse = |message: String| {
        let message = format!("`quaternion` of [manifold]: {message}");
        let hint =
            "declare an array of four states, Real q[4](start = {1, 0, 0, 0}), the scalar first";
        Err(name.blame(Error::input(message).at(&study.file).hint(hint)))
    };
    let own = plant.states.iter().enumerate();
    let own = own.filter(|(_, state)| name.is_or_has(&state.name));
    let places: Vec<usize> = own.map(|(place, _)| place).collect();
    match places[..] {
        [] => {
            let states = plant.states.iter().map(|state| state.name.as_str());
            let near = near::suggest(&name.text, states);
            return refuse(format!("no state is called \"{name}\" ({near})"));
        }
        [first, .., last] if places.len() == 4 && last == first + 3 => {}
        _ => {
            let count = places.len();
            return refuse(format!(
                "\"{name}\" is {count} of the states, expected four"
            ));
        }
    }
    for (element, place) in places.into_iter().enumerate() {
        let state = &mut plant.states[place];
        if state.home != Home::Line {
            return refuse(format!("\"{name}\" stands there twice"));
        }
        state.home = Home::Rotation { element };
        (state.min, state.max) = (state.min.max(-UNIT), state.max.min(UNIT));
    }
    Ok(())
}

/// What the equations make of full turns, seen at some places.
struct Turns<'s> {
    study: &'s Study,
    /// derivatives, then outputs
    tape: Option<Tape>,
    states: usize,
    /// values of time, states, inputs and parameters
    places: Vec<Vec<f64>>,
}

impl<'s> Turns<'s> {
    fn new(study: &'s Study, plant: &Plant) -> Self {
        let own =
            |variables: &[Variable]| -> Vec<Node> { variables.iter().map(|v| v.node).collect() };
        let parameters = plant.parameters.iter().map(|p| p.variable.node);
        let parameters: Vec<Node> = parameters.collect();
        let inputs = [
            &[plant.time][..],
            &own(&plant.states),
            &own(&plant.inputs),
            &parameters,
        ];
        let outputs = [plant.derivatives.clone(), own(&plant.outputs)].concat();
        let mut random = Random(1);
        Self {
            study,
            tape: Tape::new(&plant.graph, &inputs.concat(), &outputs).ok(),
            states: plant.states.len(),
            places: (0..TRIED).map(|_| somewhere(plant, &mut random)).collect(),
        }
    }

    /// The values at a place, and at the same with some states changed; none where there are none.
    fn pair(&self, place: &[f64], change: impl Fn(&mut [f64])) -> Option<[Vec<f64>; 2]> {
        let tape = self.tape.as_ref()?;
        let values = |place: &[f64]| {
            let mut found = vec![0.0; tape.outputs()];
            tape.evaluator().eval(place, &mut found);
            found
        };
        let mut changed = place.to_vec();
        change(&mut changed[1..=self.states]);
        let pair = [values(place), values(&changed)];
        let is_sound = pair.iter().flatten().all(|x| x.is_finite());
        is_sound.then_some(pair)
    }

    /// Refuses equations that do not fit, and finds the outputs that turn as well.
    fn place(&self, plant: &mut Plant) -> Result<(), Error> {
        for state in 0..plant.states.len() {
            match plant.states[state].home {
                Home::Line | Home::Signed { .. } => {}
                Home::Circle { from } => self.place_circle(plant, state, from)?,
                Home::Rotation { element: 0 } => self.place_rotation(plant, state)?,
                Home::Rotation { .. } => {}
            }
        }
        Ok(())
    }

    fn place_circle(
        &self,
        plant: &mut Plant,
        state: usize,
        from: Option<f64>,
    ) -> Result<(), Error> {
        let name = plant.states[state].name.clone();
        let count = plant.derivatives.len();
        let mut turns: Vec<Option<f64>> = vec![None; plant.outputs.len()];
        for place in &self.places {
            let Some([here, there]) = self.pair(place, |x| x[state] += TAU) else {
                continue;
            };
            let values = here.iter().zip(&there).enumerate();
            for (i, (here, there)) in values {
                let (off, size) = (there - here, 1.0 + here.abs());
                let is_nothing = off.abs() <= ROUNDING * size;
                let Some(output) = i.checked_sub(count) else {
                    match is_nothing {
                        true => continue,
                        false => {
                            let what = format!("der({})", plant.states[i].name);
                            return Err(self.no_turn(&name, &what, *here, *there));
                        }
                    }
                };
                let is_dial = plant.outputs[output].home != Home::Line;
                let is_turn = wrapped(off).abs() <= ROUNDING * size;
                let known = turns[output].get_or_insert(off);
                let is_same = (off - *known).abs() <= ROUNDING * size;
                if !(is_nothing || is_turn && (is_dial || is_same)) {
                    let what = &plant.outputs[output].name;
                    return Err(self.no_turn(&name, what, *here, *there));
                }
            }
        }
        for (output, off) in plant.outputs.iter_mut().zip(turns) {
            if output.home == Home::Line && off.is_some_and(|off| off.abs() > 1.0) {
                let is_own = output.node == plant.states[state].node;
                let of_range = (output.max - output.min - TAU).abs() <= SLACK;
                let own = of_range.then_some(output.min);
                output.home = Home::Circle {
                    from: own.or(from.filter(|_| is_own)),
                };
                (output.min, output.max) = (f64::NEG_INFINITY, f64::INFINITY);
            }
        }
        Ok(())
    }

    fn no_turn(&self, name: &str, what: &str, here: f64, there: f64) -> Error {
        let message = format!(
            "`circle` of [manifold]: {name} is no angle of which a full turn changes nothing: {what} is {} at one place and {} at {name} + 2π",
            number(here),
            number(there)
        );
        let hint = format!("leave {name} out, or write {what} in its sine and cosine");
        Error::input(message).at(&self.study.file).hint(hint)
    }

    fn place_rotation(&self, plant: &mut Plant, first: usize) -> Result<(), Error> {
        let name = array(&plant.states[first].name);
        let count = plant.derivatives.len();
        let own = first..first + 4;
        // whether outputs are the same at -q, and whether they change their sign alone
        let mut parities = vec![[true; 2]; plant.outputs.len()];
        let negate = |x: &mut [f64]| x[own.clone()].iter_mut().for_each(|q| *q = -*q);
        for place in &self.places {
            let Some([here, there]) = self.pair(place, negate) else {
                continue;
            };
            let q = &place[1..][own.clone()];
            let rate = &here[own.clone()];
            let along: f64 = q.iter().zip(rate).map(|(q, dq)| q * dq).sum();
            let size: f64 = 1.0 + rate.iter().map(|dq| dq.abs()).sum::<f64>();
            if along.abs() > ROUNDING * size {
                let message = format!(
                    "`quaternion` of [manifold]: {name} does not keep its length: {name}·der({name}) = {} where {name} has length 1",
                    number(along)
                );
                let hint = format!(
                    "the equation of an attitude is der({name}) = 0.5*{{-q2*w1 - q3*w2 - q4*w3, q1*w1 + q3*w3 - q4*w2, q1*w2 - q2*w3 + q4*w1, q1*w3 + q2*w2 - q3*w1}} with the rates w about the body's axes"
                );
                return Err(Error::input(message).at(&self.study.file).hint(hint));
            }
            for (i, (here, there)) in here.iter().zip(&there).enumerate() {
                let is_nothing = |off: f64| off.abs() <= ROUNDING * (1.0 + here.abs());
                let parity = [is_nothing(here - there), is_nothing(here + there)];
                let is_sound = match i.checked_sub(count) {
                    None => parity[usize::from(own.contains(&i))],
                    Some(output) => {
                        let known = &mut parities[output];
                        *known = [known[0] && parity[0], known[1] && parity[1]];
                        known[0] || known[1]
                    }
                };
                if !is_sound {
                    let what = match i.checked_sub(count) {
                        None => format!("der({})", plant.states[i].name),
                        Some(output) => plant.outputs[output].name.clone(),
                    };
                    let message = format!(
                        "`quaternion` of [manifold]: {name} and -{name} are one rotation, and {what} is {} at the one and {} at the other",
                        number(*here),
                        number(*there)
                    );
                    let hint = format!(
                        "have sensors show what a rotation does, for example vectors in the body's axes, which are of second degree in {name}"
                    );
                    return Err(Error::input(message).at(&self.study.file).hint(hint));
                }
            }
        }
        for (output, [is_same, _]) in plant.outputs.iter_mut().zip(parities) {
            if !is_same {
                output.home = Home::Signed { of: first };
            }
        }
        Ok(())
    }
}

/// Values of time, states, inputs and parameters, within their ranges and about their starts.
fn somewhere(plant: &Plant, random: &mut Random) -> Vec<f64> {
    let of = |variable: &Variable, random: &mut Random| {
        let (share, width) = (random.next(), variable.max - variable.min);
        match (variable.home, width.is_finite()) {
            (Home::Line, true) => variable.min + share * width,
            (Home::Circle { .. }, _) => TAU * (share - 0.5),
            _ => variable.start.unwrap_or(0.0) + 2.0 * share - 1.0,
        }
    };
    let mut place = vec![random.next()];
    let states = plant.states.iter().map(|v| of(v, random));
    place.extend(states.collect::<Vec<f64>>());
    for (i, _) in firsts(&plant.states) {
        let own = &mut place[1 + i..5 + i];
        let mut q: [f64; 4] = [0.0; 4];
        q.copy_from_slice(own);
        own.copy_from_slice(&unit(q).unwrap_or([1.0, 0.0, 0.0, 0.0]));
    }
    let inputs = plant.inputs.iter().map(|v| of(v, random));
    place.extend(inputs.collect::<Vec<f64>>());
    let value = |p: &Parameter| p.value.unwrap_or(1.0);
    place.extend(plant.parameters.iter().map(value));
    place
}

/// Numbers in [0, 1), the same ones always.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        let next = self.0.wrapping_mul(6_364_136_223_846_793_005);
        self.0 = next.wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// The places of the scalars of quaternions, with the names of these.
pub(crate) fn firsts(states: &[Variable]) -> impl Iterator<Item = (usize, String)> {
    let firsts = states.iter().enumerate();
    let firsts = firsts.filter(|(_, state)| state.home == (Home::Rotation { element: 0 }));
    firsts.map(|(place, state)| (place, array(&state.name)))
}

/// The array of which a state is an element.
fn array(element: &str) -> String {
    let (array, _) = element.rsplit_once('[').unwrap_or((element, ""));
    array.to_owned()
}

/// The plant with what is known of its quaternions as outputs: their length is 1. None where it has none.
pub fn with_lengths(plant: &Plant) -> Option<Plant> {
    let lengths = firsts(&plant.states).map(|(first, _)| {
        let own = plant.states[first..first + 4].iter();
        let squares = own.map(|q| plant.graph.expr(q.node).powi(2));
        let length = squares.reduce(|sum, square| sum + square);
        let state = &plant.states[first];
        Variable {
            // no name of the plant's has this form
            name: format!(" length of {}", state.name),
            node: length.map_or(state.node, |length| length.node()),
            ..state.clone()
        }
    });
    let lengths: Vec<Variable> = lengths.collect();
    (!lengths.is_empty()).then(|| {
        let mut own = plant.clone();
        own.outputs.extend(lengths);
        own
    })
}

/// Where states and readings of a plant live.
pub fn of(augmented: &AugmentedPlant<'_>) -> Manifold {
    let outputs = augmented.outputs.iter().enumerate();
    let dials = outputs.clone();
    let dials = dials.filter(|(_, output)| is_circle(&output.variable));
    let own = of_states(&augmented.states);
    let mirrors = own.rotations.iter().map(|of| {
        let own = outputs.clone();
        let own = own.filter(|(_, o)| o.variable.home == Home::Signed { of: *of });
        own.map(|(place, _)| place).collect::<Vec<usize>>()
    });
    Manifold {
        dials: dials.map(|(place, _)| place).collect(),
        mirrors: mirrors.filter(|own| !own.is_empty()).collect(),
        ..own
    }
}

/// Where states live.
pub(crate) fn of_states(states: &[Variable]) -> Manifold {
    let circles = states.iter().enumerate();
    let circles = circles.filter(|(_, state)| is_circle(state));
    Manifold {
        circles: circles.map(|(place, _)| place).collect(),
        rotations: firsts(states).map(|(place, _)| place).collect(),
        ..Manifold::default()
    }
}

pub(super) fn is_circle(variable: &Variable) -> bool {
    matches!(variable.home, Home::Circle { .. })
}

/// Quaternions among the starts of states as such of length 1.
///
/// # Errors
/// One without a length.
pub(crate) fn started(states: &[Variable], starts: &mut [f64], whose: &str) -> Result<(), Error> {
    for (place, name) in firsts(states) {
        let own = &mut starts[place..place + 4];
        let mut q: [f64; 4] = [0.0; 4];
        q.copy_from_slice(own);
        let Some(q) = unit(q) else {
            let message = format!(
                "{whose}: the quaternion {name} starts with length 0, which is no rotation"
            );
            let hint = format!(
                "give it a start in the model, Real {name}[4](start = {{1, 0, 0, 0}}), or in `initial`"
            );
            return Err(Error::input(message).hint(hint));
        };
        own.copy_from_slice(&q);
    }
    Ok(())
}
