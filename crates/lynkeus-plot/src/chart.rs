//! Figures over a parameter: a broad panel, and smaller ones in two columns under it.

use std::ops::{Range, RangeInclusive};

use super::axis::Axis;
use super::limits::extremes;

/// Ends of a logarithmic axis differ at least by this ratio.
const LOG: f64 = 2.5;

/// The height of a panel that is cut, as a multiple of the value at the mark.
const CUT: f64 = 8.0;

/// The depth of a logarithmic panel, as a ratio of its greatest value to its least.
const DEEP: f64 = 1e6;

/// Panels that share the axis of a parameter.
#[derive(Clone, Debug, Default)]
pub struct Chart {
    /// The line above everything.
    pub title: String,
    /// The label of the parameter's axis.
    pub label: String,
    /// A vertical line with a word, in colour: what is recommended.
    pub mark: Option<(f64, String)>,
    /// A dashed vertical line with a word: what is used at present.
    pub present: Option<(f64, String)>,
    /// A band of values behind the curves.
    pub band: Option<RangeInclusive<f64>>,
    /// Values for which there is nothing to draw, crossed out at the top of the first panel.
    pub crosses: Vec<f64>,
    /// The panels; the first is as broad as the picture.
    pub plots: Vec<Plot>,
}

/// One panel.
#[derive(Clone, Debug, Default)]
pub struct Plot {
    /// What it shows.
    pub caption: String,
    /// How its values are laid out.
    pub upright: Upright,
    /// Its curves.
    pub lines: Vec<Line>,
}

/// The value axis of a panel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Upright {
    /// From zero; where the values reach beyond eight times the value at the mark, cut there.
    #[default]
    Linear,
    /// Logarithmic, six decades at most.
    Log,
}

/// One curve: (parameter, value) in the order of the parameter; a NaN breaks the line.
#[derive(Clone, Debug)]
pub struct Line {
    /// How it is drawn.
    pub look: Look,
    /// Its word in the legend; empty for none.
    pub name: String,
    /// Its points.
    pub points: Vec<(f64, f64)>,
}

/// How a curve of a [`Chart`] is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Look {
    /// Thin and pale, behind everything.
    Pale,
    /// Grey.
    Grey,
    /// Orange.
    Orange,
    /// Blue and broad, with dots, before everything.
    Main,
}

impl Chart {
    /// The parameter's axis: logarithmic where its values are positive and far apart.
    pub(super) fn axis(&self) -> Option<Axis> {
        let points = self.plots.iter().flat_map(|p| &p.lines);
        let values = points.flat_map(|l| l.points.iter().map(|p| p.0));
        let ends = extremes(values.chain(self.crosses.iter().copied()))?;
        if ends.start == ends.end {
            let air = (0.5 * ends.start.abs()).max(1e-3);
            return Some(Axis {
                is_log: false,
                ends: ends.start - air..ends.end + air,
            });
        }
        Some(Axis {
            is_log: ends.start > 0.0 && ends.end > LOG * ends.start,
            ends,
        })
    }
}

impl Plot {
    /// The axis of its values, given the parameter at the mark; none where nothing is finite.
    pub(super) fn axis(&self, mark: Option<f64>) -> Option<Axis> {
        let values = self.lines.iter().flat_map(|l| l.points.iter().map(|p| p.1));
        let all = extremes(values)?;
        match self.upright {
            Upright::Linear => Some(self.linear(all, mark)),
            Upright::Log => self.logarithmic(all),
        }
    }

    fn linear(&self, all: Range<f64>, mark: Option<f64>) -> Axis {
        let at_mark = mark.and_then(|x| self.highest_at(x));
        let top = match at_mark {
            Some(value) if value > 0.0 => all.end.min(CUT * value),
            _ => all.end,
        };
        let top = if top > 0.0 { 1.06 * top } else { 1.0 };
        Axis {
            is_log: false,
            ends: all.start.min(0.0)..top,
        }
    }

    fn logarithmic(&self, all: Range<f64>) -> Option<Axis> {
        if all.end <= 0.0 {
            return None;
        }
        let values = self.lines.iter().flat_map(|l| l.points.iter().map(|p| p.1));
        // beyond ten times the range an estimate is lost, how far does not matter
        let top = all.end.min(10.0);
        let low = extremes(values.filter(|v| *v > 0.0 && *v <= top))?.start;
        let low = low.max(top / DEEP).min(top / 10.0);
        Some(Axis {
            is_log: true,
            ends: low / 1.2..top * 1.2,
        })
    }

    /// The greatest value of the curves that are not pale, at a parameter.
    fn highest_at(&self, x: f64) -> Option<f64> {
        let lines = self.lines.iter().filter(|l| l.look != Look::Pale);
        let points = lines.flat_map(|l| &l.points);
        let values = points.filter(|p| p.0 == x && p.1.is_finite()).map(|p| p.1);
        values.max_by(f64::total_cmp)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot(upright: Upright, values: &[(f64, f64)]) -> Plot {
        Plot {
            caption: "error".to_owned(),
            upright,
            lines: vec![Line {
                look: Look::Main,
                name: String::new(),
                points: values.to_vec(),
            }],
        }
    }

    #[test]
    fn a_curve_that_runs_away_is_cut_at_eight_times_the_mark() {
        let points = [(1.0, 3.0), (2.0, 1.0), (4.0, 1e6)];
        let axis = plot(Upright::Linear, &points).axis(Some(2.0)).unwrap();
        assert_eq!(axis.ends, 0.0..1.06 * 8.0);
        let axis = plot(Upright::Linear, &points[..2]).axis(Some(2.0)).unwrap();
        assert_eq!(axis.ends, 0.0..1.06 * 3.0);
    }

    #[test]
    fn a_logarithmic_panel_has_a_floor() {
        let points = [(1.0, 0.1), (2.0, 1e-15), (4.0, 0.0), (5.0, 1e9)];
        let axis = plot(Upright::Log, &points).axis(None).unwrap();
        assert!((axis.ends.start - 1e-5 / 1.2).abs() < 1e-9, "{axis:?}");
        assert_eq!(axis.ends.end, 12.0);
        assert_eq!(plot(Upright::Log, &[(1.0, 0.0)]).axis(None), None);
    }

    #[test]
    fn the_picture_has_its_words_and_no_holes() {
        let mut chart = Chart {
            title: "T <1>".to_owned(),
            label: "theta".to_owned(),
            mark: Some((2.0, "knee".to_owned())),
            present: Some((4.0, "study".to_owned())),
            band: Some(1.5..=2.5),
            crosses: vec![8.0],
            plots: vec![plot(Upright::Linear, &[(1.0, 3.0), (2.0, 1.0), (4.0, f64::NAN)]); 4],
        };
        let svg = chart.to_svg().unwrap();
        for word in ["T &lt;1&gt;", "theta", "knee", "study", "error"] {
            assert!(svg.contains(word), "{word}");
        }
        assert!(!svg.contains("NaN"));
        chart.plots.clear();
        chart.crosses.clear();
        assert!(chart.to_svg().is_err());
    }
}
