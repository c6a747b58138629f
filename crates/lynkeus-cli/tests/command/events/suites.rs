//! Models with events as the public suites of flat Modelica have them, beside values that are found otherwise.

use super::column;
use crate::Folder;

/// Simulates a model: its table.
fn simulated(model: &str, simulate: &str) -> String {
    let folder = Folder::empty();
    folder.write("m.mo", model);
    folder.write(
        "s.toml",
        &format!("plant = \"m.mo\"\n[simulate]\n{simulate}"),
    );
    let run = folder.run(&["simulate", "s.toml", "-q", "-o", "sim.csv"]);
    assert_eq!(run.code, 0, "{}", run.err);
    folder.read("sim.csv")
}

fn near(found: &[f64], expected: impl IntoIterator<Item = f64>, most: f64) {
    let expected: Vec<f64> = expected.into_iter().collect();
    assert_eq!(found.len(), expected.len());
    for (k, (found, expected)) in found.iter().zip(expected).enumerate() {
        assert!(
            (found - expected).abs() <= most,
            "row {k}: {found} for {expected}"
        );
    }
}

/// What the clock sets (`WhenEquation`): in the row of the instant what was before it.
#[test]
fn an_instant_is_kept() {
    for method in ["adaptive", "rk4"] {
        let table = simulated(
            "model Instant
  Real begun(start = 0);
  Real x(start = 0);
  output Real y = x;
equation
  der(x) = 1;
  when time >= 0.5 then
    begun = time;
  end when;
end Instant;
",
            &format!("until = 1\noutput_step = 0.125\nmethod = \"{method}\"\n"),
        );
        let expected = [0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.5, 0.5];
        near(&column(&table, "begun"), expected, 0.0);
    }
}

/// A pulse of half a second in each second (`BooleanExpression`), and how long a Boolean has been true
/// (`BrokenWhenCondition`).
#[test]
fn pulses_and_their_lengths() {
    let table = simulated(
        "model Pulse
  discrete Real begun(start = 0);
  discrete Real entered(start = 0);
  Boolean is_up;
  Boolean is_on;
  Real x(start = 0);
  output Real since = if is_on then time - entered else x;
equation
  der(x) = if is_up then 1 else 0;
  when sample(0, 1) then
    begun = time;
  end when;
  is_up = time >= begun and time < begun + 0.5;
  when is_on then
    entered = time;
  end when;
  is_on = x > 0.7;
end Pulse;
",
        "until = 3\noutput_step = 0.125\n",
    );
    let t = column(&table, "t");
    let up = |t: &f64| 0.5 * t.floor() + (t - t.floor()).min(0.5);
    near(&column(&table, "x"), t.iter().map(up), 1e-9);
    // 0.7 is reached 0.2 s into the second pulse
    let entered = t.iter().map(|t| if *t > 1.2 { 1.2 } else { 0.0 });
    near(&column(&table, "entered"), entered, 1e-9);
}

/// A differentiating amplifier with limits and a source that counts its periods (`OpAmpDifferentiator`), of a time
/// constant of 2 µs, beside `amplifier.py`.
#[test]
fn an_amplifier_with_limits_is_that_of_scipy() {
    let table = simulated(
        "model Amplifier
  parameter Real RC = 3.183098861837907e-5*1000;
  Integer count(start = 0);
  discrete Real begun(start = -0.035);
  Real after = time - begun;
  Real source;
  Real node;
  Real v(start = 0);
  output Real out;
equation
  when time >= (pre(count) + 1)*0.1 - 0.035 then
    count = pre(count) + 1;
    begun = time;
  end when;
  source = -5 + (if after < 0.02 then 10*after/0.02 else if after < 0.05 then 10 else if after < 0.07 then 10 - 10*(after - 0.05)/0.02 else 0);
  node = source - v;
  out = max(-15, min(15, -15000*node));
  RC*der(v) = node - out;
end Amplifier;
",
        "until = 0.304\noutput_step = 0.008\nmethod = \"stiff\"\nrtol = 1e-9\n",
    );
    let expected = include_str!("amplifier.csv");
    near(&column(&table, "v"), column(expected, "v"), 2e-6);
}

/// Two diodes in a loop with their resistors, whose Booleans follow from the currents and the currents from them: a
/// rectifier, beside steps of Runge and Kutta over its currents written out.
#[test]
fn diodes_in_a_loop_rectify() {
    let model = "model Rectifier
  Real u(start = 0);
  Real s1;
  Real s2;
  Real i1;
  Real i2;
  Real v1;
  Real v2;
  Boolean off1(start = true);
  Boolean off2(start = true);
  output Real y = u;
equation
  off1 = s1 < 0;
  off2 = s2 < 0;
  v1 = s1*(if off1 then 1 else 1e-5);
  i1 = s1*(if off1 then 1e-5 else 1);
  v2 = s2*(if off2 then 1 else 1e-5);
  i2 = s2*(if off2 then 1e-5 else 1);
  10*sin(6.25*time) - 2*i1 - v1 = u;
  -10*sin(6.25*time) - 2*i2 - v2 = u;
  0.1*der(u) = i1 + i2 - 0.1*u;
end Rectifier;
";
    let current = |over: f64| match over < 0.0 {
        true => 1e-5 * over / (1.0 + 2e-5),
        false => over / (2.0 + 1e-5),
    };
    let slope = |t: f64, u: f64| {
        let e = 10.0 * (6.25 * t).sin();
        10.0 * (current(e - u) + current(-e - u)) - u
    };
    let (steps, mut u, mut expected) = (200_000, 0.0, vec![0.0]);
    let h = 1.0 / f64::from(steps);
    for k in 0..steps {
        let t = h * f64::from(k);
        let a = slope(t, u);
        let b = slope(t + 0.5 * h, u + 0.5 * h * a);
        let c = slope(t + 0.5 * h, u + 0.5 * h * b);
        let d = slope(t + h, u + h * c);
        u += h / 6.0 * (a + 2.0 * b + 2.0 * c + d);
        if (k + 1) % (steps / 20) == 0 {
            expected.push(u);
        }
    }
    for (method, most) in [("adaptive", 1e-6), ("stiff", 1e-6), ("rk4", 1e-3)] {
        let step = if method == "rk4" { "step = 1e-3\n" } else { "" };
        let simulate = format!("until = 1\noutput_step = 0.05\nmethod = \"{method}\"\n{step}");
        let table = simulated(model, &simulate);
        near(&column(&table, "u"), expected.iter().copied(), most);
    }
}

/// A triac of two thyristors whose gates stand behind diodes (`SimpleTriacCircuit`), beside `triac.py`.
#[test]
fn a_triac_is_that_of_scipy() {
    let table = simulated(
        include_str!("triac.mo"),
        "until = 1e-4\noutput_step = 4e-6\nmethod = \"stiff\"\nrtol = 1e-7\n",
    );
    let expected = include_str!("triac.csv");
    near(&column(&table, "i"), column(expected, "i"), 1e-6);
    for control in ["control1", "control2"] {
        near(&column(&table, control), column(expected, control), 1e-6);
    }
}
