//! Random windows of linear plants against an independent, slow and finite method: the bounded least
//! squares problem as one of least distance, by Lawson and Hanson's active sets (*Solving Least Squares
//! Problems*, 1974, chapter 23), in the noises as unknowns, so that states without noise are no
//! exception.

use lynkeus_expr::Graph;
use nalgebra::{DMatrix, DVector};

use crate::filter::root::Factor;
use crate::filter::tests::exact;
use crate::filter::{FilterKind, FilterSettings, Limits, NoisyModel, NoisyPlant, Sensor};
use crate::{Blueprint, Estimator, Level};

/// Xorshift.
struct Random(u64);

impl Random {
    fn uniform(&mut self, low: f64, high: f64) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        low + (high - low) * (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn chance(&mut self, share: f64) -> bool {
        self.uniform(0.0, 1.0) < share
    }

    fn below(&mut self, end: usize) -> usize {
        self.uniform(0.0, end as f64) as usize
    }
}

/// x' = Fx + w, y = Cx + v.
struct Case {
    F: DMatrix<f64>,
    C: DMatrix<f64>,
    densities: Vec<f64>,
    variances: Vec<f64>,
    start: Vec<f64>,
    noise: f64,
    bounds: Vec<Limits>,
    times: Vec<f64>,
    /// NaN where the sensor does not report
    readings: Vec<Vec<f64>>,
}

impl Case {
    fn drawn(seed: u64) -> Self {
        let mut random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
        for _ in 0..20 {
            random.uniform(0.0, 1.0);
        }
        let n = 1 + random.below(5);
        let m = 1 + random.below(2);
        let rows = 2 + random.below(5);
        let mut matrix = |rows, columns, size: f64| {
            DMatrix::from_fn(rows, columns, |_, _| random.uniform(-size, size))
        };
        let (F, C) = (matrix(n, n, 1.5), matrix(m, n, 1.2));
        // now and then a state is moved by no noise, or known at the start
        let sparse = |random: &mut Random, size, share| {
            if random.chance(share) {
                0.0
            } else {
                random.uniform(0.002, size)
            }
        };
        let densities = (0..n).map(|_| sparse(&mut random, 0.1, 0.3)).collect();
        let variances = (0..n).map(|_| sparse(&mut random, 0.6, 0.1)).collect();
        let bounds = (0..n).map(|_| match random.below(6) {
            0 => Limits {
                low: f64::NEG_INFINITY,
                high: random.uniform(0.05, 0.4),
            },
            1 => Limits {
                low: random.uniform(-0.4, -0.05),
                high: f64::INFINITY,
            },
            _ => Limits {
                low: random.uniform(-0.5, -0.02),
                high: random.uniform(0.02, 0.5),
            },
        });
        let bounds: Vec<Limits> = bounds.collect();
        let start = bounds
            .iter()
            .map(|b| random.uniform(b.low.max(-0.4), b.high.min(0.4)));
        let start = start.collect();
        let reading = |random: &mut Random| match random.chance(0.2) {
            true => f64::NAN,
            false => random.uniform(-1.5, 1.5),
        };
        let readings = (0..rows).map(|_| (0..m).map(|_| reading(&mut random)).collect());
        let readings = readings.collect();
        let mut t = 0.0;
        let times = (0..rows).map(|_| {
            t += random.uniform(0.05, 0.6);
            t
        });
        Self {
            times: times.collect(),
            noise: random.uniform(0.02, 0.3),
            F,
            C,
            densities,
            variances,
            start,
            bounds,
            readings,
        }
    }

