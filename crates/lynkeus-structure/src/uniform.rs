//! For what inputs, and where: whether the outputs tell neighbouring states apart at
//! every point of the box for every constant input, and where they do not.
//!
//! The outputs with their first derivatives along the flow, for inputs that stay
//! constant, are a map of the state; of its rows n independent ones are chosen
//! ([`Codistribution`]), with a determinant that is proved to keep its sign if there are any.
//! Where their determinant is not zero the state is seen, at once and for any small error.
//! Where it is zero, that many derivatives do not show it.
//!
//! What is known everywhere on the box whatever the inputs do, unknown ones being any functions of time:
//! [`determined`].

use std::collections::{HashMap, HashSet};

use lynkeus_expr::interval::Intervals;
use lynkeus_expr::jacobian::{self, Jacobian};
use lynkeus_expr::{Graph, MissingInput, Node, Tape};

use crate::matrix::{Rows, determinant, jacobian_rows};
use crate::output_map::{Codistribution, output_derivatives};
use crate::region::{Cell, inside};
use crate::{
    AugmentedPlant, Coordinate, Finding, OneToOne, Place, Reason, Region, Verdict,
    magnitude_within, one_to_one, regularity, sign, vanishes,
};

/// A determinant of more states has too many terms.
const STATES: usize = 6;
/// Further choices of rows whose determinant is examined.
const CHOICES: usize = 8;
/// Cells of the subdivision that is told.
const CELLS: usize = 256;

/// What constant inputs and which states do to observability.
#[derive(Clone, Debug)]
pub struct Uniformity {
    /// the outputs' derivatives tell neighbouring states apart everywhere, for every constant
    /// input: a determinant keeps away from zero on the whole box
    pub regular: Finding,
    /// whether points far apart are told apart as well, while inputs stay constant
    pub one_to_one: OneToOne,
    /// where it may be zero: cells of a subdivision, and their share of the box's volume
    pub singular: Vec<Place>,
    /// the share; without meaning where a range is missing
    pub share: f64,
    /// variables of the determinant whose range is not declared
    pub undeclared: Vec<String>,
    /// constant inputs for which the determinant is zero for every state
    pub blind: Vec<Blind>,
    /// ranges of the states
    pub sides: Place,
}

/// Examines the box; none where the model has too many states, or where its outputs
/// do not determine the state at any point. `known` states are [known everywhere](crate::determined).
///
/// # Errors
/// [`MissingInput`] where the plant has parameters without value.
pub fn uniformity(
    augmented: &AugmentedPlant<'_>,
    known: &[bool],
) -> Result<Option<Uniformity>, MissingInput> {
    let n = augmented.states.len();
    if n > STATES {
        return Ok(None);
    }
    let graph = augmented.graph();
    let region = augmented.region();
    let derivatives = derivatives(augmented)?;
    let Some((node, regular)) = map(augmented, &derivatives, &region)? else {
        return Ok(None);
    };
    if vanishes(graph, node, &region)? == Verdict::Proved {
        return Ok(None);
    }
    let (singular, share) = match regular.verdict {
        Verdict::Proved => (vec![], 0.0),
        _ => cells(graph, node, &region)?,
    };
    // more rows than states may tell apart what no choice of them does
    let together = regular.is_proved() || augmented.outputs.len() > 1;
    Ok(Some(Uniformity {
        one_to_one: are_one_to_one(augmented, &derivatives, known, together, &region)?,
        blind: match regular.verdict {
            Verdict::Proved => vec![],
            _ => blind(augmented, node, &region)?,
        },
        regular,
        singular,
        share,
        undeclared: region.restricted(&graph.symbols_of(&[node])).open(),
        sides: region.dimensions[..n].to_vec(),
    }))
}

