//! The report as text: a screen at most.

use lynkeus_answer::Document;
use lynkeus_answer::document::{Cell, Table};
use lynkeus_observability::precision::{Advice, Deviations, SensorSet};
use lynkeus_words::counted;
use serde_json::Value;

use super::Report;
use crate::{Answer, Series};
use lynkeus_experiment::words::number;

/// Quantities listed.
const LISTED: usize = 12;

/// Horizons listed.
const COLUMNS: usize = 6;

/// Sensor sets listed.
const SETS: usize = 6;

lynkeus_experiment::displayed!(Report);

impl Answer for Report {
    fn document(&self) -> Document {
        let span = self.horizons.last().copied().unwrap_or_default();
        let unit = self.unit();
        let mut document = Document::new(format!(
            "{}: what is known at present after {}{unit} of samples, one every {}{unit}",
            self.plant,
            number(span),
            number(self.step)
        ));
        let told = self.sensors.iter().take(self.measured).map(|s| {
            let aside = if s.is_stated { "" } else { " (assumed)" };
            format!("{} {}{aside}", s.name, s.noise)
        });
        document.line(format!("measured: {}", told.collect::<Vec<_>>().join("; ")));
        self.quantities(&mut document);
        document.part().table(self.course());
        if let Some(advice) = &self.advice {
            self.advise(&mut document, advice);
        }
        if self.horizons.len() < self.asked {
            let (reached, asked) = (self.horizons.len(), self.asked);
            document.line(format!(
                "a limit ended the run after {reached} of {asked} horizons"
            ));
        }
        if let Some(told) = self.declared.told() {
            document.line(told);
        }
        if self.is_doubtful {
            document.part().line("what is seen and what is not is near the border of the integrator's accuracy: tighten rtol of [simulate] to be sure");
        }
        document
    }

    fn entries(&self) -> Value {
        Self::entries(self)
    }

    fn is_positive(&self) -> bool {
        Self::is_positive(self)
    }

    fn columns(&self) -> Vec<(String, Series)> {
        let columns = Self::columns(self).into_iter();
        columns.map(|(name, x)| (name, x.into())).collect()
    }

    #[cfg(feature = "plot")]
    fn svg(&self) -> Result<Option<String>, crate::Error> {
        self.to_svg().map(Some)
    }
}

impl Report {
    fn unit(&self) -> String {
        self.time_unit
            .as_ref()
            .map_or(String::new(), |unit| format!(" {unit}"))
    }

    fn quantities(&self, document: &mut Document) {
        let Some(last) = self.last() else {
            return;
        };
        let order = self.ranked();
        let titles = [
            "quantity",
            "standard error",
            "of the range",
            "of its start",
            self.beside(),
        ];
        let rows = order.iter().map(|&i| {
            let figures = [
                error(self.told(i, last.present[i])),
                percent(self.share(last, i)),
                start_error(self.told(i, last.start[i]), self.scales[i]),
                self.other(i),
            ];
            let name = Cell::from(self.names[i].as_str());
            std::iter::once(name)
                .chain(figures.map(Cell::Number))
                .collect()
        });
        let table = Table::new(titles).with(rows).dense();
        document
            .part()
            .table(table.at_most(LISTED, "that are known better"));
        if order.iter().any(|&i| self.told(i, last.present[i]) == 0.0) {
            document
                .line("0: known exactly, for a model that is right: nothing of an error is left");
        }
        self.meaning(document);
    }

