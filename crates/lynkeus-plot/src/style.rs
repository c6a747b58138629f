//! Sizes, colours and lines that pictures share.

use plotters::chart::ChartContext;
use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

use super::Kind;

pub(super) const WIDTH: u32 = 900;
pub(super) const LEFT: u32 = 78;
pub(super) const RIGHT: u32 = 22;
pub(super) const FONT: &str = "sans-serif";

pub(super) const INK: RGBColor = RGBColor(38, 38, 38);
pub(super) const FAINT: RGBColor = RGBColor(226, 226, 226);
pub(super) const FRAME: RGBColor = RGBColor(150, 150, 150);
pub(super) const GREY: RGBColor = RGBColor(140, 140, 140);
pub(super) const BLUE: RGBColor = RGBColor(0, 114, 178);
pub(super) const GREEN: RGBColor = RGBColor(0, 158, 115);
pub(super) const ORANGE: RGBColor = RGBColor(230, 159, 0);
pub(super) const VERMILION: RGBColor = RGBColor(213, 94, 0);

pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
pub(super) type Chart<'a> =
    ChartContext<'a, SVGBackend<'a>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;
pub(super) type Drawn = Result<(), DrawingAreaErrorKind<std::io::Error>>;

pub(super) fn stroke(kind: Kind) -> ShapeStyle {
    match kind {
        Kind::True => GREY.stroke_width(4),
        Kind::Estimated => BLUE.stroke_width(2),
        Kind::Smoothed => GREEN.stroke_width(2),
        Kind::Measured => ORANGE.filled(),
        Kind::Worst => ORANGE.stroke_width(1),
        Kind::Mean => BLUE.stroke_width(2),
    }
}
