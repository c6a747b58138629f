//! Bars on a logarithmic axis, over a chart.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::axis::Axis;
use super::chart::Chart;
use super::grid;
use super::limits::extremes;
use super::render::{tick, titled};
use super::style::{Area, BLUE, Drawn, FAINT, FONT, FRAME, INK, ORANGE, VERMILION, WIDTH};
use lynkeus_answer::Error;

const HEAD: u32 = 76;
const ROW: u32 = 19;
const TICKS: u32 = 30;
const RIGHT: u32 = 24;
const LEAST_LEFT: u32 = 66;
const MOST_LEFT: u32 = 260;

/// The depth of the axis, as a ratio of its greatest value to its least.
const DEEP: f64 = 1e6;

/// A bar for each of several quantities, and a chart under them.
#[derive(Clone, Debug, Default)]
pub struct Bars {
    /// What the bars show.
    pub caption: String,
    /// The bars' words in the legend.
    pub bars_name: String,
    /// The dots' words; empty where there are none.
    pub dots_name: String,
    /// What stands beside a bar without end.
    pub unseen: String,
    /// From the top.
    pub bars: Vec<Bar>,
    /// Under the bars; its title is that of the picture, its first plot is drawn.
    pub below: Chart,
}

/// One bar.
#[derive(Clone, Debug, Default)]
pub struct Bar {
    /// What it belongs to.
    pub name: String,
    /// Its end; infinite where there is none.
    pub value: f64,
    /// A dot on its line.
    pub dot: Option<f64>,
}

impl Bars {
    /// The picture as SVG text.
    ///
    /// # Errors
    /// There is nothing finite to draw.
    pub fn to_svg(&self) -> Result<String, Error> {
        let Some(axis) = self.axis() else {
            return Err(Error::refused("nothing to draw: no finite values"));
        };
        let mut text = String::new();
        self.draw(&axis, &mut text)
            .map_err(|e| Error::input(format!("cannot draw: {e}")))?;
        Ok(titled(text, &self.below.title))
    }

    fn axis(&self) -> Option<Axis> {
        let values = self.bars.iter().flat_map(|b| [Some(b.value), b.dot]);
        let ends = extremes(values.flatten().filter(|v| *v > 0.0 && v.is_finite()))?;
        let low = ends.start.max(ends.end / DEEP).min(ends.end / 10.0);
        Some(Axis {
            is_log: true,
            ends: low / 2.0..ends.end * 1.5,
        })
    }

    fn draw(&self, axis: &Axis, text: &mut String) -> Drawn {
        let rows = u32::try_from(self.bars.len()).unwrap_or(u32::MAX);
        let top = HEAD + rows.saturating_mul(ROW) + TICKS;
        let below = grid::foot_panel(&self.below);
        let height = top + below.as_ref().map_or(0, |panel| panel.height());
        let root = SVGBackend::with_string(text, (WIDTH, height)).into_drawing_area();
        root.fill(&WHITE)?;
        self.head(&root)?;
        self.frame(&root, axis)?;
        for (row, bar) in self.bars.iter().enumerate() {
            self.bar(&root, axis, row, bar)?;
        }
        if let Some(panel) = below {
            let area = root.clone().shrink((0, top), (WIDTH, panel.height()));
            panel.draw(&area)?;
        }
        root.present()
    }

    /// Room for the names.
    fn left(&self) -> i32 {
        let longest = self.bars.iter().map(|b| b.name.chars().count()).max();
        let wide = 16 + 8 * longest.unwrap_or(0) as u32;
        wide.clamp(LEAST_LEFT, MOST_LEFT) as i32
    }

    /// Pixel of a value, inside the frame.
    fn across(&self, axis: &Axis, value: f64) -> i32 {
        let range = axis.range();
        let place = axis.place(value).unwrap_or(range.start);
        let share = (place - range.start) / (range.end - range.start);
        let wide = (WIDTH - RIGHT) as i32 - self.left();
        self.left() + (share.clamp(0.0, 1.0) * f64::from(wide)).round() as i32
    }

