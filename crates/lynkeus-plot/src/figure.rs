//! What a picture shows: panels with curves, bands and marks.

use std::ops::Range;

use lynkeus_table::Series;

use super::Scale;

/// A picture: panels one above the other, which share the axis across.
#[derive(Clone, Debug, Default)]
pub struct Figure {
    /// The line above everything.
    pub title: String,
    /// The label of the axis across, with its unit.
    pub label: String,
    /// The axis across.
    pub across: Scale,
    /// The panels, from the top.
    pub panels: Vec<Panel>,
}

/// One quantity.
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
    /// What else there is to see, behind the curves.
    pub marks: Vec<Mark>,
    /// The axis upwards.
    pub upwards: Scale,
    /// The axis across, where it is not that of the figure.
    pub across: Option<Scale>,
}

/// One curve of a panel; a value that is not finite breaks the line.
#[derive(Clone, Debug)]
pub struct Curve {
    /// What the values are.
    pub kind: Kind,
    /// Its word in the legend; where it is empty that of its kind.
    pub name: String,
    /// Instants, or values of a parameter: increasing where there are many.
    pub time: Series,
    /// Values, as many as instants.
    pub values: Series,
}

impl Curve {
    /// A curve with its kind's word in the legend.
    pub fn new(kind: Kind, time: impl Into<Series>, values: impl Into<Series>) -> Self {
        Self {
            kind,
            name: String::new(),
            time: time.into(),
            values: values.into(),
        }
    }

    /// A curve through points (across, upwards).
    pub fn through(kind: Kind, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let (across, upwards): (Vec<f64>, Vec<f64>) = points.into_iter().unzip();
        Self::new(kind, across, upwards)
    }

    /// The same with a word of its own in the legend.
    #[must_use]
    pub fn named(mut self, name: impl Into<String>) -> Self {
        self.name = name.into();
        self
    }

    /// Its word in the legend.
    pub fn label(&self) -> &str {
        match self.name.as_str() {
            "" => self.kind.label(),
            name => name,
        }
    }
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
    /// What a panel is about, computed at a few points: broad, with dots, before everything.
    Main,
    /// A part of it, in grey.
    Grey,
    /// A part of it, in orange.
    Orange,
    /// What there is besides: thin and pale, behind everything.
    Pale,
    /// Bars from the left to the value across, one on each of some [`Scale::Rows`].
    Bars,
    /// Dots on rows.
    Dots,
}

impl Kind {
    /// The word of the legend; none where the word depends on the picture.
    pub fn label(self) -> &'static str {
        match self {
            Self::True => "true",
            Self::Measured => "measured",
            Self::Estimated => "estimated",
            Self::Smoothed => "smoothed",
            Self::Worst => "worst run",
            Self::Mean => "mean",
            Self::Main | Self::Grey | Self::Orange | Self::Pale | Self::Bars | Self::Dots => "",
        }
    }
}

/// Values between two curves; a value that is not finite breaks it.
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

/// Something of a panel that is no curve.
#[derive(Clone, Debug, PartialEq)]
pub enum Mark {
    /// When the estimate is outside of its declared range: a bar at the foot. Those of a panel are in the order of
    /// time.
    Outside(Range<f64>),
    /// Values across that are as good as the best: a pale stripe.
    Good(Range<f64>),
    /// A value across that is recommended, with its words in the legend: an upright line in colour.
    Chosen(f64, String),
    /// A value across that is used at present, with its words in the legend: a dashed upright line.
    Present(f64, String),
    /// A value across for which there is nothing to draw: a cross at the top.
    Failed(f64),
    /// A part of the plane, (across, upwards).
    Part(Range<f64>, Range<f64>),
    /// Words at the beginning of a row of [`Scale::Rows`].
    Said(usize, String),
}
