//! The errors drawn: a bar for every quantity, and curves over the horizon.

use super::{Deviations, Report};
use crate::Error;
use lynkeus_plot::{Curve, Figure, Kind, Mark, Panel, Scale};

/// Bars drawn; what is known better is left out.
const MOST: usize = 40;

impl Report {
    /// Bars with the standard error of every quantity at the longest horizon, and under them its course
    /// over the horizon, as SVG text.
    ///
    /// # Errors
    /// There is nothing finite to draw.
    pub fn to_svg(&self) -> Result<String, Error> {
        let order = self.ranked();
        let unit = self.time_unit.as_ref();
        let unit = unit.map_or(String::new(), |unit| format!(" ({unit})"));
        let over_horizon = Panel {
            caption: "over the horizon, share of the range".to_owned(),
            upwards: Scale::Log,
            curves: self.curves(&order),
            ..Panel::default()
        };
        let figure = Figure {
            title: format!("{}: how well everything is known", self.plant),
            label: format!("horizon{unit}"),
            across: Scale::Parameter,
            panels: vec![self.bars(&order), over_horizon],
        };
        figure.to_svg()
    }

    /// A row for every quantity; dots are the errors with the best sensors of the same number.
    fn bars(&self, order: &[usize]) -> Panel {
        let measured = self.sensors.iter().take(self.measured);
        let measured: Vec<&str> = measured.map(|s| s.name.as_str()).collect();
        let measured = format!("measuring {}", measured.join(", "));
        let best = self.advice.as_ref().and_then(|a| a.same_size.first());
        let best = best.filter(|set| set.sensors.iter().any(|s| *s >= self.measured));
        let rows = || order.iter().take(MOST).enumerate();
        let of = |kind, deviations: &Deviations| {
            let shares = rows().map(|(row, &i)| (self.share(deviations, i), row as f64));
            Curve::through(kind, shares.filter(|(share, _)| share.is_finite()))
        };
        let last = self.last();
        let bars = last.map(|deviations| of(Kind::Bars, deviations).named(measured));
        let dots = best.map(|set| {
            of(Kind::Dots, &set.deviations).named(format!("measuring {}", self.set(set)))
        });
        let is_unseen = |i: usize| !last.is_some_and(|d| self.share(d, i).is_finite());
        let unseen = rows().filter(|(_, i)| is_unseen(**i));
        let said =
            unseen.map(|(row, _)| Mark::Said(row, "not seen within this horizon".to_owned()));
        Panel {
            caption: "standard error at present, share of the range".to_owned(),
            across: Some(Scale::Log),
            upwards: Scale::Rows(rows().map(|(_, &i)| self.names[i].clone()).collect()),
            curves: bars.into_iter().chain(dots).collect(),
            marks: said.collect(),
            ..Panel::default()
        }
    }

    /// All quantities palely, the least certain boldly, unknown inputs in orange.
    fn curves(&self, order: &[usize]) -> Vec<Curve> {
        let curve = |(rank, &i): (usize, &usize)| {
            let (kind, name) = match (rank, i >= self.states) {
                (0, _) => (Kind::Main, self.names[i].as_str()),
                (_, true) => (Kind::Orange, self.names[i].as_str()),
                _ => (Kind::Pale, "others"),
            };
            let shares = self.deviations.iter().map(|d| self.share(d, i));
            Curve::through(kind, self.horizons.iter().copied().zip(shares)).named(name)
        };
        order.iter().enumerate().map(curve).collect()
    }
}
