//! What every family does alike: the copy of the plant that runs on the estimate.
//!
//! The papers' prolongation of f outside of the box (Remark 2 of Hammouri, Targui and
//! Armanet; Remark 1 of Lee, Yee and Park).
//!
//! With P the projection on the box of the declared ranges and, for each row j of a chain, a
//! number ā_j within the bounds [α₁, α₂] of its partial, sign included,
//!
//! f̃_j(x) = f_j(Px) + ā_j (x_{j+1} − Px_{j+1}).
//!
//! In x_{j+1} the slope of f̃_j is that of f_j at Px inside of the range and ā_j outside of
//! it, hence in [α₁, α₂] everywhere; in every other variable it is that of f_j at Px or zero.
//! So all bounds that hold on the box hold everywhere, and f̃ = f on the box. A slope that
//! follows Px would not do: times a distance without bound, its own change has none.

use std::collections::HashMap;

use lynkeus_expr::{Expr, Graph, Node};
use lynkeus_model::{Variable, Whens};
use lynkeus_structure::{AugmentedPlant, Measurement, Region};

use crate::conditions::Partial;
use crate::tuning::is_or_has;
use crate::{
    Estimate, Initial, KeySpec, Observer, Reason, Shape, Signal, Tunable, Tuning, TuningError,
};

impl Tuning {
    /// The same where the keys of every observer can be used.
    pub(crate) fn checked(&self) -> Result<Self, TuningError> {
        self.flag(PROLONG.name)?;
        Ok(self.clone())
    }

    /// Whether the plant's functions are continued outside of the declared ranges.
    pub(crate) fn prolongs(&self) -> bool {
        self.flag(PROLONG.name).unwrap_or(false)
    }
}

/// The plant's expressions over the estimate.
pub(crate) struct PlantCopy<'e, 'p> {
    pub augmented: &'e AugmentedPlant<'p>,
    /// x̂, one per augmented state
    pub hats: Vec<Signal>,
    /// y, one per measured output
    pub measured: Vec<Signal>,
    /// x ↦ x̂, limited to [min, max] if the tuning says so
    seen: HashMap<Node, Node>,
    pub common: &'e Tuning,
}

impl<'e, 'p> PlantCopy<'e, 'p> {
    pub fn new(augmented: &'e AugmentedPlant<'p>, common: &'e Tuning) -> Self {
        let graph = augmented.graph();
        let hat = |state: &Variable| Signal::fresh(graph, "estimate of", &state.name);
        let y = |o: &Measurement| Signal::fresh(graph, "measured", &o.variable.name);
        let mut copy = Self {
            augmented,
            hats: augmented.states.iter().map(hat).collect(),
            measured: augmented.outputs.iter().map(y).collect(),
            seen: HashMap::new(),
            common,
        };
        let seen =
            |(i, hat): (usize, &Signal)| (augmented.states[i].node, copy.seen_as(i, hat.symbol));
        copy.seen = copy.hats.iter().enumerate().map(seen).collect();
        copy
    }

    /// How the plant's functions see a state whose estimate is `hat`.
    pub fn seen_as(&self, state: usize, hat: Node) -> Node {
        match self.common.clamp || self.common.prolongs() {
            true => limited(self.augmented.graph(), hat, &self.augmented.states[state]),
            false => hat,
        }
    }

    /// Expressions of the plant at the estimate: f(x̂, u) from f(x, u).
    pub fn at_estimate(&self, expressions: &[Node]) -> Vec<Node> {
        self.augmented.graph().substitute(expressions, &self.seen)
    }

    /// The clauses by which the estimate jumps as the plant does.
    pub fn whens(&self) -> Whens {
        let augmented = self.augmented;
        let pairs = augmented.states.iter().zip(&self.hats);
        let hats = pairs.map(|(state, hat)| (state.node, hat.symbol)).collect();
        augmented.whens.substituted(augmented.graph(), &hats)
    }

    /// The same where some states, by their places, have another estimate.
    pub fn at_estimate_with(&self, expressions: &[Node], others: &[(usize, Node)]) -> Vec<Node> {
        let mut seen = self.seen.clone();
        let image =
            |&(i, hat): &(usize, Node)| (self.augmented.states[i].node, self.seen_as(i, hat));
        seen.extend(others.iter().map(image));
        self.augmented.graph().substitute(expressions, &seen)
    }

    /// x̂ with its starts.
    pub fn states(&self) -> Result<Vec<(Signal, f64)>, TuningError> {
        let starts = starts(self.augmented, &self.common.initial)?;
        Ok(self.hats.iter().cloned().zip(starts).collect())
    }

