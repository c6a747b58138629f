//! Readings that come late: each counts at the time at which its sample was taken.
//!
//! A log is put in the order of its samples: its own rows, and rows between them for samples that were taken between
//! them. An estimator goes through all of these; what is told has the rows of the log.

use std::cmp::Ordering;

use crate::course::{Course, Samples, lines};
use crate::near::{list, suggest};
use crate::prepare::Prepared;
use crate::prepare::headers::header;
use crate::words::number;
use crate::{Error, Series, Table};
use lynkeus_run::is_of_row;
use lynkeus_study::{BetweenSamples, Late, Name};

/// Why a simulation does not count delays.
pub(crate) const AT_ONCE: &str = "in a simulation every reading has come: it counts at the time of its sample, and only the simulated log has it late";

/// Where the rows of a log are among those that an estimator goes through.
#[derive(Clone, Debug)]
pub(crate) struct Interleaved {
    /// times of all of them
    time: Series,
    /// place of each row of the log
    own: Vec<usize>,
    /// inputs move between rows
    is_linear: bool,
}

/// A sample whose reading came later.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Taken {
    at: f64,
    value: f64,
    /// the time of the row that it came in
    came: f64,
}

impl Taken {
    fn is_at(&self, t: f64) -> bool {
        is_of_row(self.at, t, self.came)
    }
}

/// A log as it is put in the order of its samples.
pub(super) struct Unordered<'t> {
    /// its rows as they came, the times converted; where a sensor says when its samples were taken
    pub raw: Option<&'t Table>,
    /// the header of its times
    pub time: &'t str,
}

