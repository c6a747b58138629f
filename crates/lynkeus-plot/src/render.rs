//! The sheet: where panels, their axes, captions and legends stand.

use lynkeus_answer::Error;
use lynkeus_expr::real::rounded;

use super::axis::{Axis, number};
use super::legend::Legend;
use super::marks::Frame;
use super::svg::{
    ABOVE, AFTER, BELOW, BOTTOM_LEFT, BOTTOM_RIGHT, FAINT, FRAME, NOTE, NUMBERS, Svg, TITLE,
    TOP_LEFT, WORDS, fitted, width,
};
use super::{Figure, Kind, Mark, Panel, Scale};

const WIDTH: i32 = 900;
/// Where panels begin and end, and what they have between.
const EDGES: (i32, i32) = (78, 878);
const ROOM: i32 = EDGES.1 - EDGES.0;
/// Title and first legend.
const HEAD: i32 = 52;
/// A legend between panels.
const LEGEND: i32 = 34;
const CAPTION: i32 = 24;
/// Numbers under an axis, and under them its label.
const NUMBERED: i32 = 26;
const LABEL: i32 = 24;
const TICK: i32 = 5;
/// What names of rows, and numbers, take at most on the left, and what is free beside them.
const NAMES: i32 = 244;
const BESIDE: i32 = 16;

/// The whole figure as SVG text.
pub(super) fn svg(figure: &Figure) -> Result<String, Error> {
    let mut shown = vec![];
    for panel in &figure.panels {
        panel.upwards.check(&panel.caption)?;
        let axis = panel.axis();
        shown.extend(axis.map(|(y, beyond)| Shown { panel, y, beyond }));
    }
    if shown.is_empty() {
        return Err(nothing(&figure.across));
    }
    let mut sheet = Sheet::default();
    for group in shown.chunk_by(|a, b| a.panel.across.is_none() && b.panel.across.is_none()) {
        sheet.group(figure, group)?;
    }
    Ok(sheet.svg.sheet((WIDTH, sheet.bottom), &figure.title))
}

fn nothing(scale: &Scale) -> Error {
    Error::refused(match scale {
        Scale::Whole => "nothing to draw: expected finite values at two times at least",
        _ => "nothing to draw: no finite values",
    })
}

/// The axis across that panels share.
fn across(scale: &Scale, name: &str, panels: &[&Panel]) -> Result<Axis, Error> {
    scale.check(name)?;
    let curves = || panels.iter().flat_map(|p| &p.curves);
    let failed = || {
        let marks = panels.iter().flat_map(|p| &p.marks);
        marks.filter_map(|mark| match mark {
            Mark::Failed(at) => Some(*at),
            _ => None,
        })
    };
    let values = || curves().flat_map(|c| &c.time).chain(failed());
    scale.axis(values, None).ok_or_else(|| nothing(scale))
}

/// A panel that has something to show.
struct Shown<'f> {
    panel: &'f Panel,
    y: Axis,
    /// the extreme value of an estimate, where the axis is cut
    beyond: Option<f64>,
}

/// The picture as far as it is drawn.
#[derive(Default)]
struct Sheet {
    svg: Svg,
    bottom: i32,
}

