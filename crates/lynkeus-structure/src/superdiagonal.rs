//! The form that is affine block by block, found in the equations.
//!
//! Ltaief et al., eq. (1)–(2): y = F_0(u) x¹ and, for blocks x¹, …, x^q of states,
//! (x^k)' = F_k(u, x¹, …, x^k) x^{k+1} + φ^k(u, x¹, …, x^k).
//!
//! The blocks are determined by the equations. A state of x^{k+1} may appear in
//! block k at the earliest, so it can be no deeper than its distance from the
//! outputs; and a state whose column of F is empty leaves nothing in the Gramian,
//! so some state of block k has to depend on it and it can be no shallower. Hence
//! x¹ are the states in the outputs and x^{k+1} the new ones in the equations of x^k.

use lynkeus_expr::{Graph, Interval, MissingInput, Node, Tape, jacobian};
use lynkeus_proof::matrix::{IntervalMatrix, points, sum};
use nalgebra::DMatrix;

use crate::chains::names;
use crate::rank::gram;
use crate::region::{inside, spread};
use crate::{AugmentedPlant, Finding, Misfit, Point, Reason, Region, Shown, Verdict, sign};

/// One rectangular block: F_k.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Factor {
    /// measured outputs for k = 0, else states: x^k
    pub rows: Vec<usize>,
    /// states: x^{k+1}
    pub columns: Vec<usize>,
    /// (place in `rows`, place in `columns`, expression); others are zero everywhere
    pub entries: Vec<(usize, usize, Node)>,
}

/// A plant in the form (1)–(2).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Superdiagonal {
    /// F_0 = C(u), F_1, …, F_{q−1}
    pub factors: Vec<Factor>,
}

impl Superdiagonal {
    /// The states of x¹, …, x^q, in the order of the columns.
    pub fn blocks(&self) -> impl Iterator<Item = &[usize]> {
        self.factors.iter().map(|factor| &factor.columns[..])
    }

    /// The blocks with their states in the order of declaration, for people.
    pub fn declared(&self) -> impl Iterator<Item = Vec<usize>> {
        self.blocks().map(|block| {
            let mut block = block.to_vec();
            block.sort_unstable();
            block
        })
    }
}

/// Finds the blocks.
///
/// # Errors
/// The first output or equation that breaks the form; the states that no block reaches.
pub fn find(augmented: &AugmentedPlant<'_>) -> Result<Superdiagonal, Misfit> {
    let outputs = augmented.output_nodes();
    let output = |i: usize| (augmented.outputs[i].variable.name.clone(), true);
    let all: Vec<usize> = (0..augmented.states.len()).collect();
    let rows: Vec<usize> = (0..outputs.len()).collect();
    let mut factors = vec![factor(augmented, rows, &outputs, &all, output)?];
    let mut left: Vec<usize> = all;
    loop {
        let block = factors[factors.len() - 1].columns.clone();
        left.retain(|state| !block.contains(state));
        if left.is_empty() {
            arrange(augmented, &mut factors);
            return Ok(Superdiagonal { factors });
        }
        let derivatives: Vec<Node> = block.iter().map(|&i| augmented.derivatives[i]).collect();
        let equation = |i: usize| (augmented.states[block[i]].name.clone(), false);
        let next = factor(augmented, block.clone(), &derivatives, &left, equation)?;
        if next.columns.is_empty() {
            return Err(Misfit::NoWay(names(augmented, left)));
        }
        factors.push(next);
    }
}

/// Orders the columns of each F_k by what the equations make of them at a point of
/// the box, not by declaration: a factor of S, and with it every rounding, is then
/// the same however the states are declared. States that are equal there keep
/// their order.
fn arrange(augmented: &AugmentedPlant<'_>, factors: &mut [Factor]) {
    let Some(values) = at_a_point(augmented, factors) else {
        return;
    };
    let (derivatives, entries) = values.split_at(augmented.states.len());
    let mut entries = entries.iter();
    let mut rows: Vec<usize> = (0..augmented.outputs.len()).collect();
    for factor in factors {
        let mut columns: Vec<Vec<f64>> = vec![vec![]; factor.columns.len()];
        for (&(_, j, _), value) in factor.entries.iter().zip(&mut entries) {
            columns[j].push(value.abs());
        }
        columns.iter_mut().for_each(|c| c.sort_by(f64::total_cmp));
        let size = |j: usize| columns[j].iter().map(|x| x * x).sum::<f64>();
        let slope = |j: usize| derivatives[factor.columns[j]];
        let mut order: Vec<usize> = (0..columns.len()).collect();
        // the most visible state first
        order.sort_by(|&i, &j| {
            let sizes = size(j).total_cmp(&size(i));
            sizes.then(slope(i).total_cmp(&slope(j)))
        });
        factor.permute(&rows, &order);
        rows = order;
    }
}

