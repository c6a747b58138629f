//! What lies inside of a panel's frame: bands, marks and curves.

use lynkeus_table::Series;

use super::axis::Axis;
use super::decimate::{clipped, decimated, stretches};
use super::svg::{
    BEFORE, BLACK, BLUE, GREEN, GREY, Ink, NOTE, ORANGE, PALE, Pixel, Svg, VERMILION, WHITE,
};
use super::{Band, Curve, Kind, Mark, Panel};

pub(super) const BAND: Ink = BLUE.faint(0.18);
pub(super) const OUTSIDE: Ink = VERMILION.faint(0.7);
const GOOD: Ink = GREEN.faint(0.13);

/// Height of a bar at the foot as a share of the panel's.
const FOOT: f64 = 0.03;
/// Height of a cross at the top.
const TOP: f64 = 0.96;
/// A piece of a curve that is smaller than these shares of the panel would be no line.
const WIDTH_OF_DOT: f64 = 1.0 / 800.0;
const HEIGHT_OF_DOT: f64 = 1.0 / 200.0;
/// Half of a bar's height, in pixels.
const BAR: i32 = 6;

/// The colour and width of a curve's line.
pub(super) fn stroke(kind: Kind) -> (Ink, u32) {
    match kind {
        Kind::True => (GREY, 4),
        Kind::Estimated | Kind::Mean => (BLUE, 2),
        Kind::Smoothed => (GREEN, 2),
        Kind::Main | Kind::Bars => (BLUE, 3),
        Kind::Grey => (GREY, 2),
        Kind::Orange => (ORANGE, 2),
        Kind::Measured | Kind::Worst | Kind::Dots => (ORANGE, 1),
        Kind::Pale => (PALE, 1),
    }
}

/// Where a panel's values are on the sheet.
pub(super) struct Frame<'f> {
    pub x: &'f Axis,
    pub y: &'f Axis,
    pub left: i32,
    pub right: i32,
    pub top: i32,
    pub bottom: i32,
}

/// Shares of a frame's width and height.
type Share = (f64, f64);

fn is_inside(share: &Share) -> bool {
    (0.0..=1.0).contains(&share.1)
}

