//! Comparison systems of chains: simulated with the worst partials, couplings and
//! disturbances of the set, chosen anew at every step.

use lynkeus_expr::Interval;
use lynkeus_proof::chain::{Chain, Comparison, Disturbance, Slope, ultimate};
use lynkeus_proof::elimination::{Column, positive};
use lynkeus_proof::search::largest;
use lynkeus_proof::{Bounds, lyapunov, matrix, vertices};
use nalgebra::{DMatrix, DVector};

use super::Random;

/// Two chains of two and three states that couple.
struct Plant {
    chains: Vec<Chain>,
    slopes: Vec<Slope>,
    μ: Vec<f64>,
}

/// Places of the chains in the vector of all errors.
const STARTS: [usize; 2] = [0, 2];
const STATES: usize = 5;

fn chain(states: std::ops::Range<usize>, speed: f64, random: &mut Random) -> Option<Chain> {
    let n = states.len();
    let g = [vec![2.0, 1.0], vec![3.0, 3.0, 1.0]][n - 2].clone();
    let spread = random.within(0.0, 0.4);
    let bound = |_| Bounds::from((1.0 - spread, 1.0 + spread));
    let P = lyapunov::of_chain(&g, &vec![1.0; n - 1])?;
    Some(Chain {
        scales: (1..=n)
            .map(|j| Interval::point(speed).powi(j as i32))
            .collect(),
        states: states.collect(),
        speed: Interval::point(speed),
        S: matrix::points(&P),
        g: g.into_iter().map(Interval::point).collect(),
        partials: (1..n).map(bound).collect(),
    })
}

fn plant(random: &mut Random) -> Option<Plant> {
    let speed = random.within(2.0, 20.0);
    let chains = vec![chain(0..2, speed, random)?, chain(2..5, speed, random)?];
    let μ = chains.iter().map(Chain::decay).collect::<Option<_>>()?;
    let mut slope = || {
        let row = random.below(STATES);
        Slope {
            row,
            // as of a plant in triangular form
            column: random.below(row + 1),
            size: random.within(0.0, 1.0),
        }
    };
    let mut slopes: Vec<Slope> = (0..4).map(|_| slope()).collect();
    slopes.sort_by_key(|s| (s.row, s.column));
    slopes.dedup_by_key(|s| (s.row, s.column));
    Some(Plant { chains, slopes, μ })
}

impl Plant {
    /// V and what V' depends on at the error e: Se in the plant's units.
    fn lyapunov(&self, e: &DVector<f64>) -> (f64, DVector<f64>) {
        let mut gradient = DVector::zeros(STATES);
        for (chain, start) in self.chains.iter().zip(STARTS) {
            let n = chain.states.len();
            let s = |j: usize| chain.scales[j].midpoint();
            for i in 0..n {
                let terms = (0..n).map(|j| chain.S[i][j].midpoint() * e[start + j] / s(j));
                gradient[start + i] = terms.sum::<f64>() / s(i);
            }
        }
        (gradient.dot(e), gradient)
    }

    /// The e' of the set for which V grows fastest.
    fn worst(&self, e: &DVector<f64>, outside: &Disturbance<'_>) -> DVector<f64> {
        let (_, gradient) = self.lyapunov(e);
        let mut rate = DVector::zeros(STATES);
        for (i, (chain, start)) in self.chains.iter().zip(STARTS).enumerate() {
            let s = |j: usize| chain.scales[j].midpoint();
            let pushed: f64 = (0..chain.states.len())
                .map(|j| gradient[start + j] * s(j) * chain.g[j].midpoint())
                .sum();
            let along = |a: &[f64]| {
                DVector::from_fn(chain.states.len(), |j, _| {
                    let next = a.get(j).map_or(0.0, |a| a * e[start + j + 1]);
                    let innovation = outside.noise[i] * pushed.signum() - e[start];
                    next + s(j) * chain.g[j].midpoint() * innovation
                })
            };
            let growth = |v: &DVector<f64>| gradient.rows(start, v.len()).dot(v);
            let choices = vertices(&chain.partials).map(|a| along(&a));
            let found = choices
                .max_by(|a, b| growth(a).total_cmp(&growth(b)))
                .unwrap();
            rate.rows_mut(start, found.len()).copy_from(&found);
        }
        for slope in &self.slopes {
            rate[slope.row] += slope.size * e[slope.column].abs() * gradient[slope.row].signum();
        }
        for (i, drift) in outside.drift.iter().enumerate() {
            rate[i] += drift * gradient[i].signum();
        }
        rate
    }
}

