//! Measured states, the states their equations reveal, the states these reveal, …
//!
//! The form (1) of Farza, M'Saad, Liu and Targui: x = (x¹, …, x^q) with x¹ measured
//! and f^k a function of x¹ … x^{k+1}, where the unknown inputs v enter through
//! factors that are known, f = f̃(u, x) + G(u, s) v (H3). The layers follow from
//! the equations alone: x^{k+1} is what f̃^k reads beyond x¹ … x^k.

use std::collections::HashMap;

use lynkeus_expr::{Node, jacobian};

use crate::chains::{heads, names};
use crate::{AugmentedPlant, Matrix, Misfit};

/// A plant in layers.
#[derive(Clone, Debug)]
pub struct Layers<'p> {
    /// x¹, …, x^q as indices of states; x¹ in the order of the measured outputs
    pub layers: Vec<Vec<usize>>,
    /// f̃, one expression per state of the plant
    pub drift: Vec<Node>,
    /// G, one row per state of the plant, one column per unknown input
    pub factors: Matrix<'p>,
}

/// The layers of a plant with unknown inputs.
///
/// # Errors
/// The first equation that breaks the form, or what is missing.
pub fn find<'p>(augmented: &AugmentedPlant<'p>) -> Result<Layers<'p>, Misfit> {
    let n = augmented.plant_states();
    let m = augmented.states.len() - n;
    if m == 0 {
        return Err(Misfit::NothingUnknown);
    }
    let heads = heads(augmented)?;
    if let Some(&v) = heads.iter().find(|&&head| head >= n) {
        return Err(Misfit::UnknownMeasured(augmented.states[v].name.clone()));
    }
    let factors = factors(augmented, &heads)?;
    let zero = augmented.graph().constant(0.0).node();
    let silent: HashMap<Node, Node> = unknown(augmented).into_iter().map(|v| (v, zero)).collect();
    let drift = augmented
        .graph()
        .substitute(&augmented.derivatives[..n], &silent);
    let layers = layers(augmented, &drift, heads)?;
    let (count, revealed) = (layers[0].len(), layers.get(1).cloned().unwrap_or_default());
    let needed = m + revealed.len().max(1);
    if count < needed {
        return Err(Misfit::FewOutputs {
            count,
            needed,
            unknown: names(augmented, n..n + m),
            revealed: names(augmented, revealed),
        });
    }
    Ok(Layers {
        layers,
        drift,
        factors,
    })
}

fn unknown(augmented: &AugmentedPlant<'_>) -> Vec<Node> {
    augmented.symbols().split_off(augmented.plant_states())
}

/// G = ∂f/∂v, which must be known: no unknown input and no state that is not
/// measured may enter it.
fn factors<'p>(augmented: &AugmentedPlant<'p>, heads: &[usize]) -> Result<Matrix<'p>, Misfit> {
    let (graph, n) = (augmented.graph(), augmented.plant_states());
    let v = unknown(augmented);
    let factors = Matrix::jacobian(graph, &augmented.derivatives[..n], &v);
    let symbols = augmented.symbols();
    for row in 0..n {
        let of = || augmented.states[row].name.clone();
        for (column, input) in augmented.states[n..].iter().enumerate() {
            let factor = factors.get(row, column);
            let reads = factor.map_or(vec![], |g| {
                jacobian::pattern(graph, &[g], &symbols).swap_remove(0)
            });
            let step = factor.is_none() && augmented.pattern[row].contains(&(n + column));
            if step || reads.iter().any(|&i| i >= n) {
                let (of, input) = (of(), input.name.clone());
                return Err(Misfit::Unaffine { of, input });
            }
            let hidden = reads.iter().copied().filter(|i| !heads.contains(i));
            let hidden: Vec<usize> = hidden.collect();
            if !hidden.is_empty() {
                return Err(Misfit::HiddenFactor {
                    of: of(),
                    input: input.name.clone(),
                    reads: names(augmented, hidden),
                });
            }
        }
    }
    Ok(factors)
}

