//! The trade-off drawn.

use super::axis::shown;
use super::{Sweep, measures};
use crate::Error;
use lynkeus_plot::{Chart, Line, Look, Plot, Upright};

impl Sweep {
    /// The figures over the first key's values as SVG text. With several keys, the curve through
    /// the knee is drawn boldly and those of the other combinations palely.
    ///
    /// # Errors
    /// There is nothing finite to draw.
    pub fn to_svg(&self) -> Result<String, Error> {
        self.chart().to_svg()
    }

    /// The picture before it is drawn.
    pub fn chart(&self) -> Chart {
        let first = self.axes.first();
        let knee = self.chosen().and_then(|row| row.values.first().copied());
        let word = |word: &str, x: f64| Some((x, format!("{word} {}", shown(x))));
        let (present, whose) = match first.and_then(|a| a.proposed) {
            Some(proposed) => (Some(proposed), "proposed"),
            None => (first.and_then(|a| a.present), "study"),
        };
        Chart {
            title: format!("{}: {}", self.plant, self.subject()),
            label: first.map_or(String::new(), |a| a.label()),
            mark: knee.and_then(|x| match present == Some(x) {
                true if whose == "study" => word("knee, and the study:", x),
                _ => word("knee", x),
            }),
            present: present
                .filter(|x| knee != Some(*x) && self.covers(*x))
                .and_then(|x| word(whose, x)),
            band: self.good(),
            crosses: self.failures(),
            plots: self.plots(),
        }
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
    fn failures(&self) -> Vec<f64> {
        let failed = self.rows.iter().filter(|row| self.beside_knee(row));
        failed
            .filter(|row| row.figure(measures::OBJECTIVE).is_none())
            .filter_map(|row| row.values.first().copied())
            .collect()
    }

    fn plots(&self) -> Vec<Plot> {
        match self.log {
            Some(_) => (0..self.measures.len()).map(|m| self.plot(m)).collect(),
            None => self.simulated_plots(),
        }
    }

    /// The mean error with its two parts, then everything else.
    fn simulated_plots(&self) -> Vec<Plot> {
        let mut mean = self.plot(measures::TOTAL_ERROR);
        mean.caption = "mean error (share of the range)".to_owned();
        mean.lines.iter_mut().for_each(|line| {
            if line.look == Look::Main {
                "with noise".clone_into(&mut line.name);
            }
        });
        let part = |measure: usize, look: Look, name: &str| Line {
            look,
            name: name.to_owned(),
            points: self.points(measure, |row| self.beside_knee(row)),
        };
        let grey = part(measures::EXACT_ERROR, Look::Grey, "without noise");
        let orange = part(measures::NOISE_ERROR, Look::Orange, "made by the noise");
        mean.lines.extend([grey, orange]);
        let others = [
            measures::SETTLING_TIME,
            measures::PEAK_ERROR,
            measures::NOISE_GAIN,
            measures::ULTIMATE_BOUND,
            measures::SAMPLING_MARGIN,
        ];
        let others = others.into_iter().map(|measure| self.plot(measure));
        [mean].into_iter().chain(others).collect()
    }

    /// One figure: a curve for every combination of the keys after the first.
    fn plot(&self, measure: usize) -> Plot {
        let mut combinations: Vec<&[f64]> = vec![];
        for row in &self.rows {
            let others = row.values.get(1..).unwrap_or_default();
            if !combinations.contains(&others) {
                combinations.push(others);
            }
        }
        let knee = self.chosen().and_then(|row| row.values.get(1..));
        let line = |others: &&[f64]| Line {
            look: match knee == Some(*others) {
                true => Look::Main,
                false => Look::Pale,
            },
            name: String::new(),
            points: self.points(measure, |row| row.values.get(1..) == Some(*others)),
        };
        let found = self.measures.get(measure);
        let unit = self
            .time_unit
            .as_deref()
            .filter(|_| found.is_some_and(|m| m.is_time));
        let title = found.map_or("", |m| m.title);
        Plot {
            caption: match unit {
                Some(unit) => format!("{title} ({unit})"),
                None => title.to_owned(),
            },
            upright: match found.map(|m| m.name) {
                Some("ultimate_bound") => Upright::Log,
                _ => Upright::Linear,
            },
            lines: combinations.iter().map(line).collect(),
        }
    }
}
