//! An attitude from 120° off, beside the filter that somebody writes by hand for this body: rotation matrices, the error
//! a rotation about the body's axes, first-order noise, readings one after the other.

use crate::csv;
use crate::manifold::attitude;

type Vector = [f64; 3];
type Matrix = [Vector; 3];

/// The vectors of the world that the body sees: down, and north with its dip.
const WORLD: [Vector; 2] = [[0.0, 0.0, 1.0], [0.5, 0.0, -0.866]];
const NOISE: f64 = 0.05;
const DENSITIES: [f64; 6] = [1e-4, 1e-4, 1e-4, 1e-6, 1e-6, 1e-6];
const VARIANCES: [f64; 6] = [4.0, 4.0, 4.0, 0.01, 0.01, 0.01];

fn times(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

fn transposed(a: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}

fn cross([x, y, z]: Vector) -> Matrix {
    [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
}

/// Rodrigues' formula.
fn turn(v: Vector) -> Matrix {
    let angle = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let once = cross(v);
    let twice = times(&once, &once);
    let (a, b) = match angle > 1e-8 {
        true => (angle.sin() / angle, (1.0 - angle.cos()) / (angle * angle)),
        false => (1.0, 0.5),
    };
    let unit = |i: usize, j: usize| f64::from(u8::from(i == j));
    std::array::from_fn(|i| std::array::from_fn(|j| unit(i, j) + a * once[i][j] + b * twice[i][j]))
}

fn of_quaternion(q: &[f64]) -> Matrix {
    let [w, x, y, z] = [q[0], q[1], q[2], q[3]];
    [
        [
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y - w * z),
            2.0 * (x * z + w * y),
        ],
        [
            2.0 * (x * y + w * z),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z - w * x),
        ],
        [
            2.0 * (x * z - w * y),
            2.0 * (y * z + w * x),
            1.0 - 2.0 * (x * x + y * y),
        ],
    ]
}

/// The angle between two attitudes.
fn between(a: &Matrix, b: &Matrix) -> f64 {
    let off = times(&transposed(a), b);
    let sine = [
        off[2][1] - off[1][2],
        off[0][2] - off[2][0],
        off[1][0] - off[0][1],
    ];
    let sine = sine.iter().map(|x| x * x).sum::<f64>().sqrt();
    sine.atan2(off[0][0] + off[1][1] + off[2][2] - 1.0)
}

struct ByHand {
    attitude: Matrix,
    offset: Vector,
    p: [[f64; 6]; 6],
}

impl ByHand {
    fn new(attitude: Matrix) -> Self {
        let mut p = [[0.0; 6]; 6];
        (0..6).for_each(|i| p[i][i] = VARIANCES[i]);
        Self {
            attitude,
            offset: [0.0; 3],
            p,
        }
    }

    fn predict(&mut self, h: f64, gyro: &[f64]) {
        let step = std::array::from_fn(|i| (gyro[i] - self.offset[i]) * h);
        let back = transposed(&turn(step));
        self.attitude = times(&self.attitude, &turn(step));
        // δθ' = −ω×δθ − δb
        let carry = |i: usize, j: usize| match (i < 3, j < 3) {
            (true, true) => back[i][j],
            (true, false) => -h * f64::from(u8::from(i + 3 == j)),
            (false, _) => f64::from(u8::from(i == j)),
        };
        let before = self.p;
        let half: [[f64; 6]; 6] = std::array::from_fn(|i| {
            std::array::from_fn(|j| (0..6).map(|k| carry(i, k) * before[k][j]).sum())
        });
        self.p = std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let carried: f64 = (0..6).map(|k| half[i][k] * carry(j, k)).sum();
                carried + if i == j { DENSITIES[i] * h } else { 0.0 }
            })
        });
    }

    fn correct(&mut self, readings: &[f64]) {
        let into = transposed(&self.attitude);
        let mut moved = [0.0; 6];
        for (k, vector) in WORLD.iter().enumerate() {
            let seen: Vector =
                std::array::from_fn(|i| (0..3).map(|j| into[i][j] * vector[j]).sum());
            for (i, slopes) in cross(seen).into_iter().enumerate() {
                let projected: [f64; 6] =
                    std::array::from_fn(|a| (0..3).map(|b| self.p[a][b] * slopes[b]).sum());
                let spread: f64 = (0..3).map(|b| slopes[b] * projected[b]).sum();
                let foreseen: f64 = seen[i] + (0..3).map(|b| slopes[b] * moved[b]).sum::<f64>();
                let gain = projected.map(|x| x / (spread + NOISE * NOISE));
                for a in 0..6 {
                    moved[a] += gain[a] * (readings[3 * k + i] - foreseen);
                    (0..6).for_each(|b| self.p[a][b] -= gain[a] * projected[b]);
                }
            }
        }
        self.attitude = times(&self.attitude, &turn([moved[0], moved[1], moved[2]]));
        (0..3).for_each(|i| self.offset[i] += moved[3 + i]);
    }
}

