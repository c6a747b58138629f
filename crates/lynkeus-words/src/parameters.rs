//! Parameters of a design.

use lynkeus_expr::real::rounded;
use lynkeus_observers::{ParameterValue, Shown};

use crate::{Words, arrows};

impl Words for ParameterValue {
    fn words(&self) -> String {
        match self {
            Self::Names(names) => names.join(", "),
            Self::Blocks(blocks) => arrows(blocks),
            Self::Alarm(least) => format!("excitation below {least:.3e}"),
            Self::Numbers(numbers) => listed(numbers),
            Self::Pairs(pairs) => {
                let pairs = pairs.iter().map(|k| format!("({}, {})", k[0], k[1]));
                pairs.collect::<Vec<_>>().join(", ")
            }
            Self::Computed(number) => format!("{number:.6}"),
            Self::Matrix(rows) => matrix(rows, |x| match x.is_nan() {
                true => "–".to_owned(),
                false => rounded(*x, 6).to_string(),
            }),
            Self::Expressions(rows) => matrix(rows, String::clone),
            Self::AtStart(rows) => {
                let row = |row: &Vec<Shown>| {
                    let entries: Vec<String> = row.iter().map(Shown::words).collect();
                    format!("({})", entries.join(", "))
                };
                rows.iter().map(row).collect::<Vec<_>>().join(", ")
            }
            Self::Gain { gain, limited } => {
                let limited = if *limited {
                    ", on the limited error"
                } else {
                    ""
                };
                format!("{}{limited}", gain.words())
            }
            Self::Transient { θ, until, fall } => {
                let fall = fall.map(|fall| format!(", then to θ with the time constant {fall}"));
                format!(
                    "{} until t = {until}{}",
                    listed(θ),
                    fall.unwrap_or_default()
                )
            }
            Self::Variance {
                variance,
                from_range,
            } => {
                let from = if *from_range { " (from its range)" } else { "" };
                format!("{variance}{from}")
            }
        }
    }
}

impl Words for Shown {
    fn words(&self) -> String {
        match self.at_start {
            Some(value) => format!("{}; {value} at the start", self.text),
            None => self.text.clone(),
        }
    }
}

/// `1, 2.5`
fn listed(numbers: &[f64]) -> String {
    let number = |x: &f64| match x.is_finite() {
        // what a product of two numbers leaves in the last digits is noise to a reader
        true => rounded(*x, 10).to_string(),
        false => "beyond the range of numbers".to_owned(),
    };
    numbers.iter().map(number).collect::<Vec<_>>().join(", ")
}

/// `[[1, 0], [0, 2]]`
fn matrix<T>(rows: &[Vec<T>], entry: impl Fn(&T) -> String) -> String {
    let row = |row: &Vec<T>| {
        format!(
            "[{}]",
            row.iter().map(&entry).collect::<Vec<_>>().join(", ")
        )
    };
    format!("[{}]", rows.iter().map(row).collect::<Vec<_>>().join(", "))
}