    fn estimator(&self) -> Estimator {
        let g = Graph::new();
        let n = self.start.len();
        let x: Vec<_> = (0..n).map(|i| g.symbol(&format!("x{i}"))).collect();
        let times = |row: &[f64]| {
            let terms = row.iter().zip(&x);
            terms
                .fold(g.constant(0.0), |sum, (f, x)| sum + *x * *f)
                .node()
        };
        let row =
            |matrix: &DMatrix<f64>, i| -> Vec<f64> { matrix.row(i).iter().copied().collect() };
        let states = x.iter().zip(&self.start).enumerate();
        let model = NoisyModel::new(&NoisyPlant {
            graph: &g,
            time: g.symbol("t").node(),
            states: states
                .map(|(i, (x, start))| (format!("x{i}"), x.node(), *start))
                .collect(),
            derivatives: (0..n).map(|i| times(&row(&self.F, i))).collect(),
            inputs: vec![],
            sensors: (0..self.C.nrows())
                .map(|i| Sensor {
                    name: format!("y{i}"),
                    output: times(&row(&self.C, i)),
                    noise: Level::Absolute(self.noise),
                    limits: None,
                })
                .collect(),
            process_noise: self.densities.clone(),
            initial_variance: self.variances.clone(),
            ranges: self.bounds.clone(),
            confined: None,
            whens: Default::default(),
        });
        let kind = FilterKind::MovingHorizon(20);
        Blueprint::filter(model.unwrap(), FilterSettings::of(kind), exact())
            .estimator()
            .unwrap()
    }

    /// Φ and a root of W over a time (C. Van Loan's exponential).
    fn flow(&self, time: f64) -> (DMatrix<f64>, DMatrix<f64>) {
        let n = self.start.len();
        let mut both = DMatrix::zeros(2 * n, 2 * n);
        both.view_mut((0, 0), (n, n)).copy_from(&(-&self.F * time));
        both.view_mut((n, n), (n, n))
            .copy_from(&(self.F.transpose() * time));
        for (i, q) in self.densities.iter().enumerate() {
            both[(i, n + i)] = q * time;
        }
        let both = both.exp();
        let transition = both.view((n, n), (n, n)).transpose();
        let noise = &transition * both.view((0, n), (n, n));
        let entries: Vec<f64> = (0..n * n)
            .map(|k| 0.5 * (noise[(k / n, k % n)] + noise[(k % n, k / n)]))
            .collect();
        (
            transition,
            DMatrix::from_row_slice(n, n, Factor::default().of(&entries, n)),
        )
    }

