//! The triangular form and its constant gain: Δ_θ, S by Lemma 1 or given, r, and the window
//! of Theorem 2.

use lynkeus_expr::Node;
use lynkeus_gain::{Bounds, Tridiagonal, lemma1};
use lynkeus_structure::Assignment;

use super::said::Said;
use super::settings::Settings;
use crate::conditions::Partial;
use crate::estimate::{PlantCopy, Speed};
use crate::peaking::Transient;
use crate::{ParameterValue, Reason, TuningError, peaking};

/// The triangular form of a plant with the facts about its partials.
pub struct Form {
    pub assignment: Assignment,
    /// per chain, j = 1 … n−1
    pub(crate) partials: Vec<Vec<Partial>>,
}

/// The numbers of the gain.
pub(super) struct Gains<'s> {
    pub θ: Vec<f64>,
    pub δ: Vec<f64>,
    pub r: Vec<f64>,
    pub S: Vec<Tridiagonal>,
    pub divided: bool,
    pub transient: Option<&'s Transient>,
}

impl<'s> Gains<'s> {
    pub fn new(form: &Form, settings: &'s Settings) -> Result<Self, TuningError> {
        let count = form.assignment.chains.len();
        let θ = settings.θ()?;
        let divided = settings.divided;
        let (S, ρ) = match &settings.S {
            Some(S) => (S.clone(), None),
            None => lemma1_matrices(form, divided)?,
        };
        let r = match &settings.r {
            Some(r) => r.clone(),
            // (9) with r = ρ/2; an explicit S comes without its ρ: the example's r = 1
            None => vec![ρ.map_or(1.0, |ρ| ρ / 2.0); count],
        };
        Ok(Self {
            θ,
            δ: exponents(form, settings),
            r,
            S,
            divided,
            transient: settings.remedies.transient.as_ref(),
        })
    }

    /// r Δ_θ S⁻¹Cᵀ of chain i.
    pub fn chain(&self, i: usize) -> Vec<f64> {
        let power = |j: usize| self.θ[i].powf(self.δ[i] * (j + 1) as f64);
        let column = self.S[i].gain().into_iter().enumerate();
        column.map(|(j, s)| self.r[i] * power(j) * s).collect()
    }

    /// The same at time t, for the chain's θ.
    pub fn timed(&self, copy: &PlantCopy<'_, '_>, i: usize, θ: &Speed) -> Vec<Node> {
        let exponent = |j: usize| self.δ[i] * (j + 1) as f64;
        let constants = self.chain(i).into_iter().enumerate();
        let steady: Vec<(f64, f64)> = constants.map(|(j, gain)| (gain, exponent(j))).collect();
        peaking::gains(self.transient, copy, i, θ, &steady)
    }

    /// The numbers, for the reader.
    pub fn parameters(&self) -> Vec<(String, ParameterValue)> {
        let row = |name: String, numbers: &[f64]| (name, numbers.to_vec().into());
        let mut rows = vec![
            row("θ".to_owned(), &self.θ),
            row("δ".to_owned(), &self.δ),
            row("r".to_owned(), &self.r),
        ];
        rows.extend(self.transient.map(Transient::parameter));
        for (i, s) in self.S.iter().enumerate() {
            rows.push(row(format!("S{} diagonal", i + 1), s.diagonal()));
            rows.push(row(format!("S{} beside it", i + 1), s.off_diagonal()));
        }
        rows
    }
}

fn lemma1_matrices(
    form: &Form,
    divided: bool,
) -> Result<(Vec<Tridiagonal>, Option<f64>), TuningError> {
    let found = |chain: &Vec<Partial>| {
        let bounds = |p: &Partial| match divided {
            // dividing by the partials leaves a chain of integrators
            true => Bounds {
                lower: 1.0,
                upper: 1.0,
            },
            false => Bounds {
                lower: p.bounds.0,
                upper: p.bounds.1,
            },
        };
        let bounds: Vec<Bounds> = chain.iter().map(bounds).collect();
        lemma1::construct(&bounds).map_err(|error| {
            let expected = "partial derivatives with known positive bounds for Lemma 1; declare min and max in the model, give S, or set partials = true";
            TuningError::new("gain", expected, error)
        })
    };
    let found: Vec<_> = form.partials.iter().map(found).collect::<Result<_, _>>()?;
    let ρ = found.last().map(|found| found.ρ);
    Ok((found.into_iter().map(|found| found.S).collect(), ρ))
}

/// δ: given, or δ = 1 for the leading chain and 2n₁/(2nᵢ−1) for another, the middle of Theorem 2's window. Two of
/// these then are in theirs: |nᵢδᵢ − nₖδₖ| = |δᵢ − δₖ|/2.
pub(super) fn exponents(form: &Form, settings: &Settings) -> Vec<f64> {
    if let Some(δ) = &settings.δ {
        return δ.clone();
    }
    let lengths = form.assignment.lengths();
    let lead = form.assignment.leading;
    let exponent = |i: usize| match i == lead {
        true => 1.0,
        false => 2.0 * lengths[lead] as f64 / (2.0 * lengths[i] as f64 - 1.0),
    };
    (0..lengths.len()).map(exponent).collect()
}

/// Theorem 2: (2n₁−1)/(2n₂−1) δ₁ < δ₂ < (2n₁+1)/(2n₂−1) δ₁, where the second chain follows the first.
///
/// Two chains that follow another one meet at their last equations alone: |nᵢδᵢ − nₖδₖ| < (δᵢ + δₖ)/2, which is
/// (2nᵢ−1)/(2nₖ+1) δᵢ < δₖ < (2nᵢ+1)/(2nₖ−1) δᵢ.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window {
    /// the chains i and k
    pub pair: [usize; 2],
    /// whether the first one leads
    pub leads: bool,
    pub low: f64,
    pub high: f64,
    /// δₖ/δᵢ
    pub ratio: f64,
}

impl Window {
    /// Of every two chains; none of one chain.
    pub fn of(assignment: &Assignment, δ: &[f64]) -> Vec<Self> {
        Self::all(&assignment.lengths(), assignment.leading, δ)
    }

    /// What the reader should know of an observer with these exponents.
    pub fn notes(assignment: &Assignment, δ: &[f64]) -> Vec<Reason> {
        let windows = Self::of(assignment, δ);
        windows.iter().filter_map(Self::note).collect()
    }

    /// The same by the chains' lengths.
    pub fn all(lengths: &[usize], lead: usize, δ: &[f64]) -> Vec<Self> {
        let others = (0..lengths.len()).filter(|&i| i != lead);
        let order: Vec<usize> = std::iter::once(lead).chain(others).collect();
        let mut found = vec![];
        for (place, &i) in order.iter().enumerate() {
            for &k in &order[place + 1..] {
                let [first, second] = [i, k].map(|chain| 2.0 * lengths[chain] as f64);
                let leads = i == lead;
                found.push(Self {
                    pair: [i, k],
                    leads,
                    low: (first - 1.0) / if leads { second - 1.0 } else { second + 1.0 },
                    high: (first + 1.0) / (second - 1.0),
                    ratio: δ[k] / δ[i],
                });
            }
        }
        found
    }

    pub fn holds(&self) -> bool {
        self.low < self.ratio && self.ratio < self.high
    }

    /// What the reader should know of an observer outside of it.
    fn note(&self) -> Option<Reason> {
        let Self {
            low, high, ratio, ..
        } = *self;
        (!self.holds()).then(|| Said::OutsideWindow { low, high, ratio }.into())
    }
}