impl Frame<'_> {
    /// The pixel of shares of the frame, the last one that is not beyond.
    pub fn pixel(&self, (x, y): Share) -> Pixel {
        let steps = |pixels: i32, share: f64| (f64::from(pixels) * share + 1e-3).floor() as i32;
        let along = steps(self.right - self.left, x);
        let up = steps(self.bottom - self.top, y);
        (
            self.left.saturating_add(along),
            self.bottom.saturating_sub(up),
        )
    }

    fn pixels(&self, shares: &[Share]) -> Vec<Pixel> {
        shares.iter().map(|share| self.pixel(*share)).collect()
    }

    fn columns(&self) -> usize {
        (self.right - self.left + 1).max(1) as usize
    }

    /// A curve's points, as many as can be seen.
    fn shares(&self, time: &Series, values: &Series) -> Vec<Share> {
        let points = decimated(time, values, self.columns()).into_iter();
        points
            .map(|(t, value)| (self.x.share(t), self.y.share(value)))
            .collect()
    }

    /// Everything in a panel's frame, from the back.
    pub fn draw(&self, svg: &mut Svg, panel: &Panel) {
        for band in &panel.bands {
            self.band(svg, band);
        }
        self.outside(svg, &panel.marks);
        for mark in &panel.marks {
            self.mark(svg, mark);
        }
        let mut curves: Vec<&Curve> = panel.curves.iter().collect();
        curves.sort_by_key(|c| (c.kind == Kind::Main, c.kind != Kind::Pale, c.kind));
        for curve in curves {
            self.curve(svg, curve);
        }
    }

    /// A band, cut where the axis ends.
    fn band(&self, svg: &mut Svg, band: &Band) {
        let low = self.shares(&band.time, &band.low);
        let high = self.shares(&band.time, &band.high);
        for (low, high) in stretches(&low).zip(stretches(&high)) {
            let outline = high.iter().chain(low.iter().rev());
            let outline: Vec<Share> = outline.map(|p| (p.0, p.1.clamp(0.0, 1.0))).collect();
            svg.polygon(&self.pixels(&outline), BAND);
        }
    }

    /// Bars at the foot; those closer than a column of the picture are one.
    fn outside(&self, svg: &mut Svg, marks: &[Mark]) {
        let spans = marks.iter().filter_map(|mark| match mark {
            Mark::Outside(span) => Some((self.x.share(span.start), self.x.share(span.end))),
            _ => None,
        });
        let column = 1.0 / self.columns() as f64;
        for (from, to) in joined(spans, column) {
            let to = to.max(from + 2.0 * column).min(1.0);
            self.rectangle(svg, (from, 0.0), (to, FOOT), OUTSIDE);
        }
    }

    fn rectangle(&self, svg: &mut Svg, a: Share, b: Share, ink: Ink) {
        svg.rectangle(self.pixel(a), self.pixel(b), ink);
    }

    fn mark(&self, svg: &mut Svg, mark: &Mark) {
        let upright = |x: f64| [(x, 0.0), (x, 1.0)].map(|share| self.pixel(share));
        match mark {
            Mark::Outside(_) => {}
            Mark::Good(span) => {
                let (from, to) = (self.x.share(span.start), self.x.share(span.end));
                self.rectangle(svg, (from, 0.0), (to, 1.0), GOOD);
            }
            Mark::Chosen(at, _) => svg.path(&upright(self.x.share(*at)), VERMILION, 2),
            Mark::Present(at, _) => svg.dashes(&upright(self.x.share(*at)), BLACK),
            Mark::Failed(at) => {
                let (x, y) = self.pixel((self.x.share(*at), TOP));
                svg.path(&[(x - 4, y - 4), (x + 4, y + 4)], VERMILION, 2);
                svg.path(&[(x + 4, y - 4), (x - 4, y + 4)], VERMILION, 2);
            }
            Mark::Part(across, upwards) => {
                let [left, right] = [across.start, across.end].map(|x| self.x.share(x));
                let [low, high] = [upwards.start, upwards.end].map(|y| self.y.share(y));
                self.rectangle(svg, (left, low), (right, high), VERMILION.faint(0.6));
                // a thin part stays visible by its edge
                let corners = [(left, low), (right, low), (right, high), (left, high)];
                let edge = [&corners[..], &corners[..1]].concat();
                svg.path(&self.pixels(&edge), VERMILION, 1);
            }
            Mark::Said(row, words) => {
                let (x, y) = self.pixel((0.0, self.y.share(*row as f64)));
                svg.text(words, (x + 8, y), NOTE, BEFORE);
            }
        }
    }

    /// A curve, cut where the axis ends: readings as dots, bars from the left, everything else as lines.
    fn curve(&self, svg: &mut Svg, curve: &Curve) {
        let shares = self.shares(&curve.time, &curve.values);
        let places = shares.iter().copied().filter(is_inside);
        let places = places.map(|share| self.pixel(share));
        match curve.kind {
            Kind::Measured => places.for_each(|at| svg.dot(at, 2, ORANGE.faint(0.75))),
            Kind::Bars => places.for_each(|(x, y)| {
                let end = x.clamp(self.left, self.right);
                svg.rectangle((self.left, y - BAR), (end, y + BAR), BLUE);
            }),
            Kind::Dots => places.for_each(|(x, y)| {
                let at = (x.clamp(self.left, self.right), y);
                svg.dot(at, 6, WHITE);
                svg.dot(at, 5, ORANGE);
            }),
            kind => {
                self.line(svg, &shares, stroke(kind));
                if kind == Kind::Main {
                    places.for_each(|at| svg.dot(at, 3, BLUE));
                }
            }
        }
    }

    fn line(&self, svg: &mut Svg, shares: &[Share], (ink, width): (Ink, u32)) {
        for piece in clipped(shares) {
            match dot(&piece) {
                Some(at) => svg.dot(self.pixel(at), 1 + width / 2, ink),
                None => svg.path(&self.pixels(&piece), ink, width),
            }
        }
    }
}

/// Where a piece of a curve is that is too small for a line.
fn dot(piece: &[Share]) -> Option<Share> {
    let first = *piece.first()?;
    let is_near =
        |p: &Share| (p.0 - first.0).abs() < WIDTH_OF_DOT && (p.1 - first.1).abs() < HEIGHT_OF_DOT;
    piece.iter().all(is_near).then_some(first)
}

/// Spans in their order, with gaps shorter than `gap` closed.
fn joined(spans: impl Iterator<Item = Share>, gap: f64) -> Vec<Share> {
    let mut all: Vec<Share> = vec![];
    for span in spans {
        match all.last_mut() {
            Some(last) if span.0 - last.1 <= gap => last.1 = last.1.max(span.1),
            _ => all.push(span),
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
        let found = joined(spans.into_iter(), 0.1);
        assert_eq!(found, [(0.0, 2.0), (3.0, 3.05)]);
    }
}
