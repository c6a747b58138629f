//! A sensor that is not there yet.

use lynkeus_expr::Node;
use lynkeus_run::filter::Limits;
use lynkeus_study::Noise;

use lynkeus_experiment::words::number;

/// The noise of a sensor of which nothing is said, as a share of its range.
const LEVEL: f64 = 0.01;

/// A sensor that is not there yet.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Extra {
    /// the output or state that it shows
    pub name: String,
    pub node: Node,
    /// none where it follows from how far the output goes
    pub noise: Option<Noise>,
    pub limits: Option<Limits>,
}

impl Extra {
    /// `x ±0.1`
    pub fn words(&self) -> String {
        let noise = match self.noise {
            None => String::new(),
            Some(Noise::Absolute(deviation)) => format!(" \u{b1}{}", number(deviation)),
            Some(Noise::Relative(share)) => format!(" \u{b1}{} %", number(100.0 * share)),
            Some(Noise::Uniform(bound)) => format!(" evenly within \u{b1}{}", number(bound)),
        };
        format!("{}{noise}", self.name)
    }
}

/// The noise of a sensor that shows what lies in this range.
pub(super) fn usual(low: f64, high: f64) -> Option<Noise> {
    let range = high - low;
    (range > 0.0 && range.is_finite()).then(|| one_in_a_hundred(range))
}

/// To two digits: nobody knows it better.
pub(super) fn one_in_a_hundred(range: f64) -> Noise {
    let deviation = LEVEL * range;
    Noise::Absolute(format!("{deviation:.1e}").parse().unwrap_or(deviation))
}
