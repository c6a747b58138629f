//! SVG text, element by element.

use lynkeus_answer::visible;

/// A colour with its opacity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ink(&'static str, f64);

pub(super) const WHITE: Ink = Ink("#FFFFFF", 1.0);
pub(super) const BLACK: Ink = Ink("#262626", 1.0);
pub(super) const FAINT: Ink = Ink("#E2E2E2", 1.0);
pub(super) const FRAME: Ink = Ink("#969696", 1.0);
pub(super) const GREY: Ink = Ink("#8C8C8C", 1.0);
pub(super) const BLUE: Ink = Ink("#0072B2", 1.0);
pub(super) const PALE: Ink = Ink("#B0CDE2", 1.0);
pub(super) const GREEN: Ink = Ink("#009E73", 1.0);
pub(super) const ORANGE: Ink = Ink("#E69F00", 1.0);
pub(super) const VERMILION: Ink = Ink("#D55E00", 1.0);

impl Ink {
    pub const fn faint(self, opacity: f64) -> Self {
        Self(self.0, opacity)
    }

    fn stroke(self) -> String {
        format!("opacity=\"{}\" stroke=\"{}\"", self.1, self.0)
    }

    fn fill(self) -> String {
        format!("opacity=\"{}\" fill=\"{}\"", self.1, self.0)
    }
}

/// How words are written: their size, of which a letter takes half in width, colour, and more.
#[derive(Clone, Copy, Debug)]
pub(super) struct Font(u32, Ink, &'static str);

pub(super) const TITLE: Font = Font(18, BLACK, " font-weight=\"bold\"");
pub(super) const WORDS: Font = Font(14, BLACK, "");
pub(super) const NUMBERS: Font = Font(13, BLACK, "");
pub(super) const NOTE: Font = Font(13, VERMILION, "");

/// Where a place is beside words: which end of them, and how far below it their line is.
pub(super) type Anchor = (&'static str, &'static str);

pub(super) const BEFORE: Anchor = ("start", "0.5ex");
pub(super) const AFTER: Anchor = ("end", "0.5ex");
pub(super) const ABOVE: Anchor = ("middle", "0.76em");
pub(super) const BELOW: Anchor = ("middle", "-0.5ex");
pub(super) const TOP_LEFT: Anchor = ("start", "0.76em");
pub(super) const BOTTOM_LEFT: Anchor = ("start", "-0.5ex");
pub(super) const BOTTOM_RIGHT: Anchor = ("end", "-0.5ex");

pub(super) type Pixel = (i32, i32);

/// A picture under way.
#[derive(Default)]
pub(super) struct Svg(String);

impl Svg {
    /// What is drawn, on a white sheet. Its title is for screen readers and hovering, its metadata say what drew it.
    pub fn sheet(self, (width, height): Pixel, title: &str) -> String {
        let title = safe(title);
        let mut sheet = Self(format!(
            "<svg width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" xmlns=\"http://www.w3.org/2000/svg\">\n<title>{title}</title>\n<metadata>lynkeus {}</metadata>\n",
            env!("CARGO_PKG_VERSION")
        ));
        sheet.rectangle((0, 0), (width, height), WHITE);
        sheet.0 + &self.0 + "</svg>\n"
    }

    pub fn text(&mut self, words: &str, (x, y): Pixel, font: Font, (anchor, dy): Anchor) {
        let (words, fill, more) = (safe(words), font.1.fill(), font.2);
        let size = f64::from(font.0) / 1.24;
        self.0 += &format!(
            "<text x=\"{x}\" y=\"{y}\" dy=\"{dy}\" text-anchor=\"{anchor}\" font-family=\"sans-serif\" font-size=\"{size}\" {fill}{more}>\n{words}\n</text>\n"
        );
    }

    /// A line of the grid.
    pub fn line(&mut self, (x1, y1): Pixel, (x2, y2): Pixel, ink: Ink) {
        let stroke = ink.stroke();
        self.0 += &format!(
            "<line {stroke} stroke-width=\"1\" x1=\"{x1}\" y1=\"{y1}\" x2=\"{x2}\" y2=\"{y2}\"/>\n"
        );
    }

    pub fn path(&mut self, points: &[Pixel], ink: Ink, width: u32) {
        let (stroke, points) = (ink.stroke(), list(points));
        self.0 += &format!(
            "<polyline fill=\"none\" {stroke} stroke-width=\"{width}\" points=\"{points}\"/>\n"
        );
    }

    pub fn dashes(&mut self, points: &[Pixel], ink: Ink) {
        let (stroke, points) = (ink.stroke(), list(points));
        self.0 += &format!(
            "<polyline fill=\"none\" {stroke} stroke-dasharray=\"5 5\" points=\"{points}\"/>\n"
        );
    }

    pub fn polygon(&mut self, points: &[Pixel], ink: Ink) {
        self.0 += &format!("<polygon {} points=\"{}\"/>\n", ink.fill(), list(points));
    }

    /// A rectangle without an edge, between two corners.
    pub fn rectangle(&mut self, a: Pixel, b: Pixel, ink: Ink) {
        let (x, y) = (a.0.min(b.0), a.1.min(b.1));
        let (width, height, fill) = (a.0.abs_diff(b.0), a.1.abs_diff(b.1), ink.fill());
        self.0 += &format!(
            "<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" {fill} stroke=\"none\"/>\n"
        );
    }

    pub fn dot(&mut self, (x, y): Pixel, radius: u32, ink: Ink) {
        let fill = ink.fill();
        self.0 += &format!(
            "<circle cx=\"{x}\" cy=\"{y}\" r=\"{radius}\" {fill} stroke=\"none\" stroke-width=\"1\"/>\n"
        );
    }
}

fn list(points: &[Pixel]) -> String {
    points.iter().map(|(x, y)| format!("{x},{y} ")).collect()
}

/// Words in which what no XML may have, and what a terminal obeys, is spelled out.
fn safe(words: &str) -> String {
    let words = visible::line(words).replace('&', "&amp;");
    let words = words.replace('<', "&lt;").replace('>', "&gt;");
    let words = words.replace('"', "&quot;").replace('\'', "&apos;");
    // the two that are no control characters
    words.replace(['\u{fffe}', '\u{ffff}'], "\u{fffd}")
}

/// Pixels that words take at most in the fonts that viewers have for sans-serif.
pub(super) fn width(words: &str, font: Font) -> i32 {
    words.chars().count() as i32 * font.0 as i32 / 2
}

/// The words, or as many of their letters as have room in so many pixels.
pub(super) fn fitted(words: &str, font: Font, room: i32) -> String {
    if width(words, font) <= room {
        return words.to_owned();
    }
    // a letter takes half of its size, and the dots one or two
    let size = font.0 as i32;
    let letters = 2 * (room - size).max(0) / size;
    let kept: String = words.chars().take(letters as usize).collect();
    format!("{}…", kept.trim_end())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_no_room_is_cut_short() {
        let fitted = |words, room| fitted(words, WORDS, room);
        assert_eq!(fitted("level of the tank", 119), "level of the tank");
        assert_eq!(fitted("level of the tank", 118), "level of the t…");
        assert_eq!(fitted("level", 7), "…");
    }
}
