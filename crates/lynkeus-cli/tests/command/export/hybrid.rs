//! Random plants with events, angles, rotations and late sensors, through every language.

use std::fmt::Write;

use super::{Looked, compiled, has, late, look, rust};
use crate::normal::Normal;
use crate::random::pick;
use crate::{Folder, skipped};

/// A plant under way, with what a study says of it and a log of it.
#[derive(Default)]
struct Draft {
    declared: String,
    equations: String,
    circle: Vec<&'static str>,
    rotates: bool,
    noise: Vec<(&'static str, f64)>,
    process: Vec<(&'static str, f64)>,
    inputs: Vec<&'static str>,
}

fn between(random: &mut Normal, low: f64, high: f64) -> f64 {
    low + (high - low) * random.uniform()
}

impl Draft {
    /// What jumps: by the state, by the clock, or by both.
    fn core(&mut self, random: &mut Normal) {
        let share = between(random, 0.4, 0.85);
        let (declared, equations, moved): (&str, String, _) = match pick(
            random,
            &[0, 1, 2, 3, 4, 5],
        ) {
            0 => (
                "Real h(start = 1); Real v(start = 0); discrete Integer n(start = 0); output Real y = h;",
                format!(
                    "der(h) = v; der(v) = -9.81 - 0.1*v;\nwhen h <= 0 then reinit(v, 0.4 - {share:.2}*pre(v)); n = pre(n) + 1; end when;"
                ),
                "v",
            ),
            1 => (
                "Real T(start = 18); Boolean on(start = true); output Real y = 0.1*T;",
                format!(
                    "der(T) = (if on then 8 else 0) - {share:.2}*(T - 12);\nwhen T >= 21 then on = false; elsewhen T <= 19 then on = true; end when;"
                ),
                "T",
            ),
            2 => (
                "Real h(start = 0.5); Real feed(start = 1.5); discrete Real full(start = 0); output Real y = h;",
                format!(
                    "der(h) = feed - 0.2*h; der(feed) = 0;\nwhen h >= 1.5 then reinit(h, {share:.2}*h); full = time; end when;"
                ),
                "feed",
            ),
            3 => (
                "Real x(start = 0.7); discrete Real hold(start = 0); output Real y = x;",
                format!(
                    "der(x) = 0.6*x + hold - 0.1*x^3;\nwhen sample(0.13, {:.2}) then hold = {share:.2}*pre(hold) - 1.2*x; end when;",
                    between(random, 0.1, 0.6)
                ),
                "x",
            ),
            4 => (
                "Real x(start = 0); Real v(start = 3); discrete Integer left(start = 0); output Real y = x;",
                format!(
                    "der(x) = v; der(v) = -0.2*v + 2*sin(3*time);\nwhen x > 1 then reinit(v, -{share:.2}*abs(pre(v))); elsewhen x < -1 then reinit(v, {share:.2}*abs(pre(v))); left = pre(left) + 1; end when;"
                ),
                "v",
            ),
            _ => (
                "Real x(start = 1); Real k(start = 1); Boolean is_open(start = false); discrete Real last(start = 0); output Real y = x;",
                format!(
                    "der(x) = (if is_open then 0.8 else -1)*k + 0.3*sin(time); der(k) = 0;\nwhen x <= 0.2 then is_open = true; elsewhen x >= {:.2} then is_open = false; end when;\nwhen edge(is_open) then last = pre(last) + x; end when;",
                    1.0 + share
                ),
                "k",
            ),
        };
        self.declared += declared;
        self.equations += &equations;
        self.noise.push(("y", between(random, 0.02, 0.2)));
        let density = match random.uniform() < 0.7 {
            true => between(random, 0.01, 0.2),
            false => 0.0,
        };
        self.process.push((moved, density));
    }

    fn angle(&mut self, random: &mut Normal) {
        let turn = pick(random, &["", ", min = 0, max = 6.28318"]);
        write!(
            self.declared,
            "Real phi(start = 0.3{turn}); Real w(start = 4); output Real enc = phi;"
        )
        .unwrap();
        self.equations +=
            "\nder(phi) = w; der(w) = -0.3*w;\nwhen w <= 2 then reinit(w, pre(w) + 3); end when;";
        self.circle.push("phi");
        self.noise.push(("enc", 0.05));
        self.process.push(("w", between(random, 0.01, 0.2)));
    }

    /// What the clock switches, at instants of rows among others, alone and with a condition on the state.
    fn clock(&mut self, random: &mut Normal) {
        let first = pick(random, &["0.5", "1.0", "1.234", "0.1 + 0.7"]);
        let then = pick(
            random,
            &[
                "time > 2.2",
                "time >= 2.5 and z < 0.9",
                "not time < 3",
                "2.0 < time",
            ],
        );
        self.declared += "Real z(start = 1.2); discrete Real lit(start = 0); output Real yz = z;";
        write!(
            self.equations,
            "\nder(z) = lit - {:.2}*z;\nwhen time >= {first} then lit = 1.5; elsewhen {then} then lit = pre(lit) - 0.7; reinit(z, 0.5*pre(z)); end when;",
            between(random, 0.3, 1.5)
        )
        .unwrap();
        self.noise.push(("yz", 0.05));
        self.process.push(("z", 0.02));
    }

    fn rotation(&mut self) {
        self.declared += "Real q[4](start = {1, 0, 0, 0}); input Real p; output Real a = 2*(q[2]*q[4] - q[1]*q[3]); output Real b = 2*(q[3]*q[4] + q[1]*q[2]);";
        self.equations += "\nder(q[1]) = 0.5*(-q[2]*p - 0.2*q[4]); der(q[2]) = 0.5*(q[1]*p + 0.2*q[3]); der(q[3]) = 0.5*(-0.2*q[2] + q[4]*p); der(q[4]) = 0.5*(0.2*q[1] - q[3]*p);";
        self.rotates = true;
        self.inputs.push("p");
        self.noise.extend([("a", 0.1), ("b", 0.1)]);
        self.process.push(("q", 0.01));
    }

    fn model(&self) -> String {
        format!(
            "model M\n{}\nequation\n{}\nend M;\n",
            self.declared, self.equations
        )
    }

    fn study(&self, random: &mut Normal, delay: &str) -> String {
        let table = |pairs: &[(&str, f64)]| {
            let pairs = pairs
                .iter()
                .map(|(name, value)| format!("{name} = {value:.4}"));
            pairs.collect::<Vec<_>>().join(", ")
        };
        let mut text = "plant = \"m.mo\"\n".to_owned();
        if self.rotates || !self.circle.is_empty() {
            text += "[manifold]\n";
        }
        if !self.circle.is_empty() {
            text += &format!("circle = {:?}\n", self.circle);
        }
        if self.rotates {
            text += "quaternion = [\"q\"]\n";
        }
        text += &format!("[sensors]\nnoise = {{ {} }}\n{delay}", table(&self.noise));
        if !self.process.is_empty() {
            text += &format!(
                "[process_noise]\n{}\n",
                table(&self.process).replace(", ", "\n")
            );
        }
        let family = pick(random, &["ekf", "ekf", "ukf"]);
        text += &format!("[observer]\nfamily = \"{family}\"\n");
        if random.uniform() < 0.4 {
            text += "gate = 4\n";
        }
        let step = pick(
            random,
            &["step = 0.02", "step = 0.05", "substeps = 3", "substeps = 1"],
        );
        let sd = random.uniform() < 0.8;
        text + &format!("[estimate]\nmethod = \"rk4\"\n{step}\nsd = {sd}\n")
    }

    /// Readings that have little to do with the plant, of which some are missing.
    fn log(&self, random: &mut Normal) -> Vec<String> {
        let names = self.noise.iter().map(|pair| pair.0);
        let header: Vec<&str> = std::iter::once("t")
            .chain(names)
            .chain(self.inputs.iter().copied())
            .collect();
        let mut lines = vec![header.join(",")];
        let mut t = 0.0_f64;
        for row in 0..60 {
            let mut line = format!("{t:.4}");
            for (name, noise) in &self.noise {
                let value = match *name {
                    "y" => 0.8 + 0.5 * (2.0 * t).cos(),
                    "enc" => (0.3 + 3.0 * t).rem_euclid(std::f64::consts::TAU),
                    _ => 0.3 * (0.5 * t).sin(),
                };
                match random.uniform() < 0.15 {
                    true => line.push(','),
                    false => write!(line, ",{:.5}", value + noise * random.next()).unwrap(),
                }
            }
            for _ in &self.inputs {
                match row > 0 && random.uniform() < 0.2 {
                    true => line.push(','),
                    false => write!(line, ",{:.4}", 0.5 * (0.7 * t).sin()).unwrap(),
                }
            }
            lines.push(line);
            t += match random.uniform() < 0.5 {
                true => 0.1,
                false => 0.03 + 0.15 * random.uniform(),
            };
        }
        lines
    }
}

/// Plants from here on have something that the clock switches.
const CLOCKED: u64 = 1000;

/// A study of such a plant; with late sensors by every third seed.
fn drafted(seed: u64) -> (Folder, Vec<String>, bool) {
    let mut random = Normal(5000 + seed);
    let mut draft = Draft::default();
    draft.core(&mut random);
    if random.uniform() < 0.5 {
        draft.angle(&mut random);
    }
    if random.uniform() < 0.25 {
        draft.rotation();
    }
    if seed >= CLOCKED {
        draft.clock(&mut random);
    }
    let is_late = seed.is_multiple_of(3);
    let delay = match is_late {
        true => format!("delay = {{ y = {:.2} }}\n", between(&mut random, 0.05, 0.4)),
        false => String::new(),
    };
    let folder = Folder::empty();
    folder.write("m.mo", &draft.model());
    folder.write("s.toml", &draft.study(&mut random, &delay));
    let log = draft.log(&mut random);
    folder.write("log.csv", &(log.join("\n") + "\n"));
    (folder, log, is_late)
}

fn agree(seeds: &[u64]) {
    if !has("gcc") {
        return skipped("gcc is not there");
    }
    let mut kept: Vec<Looked> = vec![];
    let mut whole = 0;
    for &seed in seeds {
        let (folder, log, is_late) = drafted(seed);
        if is_late {
            whole += usize::from(looked_late(seed, &folder, &log));
            continue;
        }
        let looked = look(seed, folder);
        whole += usize::from(looked.as_ref().is_some_and(|looked| looked.expected.2));
        kept.extend(looked);
    }
    assert!(10 * whole >= 9 * seeds.len(), "{whole} of {}", seeds.len());
    rust::check(&kept);
}

/// What C knows at some rows is what `estimate` makes of the log up to there; whether it reached the end.
fn looked_late(seed: u64, folder: &Folder, log: &[String]) -> bool {
    let made = folder.run(&["export", "s.toml", "--to", "c", "-o", "c"]);
    assert_eq!(made.code, 0, "seed {seed}: {}", made.err);
    compiled(folder.path.path(), &["-fsanitize=address,undefined"]);
    late::compared(folder, log, &format!("seed {seed}"))
}

#[test]
fn plants_with_events_and_angles_are_those_of_estimate() {
    agree(&(0..6).collect::<Vec<_>>());
}

#[test]
fn plants_that_the_clock_switches_are_those_of_estimate() {
    agree(&(CLOCKED..CLOCKED + 4).collect::<Vec<_>>());
}

#[test]
#[ignore = "takes minutes"]
fn two_hundred_plants_that_the_clock_switches_are_those_of_estimate() {
    agree(&(CLOCKED..CLOCKED + 200).collect::<Vec<_>>());
}

#[test]
#[ignore = "takes minutes"]
fn two_hundred_plants_with_events_and_angles_are_those_of_estimate() {
    agree(&(0..200).collect::<Vec<_>>());
}
