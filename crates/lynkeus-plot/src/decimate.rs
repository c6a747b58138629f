//! Long curves reduced to what a screen can show, and cut at the frame.

use lynkeus_table::Series;

/// A point on a picture's plane.
type Point = (f64, f64);

/// Points of a curve, at most four for each of `columns` equal spans of time: the first, the
/// lowest, the highest and the last, in their order. A curve with few points stays as it is.
/// A value that is not finite breaks the line: one is kept for each column without values, and
/// between columns where a gap reaches from one to the next. A gap within a column is too narrow
/// to be seen, but for an infinite value, which lifts the pen wherever it stands: an angle that begins a new turn.
pub(super) fn decimated(time: &Series, values: &Series, columns: usize) -> Vec<Point> {
    let points = time.iter().zip(values);
    let count = time.len().min(values.len());
    let (first, last) = (time.get(0), count.checked_sub(1).and_then(|i| time.get(i)));
    let (Some(first), Some(last)) = (first, last) else {
        return vec![];
    };
    let width = (last - first) / columns as f64;
    if count <= 4 * columns || width.is_nan() || width <= 0.0 {
        return points.collect();
    }
    let column = |p: Point| ((p.0 - first) / width).floor();
    let (mut kept, mut near): (Vec<Point>, Vec<Point>) = (vec![], vec![]);
    let mut is_after_gap = false;
    let lifts = values.iter().filter(|y| *y == f64::INFINITY).count();
    for point in points {
        if point.1 == f64::INFINITY && lifts <= columns {
            keep(&mut kept, &near, is_after_gap);
            near.clear();
            kept.push((point.0, f64::NAN));
            is_after_gap = false;
            continue;
        }
        if near
            .last()
            .is_some_and(|last| column(*last) != column(point))
        {
            is_after_gap = keep(&mut kept, &near, is_after_gap);
            near.clear();
        }
        near.push(point);
    }
    keep(&mut kept, &near, is_after_gap);
    kept
}

/// Adds what is drawn of the points of a column. Whether it ends in a gap.
fn keep(kept: &mut Vec<Point>, near: &[Point], is_after_gap: bool) -> bool {
    let (Some(first), Some(last)) = (near.first(), near.last()) else {
        return is_after_gap;
    };
    let corners = corners(near);
    if is_after_gap && is_gap(*first) || corners.is_empty() {
        kept.push((first.0, f64::NAN));
    }
    kept.extend(corners);
    is_gap(*last)
}

fn is_gap(point: Point) -> bool {
    !point.0.is_finite() || !point.1.is_finite()
}

/// The first, the lowest, the highest and the last of the finite points, in their order, each once.
fn corners(points: &[Point]) -> Vec<Point> {
    let finite = || points.iter().enumerate().filter(|(_, p)| !is_gap(**p));
    let low = finite().min_by(|a, b| a.1.1.total_cmp(&b.1.1));
    let high = finite().max_by(|a, b| a.1.1.total_cmp(&b.1.1));
    let all = [finite().next(), low, high, finite().next_back()];
    let mut all: Vec<(usize, &Point)> = all.into_iter().flatten().collect();
    all.sort_by_key(|p| p.0);
    all.dedup_by_key(|p| p.0);
    all.into_iter().map(|p| *p.1).collect()
}

/// The stretches of a curve between gaps.
pub(super) fn stretches(points: &[Point]) -> impl Iterator<Item = &[Point]> {
    let all = points.split(|p| is_gap(*p));
    all.filter(|stretch| !stretch.is_empty())
}

/// The pieces of a line between heights 0 and 1: a line that leaves them ends at the edge. A point without neighbours is a
/// piece of its own.
pub(super) fn clipped(points: &[Point]) -> Vec<Vec<Point>> {
    let mut pieces: Vec<Vec<Point>> = Vec::new();
    for stretch in stretches(points) {
        match stretch {
            [alone] => pieces.extend((0.0..=1.0).contains(&alone.1).then(|| vec![*alone])),
            _ => cut(stretch, &mut pieces),
        }
    }
    pieces
}

/// Adds the pieces of a line without gaps.
fn cut(points: &[Point], pieces: &mut Vec<Vec<Point>>) {
    let mut joined = false;
    for pair in points.windows(2) {
        let &[a, b] = pair else { continue };
        let Some((from, to)) = segment(a, b) else {
            joined = false;
            continue;
        };
        match pieces.last_mut() {
            Some(piece) if joined && from == a => piece.push(to),
            _ => pieces.push(vec![from, to]),
        }
        joined = to == b;
    }
}

/// The part of a segment between heights 0 and 1.
fn segment(a: Point, b: Point) -> Option<(Point, Point)> {
    if a.1.max(b.1) < 0.0 || a.1.min(b.1) > 1.0 {
        return None;
    }
    let moved = |p: Point, q: Point| {
        let edge = p.1.clamp(0.0, 1.0);
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
            (0.0, 0.5),
            (1.0, 1.5),
            (2.0, 0.5),
            (3.0, f64::NAN),
            (4.0, 0.5),
            (5.0, 1.0),
        ];
        let pieces = clipped(&points);
        assert_eq!(
            pieces,
            [
                vec![(0.0, 0.5), (0.5, 1.0)],
                vec![(1.5, 1.0), (2.0, 0.5)],
                vec![(4.0, 0.5), (5.0, 1.0)]
            ]
        );
    }

    /// A sensor that reports in every other row of a long log.
    #[test]
    fn gaps_do_not_make_a_picture_large() {
        let n = 100_000;
        let time = Series::from((0..n).map(f64::from).collect::<Vec<_>>());
        let reported = |is: &dyn Fn(i32) -> bool| {
            let value = |row: i32| {
                if is(row) {
                    f64::from(row % 7)
                } else {
                    f64::NAN
                }
            };
            decimated(&time, &(0..n).map(value).collect::<Vec<_>>().into(), 500)
        };
        let every_other = reported(&|row| row % 2 == 0);
        assert!(every_other.len() <= 2000, "{}", every_other.len());
        assert_eq!(stretches(&every_other).count(), 1);
        // a column has 200 rows; the second gap reaches from the middle of one to that of the next
        let twice = reported(&|row| !(5000..6000).contains(&row) && !(9900..10_100).contains(&row));
        let found = stretches(&twice).map(|s| (s[0].0, s[s.len() - 1].0));
        let expected = [(0.0, 4999.0), (6000.0, 9899.0), (10_100.0, 99_999.0)];
        assert!(found.eq(expected));
        // what is far apart stays where it was
        let sparse = reported(&|row| row % 2500 == 1300);
        let alone: Vec<f64> = stretches(&sparse).map(|s| s[0].0).collect();
        assert!(
            alone
                .iter()
                .copied()
                .eq((0..40).map(|k| f64::from(k * 2500 + 1300)))
        );
    }

    #[test]
    fn a_point_without_neighbours_is_a_piece() {
        let nan = f64::NAN;
        let points = [(0.0, nan), (1.0, 0.5), (2.0, nan), (3.0, 5.0), (4.0, nan)];
        assert_eq!(clipped(&points), [vec![(1.0, 0.5)]]);
    }

    #[test]
    fn a_line_across_the_frame_keeps_both_edges() {
        let pieces = clipped(&[(0.0, -0.5), (1.0, 1.5)]);
        assert_eq!(pieces, [vec![(0.25, 0.0), (0.75, 1.0)]]);
    }
}
