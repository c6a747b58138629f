//! Long curves reduced to what a screen can show, and cut at the frame.

use std::ops::Range;

use crate::Series;

/// A point on a picture's plane.
type Point = (f64, f64);

/// Points of a curve, at most four for each of `columns` equal spans of time: the first, the
/// lowest, the highest and the last, in their order. A curve with few points stays as it is.
/// Non-finite values are kept, one for each gap: they break the line.
pub(super) fn decimated(time: &Series, values: &Series, columns: usize) -> Vec<(f64, f64)> {
    let points = || time.iter().zip(values);
    let count = time.len().min(values.len());
    let (first, last) = (time.get(0), count.checked_sub(1).and_then(|i| time.get(i)));
    let (Some(first), Some(last)) = (first, last) else {
        return vec![];
    };
    let width = (last - first) / columns as f64;
    if count <= 4 * columns || width.is_nan() || width <= 0.0 {
        return points().collect();
    }
    let column = |p: Point| ((p.0 - first) / width).floor();
    let are_together =
        |a: Point, b: Point| column(a) == column(b) && a.1.is_finite() == b.1.is_finite();
    let mut kept = vec![];
    let mut few: Option<Few> = None;
    for point in points().enumerate() {
        match &mut few {
            Some(few) if are_together(few.last.1, point.1) => few.take(point),
            _ => {
                kept.extend(few.replace(Few::new(point)).iter().flat_map(Few::corners));
            }
        }
    }
    kept.extend(few.iter().flat_map(Few::corners));
    kept
}

/// A point of a curve with its row.
type Numbered = (usize, Point);

/// What is drawn of points that are close together.
struct Few {
    first: Numbered,
    low: Numbered,
    high: Numbered,
    last: Numbered,
}

impl Few {
    fn new(point: Numbered) -> Self {
        Self {
            first: point,
            low: point,
            high: point,
            last: point,
        }
    }

    fn take(&mut self, point: Numbered) {
        let y = |p: Numbered| p.1.1;
        if y(point).total_cmp(&y(self.low)).is_lt() {
            self.low = point;
        }
        if y(point).total_cmp(&y(self.high)).is_ge() {
            self.high = point;
        }
        self.last = point;
    }

    /// The first, lowest, highest and last point, in their order, each once.
    fn corners(&self) -> Vec<Point> {
        let mut kept = vec![self.first, self.low, self.high, self.last];
        kept.sort_by_key(|p| p.0);
        kept.dedup_by_key(|p| p.0);
        kept.into_iter().map(|p| p.1).collect()
    }
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
        let kept = decimated(&time.into(), &values.into(), 500);
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
