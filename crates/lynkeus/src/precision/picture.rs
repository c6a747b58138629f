//! The errors drawn: a bar for every quantity, and curves over the horizon.

use super::Report;
use crate::Error;
use lynkeus_plot::{Bar, Bars, Chart, Line, Look, Plot, Upright};

/// Bars drawn; what is known better is left out.
const MOST: usize = 40;

impl Report {
    /// Bars with the standard error of every quantity at the longest horizon, and under them its course
    /// over the horizon, as SVG text.
    ///
    /// # Errors
    /// There is nothing finite to draw.
    pub fn to_svg(&self) -> Result<String, Error> {
        let best = self.advice.as_ref().and_then(|a| a.same_size.first());
        let best = best.filter(|set| set.sensors.iter().any(|s| *s >= self.measured));
        let bar = |&i: &usize| Bar {
            name: self.names[i].clone(),
            value: self.last().map_or(f64::INFINITY, |d| self.share(d, i)),
            dot: best.map(|set| self.share(&set.deviations, i)),
        };
        let order = self.ranked();
        let measured = self.sensors.iter().take(self.measured);
        let measured: Vec<&str> = measured.map(|s| s.name.as_str()).collect();
        let bars = Bars {
            caption: "standard error at present, share of the range".to_owned(),
            bars_name: format!("measuring {}", measured.join(", ")),
            dots_name: best.map_or(String::new(), |set| format!("measuring {}", self.set(set))),
            unseen: "not seen within this horizon".to_owned(),
            bars: order.iter().take(MOST).map(bar).collect(),
            below: self.curves(&order),
        };
        bars.to_svg()
    }

    fn curves(&self, order: &[usize]) -> Chart {
        let unit = self.time_unit.as_ref();
        let unit = unit.map_or(String::new(), |unit| format!(" ({unit})"));
        Chart {
            title: format!("{}: how well everything is known", self.plant),
            label: format!("horizon{unit}"),
            plots: vec![Plot {
                caption: "over the horizon, share of the range".to_owned(),
                upright: Upright::Log,
                lines: self.lines(order),
            }],
            ..Chart::default()
        }
    }

    /// All quantities palely, the least certain boldly, unknown inputs in orange.
    fn lines(&self, order: &[usize]) -> Vec<Line> {
        let look = |rank: usize, i: usize| match (rank, i >= self.states) {
            (0, _) => Look::Main,
            (_, true) => Look::Orange,
            _ => Look::Pale,
        };
        let line = |(rank, &i): (usize, &usize)| {
            let look = look(rank, i);
            let share = |d| {
                let share = self.share(d, i);
                if share.is_finite() && share > 0.0 {
                    share
                } else {
                    f64::NAN
                }
            };
            let values = self.deviations.iter().map(share);
            Line {
                look,
                name: match look {
                    Look::Pale => String::new(),
                    _ => self.names[i].clone(),
                },
                points: self.horizons.iter().copied().zip(values).collect(),
            }
        };
        let others = Line {
            look: Look::Pale,
            name: "others".to_owned(),
            points: vec![],
        };
        let lines = order.iter().enumerate().map(line);
        lines.chain([others]).collect()
    }
}
