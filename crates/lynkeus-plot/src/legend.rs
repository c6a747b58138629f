//! Title and legend of a figure.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::band::{band_style, mark_style};
use super::style::{Area, Drawn, FONT, INK, LEFT, ORANGE, RIGHT, WIDTH, stroke};
use super::{Extent, Figure, Kind};

/// Sizes of the fonts.
const TITLE: u32 = 18;
const WORDS: u32 = 14;
/// A line or a patch in the legend, and what is left free after an entry.
const SAMPLE: i32 = 28;
const GAP: i32 = 20;

/// Pixels that a text takes at most in the fonts that viewers have for sans-serif.
pub(super) fn width(text: &str, size: u32) -> i32 {
    text.chars().count() as i32 * size as i32 / 2
}

/// The text, or as much of it as has room in so many pixels.
pub(super) fn fitted(text: &str, size: u32, room: i32) -> String {
    if width(text, size) <= room {
        return text.to_owned();
    }
    // a letter takes half of its size, and the dots one or two
    let letters = 2 * (room - size as i32).max(0) / size as i32;
    let kept: String = text.chars().take(letters as usize).collect();
    format!("{}…", kept.trim_end())
}

/// An entry of the legend.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Entry {
    Curve(Kind),
    /// two standard deviations to either side
    Band(Extent),
    /// an estimate outside of its declared range
    Outside,
}

impl Entry {
    fn label(self) -> &'static str {
        match self {
            Self::Curve(kind) => kind.label(),
            Self::Band(extent) => extent.label(),
            Self::Outside => "outside its range",
        }
    }
}

/// What occurs in a figure, in the order of the legend.
pub(super) fn entries(figure: &Figure) -> Vec<Entry> {
    let mut found: Vec<Entry> = figure.kinds().into_iter().map(Entry::Curve).collect();
    for band in figure.panels.iter().flat_map(|p| &p.bands) {
        let entry = Entry::Band(band.extent);
        if !found.contains(&entry) {
            found.push(entry);
        }
    }
    if figure.panels.iter().any(|p| !p.outside.is_empty()) {
        found.push(Entry::Outside);
    }
    found
}

/// Whether the legend has room beside the title.
fn fits(title: &str, entries: &[Entry]) -> bool {
    let entry = |e: &Entry| width(e.label(), WORDS) + 4 + SAMPLE + GAP;
    let legend: i32 = entries.iter().map(entry).sum();
    width(title, TITLE) + legend <= (WIDTH - LEFT - RIGHT) as i32
}

/// The title on the left, the legend on the right, under the title where it does not fit.
pub(super) fn head(root: &Area<'_>, figure: &Figure) -> Drawn {
    let entries = entries(figure);
    let (title_at, legend_at) = match fits(&figure.title, &entries) {
        true => (16, 26),
        false => (8, 38),
    };
    let title = (FONT, TITLE).into_font().style(FontStyle::Bold).color(&INK);
    let words = fitted(&figure.title, TITLE, (WIDTH - LEFT - RIGHT) as i32);
    root.draw(&Text::new(words, (LEFT as i32, title_at), title))?;
    let mut right = (WIDTH - RIGHT) as i32;
    for entry in entries.into_iter().rev() {
        // beside its sample, however broad its letters are
        let words = (FONT, WORDS)
            .into_font()
            .color(&INK)
            .pos(Pos::new(HPos::Left, VPos::Center));
        right -= width(entry.label(), WORDS);
        root.draw(&Text::new(entry.label(), (right, legend_at), words))?;
        right -= 4;
        sample(root, entry, right - SAMPLE, legend_at)?;
        right -= SAMPLE + GAP;
    }
    Ok(())
}

/// A short piece of what the entry stands for.
fn sample(root: &Area<'_>, entry: Entry, from: i32, y: i32) -> Drawn {
    let to = from + SAMPLE;
    match entry {
        Entry::Curve(Kind::Measured) => {
            for x in [from + 6, from + 14, from + 22] {
                root.draw(&Circle::new((x, y), 2, ORANGE.filled()))?;
            }
            Ok(())
        }
        Entry::Curve(kind) => root.draw(&PathElement::new([(from, y), (to, y)], stroke(kind))),
        Entry::Band(_) => root.draw(&Rectangle::new([(from, y - 6), (to, y + 6)], band_style())),
        Entry::Outside => root.draw(&Rectangle::new([(from, y - 2), (to, y + 2)], mark_style())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_no_room_is_cut_short() {
        assert_eq!(fitted("level of the tank", 14, 119), "level of the tank");
        assert_eq!(fitted("level of the tank", 14, 118), "level of the t…");
        assert_eq!(fitted("level", 14, 7), "…");
    }

    /// "GermaniManes: drift-observable observer" is some 330 pixels, four entries are 470, of 812.
    #[test]
    fn a_legend_never_lies_on_the_title() {
        let entries = [
            Entry::Curve(Kind::True),
            Entry::Curve(Kind::Measured),
            Entry::Curve(Kind::Estimated),
            Entry::Outside,
        ];
        assert!(!fits("GermaniManes: drift-observable observer", &entries));
        assert!(fits(
            "GermaniManes: drift-observable observer",
            &entries[..3]
        ));
        assert!(fits("Ltaief: state-affine observer", &entries));
    }
}
