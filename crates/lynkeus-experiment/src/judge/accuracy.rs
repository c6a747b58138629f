//! How far estimates are from what is known to be true.

use std::f64::consts::{PI, TAU};

use lynkeus_model::Home;
use lynkeus_structure::Dimension;
use lynkeus_words::figures;
use serde::{Serialize, Serializer};

use crate::course::quantity::mean_square;
use crate::entries::finite;
use crate::words::instant;
use crate::{Quantity, Series};

/// Settled is an error below this share of the declared range.
pub(crate) const SETTLED: f64 = 0.05;

/// Quantities that are told of one by one.
const TOLD: usize = 6;

/// The error of one estimated quantity against the truth.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(
    feature = "schema",
    derive(schemars::JsonSchema),
    schemars(rename = "QuantityError")
)]
pub struct Accuracy {
    /// its name in the plant
    #[serde(skip)]
    pub quantity: String,
    /// root mean square over the last half of the rows, in the quantity's unit; none where its
    /// true value is known in the first half only
    #[serde(rename = "rms_last_half")]
    pub rms: Option<f64>,
    /// the largest after the first row, in the quantity's unit
    pub peak: f64,
    /// its time
    pub peak_at: f64,
    /// the time from which on it is within 5 % of the declared range; none where it is not up to the end
    #[serde(rename = "settled_at")]
    pub settling: Settling,
    /// beside its standard deviation; none where that is not told
    #[serde(flatten, serialize_with = "covered")]
    #[cfg_attr(feature = "schema", schemars(with = "Covered"))]
    pub coverage: Option<Coverage>,
}

/// How true standard deviations are.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(crate) struct Covered {
    /// share of the last half of the rows within two standard deviations, where these are told
    within_2_sd: Option<f64>,
    /// root mean square there in standard deviations: 1 where these are true
    rms_in_sd: Option<f64>,
}

impl From<Option<Coverage>> for Covered {
    fn from(coverage: Option<Coverage>) -> Self {
        Self {
            within_2_sd: coverage.map(|c| c.within),
            rms_in_sd: coverage.and_then(|c| finite(c.ratio)),
        }
    }
}

fn covered<S: Serializer>(coverage: &Option<Coverage>, to: S) -> Result<S::Ok, S::Error> {
    Covered::from(*coverage).serialize(to)
}

/// The errors of an estimate beside its standard deviations, over the last half of the rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coverage {
    /// share of the rows whose error is within two standard deviations
    pub within: f64,
    /// root of the mean of (error/deviation)²: 1 where the deviations are true; infinite where one is 0
    /// and the error is not
    pub ratio: f64,
    /// rows that count
    pub rows: usize,
}

/// When an error comes to stay within 5 % of the declared range.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(untagged)]
pub enum Settling {
    /// from this time on
    From(f64),
    /// not up to the end
    Never,
    /// no range is declared
    NoRange,
}

impl Coverage {
    /// Of many runs together; none of none.
    pub(crate) fn of_all(runs: impl Iterator<Item = Self>) -> Option<Self> {
        let (mut rows, mut within, mut squares) = (0, 0.0, 0.0);
        for run in runs {
            let count = run.rows as f64;
            rows += run.rows;
            within += run.within * count;
            squares += run.ratio.powi(2) * count;
        }
        let count = rows as f64;
        (rows > 0).then(|| Self {
            within: within / count,
            ratio: (squares / count).sqrt(),
            rows,
        })
    }
}

/// Errors that are larger than their deviations so many times contradict them: one that stays the same
/// over a whole run, as that of a constant, does so by chance in 1 of 15,000 runs.
const CONTRADICTED: f64 = 4.0;

/// Rows that tell.
const TELLING: usize = 10;

/// Of all quantities whose true values are known, unknown inputs first.
pub(crate) fn accuracies(
    time: &Series,
    quantities: &[Quantity],
    sides: &[Dimension],
) -> Vec<Accuracy> {
    let mut known: Vec<&Quantity> = quantities.iter().collect();
    known.sort_by_key(|q| (!q.unknown_input, q.measured.is_some()));
    let of = |q: &&Quantity| accuracy(time, q, sides.iter().find(|s| s.name == q.name));
    known.iter().filter_map(of).collect()
}

