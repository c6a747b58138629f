//! How far a run stays in the box for which everything is proved.

use std::ops::RangeInclusive;

use lynkeus_structure::{AugmentedPlant, Dimension};
use lynkeus_words::figures;
use serde::{Serialize, Serializer};

#[cfg(feature = "schema")]
use crate::entries::{Named, Range};
use crate::words::{instant, number};
use crate::{Quantity, Series};
use lynkeus_table::series::Iter;

/// What is beyond an end by no more than this share of the side's width is on it: integration
/// and noise-free sensors round.
const ROUNDING: f64 = 1e-6;

/// Quantities named in a note.
const NAMED: usize = 3;

/// One quantity that leaves its side of the box.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Excursion {
    /// its name in the plant
    #[serde(skip)]
    pub name: String,
    /// its smallest and largest value in the box
    #[serde(rename = "box")]
    #[cfg_attr(feature = "schema", schemars(with = "Range"))]
    pub side: [f64; 2],
    /// share of the rows at which it is outside
    #[serde(rename = "rows")]
    pub share: f64,
    /// time of the first of them
    pub first: f64,
    /// its value there
    pub value: f64,
    /// the value that is farthest outside
    pub farthest: f64,
    /// first and last row of each stretch of rows at which it is outside
    #[serde(skip)]
    pub stretches: Vec<RangeInclusive<usize>>,
}

/// Where a run is outside of the box.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Outside {
    /// share of the rows at which any quantity is
    #[serde(rename = "rows")]
    pub share: f64,
    /// time of the first of them
    pub first: f64,
    /// the quantities, the one that leaves first first
    #[serde(serialize_with = "by_name")]
    #[cfg_attr(feature = "schema", schemars(with = "Named<Excursion>"))]
    pub quantities: Vec<Excursion>,
}

/// Where plant and estimate are outside of the box; null where they stay inside.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(crate) struct OutsideBox<'a> {
    /// of the true values, where they are known
    pub plant: &'a Option<Outside>,
    /// of the estimates
    pub estimate: &'a Option<Outside>,
}

fn by_name<S: Serializer>(quantities: &[Excursion], to: S) -> Result<S::Ok, S::Error> {
    to.collect_map(quantities.iter().map(|e| (&e.name, e)))
}

/// The box, side by side: what the observer knows of, time included, then the disturbances.
pub fn sides(augmented: &AugmentedPlant<'_>) -> Vec<Dimension> {
    let region = augmented.region();
    let symbols = region.symbols();
    let inputs = augmented.plant.inputs.iter();
    let disturbances = inputs.filter(|i| !symbols.contains(&i.node));
    let disturbances = disturbances.map(|i| Dimension {
        name: i.name.clone(),
        symbol: i.node,
        min: i.min,
        max: i.max,
        integer: i.integer,
    });
    region.dimensions.into_iter().chain(disturbances).collect()
}

/// Time as a quantity: a side of the box, too.
pub fn time_itself(time: &Series) -> Quantity {
    Quantity {
        name: "time".to_owned(),
        truth: Some(time.clone()),
        ..Quantity::default()
    }
}

/// Some of the values of the quantities at every row.
pub(crate) type Of = fn(&Quantity) -> Option<&Series>;

/// What the plant does, as far as it is known.
pub const PLANT: Of = |quantity| quantity.truth.as_ref().or(quantity.measured.as_ref());
/// What the observer makes of it.
pub const ESTIMATE: Of = |quantity| quantity.estimate.as_ref();

/// Where values of quantities leave the box; none where they stay.
pub fn outside<'q>(
    time: &Series,
    quantities: impl IntoIterator<Item = &'q Quantity>,
    of: Of,
    sides: &[Dimension],
) -> Option<Outside> {
    let followed = quantities.into_iter().filter_map(|quantity| {
        let side = sides.iter().find(|side| side.name == quantity.name)?;
        Some(Followed::new(side, of(quantity)?))
    });
    let mut followed: Vec<Followed<'_>> = followed.collect();
    let mut any = 0;
    for (row, t) in time.iter().enumerate() {
        let mut is_outside = false;
        for quantity in &mut followed {
            is_outside |= quantity.take(row, t);
        }
        any += usize::from(is_outside);
    }
    let rows = time.len();
    let excursions = followed.into_iter().filter_map(|f| f.excursion(rows));
    let mut excursions: Vec<Excursion> = excursions.collect();
    excursions.sort_by(|a, b| a.first.total_cmp(&b.first));
    Some(Outside {
        share: share(any, rows),
        first: excursions.first()?.first,
        quantities: excursions,
    })
}

/// A quantity beside its side of the box, row by row.
struct Followed<'q> {
    side: &'q Dimension,
    values: Iter<'q>,
    slack: f64,
    /// rows at which it is outside
    count: usize,
    /// time and value at the first of them
    first: Option<(f64, f64)>,
    farthest: f64,
    /// how far that is beyond the side
    beyond: f64,
    stretches: Vec<RangeInclusive<usize>>,
}

impl<'q> Followed<'q> {
    fn new(side: &'q Dimension, values: &'q Series) -> Self {
        let farthest = values.first().unwrap_or(f64::NAN);
        Self {
            side,
            values: values.iter(),
            slack: slack(side, values),
            count: 0,
            first: None,
            farthest,
            beyond: beyond(side, farthest),
            stretches: vec![],
        }
    }

