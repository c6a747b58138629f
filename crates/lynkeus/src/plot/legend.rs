//! Title and legend of a figure.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::band::{band_style, mark_style};
use super::render::{Area, Drawn, FONT, INK, LEFT, ORANGE, RIGHT, WIDTH, stroke};
use super::{Extent, Figure, Kind};

/// More entries than this take a line of their own.
const BESIDE_TITLE: usize = 4;

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

/// The title on the left, the legend on the right, under the title where it is long.
pub(super) fn head(root: &Area<'_>, figure: &Figure) -> Drawn {
    let entries = entries(figure);
    let is_long = entries.len() > BESIDE_TITLE;
    let (title_at, legend_at) = if is_long { (8, 38) } else { (16, 26) };
    let title = (FONT, 18).into_font().style(FontStyle::Bold).color(&INK);
    root.draw(&Text::new(
        figure.title.clone(),
        (LEFT as i32, title_at),
        title,
    ))?;
    let mut right = (WIDTH - RIGHT) as i32;
    for entry in entries.into_iter().rev() {
        let words = (FONT, 14)
            .into_font()
            .color(&INK)
            .pos(Pos::new(HPos::Right, VPos::Center));
        root.draw(&Text::new(entry.label(), (right, legend_at), words))?;
        right -= 8 * entry.label().chars().count() as i32 + 4;
        sample(root, entry, right - 28, legend_at)?;
        right -= 28 + 20;
    }
    Ok(())
}

/// A short piece of what the entry stands for.
fn sample(root: &Area<'_>, entry: Entry, from: i32, y: i32) -> Drawn {
    let to = from + 28;
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
