//! Random plants in Modelica, so that a failure can be read and run again.

use nalgebra::DMatrix;

use crate::numbers::Numbers;
use crate::pair::{self, Pair};
use crate::terms::Terms;

/// A plant with what the judge has to know about it.
pub struct Random {
    pub states: Vec<(f64, f64)>,
    pub inputs: Vec<(f64, f64)>,
    pub outputs: Vec<String>,
    pub equations: Vec<String>,
    /// a right-hand side jumps inside the box as a state moves
    pub jumps: bool,
}

impl Random {
    /// The plant's text.
    pub fn text(&self) -> String {
        let mut text = "model P\n".to_owned();
        for (i, (low, high)) in self.inputs.iter().enumerate() {
            text += &format!("  input Real u{}(min = {low}, max = {high});\n", i + 1);
        }
        for (i, (low, high)) in self.states.iter().enumerate() {
            text += &format!("  Real x{}(min = {low}, max = {high});\n", i + 1);
        }
        for (i, output) in self.outputs.iter().enumerate() {
            text += &format!("  output Real y{} = {output};\n", i + 1);
        }
        text += "equation\n";
        for (i, equation) in self.equations.iter().enumerate() {
            text += &format!("  der(x{}) = {equation};\n", i + 1);
        }
        text + "end P;\n"
    }

    /// The same plant nearly at rest in the middle of the box, so that it stays there.
    pub fn at_rest(mut self) -> Self {
        let plant = pair::plant(&self.text());
        let augmented = pair::augmented(&plant);
        let none = DMatrix::zeros(self.states.len(), self.outputs.len());
        let copy = pair::observer(&augmented, &none);
        let middle = |sides: &[(f64, f64)]| -> Vec<f64> {
            sides.iter().map(|(a, b)| f64::midpoint(*a, *b)).collect()
        };
        let (x, u) = (middle(&self.states), middle(&self.inputs));
        let drift = Pair::new(&augmented, &copy).plant(0.0, &x, &u);
        for (equation, drift) in self.equations.iter_mut().zip(drift.iter()) {
            if drift.is_finite() {
                *equation += &format!(" - ({drift:.6})");
            }
        }
        self
    }
}

/// Two to four states, up to two inputs, one or two outputs that show one state each.
pub fn random(numbers: &mut Numbers) -> Random {
    let states = sides(numbers, 2 + numbers.clone().below(3));
    let n = states.len();
    let inputs: Vec<(f64, f64)> = (0..numbers.below(3)).map(|_| input(numbers)).collect();
    let mut terms = Terms {
        numbers: numbers.clone(),
        states: &states,
        inputs: &inputs,
        jumps: false,
    };
    let mut equations: Vec<String> = (0..n).map(|i| terms.linear(i)).collect();
    for equation in &mut equations {
        for _ in 0..terms.numbers.below(3) {
            *equation += &terms.weighted();
        }
    }
    if terms.numbers.chance(0.3) {
        // one term in two equations
        let shared = terms.term();
        for _ in 0..2 {
            let weight = terms.numbers.signed(0.05, 1.0);
            let row = terms.numbers.below(n);
            equations[row] += &format!(" + ({weight:.4})*({shared})");
        }
    }
    let outputs = outputs(&mut terms.numbers, n, inputs.len());
    let jumps = terms.jumps;
    *numbers = terms.numbers.clone();
    Random {
        states,
        inputs,
        outputs,
        equations,
        jumps,
    }
}

/// Boxes of random sizes, some of them away from zero and some touching it.
pub fn sides(numbers: &mut Numbers, count: usize) -> Vec<(f64, f64)> {
    let side = |_| {
        let width = numbers.size(0.05, 2.5);
        let low = match numbers.below(5) {
            0 => 0.0,
            1 | 2 => numbers.between(0.05, 0.6),
            _ => numbers.between(-1.2, 0.3),
        };
        (rounded(low), rounded(low + width))
    };
    (0..count).map(side).collect()
}

fn input(numbers: &mut Numbers) -> (f64, f64) {
    let low = numbers.between(-1.5, 1.0);
    (rounded(low), rounded(low + numbers.size(0.2, 3.0)))
}

/// The box of the text and that of the judge have the same ends.
fn rounded(x: f64) -> f64 {
    (x * 1e4).round() / 1e4
}

/// y = c·x + d, at times with an input, of one state or of two.
fn outputs(numbers: &mut Numbers, states: usize, inputs: usize) -> Vec<String> {
    let first = numbers.below(states);
    let mut shown = vec![first];
    if numbers.chance(0.4) {
        shown.push((first + 1 + numbers.below(states - 1)) % states);
    }
    let mut output = |state: &usize| {
        let state = state + 1;
        match numbers.below(4) {
            0 => format!("2*x{state} + 1"),
            1 => format!("-0.5*x{state}"),
            2 if inputs > 0 => format!("x{state} + u1"),
            _ => format!("x{state}"),
        }
    };
    shown.iter().map(&mut output).collect()
}
