//! Plants whose state jumps, in every language: events are found where `estimate` finds them, and the covariance jumps
//! as its does.

use super::{has, look, rust};
use crate::{Folder, skipped};

/// A ball that is thrown up again, whose rebounds are counted and whose speed is sampled.
const BALL: &str = "model Ball
  Real h(start = 1); Real v(start = 0);
  input Real u(start = 0);
  discrete Integer n(start = 0);
  discrete Real seen(start = 0);
  output Real y = h;
equation
  der(h) = v;
  der(v) = u - 9.81 - 0.1*v;
  when h <= 0 then
    reinit(v, 0.5 - 0.7*pre(v));
    n = pre(n) + 1;
  end when;
  when sample(0.1, 0.17) then
    seen = v;
  end when;
end Ball;
";

/// A room whose heater has a hysteresis, a mode that another condition reads, and a vent that opens with the clock.
const ROOM: &str = "model Room
  Real T(start = 18); Real wall(start = 16);
  Boolean on(start = true);
  Boolean vent(start = false);
  discrete Real last(start = 0);
  output Real y = T;
equation
  der(T) = (if on then 3 else 0) - 0.4*(T - wall) - (if vent then 1.5 else 0);
  der(wall) = 0.1*(T - wall) - 0.05*(wall - 10);
  when T >= 21 then
    on = false;
  elsewhen T <= 19 then
    on = true;
  end when;
  when edge(on) then
    last = T;
  end when;
  when sample(1, 1.5) then
    vent = not pre(vent);
  end when;
end Room;
";

/// Angles with events: a wheel that is kicked at the top, seen by an encoder that comes round.
const WHEEL: &str = "model Wheel
  Real phi(start = 0.3, min = -3.14159, max = 3.14159); Real w(start = 5);
  discrete Integer kicks(start = 0);
  output Real y = phi;
equation
  der(phi) = w;
  der(w) = -0.8*w;
  when w <= 3 then
    reinit(w, pre(w) + 1);
    kicks = pre(kicks) + 1;
  end when;
end Wheel;
";

/// A ramp whose laps end at rows, and a clock that beats there.
const RAMP: &str = "model Ramp
  Real x(start = 0);
  discrete Integer n(start = 0); discrete Real beat(start = 0);
  output Real y = x;
equation
  der(x) = 1;
  when x >= 0.75 then
    reinit(x, 0);
    n = pre(n) + 1;
  end when;
  when sample(0, 0.5) then
    beat = x;
  end when;
end Ramp;
";

fn study(family: &str, sections: &str, step: &str) -> String {
    format!(
        "plant = \"m.mo\"\n{sections}[observer]\nfamily = \"{family}\"\ngate = 6\n[estimate]\nmethod = \"rk4\"\n{step}\nsd = true\n"
    )
}

fn folder(model: &str, study: &str, log: &str) -> Folder {
    let folder = Folder::empty();
    folder.write("m.mo", model);
    folder.write("s.toml", study);
    folder.write("log.csv", log);
    folder
}

fn ball(family: &str, noise: &str, step: &str) -> Folder {
    let rows = (0..60).map(|k| {
        let t = 0.05 * f64::from(k);
        let y = match k % 7 {
            3 => String::new(),
            _ => format!("{:.3}", (0.9 - 0.2 * t) * (3.1 * t).cos().abs()),
        };
        format!("{t:.2},{y},{:.2}\n", 0.3 * (2.0 * t).sin())
    });
    let sections = format!("[sensors]\nnoise = {{ y = 0.05 }}\n{noise}");
    folder(
        BALL,
        &study(family, &sections, step),
        &format!("t,y,u\n{}", rows.collect::<String>()),
    )
}

fn room(family: &str, step: &str) -> Folder {
    let rows = (0..80).map(|k| {
        let t = 0.1 * f64::from(k);
        format!("{t:.1},{:.3}\n", 20.0 - 2.0 * (1.3 * t).cos())
    });
    let sections = "[sensors]\nnoise = { y = 0.2 }\n[process_noise]\nT = 0.02\nwall = 0.01\n";
    folder(
        ROOM,
        &study(family, sections, step),
        &format!("t,y\n{}", rows.collect::<String>()),
    )
}

fn wheel(family: &str) -> Folder {
    let rows = (0..80).map(|k| {
        let t = 0.1 * f64::from(k);
        let phi = 0.2 + 3.3 * t + 0.3 * (0.7 * t).sin();
        let turn = std::f64::consts::TAU;
        format!("{t:.1},{:.4}\n", phi - turn * (phi / turn + 0.5).floor())
    });
    let sections = "[manifold]\ncircle = [\"phi\"]\n[sensors]\nnoise = { y = 0.05 }\n[process_noise]\nw = 0.1\n";
    folder(
        WHEEL,
        &study(family, sections, "substeps = 4"),
        &format!("t,y\n{}", rows.collect::<String>()),
    )
}

/// What is read at the level itself moves the estimate beyond it, back, or leaves it there.
fn ramp(family: &str, step: &str) -> Folder {
    let rows = (0..40).map(|k: u32| {
        let t = 0.25 * f64::from(k);
        let level = t - 0.75 * f64::from(k.saturating_sub(1) / 3);
        let y = match k % 9 {
            3 | 6 => format!("{}", level + 0.04 * (1.7 * t).sin()),
            7 => format!("{level}"),
            _ => String::new(),
        };
        format!("{t},{y}\n")
    });
    let sections = "[sensors]\nnoise = { y = 0.05 }\n[process_noise]\nx = 0\n";
    folder(
        RAMP,
        &study(family, sections, step),
        &format!("t,y\n{}", rows.collect::<String>()),
    )
}

#[test]
fn events_are_those_of_estimate() {
    if !has("gcc") {
        return skipped("gcc is not there");
    }
    let [wandering, exact] = ["0.2", "0"].map(|q| format!("[process_noise]\nv = {q}\n"));
    let folders = [
        ball("ekf", &wandering, "substeps = 3"),
        ball("ekf", &exact, "step = 0.03"),
        ball("ukf", &wandering, "substeps = 2"),
        ball("ukf", &exact, "step = 0.04"),
        room("ekf", "step = 0.03"),
        room("ukf", "substeps = 3"),
        wheel("ekf"),
        wheel("ukf"),
        ramp("ekf", "step = 0.0625"),
        ramp("ukf", "step = 0.0625"),
    ];
    let looked = (0..).zip(folders).map(|(seed, folder)| {
        let looked = look(seed, folder).unwrap();
        let (header, rows, is_whole) = &looked.expected;
        assert!(*is_whole, "seed {seed}");
        let last = |name: &str| {
            let place = header.iter().position(|h| h == name);
            place.map(|place| rows.last().unwrap()[place])
        };
        let count = last("n_hat").or(last("kicks_hat"));
        assert!(
            count.is_none_or(|count| count >= 2.0),
            "seed {seed}: {count:?}"
        );
        looked
    });
    let looked: Vec<_> = looked.collect();
    let header = looked[0].folder.read("c/ball.h");
    assert!(header.contains("BALL_EVENTS 8"), "{header}");
    rust::check(&looked);
}
