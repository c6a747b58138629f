//! What is left of the readings at the values found, drawn.

use lynkeus_plot::{Band, Curve, Extent, Figure, Kind, Panel, Scale};

use super::Fit;
use super::errors::Innovations;
use crate::Series;
use crate::figure::over_time;

/// Outputs that are drawn at most.
const OUTPUTS: usize = 4;

/// Lags of the autocorrelation.
const LAGS: usize = 40;

/// 95 % of the autocorrelations of a white series of n are within ± this/√n.
const WHITE: f64 = 1.96;

impl Fit {
    /// Of each output the innovations of the first log with their band, the error of the plant alone, and the
    /// autocorrelation of the innovations over their deviations.
    pub fn figure(&self) -> Figure {
        let rows = self.rows.at.partition_point(|(log, _)| *log == 1);
        let time: Vec<f64> = self.rows.at[..rows].iter().map(|(_, t)| *t).collect();
        let time = Series::from(time);
        let outputs = self.rows.columns.iter().take(OUTPUTS);
        let panels = outputs.flat_map(|own| {
            let innovations = innovations(own, &time, rows);
            std::iter::once(innovations).chain(autocorrelation(own, rows))
        });
        let log = self.logs.first().map_or("", String::as_str);
        let title = format!("{}: what is left of {log}", self.plant);
        over_time(title, self.time_unit.as_deref(), panels.collect())
    }
}

fn innovations(own: &Innovations, time: &Series, rows: usize) -> Panel {
    let column = |values: &[f64]| Series::from(values[..rows].to_vec());
    let curve = |kind, name: &str, values: &[f64]| {
        Curve::new(kind, time.clone(), column(values)).named(name)
    };
    let edge = |side: f64| {
        let edge = own.deviation[..rows].iter().map(|sd| side * 2.0 * sd);
        // the band goes on where the sensor does not report
        let mut last = f64::NAN;
        let filled = edge.map(|x| {
            if x.is_finite() {
                last = x;
            }
            last
        });
        Series::from(filled.collect::<Vec<f64>>())
    };
    let mut curves = vec![curve(Kind::Measured, "innovation", &own.innovation)];
    let alone = own.free_run[..rows].iter().zip(&own.innovation);
    // where the plant alone is fitted it is the same
    let is_other = |(alone, innovation): (&f64, &f64)| alone.is_finite() && alone != innovation;
    if alone.into_iter().any(is_other) {
        curves.push(curve(Kind::Pale, "error of the plant alone", &own.free_run));
    }
    Panel {
        name: format!("{}_innovation", own.output),
        caption: format!("{}: reading less prediction", own.output),
        curves,
        bands: vec![Band {
            extent: Extent::TwoDeviations,
            time: time.clone(),
            low: edge(-1.0),
            high: edge(1.0),
        }],
        ..Panel::default()
    }
}

/// Over the readings that there are; none where they are too few.
fn autocorrelation(own: &Innovations, rows: usize) -> Option<Panel> {
    let scaled = own.innovation[..rows].iter().zip(&own.deviation);
    let scaled: Vec<f64> = scaled
        .map(|(ν, sd)| ν / sd)
        .filter(|z| z.is_finite())
        .collect();
    let lags = LAGS.min(scaled.len() / 5);
    let power: f64 = scaled.iter().map(|z| z * z).sum();
    if lags < 2 || power <= 0.0 {
        return None;
    }
    let correlation = |lag: usize| {
        let pairs = scaled.iter().zip(&scaled[lag..]);
        pairs.map(|(a, b)| a * b).sum::<f64>() / power
    };
    let points = (1..=lags).map(|lag| (lag as f64, correlation(lag)));
    let band = WHITE / (scaled.len() as f64).sqrt();
    let ends = Series::from(vec![0.0, lags as f64 + 1.0]);
    Some(Panel {
        name: format!("{}_autocorrelation", own.output),
        caption: format!(
            "{}: autocorrelation of innovations over their sd, by lag in readings",
            own.output
        ),
        curves: vec![Curve::through(Kind::Main, points.collect::<Vec<_>>())],
        bands: vec![Band {
            extent: Extent::TwoDeviations,
            time: ends.clone(),
            low: Series::from(vec![-band; 2]),
            high: Series::from(vec![band; 2]),
        }],
        across: Some(Scale::Within(0.0..lags as f64 + 1.0)),
        ..Panel::default()
    })
}
