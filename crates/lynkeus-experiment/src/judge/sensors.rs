//! Readings beside what was expected of them.

use lynkeus_run::credible::{By, CLIP, ENOUGH, FEW};
use lynkeus_run::filter::{Reading, SensorHealth};

use super::quantile::{largest_sum, smallest_sum};
use crate::course::doubt::{Doubt, Kind, Level, times};
use crate::course::trace::{Stretch, Trace};
use crate::judge::outside::percent;
use crate::words::instant;

/// A warning from this share of that on.
const SUSPICIOUS: f64 = 2.0 / 3.0;
/// A contradiction in this share of a sensor's readings is one.
const SHARE: f64 = 0.2;
/// The gate's work is no contradiction up to this share.
const REJECTED: f64 = 1.0 / 3.0;
/// A reading so many deviations off moves the estimate to where nobody expected it.
const JUMP: f64 = 10.0;
/// Innovations smaller than this share of what is declared contradict the noise.
const SMALL: [f64; 2] = [0.5, 0.4];
/// Correlation of an innovation with the one before.
const COLOURED: [f64; 2] = [0.4, 0.8];
/// Readings for a correlation.
const PAIRS: usize = 50;

/// A measured output with what is known of its innovations.
#[derive(Clone, Debug)]
pub(crate) struct Judged<'e> {
    pub name: &'e str,
    pub trace: &'e Trace,
    /// over the last half of the rows, where it was counted
    pub late: Option<&'e SensorHealth>,
    /// whose deviations the innovations are measured in
    pub by: By,
    /// whether the study declares what its deviation rests on
    pub is_declared: bool,
}

impl Stretch {
    /// The ratio of its innovations to what is declared.
    fn ratio(&self) -> f64 {
        (self.squares / self.taken.max(1) as f64).sqrt()
    }

    /// Whether its innovations are larger than so many times what is declared, and not by chance. Of
    /// many, the largest does not count, and none counts for more than [`CLIP`]: some glitches say
    /// nothing of the others.
    fn exceeds(&self, limit: f64) -> bool {
        let (count, squares) = match self.taken {
            0..FEW => (self.taken, self.clipped),
            taken => (taken - 1, self.clipped - self.largest.min(CLIP * CLIP)),
        };
        // the quantile last: it takes the longest
        count > 0 && squares > limit.powi(2) * count as f64 && squares > largest_sum(count)
    }
}

/// What the innovations of a sensor say against the estimate.
pub(super) fn doubts(sensor: &Judged<'_>) -> Vec<Doubt> {
    let found = [
        contradiction(sensor),
        jump(sensor),
        small(sensor).filter(|_| sensor.by != By::Settled),
        coloured(sensor),
    ];
    found.into_iter().flatten().collect()
}

fn doubt(sensor: &Judged<'_>, kind: Kind, level: Level, text: String) -> Option<Doubt> {
    Some(Doubt {
        kind,
        name: sensor.name.to_owned(),
        text,
        level,
    })
}

/// What the readings of an output say against what was expected of them, as along a filter: their times with their
/// innovations in deviations.
pub fn contradicted(name: &str, readings: impl IntoIterator<Item = (f64, f64)>) -> Option<Doubt> {
    let mut trace = Trace::default();
    for (t, z) in readings {
        trace.take(t, Reading::Taken, z);
    }
    contradiction(&Judged {
        name,
        trace: &trace,
        late: None,
        by: By::Filter,
        is_declared: true,
    })
}

/// Readings that contradict the estimate at its end, or in a good share of the run.
fn contradiction(sensor: &Judged<'_>) -> Option<Doubt> {
    let Judged { name, by, .. } = sensor;
    if let Some(late) = sensor.late {
        let offered = late.taken + late.rejected;
        if offered >= ENOUGH && 2 * late.rejected > offered {
            let text = format!(
                "{} of the last {offered} readings of {name} are rejected by the gate",
                late.rejected
            );
            return doubt(sensor, Kind::Rejected, Level::Refusal, text);
        }
        // of a filter, nothing is left out: what jumps so far moves all that follows
        let ratio = late.consistency().unwrap_or(0.0).sqrt();
        if *by == By::Filter && offered >= ENOUGH && ratio > by.limit() {
            return doubt(
                sensor,
                Kind::Innovations,
                Level::Refusal,
                larger(name, ratio),
            );
        }
    }
    let late = sensor.trace.late();
    if late.exceeds(by.limit()) {
        let text = larger(name, late.ratio());
        return doubt(sensor, Kind::Innovations, Level::Refusal, text);
    }
    let found = stretches(sensor);
    let is_high = late.exceeds(SUSPICIOUS * by.limit());
    if is_high && found.as_ref().is_none_or(|d| d.level < Level::Warning) {
        let text = larger(name, late.ratio());
        return doubt(sensor, Kind::Innovations, Level::Warning, text);
    }
    found
}

