//! Estimates outside of what the model declares.

use lynkeus_model::Variable;
use lynkeus_words::figures;

use super::Evidence;
use crate::course::computed::within_expression;
use crate::course::doubt::{Doubt, Kind, Level};
use crate::course::units::{NEARLY_ALL, within};
use crate::judge::outside::percent;
use crate::prepare::headers::header;
use crate::words::{instant, number, side};
use crate::{Quantity, Series};

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

/// An estimate that is far outside at its end.
#[derive(Clone, Debug, PartialEq)]
struct Away {
    /// the quantity's name in the plant
    name: String,
    /// smallest declared value
    min: f64,
    /// largest declared value
    max: f64,
    /// the estimate at the last row
    last: f64,
    /// number of rows, up to the last, over which it stays away
    rows: usize,
    /// in multiples of max − min: how far at least it is there from the declared range, or
    /// from the nearest of true and measured value where these are outside, too. Without a declared
    /// range: in multiples of the largest number among starts, signals and true values, or 1
    widths: f64,
}

/// Estimates that are outside of their declared ranges, by their ends or by their own deviations.
pub(super) fn doubts(evidence: &Evidence<'_>) -> Vec<Doubt> {
    let mut away = away(&evidence.declared, evidence.quantities);
    away.sort_by(|a, b| b.widths.total_cmp(&a.widths));
    // readings that are elsewhere altogether take estimates with them
    let quantities = evidence.quantities.iter();
    let doubted = quantities.filter_map(|quantity| misread(evidence, quantity));
    let (mut found, others): (Vec<_>, Vec<_>) =
        doubted.partition(|doubt| doubt.level == Level::Refusal);
    found.extend(away.iter().map(Away::doubt));
    for quantity in evidence.quantities {
        if !away.iter().any(|away| away.name == quantity.name) {
            found.extend(beyond(evidence, quantity));
        }
    }
    found.extend(others);
    found
}

/// The estimates that end far outside.
fn away(declared: &[&Variable], quantities: &[Quantity]) -> Vec<Away> {
    let largest = largest(quantities);
    let away = |quantity: &Quantity| {
        let variable = declared.iter().find(|v| v.name == quantity.name)?;
        match (variable.max - variable.min).is_finite() {
            true => of_range(variable, quantity),
            false => of_none(variable, quantity, largest),
        }
    };
    quantities.iter().filter_map(away).collect()
}

/// A range that a sensor sees left by more of its widths is not sloppy, but of another unit.
const NARROW: f64 = 3.0;

/// Outside by so many of its own deviations is no chance.
const DEVIATIONS: f64 = 3.0;

/// What is beyond by less than a share of the range, or for less than a share of the rows, is no
/// contradiction: ranges are declared in round numbers.
struct Allowance {
    /// in widths of the declared range; without one, in the largest magnitude of the estimate
    widths: f64,
    rows: f64,
}

const OF_FILTER: Allowance = Allowance {
    widths: 0.01,
    rows: 0.05,
};
/// Deviations of a linearised error system know of no peak at the start.
const OF_ERROR_SYSTEM: Allowance = Allowance {
    widths: 0.05,
    rows: 0.1,
};

