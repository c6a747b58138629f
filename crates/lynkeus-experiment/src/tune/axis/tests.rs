//! Axes of studies in words.

use super::*;

fn study(text: &str) -> Study {
    Study::parse(text, "s.toml").unwrap()
}

fn refusal(text: &str) -> String {
    axes(&study(text)).unwrap_err().to_string()
}

#[test]
fn without_keys_speed_is_swept_around_the_study() {
    let s = study("observer = { theta = 3.5 }");
    let [theta] = &axes(&s).unwrap()[..] else {
        panic!()
    };
    assert_eq!((theta.key.as_str(), theta.is_factor), ("theta", false));
    assert_eq!((theta.values.len(), theta.present), (21, Some(3.5)));
    assert_eq!(
        [theta.values[0], theta.values[10], theta.values[20]],
        [0.875, 3.5, 14.0]
    );

    let s = study("observer = { poles = [-2, -3] }");
    let [poles] = &axes(&s).unwrap()[..] else {
        panic!()
    };
    assert!(poles.is_factor && poles.label() == "poles \u{d7}");
    let grid = grid(&s, &axes(&s).unwrap()).unwrap();
    let fastest = &grid[20].1.observer.tuning.values["poles"];
    assert_eq!(
        *fastest,
        Value::List(vec![Value::Number(-8.0), Value::Number(-12.0)])
    );
}

#[test]
fn a_pole_is_swept_on_its_own_side_of_zero() {
    let s = study("observer = { poles = -2 }");
    let [poles] = &axes(&s).unwrap()[..] else {
        panic!()
    };
    assert_eq!(
        [poles.values[0], poles.values[10], poles.values[20]],
        [-8.0, -2.0, -0.5]
    );
    assert!(refusal("observer = { poles = 0 }").contains("which must not be 0"));
}

#[test]
fn several_keys_make_a_grid() {
    let s = study(
        "observer = { theta = [1, 2], r = 1 }\ntune = { keys = { \"theta[2]\" = [3, 4], r = { from = 1, to = 3, points = 3, scale = \"linear\" } } }",
    );
    let grid = grid(&s, &axes(&s).unwrap()).unwrap();
    let values: Vec<&[f64]> = grid.iter().map(|(v, _)| &v[..]).collect();
    assert_eq!(
        values[..4],
        [[3.0, 1.0], [3.0, 2.0], [3.0, 3.0], [4.0, 1.0]]
    );
    let tuning = &grid[5].1.observer.tuning.values;
    assert_eq!(tuning["theta"].to_string(), "[1, 4]");
    assert_eq!(tuning["r"], Value::Number(3.0));
}

#[test]
fn a_grid_is_counted_without_overflow() {
    let counted = |points: usize, keys: &[&str]| {
        let axis = |key: &&str| Axis {
            key: (*key).to_owned(),
            is_factor: false,
            values: vec![1.0; points],
            present: None,
            proposed: None,
            swept: Swept::Tuning((*key).to_owned(), vec![]),
            place: None,
        };
        let axes: Vec<Axis> = keys.iter().map(axis).collect();
        let counted = grid(&study("observer = { theta = 1 }"), &axes);
        counted.map(|grid| grid.len()).map_err(|e| e.to_string())
    };
    let keys = ["a", "b", "c", "d", "e", "f", "g", "h", "i"];
    assert_eq!(counted(3, &keys[..2]), Ok(9));
    let found = |points, n: usize| counted(points, &keys[..n]).unwrap_err();
    assert!(found(65_536, 4).contains("found 18446744073709551616"));
    assert!(found(65_536, 5).contains("found 1208925819614629174706176"));
    assert!(found(65_536, 8).contains("found more than 10^38"));
}

#[test]
fn what_cannot_be_swept_is_refused_with_its_place() {
    let e = refusal("observer = { theta = 1 }\ntune = { keys = { tehta = [1] } }");
    assert!(e.starts_with("s.toml:2:19: "), "{e}");
    assert!(
        e.contains("no family has a key \"tehta\"; did you mean \"theta\"?"),
        "{e}"
    );
    let e = refusal(
        "observer = { family = \"triangular\", theta = 1 }\ntune = { keys = { S0 = [1] } }",
    );
    assert!(e.contains("belongs to another family"), "{e}");
    let e = refusal("observer = { theta = [1, 2] }\ntune = { keys = { \"theta[3]\" = [1] } }");
    assert!(e.contains("`theta` has no entry 3: it is [1, 2]"), "{e}");
    let e =
        refusal("observer = { theta = 1, partials = true }\ntune = { keys = { partials = [1] } }");
    assert!(e.contains("must be a number or a list of numbers"), "{e}");
    let e = refusal("observer = { theta = 1 }\ntune = { keys = { delta = {} } }");
    assert!(e.contains("needs the ends of its range"), "{e}");
    assert!(refusal("").contains("nothing to sweep"));
    assert!(
        refusal("observer = { theta = 1 }\ntune = { keys = { \"theta[x]\" = [1] } }")
            .contains("an entry of one such as")
    );
}

