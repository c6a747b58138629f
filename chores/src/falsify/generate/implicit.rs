//! Derivatives that share their equations: a mass matrix.

use super::super::case::{Case, Coupling, Side, number};
use super::terms::round;
use super::{Draft, Manner};

impl Draft<'_> {
    /// Couples derivatives in a ring, so that none can be solved for alone.
    pub fn implicit(&mut self, case: &mut Case) {
        let n = case.states.len();
        if n < 2 || !self.numbers.chance(0.12) {
            return;
        }
        let ring = match (n, self.numbers.below(10)) {
            (3.., 0) => vec![0, 1, 2],
            (_, 1 | 2) => vec![n - 1, self.numbers.below(n - 1)],
            // behind them nothing is read: a chain keeps its form
            _ => vec![n - 2, n - 1],
        };
        let first = ring.iter().copied().min().unwrap_or(0);
        for (k, &row) in ring.iter().enumerate() {
            let column = ring[(k + 1) % ring.len()];
            let factor = self.factor(&case.states[..=first]);
            case.couplings.push(Coupling {
                row,
                column,
                factor,
            });
        }
    }

    /// An entry of the mass matrix; a hostile one may make it singular.
    fn factor(&mut self, states: &[Side]) -> String {
        let w = number(round(self.numbers.signed(0.05, 0.7)));
        let x = &self.numbers.of(states).name;
        match (self.manner, self.numbers.below(8)) {
            (Manner::Hostile, 0) => format!("(1 + {x})"),
            (Manner::Hostile, 1) => format!("(2*{x})"),
            (Manner::Hostile, 2) => format!("sign({x} - 0.1)"),
            // two of 1.0 leave no plant: they are refused before anything is said of it
            (Manner::Hostile, 3) => "0.999".to_owned(),
            (Manner::Kinked, 0) => format!("{w}*abs(sin({x}))"),
            (_, 1) => format!("{w}*cos({x})"),
            (_, 2) => format!("{w}*sin(time)"),
            (_, 3) => format!("{w}*tanh({x})"),
            _ => w,
        }
    }
}
