//! One curve of a panel.

use std::ops::Range;

use plotters::prelude::*;

use super::decimate::{clipped, decimated};
use super::style::{Chart, Drawn, LEFT, ORANGE, RIGHT, WIDTH, stroke};
use super::{Curve, Kind};

/// A piece of a curve that is smaller than these shares of the panel, and would be no line.
const WIDTH_OF_DOT: f64 = 1.0 / 800.0;
const HEIGHT_OF_DOT: f64 = 1.0 / 200.0;

/// Draws a curve, cut where the axis ends: readings as dots, everything else as lines.
pub(super) fn draw_curve(
    chart: &mut Chart<'_>,
    curve: &Curve,
    time: &Range<f64>,
    shown: &Range<f64>,
) -> Drawn {
    let columns = (WIDTH - LEFT - RIGHT) as usize;
    let points = decimated(&curve.time, &curve.values, columns);
    if curve.kind == Kind::Measured {
        let dots = points.into_iter().filter(|p| shown.contains(&p.1));
        let style = ORANGE.mix(0.75).filled();
        chart.draw_series(dots.map(|p| Circle::new(p, 2, style)))?;
        return Ok(());
    }
    let style = stroke(curve.kind);
    for piece in clipped(&points, shown) {
        if let Some(dot) = dot(&piece, time, shown) {
            let radius = 1 + style.stroke_width / 2;
            chart.draw_series([Circle::new(dot, radius, style.filled())])?;
        } else {
            chart.draw_series([PathElement::new(piece, style)])?;
        }
    }
    Ok(())
}

/// Where a piece of a curve is, if it is too small for a line.
fn dot(piece: &[(f64, f64)], time: &Range<f64>, shown: &Range<f64>) -> Option<(f64, f64)> {
    let first = *piece.first()?;
    let is_near = |p: &(f64, f64)| {
        (p.0 - first.0).abs() < WIDTH_OF_DOT * (time.end - time.start)
            && (p.1 - first.1).abs() < HEIGHT_OF_DOT * (shown.end - shown.start)
    };
    piece.iter().all(is_near).then_some(first)
}