/// Per augmented state whether the outputs and those of their derivatives that come before `signals`, known inputs of the
/// augmented plant, tell it on the whole box: whatever these do. Other inputs stay constant, `known` states are known.
///
/// # Errors
/// [`MissingInput`] where the plant has parameters without value.
pub fn apart_whatever(
    augmented: &AugmentedPlant<'_>,
    signals: &[Node],
    known: &[bool],
) -> Result<Vec<bool>, MissingInput> {
    if augmented.states.len() > STATES || known.iter().all(|known| *known) {
        return Ok(known.to_vec());
    }
    let graph = augmented.graph();
    let mut derivatives = derivatives(augmented)?;
    let reads = |y: &Node| graph.symbols_of(&[*y]).iter().any(|s| signals.contains(s));
    for of_output in &mut derivatives {
        let kept = of_output.iter().position(reads);
        of_output.truncate(kept.unwrap_or(of_output.len()));
    }
    let found = are_one_to_one(augmented, &derivatives, known, true, &augmented.region())?;
    Ok(found.known)
}

/// Refuted only where the determinant is zero: where it changes its sign by a jump, as slopes
/// do at a kink, or from one whole number to the next, no point is singular.
fn without_jumps(found: Finding, region: &Region) -> Finding {
    match &found.verdict {
        Verdict::Refuted(witness) if witness.zero().is_none() => Finding {
            verdict: Verdict::Undecided(region.named(&region.cell())),
            reason: Reason::ByJump(Box::new(found.reason)),
        },
        _ => found,
    }
}

/// A determinant of n rows of ∂(y, y', …)/∂x for constant inputs, and whether it keeps away from zero: of the
/// first choice of rows for which that is proved, else of the first that is independent at generic points.
fn map(
    augmented: &AugmentedPlant<'_>,
    derivatives: &[Vec<Node>],
    region: &Region,
) -> Result<Option<(Node, Finding)>, MissingInput> {
    let (graph, symbols) = (augmented.graph(), augmented.symbols());
    let gradient = |y: &Vec<Node>| jacobian_rows(graph, y, &symbols);
    let gradients: Vec<Rows> = derivatives.iter().map(gradient).collect();
    let examined = |indices: &[usize]| {
        let (rows, map) = (chosen(&gradients, indices), chosen(derivatives, indices));
        examined(augmented, &rows, &map, region)
    };
    let mut codistribution = Codistribution::new(augmented, &gradients)?;
    let first = codistribution.krener_respondek();
    if first.iter().sum::<usize>() < augmented.states.len() {
        return Ok(None);
    }
    let Some(found) = examined(&first)? else {
        return Ok(None);
    };
    if found.1.is_proved() {
        return Ok(Some(found));
    }
    let mut others = codistribution.alternatives(&first);
    others.truncate(CHOICES);
    for indices in others {
        if codistribution.changes_sign(&indices) {
            continue;
        }
        let other = examined(&indices)?;
        if other.as_ref().is_some_and(|other| other.1.is_proved()) {
            return Ok(other);
        }
    }
    Ok(Some(found))
}

/// So many of each output, in one list.
fn chosen<T: Clone>(of_outputs: &[Vec<T>], indices: &[usize]) -> Vec<T> {
    let pairs = of_outputs.iter().zip(indices);
    let chosen = pairs.flat_map(|(all, &count)| all.iter().take(count));
    chosen.cloned().collect()
}

/// The determinant of these rows, the Jacobian of this map; none where it is zero by its pattern.
fn examined(
    augmented: &AugmentedPlant<'_>,
    rows: &Rows,
    map: &[Node],
    region: &Region,
) -> Result<Option<(Node, Finding)>, MissingInput> {
    let graph = augmented.graph();
    let Some(node) = determinant(graph, rows) else {
        return Ok(None);
    };
    // where the map itself jumps, its derivative tells nothing
    let mut moving = augmented.symbols();
    moving.push(augmented.plant.time);
    let mut regular = regularity(graph, map, &moving, region)?;
    if regular.is_proved() {
        regular = without_jumps(sign::keeps_sign(graph, node, region)?.finding, region);
    }
    Ok(Some((node, regular)))
}

/// y_i^(k) along the flow for constant inputs, k = 0 … n − 1.
fn derivatives(augmented: &AugmentedPlant<'_>) -> Result<Vec<Vec<Node>>, MissingInput> {
    let n = augmented.states.len();
    let zero = augmented.graph().constant(0.0).node();
    let constant = |input: &lynkeus_model::Variable| {
        let mut jet = vec![zero; n + 1];
        jet[0] = input.node;
        jet
    };
    let constant: Vec<Vec<Node>> = augmented.inputs.iter().map(constant).collect();
    output_derivatives(augmented, &constant, n.saturating_sub(1))
}

