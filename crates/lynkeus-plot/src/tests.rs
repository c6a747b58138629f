//! Whole pictures.

use super::*;

fn wave(kind: Kind, n: usize) -> Curve {
    let time: Vec<f64> = (0..n).map(|i| i as f64 / 10.0).collect();
    let values: Vec<f64> = time.iter().map(|t| (t / 3.0).sin()).collect();
    Curve::new(kind, time, values)
}

fn figure(curves: Vec<Curve>) -> Figure {
    Figure {
        title: "Tank <1> & 2".to_owned(),
        label: "time (s)".to_owned(),
        panels: vec![Panel {
            caption: "level (m)".to_owned(),
            curves,
            ..Panel::default()
        }],
        ..Figure::default()
    }
}

/// The left ends and the right ends of all words, as broad as they may be.
fn ends(svg: &str) -> Vec<(f64, f64)> {
    let found = svg.split("<text ").skip(1).map(|text| {
        let attribute = |name: &str| {
            let (_, after) = text.split_once(&format!("{name}=\"")).unwrap();
            after.split('"').next().unwrap()
        };
        let words = text.lines().nth(1).unwrap();
        let words = words.replace("&lt;", "<").replace("&amp;", "&");
        let size: f64 = attribute("font-size").parse().unwrap();
        let width = words.chars().count() as f64 * size * 1.24 / 2.0;
        let x: f64 = attribute("x").parse().unwrap();
        match attribute("text-anchor") {
            "start" => (x, x + width),
            "middle" => (x - width / 2.0, x + width / 2.0),
            _ => (x - width, x),
        }
    });
    found.collect()
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
    let high: Vec<f64> = time.iter().map(|t| 3.0 + t.sin()).collect();
    let band = Band {
        extent: Extent::TwoDeviations,
        low: vec![-3.0; 300].into(),
        high: high.into(),
        time: time.into(),
    };
    picture.panels[0].bands = vec![band];
    picture.panels[0].marks = vec![Mark::Outside(3.0..4.0)];
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
    picture.label = "<&\u{7}\u{9b}".to_owned();
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
    let picture = figure(vec![wave(Kind::Estimated, 200_000)]);
    let svg = picture.to_svg().unwrap();
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
    assert!(Figure::default().to_svg().is_err());
}

/// "GermaniManes: drift-observable observer" is some 330 pixels, four entries are 470, of 812.
#[test]
fn a_legend_never_lies_on_the_title() {
    let legend_at = |title: &str, outside: bool| {
        let kinds = [Kind::True, Kind::Measured, Kind::Estimated];
        let mut picture = figure(kinds.map(|kind| wave(kind, 30)).to_vec());
        picture.title = title.to_owned();
        if outside {
            picture.panels[0].marks = vec![Mark::Outside(1.0..2.0)];
        }
        let svg = picture.to_svg().unwrap();
        let before = svg.split("estimated").next().unwrap();
        before.contains("x=\"815\" y=\"26\"") || outside && before.contains("y=\"26\"")
    };
    assert!(!legend_at("GermaniManes: drift-observable observer", true));
    assert!(legend_at("GermaniManes: drift-observable observer", false));
    assert!(legend_at("Ltaief: state-affine observer", true));
}

fn over_theta() -> Figure {
    let panel = Panel {
        upwards: Scale::FromZero,
        marks: vec![
            Mark::Good(1.5..2.5),
            Mark::Chosen(2.0, "knee 2".to_owned()),
            Mark::Present(4.0, "study 4".to_owned()),
            Mark::Failed(8.0),
        ],
        curves: vec![Curve::through(
            Kind::Main,
            [(1.0, 3.0), (2.0, 1.0), (4.0, f64::NAN)],
        )],
        caption: "error".to_owned(),
        ..Panel::default()
    };
    Figure {
        title: "T <1>".to_owned(),
        label: "theta".to_owned(),
        across: Scale::Parameter,
        panels: vec![panel; 4],
    }
}

