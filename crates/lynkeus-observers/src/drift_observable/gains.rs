//! The numbers of the gain, and the matrices that they make.

use lynkeus_gain::vandermonde::{self, Lemma32, Pole};
use lynkeus_proof::magnitude::{root, times};
use lynkeus_structure::Extended;

use super::form::Form;
use super::keys::Needed;
use super::poles::spaced;
use super::settings::Settings;
use super::variant::Variant;
use crate::TuningError;

/// Default ratio of the filter's slowest pole to that of the observer: that of the
/// paper's example.
const FILTER_SPEED: f64 = 10.0;

/// The numbers of the gain.
#[derive(Debug)]
pub(super) struct Gains {
    /// eigenvalues and K per output, empty where the output is not used
    pub λ: Vec<Vec<Pole>>,
    pub K: Vec<Vec<f64>>,
    /// per input: eigenvalues, K₂ and x̂_a(0); empty where no filter is needed
    pub filter_λ: Vec<Vec<Pole>>,
    pub K2: Vec<Vec<f64>>,
    pub filter_start: Vec<Vec<f64>>,
    /// per input: the filter's eigenvalues are set by the observer's slowest one, not by the study
    pub filter_follows: Vec<bool>,
    /// what Lemma 3.2 gave, per output that it was used for
    pub lemma: Vec<Lemma32>,
}

impl Gains {
    pub fn new(
        extended: &Extended<'_>,
        settings: &Settings,
        form: &Form,
    ) -> Result<Self, TuningError> {
        let (λ, lemma) = match settings.poles(&form.indices)? {
            Some(λ) => (λ, vec![]),
            None => by_lemma(settings, &form.indices)?,
        };
        let filters: Vec<usize> = match form.variant {
            Variant::Practical => form.U.iter().map(Vec::len).collect(),
            _ => vec![0; form.U.len()],
        };
        let needed = Needed::new(extended, filters.clone());
        let filter_slowest = -FILTER_SPEED * slowest(&λ);
        let filter_given = settings.filter_poles(&needed)?;
        let filter_follows = filter_given.iter().map(Option::is_none).collect();
        let filter_λ: Vec<Vec<Pole>> = filter_given
            .into_iter()
            .zip(&filters)
            .map(|(given, &order)| given.unwrap_or_else(|| spaced(filter_slowest, order)))
            .collect();
        let start = |j: usize| {
            let mut start = vec![0.0; filters[j]];
            if let Some(u) = start.first_mut() {
                *u = extended.inputs[j].start.unwrap_or(0.0);
            }
            start
        };
        let filter_start = settings.filter_initial(&needed)?.into_iter();
        let filter_start = filter_start
            .enumerate()
            .map(|(j, given)| given.unwrap_or_else(|| start(j)))
            .collect();
        let place = |λ: &Vec<Pole>| vandermonde::place_all(λ);
        Ok(Self {
            K: λ.iter().map(place).collect(),
            K2: filter_λ.iter().map(place).collect(),
            λ,
            filter_λ,
            filter_start,
            filter_follows,
            lemma,
        })
    }
}

fn by_lemma(
    settings: &Settings,
    μ: &[usize],
) -> Result<(Vec<Vec<Pole>>, Vec<Lemma32>), TuningError> {
    let found = settings.lemma(μ)?;
    let poles = |lemma: &Option<Lemma32>| {
        let poles = lemma.iter().flat_map(|lemma| &lemma.poles);
        poles.map(|&λ| Pole::Real(λ)).collect()
    };
    Ok((
        found.iter().map(poles).collect(),
        found.into_iter().flatten().collect(),
    ))
}

/// The smallest decay among the poles.
pub(super) fn slowest(λ: &[Vec<Pole>]) -> f64 {
    λ.iter()
        .flatten()
        .fold(f64::INFINITY, |m, λ| m.min(-λ.re()))
}

/// A − KC, a block per chain.
pub(super) fn closed_loop(K: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let n = K.iter().map(Vec::len).sum();
    let mut A = vec![vec![0.0; n]; n];
    let mut start = 0;
    for K in K {
        for (k, gain) in K.iter().enumerate() {
            A[start + k][start] = -gain;
            if k + 1 < K.len() {
                A[start + k][start + k + 1] += 1.0;
            }
        }
        start += K.len();
    }
    A
}

/// Columns √m s_k e_k for the m numbers s_k > 0.
pub(super) fn spread(s: &[f64]) -> Vec<Vec<f64>> {
    let rows: Vec<usize> = (0..s.len()).filter(|&k| s[k] > 0.0).collect();
    let root = root(rows.len() as f64);
    let row = |k: usize| {
        let entry = |&column: &usize| if column == k { times(root, s[k]) } else { 0.0 };
        rows.iter().map(entry).collect()
    };
    (0..s.len()).map(row).collect()
}
