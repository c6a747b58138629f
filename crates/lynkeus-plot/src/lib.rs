//! Pictures as SVG: panels over time or over a parameter, bars, and parts of a plane.
//!
//! A picture is a [`Figure`]: panels one above the other that share the axis across. A [`Panel`] shows one quantity by
//! curves, bands and marks; an axis has a [`Scale`]. What there is to name is in the legend.
//!
//! ```
//! use lynkeus_plot::{Curve, Figure, Kind, Panel};
//!
//! let time: Vec<f64> = (0..100).map(|i| 0.1 * f64::from(i)).collect();
//! let level = time.iter().map(|t| t.sin()).collect::<Vec<_>>();
//! let panel = Panel {
//!     caption: "level (m)".to_owned(),
//!     curves: vec![Curve::new(Kind::Estimated, time, level)],
//!     ..Panel::default()
//! };
//! let (title, label) = ("Tank".to_owned(), "time (s)".to_owned());
//! let figure = Figure { title, label, panels: vec![panel], ..Figure::default() };
//! assert!(figure.to_svg()?.starts_with("<svg"));
//! # Ok::<(), lynkeus_answer::Error>(())
//! ```
//!
//! Over time, what is true is a broad grey line, what is estimated a blue line over it with a pale band of two standard
//! deviations, what later rows make of it a green line, what is measured orange dots (Okabe and Ito's colours, safe for
//! the colour-blind). Where an estimate is outside of its declared range the foot of the panel is marked. An estimate that
//! peaks far beyond everything else would flatten the rest of its panel; the axis is then cut and the panel's caption says
//! how far the peak goes ([`Panel::limits`] has the rule).
//!
//! No words are cut by the edge of the sheet: what has no room ends with "…".
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod axis;
mod decimate;
mod figure;
mod legend;
mod limits;
mod marks;
mod render;
mod svg;
#[cfg(test)]
mod tests;

pub use axis::Scale;
pub use figure::{Band, Curve, Extent, Figure, Kind, Mark, Panel};
pub use limits::Limits;

use lynkeus_table::Series;

impl Figure {
    /// The picture as SVG text.
    ///
    /// # Errors
    /// There is nothing finite to draw, a range is none, or a curve cannot be read again.
    pub fn to_svg(&self) -> Result<String, lynkeus_answer::Error> {
        let svg = render::svg(self)?;
        let curves = self.panels.iter().flat_map(|p| &p.curves);
        let bands = self.panels.iter().flat_map(|p| &p.bands);
        let drawn = curves.flat_map(|c| [&c.time, &c.values]);
        let mut drawn = drawn.chain(bands.flat_map(|b| [&b.time, &b.low, &b.high]));
        drawn.try_for_each(Series::check)?;
        Ok(svg)
    }
}
