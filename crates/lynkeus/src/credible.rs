//! Estimates that nobody should believe: they end far outside of what the model declares.

use lynkeus_model::{Plant, Variable};
use lynkeus_structure::figures;

use crate::innovations::Innovations;
use crate::words::{number, side};
use crate::{Error, Quantity, Series};

/// An estimate that keeps this far away, over the whole of this last share of the rows, is not
/// credible. A peak is allowed: it comes back.
struct Limit {
    /// of the rows; 0 is the last one alone
    last: f64,
    /// in widths of the declared range
    widths: f64,
}

/// In widths of its range: no estimate that ends so far from the truth is worth a figure.
pub(crate) const RUN_AWAY: f64 = 100.0;

const LIMITS: [Limit; 3] = [
    Limit {
        last: 0.0,
        widths: RUN_AWAY,
    },
    Limit {
        last: 0.1,
        widths: 1.0,
    },
    Limit {
        last: 0.5,
        widths: 0.1,
    },
];

impl Limit {
    /// The first of the rows that it looks at; none where there are no rows.
    fn first(&self, rows: usize) -> Option<usize> {
        let count = ((self.last * rows as f64).ceil() as usize).max(1);
        rows.checked_sub(count)
    }
}

/// A quantity without a declared range is doubted where it ends at so many times the largest
/// number that is known; a thousand times more ends the run.
const LARGER: f64 = 1e9;

/// An estimate that is not credible.
#[derive(Clone, Debug, PartialEq)]
pub struct Doubt {
    /// the quantity's name in the plant
    pub name: String,
    /// smallest declared value
    pub min: f64,
    /// largest declared value
    pub max: f64,
    /// the estimate at the last row
    pub last: f64,
    /// number of rows, up to the last, over which it stays away
    pub rows: usize,
    /// in multiples of max − min: how far at least it is there from the declared range, or
    /// from the nearest of true and measured value where these are outside, too. Without a declared
    /// range: in multiples of the largest number among starts, signals and true values, or 1
    pub widths: f64,
}

/// The estimates that are not credible.
pub(crate) fn doubts(plant: &Plant, quantities: &[Quantity]) -> Vec<Doubt> {
    let declared = || plant.states.iter().chain(&plant.inputs);
    let largest = largest(quantities);
    let doubt = |quantity: &Quantity| {
        let variable = declared().find(|v| v.name == quantity.name)?;
        match (variable.max - variable.min).is_finite() {
            true => of_range(variable, quantity),
            false => of_none(variable, quantity, largest),
        }
    };
    quantities.iter().filter_map(doubt).collect()
}

/// The same of one quantity, row by row, without what is measured: an estimate that [`doubts`] would
/// doubt is suspect, and few others are.
#[cfg_attr(not(feature = "tune"), allow(dead_code))]
#[derive(Clone, Debug)]
pub(crate) struct Screen {
    min: f64,
    max: f64,
    rows: u32,
    /// by limit, how far the estimate was at least from the range
    least: [f64; LIMITS.len()],
    last: f64,
}

impl Screen {
    /// For so many rows.
    pub fn new(declared: &Variable, rows: usize) -> Self {
        Self {
            min: declared.min,
            max: declared.max,
            rows: u32::try_from(rows).unwrap_or(u32::MAX),
            least: [f64::INFINITY; LIMITS.len()],
            last: 0.0,
        }
    }

    pub fn add(&mut self, row: usize, truth: f64, estimate: f64) {
        self.last = estimate;
        let rows = self.rows as usize;
        for (limit, least) in LIMITS.iter().zip(&mut self.least) {
            if limit.first(rows).is_some_and(|first| row >= first) {
                let away = (self.min.min(truth) - estimate).max(estimate - self.max.max(truth));
                *least = least.min(away);
            }
        }
    }

    pub fn is_suspect(&self) -> bool {
        let width = self.max - self.min;
        match width.is_finite() {
            true => {
                let far = |(limit, least): (&Limit, &f64)| *least > limit.widths * width;
                width > 0.0 && LIMITS.iter().zip(&self.least).any(far)
            }
            false => self.last.abs() > LARGER,
        }
    }
}

/// The largest magnitude of what is known and of where the estimates start; at least 1.
fn largest(quantities: &[Quantity]) -> f64 {
    let known = quantities.iter().flat_map(|q| [&q.truth, &q.measured]);
    let known = known.flatten().flatten();
    let starts = quantities
        .iter()
        .filter_map(|q| q.estimate.as_ref()?.first());
    let finite = known.chain(starts).filter(|x| x.is_finite());
    finite.fold(1.0, |m: f64, x| m.max(x.abs()))
}

