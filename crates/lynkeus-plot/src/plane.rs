//! Parts of a plane: where in the box of two quantities something happens.

use std::ops::Range;

use plotters::prelude::*;

use super::render::{tick, titled};
use super::style::{BLUE, FAINT, FONT, INK, VERMILION, WIDTH};
use lynkeus_answer::Error;

const HEIGHT: u32 = 640;

/// Rectangles in the box of two quantities.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    /// What is shown.
    pub title: String,
    /// Name and range of the quantity across.
    pub across: (String, Range<f64>),
    /// Name and range of the quantity upwards.
    pub upwards: (String, Range<f64>),
    /// (across, upwards) of each part.
    pub parts: Vec<(Range<f64>, Range<f64>)>,
}

impl Plane {
    /// The picture as SVG text.
    ///
    /// # Errors
    /// A range that is not finite, or has no width.
    pub fn to_svg(&self) -> Result<String, Error> {
        for (name, range) in [&self.across, &self.upwards] {
            if !(range.start < range.end && (range.end - range.start).is_finite()) {
                let message = format!(
                    "nothing to draw over the range of {name}, [{}, {}]: declare min and max",
                    range.start, range.end
                );
                return Err(Error::refused(message));
            }
        }
        let mut text = String::new();
        self.draw(&mut text)
            .map_err(|e| Error::input(format!("cannot draw: {e}")))?;
        Ok(titled(text, &self.title))
    }

    fn draw(&self, text: &mut String) -> super::style::Drawn {
        let root = SVGBackend::with_string(text, (WIDTH, HEIGHT)).into_drawing_area();
        root.fill(&WHITE)?;
        let words = (FONT, 14).into_font().color(&INK);
        let bold = (FONT, 18).into_font().style(FontStyle::Bold).color(&INK);
        let mut chart = ChartBuilder::on(&root)
            .margin(18)
            .caption(&self.title, bold)
            .x_label_area_size(48)
            .y_label_area_size(70)
            .build_cartesian_2d(self.across.1.clone(), self.upwards.1.clone())?;
        chart
            .configure_mesh()
            .light_line_style(WHITE)
            .bold_line_style(FAINT)
            .x_desc(&self.across.0)
            .y_desc(&self.upwards.0)
            .x_label_formatter(&tick)
            .y_label_formatter(&tick)
            .label_style(words)
            .draw()?;
        // the sure rest of the box is left white; thin parts stay visible by their edge
        let parts = self
            .parts
            .iter()
            .map(|(x, y)| [(x.start, y.start), (x.end, y.end)]);
        chart.draw_series(
            parts
                .clone()
                .map(|p| Rectangle::new(p, VERMILION.mix(0.6).filled())),
        )?;
        chart.draw_series(parts.map(|p| Rectangle::new(p, VERMILION.stroke_width(1))))?;
        let (x, y) = (&self.across.1, &self.upwards.1);
        let frame = [(x.start, y.start), (x.end, y.end)];
        chart.draw_series([Rectangle::new(frame, BLUE.stroke_width(1))])?;
        root.present()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_without_range_is_refused() {
        let plane = Plane {
            title: "t".into(),
            across: ("a".into(), 0.0..1.0),
            upwards: ("b".into(), f64::NEG_INFINITY..1.0),
            parts: vec![],
        };
        let error = plane.to_svg().unwrap_err().to_string();
        assert!(error.contains("range of b"), "{error}");
        let finite = Plane {
            upwards: ("b".into(), 0.0..2.0),
            parts: vec![(0.2..0.3, 0.0..2.0)],
            ..plane
        };
        assert!(finite.to_svg().unwrap().contains("<svg"));
    }
}
