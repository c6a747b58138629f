//! The picture of an outcome.

use crate::prepare::mentioned::not_drawn;
use crate::{Error, Outcome, Quantity, Series};
use lynkeus_plot::{Band, Curve, Extent, Figure, Kind, Mark, Panel};
use lynkeus_study::Name;

/// Panels drawn where the study does not say which.
pub(crate) const PANELS: usize = 6;

/// The picture: the quantities of `show`, else unknown inputs and hidden states
/// first, then what is measured, six at most; then the monitors.
///
/// # Errors
/// `show` names something that is neither estimated nor measured.
pub fn figure(
    outcome: &Outcome,
    time_unit: Option<&str>,
    show: Option<&[Name]>,
) -> Result<Figure, Error> {
    let chosen = match show {
        Some(names) => names
            .iter()
            .map(|name| find(outcome, name))
            .collect::<Result<Vec<_>, _>>()?,
        None => interesting(outcome),
    };
    let mut panels: Vec<Panel> = chosen.into_iter().map(|q| panel(outcome, q)).collect();
    panels.extend(outcome.watches.iter().map(|watch| Panel {
        caption: format!(
            "{} (alarm below {})",
            watch.header, watch.monitor.alarm_below
        ),
        curves: vec![curve(outcome, Kind::Estimated, &watch.values)],
        ..Panel::default()
    }));
    let family = outcome.design.examination.family;
    let title = format!("{}: {family} observer", outcome.plant);
    Ok(over_time(title, time_unit, panels))
}

/// Panels over time.
pub(crate) fn over_time(title: String, time_unit: Option<&str>, panels: Vec<Panel>) -> Figure {
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
    pub fn picture(&self, time_unit: Option<&str>) -> Figure {
        let panels = self.rows.iter().filter_map(|row| {
            let run = row.run.as_ref().ok()?;
            let quantity = *interesting(&run.outcome).first()?;
            let mut panel = panel(&run.outcome, quantity);
            panel.caption = format!("{}, {}", row.family, panel.caption);
            Some(panel)
        });
        let title = format!("{}: families compared", self.plant);
        over_time(title, time_unit, panels.collect())
    }
}

fn find<'o>(outcome: &'o Outcome, name: &Name) -> Result<&'o Quantity, Error> {
    let mut quantities = outcome.quantities.iter();
    quantities.find(|q| q.name == name.text).ok_or_else(|| {
        let names = outcome.quantities.iter().map(|q| q.name.as_str());
        not_drawn(name, "nothing", &names.collect::<Vec<_>>())
    })
}

fn interesting(outcome: &Outcome) -> Vec<&Quantity> {
    let mut all: Vec<&Quantity> = outcome
        .quantities
        .iter()
        .filter(|q| q.estimate.is_some() || q.measured.is_some())
        .collect();
    all.sort_by_key(|q| (q.measured.is_some(), !q.unknown_input));
    if all.len() > PANELS {
        let measured = all.iter().filter(|q| q.measured.is_some()).count().min(2);
        let hidden: Vec<&Quantity> = spread(
            all.iter()
                .copied()
                .filter(|q| q.measured.is_none())
                .collect(),
            PANELS - measured,
        );
        let shown = all
            .iter()
            .copied()
            .filter(|q| q.measured.is_some())
            .take(measured);
        return hidden.into_iter().chain(shown).collect();
    }
    all
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
    // "1" is Modelica's unit of numbers without one
    let unit = quantity.unit.as_ref().filter(|unit| *unit != "1");
    let unit = unit.map_or(String::new(), |unit| format!(" ({unit})"));
    let mut caption = format!("{}{unit}", quantity.name);
    if let Some(description) = &quantity.description {
        caption = format!("{}: {description}{unit}", quantity.name);
    }
    let series = [
        (Kind::True, &quantity.truth),
        (Kind::Measured, &quantity.measured),
        (
            Kind::Estimated,
            quantity
                .estimate
                .as_ref()
                .map_or(&quantity.expected, |_| &quantity.estimate),
        ),
        (Kind::Smoothed, &quantity.smoothed),
    ];
    let curves = series
        .into_iter()
        .filter_map(|(kind, values)| Some(curve(outcome, kind, values.as_ref()?)))
        .collect();
    Panel {
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
    let found = pairs.filter_map(|(x, sd)| Some(band(outcome, x.as_ref()?, sd.as_ref()?)));
    found.collect()
}

fn band(outcome: &Outcome, estimate: &Series, deviation: &Series) -> Band {
    let edge = |side: f64| {
        let pairs = estimate.iter().zip(deviation);
        let edge = pairs.map(|(x, sd)| x + side * DEVIATIONS * sd);
        Series::gathered(estimate.store(), edge)
    };
    Band {
        extent: Extent::TwoDeviations,
        time: outcome.time.clone(),
        low: edge(-1.0),
        high: edge(1.0),
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
