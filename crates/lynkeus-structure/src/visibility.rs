//! Which states leave a trace in the measured outputs, at generic points.
//!
//! The derivatives y, y', …, y^(n−1) along the flow are differentiated with
//! respect to the extended state at a few points of the box; a state is visible
//! if it cannot be changed without changing any of them (the observability rank
//! condition of Hermann and Krener 1977). Numerical: it explains why no observer
//! fits, it proves nothing.

use lynkeus_expr::{Jets, MissingInput, Node, Reals, Tape, jacobian};
use nalgebra::{DMatrix, SVD};

use crate::Extended;

/// Points tried.
const POINTS: usize = 5;
/// Singular values below this fraction of the largest count as zero.
const RANK_TOLERANCE: f64 = 1e-10;
/// Components of a unit null vector below this count as zero.
const NULL_TOLERANCE: f64 = 1e-6;

/// For each extended state: is it visible in the measured outputs?
///
/// # Errors
/// [`MissingInput`] where the plant has parameters without value.
pub fn visible(extended: &Extended<'_>) -> Result<Vec<bool>, MissingInput> {
    let system = Variational::new(extended)?;
    let mut best: Option<(usize, Vec<bool>)> = None;
    for point in 0..POINTS {
        // no point shows more than all
        if best.as_ref().is_some_and(|(rank, _)| *rank == system.n) {
            break;
        }
        let matrix = system.observability(point);
        // a decomposition that nobody reads is not worth its time
        if extended.graph().spent().is_some() {
            break;
        }
        let Some(matrix) = matrix else {
            continue;
        };
        let found = judge(matrix);
        if best.as_ref().is_none_or(|(rank, _)| found.0 > *rank) {
            best = Some(found);
        }
    }
    Ok(best.map_or_else(
        || vec![false; extended.states.len()],
        |(_, visible)| visible,
    ))
}

/// (rank, visible) of the observability matrix.
fn judge(matrix: DMatrix<f64>) -> (usize, Vec<bool>) {
    let n = matrix.ncols();
    let svd = SVD::new(matrix, false, true);
    let largest = svd.singular_values.max();
    let Some(v) = svd.v_t else {
        return (0, vec![false; n]);
    };
    let kept: Vec<usize> = (0..v.nrows())
        .filter(|&k| svd.singular_values[k] > RANK_TOLERANCE * largest)
        .collect();
    // e_i lies in the row space iff its projection on it has length one
    let visible = (0..n).map(|i| {
        let inside: f64 = kept.iter().map(|&k| v[(k, i)].powi(2)).sum();
        1.0 - inside < NULL_TOLERANCE
    });
    (kept.len(), visible.collect())
}

/// x' = f, ξ' = (∂f/∂x) ξ, y, η = (∂h/∂x) ξ as one tape.
struct Variational<'e, 'p> {
    extended: &'e Extended<'p>,
    tape: Tape,
    n: usize,
}

impl<'e, 'p> Variational<'e, 'p> {
    fn new(extended: &'e Extended<'p>) -> Result<Self, MissingInput> {
        let graph = extended.graph();
        let x = extended.symbols();
        let ξ: Vec<Node> = extended
            .states
            .iter()
            .map(|s| graph.fresh(format!("variation of {}", s.name)).node())
            .collect();
        let y: Vec<Node> = extended.outputs.iter().map(|o| o.variable.node).collect();
        let along = |functions: &[Node]| -> Vec<Node> {
            let jacobian = jacobian::forward(graph, functions, &x);
            let row = |i: usize| {
                let terms = jacobian
                    .row(i)
                    .map(|(j, d)| graph.expr(d) * graph.expr(ξ[j]));
                terms
                    .reduce(|a, b| a + b)
                    .unwrap_or_else(|| graph.constant(0.0))
                    .node()
            };
            (0..functions.len()).map(row).collect()
        };
        let outputs = [
            &extended.derivatives[..],
            &along(&extended.derivatives),
            &y,
            &along(&y),
        ]
        .concat();
        let known: Vec<Node> = extended.inputs.iter().map(|i| i.node).collect();
        let inputs = [&x[..], &ξ, &known, &[extended.plant.time]].concat();
        let tape = Tape::new(graph, &inputs, &outputs)?;
        Ok(Self {
            extended,
            tape,
            n: x.len(),
        })
    }