/// Whether all of them together are one-to-one on the box.
fn are_one_to_one(
    augmented: &AugmentedPlant<'_>,
    derivatives: &[Vec<Node>],
    known: &[bool],
    together: bool,
    region: &Region,
) -> Result<OneToOne, MissingInput> {
    let map = one_to_one::Map {
        graph: augmented.graph(),
        functions: &derivatives.concat(),
        states: &augmented.symbols(),
        region,
    };
    map.one_to_one(known, together)
}

/// Cells in which the determinant may be zero, and their share of the volume.
fn cells(graph: &Graph, node: Node, region: &Region) -> Result<(Vec<Place>, f64), MissingInput> {
    let region = region.restricted(&graph.symbols_of(&[node]));
    let tape = Tape::new(graph, &region.symbols(), &[node])?;
    let mut bounds = tape.evaluator_in(Intervals);
    let mut may_vanish = |cell: &Cell| {
        let value = bounds.value(cell);
        value.contains_zero() || !value.is_defined()
    };
    let mut open = vec![(region.cell(), 1.0_f64)];
    // the largest cell is halved next, so that the parts are of one size
    while open.len() < CELLS {
        let Some(place) = (0..open.len()).max_by(|&i, &j| open[i].1.total_cmp(&open[j].1)) else {
            break;
        };
        let (cell, share) = open.swap_remove(place);
        let Some(halves) = region.split(&cell) else {
            open.push((cell, share));
            break;
        };
        for half in halves {
            if may_vanish(&half) {
                open.push((half, 0.5 * share));
            }
        }
        if share < 1e-6 {
            break;
        }
    }
    let share = open.iter().map(|(_, share)| share).sum();
    Ok((
        open.iter().map(|(cell, _)| region.named(cell)).collect(),
        share,
    ))
}

/// A constant input that blinds the outputs.
#[derive(Clone, Debug, PartialEq)]
pub struct Blind {
    /// name of the input
    pub input: String,
    /// its value
    pub value: f64,
    /// states that then act on no output, not even through others: two states of the
    /// plant that differ only in these cannot be told apart
    pub hidden: Vec<String>,
    /// two such states, where there is a hidden one: by name, in the box
    pub alike: Option<[Vec<Coordinate>; 2]>,
}

/// Constant inputs, of zero and the ends and middles of their ranges, for which the
/// determinant is zero whatever the state.
fn blind(
    augmented: &AugmentedPlant<'_>,
    node: Node,
    region: &Region,
) -> Result<Vec<Blind>, MissingInput> {
    let graph = augmented.graph();
    let mut found = vec![];
    for input in &augmented.inputs {
        let middle = f64::midpoint(input.min, input.max);
        let middle = if input.integer {
            middle.floor()
        } else {
            middle
        };
        let ends = [0.0, input.min, input.max, middle];
        let inside = |x: &f64| {
            let whole = !input.integer || x.fract() == 0.0;
            x.is_finite() && *x >= input.min && *x <= input.max && whole
        };
        let mut tried: Vec<f64> = vec![];
        for value in ends.into_iter().filter(inside) {
            if tried.contains(&value) {
                continue;
            }
            tried.push(value);
            let fixed = HashMap::from([(input.node, graph.constant(value).node())]);
            let there = graph.substitute(&[node], &fixed)[0];
            if vanishes(graph, there, region)? == Verdict::Proved {
                let hidden = hidden(augmented, &fixed, region)?;
                found.push(Blind {
                    input: input.name.clone(),
                    value,
                    alike: (!hidden.is_empty()).then(|| alike(augmented, &hidden)),
                    hidden,
                });
            }
        }
    }
    Ok(found)
}