fn accuracy(time: &Series, quantity: &Quantity, side: Option<&Dimension>) -> Option<Accuracy> {
    if let Some(rotation) = &quantity.rotation {
        let error = rotation.error.as_ref()?;
        let deviation = rotation.deviation.as_ref();
        let errors = || error.iter();
        return told_by(time, &rotation.name, errors, deviation, Some(PI));
    }
    quantity.errors().is_some().then_some(())?;
    let errors = || quantity.errors().into_iter().flatten();
    let width = match quantity.home {
        Home::Circle { .. } => Some(TAU),
        _ => side.map(|s| s.max - s.min),
    };
    let width = width.filter(|w| w.is_finite() && *w > 0.0);
    let deviation = quantity.deviation.as_ref();
    told_by(time, &quantity.name, errors, deviation, width)
}

/// By errors row by row and their deviations; `width` is that of the range.
fn told_by<E: Iterator<Item = f64>>(
    time: &Series,
    name: &str,
    errors: impl Fn() -> E,
    deviation: Option<&Series>,
    width: Option<f64>,
) -> Option<Accuracy> {
    let sizes = || {
        let sizes = time.iter().zip(errors().map(f64::abs));
        sizes.filter(|(_, e)| e.is_finite())
    };
    let after_start = sizes().skip(usize::from(sizes().nth(1).is_some()));
    let (peak_at, peak) = after_start.max_by(|a, b| a.1.total_cmp(&b.1))?;
    let rows = errors().count();
    Some(Accuracy {
        quantity: name.to_owned(),
        rms: mean_square(errors().skip(rows / 2).map(|e| e.powi(2))),
        peak,
        peak_at,
        settling: match width.map(|width| settled_from(sizes(), SETTLED * width)) {
            Some(Some(time)) => Settling::From(time),
            Some(None) => Settling::Never,
            None => Settling::NoRange,
        },
        coverage: deviation.and_then(|deviation| coverage(errors().zip(deviation), rows)),
    })
}

/// Of errors beside their deviations, over the last half of so many rows.
fn coverage(pairs: impl Iterator<Item = (f64, f64)>, all: usize) -> Option<Coverage> {
    // 0/0, an exact value that is known for exact, is within
    let shares = pairs.skip(all / 2);
    let shares = shares.map(|(error, deviation)| match error == 0.0 {
        true => 0.0 * deviation,
        false => error / deviation,
    });
    let (mut rows, mut within, mut squares) = (0, 0, 0.0);
    for share in shares.filter(|share| !share.is_nan()) {
        rows += 1;
        within += usize::from(share.abs() <= 2.0);
        squares += share * share;
    }
    (rows > 0).then(|| Coverage {
        within: within as f64 / rows as f64,
        ratio: (squares / rows as f64).sqrt(),
        rows,
    })
}

/// The first time from which on no error is larger than `most`; none where the last one is.
pub(crate) fn settled_from(errors: impl Iterator<Item = (f64, f64)>, most: f64) -> Option<f64> {
    errors.fold(None, |settled, (t, e)| {
        (e <= most || e.is_nan()).then_some(settled.unwrap_or(t))
    })
}

impl Accuracy {
    fn words(&self) -> String {
        let settled = match self.settling {
            Settling::From(t) => format!("; within 5 % of its range from t = {} on", instant(t)),
            Settling::Never => "; not within 5 % of its range at the end".to_owned(),
            Settling::NoRange => String::new(),
        };
        let late = match self.rms {
            Some(rms) => format!("RMS {} in the last half", figures(rms, 3)),
            None => "not known in the last half".to_owned(),
        };
        let covered = self.coverage.map_or(String::new(), |c| {
            let share = figures(100.0 * c.within, 3);
            format!("; {share} % of the last half within 2 sd")
        });
        format!(
            "error of {}: {late}, at most {} (t = {}){settled}{covered}",
            self.quantity,
            figures(self.peak, 3),
            instant(self.peak_at),
        )
    }
}

impl Accuracy {
    /// What is to be said where the truth contradicts the standard deviation.
    fn contradiction(&self) -> Option<String> {
        let Coverage { ratio, rows, .. } = self.coverage?;
        (rows >= TELLING && ratio > CONTRADICTED).then(|| {
            let how = match ratio.is_finite() {
                true => format!(
                    "errors are {} times as large as it says (root mean square)",
                    figures(ratio, 2)
                ),
                false => "there are errors where it is 0".to_owned(),
            };
            format!(
                "the truth contradicts the standard deviation of {}: in the last half {how}",
                self.quantity
            )
        })
    }
}