/// Every filter is at most a tenth worse than the one by hand, over the whole log and over its last half.
#[test]
fn from_far_off_no_filter_is_worse_than_one_by_hand() {
    for seed in 1..=3 {
        let folder = attitude("ekf", "");
        folder.change(
            "s.toml",
            "until = 30",
            &format!("until = 20\nseed = {seed}"),
        );
        let run = folder.run(&[
            "simulate", "s.toml", "-q", "-o", "sim.csv", "--log", "log.csv",
        ]);
        assert_eq!(run.code, 0, "{}", run.err);
        let (header, truth) = csv(&folder.read("sim.csv"));
        let first = header.iter().position(|h| h == "q[1]").unwrap();
        let truth: Vec<Matrix> = truth
            .iter()
            .map(|row| of_quaternion(&row[first..]))
            .collect();
        let (header, log) = csv(&folder.read("log.csv"));
        let column = |name: &str| header.iter().position(|h| h == name).unwrap();
        let (acc, mag, gyro) = (column("acc[1]"), column("mag[1]"), column("w[1]"));
        let mut by_hand = ByHand::new(of_quaternion(&[0.5; 4]));
        assert!((between(&by_hand.attitude, &truth[0]).to_degrees() - 120.0).abs() < 1e-9);
        let mut angles = vec![];
        for (k, row) in log.iter().enumerate() {
            by_hand.correct(&[&row[acc..acc + 3], &row[mag..mag + 3]].concat());
            angles.push(between(&by_hand.attitude, &truth[k]));
            if let Some(next) = log.get(k + 1) {
                by_hand.predict(next[0] - row[0], &row[gyro..gyro + 3]);
            }
        }
        let of = |angles: &[f64]| {
            let rms = |of: &[f64]| (of.iter().map(|x| x * x).sum::<f64>() / of.len() as f64).sqrt();
            [rms(angles), rms(&angles[angles.len() / 2..])]
        };
        let study = folder.read("s.toml");
        for family in [
            "\"ekf\"\niterations = 1",
            "\"ekf\"",
            "\"ukf\"\nalpha = 0.2",
            "\"mhe\"\nhorizon = 3",
        ] {
            folder.write("s.toml", &study.replace("\"ekf\"", family));
            let run = folder.run(&["estimate", "s.toml", "log.csv", "-q", "-o", "out.csv"]);
            assert_eq!(run.code, 0, "{}", run.err);
            let (header, rows) = csv(&folder.read("out.csv"));
            let first = header.iter().position(|h| h == "q[1]_hat").unwrap();
            let own = rows.iter().zip(&truth);
            let own: Vec<f64> = own
                .map(|(row, q)| between(&of_quaternion(&row[first..]), q))
                .collect();
            let (own, other) = (of(&own), of(&angles));
            for (own, other) in own.iter().zip(other) {
                assert!(*own < 1.1 * other, "{seed} {family}: {own} beside {other}");
            }
        }
    }
}