/// The doubt about a quantity without a range.
fn of_none(declared: &Variable, quantity: &Quantity, largest: f64) -> Option<Doubt> {
    let last = quantity.estimate.as_ref()?.last()?;
    let doubt = Doubt {
        name: declared.name.clone(),
        min: declared.min,
        max: declared.max,
        last,
        rows: 1,
        widths: last.abs() / largest,
    };
    (doubt.widths > LARGER).then_some(doubt)
}

/// The doubt about a quantity with a range.
fn of_range(declared: &Variable, quantity: &Quantity) -> Option<Doubt> {
    let width = declared.max - declared.min;
    let estimate = quantity.estimate.as_ref().filter(|_| width > 0.0)?;
    let rows = estimate.len();
    let least = |from: usize| {
        let away = distances(declared, quantity, from).take(rows - from);
        away.fold(f64::INFINITY, |least, away| least.min(away / width))
    };
    let exceeded = LIMITS.iter().find_map(|limit| {
        let first = limit.first(rows)?;
        let widths = least(first);
        (widths > limit.widths).then_some((rows - first, widths))
    });
    let (rows, widths) = exceeded?;
    Some(Doubt {
        name: declared.name.clone(),
        min: declared.min,
        max: declared.max,
        last: estimate.last()?,
        rows,
        widths,
    })
}

/// How far an estimate is at each row from one on from the declared range, widened to where the
/// plant is known to be: a range that is too narrow makes no right estimate wrong.
fn distances<'q>(
    declared: &'q Variable,
    quantity: &'q Quantity,
    from: usize,
) -> impl Iterator<Item = f64> + 'q {
    let of = |values: &'q Option<Series>| values.as_ref().map(|v| v.iter_from(from));
    let mut known = [of(&quantity.truth), of(&quantity.measured)];
    let estimate = of(&quantity.estimate).into_iter().flatten();
    estimate.map(move |x| {
        let known = known.iter_mut().flatten().filter_map(Iterator::next);
        let known = known.filter(|x| x.is_finite());
        let (low, high) = known.fold((declared.min, declared.max), |(low, high), x| {
            (low.min(x), high.max(x))
        });
        (low - x).max(x - high)
    })
}

/// The answer where an estimate is not credible; none where all are.
pub(crate) fn refusal(doubts: &[Doubt]) -> Option<Error> {
    let worst = doubts.iter().max_by(|a, b| a.widths.total_cmp(&b.widths))?;
    let others = match doubts.len() - 1 {
        0 => String::new(),
        1 => ", and another quantity likewise".to_owned(),
        count => format!(", and {count} other quantities likewise"),
    };
    let times = figures(worst.widths, 2);
    let range = side(&worst.name, worst.min, worst.max);
    let why = match (worst.max - worst.min).is_finite() {
        true if worst.rows == 1 => {
            format!("that is {times} times the width of its declared range away from it ({range})")
        }
        true => format!(
            "over its last {} rows it is at least {times} times the width of its declared range away from it ({range})",
            worst.rows
        ),
        false => format!("that is {times} times the largest number among starts and signals"),
    };
    let message = format!(
        "the estimate is not credible: {} ends at {}, and {why}{others}",
        worst.name,
        number(worst.last),
    );
    Some(Error::refused(message).hint(
        "see whether `lynkeus certify` proves this tuning, try another `theta` or `clamp = true`, compare the model with the log; if the plant really goes there, declare a wider min and max (the result is written all the same)",
    ))
}

/// Innovations so many times larger than declared, in the mean over the last half of a run,
/// contradict the model.
const CONTRADICTION: f64 = 3.0;
/// Readings on which such a mean rests.
const ENOUGH: usize = 20;

/// Where innovations contradict the declared noise, in words.
pub(crate) fn contradictions(innovations: &[Innovations]) -> Vec<String> {
    let words = |i: &Innovations| {
        let late = &i.late;
        let offered = late.taken + late.rejected;
        if offered < ENOUGH {
            return None;
        }
        if 2 * late.rejected > offered {
            return Some(format!(
                "{} of the last {offered} readings of {} are rejected by the gate",
                late.rejected, i.output
            ));
        }
        let ratio = late.consistency()?.sqrt();
        (ratio > CONTRADICTION).then(|| {
            format!(
                "the innovations of {} are {} times as large as its noise and the process noise explain",
                i.output,
                figures(ratio, 2)
            )
        })
    };
    innovations.iter().filter_map(words).collect()
}