#[test]
fn a_slider_has_the_studys_own_value_in_its_middle() {
    let theta = around(&study("observer = { theta = 3.1234567 }"), 5).unwrap();
    assert_eq!((theta.values.len(), theta.values[5]), (11, 3.1234567));
    assert_eq!([theta.values[0], theta.values[10]], [0.7809, 12.49]);
    let poles = around(&study("observer = { poles = [-2, -3] }"), 5).unwrap();
    assert_eq!((poles.is_factor, poles.values[5]), (true, 1.0));
    assert_eq!(around(&study(""), 5), None);
    let noise = Axis::of_densities(2);
    assert_eq!(noise.values, [0.01, 0.1, 1.0, 10.0, 100.0]);
}

#[test]
fn noises_are_swept_for_filters() {
    let text = "observer = { family = \"ekf\" }\nprocess_noise = { x = 0.1, v = 2 }\nsensors = { noise = { y = 0.5, z = \"5%\" } }\n";
    let [all] = &axes(&study(text)).unwrap()[..] else {
        panic!()
    };
    assert_eq!(
        (all.label().as_str(), all.values.len()),
        ("process_noise \u{d7}", 21)
    );
    assert_eq!([all.values[0], all.values[20]], [0.01, 100.0]);
    let keys = "tune = { keys = { process_noise.w = [3], noise.y = {}, \"process_noise.x\" = [7], noise = [2] } }\n";
    let whole =
        "tune = { keys = { process_noise.w = [3], noise.y = {}, \"process_noise.x\" = [7] } }\n";
    // a key `noise` and one in it are the same table of TOML
    assert!(Study::parse(&format!("{text}{keys}"), "s.toml").is_err());
    let s = study(&format!("{text}{whole}"));
    let found = axes(&s).unwrap();
    let present: Vec<Option<f64>> = found.iter().map(|axis| axis.present).collect();
    assert_eq!(present, [None, Some(0.5), Some(0.1)]);
    assert_eq!([found[1].values[0], found[1].values[20]], [0.125, 2.0]);
    let (values, last) = grid(&s, &found).unwrap().pop().unwrap();
    assert_eq!(values, [3.0, 2.0, 7.0]);
    let densities: Vec<(&str, f64)> = last
        .process_noise
        .iter()
        .map(|(name, density)| (name.text.as_str(), *density))
        .collect();
    assert_eq!(densities, [("x", 7.0), ("v", 2.0), ("w", 3.0)]);
    assert_eq!(last.sensors.noise[0].1, Noise::Absolute(2.0));

    let s = study(&format!("{text}tune = {{ keys = {{ noise = [2] }} }}"));
    let (_, last) = grid(&s, &axes(&s).unwrap()).unwrap().pop().unwrap();
    assert_eq!(last.sensors.noise[0].1, Noise::Absolute(1.0));
    assert_eq!(last.sensors.noise[1].1, Noise::Relative(0.1));
}

#[test]
fn noises_that_cannot_be_swept_are_refused_with_their_place() {
    let e =
        refusal("observer = { family = \"ekf\" }\ntune = { keys = { process_noise.x = [1, -1] } }");
    assert!(e.starts_with("s.toml:2:"), "{e}");
    assert!(e.contains("expected numbers >= 0, found -1"), "{e}");
    let e = refusal(
        "observer = { family = \"triangular\", theta = 1 }\ntune = { keys = { noise.y = [1] } }",
    );
    assert!(e.contains("\"noise.y\" is swept for filters"), "{e}");
    assert!(e.contains("family is \"triangular\""), "{e}");
    let e = refusal(
        "observer = { family = \"ekf\" }\nsensors = { noise = { y = \"5%\" } }\ntune = { keys = { noise.y = [1] } }",
    );
    assert!(e.contains("is no standard deviation"), "{e}");
    let e = refusal("observer = { family = \"ekf\" }\ntune = { keys = { process_noise = [1] } }");
    assert!(
        e.contains("the study has no [process_noise] for factors"),
        "{e}"
    );
    assert!(
        refusal("observer = { family = \"ekf\" }").contains("the study has no [process_noise]")
    );
}