/// Every derivative, then the entries of every F_k, at one point of the box.
fn at_a_point(augmented: &AugmentedPlant<'_>, factors: &[Factor]) -> Option<Vec<f64>> {
    let entries = factors.iter().flat_map(|f| &f.entries);
    let nodes: Vec<Node> = augmented
        .derivatives
        .iter()
        .copied()
        .chain(entries.map(|&(.., node)| node))
        .collect();
    let states = augmented.states.iter().map(|v| inside(v.min, v.max, 0.37));
    let inputs = augmented.inputs.iter().enumerate();
    let inputs = inputs.map(|(i, v)| inside(v.min, v.max, spread(0, i)));
    let point: Vec<f64> = states.chain(inputs).chain([0.37]).collect();
    let symbols = augmented.region().symbols();
    let tape = Tape::new(augmented.graph(), &symbols, &nodes).ok()?;
    let mut values = vec![0.0; nodes.len()];
    tape.evaluator().eval(&point, &mut values);
    Some(values)
}

/// ∂(functions)/∂x for the states among `candidates` that the functions depend on.
fn factor(
    augmented: &AugmentedPlant<'_>,
    rows: Vec<usize>,
    functions: &[Node],
    candidates: &[usize],
    title: impl Fn(usize) -> (String, bool),
) -> Result<Factor, Misfit> {
    let graph = augmented.graph();
    let symbol = |&i: &usize| augmented.states[i].node;
    let symbols: Vec<Node> = candidates.iter().map(symbol).collect();
    let pattern = jacobian::pattern(graph, functions, &symbols);
    let new = (0..candidates.len()).filter(|j| pattern.iter().any(|row| row.contains(j)));
    let columns: Vec<usize> = new.map(|j| candidates[j]).collect();
    let symbols: Vec<Node> = columns.iter().map(symbol).collect();
    for (i, &function) in functions.iter().enumerate() {
        if let Some((by, expression)) = not_affine(graph, function, &symbols) {
            let (of, is_output) = title(i);
            return Err(Misfit::NotAffine {
                of,
                is_output,
                states: names(augmented, columns),
                by,
                expression,
            });
        }
    }
    let jacobian = jacobian::forward(graph, functions, &symbols);
    Ok(Factor {
        rows,
        columns,
        entries: jacobian.entries,
    })
}

/// What keeps a function from being affine in `symbols`: a slope, behind the symbol that it is by, or a step.
fn not_affine(graph: &Graph, function: Node, symbols: &[Node]) -> Option<(Option<String>, String)> {
    let depends = |node: Node| !jacobian::pattern(graph, &[node], symbols)[0].is_empty();
    let step = |node: &Node| graph.jumps(*node) && depends(*node);
    if let Some(step) = graph.reachable(&[function]).into_iter().find(step) {
        return Some((None, graph.render(step, 60)));
    }
    let slopes = jacobian::forward(graph, &[function], symbols).entries;
    let (_, column, slope) = slopes.into_iter().find(|&(.., slope)| depends(slope))?;
    let by = graph.symbol_name(symbols[column]).unwrap_or_default();
    Some((Some(by), graph.render(slope, 60)))
}

impl Factor {
    /// Row i becomes what was row `rows[i]`, and alike for the columns.
    fn permute(&mut self, rows: &[usize], columns: &[usize]) {
        let place = |order: &[usize], old: usize| order.iter().position(|&o| o == old);
        self.rows = rows.iter().map(|&i| self.rows[i]).collect();
        self.columns = columns.iter().map(|&j| self.columns[j]).collect();
        for (i, j, _) in &mut self.entries {
            *i = place(rows, *i).unwrap_or(*i);
            *j = place(columns, *j).unwrap_or(*j);
        }
        self.entries.sort_unstable();
    }

