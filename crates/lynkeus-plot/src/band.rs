//! What a panel shows behind its curves: bands, and spans of time that are marked.

use std::ops::Range;

use plotters::prelude::*;

use super::decimate::{decimated, stretches};
use super::style::{BLUE, Chart, Drawn, VERMILION};
use super::{Band, Span};
use lynkeus_table::Series;

/// Height of a mark as a share of the panel's.
const MARK: f64 = 0.03;

/// The band's own colour is pale: curves lie on it.
pub(super) fn band_style() -> ShapeStyle {
    BLUE.mix(0.18).filled()
}

pub(super) fn mark_style() -> ShapeStyle {
    VERMILION.mix(0.7).filled()
}

/// Draws a band, cut where the axis ends.
pub(super) fn draw_band(
    chart: &mut Chart<'_>,
    band: &Band,
    shown: &Range<f64>,
    columns: usize,
) -> Drawn {
    let edge = |values: &Series| decimated(&band.time, values, columns);
    let (low, high) = (edge(&band.low), edge(&band.high));
    for (low, high) in stretches(&low).zip(stretches(&high)) {
        let outline = high.iter().chain(low.iter().rev());
        let outline: Vec<(f64, f64)> = outline
            .map(|p| (p.0, p.1.clamp(shown.start, shown.end)))
            .collect();
        chart.draw_series([Polygon::new(outline, band_style())])?;
    }
    Ok(())
}

/// Marks spans of time at the foot of a panel; those closer than a column of the picture are one.
pub(super) fn draw_marks(
    chart: &mut Chart<'_>,
    spans: &[Span],
    time: &Range<f64>,
    shown: &Range<f64>,
    columns: usize,
) -> Drawn {
    let column = (time.end - time.start) / columns.max(1) as f64;
    let top = shown.start + MARK * (shown.end - shown.start);
    for span in joined(spans, column) {
        let (from, to) = (span.from, span.to.max(span.from + 2.0 * column));
        let corners = [(from, shown.start), (to.min(time.end), top)];
        chart.draw_series([Rectangle::new(corners, mark_style())])?;
    }
    Ok(())
}

/// Spans in the order of time, with gaps shorter than `gap` closed.
fn joined(spans: &[Span], gap: f64) -> Vec<Span> {
    let mut all: Vec<Span> = vec![];
    for span in spans {
        match all.last_mut() {
            Some(last) if span.from - last.to <= gap => last.to = last.to.max(span.to),
            _ => all.push(*span),
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_that_nobody_could_tell_apart_are_one() {
        let spans = [(0.0, 1.0), (1.05, 2.0), (3.0, 3.0), (3.05, 3.05)];
        let spans = spans.map(|(from, to)| Span { from, to });
        let found = joined(&spans, 0.1);
        let found: Vec<(f64, f64)> = found.iter().map(|s| (s.from, s.to)).collect();
        assert_eq!(found, [(0.0, 2.0), (3.0, 3.05)]);
    }
}
