//! SVG pictures: time series, and figures over a parameter ([`Chart`]).
//!
//! A [`Figure`] has panels one above the other that share the time axis.
//! Each panel shows one quantity: what is true as a broad grey line, what is estimated as a blue
//! line over it with a pale band of two standard deviations, what later rows make of it as a green
//! line, what is measured as orange dots (Okabe and Ito's colours, safe for the colour-blind). Where
//! an estimate is outside of its declared range the foot of the panel is marked. An estimate that peaks far beyond everything else would flatten the rest of its
//! panel; the axis is then cut and the panel's caption says how far the peak goes
//! ([`Panel::limits`] has the rule).
//!
//! This crate knows curves, bands and bars, and not of what they are.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod axis;
mod band;
mod bars;
mod chart;
mod curve;
mod decimate;
mod grid;
mod legend;
mod limits;
mod panel;
mod plane;
mod render;
mod style;

pub use bars::{Bar, Bars};
pub use chart::{Chart, Line, Look, Plot, Upright};
pub use panel::{Band, Curve, Extent, Figure, Kind, Panel, Span};
pub use plane::Plane;

use lynkeus_table::Series;

impl Figure {
    /// The picture as SVG text.
    ///
    /// # Errors
    /// There is nothing finite to draw, or a curve cannot be read again.
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