fn layers(
    augmented: &AugmentedPlant<'_>,
    drift: &[Node],
    heads: Vec<usize>,
) -> Result<Vec<Vec<usize>>, Misfit> {
    let n = drift.len();
    let pattern = jacobian::pattern(augmented.graph(), drift, &augmented.symbols()[..n]);
    let mut taken = vec![false; n];
    heads.iter().for_each(|&i| taken[i] = true);
    let mut layers = vec![heads];
    loop {
        let last = &layers[layers.len() - 1];
        let read = |i: &usize| last.iter().any(|&row| pattern[row].contains(i));
        let next: Vec<usize> = (0..n).filter(|i| !taken[*i]).filter(read).collect();
        if next.is_empty() {
            break;
        }
        if next.len() > last.len() {
            return Err(Misfit::LayerGrows {
                layer: names(augmented, last.iter().copied()),
                next: names(augmented, next),
            });
        }
        next.iter().for_each(|&i| taken[i] = true);
        layers.push(next);
    }
    let left: Vec<usize> = (0..n).filter(|&i| !taken[i]).collect();
    match left.is_empty() {
        true => Ok(layers),
        false => Err(Misfit::NotRead(names(augmented, left))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Sensors;
    use lynkeus_model::{LoadOptions, Plant};

    fn found(equations: &str, measured: &[&str]) -> Result<Vec<Vec<usize>>, Misfit> {
        let text = format!(
            "model P input Real v; Real a; Real b; Real c; Real d;
             output Real ya = a; output Real yb = 2*b; output Real yc = c; output Real yd = d;
             equation {equations} end P;"
        );
        let plant = Plant::from_modelica(&text, "p.mo", &LoadOptions::default()).unwrap();
        let sensors = Sensors {
            measured: measured.iter().map(|s| s.to_string()).collect(),
            unknown: vec!["v".into()],
            ..Sensors::default()
        };
        find(&AugmentedPlant::new(&plant, &sensors).unwrap()).map(|l| l.layers)
    }

    #[test]
    fn layers_follow_the_measured_outputs() {
        let form = "der(c) = b*v + a; der(b) = d + v; der(d) = a; der(a) = -d;";
        let layers = found(form, &["yc", "yb", "ya"]).unwrap();
        assert_eq!(layers, [vec![2, 1, 0], vec![3]]);
        let deep = "der(a) = v; der(b) = -a + c; der(c) = a + d; der(d) = c;";
        assert_eq!(
            found(deep, &["yb", "ya"]).unwrap(),
            [vec![1, 0], vec![2], vec![3]]
        );
    }

    #[test]
    fn what_breaks_the_form_is_named() {
        let all = |of: &[&str]| -> Vec<String> { of.iter().map(|&s| s.to_owned()).collect() };
        let (of, input) = ("a".to_owned(), "v".to_owned());
        let cases = [
            (
                "der(a) = v^2 + c; der(b) = v; der(c) = d; der(d) = 0;",
                Misfit::Unaffine {
                    of: of.clone(),
                    input: input.clone(),
                },
            ),
            (
                "der(a) = c*v; der(b) = v + c; der(c) = d; der(d) = 0;",
                Misfit::HiddenFactor {
                    of,
                    input,
                    reads: all(&["c"]),
                },
            ),
            (
                "der(a) = v + c; der(b) = -b; der(c) = -c; der(d) = c;",
                Misfit::NotRead(all(&["d"])),
            ),
            (
                "der(a) = v + c; der(b) = -b + d; der(c) = -c; der(d) = c;",
                Misfit::FewOutputs {
                    count: 2,
                    needed: 3,
                    unknown: all(&["v"]),
                    revealed: all(&["c", "d"]),
                },
            ),
        ];
        for (equations, expected) in cases {
            assert_eq!(found(equations, &["ya", "yb"]), Err(expected));
        }
        let wide = "der(a) = v + c + d; der(b) = v; der(c) = 0; der(d) = 0;";
        let (layer, next) = (all(&["a"]), all(&["c", "d"]));
        assert_eq!(
            found(wide, &["ya"]),
            Err(Misfit::LayerGrows { layer, next })
        );
    }
}