    fn head(&self, root: &Area<'_>) -> Drawn {
        let left = self.left();
        let title = (FONT, 18).into_font().style(FontStyle::Bold).color(&INK);
        root.draw(&Text::new(self.below.title.clone(), (left, 12), title))?;
        let words = (FONT, 14).into_font().color(&INK);
        let words = words.pos(Pos::new(HPos::Left, VPos::Center));
        let corner = (left, HEAD as i32 - 12);
        root.draw(&Text::new(self.caption.clone(), corner, words.clone()))?;
        let y = 42;
        root.draw(&Rectangle::new(
            [(left, y - 5), (left + 26, y + 5)],
            BLUE.filled(),
        ))?;
        root.draw(&Text::new(
            self.bars_name.clone(),
            (left + 32, y),
            words.clone(),
        ))?;
        if self.dots_name.is_empty() {
            return Ok(());
        }
        let next = left + 32 + 8 * self.bars_name.chars().count() as i32 + 24;
        root.draw(&Circle::new((next, y), 5, ORANGE.filled()))?;
        root.draw(&Text::new(self.dots_name.clone(), (next + 12, y), words))
    }

    fn frame(&self, root: &Area<'_>, axis: &Axis) -> Drawn {
        let (top, bottom) = (
            HEAD as i32,
            HEAD as i32 + self.bars.len() as i32 * ROW as i32,
        );
        let style = (FONT, 13).into_font().color(&INK);
        let style = style.pos(Pos::new(HPos::Center, VPos::Top));
        for value in axis.ticks() {
            let x = self.across(axis, value);
            root.draw(&PathElement::new([(x, top), (x, bottom)], FAINT))?;
            root.draw(&Text::new(tick(&value), (x, bottom + 6), style.clone()))?;
        }
        let corners = [(self.left(), top), ((WIDTH - RIGHT) as i32, bottom)];
        root.draw(&Rectangle::new(corners, FRAME))
    }

    fn bar(&self, root: &Area<'_>, axis: &Axis, row: usize, bar: &Bar) -> Drawn {
        let left = self.left();
        let y = HEAD as i32 + (row as i32 * ROW as i32) + ROW as i32 / 2;
        let name = (FONT, 13).into_font().color(&INK);
        let name = name.pos(Pos::new(HPos::Right, VPos::Center));
        root.draw(&Text::new(bar.name.clone(), (left - 8, y), name))?;
        if bar.value.is_finite() {
            let end = self.across(axis, bar.value);
            root.draw(&Rectangle::new(
                [(left, y - 6), (end, y + 6)],
                BLUE.filled(),
            ))?;
        } else {
            let words = (FONT, 13).into_font().color(&VERMILION);
            let words = words.pos(Pos::new(HPos::Left, VPos::Center));
            root.draw(&Text::new(self.unseen.clone(), (left + 8, y), words))?;
        }
        match bar.dot.filter(|dot| dot.is_finite()) {
            Some(dot) => {
                let at = (self.across(axis, dot), y);
                root.draw(&Circle::new(at, 5, ORANGE.filled()))?;
                root.draw(&Circle::new(at, 5, WHITE.stroke_width(1)))
            }
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_have_their_names_and_the_unseen_say_so() {
        let bar = |name: &str, value: f64, dot: Option<f64>| Bar {
            name: name.to_owned(),
            value,
            dot,
        };
        let mut picture = Bars {
            unseen: "not seen".to_owned(),
            bars: vec![bar("a<b", f64::INFINITY, None), bar("c", 0.1, Some(0.01))],
            ..Bars::default()
        };
        let svg = picture.to_svg().unwrap();
        for word in ["a&lt;b", "not seen", ">c<"] {
            assert!(
                svg.contains(word) || svg.contains(word.trim_matches(['<', '>'])),
                "{word}"
            );
        }
        assert!(!svg.contains("NaN"));
        picture.bars.truncate(1);
        assert!(picture.to_svg().is_err());
    }
}
