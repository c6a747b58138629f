//! The limits of a panel's axis, such that a peak does not hide the rest.

use std::ops::Range;

use super::axis::{Axis, extremes};
use super::{Band, Extent, Kind, Mark, Panel, Scale};
use lynkeus_table::Series;
use lynkeus_table::series::{Sorted, Store};

/// A panel is cut when its curves span more than this many times what is worth seeing.
const TOO_TALL: f64 = 4.0;

/// Where values reach beyond this multiple of the value that is chosen, an axis from zero is cut.
const CUT: f64 = 8.0;

/// The axis of a panel.
#[derive(Clone, Debug, PartialEq)]
pub struct Limits {
    /// What the axis shows.
    pub shown: Range<f64>,
    /// The extreme value of the estimate that lies farthest outside, where the axis is cut.
    pub beyond: Option<f64>,
}

impl Panel {
    /// The limits of the value axis: everything, unless the estimate peaks.
    ///
    /// The core of a panel is the span of its true and measured values together with the middle
    /// 90 % of the estimate and of the ends of its bands; a band of deviations that is wider elsewhere is cut. Where all values span more than 4 times the core, the axis ends one
    /// core's height beyond it on either side. `None` when nothing is finite.
    pub fn limits(&self) -> Option<Limits> {
        let curves = extremes(self.values(|_| true))?;
        // sorted once: they may be long
        let bands: Vec<Range<f64>> = self.bands().collect();
        let all = bands.iter().fold(curves, |all, b| union(&all, b));
        let core = self.core(bands).unwrap_or_else(|| all.clone());
        let height = core.end - core.start;
        if height > 0.0 && all.end - all.start > TOO_TALL * height {
            let shown = (core.start - height).max(all.start)..(core.end + height).min(all.end);
            let beyond = match shown.start - all.start > all.end - shown.end {
                true => all.start,
                false => all.end,
            };
            return Some(Limits {
                shown: padded(shown),
                beyond: Some(beyond),
            });
        }
        let whole = self.quantiles().fold(all.clone(), |all, b| union(&all, &b));
        let is_too_tall = whole.end - whole.start > TOO_TALL * height;
        Some(Limits {
            shown: padded(if is_too_tall { all } else { whole }),
            beyond: None,
        })
    }

    /// The axis upwards, and where it is cut the extreme value; none where there is nothing finite to show.
    pub(super) fn axis(&self) -> Option<(Axis, Option<f64>)> {
        if self.upwards != Scale::Whole {
            let most = self.chosen().map(|value| CUT * value);
            let axis = self.upwards.axis(|| self.values(|_| true), most)?;
            return Some((axis, None));
        }
        // a quantity without values keeps its place
        let limits = self.limits().unwrap_or(Limits {
            shown: -1.0..1.0,
            beyond: None,
        });
        Some((Axis::linear(limits.shown), limits.beyond))
    }

    /// The greatest value of the curves that are not pale, at what is chosen; if it is positive.
    fn chosen(&self) -> Option<f64> {
        let chosen = self.marks.iter().find_map(|mark| match mark {
            Mark::Chosen(at, _) => Some(*at),
            _ => None,
        })?;
        let curves = self.curves.iter().filter(|c| c.kind != Kind::Pale);
        let points = curves.flat_map(|c| c.time.iter().zip(&c.values));
        let values = points.filter(|p| p.0 == chosen && p.1.is_finite());
        let greatest = values.map(|p| p.1).max_by(f64::total_cmp);
        greatest.filter(|value| *value > 0.0)
    }

    /// What bands of quantiles span: errors that there were, not only what is thought possible.
    fn quantiles(&self) -> impl Iterator<Item = Range<f64>> {
        let own = self.bands.iter().filter(|b| b.extent == Extent::Quantiles);
        own.filter_map(|b| extremes(b.low.iter().chain(&b.high)))
    }

    fn core(&self, bands: Vec<Range<f64>>) -> Option<Range<f64>> {
        let peaks = |kind| matches!(kind, Kind::Estimated | Kind::Worst | Kind::Mean);
        let known = extremes(self.values(|kind| !peaks(kind)));
        let store = self.curves.first().map(|c| c.values.store());
        let middle = store.and_then(|store| middle(store, self.values(peaks)));
        let spans = known.into_iter().chain(middle).chain(bands);
        spans.reduce(|a, b| union(&a, &b))
    }

    /// What a band spans at 90 % of the instants.
    fn bands(&self) -> impl Iterator<Item = Range<f64>> {
        let span = |band: &Band| {
            let middle = |edge: &Series| middle(edge.store(), edge.iter());
            Some(union(&middle(&band.low)?, &middle(&band.high)?))
        };
        self.bands.iter().filter_map(span)
    }

