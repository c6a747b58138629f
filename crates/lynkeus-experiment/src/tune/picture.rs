//! The trade-off drawn.

use super::axis::shown;
use super::{Sweep, measures};
use crate::Error;
use lynkeus_plot::{Curve, Figure, Kind, Mark, Panel, Scale};

/// Values that make each reading so much less likely, in logarithms, are out of sight.
const UNLIKELY: f64 = 2.0;

impl Sweep {
    /// The figures over the first key's values as SVG text. With several keys, the curve through
    /// the knee is drawn boldly and those of the other combinations palely.
    ///
    /// # Errors
    /// There is nothing finite to draw.
    pub fn to_svg(&self) -> Result<String, Error> {
        self.figure().to_svg()
    }

    /// The picture before it is drawn.
    pub fn figure(&self) -> Figure {
        let mut panels = self.panels();
        if let Some(first) = panels.first_mut() {
            first.marks.extend(self.failures());
        }
        Figure {
            title: format!("{}: {}", self.plant, self.subject()),
            label: self.axes.first().map_or(String::new(), |a| a.label()),
            across: Scale::Parameter,
            panels,
        }
    }

    /// The values about the knee that are as good, the knee, and the value that is used or proposed.
    fn marks(&self) -> Vec<Mark> {
        let first = self.axes.first();
        let knee = self.chosen().and_then(|row| row.values.first().copied());
        let (present, whose) = match first.and_then(|a| a.proposed) {
            Some(proposed) => (Some(proposed), "proposed"),
            None => (first.and_then(|a| a.present), "study"),
        };
        let good = self
            .good()
            .map(|good| Mark::Good(*good.start()..*good.end()));
        let chosen = knee.map(|x| {
            let word = match present == Some(x) && whose == "study" {
                true => "knee, and the study:",
                false => "knee",
            };
            Mark::Chosen(x, format!("{word} {}", shown(x)))
        });
        let present = present.filter(|x| knee != Some(*x) && self.covers(*x));
        let present = present.map(|x| Mark::Present(x, format!("{whose} {}", shown(x))));
        good.into_iter().chain(chosen).chain(present).collect()
    }

    fn subject(&self) -> String {
        let keys: Vec<&str> = self.axes.iter().map(|a| a.key.as_str()).collect();
        let on = self.log.as_ref().map_or("", |_| " on the log");
        format!("what {} trades{on}", keys.join(" and "))
    }

    /// Whether the first key's range includes a value.
    fn covers(&self, x: f64) -> bool {
        let values = || self.axes.iter().take(1).flat_map(|a| &a.values);
        values().any(|v| *v <= x) && values().any(|v| *v >= x)
    }

    /// The first key's values at which a run failed, the other keys being those of the knee.
    fn failures(&self) -> Vec<Mark> {
        let failed = self.rows.iter().filter(|row| self.beside_knee(row));
        failed
            .filter(|row| row.figure(self.objective).is_none())
            .filter_map(|row| row.values.first().copied())
            .map(Mark::Failed)
            .collect()
    }

    fn panels(&self) -> Vec<Panel> {
        match self.log {
            Some(_) => (0..self.measures.len()).map(|m| self.panel(m)).collect(),
            None => self.simulated(),
        }
    }

    /// The mean error with its two parts, then everything else.
    fn simulated(&self) -> Vec<Panel> {
        let mut mean = self.panel(measures::TOTAL_ERROR);
        mean.caption = "mean error (share of the range)".to_owned();
        mean.curves.iter_mut().for_each(|curve| {
            if curve.kind == Kind::Main {
                "with noise".clone_into(&mut curve.name);
            }
        });
        let part = |measure: usize, kind: Kind, name: &str| {
            let points = self.points(measure, |row| self.beside_knee(row));
            Curve::through(kind, points).named(name)
        };
        let grey = part(measures::EXACT_ERROR, Kind::Grey, "without noise");
        let orange = part(measures::NOISE_ERROR, Kind::Orange, "made by the noise");
        mean.curves.extend([grey, orange]);
        let others = [
            measures::SETTLING_TIME,
            measures::PEAK_ERROR,
            measures::NOISE_GAIN,
            measures::ULTIMATE_BOUND,
            measures::SAMPLING_MARGIN,
        ];
        let others = others.into_iter().filter(|m| *m < self.measures.len());
        let others = others.map(|measure| self.panel(measure));
        [mean].into_iter().chain(others).collect()
    }

    /// Up to which value a figure is drawn.
    fn most_drawn(&self, measure: usize) -> f64 {
        let is_likelihood = self.measures.get(measure) == Some(&measures::LIKELIHOOD);
        let all = self.rows.iter().filter_map(|row| row.figure(measure));
        match is_likelihood {
            true => all.fold(f64::INFINITY, f64::min) + UNLIKELY,
            false => f64::INFINITY,
        }
    }

    /// One figure: a curve for every combination of the keys after the first.
    fn panel(&self, measure: usize) -> Panel {
        let mut combinations: Vec<&[f64]> = vec![];
        for row in &self.rows {
            let others = row.values.get(1..).unwrap_or_default();
            if !combinations.contains(&others) {
                combinations.push(others);
            }
        }
        let knee = self.chosen().and_then(|row| row.values.get(1..));
        let most = self.most_drawn(measure);
        let curve = |others: &&[f64]| {
            let kind = match knee == Some(*others) {
                true => Kind::Main,
                false => Kind::Pale,
            };
            let mut points = self.points(measure, |row| row.values.get(1..) == Some(*others));
            points.retain(|(_, y)| *y <= most || y.is_nan());
            Curve::through(kind, points)
        };
        let found = self.measures.get(measure);
        let unit = self
            .time_unit
            .as_deref()
            .filter(|_| found.is_some_and(|m| m.is_time));
        let title = found.map_or("", |m| m.title);
        Panel {
            caption: match unit {
                Some(unit) => format!("{title} ({unit})"),
                None => title.to_owned(),
            },
            upwards: match found.map(|m| m.name) {
                Some("ultimate_bound") => Scale::Log,
                _ if found == Some(&measures::LIKELIHOOD) => Scale::Whole,
                _ => Scale::FromZero,
            },
            curves: combinations.iter().map(curve).collect(),
            marks: self.marks(),
            ..Panel::default()
        }
    }
}