#[test]
fn a_picture_over_a_parameter_has_its_words_and_no_holes() {
    let mut picture = over_theta();
    let svg = picture.to_svg().unwrap();
    for word in ["T &lt;1&gt;", "theta", "knee 2", "study 4", "error"] {
        assert!(svg.contains(word), "{word}");
    }
    assert!(!svg.contains("NaN"));
    assert_eq!(svg.matches("knee 2").count(), 1);
    // what has nothing to show takes no room
    picture.panels[3].curves.clear();
    picture.panels[3].marks.clear();
    let less = picture.to_svg().unwrap();
    assert_eq!(less.matches("error").count(), 3);
    picture.panels.clear();
    assert!(picture.to_svg().is_err());
}

fn bars(name: &str, values: &[f64]) -> Panel {
    let rows = values.iter().enumerate();
    let seen = rows.clone().filter(|(_, value)| value.is_finite());
    let unseen = rows.clone().filter(|(_, value)| !value.is_finite());
    Panel {
        caption: "standard error".to_owned(),
        across: Some(Scale::Log),
        upwards: Scale::Rows(rows.map(|(row, _)| format!("{name}{row}")).collect()),
        curves: vec![
            Curve::through(Kind::Bars, seen.map(|(row, value)| (*value, row as f64)))
                .named("measuring y"),
        ],
        marks: unseen
            .map(|(row, _)| Mark::Said(row, "not seen".to_owned()))
            .collect(),
        ..Panel::default()
    }
}

#[test]
fn bars_have_their_names_and_the_unseen_say_so() {
    let picture = |values: &[f64]| Figure {
        panels: vec![bars("a<", values)],
        ..Figure::default()
    };
    let svg = picture(&[f64::INFINITY, 0.1]).to_svg().unwrap();
    for word in ["a&lt;0", "a&lt;1", "not seen", "measuring y"] {
        assert!(svg.contains(word), "{word}");
    }
    assert!(!svg.contains("NaN"));
    assert_eq!(svg.matches("fill=\"#0072B2\"").count(), 2);
    let error = picture(&[f64::INFINITY]).to_svg().unwrap_err().to_string();
    assert!(error.contains("no finite values"), "{error}");
}

#[test]
fn no_words_are_cut_by_the_edge() {
    let long = "a quantity with a name that nobody can remember, ".repeat(5);
    let mut bars = bars(&long, &[0.3, f64::INFINITY]);
    bars.curves[0].name = format!("measuring {long}");
    let mut over_theta = over_theta();
    over_theta.panels[0].marks[2] = Mark::Present(8.0, format!("the study's {long}"));
    over_theta.panels.insert(0, bars);
    over_theta.title = long.clone();
    over_theta.label = long;
    let svg = over_theta.to_svg().unwrap();
    // the numbers of an axis that hardly moves are long
    let nearly = [0.0, 1.0, 2.0].map(|t| (12_345.678 + 1e-7 * t, -0.000_123_456 - 1e-12 * t));
    let still = figure(vec![Curve::through(Kind::True, nearly)]);
    for svg in [svg, still.to_svg().unwrap()] {
        for (left, right) in ends(&svg) {
            assert!(left >= 0.0 && right <= 900.0, "{left} {right}: {svg}");
        }
    }
}

#[test]
fn a_plane_without_range_is_refused() {
    let plane = |upwards| Figure {
        label: "a".to_owned(),
        across: Scale::Within(0.0..1.0),
        panels: vec![Panel {
            caption: "b".to_owned(),
            upwards: Scale::Within(upwards),
            marks: vec![Mark::Part(0.2..0.3, 0.0..2.0)],
            ..Panel::default()
        }],
        ..Figure::default()
    };
    let error = plane(f64::NEG_INFINITY..1.0).to_svg().unwrap_err();
    assert!(error.to_string().contains("range of b"), "{error}");
    assert!(plane(0.0..2.0).to_svg().unwrap().contains("#D55E00"));
}