impl Sheet {
    /// Draws panels that share their axis across, with a legend above and the axis' label below.
    fn group(&mut self, figure: &Figure, group: &[Shown<'_>]) -> Result<(), Error> {
        let panels: Vec<&Panel> = group.iter().map(|shown| shown.panel).collect();
        let own = panels
            .iter()
            .find_map(|p| Some((p.across.as_ref()?, &p.caption)));
        let (scale, name) = own.unwrap_or((&figure.across, &figure.label));
        let x = across(scale, name, &panels)?;
        self.head(&figure.title, &Legend::of(&panels));
        let count = figure.panels.len();
        let ticks = |shown: &Shown<'_>| upwards(&shown.y, height(shown.panel, count));
        let numbers = group.iter().flat_map(ticks);
        let widest = numbers.map(|(_, words)| width(&words, NUMBERS)).max();
        let left = EDGES.0.max(widest.unwrap_or(0).min(NAMES) + BESIDE);
        for (i, shown) in group.iter().enumerate() {
            let top = self.bottom + CAPTION;
            self.bottom = top + height(shown.panel, count);
            let frame = Frame {
                x: &x,
                y: &shown.y,
                left,
                right: EDGES.1 - 1,
                top,
                bottom: self.bottom - 1,
            };
            self.caption(&frame, shown);
            let is_last = i + 1 == group.len();
            if is_last {
                self.foot(own.is_none().then_some(&figure.label));
            }
            self.axes(&frame, is_last);
            frame.draw(&mut self.svg, shown.panel);
        }
        Ok(())
    }

    /// The legend of the panels that follow. At the top it is at the right of the title, under it where it does not fit.
    fn head(&mut self, title: &str, legend: &Legend) {
        if self.bottom > 0 {
            legend.draw(&mut self.svg, EDGES, self.bottom + LEGEND / 2);
            self.bottom += LEGEND;
            return;
        }
        let (title_at, legend_at) = match width(title, TITLE) + legend.width() <= ROOM {
            true => (16, 26),
            false => (8, 38),
        };
        let words = fitted(title, TITLE, ROOM);
        self.svg.text(&words, (EDGES.0, title_at), TITLE, TOP_LEFT);
        legend.draw(&mut self.svg, EDGES, legend_at);
        self.bottom = HEAD;
    }

    /// Room for the numbers of an axis across, and its label.
    fn foot(&mut self, label: Option<&String>) {
        self.bottom += NUMBERED;
        if let Some(label) = label {
            self.bottom += LABEL;
            let at = ((EDGES.0 + EDGES.1) / 2, self.bottom);
            let words = fitted(label, WORDS, ROOM);
            self.svg.text(&words, at, WORDS, BELOW);
        }
    }

    /// The caption, and on the right how far an estimate peaks.
    fn caption(&mut self, frame: &Frame<'_>, shown: &Shown<'_>) {
        let is_worst = shown.panel.curves.iter().any(|c| c.kind == Kind::Worst);
        let who = if is_worst { "worst run" } else { "estimate" };
        let note = shown.beyond.map_or(String::new(), |beyond| {
            format!("{who} peaks at {} (axis cut)", number(rounded(beyond, 3)))
        });
        let (left, right, y) = (frame.left, frame.right + 1, frame.top - 5);
        let room = right - left - width(&note, WORDS);
        let words = fitted(&shown.panel.caption, WORDS, room);
        self.svg.text(&words, (left, y), WORDS, BOTTOM_LEFT);
        if !note.is_empty() {
            self.svg.text(&note, (right, y), NOTE, BOTTOM_RIGHT);
        }
    }

    /// Grid, axes and numbers; those across where they are asked for.
    fn axes(&mut self, frame: &Frame<'_>, has_across: bool) {
        let (left, right, top, bottom) = (frame.left, frame.right, frame.top, frame.bottom);
        let across = frame.x.ticks(9).into_iter();
        let across = across.map(|(share, words)| (frame.pixel((share, 0.0)).0, words));
        let across: Vec<(i32, String)> = across.collect();
        let upwards = upwards(frame.y, bottom + 1 - top).into_iter();
        let upwards = upwards.map(|(share, words)| (frame.pixel((0.0, share)).1, words));
        let upwards: Vec<(i32, String)> = upwards.collect();
        let svg = &mut self.svg;
        for (x, _) in &across {
            svg.line((*x, bottom), (*x, top), FAINT);
        }
        for (y, _) in &upwards {
            svg.line((left, *y), (right, *y), FAINT);
        }
        svg.path(&[(left - 1, top), (left - 1, bottom)], FRAME, 1);
        for (y, words) in upwards {
            let words = fitted(&words, NUMBERS, NAMES);
            svg.text(&words, (left - 2 * TICK, y), NUMBERS, AFTER);
            svg.path(&[(left - 1 - TICK, y), (left - 1, y)], FRAME, 1);
        }
        if has_across {
            let y = bottom + 1;
            svg.path(&[(left, y), (right, y)], FRAME, 1);
            for (x, words) in across {
                let middle = x.min(WIDTH - 1 - width(&words, NUMBERS) / 2);
                svg.text(&words, (middle, y + 2 * TICK), NUMBERS, ABOVE);
                svg.path(&[(x, y), (x, y + TICK)], FRAME, 1);
            }
        }
    }
}

/// Pixels from foot to top of a panel, one of so many.
fn height(panel: &Panel, count: usize) -> i32 {
    match (&panel.upwards, count) {
        (Scale::Within(_), _) => 514,
        (Scale::Rows(names), _) => names.len() as i32 * 19,
        (_, 0 | 1) => 320,
        (_, 2) => 220,
        (_, 3 | 4) => 165,
        _ => 132,
    }
}

/// The ticks of an axis upwards of such a height.
fn upwards(y: &Axis, height: i32) -> Vec<(f64, String)> {
    y.ticks((height as usize / 55).clamp(5, 10))
}