    /// Has F_k full column rank everywhere on the box? Then x^{k+1} shows in x^k
    /// whatever the input. Refuted, with the direction ξ that F_k ξ = 0 hides,
    /// only where F_k is a matrix of numbers: anything that moves may turn the
    /// hidden direction, and the excitation decides.
    ///
    /// # Errors
    /// [`MissingInput`] where an entry depends on a symbol outside the region.
    pub fn column_rank(
        &self,
        augmented: &AugmentedPlant<'_>,
        k: usize,
        region: &Region,
    ) -> Result<Finding, MissingInput> {
        let graph = augmented.graph();
        let size = (self.rows.len(), self.columns.len());
        let because = |shows: Shown| Reason::Factor { k, size, shows };
        if let Some(F) = self.constant(graph) {
            return Ok(self.constant_rank(augmented, &F, because));
        }
        let entry = |i: usize, j: usize| {
            let found = self.entries.iter().find(|&&(k, l, _)| (k, l) == (i, j));
            found.map(|&(.., node)| node)
        };
        let open = || {
            let entries: Vec<Node> = self.entries.iter().map(|&(.., node)| node).collect();
            let used = region.restricted(&graph.symbols_of(&entries));
            Verdict::Undecided(used.named(&used.cell()))
        };
        let Some(gram) = gram(graph, size, entry) else {
            return Ok(Finding {
                verdict: open(),
                reason: because(Shown::WhileMoving),
            });
        };
        let Finding { verdict, reason } = sign::keeps_sign(graph, gram, region)?.finding;
        Ok(match verdict {
            Verdict::Refuted(witness) => Finding {
                verdict: open(),
                reason: because(Shown::NotAt(witness)),
            },
            verdict => Finding {
                verdict,
                reason: because(Shown::Gram(Box::new(reason))),
            },
        })
    }

    /// The matrix, where all of its entries are numbers.
    fn constant(&self, graph: &Graph) -> Option<DMatrix<f64>> {
        let mut matrix = DMatrix::zeros(self.rows.len(), self.columns.len());
        for &(i, j, node) in &self.entries {
            let value = graph.constant_value(node)?;
            matrix[(i, j)] = Some(value).filter(|x| x.is_finite())?;
        }
        Some(matrix)
    }

    /// [`Factor::column_rank`] of a matrix of numbers.
    fn constant_rank(
        &self,
        augmented: &AugmentedPlant<'_>,
        F: &DMatrix<f64>,
        because: impl Fn(Shown) -> Reason,
    ) -> Finding {
        match kernel(F) {
            (Shown::Always, _) => Finding::proved(because(Shown::Always)),
            (shows, None) => Finding::undecided(because(shows)),
            (shows, Some(ξ)) => {
                let component =
                    |(&i, x): (&usize, f64)| (augmented.states[i].name.clone(), x).into();
                let direction = Point {
                    coordinates: self.columns.iter().zip(ξ).map(component).collect(),
                    value: 0.0,
                };
                Finding::refuted(direction, because(shows))
            }
        }
    }
}

/// Components of a direction are rounded to multiples of its inverse.
const GRID: f64 = 1_048_576.0;
/// Components below this share of the largest are not taken for the unit of a direction.
const SIGNIFICANT: f64 = 1e-6;

/// What a matrix of numbers shows of ξ in F ξ, and where it hides a direction that one, exactly; or one near to it
/// where F is wider than tall.
fn kernel(F: &DMatrix<f64>) -> (Shown, Option<Vec<f64>>) {
    let mut rows = points(F);
    // per column the row of the one that is left there
    let mut pivots: Vec<Option<usize>> = vec![];
    for column in 0..F.ncols() {
        let unused = (0..F.nrows()).filter(|row| !pivots.contains(&Some(*row)));
        let size = |row: usize| rows[row][column].mignitude();
        let largest = unused.max_by(|&i, &j| size(i).total_cmp(&size(j)));
        let pivot = largest.filter(|&row| size(row) > 0.0);
        if let Some(row) = pivot {
            eliminate(&mut rows, row, column);
        }
        pivots.push(pivot);
    }
    if pivots.iter().all(Option::is_some) {
        return (Shown::Always, None);
    }
    let free = (0..F.ncols()).filter(|&column| pivots[column].is_none());
    let directions = free.map(|column| {
        let mut ξ = vec![0.0; F.ncols()];
        ξ[column] = 1.0;
        for (place, row) in pivots.iter().enumerate() {
            if let Some(row) = row {
                ξ[place] = -rows[*row][column].midpoint();
            }
        }
        ξ
    });
    let directions: Vec<Vec<f64>> = directions.collect();
    let exact = directions.iter().find_map(|ξ| exact(F, ξ));
    // more unknowns than equations always leave a direction
    let near = directions
        .into_iter()
        .next()
        .filter(|ξ| F.ncols() > F.nrows() && ξ.iter().all(|x| x.is_finite()));
    match exact.or(near) {
        Some(ξ) => (Shown::Never, Some(ξ)),
        None => (Shown::Unknown, None),
    }
}