    /// The estimates where the observer's first states are x̂ itself.
    pub fn estimates(&self) -> Vec<Estimate> {
        let pairs = self.hats.iter().zip(&self.augmented.states).enumerate();
        let estimate = |(i, (hat, variable)): (usize, (&Signal, &Variable))| Estimate {
            variable: variable.clone(),
            node: hat.symbol,
            unknown_input: i >= self.augmented.plant_states(),
        };
        pairs.map(estimate).collect()
    }
}

/// Where states and unknown inputs start: at the named value, else the default, else the plant's `start`, else the
/// middle of the range, else 0.
///
/// # Errors
/// A name that is none of theirs.
pub fn starts(augmented: &AugmentedPlant<'_>, initial: &Initial) -> Result<Vec<f64>, TuningError> {
    let states = &augmented.states;
    let mut names = initial.values.keys();
    if let Some(name) = names.find(|n| !states.iter().any(|state| is_or_has(n, &state.name))) {
        return Err(no_such_estimate(augmented, "initial", name));
    }
    let start = |variable: &Variable| {
        initial
            .of(&variable.name)
            .or(initial.default)
            .or(variable.start)
            .unwrap_or_else(|| middle(variable))
    };
    Ok(states.iter().map(start).collect())
}

/// The error that a key names what is not estimated.
pub(crate) fn no_such_estimate(
    augmented: &AugmentedPlant<'_>,
    key: &str,
    name: &str,
) -> TuningError {
    let names: Vec<&str> = augmented.states.iter().map(|s| s.name.as_str()).collect();
    let expected = format!("names of estimated quantities ({})", names.join(", "));
    TuningError::new(key, expected, format!("\"{name}\""))
}

impl PlantCopy<'_, '_> {
    /// The measured value of the state that output `i` shows: y = slope·x + offset
    /// solved for x. None where the output is no affine function of one state.
    pub fn measured_state(&self, i: usize) -> Option<(usize, Node)> {
        let graph = self.augmented.graph();
        let output = &self.augmented.outputs[i];
        let (state, slope, offset) = output.state?;
        let x = (graph.expr(self.measured[i].symbol) - graph.expr(offset)) / graph.expr(slope);
        Some((state, x.node()))
    }

    /// x̂ − x as measured, for the state that output `i` shows.
    pub fn innovation(&self, i: usize) -> Option<Node> {
        let graph = self.augmented.graph();
        let (state, measured) = self.measured_state(i)?;
        let innovation = graph.expr(self.hats[state].symbol) - graph.expr(measured);
        Some(innovation.node())
    }

    /// An observer whose states are x̂ alone.
    pub fn observer(&self, derivatives: Vec<Node>) -> Result<Observer, TuningError> {
        let signal = |v: &Variable| Signal {
            name: v.name.clone(),
            symbol: v.node,
        };
        Ok(Observer {
            time: self.augmented.plant.time,
            states: self.states()?,
            derivatives,
            inputs: self.augmented.inputs.iter().map(signal).collect(),
            input_derivatives: vec![],
            generated: vec![],
            measured: self.measured.clone(),
            estimates: self.estimates(),
            monitors: vec![],
            filter: None,
            tunables: vec![],
            is_whole: false,
        })
    }
}

/// max(min, min(max, x̂)) with the ends that are declared.
pub(crate) fn limited(graph: &Graph, hat: Node, variable: &Variable) -> Node {
    let mut image = graph.expr(hat);
    if variable.max.is_finite() {
        image = image.min(graph.constant(variable.max));
    }
    if variable.min.is_finite() {
        image = image.max(graph.constant(variable.min));
    }
    image.node()
}

/// The middle of a range, 0 where it has none.
pub(crate) fn middle(variable: &Variable) -> f64 {
    let middle = variable.min + (variable.max - variable.min) / 2.0;
    if middle.is_finite() { middle } else { 0.0 }
}

/// The study's key.
pub(crate) const PROLONG: KeySpec = KeySpec {
    name: "prolong",
    shape: Shape::Flag,
    default: "false",
    meaning: "outside of the declared ranges the plant's functions are [prolonged](triangular.md#options) as the papers ask, so that the theorem holds for every start of the estimate",
};

