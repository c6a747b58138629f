//! The chosen values into the study file.

use lynkeus_study::Swept;

use super::axis::shown;
use super::{Axis, Sweep};
use crate::Error;
use crate::rewrite::{Assignment, Change, rewritten};

impl Sweep {
    /// The study's text with the values of the knee at the swept keys, and what changed. Only
    /// those numbers are touched: every other byte stays, line ends and a byte order mark among them.
    ///
    /// # Errors
    /// There is no knee, or `text` is not the study that was swept.
    pub fn rewritten(&self, text: &str) -> Result<(String, Vec<Change>), Error> {
        let knee = self.chosen().ok_or_else(|| self.refusal())?;
        let axes = self.axes.iter().zip(knee.values.iter().copied());
        let written: Vec<_> = axes
            .map(|(axis, value)| (axis, written(axis, value)))
            .collect();
        let assignments = written
            .iter()
            .map(|(axis, written)| assignment(axis, written));
        rewritten(text, assignments)
    }
}

/// What is written at an axis for a number that stands there.
fn written(axis: &Axis, value: f64) -> impl Fn(Option<f64>) -> String {
    move |present| shown(present.map_or(value, |present| axis.chosen(present, value)))
}

fn assignment<'a>(axis: &'a Axis, written: &'a dyn Fn(Option<f64>) -> String) -> Assignment<'a> {
    let name = |name: &'a Option<String>| name.as_deref().map(|name| (name, &[][..]));
    let (tables, place): (&'static [&'static str], _) = match axis.swept() {
        Swept::Tuning(base, path) => (&["observer"], Some((base.as_str(), &path[..]))),
        Swept::Density(of) => (&["process_noise"], name(of)),
        Swept::Noise(of) => (&["sensors", "noise"], name(of)),
    };
    Assignment {
        key: axis.key.clone(),
        tables,
        place,
        written,
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Row, axis, measures};
    use super::*;
    use crate::Study;

    fn sweep(text: &str, values: &[f64]) -> Sweep {
        let axes = axis::axes(&Study::parse(text, "s.toml").unwrap()).unwrap();
        let mut row = Row::empty(values, measures::simulated(false).len());
        row.set(measures::TOTAL_ERROR, Some(1.0));
        Sweep {
            plant: "P".to_owned(),
            log: None,
            axes,
            measures: measures::simulated(false),
            rows: vec![row],
            objective: measures::OBJECTIVE,
            knee: Some(0),
            time_unit: None,
            declared: crate::Account::default(),
            notes: vec![],
        }
    }

    #[test]
    fn only_the_number_changes() {
        let text =
            "# head\nplant = 'p.mo'\n\n[observer]   # how\n  theta=4.0      # 1/min\nr = 1\n";
        let (new, changes) = sweep(text, &[3.5]).rewritten(text).unwrap();
        assert_eq!(new, text.replace("4.0", "3.5"));
        assert_eq!(changes[0].to_string(), "theta: 4.0 becomes 3.5");
        let (same, changes) = sweep(text, &[4.0]).rewritten(text).unwrap();
        assert_eq!(same, text);
        assert_eq!(changes[0].to_string(), "theta stays 4.0");
    }

    #[test]
    fn entries_lists_and_new_keys() {
        let text = "observer = { theta = [ 1.5,  # for mu\n  0.7 ] }\ntune.keys = { \"theta[2]\" = [1, 2], delta = [1, 2] }\n";
        let (new, changes) = sweep(text, &[2.0, 1.0]).rewritten(text).unwrap();
        assert!(
            new.starts_with("observer = { theta = [ 1.5,  # for mu\n  2 ]"),
            "{new}"
        );
        assert!(new.contains("delta = 1 }"), "{new}");
        assert_eq!(changes[1].to_string(), "delta = 1 is new");

        let text = "[observer]\npoles = [-2, -3.1] # 1/y\n";
        let (new, changes) = sweep(text, &[1.1]).rewritten(text).unwrap();
        assert_eq!(new, "[observer]\npoles = [-2.2, -3.41] # 1/y\n");
        assert_eq!(
            changes[0].to_string(),
            "poles: [-2, -3.1] becomes [-2.2, -3.41]"
        );
    }

    #[test]
    fn line_ends_and_marks_stay() {
        for text in [
            "\u{feff}plant = 'p.mo'\r\n[observer]\r\ntheta = 4.0  # \u{3b8}\r\n[plot]\r\n",
            "[observer]\rtheta = 4.0\n".replace('\r', "\r\n").as_str(),
            "[observer]\r\ntheta = 4.0 \nname = 1\r\n",
            "observer . theta = 4.0",
        ] {
            let plain = text.trim_start_matches('\u{feff}');
            let swept = plain.replace("name = 1\r\n", "");
            let (new, _) = sweep(&swept, &[3.5]).rewritten(text).unwrap();
            assert_eq!(new, text.replace("4.0", "3.5"));
        }
    }

    #[test]
    fn a_new_key_goes_below_the_others() {
        let keys = "tune.keys = { delta = [1, 2] }";
        for (text, new) in [
            (
                "[observer]\r\ntheta = 1 # a\r\n\r\n[plot]\r\n",
                "[observer]\r\ntheta = 1 # a\r\ndelta = 2\r\n\r\n[plot]\r\n",
            ),
            ("[observer]\n[plot]\n", "[observer]\ndelta = 2\n[plot]\n"),
            (
                "[observer]\r\ntheta = 1",
                "[observer]\r\ntheta = 1\r\ndelta = 2",
            ),
            (
                "observer.theta = 1\nx = 2\n",
                "observer.theta = 1\nobserver.delta = 2\nx = 2\n",
            ),
            (
                "observer = { theta = 1 }\n",
                "observer = { theta = 1, delta = 2 }\n",
            ),
            ("observer = {}\n", "observer = { delta = 2 }\n"),
            (
                "[observer.initial]\nx = 1\n",
                "[observer]\ndelta = 2\n\n[observer.initial]\nx = 1\n",
            ),
            (
                "[observer]\ntheta = 1\ninitial.x = [\n1]\n",
                "[observer]\ntheta = 1\ninitial.x = [\n1]\ndelta = 2\n",
            ),
        ] {
            let swept = format!("{keys}\nobserver.theta = 1");
            let (found, changes) = sweep(&swept, &[2.0]).rewritten(text).unwrap();
            assert_eq!(found, new);
            assert_eq!(changes[0].to_string(), "delta = 2 is new");
        }
    }

    #[test]
    fn a_pair_of_poles_is_scaled() {
        let text = "[observer]\r\npoles = [{ re = -2, im = 1 }, -3]\r\n";
        let (new, _) = sweep(text, &[2.0]).rewritten(text).unwrap();
        assert_eq!(new, "[observer]\r\npoles = [{ re = -4, im = 2 }, -6]\r\n");
    }

    /// The θ that is swept may be one that the study leaves out.
    #[test]
    fn a_study_without_a_section_gets_one() {
        let sweep = sweep("observer = { theta = 1 }", &[2.0]);
        for (text, end) in [("plant = 'p'", "\n"), ("plant = 'p'\r\n", "\r\n")] {
            let (new, changes) = sweep.rewritten(text).unwrap();
            assert_eq!(new, format!("{text}{end}[observer]{end}theta = 2{end}"));
            assert_eq!(changes[0].to_string(), "theta = 2 is new");
        }
    }

    #[test]
    fn noises_are_written_where_they_stand() {
        let filter = "observer = { family = \"ekf\" }\n";
        for (keys, values, text, new) in [
            (
                "process_noise.x = [1], noise.y = [1]",
                &[0.5, 2.0][..],
                "[process_noise]\nx = 0.1 # slow\n[sensors]\nnoise = { y = 1 }\n",
                "[process_noise]\nx = 0.5 # slow\n[sensors]\nnoise = { y = 2 }\n",
            ),
            (
                "process_noise.w = [1]",
                &[0.5],
                "process_noise.x = 1\n[sensors]\nmeasured = [\"y\"]\n",
                "process_noise.x = 1\nprocess_noise.w = 0.5\n[sensors]\nmeasured = [\"y\"]\n",
            ),
            (
                "process_noise.\"x[1]\" = [1], noise.y = [1]",
                &[0.5, 2.0],
                "[process_noise]\r\nx = 1\r\n[sensors]\r\nmeasured = [\"y\"]\r\n",
                "[process_noise]\r\nx = 1\r\n\"x[1]\" = 0.5\r\n[sensors]\r\nmeasured = [\"y\"]\r\nnoise = { y = 2 }\r\n",
            ),
            (
                "process_noise.w = [1], noise.y = [1]",
                &[0.5, 2.0],
                "plant = 'p'\n",
                "plant = 'p'\n\n[process_noise]\nw = 0.5\n\n[sensors.noise]\ny = 2\n",
            ),
            (
                "noise.y = [1]",
                &[2.0],
                "sensors = { noise.z = 1 }\n",
                "sensors = { noise.z = 1, noise.y = 2 }\n",
            ),
            (
                "noise.y = [1]",
                &[2.0],
                "sensors.noise.z = 1\n[plot]\n",
                "sensors.noise.z = 1\nsensors.noise.y = 2\n[plot]\n",
            ),
            (
                "noise.y = [1]",
                &[2.0],
                "[sensors]\nnoise.z = 1\n[sensors.limits]\ny = [0, 1]\n",
                "[sensors]\nnoise.z = 1\nnoise.y = 2\n[sensors.limits]\ny = [0, 1]\n",
            ),
            (
                "noise.y = [1]",
                &[2.0],
                "[sensors.limits]\ny = [0, 1]\n",
                "[sensors]\nnoise = { y = 2 }\n\n[sensors.limits]\ny = [0, 1]\n",
            ),
        ] {
            let sweep = sweep(&format!("{filter}tune.keys = {{ {keys} }}"), values);
            let (found, _) = sweep.rewritten(text).unwrap();
            assert_eq!(found, new);
            // it is the study that was meant
            Study::parse(&found, "s.toml").unwrap();
        }
    }

    #[test]
    fn all_noises_are_multiplied() {
        let sections = "process_noise = { x = 0.1, v = 3 }\nsensors.noise = { y = \"5%\", z = { uniform = 1 } }\n";
        let keys =
            "observer = { family = \"ekf\" }\ntune.keys = { process_noise = [2], noise = [2] }\n";
        let (found, changes) = sweep(&format!("{keys}{sections}"), &[2.0, 3.0])
            .rewritten(sections)
            .unwrap();
        let new = "process_noise = { x = 0.2, v = 6 }\nsensors.noise = { y = \"15%\", z = { uniform = 3 } }\n";
        assert_eq!(found, new);
        assert_eq!(
            changes[0].to_string(),
            "process_noise: x = 0.1, v = 3 becomes x = 0.2, v = 6"
        );
    }

    #[test]
    fn another_study_is_refused() {
        let sweep = sweep("observer = { theta = 1 }", &[2.0]);
        let refusal = |text: &str| sweep.rewritten(text).unwrap_err().to_string();
        assert!(refusal("observer = 3").contains("no table"));
        assert!(refusal("observer.theta = 'x'").contains("no longer a number"));
        assert!(refusal("observer.theta = ").contains("not a TOML file"));
    }
}
