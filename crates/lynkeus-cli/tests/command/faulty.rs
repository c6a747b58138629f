//! What real logs have, for a family with a theorem and for a filter: how much worse the
//! estimate is than on the clean log.

use std::fs;

use crate::{Folder, csv};

const PLANT: &str = "
model Cart
  input Real u(start = 0, min = -5, max = 5);
  Real x(start = 0, min = -5, max = 5);
  Real v(start = 0, min = -5, max = 5);
  output Real y = x;
equation
  der(x) = v;
  der(v) = u - x - 0.4*v - 0.1*x^3;
end Cart;
";

const OBSERVERS: [(&str, &str); 2] = [
    (
        "triangular",
        "[observer]\nfamily = \"triangular\"\ntheta = 2",
    ),
    (
        "ekf",
        "[observer]\nfamily = \"ekf\"\ngate = 5\ninitial_variance = { default = 0.1 }\n[process_noise]\nv = 1e-3",
    ),
];

const ROWS: usize = 600;
const STEP: f64 = 0.05;

fn u(t: f64) -> f64 {
    (0.7 * t).sin() + 0.5 * (1.9 * t).cos()
}

/// The cart's course at the times of the rows, by small Runge–Kutta steps.
fn truth() -> Vec<[f64; 2]> {
    let f = |t: f64, [x, v]: [f64; 2]| [v, u(t) - x - 0.4 * v - 0.1 * x.powi(3)];
    let mut s = [0.0, 0.0];
    let mut rows = vec![s];
    let h = STEP / 20.0;
    for k in 0..20 * (ROWS - 1) {
        let t = h * k as f64;
        let plus = |a: [f64; 2], b: [f64; 2], c: f64| [a[0] + c * b[0], a[1] + c * b[1]];
        let k1 = f(t, s);
        let k2 = f(t + h / 2.0, plus(s, k1, h / 2.0));
        let k3 = f(t + h / 2.0, plus(s, k2, h / 2.0));
        let k4 = f(t + h, plus(s, k3, h));
        for i in 0..2 {
            s[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
        }
        if k % 20 == 19 {
            rows.push(s);
        }
    }
    rows
}

/// Uniform numbers that are the same in every run.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// A row of a log: time, reading, input, as text.
type Line = (String, String, String);

/// The clean log, noise of ±0.01.
fn clean(truth: &[[f64; 2]]) -> Vec<Line> {
    let mut numbers = Numbers(5);
    let line = |(k, s): (usize, &[f64; 2])| {
        let t = STEP * k as f64;
        let noise = 0.02 * (numbers.next() - 0.5);
        (t.to_string(), (s[0] + noise).to_string(), u(t).to_string())
    };
    truth.iter().enumerate().map(line).collect()
}

/// Root mean square errors of x and v from t = 8 on, and the message.
fn error(observer: &str, lines: &[Line], truth: &[[f64; 2]]) -> Result<[f64; 2], String> {
    let folder = Folder::empty();
    folder.write("cart.mo", PLANT);
    let study = format!("plant = \"cart.mo\"\n[sensors]\nnoise = {{ y = 0.006 }}\n{observer}\n");
    folder.write("s.toml", &study);
    let mut log = "t,y,u\n".to_owned();
    for (t, y, u) in lines {
        log += &format!("{t},{y},{u}\n");
    }
    fs::write(folder.path.path().join("log.csv"), log).unwrap();
    let ended = folder.run(&["estimate", "s.toml", "log.csv"]);
    if ended.code != 0 {
        return Err(ended.err);
    }
    let (_, rows) = csv(&ended.out);
    let settled: Vec<&Vec<f64>> = rows.iter().filter(|row| row[0] >= 8.0).collect();
    let of = |i: usize| {
        let off = |row: &&Vec<f64>| {
            // between rows of the clean log the cart hardly moves
            let k = (row[0] / STEP).round() as usize;
            (row[1 + i] - truth[k.min(ROWS - 1)][i]).powi(2)
        };
        (settled.iter().map(off).sum::<f64>() / settled.len() as f64).sqrt()
    };
    Ok([of(0), of(1)])
}

/// Fault, what it does to the log, and how many times the clean error of v it may cost: first
/// the family with a theorem, then the filter.
type Fault = (&'static str, fn(Vec<Line>) -> Vec<Line>, [f64; 2]);

fn each(lines: Vec<Line>, change: impl Fn(usize, &mut Line, &mut Numbers)) -> Vec<Line> {
    let mut numbers = Numbers(77);
    let mut lines = lines;
    for (k, line) in lines.iter_mut().enumerate().skip(1) {
        change(k, line, &mut numbers);
    }
    lines
}

const FAULTS: [Fault; 11] = [
    (
        "10 % missing",
        |l| {
            each(l, |_, line, n| {
                if n.next() < 0.1 {
                    line.1.clear()
                }
            })
        },
        [1.2, 1.15],
    ),
    (
        "50 % missing",
        |l| {
            each(l, |_, line, n| {
                if n.next() < 0.5 {
                    line.1.clear()
                }
            })
        },
        [1.6, 1.35],
    ),
    (
        "one reading in 60",
        |l| {
            each(l, |k, line, _| {
                if k % 60 != 0 {
                    line.1.clear()
                }
            })
        },
        [2.2, 2.6],
    ),
    (
        "uneven rows",
        |l| {
            l.into_iter()
                .enumerate()
                .filter(|(k, _)| k % 7 != 3 && k % 5 != 1)
                .map(|(_, l)| l)
                .collect()
        },
        [2.1, 1.7],
    ),
    (
        "late rows",
        |mut l| {
            (20..ROWS - 5).step_by(37).for_each(|k| l.swap(k, k + 3));
            l
        },
        [1.01, 1.01],
    ),
    (
        "repeated rows",
        |l| {
            l.into_iter()
                .enumerate()
                .flat_map(|(k, l)| vec![l; 1 + usize::from(k % 9 == 2)])
                .collect()
        },
        [1.01, 1.01],
    ),
    (
        "NaN, infinities, words",
        |l| {
            each(l, |k, line, _| match k % 40 {
                5 => line.1 = "NaN".into(),
                15 => line.1 = "inf".into(),
                25 => line.1 = "-inf".into(),
                35 => line.1 = "Bad".into(),
                _ => {}
            })
        },
        [1.2, 1.2],
    ),
    (
        "frozen for 2 s",
        |l| {
            let hung = l[300].1.clone();
            each(l, move |k, line, _| {
                if (300..340).contains(&k) {
                    line.1 = hung.clone()
                }
            })
        },
        [14.0, 1.15],
    ),
    (
        "5 % outliers of ±3",
        |l| {
            each(l, |_, line, n| {
                if n.next() < 0.05 {
                    line.1 = "3".into()
                }
            })
        },
        [27.0, 1.15],
    ),
    (
        "clipped at 0.8",
        |l| {
            each(l, |_, line, _| {
                let y: f64 = line.1.parse().unwrap();
                line.1 = y.min(0.8).to_string()
            })
        },
        [17.0, 3.2],
    ),
    (
        "an input missing 20 %",
        |l| {
            each(l, |_, line, n| {
                if n.next() < 0.2 {
                    line.2.clear()
                }
            })
        },
        [1.3, 1.5],
    ),
];

/// Observers and faults that they cannot cope with, and say so: one with a theorem has no gate and follows every
/// outlier, and a sensor that hangs; one whose `limits` nobody declares hangs at 0.8.
const NOT_CREDIBLE: [(&str, &str, &str); 4] = [
    ("triangular", "frozen for 2 s", "the innovations of y"),
    ("triangular", "5 % outliers of ±3", "the innovations of y"),
    ("triangular", "clipped at 0.8", "the innovations of y"),
    ("ekf", "clipped at 0.8", "y is frozen in"),
];

fn is_not_credible(name: &str, fault: &str, message: &str) -> bool {
    let own = NOT_CREDIBLE.iter().find(|c| (c.0, c.1) == (name, fault));
    own.is_some_and(|c| message.contains(&format!("the estimate is not credible: {}", c.2)))
}

#[test]
fn faulty_logs_cost_what_they_must() {
    let truth = truth();
    let lines = clean(&truth);
    let mut table = String::new();
    let (mut failed, mut told) = (vec![], 0);
    for (name, observer) in OBSERVERS {
        let base = error(observer, &lines, &truth).unwrap();
        table += &format!("{name}: clean {base:?}\n");
        for (fault, change, most) in FAULTS {
            let limit = most[usize::from(name == "ekf")];
            match error(observer, &change(lines.clone()), &truth) {
                Ok(found) => {
                    let times = found[1] / base[1];
                    table += &format!("{name}, {fault}: {times:.2} times the error of v\n");
                    if times > limit {
                        failed.push(format!("{name}, {fault}: {times:.2} > {limit}"));
                    }
                }
                Err(message) if is_not_credible(name, fault, &message) => {
                    table += &format!("{name}, {fault}: not credible\n");
                    told += 1;
                }
                Err(message) => failed.push(format!("{name}, {fault}: {message}")),
            }
        }
    }
    assert!(failed.is_empty(), "{failed:#?}\n{table}");
    assert_eq!(told, NOT_CREDIBLE.len(), "{table}");
    println!("{table}");
}

/// Which faults hang a sensor, and when.
#[test]
fn a_frozen_sensor_is_told_and_nothing_else_is() {
    let truth = truth();
    let lines = clean(&truth);
    for (fault, change, _) in FAULTS {
        let folder = Folder::empty();
        folder.write("cart.mo", PLANT);
        let study = format!("plant = \"cart.mo\"\n{}\n[sensors]\n", OBSERVERS[0].1);
        folder.write("s.toml", &study);
        let rows = change(lines.clone()).into_iter();
        let rows: String = rows.map(|(t, y, u)| format!("{t},{y},{u}\n")).collect();
        folder.write("log.csv", &format!("t,y,u\n{rows}"));
        let ended = folder.run(&["estimate", "s.toml", "log.csv", "--json"]);
        let found = ended.json()["frozen"].as_array().unwrap().clone();
        match fault {
            // 40 rows hang, from 300 on; the row before them is the clean 299
            "frozen for 2 s" => {
                assert_eq!(found.len(), 1, "{found:?}");
                assert_eq!(
                    (&found[0]["output"], &found[0]["rows"]),
                    (&"y".into(), &40.into())
                );
                let from = found[0]["from"].as_f64().unwrap();
                assert!((from - 300.0 * STEP).abs() < 1e-9, "{from}");
                assert!(
                    ended.err.contains("the sensor y is frozen at"),
                    "{}",
                    ended.err
                );
            }
            "clipped at 0.8" => {
                assert!(
                    found
                        .iter()
                        .all(|f| f["at_end_of_range"] == true && f["value"] == 0.8)
                );
                assert!(!found.is_empty());
            }
            _ => assert!(found.is_empty(), "{fault}: {found:?}"),
        }
    }
}

/// A reading of 1e300 is no estimate of anything, and ends no run of a filter with a gate.
#[test]
fn a_reading_beyond_reason_is_told() {
    let truth = truth();
    let change = |l| {
        each(l, |k, line, _| {
            if k == 200 {
                line.1 = "1e300".into()
            }
        })
    };
    let lines = change(clean(&truth));
    assert!(error(OBSERVERS[1].1, &lines, &truth).is_ok());
    let told = error(OBSERVERS[0].1, &lines, &truth).unwrap_err();
    assert!(told.contains("error: "), "{told}");
}
