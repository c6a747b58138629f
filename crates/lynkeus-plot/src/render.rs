//! Figures drawn with `plotters` onto its SVG backend.

use std::borrow::Cow;
use std::ops::Range;

use lynkeus_expr::real::rounded;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::band::{draw_band, draw_marks};
use super::curve::draw_curve;
use super::legend::{fitted, head, width};
use super::limits::Limits;
use super::style::{Area, Chart, Drawn, FAINT, FONT, FRAME, INK, LEFT, RIGHT, VERMILION, WIDTH};
use super::{Curve, Figure, Kind, Panel};
use lynkeus_answer::{Error, visible};

const HEAD: u32 = 52;
const CAPTION: u32 = 24;
const TIME_AXIS: u32 = 50;

/// The whole figure as SVG text.
pub(super) fn svg(figure: &Figure) -> Result<String, Error> {
    let Some(time) = figure.time_range().filter(|t| t.end > t.start) else {
        return Err(Error::refused(
            "nothing to draw: expected finite values at two times at least",
        ));
    };
    let mut text = String::new();
    draw(figure, &time, &mut text).map_err(|e| Error::input(format!("cannot draw: {e}")))?;
    Ok(titled(text, &figure.title))
}

fn draw(figure: &Figure, time: &Range<f64>, text: &mut String) -> Drawn {
    let panel = panel_height(figure.panels.len());
    let count = u32::try_from(figure.panels.len()).unwrap_or(u32::MAX);
    let height = HEAD + count.saturating_mul(panel + CAPTION) + TIME_AXIS;
    let root = SVGBackend::with_string(text, (WIDTH, height)).into_drawing_area();
    root.fill(&WHITE)?;
    head(&root, figure)?;
    let mut top = HEAD;
    for (i, content) in figure.panels.iter().enumerate() {
        let last = i + 1 == figure.panels.len();
        let below = if last { TIME_AXIS } else { 0 };
        let area = root
            .clone()
            .shrink((0, top), (WIDTH, CAPTION + panel + below));
        draw_panel(&area, content, time, last.then_some(&figure.time_label))?;
        top += CAPTION + panel;
    }
    root.present()
}

fn panel_height(panels: usize) -> u32 {
    match panels {
        0 | 1 => 320,
        2 => 220,
        3 | 4 => 165,
        _ => 132,
    }
}

fn draw_panel(
    area: &Area<'_>,
    panel: &Panel,
    time: &Range<f64>,
    time_label: Option<&String>,
) -> Drawn {
    let limits = panel.limits().unwrap_or(Limits {
        shown: -1.0..1.0,
        beyond: None,
    });
    caption(area, panel, &limits)?;
    let mut chart = ChartBuilder::on(area)
        .margin_top(CAPTION)
        .margin_right(RIGHT)
        .set_label_area_size(LabelAreaPosition::Left, LEFT)
        .set_label_area_size(
            LabelAreaPosition::Bottom,
            if time_label.is_some() { TIME_AXIS } else { 0 },
        )
        .build_cartesian_2d(time.clone(), limits.shown.clone())?;
    axes(&mut chart, time_label, &limits.shown)?;
    let columns = (WIDTH - LEFT - RIGHT) as usize;
    for band in &panel.bands {
        draw_band(&mut chart, band, &limits.shown, columns)?;
    }
    draw_marks(&mut chart, &panel.outside, time, &limits.shown, columns)?;
    let mut curves: Vec<&Curve> = panel.curves.iter().collect();
    curves.sort_by_key(|c| c.kind);
    for curve in curves {
        draw_curve(&mut chart, curve, time, &limits.shown)?;
    }
    Ok(())
}

