//! Lemma 1 for one chain of an observer: does its S satisfy (17), with which ρ, η?

use crate::statement::{proved, refuted, undecided};
use crate::{Check, Hammouri};
use lynkeus_expr::Interval;
use lynkeus_gain::Tridiagonal;
use lynkeus_gain::lemma1::{self, Breaking, Kernel};
use lynkeus_proof::chain::Chain;
use lynkeus_proof::matrix::sum;
use lynkeus_structure::{Coordinate, Point};

use crate::Constant;
use crate::proof::words::shown;

/// What Lemma 1 says of a chain.
pub(super) struct Verified {
    pub check: Check,
    /// AᵀS + SA − ρCᵀC ≤ −μ·diag(S) with ρ = 2r; none where it is not proved
    pub μ: Option<f64>,
    /// S satisfies it for no ρ
    pub broken: bool,
    pub constants: Vec<Constant>,
}

/// Checks (17) with ρ = 2r. `names`: the states of the chain; `suffix` tells the
/// constants of several chains apart.
pub(super) fn verify(
    chain: &Chain,
    S: &Tridiagonal,
    r: f64,
    names: &[String],
    suffix: &str,
) -> Verified {
    let title = Hammouri::Lemma1 {
        states: names.to_vec(),
        ρ: 2.0 * r,
    };
    let open = |check: Check| Verified {
        check,
        μ: None,
        broken: false,
        constants: vec![],
    };
    let bounds = &chain.partials;
    let least = match lemma1::kernel(S, bounds) {
        Ok(Kernel::Holds { ρ }) => ρ,
        Ok(Kernel::Breaks(found)) => {
            let (check, broken) = breaks(title, S, &found, names);
            return Verified {
                broken,
                ..open(check)
            };
        }
        Err(error) => return open(undecided(title, error.to_string())),
    };
    let Some(μ) = chain.decay() else {
        let detail = match 2.0 * r > least {
            true => {
                "it holds in floating point, but with less than the rounding errors to spare".into()
            }
            false => format!(
                "this S satisfies it for ρ > {} only; choose r > {}",
                shown(least),
                shown(least / 2.0)
            ),
        };
        return open(undecided(title, detail));
    };
    let smallest = S.diagonal().iter().copied().fold(f64::INFINITY, f64::min);
    let η = (Interval::point(μ) * Interval::point(smallest)).lo();
    let constants = constants(chain, suffix, [least, 2.0 * r, η, μ]);
    let detail = format!(
        "with η = {}; it holds for every ρ above {}",
        shown(η),
        shown(least)
    );
    Verified {
        check: proved(title, detail),
        μ: Some(μ),
        broken: false,
        constants,
    }
}

fn constants(chain: &Chain, suffix: &str, [least, ρ, η, μ]: [f64; 4]) -> Vec<Constant> {
    let (lower, upper) = chain
        .partials
        .iter()
        .fold((f64::INFINITY, 0.0f64), |(l, u), b| {
            (l.min(b.lower), u.max(b.upper))
        });
    let mut list = vec![];
    let mut add = |name: &str, value: f64, meaning: &str| {
        list.push(Constant::new(format!("{name}{suffix}"), value, meaning));
    };
    if upper > 0.0 {
        add("α1", lower, "lower bound of the partials along the chain");
        add("α2", upper, "upper bound of the partials along the chain");
    }
    add(
        "ρ_min",
        least,
        "Lemma 1 holds for every ρ above it (floating point)",
    );
    add("ρ", ρ, "2r, the ρ of the proof");
    add("η", η, "Lemma 1: AᵀS + SA − ρCᵀC ≤ −ηI");
    add(
        "μ",
        μ,
        "the same weighed by S: AᵀS + SA − ρCᵀC ≤ −μ·diag(S)",
    );
    list
}

/// The refutation, and whether it is one: at a vertex of the bounds, in a direction that C does not see.
fn breaks(title: Hammouri, S: &Tridiagonal, found: &Breaking, names: &[String]) -> (Check, bool) {
    let value = quotient(S, found);
    let direction: Vec<String> = names
        .iter()
        .zip(&found.direction)
        .filter(|(_, v)| v.abs() > 5e-4)
        .map(|(name, v)| format!("{v:+.3}·{name}"))
        .collect();
    let direction = direction.join(" ");
    let size = shown(found.eigenvalue);
    if !value.is_positive() {
        let detail = format!(
            "in the direction {direction}, which the sensor does not see, AᵀS + SA is {size} whatever ρ is, too near to zero for rounding errors to tell its sign (a_j: the partials along the chain)"
        );
        return (undecided(title, detail), false);
    }
    let detail = format!(
        "this S satisfies it for no ρ: in the direction {direction}, which the sensor does not see, AᵀS + SA is +{size} there (a_j: the partials along the chain), whatever ρ is"
    );
    let name = |j: usize| format!("a{}", j + 1);
    let coordinates = found.a.iter().enumerate().map(|(j, &a)| (name(j), a));
    let point = Point {
        coordinates: coordinates.map(Coordinate::from).collect(),
        value: found.eigenvalue,
    };
    (refuted(title, point, detail), true)
}

/// vᵀ(AᵀS + SA)v, rounding included: a proof that the form is positive somewhere.
fn quotient(S: &Tridiagonal, found: &Breaking) -> Interval {
    let v = |i: usize| Interval::point(found.direction[i]);
    let n = S.size();
    let pairs = (0..n).flat_map(|i| (1..n).map(move |j| (i, j)));
    let terms = pairs.map(|(i, j)| {
        let SA = Interval::point(S.get(i, j - 1)) * Interval::point(found.a[j - 1]);
        Interval::point(2.0) * v(i) * SA * v(j)
    });
    sum(terms)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lynkeus_structure::Verdict;

    fn title() -> Hammouri {
        Hammouri::Lemma1 {
            states: vec!["x".into(), "z".into()],
            ρ: 2.0,
        }
    }

    #[test]
    fn a_matrix_that_overflows_is_no_refutation() {
        let S = Tridiagonal::new(vec![1.0, 1e300], vec![-1e100]).unwrap();
        let chain = Chain {
            states: vec![0, 1],
            speed: Interval::ONE,
            scales: vec![Interval::ONE; 2],
            S: vec![
                vec![Interval::ONE, Interval::point(-1e100)],
                vec![Interval::point(-1e100), Interval::point(1e300)],
            ],
            g: vec![Interval::ONE; 2],
            partials: vec![(1e250, 1e250).into()],
        };
        let found = verify(&chain, &S, 1.0, &["x".into(), "z".into()], "");
        assert!(!found.broken && found.μ.is_none());
        assert!(matches!(found.check.verdict, Verdict::Undecided(_)));
        assert!(
            found.check.detail.contains("no value"),
            "{}",
            found.check.detail
        );
    }

    /// AᵀS + SA = 0 on the kernel of C: that rounding does not tell its sign says nothing of ρ.
    #[test]
    fn what_rounding_hides_is_no_refutation() {
        let S = Tridiagonal::new(vec![1.0, 3.0], vec![0.0]).unwrap();
        for eigenvalue in [0.0, -1e-17] {
            let found = Breaking {
                a: vec![1.0],
                eigenvalue,
                direction: vec![0.0, 1.0],
            };
            let (check, is_refuted) = breaks(title(), &S, &found, &["x".into(), "z".into()]);
            assert!(!is_refuted && matches!(check.verdict, Verdict::Undecided(_)));
            let said = &check.detail;
            assert!(!said.contains("for no ρ") && !said.contains("+-"), "{said}");
        }
    }
}
