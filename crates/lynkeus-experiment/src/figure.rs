//! The picture of an outcome.

use lynkeus_model::Home;

use crate::prepare::mentioned::not_drawn;
use crate::tune::Foretold;
use crate::{Error, Outcome, Quantity, Series};
use lynkeus_plot::{Band, Curve, Extent, Figure, Kind, Mark, Panel};
use lynkeus_study::Name;

/// Panels drawn where the study does not say which.
pub(crate) const PANELS: usize = 6;

impl Outcome {
    /// The picture: the quantities of the study's `show`, else unknown inputs and hidden states
    /// first, then what is measured, six at most; then the monitors.
    ///
    /// # Errors
    /// `show` names something that is neither estimated nor measured.
    pub fn figure(&self) -> Result<Figure, Error> {
        let chosen = match &self.show {
            Some(names) => named(&self.quantities, names, |q| &q.name, "nothing")?,
            None => interesting(self),
        };
        let mut panels: Vec<Panel> = chosen.into_iter().map(|q| panel(self, q)).collect();
        panels.extend(self.watches.iter().map(|watch| Panel {
            name: watch.header.clone(),
            caption: format!(
                "{} (alarm below {})",
                watch.header, watch.monitor.alarm_below
            ),
            curves: vec![curve(self, Kind::Estimated, &watch.values)],
            ..Panel::default()
        }));
        let family = self.design.examination.family;
        let title = format!("{}: {family} observer", self.plant);
        Ok(over_time(title, self.time_unit.as_deref(), panels))
    }
}

/// What `show` asks for. A name that is not there is refused: `nothing`, or nothing of a kind, is called so.
pub(crate) fn named<'a, T>(
    all: &'a [T],
    show: &[Name],
    name_of: fn(&T) -> &str,
    nothing: &str,
) -> Result<Vec<&'a T>, Error> {
    let find = |name: &Name| {
        let mut found = all.iter().filter(|x| name_of(x) == name.text);
        let names = || all.iter().map(name_of).collect::<Vec<_>>();
        found
            .next()
            .ok_or_else(|| not_drawn(name, nothing, &names()))
    };
    show.iter().map(find).collect()
}

/// A unit after a name, "1" is Modelica's of numbers without one.
pub(crate) fn in_brackets(unit: Option<&str>) -> String {
    let unit = unit.filter(|unit| *unit != "1");
    unit.map_or(String::new(), |unit| format!(" ({unit})"))
}

/// Panels over time.
pub fn over_time(title: String, time_unit: Option<&str>, panels: Vec<Panel>) -> Figure {
    let unit = time_unit.map_or(String::new(), |unit| format!(" ({unit})"));
    Figure {
        title,
        label: format!("time{unit}"),
        panels,
        ..Figure::default()
    }
}

impl crate::Comparison {
    /// One panel per family: the quantity that is hardest to see, unknown inputs first.
    #[must_use]
    pub fn picture(&self) -> Figure {
        let panels = self.rows.iter().filter_map(|row| {
            let run = row.run.as_ref().ok()?;
            let quantity = *interesting(&run.outcome).first()?;
            let mut panel = panel(&run.outcome, quantity);
            let foretold = run.foretold.as_ref().map_or_else(String::new, foretold);
            panel.caption = format!("{}, {}{foretold}", row.family, panel.caption);
            Some(panel)
        });
        let title = format!("{}: families compared", self.plant);
        over_time(title, self.time_unit.as_deref(), panels.collect())
    }
}

/// What is known of a run without true values.
fn foretold(foretold: &Foretold) -> String {
    let figures = [
        ("\u{2212}log L per reading", foretold.nll_per_reading, 6),
        ("held-out error", foretold.held_out_error, 3),
    ];
    let known = figures.into_iter();
    let known =
        known.filter_map(|(name, x, digits)| Some((name, lynkeus_words::figures(x?, digits))));
    known.map(|(name, x)| format!("; {name} {x}")).collect()
}

fn interesting(outcome: &Outcome) -> Vec<&Quantity> {
    let mut all: Vec<&Quantity> = outcome
        .quantities
        .iter()
        .filter(|q| q.estimate.is_some() || q.measured.is_some())
        .collect();
    all.sort_by_key(|q| (q.measured.is_some(), !q.unknown_input));
    if all.len() <= PANELS {
        return all;
    }
    let (mut measured, hidden): (Vec<_>, Vec<_>) =
        all.into_iter().partition(|q| q.measured.is_some());
    measured.truncate(2);
    let hidden = spread(hidden, PANELS - measured.len());
    hidden.into_iter().chain(measured).collect()
}