fn larger(name: &str, ratio: f64) -> String {
    format!(
        "the innovations of {name} are {} as large as its noise and the process noise explain",
        times(ratio)
    )
}

/// Stretches of the run in which readings contradict the estimate, or are rejected.
fn stretches(sensor: &Judged<'_>) -> Option<Doubt> {
    let limit = sensor.by.limit();
    let is_bad = |s: &&Stretch| 2 * s.rejected > s.readings() || s.exceeds(limit);
    let all = sensor.trace.stretches();
    let count = |stretches: &[Stretch]| stretches.iter().map(Stretch::readings).sum::<usize>();
    let total = count(all);
    let mut start = 0;
    if sensor.by.converges() {
        start = all.iter().take_while(is_bad).count();
        while 2 * count(&all[..start]) > total {
            start -= 1;
        }
    }
    let bad: Vec<&Stretch> = all[start..].iter().filter(is_bad).collect();
    let together = bad.iter().copied().copied().reduce(Stretch::and)?;
    let share = together.readings() as f64 / total.max(1) as f64;
    let is_rejected = 2 * together.rejected > together.readings();
    let is_much =
        share >= if is_rejected { REJECTED } else { SHARE } && bad.len() >= all.len().min(2);
    let level = match is_much {
        true => Level::Refusal,
        false => Level::Note,
    };
    let when = format!(
        "{} of its readings, from t = {} to {}",
        percent(share),
        instant(together.from),
        instant(together.to)
    );
    let name = sensor.name;
    match is_rejected {
        true => {
            let text = format!("the gate rejects most of {name} in {when}");
            doubt(sensor, Kind::Rejected, level, text)
        }
        false => {
            let text = format!("{} in {when}", larger(name, together.ratio()));
            doubt(sensor, Kind::Innovations, level, text)
        }
    }
}

/// One reading that a filter without a gate believes.
fn jump(sensor: &Judged<'_>) -> Option<Doubt> {
    let whole = sensor.trace.whole();
    let size = whole.largest.sqrt();
    if sensor.by != By::Filter || size <= JUMP {
        return None;
    }
    let text = format!(
        "a reading of {} is {} of its deviations from what was expected, and moves the estimate (t = {}); `gate` of [observer] keeps such readings out",
        sensor.name,
        lynkeus_words::figures(size, 2),
        instant(whole.largest_at)
    );
    doubt(sensor, Kind::Jump, Level::Note, text)
}

/// Innovations that are far too small: a noise, a density or a unit is wrong.
fn small(sensor: &Judged<'_>) -> Option<Doubt> {
    let whole = sensor.trace.whole();
    let ratio = whole.ratio();
    let is_small = ratio < SMALL[0] && whole.squares < smallest_sum(whole.taken);
    if !(is_small && sensor.is_declared) {
        return None;
    }
    let text = format!(
        "the innovations of {} are {} their declared size: its noise or a density of [process_noise] is declared too large, or in another unit",
        sensor.name,
        times(ratio)
    );
    let level = match ratio < SMALL[1] {
        true => Level::Warning,
        false => Level::Note,
    };
    doubt(sensor, Kind::Noise, level, text)
}

/// A filter's innovations are white where its model is right.
fn coloured(sensor: &Judged<'_>) -> Option<Doubt> {
    let whole = sensor.trace.whole();
    let correlation = whole.products / whole.squares.max(f64::MIN_POSITIVE);
    let is_coloured = correlation > COLOURED[0] && whole.taken >= PAIRS;
    if sensor.by != By::Filter || !is_coloured {
        return None;
    }
    let text = format!(
        "the innovations of {} follow from the ones before (correlation {}): the model leaves something out",
        sensor.name,
        lynkeus_words::figures(correlation, 2)
    );
    let level = match correlation > COLOURED[1] {
        true => Level::Warning,
        false => Level::Note,
    };
    doubt(sensor, Kind::Coloured, level, text)
}
