//! Fixed steps: those that are asked for, those that are needed, and what is told of them.

use lynkeus_expr::Node;
use lynkeus_model::{Plant, Variable};
use lynkeus_run::{Blueprint, Fastest, Method, Step, System, fastest_mode, first_jump};
use lynkeus_words::short;

use crate::prepare::Prepared;
use crate::{Error, Study, prepare::systems};

/// How many of the steps that the fastest mode needs (|λ|h ≤ ½) are one with which the classical method
/// is stable for no mode that decays: all of its region left of the axis has |λ|h < 2.97.
const LONGEST: f64 = 5.94;

/// A step that is asked for.
///
/// # Errors
/// It is none.
pub fn sound(step: Option<f64>) -> Result<Option<f64>, Error> {
    match step {
        Some(step) if !(step > 0.0 && step.is_finite()) => Err(Error::input(format!(
            "--step: expected a finite number above 0, found {step}"
        ))),
        step => Ok(step),
    }
}

/// The next shorter step of one digit: 1, 2 or 5.
pub(crate) fn rounded(step: f64) -> f64 {
    let unit = 10.0_f64.powf(step.log10().floor());
    let digit = match step / unit {
        d if d >= 5.0 => 5.0,
        d if d >= 2.0 => 2.0,
        _ => 1.0,
    };
    // the nearest number with these digits
    format!("{digit}e{}", step.log10().floor())
        .parse()
        .unwrap_or(digit * unit)
}

/// What a step does that `estimate` and `simulate` do not.
pub fn bends(system: &System) -> Option<String> {
    let told = "the model bends with time alone (max, min, abs of time): lynkeus stops at these instants, here a step goes across them";
    system.bends_with_time().then(|| told.to_owned())
}

/// What fixed steps may lose of a plant that jumps with its state.
pub(crate) fn unlocated(plant: &Plant, method: Method) -> Option<String> {
    let Method::Rk4(_) = method else {
        return None;
    };
    let states: Vec<Node> = plant.states.iter().map(|state| state.node).collect();
    let jump = first_jump(&plant.graph, &states, &plant.derivatives)?;
    Some(format!(
        "with method = \"rk4\" steps go across where {jump} jumps: what happens between two crossings may be lost; method = \"adaptive\" ends its steps there"
    ))
}

/// With fixed steps: those asked for, those of the study, or such as the fastest mode needs.
pub fn stepped(
    prepared: &Prepared<'_>,
    made: Blueprint,
    step: Option<f64>,
    notes: &mut Vec<String>,
) -> Result<Blueprint, Error> {
    if let Some(step) = sound(step)? {
        return Ok(made.with_method(Method::Rk4(Step::AtMost(step))));
    }
    if let Method::Rk4(Step::AtMost(_) | Step::Substeps(_)) = made.run.method {
        return Ok(made);
    }
    let unsaid = Unsaid {
        study: prepared.study(),
        within: "",
        point: "sample",
        section: Some("estimate"),
    };
    let method = unsaid.method(fastest(prepared, &made), notes)?;
    Ok(made.with_method(method))
}

/// Fixed steps that neither the user nor the study gives.
pub struct Unsaid<'a> {
    /// what says nothing of them
    pub study: &'a Study,
    /// what they are for, or nothing
    pub within: &'static str,
    /// what they go between
    pub point: &'static str,
    /// where the study could give them
    pub section: Option<&'static str>,
}

impl Unsaid<'_> {
    /// Such as the fastest mode at the start needs, and told.
    ///
    /// # Errors
    /// Nothing is needed that is known.
    pub fn method(
        &self,
        fastest: Option<Fastest>,
        notes: &mut Vec<String>,
    ) -> Result<Method, Error> {
        let Self { within, point, .. } = self;
        let written = self.section.map(|section| {
            format!("write method = \"rk4\" and step = … under [{section}], or give --step")
        });
        let Some(fastest) = fastest else {
            let message = format!(
                "{within}the step cannot be chosen: the equations have no slopes at the start"
            );
            return Err(Error::input(message)
                .at(&self.study.file)
                .hint(written.unwrap_or_else(|| "give --step".to_owned())));
        };
        if fastest.step().is_infinite() {
            notes.push(format!("{within}one step from each {point} to the next: at the start nothing moves by itself; --step takes a longest step"));
            return Ok(Method::Rk4(Step::Substeps(1)));
        }
        let step = rounded(fastest.step());
        let place = match fastest.is_steep {
            true => {
                "a hundredth of the ranges off the start needs (at the start a slope is infinite)"
            }
            false => "at the start needs",
        };
        let unsaid = self.section.map_or_else(String::new, |section| {
            format!(": [{section}] has no method = \"rk4\" with `step`")
        });
        notes.push(format!(
            "{within}steps of {} at most, which the fastest mode {place}{unsaid}; --step takes another",
            short(step)
        ));
        Ok(Method::Rk4(Step::AtMost(step)))
    }
}

/// A value that an input may have.
pub fn typical(input: &Variable) -> f64 {
    let middle = 0.5 * (input.min + input.max);
    let middle = if middle.is_finite() { middle } else { 0.0 };
    input.start.or(input.nominal).unwrap_or(middle)
}

/// What an input is before anybody sets it: what the study has it at all the time, what the model starts it
/// with, else 0, or what of its range is next to it.
pub fn unset(study: &Study, plant: &Plant, input: &Variable) -> f64 {
    let given = study.simulate.iter().flat_map(|s| &s.inputs);
    let mut given = given.filter(|(name, _)| name.text == input.name);
    let written = given.next().and_then(|(_, expression)| {
        let node = systems::expression(plant, expression).ok()?;
        plant.graph.constant_value(node)
    });
    let nearest = 0.0_f64.max(input.min).min(input.max);
    written.or(input.start).unwrap_or(nearest)
}

/// How large a variable is: its range, its typical size, its start, else 1.
pub fn size(variable: &Variable) -> f64 {
    let width = Some(variable.max - variable.min);
    let known = [width, variable.nominal, variable.start];
    let mut sizes = known.into_iter().flatten().map(f64::abs);
    sizes.find(|size| size.is_normal()).unwrap_or(1.0)
}

/// Where fixed steps are so long that the method itself grows, if it is seen to.
pub fn hasty(prepared: &Prepared<'_>, made: &Blueprint) -> Option<String> {
    let Method::Rk4(Step::AtMost(step)) = made.run.method else {
        return None;
    };
    let longest = LONGEST * fastest(prepared, made)?.step();
    (step > longest).then(|| {
        format!(
            "not for these steps: they are {} at most, and beyond about {} the fastest mode at the start makes the method itself grow",
            short(step),
            short(longest)
        )
    })
}

/// The fastest mode at the start.
fn fastest(prepared: &Prepared<'_>, made: &Blueprint) -> Option<Fastest> {
    let plant = prepared.plant();
    let known = plant.inputs.iter();
    let known: Vec<(&str, f64)> = known.map(|i| (i.name.as_str(), typical(i))).collect();
    let sizes = made.flow.states().iter().map(|state| {
        let mut all = plant
            .states
            .iter()
            .chain(&plant.inputs)
            .chain(&plant.outputs);
        all.find(|v| v.name == *state).map_or(1.0, size)
    });
    fastest_mode(made, &known, &sizes.collect::<Vec<f64>>())
}

/// Fixed steps in words.
pub fn steps(method: Method) -> Option<String> {
    match method {
        Method::Rk4(Step::AtMost(h)) => Some(format!("steps of {h:?} at most")),
        Method::Rk4(Step::Substeps(n)) => Some(format!("{n} steps from sample to sample")),
        _ => None,
    }
}
