//! Charts drawn with `plotters` onto its SVG backend.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::axis::Axis;
use super::chart::{Chart, Line, Look, Plot};
use super::decimate::clipped;
use super::render::{tick, titled};
use super::style::{
    Area, BLUE, Chart as Plane, Drawn, FAINT, FONT, FRAME, GREY, INK, ORANGE, VERMILION, WIDTH,
};
use lynkeus_answer::Error;

const HEAD: u32 = 64;
const BROAD: u32 = 250;
const SMALL: u32 = 150;
const CAPTION: u32 = 26;
const TICKS: u32 = 26;
const FOOT: u32 = 30;
const LEGEND: u32 = 34;
const LEFT: u32 = 66;
const RIGHT: u32 = 24;
const BAND: RGBColor = RGBColor(222, 239, 231);
const PALE: RGBColor = RGBColor(176, 205, 226);

impl Chart {
    /// The picture as SVG text.
    ///
    /// # Errors
    /// There is nothing finite to draw.
    pub fn to_svg(&self) -> Result<String, lynkeus_answer::Error> {
        svg(self)
    }
}

fn svg(chart: &Chart) -> Result<String, Error> {
    let mark = chart.mark.as_ref().map(|m| m.0);
    let axes = chart.plots.iter().map(|plot| (plot, plot.axis(mark)));
    let shown: Vec<(&Plot, Axis)> = axes.filter_map(|(p, axis)| Some((p, axis?))).collect();
    let (Some(axis), false) = (chart.axis(), shown.is_empty()) else {
        return Err(Error::refused("nothing to draw: no finite values"));
    };
    let mut text = String::new();
    draw(chart, &axis, &shown, &mut text).map_err(|e| Error::input(format!("cannot draw: {e}")))?;
    Ok(titled(text, &chart.title))
}

fn draw(chart: &Chart, x: &Axis, plots: &[(&Plot, Axis)], text: &mut String) -> Drawn {
    let rows = plots.len().saturating_sub(1).div_ceil(2);
    let rows = u32::try_from(rows).unwrap_or(u32::MAX);
    let small = CAPTION + SMALL + TICKS;
    let broad = CAPTION + BROAD + TICKS;
    let height = HEAD + broad + rows.saturating_mul(small) + FOOT;
    let root = SVGBackend::with_string(text, (WIDTH, height)).into_drawing_area();
    root.fill(&WHITE)?;
    head(&root, chart, plots)?;
    for (i, (plot, y)) in plots.iter().enumerate() {
        let area = match i.checked_sub(1) {
            None => root.clone().shrink((0, HEAD), (WIDTH, broad)),
            Some(place) => {
                let (row, column) = (place as u32 / 2, place as u32 % 2);
                let corner = (column * WIDTH / 2, HEAD + broad + row * small);
                root.clone().shrink(corner, (WIDTH / 2, small))
            }
        };
        panel(&area, chart, plot, x, y, i == 0)?;
    }
    foot(&root, chart, height)?;
    root.present()
}

/// The first panel of a chart with its legend, at the foot of another picture.
pub(super) struct FootPanel<'c> {
    chart: &'c Chart,
    plot: &'c Plot,
    x: Axis,
    y: Axis,
}

/// None where there is nothing finite to draw.
pub(super) fn foot_panel(chart: &Chart) -> Option<FootPanel<'_>> {
    let plot = chart.plots.first()?;
    Some(FootPanel {
        chart,
        plot,
        x: chart.axis()?,
        y: plot.axis(None)?,
    })
}

impl FootPanel<'_> {
    pub(super) fn height(&self) -> u32 {
        LEGEND + CAPTION + BROAD + TICKS + FOOT
    }

    pub(super) fn draw(&self, area: &Area<'_>) -> Drawn {
        legend(area, &self.plot.lines, LEGEND as i32 / 2)?;
        let inner = area
            .clone()
            .shrink((0, LEGEND), (WIDTH, CAPTION + BROAD + TICKS));
        panel(&inner, self.chart, self.plot, &self.x, &self.y, true)?;
        foot(area, self.chart, self.height())
    }
}

