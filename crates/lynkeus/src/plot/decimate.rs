//! Long curves reduced to what a screen can show, and cut at the frame.

use std::ops::Range;

/// Points of a curve, at most four for each of `columns` equal spans of time: the first, the
/// lowest, the highest and the last, in their order. A curve with few points stays as it is.
/// Non-finite values are kept, one for each gap: they break the line.
pub(super) fn decimated(time: &[f64], values: &[f64], columns: usize) -> Vec<(f64, f64)> {
    let points: Vec<(f64, f64)> = time.iter().copied().zip(values.iter().copied()).collect();
    let (Some(first), Some(last)) = (points.first(), points.last()) else {
        return points;
    };
    let width = (last.0 - first.0) / columns as f64;
    if points.len() <= 4 * columns || width.is_nan() || width <= 0.0 {
        return points;
    }
    let column = |p: &(f64, f64)| ((p.0 - first.0) / width).floor();
    points
        .chunk_by(|a, b| column(a) == column(b) && a.1.is_finite() == b.1.is_finite())
        .flat_map(corners)
        .collect()
}

/// The first, lowest, highest and last point of a few, in their order, each once.
fn corners(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let by_value = |a: &(usize, &(f64, f64)), b: &(usize, &(f64, f64))| a.1.1.total_cmp(&b.1.1);
    let low = points.iter().enumerate().min_by(by_value);
    let high = points.iter().enumerate().max_by(by_value);
    let mut kept = vec![0, points.len().saturating_sub(1)];
    kept.extend(low.map(|(i, _)| i));
    kept.extend(high.map(|(i, _)| i));
    kept.sort_unstable();
    kept.dedup();
    kept.into_iter()
        .filter_map(|i| points.get(i).copied())
        .collect()
}

/// The pieces of a line inside a band of values: a line that leaves the band ends at its edge.
pub(super) fn clipped(points: &[(f64, f64)], band: &Range<f64>) -> Vec<Vec<(f64, f64)>> {
    let mut pieces: Vec<Vec<(f64, f64)>> = Vec::new();
    let mut joined = false;
    for pair in points.windows(2) {
        let &[a, b] = pair else { continue };
        let Some((from, to)) = segment(a, b, band) else {
            joined = false;
            continue;
        };
        match pieces.last_mut() {
            Some(piece) if joined && from == a => piece.push(to),
            _ => pieces.push(vec![from, to]),
        }
        joined = to == b;
    }
    pieces
}

/// A point on a picture's plane.
type Point = (f64, f64);

/// The part of a segment inside the band.
fn segment(a: Point, b: Point, band: &Range<f64>) -> Option<(Point, Point)> {
    let finite = [a.0, a.1, b.0, b.1].iter().all(|v| v.is_finite());
    let outside = |edge: fn(f64, f64) -> bool, at: f64| edge(a.1, at) && edge(b.1, at);
    if !finite || outside(|v, e| v < e, band.start) || outside(|v, e| v > e, band.end) {
        return None;
    }
    let moved = |p: Point, q: Point| {
        let edge = p.1.clamp(band.start, band.end);
        if edge == p.1 {
            return p;
        }
        let share = (edge - p.1) / (q.1 - p.1);
        (p.0 + share * (q.0 - p.0), edge)
    };
    Some((moved(a, b), moved(b, a)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spike_survives_decimation() {
        let n = 100_000;
        let time: Vec<f64> = (0..n).map(f64::from).collect();
        let mut values = vec![0.0; n as usize];
        values[54_321] = 7.0;
        let kept = decimated(&time, &values, 500);
        assert!(kept.len() <= 2000, "{}", kept.len());
        assert!(kept.contains(&(54_321.0, 7.0)));
        assert_eq!(kept.last().unwrap().0, f64::from(n - 1));
        assert!(kept.is_sorted_by(|a, b| a.0 < b.0));
    }

    #[test]
    fn a_line_is_cut_where_it_leaves_and_broken_at_gaps() {
        let points = [
            (0.0, 0.0),
            (1.0, 2.0),
            (2.0, 0.0),
            (3.0, f64::NAN),
            (4.0, 0.0),
            (5.0, 1.0),
        ];
        let pieces = clipped(&points, &(-1.0..1.0));
        assert_eq!(
            pieces,
            [
                vec![(0.0, 0.0), (0.5, 1.0)],
                vec![(1.5, 1.0), (2.0, 0.0)],
                vec![(4.0, 0.0), (5.0, 1.0)]
            ]
        );
    }

    #[test]
    fn a_line_across_the_band_keeps_both_edges() {
        let pieces = clipped(&[(0.0, -10.0), (1.0, 10.0)], &(-5.0..5.0));
        assert_eq!(pieces, [vec![(0.25, -5.0), (0.75, 5.0)]]);
    }
}
