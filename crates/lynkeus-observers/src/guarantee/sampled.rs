//! Guarantees for sensors that are sampled, the measurements following the model between.
//!
//! Between samples w' = L_f h(x̂) (`between_samples = "predict"`), so that an innovation h(x̂) − w changes by nothing but
//! the correction itself: in the units of the state s that the sensor shows, σ' = F_s(x̂, σ) − F_s(x̂, 0). With
//! e' = F(x̂, σ) − F(x, 0) that is an error system over (e, σ) whose slopes are those of the continuous observer, and a
//! sample sets σ to e_s. Where the observer reads w apart from the innovation, too, w − y = c (e_s − σ) has slopes of its
//! own. A Lyapunov function of the time since the last sample proves its decay for every sequence of
//! samples that are never further apart than some interval ([`lynkeus_proof::decay::SampledProof`]).
//!
//! Readings that are held instead are off by what the output moves meanwhile, at most interval·(|L_f h| + c·drift_s): an
//! error of measurement like others, which the proof for continuous sensors counts.
//!
//! With |w_i| ≤ drift_i acting on the plant and |ν_j| ≤ noise_j on the readings, s = √V obeys s' ≤ −rate·s + β between
//! samples, β the largest √(dᵀP(τ)d), and s² grows by at most ρ² = νᵀP(0)ν at each. Where samples are δ apart, with
//! a = e^(−rate·δ) and b = (1 − a)·β/rate, s⁺² = (a s⁺ + b)² + ρ² in the end, and |e_i| ≤ s⁺·√(P(0)⁻¹)_ii.

use std::collections::HashMap;

use lynkeus_expr::{Budget, Interval, MissingInput, Node};
use lynkeus_gain::sampling::{SampledError, Switching};
use lynkeus_proof::decay::{self, ErrorModel, Field, SampledProof, Samples, Sector};
use lynkeus_proof::matrix::sum;
use lynkeus_structure::{AugmentedPlant, Dimension, Innovation, Slopes, range};
use nalgebra::DMatrix;

use super::error_system::{Apart, expanded, readings, seen_by, size};
use super::said::Said;
use super::together;
use super::{Claim, SEARCH, certify, finite_bounds, spread};
use crate::field::Joint;
use crate::{Assumptions, Bounds, DesignError, Observer};

/// The share of the rate with continuous sensors at which the longest interval is sought.
const SLOW: f64 = 0.01;

/// Slopes are taken together where that makes the interval this much longer.
const LONGER: f64 = 1.2;

/// Equal samples this much further apart than the longest interval at which the error was seen to shrink let it grow: that
/// interval is known to a hundredth.
const BEYOND: f64 = 1.015;

/// How often what lies between that rate and the continuous one is halved, for given samples.
const HALVINGS: usize = 5;

/// What is proved of an observer whose readings are samples.
#[derive(Clone, Debug)]
pub struct SampledDecay {
    /// for the longest interval that was found
    pub longest: AtSamples,
    /// for the samples that were asked about; none where these are not proved
    pub at: Option<AtSamples>,
    /// whether slopes count as they are together at each point of the box, or apart
    pub together: bool,
    /// an interval T such that some sequence of samples at most T apart lets the error grow, with slopes that change within
    /// their ranges, or from one point of the box to another, as the proof allows; infinite where it was not seen to
    /// grow: what no proof of its kind can reach
    pub broken: f64,
    /// for readings that are held from one to the next of those; none where nothing bounds what they leave
    pub held: Option<AtSamples>,
    /// a limit that ended the search
    pub spent: Option<Said>,
}

/// What is proved for every sequence of samples at most some interval apart: with V = eᵀPe where one comes,
/// eᵀPe ≤ e^(−2·rate·t)·V from there on.
#[derive(Clone, Debug)]
pub struct AtSamples {
    /// the longest time from a sample to the next
    pub interval: f64,
    /// the rate at which the error decays, 1/time unit
    pub rate: f64,
    /// P, in the order of the augmented states
    pub lyapunov: DMatrix<f64>,
    /// c of |e(t)| ≤ c·e^(−rate·t)·|e(0)|
    pub overshoot: Option<f64>,
    /// what is left in the end of what acts and of errors of measurement, where samples are just so far apart
    pub ultimate: Option<Bounds>,
}