/// The answer where they do.
pub(crate) fn contradicted(first: &str) -> Error {
    Error::refused(format!("the estimate is not credible: {first}")).hint(
        "declare larger densities under [process_noise] for what the model does not know, or a larger noise of the sensor; compare the model with the log (the result is written all the same)",
    )
}

#[cfg(test)]
mod tests {
    use lynkeus_model::LoadOptions;

    use super::*;

    /// Whether an estimate of x in [−1, 1] is doubted.
    fn doubted(declared: &str, quantity: Quantity) -> Vec<Doubt> {
        let text = format!("model M Real x{declared}; equation der(x) = -x; end M;");
        let plant = Plant::from_modelica(&text, "m.mo", &LoadOptions::default()).unwrap();
        let quantity = Quantity {
            name: "x".to_owned(),
            ..quantity
        };
        doubts(&plant, &[quantity])
    }

    fn estimate(values: impl Iterator<Item = f64>) -> Quantity {
        Quantity {
            estimate: Some(values.collect::<Vec<f64>>().into()),
            ..Quantity::default()
        }
    }

    const BOX: &str = "(min = -1, max = 1)";

    #[test]
    fn peaks_are_allowed_and_ends_are_not() {
        let peak = (0..100).map(|k| if k == 50 { 1e10 } else { 0.5 });
        assert_eq!(doubted(BOX, estimate(peak)), vec![]);
        // 2 × 100 widths at the very end
        let run_away = (0..100).map(|k| if k == 99 { 401.1 } else { 0.5 });
        let found = doubted(BOX, estimate(run_away));
        assert_eq!((found[0].rows, found[0].last), (1, 401.1));
        let short = (0..100).map(|k| if k == 99 { 200.0 } else { 0.5 });
        assert_eq!(doubted(BOX, estimate(short)), vec![]);
    }

    #[test]
    fn leaving_for_good_is_judged_by_how_long_and_how_far() {
        let after = |row: usize, value: f64| {
            let values = (0..100).map(move |k| if k >= row { value } else { 0.0 });
            doubted(BOX, estimate(values)).first().map(|d| d.rows)
        };
        // a width beyond the end for a tenth of the rows, a tenth of one for half of them
        assert_eq!(after(90, -3.01), Some(10));
        assert_eq!((after(90, -2.99), after(91, -3.01)), (None, None));
        assert_eq!(after(50, 1.21), Some(50));
        assert_eq!((after(50, 1.19), after(51, 1.21)), (None, None));
    }

    #[test]
    fn a_range_that_the_plant_leaves_is_no_fault_of_the_estimate() {
        let with = |truth: Option<f64>, measured: Option<f64>| {
            let constant = |value| Series::from(vec![value; 40]);
            let quantity = Quantity {
                truth: truth.map(constant),
                measured: measured.map(constant),
                ..estimate(vec![50.0; 40].into_iter())
            };
            doubted(BOX, quantity).first().map(|d| d.widths)
        };
        assert_eq!(with(None, None), Some(24.5));
        assert_eq!(
            (with(Some(50.1), None), with(None, Some(49.9))),
            (None, None)
        );
        // the plant is outside, the estimate is elsewhere
        assert_eq!(with(Some(-50.0), Some(-49.0)), Some(24.5));
        assert_eq!(with(Some(f64::NAN), None), Some(24.5));
    }

    #[test]
    fn without_a_range_only_what_is_absurd_is_doubted() {
        let values = || estimate([0.0, 1e9].into_iter());
        for open in ["", "(min = 0)"] {
            assert_eq!(doubted(open, values()), vec![]);
            let found = doubted(open, estimate([0.0, 1e10].into_iter()));
            assert_eq!(found[0].widths, 1e10);
            let error = refusal(&found).unwrap().to_string();
            assert!(error.contains("1e10 times the largest number"), "{error}");
            // large numbers are usual there
            let large = estimate([20.0, 1e10].into_iter());
            assert_eq!(doubted(open, large), vec![]);
        }
        let error = refusal(&doubted(BOX, values())).unwrap().to_string();
        assert!(
            error.starts_with(
                "the estimate is not credible: x ends at 1e9, and that is 5e8 times the width"
            ),
            "{error}"
        );
        assert!(refusal(&[]).is_none());
    }
}
