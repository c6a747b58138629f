//! How long a gain stands between two samples.

use nalgebra::DMatrix;

use lynkeus_proof::spectrum::eigenvalues;

pub use switching::Switching;

mod switching;

/// Factor between two intervals that are looked at.
const FINER: f64 = 1.1;
/// Intervals from this one on are looked at, in units of the fastest mode,
const SHORTEST: f64 = 1e-2;
/// up to this one.
const LONGEST: f64 = 1e3;
/// Larger matrices are not looked at.
const LARGEST: usize = 64;
/// The exponential of a matrix takes its tenth power, and does not end where that overflows.
const LARGEST_STEP: f64 = 1e28;
/// How far from 1 a spectral radius is told from it.
const ROUNDING: f64 = 1e-9;

/// The linearised error (e, ε)' = M (e, ε) of an observer with predicted measurements
/// w' = L_f h(x̂), where e = x̂ − x, ε = w − y. A sample sets ε to 0, so that from one to the next
/// e⁺ = Ψ(τ) e with Ψ the upper left block of exp(Mτ), and errors shrink where its spectral
/// radius is below 1. They do with short intervals.
#[derive(Clone, Debug, PartialEq)]
pub struct SampledError {
    M: DMatrix<f64>,
    /// entries of e
    n: usize,
    /// the largest modulus of an eigenvalue without samples
    fastest: f64,
    hold: f64,
}

impl SampledError {
    /// From M, where ε is the last entries, and C = ∂h/∂x̂ by sensor. None where errors do not
    /// shrink with short intervals, and where M is too large or not finite.
    #[must_use]
    pub fn new(M: DMatrix<f64>, C: &DMatrix<f64>) -> Option<Self> {
        let (size, sensors) = (M.nrows(), C.nrows());
        let n = size.checked_sub(sensors).filter(|n| *n > 0)?;
        let is_fit = (M.ncols(), C.ncols()) == (size, n) && M.iter().all(|x| x.is_finite());
        if !is_fit || size > LARGEST {
            return None;
        }
        // K = ∂F/∂w is the upper right block
        let hold = 2.0 / radius(C * M.view((0, n), (n, sensors)))?;
        let fastest = radius(M.view((0, 0), (n, n)).into_owned())?;
        if fastest <= 0.0 || !fastest.is_finite() {
            return None;
        }
        let found = Self {
            M,
            n,
            fastest,
            hold,
        };
        found.shrinks(SHORTEST / fastest).then_some(found)
    }

    /// With held measurements: 2/ρ(CK), in which the estimate has followed a held reading by
    /// 1 − e⁻² = 86 %, so that it runs after the steps that holding makes.
    #[must_use]
    pub fn hold(&self) -> f64 {
        self.hold
    }

    /// With the inter-sample predictor: the first interval at which an error does not shrink from
    /// sample to sample; infinite where none was found up to 1000 times the fastest mode. What is
    /// not below `least` is looked for no further, and told as something not below it.
    #[must_use]
    pub fn predict(&self, least: f64) -> f64 {
        let longest = LONGEST / self.fastest;
        let mut interval = SHORTEST / self.fastest;
        while interval <= longest && interval < least && self.shrinks(interval * FINER) {
            interval *= FINER;
        }
        match interval {
            _ if interval > longest => f64::INFINITY,
            _ if interval >= least => interval,
            _ => between(interval, interval * FINER, |interval| {
                self.shrinks(interval)
            }),
        }
    }

    fn shrinks(&self, interval: f64) -> bool {
        let step = &self.M * interval;
        // also where the flow is not a number: nothing is seen to shrink
        step.amax() < LARGEST_STEP && {
            let flow = step.exp().view((0, 0), (self.n, self.n)).into_owned();
            radius(flow).is_some_and(|radius| radius < 1.0 - ROUNDING)
        }
    }
}

/// Where errors cease to shrink, to 1 %.
fn between(mut shrinking: f64, mut growing: f64, shrinks: impl Fn(f64) -> bool) -> f64 {
    while growing > 1.01 * shrinking {
        let middle = (shrinking * growing).sqrt();
        match shrinks(middle) {
            true => shrinking = middle,
            false => growing = middle,
        }
    }
    shrinking
}