/// The longest interval between samples for which the error is proved to decay, and what is proved for samples
/// `interval` apart; `continuous` is the rate proved for sensors that are read continuously.
///
/// # Errors
/// Parameters without value.
pub fn between_samples(
    augmented: &AugmentedPlant<'_>,
    observer: &Observer,
    assumptions: &Assumptions,
    continuous: f64,
    interval: Option<f64>,
) -> Result<Result<SampledDecay, Said>, DesignError> {
    let graph = augmented.graph();
    let found = graph.budgeted(graph.budget().part(1.0), || {
        let system = match SampledSystem::new(augmented, observer, assumptions)? {
            Ok(system) => system,
            Err(said) => return Ok(Err(said)),
        };
        let decay = system.decay(augmented, assumptions, continuous, interval);
        let held = match interval {
            Some(interval) => {
                system.held(augmented, observer, assumptions, continuous, interval)?
            }
            None => None,
        };
        Ok(decay.map(|decay| SampledDecay { held, ..decay }))
    });
    found.unwrap_or_else(|spent| Ok(Err(Said::LongerSought(spent))))
}

/// (e, σ)' = 𝒜(θ) (e, σ) with what the proofs need.
struct SampledSystem {
    models: Vec<ErrorModel>,
    /// 𝒜 over (e, w − y) at every point of the box, where it depends on few numbers
    joint: Option<Joint>,
    /// per sensor: the state that it shows
    shown: Vec<usize>,
    /// per sensor: |c| of y = c·x + d
    slopes: Vec<f64>,
    scale: Vec<f64>,
}

impl SampledSystem {
    /// Of an observer whose states are the estimate, and outputs that each show one.
    fn new(
        augmented: &AugmentedPlant<'_>,
        observer: &Observer,
        assumptions: &Assumptions,
    ) -> Result<Result<Self, Said>, MissingInput> {
        let graph = augmented.graph();
        let n = augmented.states.len();
        if observer.filter.is_some() || !observer.is_the_estimate(n) {
            let states = observer.states.len();
            return Ok(Err(Said::OtherStates {
                states,
                estimated: n,
            }));
        }
        let (mut shown, mut slopes) = (vec![], vec![]);
        for output in &augmented.outputs {
            let state = output.state.and_then(|(state, slope, offset)| {
                let still = graph.symbols_of(&[offset]).is_empty();
                Some((
                    state,
                    graph.constant_value(slope).filter(|c| *c != 0.0 && still)?,
                ))
            });
            let Some((state, slope)) = state else {
                return Ok(Err(Said::ShowsNoState(output.variable.name.clone())));
            };
            shown.push(state);
            slopes.push(slope);
        }
        let models = models(augmented, observer, assumptions, &shown)?;
        let region = seen_by(augmented, observer, assumptions)?;
        Ok(Ok(Self {
            joint: together::sampled(augmented, observer, &region, (&shown, &slopes))?,
            models: models
                .iter()
                .map(|m| folded(m, n, &shown, &slopes))
                .collect(),
            shown,
            slopes: slopes.iter().map(|c| c.abs()).collect(),
            scale: augmented.states.iter().map(size).collect(),
        }))
    }

    fn decay(
        &self,
        augmented: &AugmentedPlant<'_>,
        assumptions: &Assumptions,
        continuous: f64,
        interval: Option<f64>,
    ) -> Result<SampledDecay, Said> {
        let search = augmented.graph().budget().part(SEARCH);
        let found = match &self.joint {
            None => Found {
                longest: self.longest(continuous * SLOW, &search),
                ..Found::default()
            },
            Some(joint) => joint.field(|field| self.together(field, continuous, interval, &search)),
        };
        let longest = found.longest.ok_or_else(|| {
            let spent = search.marked().map(Said::LongerSought);
            spent.unwrap_or(Said::NoInterval)
        })?;
        let asked = interval.filter(|interval| *interval <= longest.interval);
        let proved = |interval: f64, proof: &SampledProof| AtSamples {
            interval,
            rate: proof.rate,
            lyapunov: self.of_estimate(proof),
            overshoot: spread(&self.of_estimate(proof)),
            ultimate: self.ultimate(augmented, assumptions, proof, interval),
        };
        let at = asked.map(|interval| {
            let apart = |rate: f64| self.proof(interval, rate, &search);
            let proof = found
                .at
                .unwrap_or_else(|| fastest(&longest, continuous, &search, apart));
            proved(interval, &proof)
        });
        Ok(SampledDecay {
            longest: proved(longest.interval, &longest),
            at,
            together: found.broken.is_some(),
            broken: found.broken.unwrap_or_else(|| self.broken(&self.models)),
            held: None,
            spent: search.marked().map(Said::LongerSought),
        })
    }