fn caption(area: &Area<'_>, panel: &Panel, limits: &Limits) -> Drawn {
    let baseline = CAPTION as i32 - 5;
    let at = |side, size: u32, colour: &RGBColor| {
        let font = (FONT, size).into_font();
        font.color(colour).pos(Pos::new(side, VPos::Bottom))
    };
    let is_worst = panel.curves.iter().any(|c| c.kind == Kind::Worst);
    let who = if is_worst { "worst run" } else { "estimate" };
    let note = limits.beyond.map_or(String::new(), |beyond| {
        format!("{who} peaks at {} (axis cut)", tick(&rounded(beyond, 3)))
    });
    let (left, right) = (LEFT as i32, (WIDTH - RIGHT) as i32);
    let words = fitted(&panel.caption, 14, right - left - width(&note, 14));
    area.draw(&Text::new(
        words,
        (left, baseline),
        at(HPos::Left, 14, &INK),
    ))?;
    if note.is_empty() {
        return Ok(());
    }
    area.draw(&Text::new(
        note,
        (right, baseline),
        at(HPos::Right, 13, &VERMILION),
    ))
}

fn axes(chart: &mut Chart<'_>, time_label: Option<&String>, shown: &Range<f64>) -> Drawn {
    let height = shown.end - shown.start;
    let level = |value: &f64| tick(&unless_dust(*value, height));
    let ticks = (FONT, 13).into_font().color(&INK);
    let mut mesh = chart.configure_mesh();
    mesh.bold_line_style(FAINT)
        .light_line_style(TRANSPARENT)
        .axis_style(FRAME)
        .x_labels(9)
        .y_labels(5)
        .label_style(ticks)
        .x_label_formatter(&tick)
        .y_label_formatter(&level)
        .axis_desc_style((FONT, 14).into_font().color(&INK));
    if let Some(label) = time_label {
        mesh.x_desc(label);
    }
    mesh.draw()
}

/// A tick's number without the dust of binary fractions.
pub(super) fn tick(value: &f64) -> String {
    let value = rounded(*value, 9);
    if value == 0.0 {
        return "0".to_owned();
    }
    match value.abs() {
        1e-4..1e6 => format!("{value}").replace('-', "\u{2212}"),
        _ => format!("{value:e}").replace('-', "\u{2212}"),
    }
}

/// Zero for the tick that only rounding keeps from it.
fn unless_dust(value: f64, height: f64) -> f64 {
    if value.abs() < 1e-9 * height {
        0.0
    } else {
        value
    }
}

/// Names the picture for screen readers and hovering. Characters of names that no XML may have, and those that a
/// terminal obeys, are spelled out.
pub(super) fn titled(svg: String, title: &str) -> String {
    let svg = match visible::lines(&svg) {
        Cow::Borrowed(_) => svg,
        Cow::Owned(safe) => safe,
    };
    // the two that are no control characters
    let svg = svg.replace(['\u{fffe}', '\u{ffff}'], "\u{fffd}");
    let title = visible::line(title).replace(['\u{fffe}', '\u{ffff}'], "\u{fffd}");
    let Some(end) = svg
        .find("<svg")
        .and_then(|at| Some(at + svg.get(at..)?.find('>')? + 1))
    else {
        return svg;
    };
    let (head, body) = svg.split_at(end);
    let title = title
        .replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;");
    format!("{head}\n<title>{title}</title>{body}")
}

#[cfg(test)]
mod tests {
    use super::super::{Band, Extent, Span};
    use super::*;

    fn wave(kind: Kind, n: usize) -> Curve {
        let time: Vec<f64> = (0..n).map(|i| i as f64 / 10.0).collect();
        let values: Vec<f64> = time.iter().map(|t| (t / 3.0).sin()).collect();
        Curve {
            kind,
            time: time.into(),
            values: values.into(),
        }
    }

    fn figure(curves: Vec<Curve>) -> Figure {
        Figure {
            title: "Tank <1> & 2".to_owned(),
            time_label: "time (s)".to_owned(),
            panels: vec![Panel {
                caption: "level (m)".to_owned(),
                curves,
                ..Panel::default()
            }],
        }
    }

    #[test]
    fn a_picture_names_everything() {
        let picture = figure(vec![wave(Kind::True, 300), wave(Kind::Estimated, 300)]);
        let svg = picture.to_svg().unwrap();
        for words in [
            "<title>Tank &lt;1&gt; &amp; 2</title>",
            "level (m)",
            "time (s)",
            "estimated",
            "true",
        ] {
            assert!(svg.contains(words), "{words}");
        }
        assert!(!svg.contains("measured"));
        assert!(!svg.contains("NaN"));
    }

