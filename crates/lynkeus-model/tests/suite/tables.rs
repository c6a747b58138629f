//! `Modelica.Math.Vectors.interpolate`: straight lines, and monotone cubics.

use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Interval, Tape, jacobian};
use lynkeus_model::{Diagnostic, LoadOptions, Plant, Tables};
use proptest::prelude::*;

fn read(x: &str, y: &str, tables: Tables) -> Result<Plant, Diagnostic> {
    let text = format!(
        "model M Real z; equation\nder(z) = Modelica.Math.Vectors.interpolate({{{x}}}, {{{y}}}, z); end M;"
    );
    let options = LoadOptions {
        tables,
        ..LoadOptions::default()
    };
    Plant::from_modelica(&text, "t.mo", &options)
}

/// The table over z, with its slope.
struct Table {
    tape: Tape,
}

impl Table {
    fn new(x: &str, y: &str, tables: Tables) -> Self {
        let plant = read(x, y, tables).unwrap();
        let value = plant.derivatives[0];
        let z = [plant.states[0].node];
        let slope = jacobian::forward(&plant.graph, &[value], &z).get(0, 0);
        let slope = slope.unwrap_or_else(|| plant.graph.constant(0.0).node());
        let tape = Tape::new(&plant.graph, &z, &[value, slope]).unwrap();
        Self { tape }
    }

    fn monotone(x: &[f64], y: &[f64]) -> Self {
        let list = |numbers: &[f64]| numbers.iter().map(f64::to_string).collect::<Vec<_>>();
        Self::new(&list(x).join(", "), &list(y).join(", "), Tables::Monotone)
    }

    /// Value and slope.
    fn at(&self, z: f64) -> [f64; 2] {
        let mut out = [0.0; 2];
        self.tape.evaluator().eval(&[z], &mut out);
        out
    }
}

#[track_caller]
fn near(found: f64, expected: f64) {
    assert!(
        (found - expected).abs() < 1e-14 * expected.abs().max(1.0),
        "{found} for {expected}"
    );
}

/// The cubic worked out by hand: widths 1 and 2, secants 1 and 1/2.
#[test]
fn cubics_by_hand() {
    let table = Table::monotone(&[0.0, 1.0, 3.0], &[0.0, 1.0, 2.0]);
    let slopes = [7.0 / 6.0, 9.0 / 13.0, 1.0 / 6.0];
    for (z, y, slope) in [
        (0.0, 0.0, slopes[0]),
        (1.0, 1.0, slopes[1]),
        (3.0, 2.0, slopes[2]),
        (-1.0, -slopes[0], slopes[0]),
        (5.0, 2.0 + 2.0 * slopes[2], slopes[2]),
        (
            0.5,
            0.5 + (slopes[0] - slopes[1]) / 8.0,
            1.5 - (slopes[0] + slopes[1]) / 4.0,
        ),
        (
            2.0,
            1.5 + (slopes[1] - slopes[2]) / 4.0,
            0.75 - (slopes[1] + slopes[2]) / 4.0,
        ),
    ] {
        let [value, found] = table.at(z);
        near(value, y);
        near(found, slope);
    }
}

/// Where the data turn or rest the slope is 0; at the ends it is held.
#[test]
fn slopes_that_are_held() {
    let first = |y: &[f64; 3]| Table::monotone(&[0.0, 1.0, 2.0], y).at(0.0)[1];
    near(first(&[0.0, 1.0, 5.0]), 0.0);
    near(first(&[0.0, 1.0, -4.0]), 3.0);
    near(first(&[0.0, 1.0, 3.0]), 0.5);
    near(first(&[0.0, 0.0, 3.0]), 0.0);
    let plateau = Table::monotone(&[0.0, 1.0, 2.0, 3.0], &[0.0, 1.0, 1.0, 0.0]);
    for z in [1.0, 1.3, 2.0] {
        near(plateau.at(z)[0], 1.0);
        near(plateau.at(z)[1], 0.0);
    }
    near(plateau.at(0.0)[1], 1.5);
}

#[test]
fn two_points_are_a_line_and_one_a_number() {
    let line = Table::monotone(&[1.0, 3.0], &[5.0, 6.0]);
    near(line.at(7.0)[0], 8.0);
    let number = Table::monotone(&[1.0], &[5.0]);
    assert_eq!(number.at(-3.0), [5.0, 0.0]);
}