    /// What is proved with the slopes together, where that reaches further than apart.
    fn together(
        &self,
        field: &Field<'_>,
        continuous: f64,
        interval: Option<f64>,
        search: &Budget,
    ) -> Found {
        let apart = self.longest(continuous * SLOW, search);
        let least = apart.as_ref().map(|proof| LONGER * proof.interval);
        let mut samples = Samples::new(field, (&self.shown, &self.scale), continuous, search);
        let Some(longest) = samples.longest(continuous * SLOW, least) else {
            return Found {
                longest: apart,
                ..Found::default()
            };
        };
        let asked = interval.filter(|interval| *interval <= longest.interval);
        samples.replenish();
        let at = asked.map(|interval| {
            fastest(&longest, continuous, search, |rate| {
                let apart = self.proof(interval, rate, search);
                apart.or_else(|| samples.prove(interval, rate))
            })
        });
        Found {
            at,
            broken: Some(self.broken(samples.models())),
            longest: Some(longest),
        }
    }

    /// The shortest interval T found such that some sequence of samples at most T apart lets the error grow. It is sought
    /// where equal samples and slopes that stay let it grow in the end.
    fn broken(&self, models: &[ErrorModel]) -> f64 {
        let n = self.scale.len();
        let mut C = DMatrix::zeros(self.shown.len(), n);
        for (j, &state) in self.shown.iter().enumerate() {
            C[(j, state)] = 1.0;
        }
        let S = decay::between_errors(n + self.shown.len(), &self.shown);
        // a choice is of a model and, slope by slope, of an end or the middle of its range
        let slopes = models.iter().map(|m| m.sectors.len()).max().unwrap_or(0);
        let counts = [vec![models.len()], vec![3; slopes]].concat();
        let of = |choice: &[usize]| {
            let model = &models[choice[0]];
            let slope = |(sector, place): (&Sector, &usize)| match place {
                0 => sector.range.lo(),
                1 => sector.range.hi(),
                _ => sector.middle(),
            };
            let θ: Vec<f64> = model.sectors.iter().zip(&choice[1..]).map(slope).collect();
            &S * model.at(&θ) * &S
        };
        let places = if slopes > 0 { 0..3 } else { 0..1 };
        let alike = |model: usize| {
            let places = places.clone();
            places.map(move |place| [vec![model], vec![place; slopes]].concat())
        };
        let (mut equal, mut worst) = (f64::INFINITY, None);
        for choice in (0..models.len()).flat_map(alike) {
            let error = SampledError::new(of(&choice), &C);
            let interval = error.map_or(equal, |error| error.predict(equal));
            if interval < equal {
                (equal, worst) = (interval, Some(choice));
            }
        }
        let switching = Switching {
            of: &of,
            counts: &counts,
            n,
        };
        // it shrinks at `equal`, and grows from there on
        let longest = BEYOND * equal;
        let found = worst.and_then(|staying| switching.grows_from(&staying, longest));
        found.unwrap_or(f64::INFINITY)
    }

    fn proof(&self, interval: f64, rate: f64, budget: &Budget) -> Option<SampledProof> {
        let claim = (interval, rate);
        decay::prove_between_samples(&self.models, &self.shown, &self.scale, claim, budget)
    }

    fn longest(&self, rate: f64, budget: &Budget) -> Option<SampledProof> {
        decay::longest(&self.models, &self.shown, &self.scale, rate, budget)
    }