    /// What stands in the last column.
    fn beside(&self) -> &'static str {
        match (!self.counted.is_empty(), &self.filtered) {
            (true, _) => "if model exact",
            (false, Some(_)) => "sd of ekf",
            (false, None) => "",
        }
    }

    fn other(&self, quantity: usize) -> String {
        let values = match !self.counted.is_empty() {
            true => self.exact.last(),
            false => self.filtered.as_ref().and_then(|all| all.last()),
        };
        let value = values.and_then(|values| values.get(quantity));
        value.map_or(String::new(), |σ| error(self.told(quantity, *σ)))
    }

    /// What the figures count, in words.
    fn meaning(&self, document: &mut Document) {
        if !self.disturbances.is_empty() {
            document.line(format!(
                "disturbances ({}) are taken as zero: what they add to errors is not counted; `lynkeus check` bounds what it can",
                self.disturbances.join(", ")
            ));
        }
        if !self.counted.is_empty() {
            let (last, others) = (
                self.counted[self.counted.len() - 1],
                &self.counted[..self.counted.len() - 1],
            );
            let (keys, are) = match others.is_empty() {
                true => (last.to_owned(), "is"),
                false => (format!("{} and {last}", others.join(", ")), "are"),
            };
            document.line(format!("{keys} {are} counted: these are the standard deviations of the extended Kalman filter; sensor sets are compared for an exact model"));
        } else if self.filtered.is_some() {
            document.line("the model is taken as exact; a filter without [process_noise] trusts it less, and its sd says so");
        }
    }

    /// The least certain quantities and the mean over some horizons.
    fn course(&self) -> Table {
        let shown = spread(self.horizons.len(), COLUMNS);
        let mut titles = vec!["after".to_owned()];
        titles.extend(shown.iter().map(|&h| number(self.horizons[h])));
        if let Some(last) = titles.last_mut() {
            *last += &self.unit();
        }
        let line = |name: &str, share: &dyn Fn(&Deviations) -> String| {
            let shares = shown
                .iter()
                .map(|&h| Cell::Number(share(&self.deviations[h])));
            std::iter::once(Cell::from(name)).chain(shares).collect()
        };
        let ranked = self.ranked();
        let worst = ranked.iter().take(2);
        let worst = worst.map(|&i| line(&self.names[i], &|d| percent(self.share(d, i))));
        let mean = line("mean", &|d| match self.mean(d) {
            (mean, 0) => percent(mean),
            (_, unseen) => format!("{unseen} unseen"),
        });
        Table::new(titles).with(worst.chain([mean]))
    }

    fn advise(&self, document: &mut Document, advice: &Advice) {
        let size = advice.present.sensors.len();
        let tried = advice.same_size.len();
        let how = match advice.is_complete {
            true => "all",
            false => "exchanging one,",
        };
        document.heading(format!(
            "which {} ({how} {tried} tried):",
            counted(size, "sensor")
        ));
        let is_own = |set: &SensorSet| set.sensors == advice.present.sensors;
        let ranked = advice.same_size.iter().enumerate();
        let shown = ranked.filter(|(rank, set)| *rank < SETS || is_own(set));
        let rows = shown.map(|(rank, set)| {
            let own = if is_own(set) { "(the study's)" } else { "" };
            vec![
                Cell::Number((rank + 1).to_string()),
                self.set(set).into(),
                self.quality(set).into(),
                own.into(),
            ]
        });
        let titles = ["rank", "sensors", "how well", "of the study"];
        document.table(Table::plain(titles).with(rows));
        for (sets, words, is_new) in [
            (&advice.additions, "best addition", true),
            (&advice.singles, "best single sensor", size != 1),
            (&advice.pairs, "best pair", size != 2),
        ] {
            if let Some(set) = sets.first().filter(|_| is_new) {
                document.line(format!("{words}: {}: {}", self.set(set), self.quality(set)));
            }
        }
        if let Some(noise) = self.usual_noise() {
            document.line(noise);
        }
    }

    /// How the noise of candidates was chosen.
    fn usual_noise(&self) -> Option<String> {
        let added = self.sensors.iter().skip(self.measured);
        let mut noises: Vec<&str> = added
            .filter(|s| !s.is_stated)
            .map(|s| s.noise.as_str())
            .collect();
        let count = noises.len();
        noises.sort_unstable();
        noises.dedup();
        let noise = match noises[..] {
            [] => return None,
            [one] => one,
            _ => "the same share of the range as the measured ones",
        };
        Some(format!(
            "noise assumed for {count} sensors that could be: {noise}"
        ))
    }

    fn quality(&self, set: &SensorSet) -> String {
        if set.unseen > 0 {
            return format!("{} not seen within this horizon", set.unseen);
        }
        let worst = self.names.get(set.worst).map_or("", String::as_str);
        let share = self.share(&set.deviations, set.worst);
        let (mean, share) = (percent(set.score.exp()), percent(share));
        format!("mean {mean}, worst {share} ({worst})")
    }
}

/// A standard error in its unit.
fn error(σ: f64) -> String {
    match σ.is_finite() {
        true => number(σ),
        false => "not seen".to_owned(),
    }
}

/// The same of a value at the start; one beyond the range is as good as none.
fn start_error(σ: f64, scale: f64) -> String {
    match σ.is_finite() && σ > scale {
        true => "> its range".to_owned(),
        false => error(σ),
    }
}

/// A share of the range with two or three digits.
pub(super) fn percent(share: f64) -> String {
    if !share.is_finite() {
        return "not seen".to_owned();
    }
    let percent = 100.0 * share;
    match percent {
        0.0 => "0 %".to_owned(),
        1000.0.. => "> 1000 %".to_owned(),
        100.0.. => format!("{percent:.0} %"),
        10.0.. => format!("{percent:.1} %"),
        1.0.. => format!("{percent:.2} %"),
        0.01.. => format!("{percent:.3} %"),
        1e-4.. => format!("{percent:.4} %"),
        _ => format!("{percent:.1e} %"),
    }
}

/// At most `most` indices below `count`, evenly spread, ends included.
fn spread(count: usize, most: usize) -> Vec<usize> {
    if count <= most {
        return (0..count).collect();
    }
    (0..most).map(|k| k * (count - 1) / (most - 1)).collect()
}