/// The default: along the first and the last piece outside, as the Modelica library has it.
#[test]
fn lines_by_default() {
    let table = Table::new("0, 1, 3", "0, 1, 2", Tables::default());
    for (z, y) in [(-1.0, -1.0), (0.5, 0.5), (1.0, 1.0), (2.0, 1.5), (5.0, 3.0)] {
        assert_eq!(table.at(z)[0], y, "{z}");
    }
}

#[test]
fn points_that_do_not_increase_are_refused() {
    for tables in [Tables::Linear, Tables::Monotone] {
        for (x, y, words) in [
            ("0, 2, 1", "1, 2, 3", "must increase: [2] = 2, [3] = 1"),
            ("0, 1, 1", "1, 2, 3", "must increase: [2] = 1, [3] = 1"),
            ("0, 1", "1, 2, 3", "found 2 points and 3 values"),
        ] {
            let refused = read(x, y, tables).unwrap_err();
            assert!(refused.message.contains(words), "{refused}");
            assert_eq!(refused.line, 2);
        }
    }
}

/// Points at random distances with values that rise, rest or fall by random steps.
fn points() -> impl Strategy<Value = (Vec<f64>, Vec<f64>)> {
    let step = prop_oneof![Just(0.0), -3.0..3.0_f64];
    prop::collection::vec((0.01..2.0_f64, step), 3..9).prop_map(|steps| {
        let (mut x, mut y) = (vec![-1.0], vec![0.5]);
        for (i, (width, rise)) in steps.into_iter().enumerate() {
            x.push(x[i] + width);
            y.push(y[i] + rise);
        }
        (x, y)
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]
    #[test]
    fn cubics_stay_between_their_points((x, y) in points()) {
        let table = Table::monotone(&x, &y);
        for i in 0..x.len() - 1 {
            let (low, high) = (y[i].min(y[i + 1]), y[i].max(y[i + 1]));
            let rises = (y[i + 1] - y[i]).signum() * f64::from(u8::from(y[i] != y[i + 1]));
            let [value, slope] = table.at(x[i]);
            prop_assert!((value - y[i]).abs() <= f64::EPSILON * 4.0 * (1.0 + y[i].abs()));
            // one slope from both sides
            let [_, before] = table.at(x[i].next_down());
            prop_assert!((before - slope).abs() < 1e-9 * (1.0 + slope.abs()), "{before} {slope}");
            let mut last = value;
            for k in 0..=16 {
                let z = x[i] + (x[i + 1] - x[i]) * f64::from(k) / 16.0;
                let [value, slope] = table.at(z);
                prop_assert!(low - 1e-12 <= value && value <= high + 1e-12);
                prop_assert!((value - last) * rises >= -1e-12, "{value} after {last}");
                prop_assert!(slope * rises >= -1e-9, "{slope}");
                last = value;
                let cell = [Interval::point(z).inflate(0.01)];
                let bounds = table.tape.eval_in(&Intervals, &cell);
                for member in [cell[0].lo(), z, cell[0].hi()] {
                    let found = table.at(member);
                    prop_assert!(bounds[0].inflate(1e-12).contains(found[0]));
                    prop_assert!(bounds[1].inflate(1e-9).contains(found[1]));
                }
            }
        }
    }
}

/// Limited to its points, a table stays at its last value, and is compared with that.
#[test]
fn the_last_value_is_reached_to_the_bit() {
    let table = Table::new("-1, 0.3, 2", "1, -2, 0.7", Tables::Linear);
    assert_eq!([table.at(-1.0)[0], table.at(2.0)[0]], [1.0, 0.7]);
    let mut seed = 1_u64;
    let mut draw = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (seed >> 40) as f64 / f64::from(1 << 24)
    };
    for count in [2, 3, 4, 9] {
        for _ in 0..100 {
            let mut x = 0.0;
            let points: Vec<(f64, f64)> = (0..count)
                .map(|_| {
                    x += 0.01 + draw();
                    (x, (200.0 * draw() - 100.0).round() / 100.0)
                })
                .collect();
            let list = |numbers: Vec<f64>| {
                let texts: Vec<String> = numbers.iter().map(|x| format!("{x:?}")).collect();
                texts.join(", ")
            };
            let (x, y): (Vec<f64>, Vec<f64>) = points.into_iter().unzip();
            let (end, last) = (x[count - 1], y[count - 1]);
            let table = Table::new(&list(x), &list(y), Tables::Linear);
            assert_eq!(table.at(end)[0], last);
        }
    }
}
