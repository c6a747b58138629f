//! The picture of an outcome.

use crate::prepare::mentioned::not_drawn;
use crate::{Error, Outcome, Quantity, Series};
use lynkeus_plot::{Band, Curve, Extent, Figure, Kind, Panel, Span};
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
            Some(names) => names
                .iter()
                .map(|name| find(self, name))
                .collect::<Result<Vec<_>, _>>()?,
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
        Ok(Figure {
            title: format!(
                "{}: {} observer",
                self.plant, self.design.examination.family
            ),
            time_label: time_label(self.time_unit.as_deref()),
            panels,
        })
    }
}

/// What stands under an axis of time.
pub(crate) fn time_label(unit: Option<&str>) -> String {
    unit.map_or("time".to_owned(), |unit| format!("time ({unit})"))
}
impl crate::Comparison {
    /// One panel per family: the quantity that is hardest to see, unknown inputs first.
    #[must_use]
    pub fn picture(&self) -> Figure {
        let panels = self.rows.iter().filter_map(|row| {
            let run = row.run.as_ref().ok()?;
            let quantity = *interesting(&run.outcome).first()?;
            let mut panel = panel(&run.outcome, quantity);
            panel.caption = format!("{}, {}", row.family, panel.caption);
            Some(panel)
        });
        Figure {
            title: format!("{}: families compared", self.plant),
            time_label: time_label(self.time_unit.as_deref()),
            panels: panels.collect(),
        }
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
        name: quantity.name.clone(),
        caption,
        curves,
        bands: bands(outcome, quantity),
        outside: outside(outcome, quantity),
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
fn outside(outcome: &Outcome, quantity: &Quantity) -> Vec<Span> {
    let excursions = outcome.estimate_outside.iter().flat_map(|o| &o.quantities);
    let mut own = excursions.filter(|e| e.name == quantity.name);
    let stretches = own.next().map_or(&[][..], |e| &e.stretches);
    let at = |row: usize| outcome.time.get(row);
    let spans = stretches.iter().filter_map(|rows| {
        Some(Span {
            from: at(*rows.start())?,
            to: at(*rows.end())?,
        })
    });
    spans.collect()
}

fn curve(outcome: &Outcome, kind: Kind, values: &Series) -> Curve {
    Curve {
        kind,
        time: outcome.time.clone(),
        values: values.clone(),
    }
}