impl Unordered<'_> {
    /// Moves the late readings among `samples`, which are the log's rows in the order of their times, to their own
    /// times; none where no sensor is late.
    ///
    /// # Errors
    /// A delay longer than the log; a column that the log does not have, or not as times of the kind of its own; a
    /// reading without a time of its sample, or whose sample was taken after its row.
    pub fn interleave(
        &self,
        prepared: &Prepared<'_>,
        samples: &mut Samples,
        (notes, warnings): (&mut Vec<String>, &mut Vec<String>),
    ) -> Result<Option<Interleaved>, Error> {
        let declared = &prepared.declared().late;
        let outputs = prepared.augmented().outputs.iter();
        let names: Vec<&str> = outputs.map(|o| o.variable.name.as_str()).collect();
        let mut moved: Vec<(usize, Vec<Taken>)> = vec![];
        for (place, name) in names.iter().enumerate() {
            let (Some(late), Some(readings)) = (declared.of(name), samples.readings.get(place))
            else {
                continue;
            };
            if readings.is_empty() {
                continue;
            }
            let mut taken = match late {
                Late::By(delay) => self.delayed(prepared, name, *delay, samples, readings)?,
                Late::TakenAt(column) => self.stamped(prepared, name, column)?,
            };
            taken.sort_by(|a, b| a.at.total_cmp(&b.at));
            notes.extend(told(name, late, &taken));
            moved.push((place, taken));
        }
        if moved.is_empty() {
            return Ok(None);
        }
        let is_linear = prepared.study().estimate.between_samples == BetweenSamples::Linear;
        let all = moved.iter().flat_map(|(_, taken)| taken);
        let among = Interleaved::new(&samples.time, all.copied().collect(), is_linear);
        if let (Some(first), Some(own)) = (among.time.first(), samples.time.first())
            && first < own
        {
            notes.push(format!(
                "the estimate begins at {}, where the first sample was taken, before the first row of the log at {}",
                number(first),
                number(own)
            ));
        }
        let times = among.time.held()?;
        let mut readings: Vec<Series> = samples.readings.iter().map(|y| among.spread(y)).collect();
        for (place, taken) in moved {
            let (placed, lost) = placed(&times, &taken);
            if lost > 0 {
                warnings.push(format!(
                    "{}: samples with different readings at one time: {lost}; the last one counts",
                    names[place]
                ));
            }
            readings[place] = Series::gathered(samples.time.store(), placed);
        }
        samples.readings = readings;
        samples.inputs = samples.inputs.iter().map(|u| among.held(u)).collect();
        samples.time = among.time.clone();
        Ok(Some(among))
    }

    /// The readings of a sensor that shows what was `delay` ago.
    fn delayed(
        &self,
        prepared: &Prepared<'_>,
        name: &str,
        delay: f64,
        samples: &Samples,
        readings: &Series,
    ) -> Result<Vec<Taken>, Error> {
        let span = samples.span();
        if delay > span {
            let given = &prepared.study().sensors.late;
            let mut given = given.iter().filter(|(given, _)| given.is_or_has(name));
            let message = format!(
                "`delay` of [sensors]: {name} = {} is longer than the log, which spans {}: no sample was taken in it",
                number(delay),
                number(span)
            );
            let error = Error::input(message)
                .hint("the delay is in the unit of the plant's time; a sensor that nobody reads is left out of `measured`");
            return Err(match given.next() {
                Some((name, _)) => name.blame(error),
                None => error,
            });
        }
        let rows = samples.time.iter().zip(readings);
        let rows = rows.filter(|(_, y)| y.is_finite());
        Ok(rows
            .map(|(came, value)| Taken {
                at: came - delay,
                value,
                came,
            })
            .collect())
    }

    /// The readings of a sensor whose log says when each sample was taken.
    fn stamped(
        &self,
        prepared: &Prepared<'_>,
        name: &str,
        column: &Name,
    ) -> Result<Vec<Taken>, Error> {
        let Some(table) = self.raw else {
            return Ok(vec![]);
        };
        let settings = &prepared.study().estimate;
        if !table.has(&column.text) {
            let message = format!(
                "`taken_at` of [sensors]: {} has no column \"{column}\"; the columns found are: {}",
                table.place(),
                list(table.names())
            );
            let hint = suggest(&column.text, table.names());
            return Err(column.blame(Error::input(message).hint(hint)));
        }
        let mut at = table.times_like(&column.text, self.time)?;
        if table.origin(&column.text).is_some() || table.has_durations(&column.text) {
            let seconds = settings.log.seconds();
            at = Series::gathered(at.store(), at.iter().map(|t| t / seconds));
        }
        let times = table.times(self.time)?;
        let readings = table.cells(header(settings, name))?;
        let mut taken = vec![];
        for (row, ((came, value), at)) in times.iter().zip(readings).zip(&at).enumerate() {
            // what has no time counts nowhere, which is told
            if !value.is_finite() || !came.is_finite() {
                continue;
            }
            let reading = Taken { at, value, came };
            if !at.is_finite() {
                let message = format!(
                    "{name} = {} has no time of its sample: expected one in \"{column}\", found an empty cell",
                    number(value)
                );
                return Err(Error::input(message)
                    .at(table.place_of_row(row))
                    .hint("write the time, or leave the reading's cell empty as well"));
            }
            if at > came && !reading.is_at(came) {
                let time = self.time;
                let message = format!(
                    "the sample of {name} was taken after its result came: \"{column}\" = {} and \"{time}\" = {}",
                    number(at),
                    number(came)
                );
                return Err(Error::input(message).at(table.place_of_row(row)).hint(
                    "both times must be of one clock, in one unit and one zone, and the sample's the earlier one",
                ));
            }
            taken.push(reading);
        }
        Ok(taken)
    }
}

/// What is said of late readings.
fn told(name: &str, late: &Late, taken: &[Taken]) -> Option<String> {
    let largest = taken.iter().map(|t| t.came - t.at).fold(0.0, f64::max);
    let how = match late {
        _ if taken.is_empty() => return None,
        Late::By(delay) => format!("{} before they came", number(*delay)),
        Late::TakenAt(column) => format!(
            "as \"{column}\" says, up to {} before they came",
            lynkeus_words::short(largest)
        ),
    };
    Some(match taken.len() {
        1 => format!(
            "{name}: 1 reading counts at the time of its sample, {}",
            how.replace("they", "it")
        ),
        count => format!("{name}: {count} readings count at the times of their samples, {how}"),
    })
}