/// Two states that differ in the hidden ones only: a quarter and three quarters up
/// their ranges, the others in the middle.
fn alike(augmented: &AugmentedPlant<'_>, hidden: &[String]) -> [Vec<Coordinate>; 2] {
    [0.25, 0.75].map(|share| {
        let value = |v: &lynkeus_model::Variable| {
            let share = if hidden.contains(&v.name) { share } else { 0.5 };
            (v.name.clone(), inside(v.min, v.max, share)).into()
        };
        augmented.states.iter().map(value).collect()
    })
}

/// States from which no path of dependencies leads to an output.
fn hidden(
    augmented: &AugmentedPlant<'_>,
    fixed: &HashMap<Node, Node>,
    region: &Region,
) -> Result<Vec<String>, MissingInput> {
    let graph = augmented.graph();
    let symbols = augmented.symbols();
    let functions = [augmented.output_nodes(), augmented.derivatives.clone()].concat();
    let partials = jacobian_rows(graph, &functions, &symbols);
    let first = augmented.outputs.len();
    let mut seen = vec![false; symbols.len()];
    let mut open: Vec<usize> = (0..first).collect();
    while let Some(row) = open.pop() {
        let function = graph.substitute(&[functions[row]], fixed)[0];
        let jumping = jumping(graph, function);
        for (state, partial) in partials[row].iter().enumerate() {
            if seen[state] {
                continue;
            }
            let there = partial.map(|partial| graph.substitute(&[partial], fixed)[0]);
            let is_still = there.map(|there| vanishes(graph, there, region));
            let moves = is_still
                .transpose()?
                .is_some_and(|verdict| verdict != Verdict::Proved);
            if moves || jumping.contains(&symbols[state]) {
                seen[state] = true;
                open.push(first + state);
            }
        }
    }
    let names = augmented.states.iter().zip(&seen);
    Ok(names
        .filter(|(_, seen)| !**seen)
        .map(|(s, _)| s.name.clone())
        .collect())
}

/// The variables with which a function may jump, which its derivatives do not show.
fn jumping(graph: &Graph, function: Node) -> HashSet<Node> {
    let mut jumps = graph.reachable(&graph.with_residuals(&[function]));
    jumps.retain(|&node| graph.jumps(node));
    graph.symbols_of(&jumps).into_iter().collect()
}

/// States beyond which nothing is tried.
const KNOWN_STATES: usize = 300;
/// Cells examined for the size of a slope.
const SLOPE_CELLS: usize = 400;

/// Per augmented state whether it is known everywhere on the box whatever the inputs do: because alone, beside what is
/// known already, it moves an output or the derivative of a known state, with a slope that never vanishes. The functions
/// are then strictly monotone in it, so that it is known at once and globally: no derivative of an unknown input enters.
/// False says nothing.
///
/// # Errors
/// [`MissingInput`] where the plant has parameters without value.
pub fn determined(augmented: &AugmentedPlant<'_>) -> Result<Vec<bool>, MissingInput> {
    let (graph, region) = (augmented.graph(), augmented.region());
    let mut known = vec![false; augmented.states.len()];
    let Some(slopes) = slopes(augmented, &region)? else {
        return Ok(known);
    };
    let first = augmented.outputs.len();
    // the derivative of an unknown input is no equation
    let mut open: Vec<usize> = (0..first + augmented.plant_states()).collect();
    while graph.spent().is_none() {
        let is_told = |row: usize| row < first || known[row - first];
        let next = one_unknown(&mut open, &slopes, is_told, |j| known[j]);
        let Some((_, j, slope)) = next else { break };
        known[j] = sign::keeps_sign(graph, slope, &region)?.finding.is_proved();
    }
    Ok(known)
}

/// Those of the outputs, then of the derivatives, by the augmented states; none where there are too many states, or
/// where a function jumps: it may take a value twice though its slope has one sign.
fn slopes(
    augmented: &AugmentedPlant<'_>,
    region: &Region,
) -> Result<Option<Jacobian>, MissingInput> {
    if augmented.states.len() > KNOWN_STATES || !augmented.regularity(region)?.is_proved() {
        return Ok(None);
    }
    let functions = [augmented.output_nodes(), augmented.derivatives.clone()].concat();
    let symbols = augmented.symbols();
    Ok(Some(jacobian::forward(
        augmented.graph(),
        &functions,
        &symbols,
    )))
}