    /// Whether it is outside at the next row.
    fn take(&mut self, row: usize, t: f64) -> bool {
        let Some(x) = self.values.next() else {
            return false;
        };
        let beyond = beyond(self.side, x);
        // the last of several; a missing value is none of them
        if self.farthest.is_nan() || beyond >= self.beyond {
            (self.farthest, self.beyond) = (x, beyond);
        }
        if beyond <= self.slack || x.is_nan() {
            return false;
        }
        self.count += 1;
        self.first.get_or_insert((t, x));
        match self.stretches.last_mut() {
            Some(last) if *last.end() + 1 == row => *last = *last.start()..=row,
            _ => self.stretches.push(row..=row),
        }
        true
    }

    fn excursion(self, rows: usize) -> Option<Excursion> {
        let (first, value) = self.first?;
        Some(Excursion {
            name: self.side.name.clone(),
            side: [self.side.min, self.side.max],
            share: share(self.count, rows),
            first,
            value,
            farthest: self.farthest,
            stretches: self.stretches,
        })
    }
}

/// How far a value is beyond a side; of one inside, less than zero.
fn beyond(side: &Dimension, x: f64) -> f64 {
    (side.min - x).max(x - side.max)
}

/// What counts as rounding beside a side: a share of its width, or where that is none of the
/// numbers around it. NaN, in a log's column of truth, is not outside.
fn slack(side: &Dimension, values: &Series) -> f64 {
    let width = side.max - side.min;
    if width.is_finite() && width > 0.0 {
        return ROUNDING * width;
    }
    let ends = [side.min, side.max].into_iter().filter(|x| x.is_finite());
    let sizes = ends.chain(values.iter().filter(|x| x.is_finite()));
    ROUNDING * sizes.fold(0.0, |m: f64, x| m.max(x.abs()))
}

fn share(count: usize, rows: usize) -> f64 {
    count as f64 / rows.max(1) as f64
}

/// A share as people read it.
pub(crate) fn percent(share: f64) -> String {
    format!("{} %", figures(100.0 * share, 2))
}

impl Excursion {
    fn side(&self) -> String {
        let [min, max] = self.side.map(number);
        format!("box [{min}, {max}]")
    }
}

impl Outside {
    /// `at 97 % of the rows, first at t = 0 (x reaches 100, box [-2, 2]; …)`.
    pub fn words(&self) -> String {
        let each =
            |e: &Excursion| format!("{} reaches {}, {}", e.name, number(e.farthest), e.side());
        format!(
            "at {} of the rows, first at t = {} ({})",
            percent(self.share),
            instant(self.first),
            self.listed(each)
        )
    }

    /// `x = 100, box [-2, 2]; …`, for a run that is its start alone.
    pub fn starts(&self) -> String {
        self.listed(|e| format!("{} = {}, {}", e.name, number(e.value), e.side()))
    }

    /// The first of the quantities in words, and how many more there are.
    fn listed(&self, words: impl Fn(&Excursion) -> String) -> String {
        let mut all: Vec<String> = self.quantities.iter().take(NAMED).map(words).collect();
        let more = self.quantities.len().saturating_sub(NAMED);
        if more > 0 {
            all.push(format!("and {more} more"));
        }
        all.join("; ")
    }
}

#[cfg(test)]
mod tests {
    use lynkeus_model::{LoadOptions, Plant};
    use lynkeus_structure::Sensors;

    use super::*;

    fn side_of(declared: &str) -> Dimension {
        let text =
            format!("model M Real x{declared}; output Real y = x; equation der(x) = -x; end M;");
        let plant = Plant::from_modelica(&text, "m.mo", &LoadOptions::default()).unwrap();
        let augmented = AugmentedPlant::new(&plant, &Sensors::default()).unwrap();
        sides(&augmented).remove(0)
    }

    fn found(declared: &str, values: &[f64]) -> Option<Outside> {
        let time: Vec<f64> = (0..values.len()).map(|k| k as f64).collect();
        let time = Series::from(time);
        let quantity = Quantity {
            name: "x".to_owned(),
            estimate: Some(values.to_vec().into()),
            ..Quantity::default()
        };
        let sides = [side_of(declared)];
        assert_eq!(
            outside(&time, std::slice::from_ref(&quantity), PLANT, &sides),
            None
        );
        outside(&time, &[quantity], ESTIMATE, &sides)
    }

    #[test]
    fn shares_first_times_and_the_farthest_value() {
        let found = found("(min = -1, max = 2)", &[0.0, 2.5, 2.0, -4.0]).unwrap();
        assert_eq!((found.share, found.first), (0.5, 1.0));
        let x = &found.quantities[0];
        assert_eq!((x.value, x.farthest), (2.5, -4.0));
        assert_eq!(
            found.words(),
            "at 50 % of the rows, first at t = 1 (x reaches -4, box [-1, 2])"
        );
        assert_eq!(serde_json::json!(found)["quantities"]["x"]["rows"], 0.5);
    }

    #[test]
    fn what_rounds_to_an_end_is_on_it_and_open_ends_hold_nothing_out() {
        assert_eq!(found("(min = 0, max = 10)", &[-1e-7, 10.0 + 1e-6]), None);
        assert!(found("(min = 0, max = 10)", &[-1e-4]).is_some());
        assert_eq!(found("", &[1e30, -1e30]), None);
        assert_eq!(found("(min = 0)", &[1e9, -1e-3]), None);
        let found = found("(min = 0)", &[1.0, -1e-3]).unwrap();
        assert!(serde_json::json!(found)["quantities"]["x"]["box"][1].is_null());
    }
}