    /// What the proof for continuous sensors makes of readings that are held.
    fn held(
        &self,
        augmented: &AugmentedPlant<'_>,
        observer: &Observer,
        assumptions: &Assumptions,
        continuous: f64,
        interval: f64,
    ) -> Result<Option<AtSamples>, DesignError> {
        let graph = augmented.graph();
        let mut noise = vec![];
        let sensors = self.shown.iter().zip(&self.slopes).enumerate();
        for (j, (&state, &slope)) in sensors {
            let moves = range(graph, augmented.derivatives[state], &assumptions.region)?;
            let drift = assumptions.drift.get(state).copied().unwrap_or(0.0);
            let speed = Interval::point(moves.enclosure.magnitude()) + Interval::point(drift);
            let moved = Interval::point(interval) * Interval::point(slope) * speed;
            let ν = assumptions.noise.get(j).copied().unwrap_or(0.0);
            noise.push((moved + Interval::point(ν)).hi());
        }
        if noise.iter().any(|ν| !ν.is_finite()) || assumptions.is_moved() {
            return Ok(None);
        }
        let off = assumptions.clone().with_noise(noise);
        let found = certify(augmented, observer, &off, Claim::At(continuous))?;
        let at = (found.rate, found.lyapunov, found.ultimate_bound);
        let (Some(rate), Some(lyapunov), Some(norm)) = at else {
            return Ok(None);
        };
        let states = found.ultimate;
        Ok(Some(AtSamples {
            interval,
            rate,
            lyapunov,
            overshoot: found.overshoot,
            ultimate: Some(Bounds { norm, states }),
        }))
    }

    /// P(0) for e alone: eᵀPe is at most V at every time.
    fn of_estimate(&self, proof: &SampledProof) -> DMatrix<f64> {
        let n = self.scale.len();
        proof.P[0].view((0, 0), (n, n)).into_owned()
    }

    /// What is left of the error in the end where samples are `apart` from each other; none where what acts has no
    /// bound.
    fn ultimate(
        &self,
        augmented: &AugmentedPlant<'_>,
        assumptions: &Assumptions,
        proof: &SampledProof,
        apart: f64,
    ) -> Option<Bounds> {
        let n = self.scale.len();
        let drift = |i: usize| assumptions.drift.get(i).copied().unwrap_or(0.0);
        let acting = (0..n).chain(self.shown.iter().copied()).map(drift);
        let acting: Vec<Interval> = acting.map(Interval::point).collect();
        let noise = assumptions.noise.iter().zip(&self.slopes);
        let noise = noise.map(|(ν, c)| Interval::point(*ν) / Interval::point(*c));
        let noise: Vec<Interval> = std::iter::repeat_n(Interval::ZERO, n)
            .chain(noise)
            .collect();
        let everything = acting.iter().chain(&noise).all(|x| x.hi().is_finite());
        if !everything || assumptions.is_moved() || proof.rate <= 0.0 {
            return None;
        }
        let β = proof.P.iter().map(|P| form(P, &acting).sqrt().hi());
        let β = Interval::point(β.fold(0.0, f64::max));
        let ρ2 = form(&proof.P[0], &noise);
        let rate = Interval::point(proof.rate);
        let a = (-(rate * Interval::point(apart))).exp();
        let b = (Interval::ONE - a) * β / rate;
        let lost = Interval::ONE - a * a;
        let root = (a * a * b * b + lost * (b * b + ρ2)).sqrt();
        let s = (a * b + root) / lost;
        finite_bounds(augmented, &self.of_estimate(proof), Interval::point(s.hi()))
    }
}

/// What is proved before it is told.
#[derive(Default)]
struct Found {
    longest: Option<SampledProof>,
    /// for the interval asked about, where slopes count together
    at: Option<SampledProof>,
    /// the shortest interval found that lets the error grow, where slopes count together
    broken: Option<f64>,
}