/// The first of the open rows that counts and reads one unknown alone, taken out: with the place of that unknown and
/// its slope.
fn one_unknown(
    open: &mut Vec<usize>,
    slopes: &Jacobian,
    counts: impl Fn(usize) -> bool,
    is_known: impl Fn(usize) -> bool,
) -> Option<(usize, usize, Node)> {
    let (place, row, (j, slope)) = open.iter().enumerate().find_map(|(place, &row)| {
        let mut entries = slopes.row(row).filter(|(j, _)| !is_known(*j));
        let only = entries.next().filter(|_| counts(row))?;
        entries.next().is_none().then_some((place, row, only))
    })?;
    open.remove(place);
    Some((row, j, slope))
}

/// Per augmented state how far two of its values can be apart that the same outputs go with, where that is
/// known: zero for those of `known`, what is `given` for some (place, size), and what follows from these by an output,
/// or by the derivative of a known state, along a slope that never vanishes.
///
/// # Errors
/// [`MissingInput`] where the plant has parameters without value.
pub fn uncertain(
    augmented: &AugmentedPlant<'_>,
    known: &[bool],
    given: &[(usize, f64)],
) -> Result<Vec<Option<f64>>, MissingInput> {
    let (graph, region) = (augmented.graph(), augmented.region());
    let mut sizes: Vec<Option<f64>> = known.iter().map(|known| known.then_some(0.0)).collect();
    for &(place, size) in given {
        sizes[place] = sizes[place].or(Some(size).filter(|size| size.is_finite()));
    }
    let Some(slopes) = slopes(augmented, &region)? else {
        return Ok(sizes);
    };
    let first = augmented.outputs.len();
    let mut open: Vec<usize> = (0..first + augmented.plant_states())
        .filter(|&row| row < first || known[row - first])
        .collect();
    while graph.spent().is_none() {
        let next = one_unknown(&mut open, &slopes, |_| true, |j| sizes[j].is_some());
        let Some((row, j, slope)) = next else { break };
        let (least, _) = sign::keeps_sign(graph, slope, &region)?.bounds;
        let mut sum = 0.0;
        for (k, slope) in slopes.row(row).filter(|(k, _)| *k != j) {
            let size = sizes[k].unwrap_or(f64::INFINITY);
            if size > 0.0 {
                sum += size * magnitude_within(graph, slope, &region, SLOPE_CELLS)?.bound;
            }
        }
        sizes[j] = Some(sum / least).filter(|size| size.is_finite());
    }
    Ok(sizes)
}

#[cfg(test)]
mod tests {
    use lynkeus_model::{LoadOptions, Plant};

    use super::*;
    use crate::Sensors;

    fn examined(equations: &str) -> Option<Uniformity> {
        let text = format!(
            "model P
      input Real u(min = -1, max = 1);
      Real a(min = -1, max = 1); Real b(min = -1, max = 2);
      output Real y = a;
    equation
      {equations}
    end P;"
        );
        let plant = Plant::from_modelica(&text, "p.mo", &LoadOptions::default()).unwrap();
        let augmented = AugmentedPlant::new(&plant, &Sensors::default()).unwrap();
        uniformity(&augmented, &determined(&augmented).unwrap()).unwrap()
    }

    #[test]
    fn a_chain_is_seen_for_every_input() {
        let found = examined("der(a) = b + u; der(b) = -sin(a);").unwrap();
        assert_eq!(found.regular.verdict, Verdict::Proved);
        assert!(found.singular.is_empty() && found.blind.is_empty());
    }

    #[test]
    fn an_input_that_blinds_is_named() {
        let found = examined("der(a) = u*b; der(b) = -b;").unwrap();
        assert!(matches!(found.regular.verdict, Verdict::Refuted(_)));
        let [blind] = &found.blind[..] else {
            panic!("{:?}", found.blind)
        };
        assert_eq!((blind.input.as_str(), blind.value), ("u", 0.0));
        assert_eq!(blind.hidden, ["b"]);
        let at = |a: f64, b: f64| vec![("a".to_owned(), a).into(), ("b".to_owned(), b).into()];
        assert_eq!(blind.alike, Some([at(0.0, -0.25), at(0.0, 1.25)]));
    }