/// The first of them in words.
pub(crate) fn told(accuracies: &[Accuracy]) -> Vec<String> {
    let mut words: Vec<String> = accuracies.iter().take(TOLD).map(Accuracy::words).collect();
    let more = accuracies.len().saturating_sub(TOLD);
    if more > 0 {
        words.push(format!("errors of {more} more quantities: --json"));
    }
    words.extend(accuracies.iter().filter_map(Accuracy::contradiction));
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_is_told_by_its_end_its_peak_and_when_it_is_small() {
        let quantity = Quantity {
            name: "x".to_owned(),
            truth: Some(vec![0.0, 0.0, f64::NAN, 0.0, 1.0, 1.0].into()),
            estimate: Some(vec![9.0, -4.0, 1.0, 0.3, 1.4, 1.3].into()),
            ..Quantity::default()
        };
        let graph = lynkeus_expr::Graph::new();
        let side = |max| Dimension {
            name: "x".to_owned(),
            symbol: graph.symbol("x").node(),
            min: 0.0,
            max,
            integer: false,
        };
        let time = Series::from(vec![0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        let of = |max| accuracy(&time, &quantity, Some(&side(max))).unwrap();
        let found = of(8.0);
        // 0.3, 0.4, 0.3 in the last three rows
        assert!((found.rms.unwrap() - (0.34_f64 / 3.0).sqrt()).abs() < 1e-12);
        assert_eq!((found.peak, found.peak_at), (4.0, 1.0));
        assert_eq!(found.settling, Settling::From(3.0));
        assert_eq!(of(7.0).settling, Settling::From(5.0));
        assert_eq!(of(5.0).settling, Settling::Never);
        assert_eq!(of(f64::INFINITY).settling, Settling::NoRange);
    }

    /// Four rows count: one is off by three deviations, one by half of one, two are right, of which one
    /// is known for right.
    #[test]
    fn errors_are_counted_in_deviations() {
        let of = |scale: f64| Quantity {
            name: "x".to_owned(),
            truth: Some(vec![0.0; 8].into()),
            estimate: Some(vec![9.0, 9.0, 9.0, 9.0, 3.0 * scale, 0.5, 0.0, 0.0].into()),
            deviation: Some(vec![1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0].into()),
            ..Quantity::default()
        };
        let counted = |quantity: &Quantity| {
            let errors = quantity.errors()?.zip(quantity.deviation.as_ref()?);
            coverage(errors, quantity.truth.as_ref()?.len())
        };
        let found = counted(&of(1.0)).unwrap();
        assert_eq!((found.within, found.rows), (0.75, 4));
        assert!((found.ratio - (9.25_f64 / 4.0).sqrt()).abs() < 1e-15);
        let long = |error: f64| Quantity {
            name: "x".to_owned(),
            truth: Some(vec![0.0; 40].into()),
            estimate: Some(vec![error; 40].into()),
            deviation: Some(vec![0.1; 40].into()),
            ..Quantity::default()
        };
        let time = Series::from((0..40).map(f64::from).collect::<Vec<_>>());
        let told = |error| told(&accuracies(&time, &[long(error)], &[])).join("\n");
        assert!(told(0.5).contains("0 % of the last half within 2 sd"));
        assert!(told(0.5).contains("the truth contradicts the standard deviation of x"));
        assert!(!told(0.3).contains("contradicts") && !told(0.15).contains(" 0 %"));
        assert_eq!(counted(&Quantity::default()), None);
    }

    /// A laboratory's value now and then: the last half is that of the rows, as everywhere.
    #[test]
    fn rows_without_truth_count_nowhere() {
        let quantity = |truth: [f64; 6]| Quantity {
            truth: Some(truth.to_vec().into()),
            estimate: Some(vec![2.0; 6].into()),
            ..Quantity::default()
        };
        let nan = f64::NAN;
        let time = Series::from(vec![0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        let late = quantity([0.0, 0.0, 0.0, nan, 1.0, nan]);
        assert_eq!(accuracy(&time, &late, None).unwrap().rms, Some(1.0));
        assert_eq!(late.settled_error(), Some(1.0));
        let early = accuracy(&time, &quantity([0.0, 1.0, nan, nan, nan, nan]), None).unwrap();
        assert_eq!((early.rms, early.peak), (None, 1.0));
        assert!(early.words().contains("not known in the last half"));
        assert!(serde_json::json!(early)["rms_last_half"].is_null());
    }
}