/// The last value at each of these times, NaN where there is none, and how many others were different; both are in the
/// order of time.
fn placed(times: &[f64], taken: &[Taken]) -> (Vec<f64>, usize) {
    let mut values = vec![f64::NAN; times.len()];
    let (mut row, mut lost) = (0, 0);
    for sample in taken {
        while times
            .get(row)
            .is_some_and(|t| *t < sample.at && !sample.is_at(*t))
        {
            row += 1;
        }
        if let Some(value) = values.get_mut(row) {
            lost += usize::from(value.is_finite() && *value != sample.value);
            *value = sample.value;
        }
    }
    (values, lost)
}

impl Interleaved {
    fn new(rows: &Series, mut taken: Vec<Taken>, is_linear: bool) -> Self {
        taken.sort_by(|a, b| a.at.total_cmp(&b.at));
        let mut time = Series::within(rows.store());
        let mut own = vec![];
        let mut rows = rows.iter().peekable();
        let mut taken = taken.into_iter().peekable();
        loop {
            let next = match (rows.peek(), taken.peek()) {
                (None, None) => break,
                (Some(t), Some(sample)) if sample.is_at(*t) => Ordering::Equal,
                (Some(t), Some(sample)) => t.total_cmp(&sample.at),
                (Some(_), None) => Ordering::Less,
                (None, Some(_)) => Ordering::Greater,
            };
            match next {
                Ordering::Equal => drop(taken.next()),
                Ordering::Less => {
                    own.push(time.len());
                    rows.next().into_iter().for_each(|t| time.push(t));
                }
                Ordering::Greater => {
                    let sample = taken.next();
                    let is_new = |s: &Taken| time.last().is_none_or(|t| !s.is_at(t));
                    let sample = sample.filter(is_new).map(|sample| sample.at);
                    sample.into_iter().for_each(|t| time.push(t));
                }
            }
        }
        Self {
            time,
            own,
            is_linear,
        }
    }

    /// How many rows are none of the log.
    pub fn inserted(&self) -> usize {
        self.time.len() - self.own.len()
    }

    /// A column of the log over all rows: NaN in those that are none of the log.
    pub fn spread(&self, column: &Series) -> Series {
        if column.is_empty() {
            return column.clone();
        }
        let mut own = self.own.iter().peekable();
        let mut values = column.iter();
        let spread = (0..self.time.len()).map(|row| match own.next_if(|own| **own == row) {
            Some(_) => values.next().unwrap_or(f64::NAN),
            None => f64::NAN,
        });
        Series::gathered(column.store(), spread)
    }

    /// A known input over all rows: the last value holds, or it moves along the line to the next one; before the
    /// first row it is what it is there.
    pub fn held(&self, input: &Series) -> Series {
        let spread = self.spread(input);
        if self.is_linear {
            return lines::between(&self.time, &spread);
        }
        let mut last = input.first().unwrap_or(f64::NAN);
        let held = spread.iter().map(|u| {
            if u.is_finite() {
                last = u;
            }
            last
        });
        Series::gathered(input.store(), held)
    }

    /// The rows of the log of a column that may be shorter than all.
    pub fn own(&self, column: &Series) -> Series {
        let mut own = self.own.iter().peekable();
        let rows = column.iter().enumerate();
        let rows = rows.filter(|(row, _)| own.next_if(|own| *own == row).is_some());
        Series::gathered(column.store(), rows.map(|(_, value)| value))
    }

    /// The same of what samples say: what a row between those of the log has stands in the next one that has nothing.
    fn own_or_before(&self, column: &Series) -> Series {
        let mut own = self.own.iter().peekable();
        let mut before = f64::NAN;
        let mut told = Series::within(column.store());
        for (row, value) in column.iter().enumerate() {
            let value = if value.is_nan() { before } else { value };
            let is_own = own.next_if(|own| **own == row).is_some();
            before = if is_own { f64::NAN } else { value };
            if is_own {
                told.push(value);
            }
        }
        told
    }