/// At most `count` of them, evenly spread: of a long chain the ends and the middle.
pub(crate) fn spread<T: Copy>(all: Vec<T>, count: usize) -> Vec<T> {
    if all.len() <= count || count < 2 {
        return all.into_iter().take(count).collect();
    }
    (0..count)
        .map(|k| all[k * (all.len() - 1) / (count - 1)])
        .collect()
}

fn panel(outcome: &Outcome, quantity: &Quantity) -> Panel {
    let unit = in_brackets(quantity.unit.as_deref());
    let caption = match &quantity.description {
        Some(description) => format!("{}: {description}{unit}", quantity.name),
        None => format!("{}{unit}", quantity.name),
    };
    let estimate = match quantity.estimate {
        Some(_) => &quantity.estimate,
        None => &quantity.expected,
    };
    let series = [
        (Kind::True, &quantity.truth),
        (Kind::Measured, &quantity.measured),
        (Kind::Estimated, estimate),
        (Kind::Smoothed, &quantity.smoothed),
    ];
    let curves = series
        .into_iter()
        .filter_map(|(kind, values)| Some(curve_of(outcome, quantity, kind, values.as_ref()?)))
        .collect();
    Panel {
        name: quantity.name.clone(),
        caption,
        curves,
        bands: bands(outcome, quantity),
        marks: outside(outcome, quantity),
        ..Panel::default()
    }
}

/// Standard deviations that a band reaches to either side.
const DEVIATIONS: f64 = 2.0;

/// About the estimate, and inside of that about the estimate given later rows.
fn bands(outcome: &Outcome, quantity: &Quantity) -> Vec<Band> {
    let pairs = [
        (&quantity.estimate, &quantity.deviation),
        (&quantity.smoothed, &quantity.smoothed_deviation),
    ];
    let pairs = pairs.into_iter();
    let is_wrapped = is_wrapped(quantity);
    let found =
        pairs.filter_map(|(x, sd)| Some(band(outcome, x.as_ref()?, sd.as_ref()?, is_wrapped)));
    found.collect()
}

fn band(outcome: &Outcome, estimate: &Series, deviation: &Series, is_wrapped: bool) -> Band {
    let edge = |side: f64| {
        let pairs = estimate.iter().zip(deviation);
        let edge = pairs.map(|(x, sd)| x + side * DEVIATIONS * sd);
        Series::gathered(estimate.store(), edge)
    };
    let (low, high) = (edge(-1.0), edge(1.0));
    let (time, low, high) = match is_wrapped {
        false => (outcome.time.clone(), low, high),
        true => {
            let (time, low) = lifted(&outcome.time, &low, estimate);
            (time, low, lifted(&outcome.time, &high, estimate).1)
        }
    };
    Band {
        extent: Extent::TwoDeviations,
        time,
        low,
        high,
    }
}

/// Whether a quantity is shown in one turn.
fn is_wrapped(quantity: &Quantity) -> bool {
    matches!(quantity.home, Home::Circle { from: Some(_) })
}

/// Time and values, with the pen lifted where angles go on in the next turn.
fn lifted(time: &Series, values: &Series, angles: &Series) -> (Series, Series) {
    let rows = || time.iter().zip(values).zip(angles);
    let before = std::iter::once(f64::NAN).chain(angles);
    let points = rows().zip(before).flat_map(|(((t, x), angle), before)| {
        let is_new = (angle - before).abs() > std::f64::consts::PI;
        let lift = is_new.then_some((t, f64::INFINITY));
        lift.into_iter().chain([(t, x)])
    });
    let (time, values): (Vec<f64>, Vec<f64>) = points.unzip();
    (time.into(), values.into())
}

fn curve_of(outcome: &Outcome, quantity: &Quantity, kind: Kind, values: &Series) -> Curve {
    match is_wrapped(quantity) {
        false => curve(outcome, kind, values),
        true => {
            let (time, values) = lifted(&outcome.time, values, values);
            Curve::new(kind, time, values)
        }
    }
}

/// When the estimate is outside of its declared range.
fn outside(outcome: &Outcome, quantity: &Quantity) -> Vec<Mark> {
    let excursions = outcome.estimate_outside.iter().flat_map(|o| &o.quantities);
    let mut own = excursions.filter(|e| e.name == quantity.name);
    let stretches = own.next().map_or(&[][..], |e| &e.stretches);
    let at = |row: usize| outcome.time.get(row);
    let spans = stretches
        .iter()
        .filter_map(|rows| Some(Mark::Outside(at(*rows.start())?..at(*rows.end())?)));
    spans.collect()
}

fn curve(outcome: &Outcome, kind: Kind, values: &Series) -> Curve {
    Curve::new(kind, outcome.time.clone(), values.clone())
}
