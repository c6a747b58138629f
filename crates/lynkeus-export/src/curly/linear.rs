//! A flow with its Jacobian: the covariance along an estimate.

use lynkeus_run::{Level, Linearised};

use super::function::{Arguments, Target, draft};
use super::machine::{FIELD, Kind, Machine, code, refuse_jumps};
use super::tables::{places, table};
use super::template::{chosen, exchanged};
use super::tuning::NOISE_FACTOR;
use crate::Refusal;
use crate::code::Part;

const INTEGRATE: &str = include_str!("runtime/integrate.c");
const LINEARISED: &str = include_str!("runtime/linearised.c");
const ALONG: &str = include_str!("runtime/along.c");
const PREDICT: &str = include_str!("runtime/predict.c");

/// A flow with its Jacobian and the densities of the noise on its states.
pub(super) struct Linear<'a> {
    pub flow: &'a Linearised,
    pub noise: &'a [f64],
    /// the densities are multiplied by a number that may be changed
    pub is_tuned: bool,
}

/// Which of two flows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Which {
    Free,
    /// inside the declared ranges
    Inside {
        /// whether the free flow is linearised, too: then both are integrated by the same functions
        is_shared: bool,
        /// whether its covariance is carried by Φ, too: then by the same function
        is_carried: bool,
    },
}

/// Names and sizes of which there is one for each flow.
const OWN: [&str; 6] = [
    "linear_flow",
    "linearised",
    "entry_rows",
    "entry_columns",
    "ENTRIES",
    "ENTRIES_ROOM",
];

/// And where the free flow has no covariance along it.
const SHARED: [&str; 7] = [
    "integrate",
    "along",
    "rows_of_noise",
    "process_noise",
    "WIDTH",
    "CARRIED",
    "DIMENSION",
];

impl Which {
    /// Whether the free flow has left these functions, sizes and tables.
    fn shares(self) -> bool {
        matches!(
            self,
            Self::Inside {
                is_shared: true,
                ..
            }
        )
    }

    /// Whether the free flow has left the function that carries a covariance.
    fn is_carried(self) -> bool {
        matches!(
            self,
            Self::Inside {
                is_carried: true,
                ..
            }
        )
    }

    /// The text, in which what this flow has for itself is called so.
    pub fn renamed(self, text: &str) -> String {
        exchanged(text, |word| {
            let is_own = OWN.contains(&word)
                || (SHARED.contains(&word) && !self.shares())
                || (word == "predict" && !self.is_carried());
            let is_own = is_own && self != Self::Free;
            is_own.then(|| match word.chars().all(|c| !c.is_lowercase()) {
                true => format!("{word}_INSIDE"),
                false => format!("{word}_inside"),
            })
        })
    }
}

impl Machine {
    /// The root of a covariance that starts diagonal.
    pub fn root(&mut self, variances: &[f64]) {
        let n = variances.len();
        let mut start = vec![0.0; n * n];
        for (i, variance) in variances.iter().enumerate() {
            start[i * n + i] = variance.sqrt();
        }
        self.field(
            "root",
            Kind::Real,
            "lower root of the covariance, row by row",
            start,
        );
    }

    /// The variances of the noises of the sensors.
    pub fn noises(&mut self, levels: impl Iterator<Item = Level>) {
        let parts = levels.map(|level| match level {
            Level::Relative(share) => (0.0, share),
            other => (other.variance(0.0), 0.0),
        });
        let (variances, shares): (Vec<f64>, Vec<f64>) = parts.unzip();
        self.tables += &table("noise_variances", &variances);
        self.tables += &table("noise_shares", &shares);
    }

    /// x, Φ and W along a flow, together, and the rows that W adds to a root.
    pub fn linear(
        &mut self,
        which: Which,
        linear: &Linear<'_>,
        arguments: &Arguments,
    ) -> Result<(), Refusal> {
        let Linear {
            flow,
            noise,
            is_tuned,
        } = linear;
        let entries = flow.jacobians().state.places();
        let flow = flow.system();
        refuse_jumps(flow)?;
        let n = flow.states().len();
        let scale = noise.iter().fold(0.0_f64, |m, q| m.max(*q));
        let (width, holds): (usize, &[&str]) = match scale > 0.0 {
            true => (2 * n, &["noisy"]),
            false => (n, &[]),
        };
        self.size(which.renamed("ENTRIES"), entries.len());
        self.size(which.renamed("ENTRIES_ROOM"), entries.len().max(1));
        if !which.shares() {
            self.size(which.renamed("WIDTH"), width);
            self.size(which.renamed("CARRIED"), width);
            self.size(which.renamed("DIMENSION"), n + n * width);
        }
        let mut tables = places("entry_rows", entries.iter().map(|e| e.0));
        tables += &places("entry_columns", entries.iter().map(|e| e.1));
        if scale > 0.0 && !which.shares() {
            let shares: Vec<f64> = noise.iter().map(|q| q / scale).collect();
            tables += &table("process_noise", &shares);
        }
        self.tables += &which.renamed(&tables);
        let jacobian = Part {
            tape: flow.output_tape(),
            outputs: 0..entries.len(),
        };
        let flow = draft(
            "The derivatives, and the entries of their Jacobian that are not zero.",
            "linear_flow",
            &code(&[Part::all(flow.derivative_tape()), jacobian])?,
            arguments,
            &[Target::all("dx", n), Target::all("slopes", entries.len())],
        )?;
        let scale = match is_tuned {
            true => format!("R({scale:?}) * {NOISE_FACTOR}"),
            false => format!("R({scale:?})"),
        };
        let along = chosen(ALONG, holds).replace("NOISE_SCALE", &scale);
        let linearised = chosen(LINEARISED, holds);
        let kind = if which == Which::Free { FIELD } else { "" };
        let own = [kind, &flow, &linearised].join("\n");
        self.add(&which.renamed(&own));
        if !which.shares() {
            self.add(&which.renamed(&[INTEGRATE, &along].join("\n")));
        }
        Ok(())
    }

    /// P = ΦPΦᵀ + W along a flow that is drafted already.
    pub fn carried(&mut self, which: Which, linear: &Linear<'_>) {
        if !which.is_carried() {
            let holds: &[&str] = if linear.is_noisy() { &["noisy"] } else { &[] };
            self.add(&which.renamed(&chosen(PREDICT, holds)));
        }
    }
}

impl Linear<'_> {
    /// Whether anything disturbs the states.
    pub fn is_noisy(&self) -> bool {
        self.noise.iter().any(|q| *q > 0.0)
    }
}