    /// The newest of so many rows where the cost of all of them is least; none where no states fit.
    fn least(&self, rows: usize) -> Option<Vec<f64>> {
        let n = self.start.len();
        let size = n * rows;
        // x = about + shape ξ, row by row
        let mut shape = DMatrix::zeros(size, size);
        let mut about = DVector::zeros(size);
        for k in 0..rows {
            let (root, before) = match k.checked_sub(1) {
                None => {
                    let roots = self.variances.iter().map(|v| v.sqrt());
                    about.rows_mut(0, n).copy_from_slice(&self.start);
                    (
                        DMatrix::from_diagonal(&DVector::from_iterator(n, roots)),
                        None,
                    )
                }
                Some(j) => {
                    let (transition, root) = self.flow(self.times[k] - self.times[j]);
                    (root, Some((j, transition)))
                }
            };
            if let Some((j, transition)) = before {
                let carried = &transition * shape.rows(j * n, n);
                shape.rows_mut(k * n, n).copy_from(&carried);
                let moved = &transition * about.rows(j * n, n);
                about.rows_mut(k * n, n).copy_from(&moved);
            }
            shape.view_mut((k * n, k * n), (n, n)).copy_from(&root);
        }
        // ½ξᵀHξ − gᵀξ
        let mut hessian = DMatrix::identity(size, size);
        let mut gradient = DVector::zeros(size);
        for (k, readings) in self.readings[..rows].iter().enumerate() {
            for (i, y) in readings.iter().enumerate().filter(|(_, y)| y.is_finite()) {
                let row = self.C.row(i) * shape.rows(k * n, n) / self.noise;
                let rest = (y - (self.C.row(i) * about.rows(k * n, n))[0]) / self.noise;
                hessian += row.transpose() * &row;
                gradient += row.transpose() * rest;
            }
        }
        // Gξ ≥ h
        let (mut sides, mut ends) = (vec![], vec![]);
        for place in 0..size {
            let Limits { low, high } = self.bounds[place % n];
            for (sign, bound) in [(1.0, low), (-1.0, high)] {
                if bound.is_finite() {
                    sides.push(shape.row(place) * sign);
                    ends.push(sign * (bound - about[place]));
                }
            }
        }
        let G = DMatrix::from_rows(&sides);
        let lower = hessian.cholesky().unwrap().l();
        let free = lower.solve_lower_triangular(&gradient).unwrap();
        // z = Lᵀξ − L⁻¹g
        let across = lower
            .solve_lower_triangular(&G.transpose())
            .unwrap()
            .transpose();
        let ends = DVector::from_vec(ends) - &across * &free;
        let z = least_distance(&across, &ends)?;
        let noises = lower
            .transpose()
            .solve_upper_triangular(&(z + free))
            .unwrap();
        let x = about + shape * noises;
        Some(x.rows(size - n, n).iter().copied().collect())
    }
}

/// The shortest z with Gz ≥ h; none where there is none.
fn least_distance(G: &DMatrix<f64>, h: &DVector<f64>) -> Option<DVector<f64>> {
    let (m, n) = G.shape();
    let mut E = DMatrix::zeros(n + 1, m);
    E.rows_mut(0, n).copy_from(&G.transpose());
    E.row_mut(n).copy_from(&h.transpose());
    let mut f = DVector::zeros(n + 1);
    f[n] = 1.0;
    let u = not_negative(&E, &f);
    let rest = E * u - f;
    (rest.norm() > 1e-9).then(|| -rest.rows(0, n) / rest[n])
}

/// The u ≥ 0 with the least |Eu − f|.
fn not_negative(E: &DMatrix<f64>, f: &DVector<f64>) -> DVector<f64> {
    let m = E.ncols();
    let mut u = DVector::zeros(m);
    let mut used: Vec<usize> = vec![];
    let solve = |used: &[usize]| {
        let columns = E.select_columns(used);
        columns.svd(true, true).solve(f, 1e-13).unwrap()
    };
    for _ in 0..10 * m {
        let pull = E.transpose() * (f - E * &u);
        let free = (0..m).filter(|j| !used.contains(j));
        let Some(best) = free.max_by(|a, b| pull[*a].total_cmp(&pull[*b])) else {
            break;
        };
        if pull[best] <= 1e-12 {
            break;
        }
        used.push(best);
        let mut found = solve(&used);
        while found.iter().any(|v| *v <= 0.0) {
            let shares = used.iter().zip(&found).filter(|(_, v)| **v <= 0.0);
            let share = shares.map(|(j, v)| u[*j] / (u[*j] - v)).fold(1.0, f64::min);
            for (j, v) in used.iter().zip(&found) {
                u[*j] += share * (v - u[*j]);
            }
            used.retain(|j| u[*j] > 1e-14);
            (0..m)
                .filter(|j| !used.contains(j))
                .for_each(|j| u[j] = 0.0);
            if used.is_empty() {
                return u;
            }
            found = solve(&used);
        }
        u.fill(0.0);
        used.iter().zip(&found).for_each(|(j, v)| u[*j] = *v);
    }
    u
}

/// Every window is at its least cost, and inside to the last digit; where no states fit it is told.
#[test]
fn every_window_is_at_its_minimum() {
    let (mut bounded, mut impossible) = (0, 0);
    for seed in 0..250 {
        let case = Case::drawn(seed);
        let mut estimator = case.estimator();
        for (k, (t, readings)) in case.times.iter().zip(&case.readings).enumerate() {
            let found = estimator.push(*t, readings).unwrap().to_vec();
            let all = found.iter().zip(&case.bounds);
            let at = all.clone().filter(|(x, b)| **x == b.low || **x == b.high);
            bounded += usize::from(at.count() > 0);
            assert!(
                all.into_iter().all(|(x, b)| b.low <= *x && *x <= b.high),
                "{seed}, row {k}: {found:?} outside"
            );
            let Some(expected) = case.least(k + 1) else {
                assert!(estimator.health().unsolved > 0, "{seed}, row {k}");
                impossible += 1;
                break;
            };
            assert_eq!(estimator.health().unsolved, 0, "{seed}, row {k}");
            for (x, y) in found.iter().zip(&expected) {
                assert!(
                    (x - y).abs() < 1e-7,
                    "{seed}, row {k}: {found:?} for {expected:?}"
                );
            }
        }
    }
    assert!(bounded > 300 && impossible < 50, "{bounded} {impossible}");
}
