//! The report as text: a screen at most.

use std::fmt;

use lynkeus_observability::precision::{Advice, SensorSet};

use super::Report;
use crate::words::number;

/// Quantities listed.
const LISTED: usize = 12;

/// Horizons listed.
const COLUMNS: usize = 6;

/// Sensor sets listed.
const SETS: usize = 6;

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.heading(f)?;
        self.quantities(f)?;
        self.course(f)?;
        if let Some(advice) = &self.advice {
            self.sensors(f, advice)?;
        }
        if self.horizons.len() < self.asked {
            let reached = self.horizons.len();
            writeln!(
                f,
                "a limit ended the run after {reached} of {} horizons",
                self.asked
            )?;
        }
        if let Some(told) = self.declared.told() {
            writeln!(f, "{told}")?;
        }
        self.doubts(f)
    }
}

impl Report {
    fn unit(&self) -> String {
        self.time_unit
            .as_ref()
            .map_or(String::new(), |unit| format!(" {unit}"))
    }

    fn heading(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let span = self.horizons.last().copied().unwrap_or_default();
        let unit = self.unit();
        writeln!(
            f,
            "{}: what is known at present after {}{unit} of samples, one every {}{unit}",
            self.plant,
            number(span),
            number(self.step)
        )?;
        let told = self.sensors.iter().take(self.measured).map(|s| {
            let aside = if s.is_stated { "" } else { " (assumed)" };
            format!("{} {}{aside}", s.name, s.noise)
        });
        writeln!(f, "measured: {}", told.collect::<Vec<_>>().join("; "))
    }

    fn quantities(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(last) = self.last() else {
            return Ok(());
        };
        let order = self.ranked();
        let wide = self.wide();
        writeln!(
            f,
            "\n{:wide$}  {:>16}  {:>14}  {:>16}  {:>16}",
            "",
            "standard error",
            "of the range",
            "of its start",
            self.beside()
        )?;
        for &i in order.iter().take(LISTED) {
            writeln!(
                f,
                "{:wide$}  {:>16}  {:>14}  {:>16}  {:>16}",
                self.names[i],
                error(self.told(i, last.present[i])),
                percent(self.share(last, i)),
                start_error(self.told(i, last.start[i]), self.scales[i]),
                self.other(i)
            )?;
        }
        match order.len().saturating_sub(LISTED) {
            0 => {}
            more => writeln!(f, "and {more} that are known better")?,
        }
        if order.iter().any(|&i| self.told(i, last.present[i]) == 0.0) {
            writeln!(
                f,
                "0: known exactly, for a model that is right: nothing of an error is left"
            )?;
        }
        self.meaning(f)
    }