    #[test]
    fn bands_and_marks_are_drawn_and_named() {
        let mut picture = figure(vec![wave(Kind::Estimated, 300), wave(Kind::Smoothed, 300)]);
        let plain = picture.to_svg().unwrap();
        let time: Vec<f64> = (0..300).map(|i| f64::from(i) / 10.0).collect();
        let band = Band {
            extent: Extent::TwoDeviations,
            low: vec![-3.0; 300].into(),
            high: time
                .iter()
                .map(|t| 3.0 + t.sin())
                .collect::<Vec<_>>()
                .into(),
            time: time.into(),
        };
        picture.panels[0].bands = vec![band];
        picture.panels[0].outside = vec![Span { from: 3.0, to: 4.0 }];
        let svg = picture.to_svg().unwrap();
        for words in ["± 2 sd", "outside its range", "smoothed", "estimated"] {
            assert!(svg.contains(words), "{words}");
        }
        assert!(!plain.contains("± 2 sd") && !plain.contains("outside"));
        assert!(svg.contains("<polygon") && !svg.contains("NaN"));
        // the axis shows the band, too
        let limits = picture.panels[0].limits().unwrap().shown;
        assert!(limits.start < -3.0 && limits.end > 3.5, "{limits:?}");
    }

    #[test]
    fn no_name_breaks_the_picture() {
        let mut picture = figure(vec![wave(Kind::True, 30)]);
        picture.title = "a\u{1b}[31m\u{0}\u{fffe}".to_owned();
        picture.time_label = "<&\u{7}\u{9b}".to_owned();
        let svg = picture.to_svg().unwrap();
        let is_wrong = |c: char| {
            (c.is_control() && c != '\n' && c != '\t') || matches!(c, '\u{fffe}' | '\u{ffff}')
        };
        assert!(!svg.contains(is_wrong), "{svg}");
        for words in [
            "<title>a\\u{1b}[31m\\u{0}\u{fffd}</title>",
            "&lt;&amp;\\u{7}\\u{9b}",
        ] {
            assert!(svg.contains(words), "{words}");
        }
    }

    #[test]
    fn long_curves_give_small_pictures() {
        let svg = figure(vec![wave(Kind::Estimated, 200_000)])
            .to_svg()
            .unwrap();
        assert!(svg.len() < 150_000, "{} bytes", svg.len());
    }

    #[test]
    fn a_long_caption_leaves_room_for_the_note() {
        let mut peak = wave(Kind::Estimated, 300);
        let values = peak.values.iter().enumerate();
        let values = values.map(|(i, x)| if i == 3 { 1e3 } else { x });
        peak.values = values.collect::<Vec<_>>().into();
        let mut picture = figure(vec![peak, wave(Kind::True, 300)]);
        picture.panels[0].caption = "level ".repeat(30);
        let svg = picture.to_svg().unwrap();
        assert!(svg.contains("peaks at 1000 (axis cut)") && svg.contains('…'));
        let longest = svg
            .lines()
            .filter(|line| line.starts_with("level"))
            .map(str::len);
        assert!(longest.max().unwrap() < 100);
    }

    /// The laboratory's values of a state: few, and far apart.
    #[test]
    fn values_without_neighbours_are_dots() {
        let mut sparse = wave(Kind::True, 300);
        let values = sparse.values.iter().enumerate();
        let values = values.map(|(i, x)| if i % 50 == 7 { x } else { f64::NAN });
        sparse.values = values.collect::<Vec<_>>().into();
        let svg = figure(vec![sparse, wave(Kind::Estimated, 300)]);
        let svg = svg.to_svg().unwrap();
        assert_eq!(svg.matches("<circle").count(), 6);
    }

    #[test]
    fn nothing_to_draw_is_an_error() {
        assert!(figure(vec![]).to_svg().is_err());
        assert!(figure(vec![wave(Kind::True, 1)]).to_svg().is_err());
    }

    #[test]
    fn ticks_are_plain() {
        assert_eq!(tick(&0.300_000_000_000_000_04), "0.3");
        assert_eq!(tick(&-2.0), "\u{2212}2");
        assert_eq!(tick(&1e7), "1e7");
        assert_eq!(tick(&0.0), "0");
        assert_eq!(tick(&unless_dust(-5.55e-17, 1.0)), "0");
    }
}
