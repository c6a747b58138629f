//! What a picture over time shows: panels with curves and bands.

use lynkeus_table::Series;

/// A picture: panels that share the time axis.
#[derive(Clone, Debug, Default)]
pub struct Figure {
    /// The line above everything.
    pub title: String,
    /// The label of the time axis, with its unit.
    pub time_label: String,
    /// The panels, from the top.
    pub panels: Vec<Panel>,
}

/// One quantity over time.
#[derive(Clone, Debug, Default)]
pub struct Panel {
    /// The quantity's name, or the monitor's header.
    pub name: String,
    /// The quantity's name, description and unit.
    pub caption: String,
    /// Its curves.
    pub curves: Vec<Curve>,
    /// Where the truth is supposed to be.
    pub bands: Vec<Band>,
    /// When the estimate is outside of its declared range, in the order of time.
    pub outside: Vec<Span>,
}

/// Values between two curves; a NaN breaks it.
#[derive(Clone, Debug)]
pub struct Band {
    /// What lies in it.
    pub extent: Extent,
    /// Instants, increasing.
    pub time: Series,
    /// Lower ends, as many as instants.
    pub low: Series,
    /// Upper ends, as many as instants.
    pub high: Series,
}

/// What a band reaches over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// Two standard deviations to either side.
    TwoDeviations,
    /// From the 5 % to the 95 % quantile of many runs.
    Quantiles,
}

impl Extent {
    /// The words of the legend.
    pub fn label(self) -> &'static str {
        match self {
            Self::TwoDeviations => "± 2 sd",
            Self::Quantiles => "5–95 %",
        }
    }
}

/// A span of time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// The first instant.
    pub from: f64,
    /// The last.
    pub to: f64,
}

/// One curve of a panel; a NaN breaks the line.
#[derive(Clone, Debug)]
pub struct Curve {
    /// What the values are.
    pub kind: Kind,
    /// Instants, increasing.
    pub time: Series,
    /// Values, as many as instants.
    pub values: Series,
}

/// What the values of a curve are; it decides colour and line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// What the plant really does: simulated, or an unknown input that happens to be logged.
    True,
    /// What a sensor reads.
    Measured,
    /// What the observer makes of it.
    Estimated,
    /// What it makes of it knowing later rows.
    Smoothed,
    /// The worst of many runs.
    Worst,
    /// The mean of many runs.
    Mean,
}

impl Kind {
    /// The word of the legend.
    pub fn label(self) -> &'static str {
        match self {
            Self::True => "true",
            Self::Measured => "measured",
            Self::Estimated => "estimated",
            Self::Smoothed => "smoothed",
            Self::Worst => "worst run",
            Self::Mean => "mean",
        }
    }
}

impl Figure {
    /// The kinds of curves that occur, in the order of the legend.
    pub(super) fn kinds(&self) -> Vec<Kind> {
        let curves = self.panels.iter().flat_map(|p| &p.curves);
        let mut kinds: Vec<Kind> = curves.map(|c| c.kind).collect();
        kinds.sort();
        kinds.dedup();
        kinds
    }
}