/// Adds ā (x̂_next − Px̂_next) to the equations of a chain with these partials, if the study asks for it; `copy`
/// then evaluates everything else at Px̂.
///
/// # Errors
/// A partial without bounds.
pub(crate) fn prolong(
    copy: &PlantCopy<'_, '_>,
    states: &[usize],
    partials: &[Partial],
    derivatives: &mut [Node],
) -> Result<(), TuningError> {
    if !copy.common.prolongs() {
        return Ok(());
    }
    let graph = copy.augmented.graph();
    for (pair, partial) in states.windows(2).zip(partials) {
        let (row, next) = (pair[0], pair[1]);
        let variable = &copy.augmented.states[next];
        let Some(slope) = partial.nominal() else {
            let expected = format!(
                "∂f({})/∂{} with known bounds away from zero, to continue with; declare min and max",
                copy.augmented.states[row].name, variable.name
            );
            let found = format!("bounds {} and {}", partial.bounds.0, partial.bounds.1);
            return Err(TuningError::new(PROLONG.name, expected, found));
        };
        let hat = copy.hats[next].symbol;
        let outside = graph.expr(hat) - graph.expr(limited(graph, hat, variable));
        derivatives[row] = (graph.expr(derivatives[row]) + slope * outside).node();
    }
    Ok(())
}

/// Refuses the key where an observer has no such form.
pub(crate) fn refuse(common: &Tuning, observer: &str) -> Result<(), TuningError> {
    match common.prolongs() {
        true => Err(TuningError::new(
            PROLONG.name,
            format!("no prolongation with {observer}"),
            "true",
        )),
        false => Ok(()),
    }
}

/// Where the estimate may be for the guarantee to hold.
///
/// Everywhere only where the box of the proof is the one that the observer projects on and
/// takes its slopes from: a smaller one of states (`tube`) or of inputs has other bounds.
pub(crate) fn note(common: &Tuning, augmented: &AugmentedPlant<'_>, region: &Region) -> Reason {
    let whole = |variable: &Variable| {
        let mut sides = region.dimensions.iter();
        let side = sides.find(|d| d.symbol == variable.node);
        side.is_none_or(|d| d.min <= variable.min && d.max >= variable.max)
    };
    let declared = augmented.plant.states.iter().chain(&augmented.plant.inputs);
    match (common.prolongs(), declared.into_iter().all(whole)) {
        (true, true) => Reason::EveryStart,
        (true, false) => Reason::PartOfTheBox,
        (false, _) => Reason::InTheBox {
            clamp: common.clamp,
        },
    }
}

/// A speed that gains are powers of.
#[derive(Clone, Debug)]
pub(crate) struct Speed {
    /// the study's value
    value: f64,
    /// where it may be changed
    tunable: Option<Tunable>,
}

impl Speed {
    pub fn new(
        copy: &PlantCopy<'_, '_>,
        name: impl Into<String>,
        value: f64,
        meaning: String,
    ) -> Self {
        let name = name.into();
        let tunable = |name: String| Tunable {
            symbol: copy.augmented.graph().fresh(name.as_str()).node(),
            name,
            value,
            meaning,
        };
        Self {
            value,
            tunable: copy.common.tunable.then(|| tunable(name)),
        }
    }

    /// θ of each chain, in the order of the measured outputs.
    pub fn of_chains(copy: &PlantCopy<'_, '_>, θ: &[f64]) -> Vec<Self> {
        let outputs = copy.augmented.outputs.iter();
        let each = outputs.zip(θ).enumerate().map(|(i, (output, value))| {
            let output = &output.variable.name;
            match θ {
                [_] => Self::new(copy, "theta", *value, format!("θ of the gain of {output}")),
                _ => {
                    let meaning = format!("θ of the chain of {output}");
                    Self::new(copy, format!("theta[{}]", i + 1), *value, meaning)
                }
            }
        });
        each.collect()
    }

    /// The study's value.
    pub fn value(&self) -> f64 {
        self.value
    }

    /// The speed.
    pub fn expr<'g>(&self, graph: &'g Graph) -> Expr<'g> {
        match &self.tunable {
            Some(tunable) => graph.expr(tunable.symbol),
            None => graph.constant(self.value),
        }
    }

    /// A gain that is `gain` at the study's value and grows like a power of the speed.
    pub fn scaled<'g>(&self, graph: &'g Graph, gain: f64, exponent: f64) -> Expr<'g> {
        let gain = graph.constant(gain);
        match self.tunable {
            Some(_) => {
                let ratio = self.expr(graph) / graph.constant(self.value);
                gain * ratio.pow(graph.constant(exponent))
            }
            None => gain,
        }
    }
}

impl Observer {
    /// The same, of which these may be changed where the tuning asks for that.
    pub(crate) fn tuned_by<'s>(mut self, speeds: impl IntoIterator<Item = &'s Speed>) -> Self {
        let numbers = speeds.into_iter().filter_map(|speed| speed.tunable.clone());
        self.tunables.extend(numbers);
        self
    }
}
