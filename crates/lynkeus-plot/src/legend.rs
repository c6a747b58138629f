//! The legend of panels that share an axis.

use super::marks::{BAND, OUTSIDE, stroke};
use super::svg::{BEFORE, BLACK, BLUE, ORANGE, Svg, VERMILION, WORDS, fitted, width};
use super::{Kind, Mark, Panel};

/// A line or a patch in the legend, what is left free after it, and both with what is left free before it.
const SAMPLE: i32 = 28;
const AFTER: i32 = 4;
const BESIDE: i32 = SAMPLE + AFTER + 20;
/// An entry has as much room.
const LEAST: i32 = 100;

/// What occurs in panels, in the order of the legend, with its words.
pub(super) struct Legend(Vec<(Sample, String)>);

/// What an entry shows beside its words.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Sample {
    Curve(Kind),
    Band,
    Outside,
    Chosen,
    Present,
}

impl Legend {
    pub fn of(panels: &[&Panel]) -> Self {
        let mut curves: Vec<_> = panels.iter().flat_map(|p| &p.curves).collect();
        curves.sort_by_key(|c| c.kind);
        let curves = curves.into_iter();
        let curves = curves.map(|c| (Sample::Curve(c.kind), c.label()));
        let bands = panels.iter().flat_map(|p| &p.bands);
        let bands = bands.map(|b| (Sample::Band, b.extent.label()));
        let marks = panels.iter().flat_map(|p| &p.marks);
        let marks = marks.filter_map(|mark| match mark {
            Mark::Outside(_) => Some((Sample::Outside, "outside its range")),
            Mark::Chosen(_, words) => Some((Sample::Chosen, words)),
            Mark::Present(_, words) => Some((Sample::Present, words)),
            _ => None,
        });
        let mut entries = vec![];
        for (sample, words) in curves.chain(bands).chain(marks) {
            let entry = (sample, words.to_owned());
            if !words.is_empty() && !entries.contains(&entry) {
                entries.push(entry);
            }
        }
        Self(entries)
    }

    /// Pixels from the first sample to the last word, with a gap before.
    pub fn width(&self) -> i32 {
        let entries = self.0.iter();
        entries.map(|(_, words)| BESIDE + width(words, WORDS)).sum()
    }

    /// Draws the entries up to the right edge. Where they have no room each has the same; where there are very many, the last
    /// are left out.
    pub fn draw(&self, svg: &mut Svg, (left, mut right): (i32, i32), y: i32) {
        let room = right - left;
        let shown = self.0.len().min((room / LEAST) as usize);
        let most = match self.width() <= room {
            true => room,
            false => room / shown.max(1) as i32 - BESIDE,
        };
        for (sample, words) in self.0.iter().take(shown).rev() {
            let words = fitted(words, WORDS, most);
            right -= width(&words, WORDS);
            // beside its sample, however broad its letters are
            svg.text(&words, (right, y), WORDS, BEFORE);
            sample.draw(svg, (right - AFTER - SAMPLE, right - AFTER), y);
            right -= BESIDE;
        }
    }
}

impl Sample {
    /// A short piece of what the entry stands for.
    fn draw(self, svg: &mut Svg, (from, to): (i32, i32), y: i32) {
        let line = [(from, y), (to, y)];
        match self {
            Self::Curve(Kind::Measured) => {
                let places = [6, 14, 22].into_iter();
                places.for_each(|x| svg.dot((from + x, y), 2, ORANGE));
            }
            Self::Curve(Kind::Dots) => svg.dot((from + SAMPLE / 2, y), 5, ORANGE),
            Self::Curve(Kind::Bars) => svg.rectangle((from, y - 5), (to, y + 5), BLUE),
            Self::Curve(kind) => {
                let (ink, width) = stroke(kind);
                svg.path(&line, ink, width);
            }
            Self::Band => svg.rectangle((from, y - 6), (to, y + 6), BAND),
            Self::Outside => svg.rectangle((from, y - 2), (to, y + 2), OUTSIDE),
            Self::Chosen => svg.path(&line, VERMILION, 2),
            Self::Present => svg.dashes(&line, BLACK),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Curve;

    fn drawn(panel: &Panel, right: i32) -> String {
        let mut svg = Svg::default();
        Legend::of(&[panel]).draw(&mut svg, (0, right), 50);
        svg.sheet((right, 100), "")
    }

    #[test]
    fn what_occurs_twice_is_named_once_and_by_its_own_words() {
        let curve = |kind, name: &str| Curve::through(kind, []).named(name);
        let panel = Panel {
            curves: vec![
                curve(Kind::Pale, "others"),
                curve(Kind::Estimated, ""),
                curve(Kind::Pale, "others"),
                curve(Kind::Main, "x1"),
                curve(Kind::Grey, ""),
            ],
            ..Panel::default()
        };
        let words: Vec<_> = Legend::of(&[&panel]).0;
        let words: Vec<_> = words.iter().map(|(_, words)| words.as_str()).collect();
        assert_eq!(words, ["estimated", "x1", "others"]);
    }

    #[test]
    fn words_are_cut_where_a_legend_has_no_room() {
        let name = "measuring everything that there is to be measured here";
        let curves = [name, "x1"].map(|name| Curve::through(Kind::Bars, []).named(name));
        let panel = Panel {
            curves: curves.to_vec(),
            ..Panel::default()
        };
        assert!(drawn(&panel, 800).contains(name));
        let short = drawn(&panel, 300);
        assert!(!short.contains(name) && short.contains('…') && short.contains("x1"));
        assert!(!short.contains("x=\"-"));
    }
}