/// The largest modulus of an eigenvalue; none where it cannot be told.
fn radius(matrix: DMatrix<f64>) -> Option<f64> {
    let eigenvalues = eigenvalues(matrix)?;
    Some(eigenvalues.iter().map(|λ| λ.norm()).fold(0.0, f64::max))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The limits: with the predictor, and with held measurements.
    #[derive(Debug, PartialEq)]
    struct Limits {
        predict: f64,
        hold: f64,
    }

    fn limits(M: &DMatrix<f64>, C: &DMatrix<f64>) -> Option<Limits> {
        let found = SampledError::new(M.clone(), C)?;
        Some(Limits {
            predict: found.predict(f64::INFINITY),
            hold: found.hold(),
        })
    }

    /// M for a chain of integrators with gain (θ c₁, θ² c₂, …) from its first state.
    fn chain(θ: f64, c: &[f64]) -> DMatrix<f64> {
        let n = c.len();
        let mut M = DMatrix::zeros(n + 1, n + 1);
        let mut power = 1.0;
        for i in 0..n {
            power *= θ;
            M[(i, 0)] = -power * c[i];
            M[(i, n)] = power * c[i];
            if i + 1 < n {
                M[(i, i + 1)] += 1.0;
            }
        }
        M[(n, 1)] = 1.0;
        M
    }

    /// What shows the first state of n.
    fn first(n: usize) -> DMatrix<f64> {
        DMatrix::identity(1, n)
    }

    fn rows<const N: usize>(rows: [[f64; N]; N]) -> DMatrix<f64> {
        DMatrix::from_row_slice(N, N, rows.as_flattened())
    }

    /// By hand: with q = exp(−2θτ) ≈ 0, Ψ = [[1/4 − θτ/2, τ], [−θ/2, 1]] has determinant 1/4 and
    /// trace 5/4 − θτ/2, which reaches −5/4 at θτ = 5. The chain of three: by SciPy.
    #[test]
    fn a_chain_stands_an_interval_inversely_to_its_gain() {
        for θ in [1.0, 30.0] {
            let two = limits(&chain(θ, &[2.0, 1.0]), &first(2)).unwrap();
            assert!((θ * two.predict - 5.001).abs() < 0.06, "{two:?}");
            // CK = 2θ
            assert!((θ * two.hold - 1.0).abs() < 1e-12, "{two:?}");
            // what is beyond what is asked for is not looked for
            let near = SampledError::new(chain(θ, &[2.0, 1.0]), &first(2)).unwrap();
            assert!((1.0..1.2).contains(&(θ * near.predict(1.0 / θ))));
            assert_eq!(near.predict(6.0 / θ), two.predict);
            let three = limits(&chain(θ, &[3.0, 3.0, 1.0]), &first(3)).unwrap();
            assert!((θ * three.predict - 2.899).abs() < 0.04, "{three:?}");
        }
    }

    /// x' = a x, K = 3: stable plants stand any interval; an unstable one 3.896 at a = 1/2 (SciPy).
    #[test]
    fn what_decays_by_itself_stands_any_interval() {
        let M = |a: f64| rows([[a - 3.0, 3.0], [a, 0.0]]);
        assert_eq!(limits(&M(-0.5), &first(1)).unwrap().predict, f64::INFINITY);
        let unstable = limits(&M(0.5), &first(1)).unwrap().predict;
        assert!((unstable - 3.896).abs() < 0.04, "{unstable}");
    }

    /// A coupling in a unit of which powers overflow: nothing is told, and soon.
    #[test]
    fn a_flow_out_of_range_ends() {
        for size in [1e40, 1e150, 1e300] {
            let M = rows([[-1.0, size, 1.0], [0.0, -1.0, 1.0], [0.0, size, 0.0]]);
            assert_eq!(limits(&M, &first(2)), None);
            let alone = rows([[-1.0, 1.0], [size, 0.0]]);
            assert_eq!(limits(&alone, &first(1)), None);
        }
    }

    #[test]
    fn where_nothing_shrinks_nothing_is_said() {
        // a second state that nobody sees and nothing moves
        let M = rows([[-1.0, 0.0, 1.0], [0.0; 3], [0.0; 3]]);
        assert_eq!(limits(&M, &first(2)), None);
        assert_eq!(
            limits(&rows([[f64::NAN, 0.0], [0.0, 0.0]]), &first(1)),
            None
        );
        assert_eq!(limits(&DMatrix::zeros(0, 0), &DMatrix::zeros(0, 0)), None);
    }
}