    fn values(&self, of: impl Fn(Kind) -> bool) -> impl Iterator<Item = f64> {
        self.curves
            .iter()
            .filter(move |c| of(c.kind))
            .flat_map(|c| &c.values)
            .filter(|v| v.is_finite())
    }
}

/// The span of the middle 90 % of the finite values.
fn middle(store: &Store, values: impl Iterator<Item = f64>) -> Option<Range<f64>> {
    let sorted = Sorted::new(store, values.filter(|v| v.is_finite()));
    let cut = sorted.len() / 20;
    let last = sorted.len().checked_sub(1 + cut)?;
    Some(sorted.at(cut)?..sorted.at(last)?)
}

fn union(a: &Range<f64>, b: &Range<f64>) -> Range<f64> {
    a.start.min(b.start)..a.end.max(b.end)
}

/// Some air above and below; a constant gets an axis around it.
fn padded(range: Range<f64>) -> Range<f64> {
    let height = range.end - range.start;
    let scale = range.start.abs().max(range.end.abs());
    let air = match height > 1e-9 * scale {
        true => 0.06 * height,
        false if scale > 0.0 => 0.1 * scale,
        false => 1.0,
    };
    range.start - air..range.end + air
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Curve;

    fn curve(kind: Kind, values: Vec<f64>) -> Curve {
        let time = (0..values.len()).map(|i| i as f64);
        Curve::new(kind, time.collect::<Vec<_>>(), values)
    }

    fn panel(curves: Vec<Curve>) -> Panel {
        Panel {
            curves,
            ..Panel::default()
        }
    }

    #[test]
    fn a_peak_is_cut_and_told() {
        let mut estimate = vec![0.5; 100];
        estimate[1] = -40.0;
        let truth = curve(Kind::True, vec![0.0, 1.0]);
        let limits = panel(vec![truth, curve(Kind::Estimated, estimate)])
            .limits()
            .unwrap();
        assert_eq!(limits.beyond, Some(-40.0));
        assert!(limits.shown.start > -1.2 && limits.shown.start < -1.0);
        assert!(limits.shown.end > 1.0 && limits.shown.end < 1.2);
    }

    #[test]
    fn a_modest_overshoot_is_shown_whole() {
        let truth = curve(Kind::True, vec![0.0, 1.0]);
        let limits = panel(vec![truth, curve(Kind::Estimated, vec![0.0, 3.0, 1.0])])
            .limits()
            .unwrap();
        assert_eq!(limits.beyond, None);
        assert!(limits.shown.end > 3.0);
    }

    #[test]
    fn quantiles_are_shown_whole_and_deviations_are_not() {
        let limits = |extent: Extent| {
            let mut high = vec![1.0; 100];
            high[3] = 1.5;
            let band = Band {
                extent,
                time: (0..100).map(f64::from).collect::<Vec<_>>().into(),
                low: vec![-1.0; 100].into(),
                high: high.into(),
            };
            let mean = curve(Kind::Mean, vec![0.0; 100]);
            let panel = Panel {
                bands: vec![band],
                ..panel(vec![mean])
            };
            panel.limits().unwrap().shown.end
        };
        assert!(limits(Extent::Quantiles) > 1.5);
        assert!(limits(Extent::TwoDeviations) < 1.2);
    }

    #[test]
    fn constants_zeros_and_nothing_have_an_axis_or_none() {
        let of = |values| panel(vec![curve(Kind::True, values)]).limits();
        assert_eq!(of(vec![5.0, 5.0]).unwrap().shown, 4.5..5.5);
        assert_eq!(of(vec![0.0]).unwrap().shown, -1.0..1.0);
        assert_eq!(of(vec![f64::NAN]), None);
        assert_eq!(of(vec![]), None);
    }

    #[test]
    fn a_curve_that_runs_away_is_cut_at_eight_times_what_is_chosen() {
        let end = |points: &[(f64, f64)]| {
            let panel = Panel {
                upwards: Scale::FromZero,
                marks: vec![Mark::Chosen(2.0, "knee".to_owned())],
                ..panel(vec![Curve::through(Kind::Main, points.to_vec())])
            };
            let axis = panel.axis().unwrap().0;
            assert_eq!(axis.ends.start, 0.0);
            axis.ends.end
        };
        let points = [(1.0, 3.0), (2.0, 1.0), (4.0, 1e6)];
        assert_eq!(end(&points), 1.06 * 8.0);
        assert_eq!(end(&points[..2]), 1.06 * 3.0);
    }
}