/// The doubt about an estimate that is outside by more than its own deviations explain.
fn beyond(evidence: &Evidence<'_>, quantity: &Quantity) -> Option<Doubt> {
    let declared = evidence.declared.iter();
    let declared = declared.into_iter().find(|v| v.name == quantity.name)?;
    let estimate = quantity.estimate.as_ref()?;
    if estimate
        .iter()
        .all(|x| declared.min <= x && x <= declared.max)
    {
        return None;
    }
    let named = |(name, _): &&(&str, &Series)| *name == quantity.name;
    let deviation = evidence.deviations.iter().find(named)?.1;
    let allowance = match evidence.is_filter {
        true => OF_FILTER,
        false => OF_ERROR_SYSTEM,
    };
    let width = declared.max - declared.min;
    let width = match width.is_finite() {
        true => width,
        false => estimate.iter().fold(0.0, |m: f64, x| m.max(x.abs())),
    };
    let (mut count, mut until, mut rows) = (0, 0.0, 0_usize);
    let mut seen = seen_beyond(evidence);
    let away = distances(declared, quantity, 0).zip(deviation.iter());
    for ((away, sd), t) in away.zip(evidence.time.iter()) {
        rows += 1;
        let seen = seen();
        let is_seen = seen <= NARROW && away <= 2.0 * seen * width;
        if !is_seen && away > DEVIATIONS * sd && away > allowance.widths * width {
            count += 1;
            until = t;
        }
    }
    let share = f64::from(count) / rows.max(1) as f64;
    (share >= allowance.rows).then(|| Doubt {
        kind: Kind::Range,
        name: declared.name.clone(),
        text: format!(
            "{} is outside of its declared range ({}) by more than {DEVIATIONS} of its own deviations in {} of the rows, until t = {}",
            declared.name,
            side(&declared.name, declared.min, declared.max),
            percent(share),
            instant(until)
        ),
        level: Level::Refusal,
    })
}

/// The same of one quantity, row by row, without what is measured: an estimate that [`away`] would
/// find is suspect, and few others are.
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
fn of_none(declared: &Variable, quantity: &Quantity, largest: f64) -> Option<Away> {
    let last = quantity.estimate.as_ref()?.last()?;
    let away = Away {
        name: declared.name.clone(),
        min: declared.min,
        max: declared.max,
        last,
        rows: 1,
        widths: last.abs() / largest,
    };
    (away.widths > LARGER).then_some(away)
}

/// The doubt about a quantity with a range.
fn of_range(declared: &Variable, quantity: &Quantity) -> Option<Away> {
    let width = declared.max - declared.min;
    let estimate = quantity.estimate.as_ref().filter(|_| width > 0.0)?;
    let rows = estimate.len();
    let least = |from: usize| {
        let away = distances(declared, quantity, from).take(rows - from);
        away.fold(f64::INFINITY, |least, away| least.min(away / width))
    };
    // every limit looks at the last row
    if rows == 0 || least(rows - 1) <= LIMITS.iter().fold(f64::INFINITY, |w, l| w.min(l.widths)) {
        return None;
    }
    let exceeded = LIMITS.iter().find_map(|limit| {
        let first = limit.first(rows)?;
        let widths = least(first);
        (widths > limit.widths).then_some((rows - first, widths))
    });
    let (rows, widths) = exceeded?;
    Some(Away {
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
    let known = [of(&quantity.truth), of(&quantity.measured)];
    let mut known = known.map(|values| values.map(held));
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

/// Where a value is missing the plant is not far from the one before.
fn held(values: impl Iterator<Item = f64>) -> impl Iterator<Item = f64> {
    values.scan(f64::NAN, |last, x| {
        if x.is_finite() {
            *last = x;
        }
        Some(*last)
    })
}

/// How far at the next row a sensor sees its own state outside of its declared range, in widths of
/// that. Where ranges are narrower than what the plant does, the same excess elsewhere is no doubt.
fn seen_beyond<'e>(evidence: &Evidence<'e>) -> impl FnMut() -> f64 + 'e {
    let measured = evidence.quantities.iter();
    let measured = measured.filter_map(|q| readings_beyond(evidence, q));
    let mut measured: Vec<_> = measured.collect();
    move || {
        let next = measured.iter_mut().filter_map(Iterator::next);
        next.fold(0.0, f64::max)
    }
}

/// Of a measured quantity with a range: by row, how many widths its readings are beyond it.
fn readings_beyond<'e>(
    evidence: &Evidence<'e>,
    quantity: &'e Quantity,
) -> Option<impl Iterator<Item = f64> + 'e> {
    let mut declared = evidence.declared.iter();
    let &declared = declared.find(|v| v.name == quantity.name)?;
    let width = declared.max - declared.min;
    let readings = quantity.measured.as_ref()?.iter();
    let beyond = move |y: f64| ((declared.min - y).max(y - declared.max) / width).max(0.0);
    (width.is_finite() && width > 0.0).then(|| readings.map(beyond))
}