/// The label of the parameter's axis.
fn foot(root: &Area<'_>, chart: &Chart, height: u32) -> Drawn {
    let label = (FONT, 15).into_font().color(&INK);
    let label = label.pos(Pos::new(HPos::Center, VPos::Center));
    let foot = (WIDTH as i32 / 2, (height - FOOT / 2) as i32);
    root.draw(&Text::new(chart.label.clone(), foot, label))
}

/// The title, and under it the legend of the first panel.
fn head(root: &Area<'_>, chart: &Chart, plots: &[(&Plot, Axis)]) -> Drawn {
    let title = (FONT, 18).into_font().style(FontStyle::Bold).color(&INK);
    root.draw(&Text::new(chart.title.clone(), (LEFT as i32, 14), title))?;
    let lines = plots.first().map_or(&[][..], |(plot, _)| &plot.lines);
    legend(root, lines, 48)
}

/// The curves that have names, at this height.
fn legend(root: &Area<'_>, lines: &[Line], at: i32) -> Drawn {
    let mut left = LEFT as i32;
    for line in lines.iter().filter(|l| !l.name.is_empty()) {
        root.draw(&PathElement::new(
            [(left, at), (left + 26, at)],
            stroke(line.look),
        ))?;
        let words = (FONT, 14).into_font().color(&INK);
        let words = words.pos(Pos::new(HPos::Left, VPos::Center));
        root.draw(&Text::new(line.name.clone(), (left + 32, at), words))?;
        left += 32 + 8 * line.name.chars().count() as i32 + 18;
    }
    Ok(())
}

fn panel(area: &Area<'_>, chart: &Chart, plot: &Plot, x: &Axis, y: &Axis, first: bool) -> Drawn {
    let caption = (FONT, 14).into_font().color(&INK);
    let caption = caption.pos(Pos::new(HPos::Left, VPos::Bottom));
    let corner = (LEFT as i32, CAPTION as i32 - 5);
    area.draw(&Text::new(plot.caption.clone(), corner, caption))?;
    let mut plane = ChartBuilder::on(area)
        .margin_top(CAPTION)
        .margin_right(RIGHT)
        .set_label_area_size(LabelAreaPosition::Left, LEFT)
        .set_label_area_size(LabelAreaPosition::Bottom, TICKS)
        .build_cartesian_2d(x.range(), y.range())?;
    band(&mut plane, chart, x, y)?;
    ticks(area, &mut plane, x, y)?;
    uprights(&mut plane, chart, x, y)?;
    let mut lines: Vec<&Line> = plot.lines.iter().collect();
    lines.sort_by_key(|line| line.look);
    for line in lines {
        curve(&mut plane, line, x, y)?;
    }
    if first {
        crosses(&mut plane, chart, x, y)?;
        words(area, &plane, chart, x, y)?;
    }
    Ok(())
}

/// The band behind the curves.
fn band(plane: &mut Plane<'_>, chart: &Chart, x: &Axis, y: &Axis) -> Drawn {
    let Some(band) = &chart.band else {
        return Ok(());
    };
    let range = y.range();
    if let (Some(from), Some(to)) = (x.place(*band.start()), x.place(*band.end())) {
        let corners = [(from, range.start), (to, range.end)];
        plane.draw_series([Rectangle::new(corners, BAND.filled())])?;
    }
    Ok(())
}

/// Grid, frame and numbers.
fn ticks(area: &Area<'_>, plane: &mut Plane<'_>, x: &Axis, y: &Axis) -> Drawn {
    let (across, up) = (x.range(), y.range());
    let number = |h, v| {
        let style = (FONT, 13).into_font().color(&INK);
        style.pos(Pos::new(h, v))
    };
    let origin = area.get_base_pixel();
    let local = |(a, b): (i32, i32)| (a - origin.0, b - origin.1);
    for value in x.ticks() {
        let Some(place) = x.place(value) else {
            continue;
        };
        let path = vec![(place, up.start), (place, up.end)];
        plane.draw_series([PathElement::new(path, FAINT)])?;
        let (px, py) = local(plane.backend_coord(&(place, up.start)));
        let style = number(HPos::Center, VPos::Top);
        area.draw(&Text::new(tick(&value), (px, py + 6), style))?;
    }
    let (_, top) = plane.backend_coord(&(across.start, up.end));
    let (_, bottom) = plane.backend_coord(&(across.start, up.start));
    let most = ((bottom - top) / 26).max(2) as usize;
    let all = y.ticks();
    for value in all.iter().step_by(all.len().div_ceil(most).max(1)) {
        let Some(place) = y.place(*value) else {
            continue;
        };
        let path = vec![(across.start, place), (across.end, place)];
        plane.draw_series([PathElement::new(path, FAINT)])?;
        let (px, py) = local(plane.backend_coord(&(across.start, place)));
        let style = number(HPos::Right, VPos::Center);
        area.draw(&Text::new(tick(value), (px - 7, py), style))?;
    }
    let corners = [(across.start, up.start), (across.end, up.end)];
    plane.draw_series([Rectangle::new(corners, FRAME)])?;
    Ok(())
}