    /// What stands in the last column.
    fn beside(&self) -> &'static str {
        match (self.counts_process_noise, &self.filtered) {
            (true, _) => "if model exact",
            (false, Some(_)) => "sd of ekf",
            (false, None) => "",
        }
    }

    fn other(&self, quantity: usize) -> String {
        let values = match self.counts_process_noise {
            true => self.exact.last(),
            false => self.filtered.as_ref().and_then(|all| all.last()),
        };
        let value = values.and_then(|values| values.get(quantity));
        value.map_or(String::new(), |σ| error(self.told(quantity, *σ)))
    }

    /// What the figures count, in words.
    fn meaning(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.disturbances.is_empty() {
            writeln!(
                f,
                "disturbances ({}) are taken as zero: what they add to errors is not counted; `lynkeus check` bounds what it can",
                self.disturbances.join(", ")
            )?;
        }
        match (self.counts_process_noise, &self.filtered) {
            (true, _) => writeln!(
                f,
                "[process_noise] is counted: these are the standard deviations of the extended Kalman filter; sensor sets are compared for an exact model"
            ),
            (false, Some(_)) => writeln!(
                f,
                "the model is taken as exact; a filter without [process_noise] trusts it less, and its sd says so"
            ),
            (false, None) => Ok(()),
        }
    }

    /// The least certain quantities and the mean over some horizons.
    fn course(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let shown = spread(self.horizons.len(), COLUMNS);
        let wide = self.wide();
        write!(f, "\n{:wide$}", "after")?;
        for &h in &shown {
            write!(f, "  {:>9}", number(self.horizons[h]))?;
        }
        writeln!(f, "{}", self.unit())?;
        for &i in self.ranked().iter().take(2) {
            write!(f, "{:wide$}", self.names[i])?;
            for &h in &shown {
                write!(f, "  {:>9}", percent(self.share(&self.deviations[h], i)))?;
            }
            writeln!(f)?;
        }
        write!(f, "{:wide$}", "mean")?;
        for &h in &shown {
            let (mean, unseen) = self.mean(&self.deviations[h]);
            match unseen {
                0 => write!(f, "  {:>9}", percent(mean))?,
                _ => write!(f, "  {:>9}", format!("{unseen} unseen"))?,
            }
        }
        writeln!(f)
    }

    fn sensors(&self, f: &mut fmt::Formatter<'_>, advice: &Advice) -> fmt::Result {
        let size = advice.present.sensors.len();
        let tried = advice.same_size.len();
        let how = if advice.is_complete {
            "all"
        } else {
            "exchanging one,"
        };
        let plural = if size == 1 { "" } else { "s" };
        let wide = self.set_width(advice);
        writeln!(f, "\nwhich {size} sensor{plural} ({how} {tried} tried):")?;
        let best = advice.same_size.iter().enumerate().take(SETS);
        for (rank, set) in best {
            self.set_line(f, advice, rank, set, wide)?;
        }
        let present = advice
            .same_size
            .iter()
            .position(|s| s.sensors == advice.present.sensors);
        if let Some(rank) = present.filter(|rank| *rank >= SETS) {
            self.set_line(f, advice, rank, &advice.present, wide)?;
        }
        let first = |sets: &[SensorSet], words: &str, f: &mut fmt::Formatter<'_>| match sets.first()
        {
            Some(set) => writeln!(f, "{words}{}: {}", self.set(set), self.quality(set)),
            None => Ok(()),
        };
        first(&advice.additions, "best addition: ", f)?;
        if size != 1 {
            first(&advice.singles, "best single sensor: ", f)?;
        }
        if size != 2 {
            first(&advice.pairs, "best pair: ", f)?;
        }
        self.usual_noise(f)
    }

    fn set_line(
        &self,
        f: &mut fmt::Formatter<'_>,
        advice: &Advice,
        rank: usize,
        set: &SensorSet,
        wide: usize,
    ) -> fmt::Result {
        let own = match set.sensors == advice.present.sensors {
            true => "  (the study's)",
            false => "",
        };
        writeln!(
            f,
            "{:>5}  {:wide$}  {}{own}",
            rank + 1,
            self.set(set),
            self.quality(set)
        )
    }

    fn set_width(&self, advice: &Advice) -> usize {
        let shown = advice.same_size.iter().take(SETS);
        let all = shown.chain([&advice.present]);
        all.map(|set| self.set(set).chars().count())
            .max()
            .unwrap_or(0)
    }

    /// How the noise of candidates was chosen.
    fn usual_noise(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let added = self.sensors.iter().skip(self.measured);
        let mut noises: Vec<&str> = added
            .filter(|s| !s.is_stated)
            .map(|s| s.noise.as_str())
            .collect();
        let count = noises.len();
        noises.sort_unstable();
        noises.dedup();
        match noises[..] {
            [] => Ok(()),
            [one] => writeln!(f, "noise assumed for {count} sensors that could be: {one}"),
            _ => writeln!(
                f,
                "noise assumed for {count} sensors that could be: the same share of the range as the measured ones"
            ),
        }
    }

    fn quality(&self, set: &SensorSet) -> String {
        let worst = self.names.get(set.worst).map_or("", String::as_str);
        if set.unseen > 0 {
            return format!("{} not seen within this horizon", set.unseen);
        }
        let share = self.share(&set.deviations, set.worst);
        format!(
            "mean {:>8}, worst {:>8} ({worst})",
            percent(set.score.exp()),
            percent(share)
        )
    }

    /// Where the rank decision is near its border.
    fn doubts(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.is_doubtful {
            true => writeln!(
                f,
                "\nwhat is seen and what is not is near the border of the integrator's accuracy: tighten rtol of [simulate] to be sure"
            ),
            false => Ok(()),
        }
    }

    fn wide(&self) -> usize {
        let names = self.names.iter().map(|n| n.chars().count());
        names.max().unwrap_or(0).max(5)
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