    /// At u = 0 the sign of b still shows, and which side of a threshold it is on.
    #[test]
    fn what_a_jump_shows_is_not_hidden() {
        let blind = |jump: &str| {
            let equations = format!("der(a) = u*b + {jump}; der(b) = -b;");
            examined(&equations).unwrap().blind
        };
        for jump in ["sign(b)", "(if b > 0.5 then a else 0)", "floor(b)"] {
            let [blind] = &blind(jump)[..] else {
                panic!("{jump}")
            };
            assert!(blind.hidden.is_empty() && blind.alike.is_none(), "{jump}");
        }
        assert_eq!(blind("sign(a)")[0].hidden, ["b"]);
    }

    /// Nothing but the jump of it is in the second output.
    #[test]
    fn what_another_output_shows_by_a_jump_is_not_hidden() {
        let hidden = |output: &str| {
            let text = format!(
        "model P input Real u(min = -1, max = 1); Real a(min = -1, max = 1); Real b(min = -1, max = 2);
           output Real y = a; output Real z = {output}; equation der(a) = u*b; der(b) = -b; end P;"
    );
            let plant = Plant::from_modelica(&text, "p.mo", &LoadOptions::default()).unwrap();
            let augmented = AugmentedPlant::new(&plant, &Sensors::default()).unwrap();
            let found = uniformity(&augmented, &determined(&augmented).unwrap())
                .unwrap()
                .unwrap();
            found
                .blind
                .into_iter()
                .map(|blind| blind.hidden)
                .collect::<Vec<_>>()
        };
        assert_eq!(hidden("sign(b)"), [Vec::<String>::new()]);
        assert_eq!(hidden("2*a"), [["b"]]);
    }

    /// d/db b² = 2b: zero at b = 0, a third up the side from −1 to 2.
    #[test]
    fn the_singular_set_is_enclosed() {
        let found = examined("der(a) = b^2; der(b) = -b;").unwrap();
        assert!(found.blind.is_empty());
        assert!(found.share < 0.05, "{}", found.share);
        for part in &found.singular {
            let side = part.iter().find(|side| side.name == "b").unwrap();
            assert!(
                side.min <= 0.0 && side.max >= 0.0 && side.max - side.min < 0.1,
                "{part:?}"
            );
        }
    }

    /// The slope of |b| jumps from −1 to 1, that of b·|b| is zero at b = 0.
    #[test]
    fn a_jump_of_the_sensitivity_is_no_singular_point() {
        let found = examined("der(a) = abs(b); der(b) = -b;").unwrap();
        assert!(
            matches!(found.regular.verdict, Verdict::Undecided(_)),
            "{:?}",
            found.regular
        );
        let found = examined("der(a) = abs(b)*b; der(b) = -b;").unwrap();
        assert!(
            matches!(found.regular.verdict, Verdict::Refuted(_)),
            "{:?}",
            found.regular
        );
    }

    #[test]
    fn a_whole_input_blinds_at_whole_values_only() {
        let blind = |factor: &str| {
            let text = format!(
        "model P input Integer s(min = 0, max = 1); Real a(min = -1, max = 1); Real b(min = -1, max = 2); output Real y = a;
         equation der(a) = {factor}*b; der(b) = -b; end P;"
    );
            let plant = Plant::from_modelica(&text, "p.mo", &LoadOptions::default()).unwrap();
            let augmented = AugmentedPlant::new(&plant, &Sensors::default()).unwrap();
            uniformity(&augmented, &determined(&augmented).unwrap())
                .unwrap()
                .unwrap()
        };
        let never = blind("(s - 0.5)");
        assert!(never.blind.is_empty());
        assert!(
            !matches!(never.regular.verdict, Verdict::Refuted(_)),
            "{:?}",
            never.regular
        );
        assert_eq!(blind("s").blind.len(), 1);
    }

    #[test]
    fn what_no_output_shows_has_no_map() {
        assert!(examined("der(a) = -a; der(b) = -b;").is_none());
    }

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
        determined(&AugmentedPlant::new(&plant, &sensors).unwrap()).unwrap()
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