/// The fastest rate found by trials that is not slower than that of a proof.
fn fastest(
    slow: &SampledProof,
    continuous: f64,
    budget: &Budget,
    mut trial: impl FnMut(f64) -> Option<SampledProof>,
) -> SampledProof {
    let (mut low, mut high) = (slow.rate, continuous);
    let mut best = slow.clone();
    for _ in 0..HALVINGS {
        if budget.spent().is_some() {
            break;
        }
        let rate = (low * high).sqrt();
        match trial(rate) {
            Some(proof) => (low, best) = (rate, proof),
            None => high = rate,
        }
    }
    best
}

/// The error systems over (e, σ, w − y), of observers that read a measurement apart from its innovation, too; the rows of
/// w − y are left 0.
fn models(
    augmented: &AugmentedPlant<'_>,
    observer: &Observer,
    assumptions: &Assumptions,
    shown: &[usize],
) -> Result<Vec<ErrorModel>, MissingInput> {
    let graph = augmented.graph();
    let n = augmented.states.len();
    let mut apart = Apart::new(
        augmented,
        observer,
        &seen_by(augmented, observer, assumptions)?,
    )?;
    let zero = graph.constant(0.0).node();
    let seen = readings(augmented, observer);
    let vanishing = apart.read.iter().map(|(_, own)| (own.symbol, zero));
    let right: HashMap<Node, Node> = vanishing.chain(seen).collect();
    let uncorrected = graph.substitute(&apart.derivatives, &right);
    let correction = |&state: &usize| {
        let (with, without) = (apart.derivatives[state], uncorrected[state]);
        (graph.expr(with) - graph.expr(without)).node()
    };
    let corrections: Vec<Node> = shown.iter().map(correction).collect();
    let still = vec![zero; shown.len()];
    let derivatives = [&apart.derivatives[..], &corrections, &still].concat();
    let place = |(sensor, own): &(usize, Innovation)| Innovation {
        symbol: own.symbol,
        state: n + sensor,
    };
    let innovations: Vec<Innovation> = apart.read.iter().map(place).collect();
    // the innovations have their columns by themselves
    let idle: Vec<Node> = shown
        .iter()
        .map(|_| graph.fresh("no state").node())
        .collect();
    let sides = idle
        .iter()
        .map(|&symbol| Dimension::new("no state", symbol, 0.0, 0.0));
    apart.region.dimensions.extend(sides);
    let hats = observer.states.iter().map(|(signal, _)| signal.symbol);
    let measured = observer.measured.iter().map(|signal| signal.symbol);
    let symbols: Vec<Node> = hats.chain(idle).chain(measured).collect();
    let all = Slopes::new(graph, &derivatives, &symbols, &innovations, &apart.region)?;
    Ok(expanded(&all.models))
}

/// The model over (e, σ): w − y = c (e_s − σ) for the sensor that shows c·x_s.
fn folded(model: &ErrorModel, n: usize, shown: &[usize], slopes: &[f64]) -> ErrorModel {
    let size = n + shown.len();
    let mut folded = ErrorModel {
        constant: model.constant[..size].to_vec(),
        sectors: vec![],
    };
    for row in &mut folded.constant {
        let apart: Vec<Interval> = row.split_off(size);
        for (j, entry) in apart.into_iter().enumerate() {
            let moved = entry * Interval::point(slopes[j]);
            row[shown[j]] = row[shown[j]] + moved;
            row[n + j] = row[n + j] - moved;
        }
    }
    for sector in &model.sectors {
        let of = |column: usize, factor: f64| {
            let direction = sector.direction[..size].iter();
            Sector {
                column,
                direction: direction.map(|b| *b * Interval::point(factor)).collect(),
                range: sector.range,
            }
        };
        match sector.column.checked_sub(size) {
            None => folded.sectors.push(of(sector.column, 1.0)),
            Some(j) => folded
                .sectors
                .extend([of(shown[j], slopes[j]), of(n + j, -slopes[j])]),
        }
    }
    folded
}

/// An upper bound of dᵀPd for every d within these bounds of its entries.
fn form(P: &DMatrix<f64>, bounds: &[Interval]) -> Interval {
    let n = bounds.len();
    let pairs = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
    sum(pairs.map(|(i, j)| Interval::point(P[(i, j)]).abs() * bounds[i] * bounds[j]))
}
