//! What is left of the readings at the values found, drawn.

use lynkeus_plot::{Band, Curve, Extent, Figure, Kind, Mark, Panel, Scale};

use super::Fit;
use super::errors::Innovations;
use super::uncertainty::Profile;
use crate::Series;
use lynkeus_experiment::figure::over_time;
use lynkeus_experiment::tune::whiteness::{autocorrelations, band};

/// Outputs that are drawn at most.
const OUTPUTS: usize = 4;

/// Lags of the autocorrelation.
const LAGS: usize = 40;

impl Fit {
    /// Of each output the innovations of the first log with their band, the error of the plant alone, and the
    /// autocorrelation of the innovations over their deviations; then the profiles that were asked for.
    pub fn figure(&self) -> Figure {
        let rows = self.rows.at.partition_point(|(log, _)| *log == 1);
        let time: Vec<f64> = self.rows.at[..rows].iter().map(|(_, t)| *t).collect();
        let time = Series::from(time);
        let outputs = self.rows.columns.iter().take(OUTPUTS);
        let panels = outputs.flat_map(|own| {
            let innovations = innovations(own, &time, rows);
            std::iter::once(innovations).chain(autocorrelation(own, rows))
        });
        let panels = panels.chain(self.uncertainty.profiles.iter().map(|p| self.profile(p)));
        let log = self.logs.first().map_or("", String::as_str);
        let title = format!("{}: what is left of {log}", self.plant);
        over_time(title, self.time_unit.as_deref(), panels.collect())
    }
}

/// Steps of a profile's curve between two of its points.
const BETWEEN: usize = 16;

impl Fit {
    /// −log L along a value, the others being the best, with the line that bounds its interval.
    fn profile(&self, profile: &Profile) -> Panel {
        let unknown = &self.unknowns[profile.place];
        let known = &self.uncertainty.known[profile.place];
        let most = 2.5 * profile.rise;
        let points = &profile.points;
        // the root of the rise, negative below the least, is nearly straight
        let root = |&(value, rise): &(f64, f64)| {
            let sign = if value < known.value { -1.0 } else { 1.0 };
            (unknown.searched(value), sign * rise.max(0.0).sqrt())
        };
        let between = points.windows(2).flat_map(|pair| {
            let [(z0, r0), (z1, r1)] = [root(&pair[0]), root(&pair[1])];
            (0..BETWEEN).map(move |k| {
                let share = k as f64 / BETWEEN as f64;
                let at = |a: f64, b: f64| a + share * (b - a);
                (at(z0, z1), at(r0, r1))
            })
        });
        let curve = between.chain(points.last().map(root));
        let curve = curve.map(|(z, root)| (unknown.value(z), root * root));
        let curve: Vec<_> = curve.filter(|(_, rise)| *rise <= most).collect();
        let [first, last] = [curve.first(), curve.last()].map(|end| end.map_or(0.0, |end| end.0));
        let is_least = known
            .interval
            .is_some_and(|(low, _)| low <= unknown.low && low < first);
        let first = if is_least && unknown.reaches_zero() {
            0.0
        } else {
            first
        };
        let line = [first, last].map(|value| (value, profile.rise));
        let ends = known.interval.map(|(low, high)| low..high);
        let interval = ends.filter(|ends| ends.start >= first || ends.end <= last);
        Panel {
            name: format!("{}_profile", unknown.label()),
            caption: format!(
                "{}: rise of \u{2212}log L, by its value; the others are optimised",
                unknown.label()
            ),
            curves: vec![
                Curve::through(Kind::Estimated, curve).named("profile"),
                Curve::through(Kind::Grey, line)
                    .named(format!("bound of the interval, {:.2}", profile.rise)),
            ],
            marks: interval
                .map(|ends| Mark::Good(ends.start.max(first)..ends.end.min(last)))
                .into_iter()
                .chain([Mark::Chosen(known.value, "value found".to_owned())])
                .collect(),
            upwards: Scale::FromZero,
            across: Some(match first < last {
                true => Scale::Within(first..last),
                false => Scale::Parameter,
            }),
            ..Panel::default()
        }
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
    let correlations = autocorrelations(&scaled, LAGS).filter(|all| all.len() > 1)?;
    let lags = correlations.len();
    let points = (1..=lags).map(|lag| lag as f64).zip(correlations);
    let band = band(scaled.len());
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