/// The mark and what is used at present.
fn uprights(plane: &mut Plane<'_>, chart: &Chart, x: &Axis, y: &Axis) -> Drawn {
    let up = y.range();
    if let Some(place) = chart.present.as_ref().and_then(|p| x.place(p.0)) {
        let dash = 0.02 * (up.end - up.start);
        for i in (0..50).step_by(2) {
            let from = up.start + f64::from(i) * dash;
            let path = vec![(place, from), (place, from + dash)];
            plane.draw_series([PathElement::new(path, INK.stroke_width(1))])?;
        }
    }
    if let Some(place) = chart.mark.as_ref().and_then(|m| x.place(m.0)) {
        let path = vec![(place, up.start), (place, up.end)];
        plane.draw_series([PathElement::new(path, VERMILION.stroke_width(2))])?;
    }
    Ok(())
}

/// The words of the uprights, above the first panel.
fn words(area: &Area<'_>, plane: &Plane<'_>, chart: &Chart, x: &Axis, y: &Axis) -> Drawn {
    let origin = area.get_base_pixel();
    let top = y.range().end;
    let uprights = [(&chart.mark, VERMILION), (&chart.present, INK)];
    for (upright, colour) in uprights {
        let Some((value, word)) = upright else {
            continue;
        };
        let Some(place) = x.place(*value) else {
            continue;
        };
        let (px, py) = plane.backend_coord(&(place, top));
        let aside = chart.mark.as_ref().zip(chart.present.as_ref());
        let side = match aside {
            Some((mark, present)) if mark.0 > present.0 => (HPos::Left, HPos::Right),
            Some(_) => (HPos::Right, HPos::Left),
            None => (HPos::Center, HPos::Center),
        };
        let side = if colour == VERMILION { side.0 } else { side.1 };
        let style = (FONT, 14).into_font().style(FontStyle::Bold).color(&colour);
        let style = style.pos(Pos::new(side, VPos::Bottom));
        let at = (px - origin.0, py - origin.1 - 4);
        area.draw(&Text::new(word.clone(), at, style))?;
    }
    Ok(())
}

/// What could not be drawn.
fn crosses(plane: &mut Plane<'_>, chart: &Chart, x: &Axis, y: &Axis) -> Drawn {
    let up = y.range();
    let height = up.start + 0.96 * (up.end - up.start);
    let places = chart.crosses.iter().filter_map(|value| x.place(*value));
    let style = VERMILION.stroke_width(2);
    plane.draw_series(places.map(|place| Cross::new((place, height), 4, style)))?;
    Ok(())
}

fn curve(plane: &mut Plane<'_>, line: &Line, x: &Axis, y: &Axis) -> Drawn {
    let nothing = f64::NAN;
    let place = |p: &(f64, f64)| Some((x.place(p.0)?, y.place(p.1).unwrap_or(nothing)));
    let points: Vec<(f64, f64)> = line.points.iter().filter_map(place).collect();
    let shown = y.range();
    for piece in clipped(&points, &shown) {
        plane.draw_series([PathElement::new(piece, stroke(line.look))])?;
    }
    if line.look == Look::Main {
        let dots = points.into_iter().filter(|p| shown.contains(&p.1));
        plane.draw_series(dots.map(|p| Circle::new(p, 3, BLUE.filled())))?;
    }
    Ok(())
}

fn stroke(look: Look) -> ShapeStyle {
    match look {
        Look::Pale => PALE.stroke_width(1),
        Look::Grey => GREY.stroke_width(2),
        Look::Orange => ORANGE.stroke_width(2),
        Look::Main => BLUE.stroke_width(3),
    }
}
