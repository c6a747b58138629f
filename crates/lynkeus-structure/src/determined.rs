//! What is known everywhere on the box whatever the inputs do: a quantity that alone, beside
//! what is known already, moves an output or the derivative of a known state, with a slope that never
//! vanishes.
//!
//! The functions are then strictly monotone in it, so that it is known at once and globally, unknown
//! inputs being any functions of time: no derivative of theirs enters.

use lynkeus_expr::{MissingInput, Node, jacobian};

use crate::{Extended, Verdict, sign};

/// States beyond which nothing is tried.
const STATES: usize = 300;

/// Per extended state whether it is known everywhere by that argument. False says nothing.
///
/// # Errors
/// [`MissingInput`] where the plant has parameters without value.
pub fn determined(extended: &Extended<'_>) -> Result<Vec<bool>, MissingInput> {
    let (graph, region) = (extended.graph(), extended.region());
    let mut known = vec![false; extended.states.len()];
    if known.len() > STATES {
        return Ok(known);
    }
    // a function that jumps may take a value twice though its slope has one sign
    if extended.regularity(&region)?.verdict != Verdict::Proved {
        return Ok(known);
    }
    let outputs = extended.outputs.iter().map(|o| o.variable.node);
    let functions: Vec<Node> = outputs
        .chain(extended.derivatives.iter().copied())
        .collect();
    let slopes = jacobian::forward(graph, &functions, &extended.symbols());
    let first = extended.outputs.len();
    // the derivative of an unknown input is no equation
    let mut open: Vec<usize> = (0..first + extended.plant_states()).collect();
    loop {
        let mut next = None;
        for (place, &row) in open.iter().enumerate() {
            let is_told = row < first || known[row - first];
            let mut entries = slopes.row(row).filter(|(j, _)| !known[*j]);
            if let (true, Some((j, slope)), None) = (is_told, entries.next(), entries.next()) {
                next = Some((place, j, slope));
                break;
            }
        }
        let Some((place, j, slope)) = next.filter(|_| graph.spent().is_none()) else {
            return Ok(known);
        };
        open.remove(place);
        known[j] = sign::keeps_sign(graph, slope, &region)?.finding.verdict == Verdict::Proved;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Sensors;
    use lynkeus_model::{LoadOptions, Plant};

    fn known(equations: &str) -> Vec<bool> {
        let text = format!(
            "model P
              input Real w(min = -1, max = 1);
              Real a(min = -1, max = 1); Real b(min = 1, max = 2); Real c(min = -1, max = 1);
              output Real y = a;
            equation
              {equations}
            end P;"
        );
        let plant = Plant::from_modelica(&text, "p.mo", &LoadOptions::default()).unwrap();
        let sensors = Sensors {
            unknown: vec!["w".into()],
            ..Sensors::default()
        };
        determined(&Extended::new(&plant, &sensors).unwrap()).unwrap()
    }

    #[test]
    fn a_chain_to_the_unknown_input_is_known_everywhere() {
        let found = known("der(a) = b^2; der(b) = c - b; der(c) = w;");
        assert_eq!(found, [true; 4]);
    }

    #[test]
    fn two_at_once_and_slopes_that_vanish_are_not() {
        // b and w together
        let found = known("der(a) = b + w; der(b) = -b; der(c) = -c;");
        assert_eq!(found, [true, false, false, false]);
        // c^2 does not tell the sign of c
        let found = known("der(a) = b; der(b) = c^2; der(c) = w;");
        assert_eq!(found, [true, true, false, false]);
        // a jump
        let found = known("der(a) = if a > 0 then b else b - 3; der(b) = c; der(c) = w;");
        assert_eq!(found, [false; 4]);
    }
}
