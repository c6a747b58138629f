//! What is known everywhere on the box whatever the inputs do: a quantity that alone, beside
//! what is known already, moves an output or the derivative of a known state, with a slope that never
//! vanishes.
//!
//! The functions are then strictly monotone in it, so that it is known at once and globally, unknown
//! inputs being any functions of time: no derivative of theirs enters.

use lynkeus_expr::{MissingInput, Node, jacobian};

use crate::{Extended, Verdict, magnitude_within, sign};

/// States beyond which nothing is tried.
const STATES: usize = 300;
/// Cells examined for the size of a slope.
const CELLS: usize = 400;

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

/// Per extended state how far two of its values can be apart that the same outputs go with, where that is
/// known: zero for those of `known`, what is `given` for some (place, size), and what follows from these by an output,
/// or by the derivative of a known state, along a slope that never vanishes.
///
/// # Errors
/// [`MissingInput`] where the plant has parameters without value.
pub fn uncertain(
    extended: &Extended<'_>,
    known: &[bool],
    given: &[(usize, f64)],
) -> Result<Vec<Option<f64>>, MissingInput> {
    let (graph, region) = (extended.graph(), extended.region());
    let mut sizes: Vec<Option<f64>> = known.iter().map(|known| known.then_some(0.0)).collect();
    for &(place, size) in given {
        sizes[place] = sizes[place].or(Some(size).filter(|size| size.is_finite()));
    }
    if sizes.len() > STATES || extended.regularity(&region)?.verdict != Verdict::Proved {
        return Ok(sizes);
    }
    let outputs = extended.outputs.iter().map(|o| o.variable.node);
    let functions: Vec<Node> = outputs
        .chain(extended.derivatives.iter().copied())
        .collect();
    let slopes = jacobian::forward(graph, &functions, &extended.symbols());
    let first = extended.outputs.len();
    let mut open: Vec<usize> = (0..first + extended.plant_states())
        .filter(|&row| row < first || known[row - first])
        .collect();
    loop {
        let one = |row: usize| {
            let mut entries = slopes.row(row).filter(|(j, _)| sizes[*j].is_none());
            entries.next().filter(|_| entries.next().is_none())
        };
        let mut next = open.iter().enumerate();
        let next = next.find_map(|(place, &row)| Some((place, row, one(row)?)));
        let Some((place, row, (j, slope))) = next.filter(|_| graph.spent().is_none()) else {
            return Ok(sizes);
        };
        open.remove(place);
        let (least, _) = sign::keeps_sign(graph, slope, &region)?.bounds;
        let mut sum = 0.0;
        for (k, slope) in slopes.row(row).filter(|(k, _)| *k != j) {
            let size = sizes[k].unwrap_or(f64::INFINITY);
            if size > 0.0 {
                sum += size * magnitude_within(graph, slope, &region, CELLS)?;
            }
        }
        sizes[j] = Some(sum / least).filter(|size| size.is_finite());
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