#[test]
fn the_decay_of_comparison_systems_stands_the_worst_case() {
    let mut random = Random::new(20);
    let (mut proved, quiet) = (
        0,
        Disturbance {
            drift: &[0.0; STATES],
            noise: &[0.0; 2],
            process: &[0.0; STATES],
        },
    );
    for _ in 0..200 {
        let Some(plant) = plant(&mut random) else {
            continue;
        };
        let comparison = Comparison::new(&plant.chains, &plant.μ, &plant.slopes);
        let σ = comparison.rate();
        assert_eq!(σ.is_some(), comparison.holds());
        let Some(σ) = σ else { continue };
        proved += 1;
        for _ in 0..200 {
            let e = DVector::from_fn(STATES, |i, _| {
                let (chain, j) = if i < 2 { (0, i) } else { (1, i - 2) };
                random.within(-1.0, 1.0) * plant.chains[chain].scales[j].midpoint()
            });
            let (V, gradient) = plant.lyapunov(&e);
            let slope = 2.0 * gradient.dot(&plant.worst(&e, &quiet));
            assert!(
                V > 0.0 && slope <= -2.0 * σ * V * (1.0 - 1e-9),
                "{slope} {V} {σ}"
            );
        }
    }
    assert!(proved >= 50, "{proved} of 200");
}

/// From an error of zero the ultimate bounds hold at all times.
#[test]
fn ultimate_bounds_stand_the_worst_disturbance() {
    let mut random = Random::new(21);
    let mut reached: f64 = 0.0;
    let mut proved = 0;
    for _ in 0..60 {
        let Some(plant) = plant(&mut random) else {
            continue;
        };
        let drift: Vec<f64> = (0..STATES)
            .map(|_| random.unit() * f64::from(u8::from(random.below(2) == 0)))
            .collect();
        let noise = [random.within(0.0, 0.1), 0.0];
        let outside = Disturbance {
            drift: &drift,
            noise: &noise,
            process: &[0.0; STATES],
        };
        let comparison = Comparison::new(&plant.chains, &plant.μ, &plant.slopes);
        let Some(σ) = comparison.rate() else {
            continue;
        };
        let found = ultimate(&plant.chains, σ, &outside).unwrap();
        proved += 1;
        let step = 0.002 / plant.chains[0].speed.midpoint();
        let mut e = DVector::zeros(STATES);
        for _ in 0..20_000 {
            let rate = plant.worst(&e, &outside);
            let half = &e + &rate * (0.5 * step);
            e += plant.worst(&half, &outside) * step;
            for &(state, bound) in &found.states {
                assert!(
                    e[state].abs() <= bound * (1.0 + 1e-3),
                    "{} {bound}",
                    e[state]
                );
                reached = reached.max(e[state].abs() / bound);
            }
            assert!(e.norm() <= found.norm * (1.0 + 1e-3));
        }
    }
    assert!(proved >= 15 && reached > 0.05, "{proved} {reached}");
}

/// Elimination, which long chains need, proves no more than random partials allow.
#[test]
fn eliminated_chains_stand_random_partials() {
    let mut random = Random::new(22);
    for states in [12, 16, 20, 24] {
        let mut draw =
            |size: f64| -> Vec<f64> { (1..states).map(|_| random.within(-size, size)).collect() };
        let (far, near) = (draw(0.15), draw(0.35));
        let column = |j: usize| Column {
            far: Interval::point(far[j]),
            near: Interval::point(near[j]),
            own: Interval::ONE,
        };
        let columns: Vec<Column> = (0..states - 1).map(column).collect();
        let bounds = vec![Bounds::from((1.0, 1.3)); states - 1];
        let proved = |shift: f64| positive(Interval::ONE, &columns, &bounds, shift);
        let found = largest(1.0, proved).unwrap();
        for _ in 0..300 {
            let a: Vec<f64> = (1..states).map(|_| random.of_range(1.0, 1.3)).collect();
            let matrix = DMatrix::from_fn(states, states, |i, j| {
                let (i, j) = (i.min(j), i.max(j));
                match (j, j - i) {
                    (_, 0) if i == 0 => 1.0,
                    (_, 0) => a[j - 1],
                    (_, 1) => -a[j - 1] * near[j - 1],
                    (_, 2) => -a[j - 1] * far[j - 1],
                    _ => 0.0,
                }
            });
            let least = matrix.symmetric_eigenvalues().min();
            assert!(least >= found - 1e-12, "{least} {found}");
        }
    }
}
