use super::*;
use lynkeus_model::LoadOptions;

const PLANT: &str = "model P
  input Real u; input Real v; input Real e;
  Real a; Real b;
  output Real y = 2*a + u; output Real z = a*b;
equation
  der(a) = b + v; der(b) = -a + u + e;
end P;";

fn plant() -> Plant {
    Plant::from_modelica(PLANT, "p.mo", &LoadOptions::default()).unwrap()
}

#[test]
fn unknown_inputs_become_states_and_disturbances_vanish() {
    let plant = plant();
    let sensors = Sensors {
        measured: vec!["y".into()],
        unknown: vec!["v".into()],
        disturbances: vec!["e".into()],
    };
    let augmented = AugmentedPlant::new(&plant, &sensors).unwrap();
    let names: Vec<_> = augmented.states.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names, ["a", "b", "v"]);
    assert_eq!(augmented.pattern, [vec![1, 2], vec![0], vec![]]);
    assert_eq!(augmented.inputs.len(), 1);
    let (state, slope, _) = augmented.outputs[0].state.unwrap();
    assert_eq!((state, plant.graph.constant_value(slope)), (0, Some(2.0)));
}

#[test]
fn a_product_of_states_is_no_affine_output() {
    let plant = plant();
    let augmented = AugmentedPlant::new(&plant, &Sensors::default()).unwrap();
    assert!(augmented.outputs[1].state.is_none());
}

#[test]
fn time_is_a_side_of_the_box() {
    let plant = plant();
    let mut augmented = AugmentedPlant::new(&plant, &Sensors::default()).unwrap();
    augmented.narrow("time", 0.0, 10.0).unwrap();
    let region = augmented.region();
    let time = region.dimensions.iter().find(|d| d.symbol == plant.time);
    assert_eq!(time.map(|d| (d.min, d.max)), Some((0.0, 10.0)));
    let outside = augmented.narrow("time", 11.0, 12.0);
    assert!(matches!(outside, Err(SensorsError::Outside { .. })));
}

#[test]
fn wrong_names_are_told_with_the_right_ones() {
    let plant = plant();
    let sensors = Sensors {
        measured: vec!["level".into()],
        ..Sensors::default()
    };
    let text = AugmentedPlant::new(&plant, &sensors)
        .unwrap_err()
        .to_string();
    assert!(
        text.contains("no output named 'level'") && text.contains("y, z"),
        "{text}"
    );
    let twice = Sensors {
        unknown: vec!["u".into()],
        disturbances: vec!["u".into()],
        ..Sensors::default()
    };
    assert!(matches!(
        AugmentedPlant::new(&plant, &twice),
        Err(SensorsError::Twice { .. })
    ));
}
