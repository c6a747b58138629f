//! The nonlinear terms of random plants.

use crate::numbers::Numbers;

pub struct Terms<'a> {
    pub numbers: Numbers,
    pub states: &'a [(f64, f64)],
    pub inputs: &'a [(f64, f64)],
    pub jumps: bool,
}

impl Terms<'_> {
    /// The linear part of an equation: mostly damped about the middle of the box, the
    /// next state, now and then another.
    pub fn linear(&mut self, row: usize) -> String {
        let n = self.states.len();
        let numbers = &mut self.numbers;
        let (low, high) = self.states[row];
        let damping = match numbers.chance(0.75) {
            true => -numbers.size(0.1, 3.0),
            false => numbers.between(-0.2, 0.6),
        };
        let mut text = format!("({damping:.4})*(x{} - {:.4})", row + 1, (low + high) / 2.0);
        if row + 1 < n {
            text += &format!(" + ({:.4})*x{}", numbers.signed(0.2, 2.0), row + 2);
        }
        if numbers.chance(0.4) {
            let other = numbers.below(n) + 1;
            text += &format!(" + ({:.4})*x{other}", numbers.signed(0.05, 0.8));
        }
        text
    }

    /// A term with a coefficient, ready to be added.
    pub fn weighted(&mut self) -> String {
        let weight = self.numbers.signed(0.03, 1.0);
        let term = self.term();
        format!(" + ({weight:.4})*({term})")
    }

    pub fn term(&mut self) -> String {
        let j = self.numbers.below(self.states.len());
        let k = self.numbers.below(self.states.len());
        let (xj, xk) = (format!("x{}", j + 1), format!("x{}", k + 1));
        let w = self.numbers.size(0.3, 4.0);
        match self.numbers.below(20) {
            0 => format!("sin({w:.3}*{xj})"),
            1 => format!("cos({w:.3}*{xj} + 1)"),
            2 => format!("tanh({w:.3}*{xj})"),
            3 => format!("{xj}*{xk}"),
            4 => format!("{xj}^2"),
            5 => format!("{xj}^3"),
            6 => format!("exp(-{xj}^2)"),
            7 => format!("{xj}/(1 + {xj}^2)"),
            8 => format!("sin({xj}*{xk})"),
            9 => format!("atan({w:.3}*{xj} - {xk})"),
            10 | 11 => self.kinked(j, &xk),
            12 => self.positive(j, &xk),
            13 | 14 => self.timely(&xj),
            15 => self.jumping(j),
            _ => self.driven(&xj, &xk),
        }
    }

    /// A place inside the range of a state, at times an end or the middle of it.
    fn place(&mut self, state: usize) -> f64 {
        let (low, high) = self.states[state];
        match self.numbers.below(6) {
            0 => low,
            1 => f64::midpoint(low, high),
            _ => self.numbers.between(low, high),
        }
    }

    fn kinked(&mut self, j: usize, xk: &str) -> String {
        let (xj, c) = (format!("x{}", j + 1), self.place(j));
        match self.numbers.below(5) {
            0 => format!("abs({xj})"),
            1 => format!("abs({xj} - ({c:.6}))"),
            2 => format!("min({xj}, {c:.6})"),
            3 => format!("max({xj}, {xk})"),
            _ => format!("if {xj} > {c:.6} then ({xj} - ({c:.6}))^2 else 0"),
        }
    }

    /// What needs a positive state; elsewhere another term.
    fn positive(&mut self, j: usize, xk: &str) -> String {
        let xj = format!("x{}", j + 1);
        match (self.states[j].0, self.numbers.below(4)) {
            (0.0.., 0) => format!("sqrt({xj})"),
            (0.04.., 1) => format!("{xk}/{xj}"),
            (0.04.., 2) => format!("log({xj})"),
            (0.0.., _) => format!("{xj}^1.5"),
            _ => format!("{xj}*exp({xk})"),
        }
    }

    fn timely(&mut self, xj: &str) -> String {
        let w = self.numbers.size(0.3, 3.0);
        match self.numbers.below(4) {
            0 => format!("sin({w:.3}*time)*{xj}"),
            1 => format!("sin({w:.3}*time + {xj})"),
            2 => format!("if sin({w:.3}*time) > 0.4 then {xj} else -0.5*{xj}"),
            _ => format!("(2 + cos(time))*tanh({xj})"),
        }
    }

    /// Discontinuous inside the box: no certificate may follow.
    fn jumping(&mut self, j: usize) -> String {
        let (low, high) = self.states[j];
        let share = self.numbers.between(0.2, 0.8);
        let (xj, c) = (format!("x{}", j + 1), low + share * (high - low));
        self.jumps = true;
        match self.numbers.below(5) {
            0 => format!("if {xj} > {c:.6} then 1 else 0.5"),
            1 => format!("sign({xj} - ({c:.6}))"),
            2 => format!("floor({xj} - ({c:.6}))"),
            3 => format!("atan(1/({xj} - ({c:.6})))"),
            _ => format!("({xj} - ({c:.6}))/abs({xj} - ({c:.6}))"),
        }
    }

    /// What inputs do, steps among it; without inputs another term.
    fn driven(&mut self, xj: &str, xk: &str) -> String {
        let Some(&(low, high)) = self.inputs.first() else {
            return format!("{xj}*{xk}");
        };
        let at = |share: f64| low + share * (high - low);
        let product = match self.inputs.len() {
            1 => format!("u1*{xj}*{xk}"),
            _ => format!("u1*u2*{xj}"),
        };
        match self.numbers.below(9) {
            0 | 1 => format!("u1*{xj}"),
            2 | 3 => product,
            4 => format!("abs(u1)*{xj}"),
            5 => format!("if u1 > {:.4} then {xj} else -0.7*{xj}", at(0.6)),
            // a step beside an affine term, its ends like those of the affine term alone
            6 => format!(
                "u1*{xj} + (if u1 > {:.4} and u1 < {:.4} then 3 else 0)*{xk}",
                at(0.3),
                at(0.6)
            ),
            7 => format!("floor(3*u1)*{xj} + u1*{xk}"),
            _ => format!("u1^2*{xj}"),
        }
    }
}