/// A sensor whose readings are mostly outside of what is declared.
fn misread(evidence: &Evidence<'_>, quantity: &Quantity) -> Option<Doubt> {
    let (mut count, mut far, mut rows, mut farthest) = (0, 0, 0_usize, 0.0_f64);
    for beyond in readings_beyond(evidence, quantity)?.filter(|b| b.is_finite()) {
        rows += 1;
        count += usize::from(beyond > OF_ERROR_SYSTEM.widths);
        far += usize::from(beyond > 1.0);
        farthest = farthest.max(beyond);
    }
    // another unit, or the range is wrong
    let is_elsewhere = rows > 0 && far as f64 >= NEARLY_ALL * rows as f64;
    let name = quantity.sensor.as_ref().unwrap_or(&quantity.name);
    let range = match &quantity.sensor {
        Some(_) => format!("the declared range of {}", quantity.name),
        None => "its declared range".to_owned(),
    };
    let unit = || {
        let declared = evidence.declared.iter().find(|v| v.name == quantity.name)?;
        let change = within(declared, quantity.measured.as_ref()?)?;
        let header = within_expression(header(evidence.settings, name));
        let (cause, changed) = (change.cause, change.expression.replace("{}", &header));
        Some(format!(
            "they look as if they were {cause}, and lie in it where `columns = {{ {name} = \"{changed}\" }}` stands in [log]"
        ))
    };
    (2 * count > rows).then(|| Doubt {
        kind: Kind::Range,
        name: name.clone(),
        text: format!(
            "the readings of {name} are outside of {range} in {} of the rows, by up to {} times its width: {}",
            percent(count as f64 / rows as f64),
            figures(farthest, 2),
            unit().unwrap_or_else(|| "is their unit the model's?".to_owned())
        ),
        level: match is_elsewhere && evidence.replayed {
            true => Level::Refusal,
            false => Level::Warning,
        },
    })
}

impl Away {
    fn doubt(&self) -> Doubt {
        let times = figures(self.widths, 2);
        let range = side(&self.name, self.min, self.max);
        let why = match (self.max - self.min).is_finite() {
            true if self.rows == 1 => {
                format!(
                    "that is {times} times the width of its declared range away from it ({range})"
                )
            }
            true => format!(
                "over its last {} rows it is at least {times} times the width of its declared range away from it ({range})",
                self.rows
            ),
            false => format!("that is {times} times the largest number among starts and signals"),
        };
        Doubt {
            kind: Kind::Range,
            name: self.name.clone(),
            text: format!("{} ends at {}, and {why}", self.name, number(self.last)),
            level: Level::Refusal,
        }
    }
}

#[cfg(test)]
mod tests {
    use lynkeus_model::{LoadOptions, Plant};

    use super::*;
    use crate::judge::refusal;

    /// Whether an estimate of x in [−1, 1] is doubted.
    fn doubted(declared: &str, quantity: Quantity) -> Vec<Away> {
        let text = format!("model M Real x{declared}; equation der(x) = -x; end M;");
        let plant = Plant::from_modelica(&text, "m.mo", &LoadOptions::default()).unwrap();
        let quantity = Quantity {
            name: "x".to_owned(),
            ..quantity
        };
        away(&[&plant.states[0]], &[quantity])
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
            let error = refusal(&[found[0].doubt()]).unwrap().to_string();
            assert!(error.contains("1e10 times the largest number"), "{error}");
            // large numbers are usual there
            let large = estimate([20.0, 1e10].into_iter());
            assert_eq!(doubted(open, large), vec![]);
        }
        let found = doubted(BOX, values());
        let error = refusal(&[found[0].doubt()]).unwrap().to_string();
        assert!(
            error.starts_with(
                "the estimate is not credible: x ends at 1e9, and that is 5e8 times the width"
            ),
            "{error}"
        );
        assert!(refusal(&[]).is_none());
    }
}