    /// Rows: the derivatives of every output, scaled to unit length. None where
    /// the point is outside the domain of the equations.
    fn observability(&self, point: usize) -> Option<DMatrix<f64>> {
        let outputs = self.extended.outputs.len();
        let mut matrix = DMatrix::zeros(self.n * outputs, self.n);
        for direction in 0..self.n {
            let η = self.sensitivity(point, direction);
            for (row, jet) in η.iter().enumerate() {
                for k in 0..self.n {
                    let scale = self.width(direction);
                    matrix[(k * outputs + row, direction)] =
                        scale * jet.get(k).copied().unwrap_or(0.0);
                }
            }
        }
        for mut row in matrix.row_iter_mut() {
            let norm = row.norm();
            if norm > 0.0 {
                row /= norm;
            }
        }
        matrix.iter().all(|x| x.is_finite()).then_some(matrix)
    }

    /// Taylor coefficients of η for ξ(0) = e_direction.
    fn sensitivity(&self, point: usize, direction: usize) -> Vec<Vec<f64>> {
        let n = self.n;
        let mut state: Vec<Vec<f64>> = (0..n).map(|i| vec![self.sample(point, i)]).collect();
        state.extend((0..n).map(|i| vec![f64::from(u8::from(i == direction))]));
        let mut values = vec![];
        for order in 0..n {
            if self.extended.graph().spent().is_some() {
                return vec![];
            }
            let jets = Jets {
                inner: &Reals,
                order,
            };
            let mut inputs = state.clone();
            let known = (0..self.extended.inputs.len()).map(|i| self.input(point, i, order));
            inputs.extend(known);
            inputs.push(vec![0.37 * point as f64, 1.0]);
            inputs.iter_mut().for_each(|jet| jet.truncate(order + 1));
            values = self.tape.eval_in(&jets, &inputs);
            for (jet, f) in state.iter_mut().zip(&values) {
                jet.push(f.get(order).copied().unwrap_or(0.0) / (order + 1) as f64);
            }
        }
        values.split_off(2 * n + self.extended.outputs.len())
    }

    /// Inputs vary: the trace of a state may need them to.
    fn input(&self, point: usize, i: usize, order: usize) -> Vec<f64> {
        let variable = &self.extended.inputs[i];
        let value = inside(variable.min, variable.max, spread(point, 1000 + i));
        let rest = (1..=order).map(|k| spread(point + 17 * k, 2000 + i) - 0.5);
        std::iter::once(value).chain(rest).collect()
    }

    fn sample(&self, point: usize, i: usize) -> f64 {
        let variable = &self.extended.states[i];
        inside(variable.min, variable.max, spread(point, i))
    }

    fn width(&self, i: usize) -> f64 {
        let variable = &self.extended.states[i];
        let width = variable.max - variable.min;
        if width.is_finite() && width > 0.0 {
            width
        } else {
            1.0
        }
    }
}

/// A well-spread number in [0.1, 0.9] for each (point, variable).
pub(crate) fn spread(point: usize, variable: usize) -> f64 {
    let golden = 0.618_033_988_749_894_9;
    let x = (point as f64 + 1.0) * golden + variable as f64 * 0.754_877_666_246_692_7;
    0.1 + 0.8 * x.fract()
}

pub(crate) fn inside(min: f64, max: f64, share: f64) -> f64 {
    match (min.is_finite(), max.is_finite()) {
        (true, true) => min + share * (max - min),
        (true, false) => min + 2.0 * share,
        (false, true) => max - 2.0 * share,
        (false, false) => 2.0 * share,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Sensors;
    use lynkeus_model::{LoadOptions, Plant};

    fn seen(text: &str) -> Vec<bool> {
        let plant = Plant::from_modelica(text, "p.mo", &LoadOptions::default()).unwrap();
        visible(&Extended::new(&plant, &Sensors::default()).unwrap()).unwrap()
    }

    #[test]
    fn a_state_that_no_output_feels_is_invisible() {
        let text = "model U Real a; Real b; Real c; output Real y = a;
          equation der(a) = -a + c; der(b) = a; der(c) = -sin(c); end U;";
        assert_eq!(seen(text), [true, false, true]);
    }

    /// Only the sum of b and c enters: neither is visible, a is.
    #[test]
    fn interchangeable_states_are_invisible() {
        let text = "model S Real a; Real b; Real c; output Real y = a;
          equation der(a) = b + c; der(b) = -b; der(c) = -c; end S;";
        assert_eq!(seen(text), [true, false, false]);
    }

    /// b shows only while the input moves.
    #[test]
    fn an_input_can_make_a_state_visible() {
        let text = "model I input Real u; Real a; Real b; output Real y = a;
          equation der(a) = u*b; der(b) = -b; end I;";
        assert_eq!(seen(text), [true, true]);
    }
}