/// Divides a row by its pivot and takes it from all others.
fn eliminate(rows: &mut IntervalMatrix, row: usize, column: usize) {
    let lead = rows[row][column];
    let mut top: Vec<Interval> = rows[row].iter().map(|x| *x / lead).collect();
    top[column] = Interval::ONE;
    for (i, other) in rows.iter_mut().enumerate() {
        let factor = other[column];
        if i == row || factor.magnitude() == 0.0 {
            continue;
        }
        for (x, above) in other.iter_mut().zip(&top) {
            *x = *x - factor * *above;
        }
        other[column] = Interval::ZERO;
    }
    rows[row] = top;
}

/// A direction of few digits near to this one that F maps to zero without any rounding.
fn exact(F: &DMatrix<f64>, ξ: &[f64]) -> Option<Vec<f64>> {
    let largest = ξ.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let units = ξ.iter().filter(|x| x.abs() > SIGNIFICANT * largest);
    let rounded = units.map(|unit| ξ.iter().map(move |x| (x / unit * GRID).round() / GRID));
    rounded
        .map(Iterator::collect)
        .find(|ξ: &Vec<f64>| is_mapped_to_zero(F, ξ))
}

fn is_mapped_to_zero(F: &DMatrix<f64>, ξ: &[f64]) -> bool {
    F.row_iter().all(|row| {
        let terms = row.iter().zip(ξ);
        let image = sum(terms.map(|(&f, &ξ)| Interval::point(f) * Interval::point(ξ)));
        image.is_defined() && image.magnitude() == 0.0
    })
}

#[cfg(test)]
mod tests {
    use lynkeus_model::{LoadOptions, Plant};

    use super::*;
    use crate::{Sensors, Verdict};