    /// Leaves of a run over all rows what is of those of the log.
    pub fn thin(&self, course: &mut Course) {
        let thin = |columns: &mut Vec<Series>| {
            for column in columns {
                *column = self.own(column);
            }
        };
        thin(&mut course.estimates);
        thin(&mut course.monitors);
        thin(&mut course.predicted);
        course.deviations.iter_mut().for_each(thin);
        course.smoothed.iter_mut().for_each(thin);
        course.smoothed_deviations.iter_mut().for_each(thin);
        for column in &mut course.innovations {
            *column = self.own_or_before(column);
        }
        if let Some(corrections) = &mut course.corrections {
            corrections.each(|column| *column = self.own(column));
        }
    }
}

/// What a sensor shows that is `delay` late, NaN before it shows anything; none where no row is so long after another.
pub(crate) fn delayed(time: &Series, values: &Series, delay: f64) -> Option<Series> {
    let mut rows = time.iter().zip(values).peekable();
    let mut is_met = false;
    let shown = time.iter().map(|came| {
        let sample = Taken {
            at: came - delay,
            value: f64::NAN,
            came,
        };
        while rows
            .next_if(|(t, _)| *t < sample.at && !sample.is_at(*t))
            .is_some()
        {}
        let met = rows.peek().filter(|(t, _)| sample.is_at(*t));
        is_met |= met.is_some();
        met.map_or(f64::NAN, |(_, value)| *value)
    });
    let shown = Series::gathered(values.store(), shown);
    is_met.then_some(shown)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(at: f64, value: f64, came: f64) -> Taken {
        Taken { at, value, came }
    }

    #[test]
    fn rows_are_between_those_of_the_log_only_where_it_has_none() {
        let rows = Series::from((0..6).map(|k| 0.1 * f64::from(k)).collect::<Vec<f64>>());
        // 0.6 − 0.4 misses 0.2 by a rounding
        assert_ne!(0.6 - 0.4, 0.2);
        let taken = vec![
            sample(0.6 - 0.4, 3.0, 0.5),
            sample(-0.05, 1.0, 0.1),
            sample(0.25, 4.0, 0.4),
            sample(0.25, 5.0, 0.5),
        ];
        let among = Interleaved::new(&rows, taken.clone(), false);
        let times = among.time.to_vec();
        assert_eq!(times.len(), 8);
        assert_eq!((times[0], times[4], among.inserted()), (-0.05, 0.25, 2));
        assert_eq!(among.own(&among.time).to_vec(), rows.to_vec());
        assert_eq!(among.own(&among.spread(&rows)).to_vec(), rows.to_vec());
        let mut sorted = taken;
        sorted.sort_by(|a, b| a.at.total_cmp(&b.at));
        let (values, lost) = placed(&times, &sorted);
        let there: Vec<(usize, f64)> = values
            .into_iter()
            .enumerate()
            .filter(|v| !v.1.is_nan())
            .collect();
        assert_eq!(there, [(0, 1.0), (3, 3.0), (4, 5.0)]);
        assert_eq!(lost, 1);
        let held = among.held(&rows).to_vec();
        assert_eq!((held[0], held[4]), (0.0, held[3]));
        let moving = Interleaved {
            is_linear: true,
            ..among.clone()
        }
        .held(&rows)
        .to_vec();
        assert!((moving[4] - 0.25).abs() < 1e-15);
        let innovations = Series::from(vec![9.0, f64::NAN, f64::NAN, 1.0, 2.0, 3.0]);
        let told = among.own_or_before(&innovations).to_vec();
        assert_eq!(told[0], 9.0);
        assert!(told[1].is_nan());
        assert_eq!(told[2..], [1.0, 3.0]);
    }
}