    fn examined<T>(text: &str, look: impl Fn(&AugmentedPlant<'_>) -> T) -> T {
        let plant = Plant::from_modelica(text, "p.mo", &LoadOptions::default()).unwrap();
        look(&AugmentedPlant::new(&plant, &Sensors::default()).unwrap())
    }

    fn blocks(text: &str) -> Result<Vec<Vec<String>>, Misfit> {
        examined(text, |e| {
            let form = find(e)?;
            Ok(form.declared().map(|block| names(e, block)).collect())
        })
    }

    fn verdicts(text: &str) -> Vec<Verdict> {
        examined(text, |e| {
            let form = find(e).unwrap();
            let check = |(k, f): (usize, &Factor)| f.column_rank(e, k, &e.region()).unwrap();
            let checks = form.factors.iter().enumerate().map(check);
            checks.map(|c| c.verdict).collect()
        })
    }

    #[test]
    fn blocks_are_found_in_any_order() {
        let text = "model P input Real u; Real d; Real a; Real c; Real b; output Real y = 2*a + u;
      equation der(a) = u*b + a^2*c + sin(a); der(b) = b*c*d - c^3; der(c) = d - b; der(d) = d^2; end P;";
        assert_eq!(blocks(text).unwrap(), [&["a"][..], &["c", "b"], &["d"]]);
    }

    #[test]
    fn what_breaks_the_form_is_named() {
        let square =
            "model P Real a; Real b; output Real y = a; equation der(a) = b^2; der(b) = 1; end P;";
        let not_affine = |of: &str, is_output: bool, states: &[&str], by: &str, slope: &str| {
            Err(Misfit::NotAffine {
                of: of.to_owned(),
                is_output,
                states: states.iter().map(|&s| s.to_owned()).collect(),
                by: Some(by.to_owned()),
                expression: slope.to_owned(),
            })
        };
        assert_eq!(blocks(square), not_affine("a", false, &["b"], "b", "b*2"));
        let product = "model P Real a; Real b; Real c; output Real y = a; equation der(a) = b*c; der(b) = 1; der(c) = 1; end P;";
        let found = not_affine("a", false, &["b", "c"], "b", "c");
        assert_eq!(blocks(product), found);
        let output = "model P Real a; output Real y = a^2; equation der(a) = 1; end P;";
        assert_eq!(blocks(output), not_affine("y", true, &["a"], "a", "a*2"));
        let unseen =
            "model P Real a; Real b; output Real y = a; equation der(a) = 1; der(b) = a; end P;";
        assert_eq!(blocks(unseen), Err(Misfit::NoWay(vec!["b".into()])));
        let switch = "model P Real a; Real b; output Real y = a; equation der(a) = b + (if b > 0 then 1 else 2); der(b) = 1; end P;";
        assert!(matches!(
            blocks(switch),
            Err(Misfit::NotAffine { by: None, .. })
        ));
    }

    #[test]
    fn constant_columns_that_coincide_hide_a_direction() {
        let text = "model P Real a; Real b; Real c; output Real y = a; equation der(a) = b + c; der(b) = -b; der(c) = b; end P;";
        let Verdict::Refuted(witness) = &verdicts(text)[1] else {
            panic!()
        };
        let ξ: Vec<f64> = witness.points[0]
            .coordinates
            .iter()
            .map(|c| c.value)
            .collect();
        assert!((ξ[0] + ξ[1]).abs() < 1e-14 && ξ[0].abs() > 0.7);
    }

    /// Two measured states with units far apart, F_1 = diag(1, 1e-14), hide nothing.
    #[test]
    fn units_far_apart_hide_no_direction() {
        let plant = |d: &str| {
            format!(
                "model P Real a; Real b; Real c; Real d; output Real y = a; output Real z = b;
             equation der(a) = c; der(b) = {d}; der(c) = -c; der(d) = -d; end P;"
            )
        };
        for d in ["1e-14*d", "1e-200*d", "2*c + 1e-14*d"] {
            assert_eq!(verdicts(&plant(d))[1], Verdict::Proved, "{d}");
        }
        let dependent =
            "model P Real a; Real b; Real c; Real d; output Real y = a; output Real z = b;
         equation der(a) = 3*c + d; der(b) = 6*c + 2*d; der(c) = -c; der(d) = -d; end P;";
        let Verdict::Refuted(witness) = &verdicts(dependent)[1] else {
            panic!()
        };
        let ξ = |i: usize| witness.points[0].coordinates[i].value;
        assert_eq!(3.0 * ξ(0) + ξ(1), 0.0);
    }

    #[test]
    fn ranks_are_decided_on_the_box() {
        let plant = |low: f64| {
            format!(
            "model P input Real u(min = {low}, max = 3); Real a; Real b; Real c; Real d; output Real y = a; output Real z = b;
             equation der(a) = u*c + d; der(b) = c + 5*d; der(c) = 0; der(d) = 0; end P;"
        )
        };
        // det F_1 = 5u − 1
        let found = verdicts(&plant(0.3));
        assert_eq!(found, [Verdict::Proved, Verdict::Proved]);
        assert!(matches!(verdicts(&plant(0.1))[1], Verdict::Undecided(_)));
        let wide = "model P input Real u; Real a; Real b; Real c; output Real y = a; equation der(a) = b + u*c; der(b) = 0; der(c) = 0; end P;";
        assert!(matches!(verdicts(wide)[1], Verdict::Undecided(_)));
    }

    fn of(rows: usize, columns: usize, entries: &[f64]) -> (Shown, Option<Vec<f64>>) {
        kernel(&DMatrix::from_row_slice(rows, columns, entries))
    }

    #[test]
    fn small_numbers_are_no_zeros() {
        assert_eq!(of(2, 2, &[1.0, 0.0, 0.0, 1e-14]), (Shown::Always, None));
        assert_eq!(of(2, 2, &[1.0, 0.0, 1e10, 1e-300]), (Shown::Always, None));
        assert_eq!(of(3, 1, &[0.0, 0.0, 5e-324]), (Shown::Always, None));
    }

    #[test]
    fn directions_are_exact() {
        assert_eq!(
            of(2, 2, &[3.0, 1.0, 6.0, 2.0]),
            (Shown::Never, Some(vec![1.0, -3.0]))
        );
        assert_eq!(of(2, 1, &[0.0, 0.0]), (Shown::Never, Some(vec![1.0])));
        // a kernel of two directions
        assert_eq!(
            of(3, 3, &[1.0; 9]),
            (Shown::Never, Some(vec![1.0, -1.0, 0.0]))
        );
        // 0.3 is not three times 0.1, and no number of few digits
        assert_eq!(of(2, 2, &[0.1, 0.3, 0.2, 0.6]), (Shown::Unknown, None));
    }

    #[test]
    fn what_is_wider_than_tall_has_a_direction() {
        let (Shown::Never, Some(ξ)) = of(1, 2, &[0.1, 0.3]) else {
            panic!()
        };
        assert!((0.1 * ξ[0] + 0.3 * ξ[1]).abs() < 1e-15 && ξ[1] == 1.0);
    }
}
