//! What a moving input leaves behind: (4.22) has no term n̄(ẑ, x̂_a)w, whatever (4.23) says.

use std::collections::BTreeMap;

use crate::common::{plant, run};
use lynkeus_model::Plant;
use lynkeus_observers::{
    Assumptions, Certificate, Tuning, Value, drift_observable::DRIFT_OBSERVABLE,
};
use lynkeus_structure::{AugmentedPlant, Sensors, Standing};

use super::list;

/// A plant with the practical observer, inputs as functions of time and bounds of their slopes.
struct Driven<'a> {
    text: &'a str,
    poles: Value,
    filter: &'a [(&'a str, &'a [f64])],
    slopes: &'a [(&'a str, &'a [f64])],
    inputs: &'a [(&'a str, &'a str)],
    until: f64,
}

fn table(entries: &[(&str, &[f64])]) -> Value {
    let entries = entries.iter().map(|(n, x)| ((*n).to_owned(), list(x)));
    Value::Table(entries.collect())
}

impl Driven<'_> {
    fn tuning(&self) -> Tuning {
        Tuning {
            values: BTreeMap::from([
                ("variant".to_owned(), Value::Text("practical".into())),
                ("poles".to_owned(), self.poles.clone()),
                ("filter_poles".to_owned(), table(self.filter)),
                ("input_derivatives".to_owned(), table(self.slopes)),
            ]),
            ..Tuning::default()
        }
    }

    fn certificate(&self, plant: &Plant) -> Certificate {
        let augmented = AugmentedPlant::new(plant, &Sensors::default()).unwrap();
        let assumptions = Assumptions::new(&augmented, augmented.region())
            .unwrap()
            .with_drift(vec![0.0; augmented.states.len()])
            .with_noise(vec![0.0; augmented.outputs.len()])
            .with_input_derivatives(vec![]);
        DRIFT_OBSERVABLE
            .theorem(&augmented, &self.tuning(), &assumptions)
            .unwrap()
    }

    /// The largest errors of the states, and of all together, over the last quarter.
    fn left(&self, plant: &Plant) -> (Vec<f64>, f64) {
        let augmented = AugmentedPlant::new(plant, &Sensors::default()).unwrap();
        let design = DRIFT_OBSERVABLE.design(&augmented, &self.tuning()).unwrap();
        let n = augmented.states.len();
        let times: Vec<f64> = (0..=400)
            .map(|k| self.until * f64::from(k) / 400.0)
            .collect();
        let start: Vec<f64> = augmented.states.iter().map(|s| s.start.unwrap()).collect();
        let rows = run(plant, &design, self.inputs, &start, &times, 1e-3).rows;
        let last = rows.iter().filter(|row| row[0] > 0.75 * self.until);
        let (mut each, mut all) = (vec![0.0f64; n], 0.0f64);
        for row in last {
            let errors = (0..n).map(|i| row[1 + i] - row[1 + n + i]);
            all = all.max(errors.clone().map(|e| e * e).sum::<f64>().sqrt());
            each = each
                .iter()
                .zip(errors)
                .map(|(m, e)| m.max(e.abs()))
                .collect();
        }
        (each, all)
    }

    /// The bounds hold, and are within `slack` of what is left.
    fn kept(&self, slack: f64) {
        let plant = plant(self.text);
        let found = self.certificate(&plant);
        assert_eq!(found.verdict(), Standing::Proved, "{:#?}", found.hypotheses);
        let (each, all) = self.left(&plant);
        let bound = found.ultimate_bound.unwrap();
        assert!(all > 1e-4, "{}: nothing is left", self.text);
        assert!(
            all <= bound && bound <= slack * all,
            "{}: {all} {bound}",
            self.text
        );
        for (left, bound) in each.iter().zip(&found.ultimate) {
            assert!(*left <= bound.value, "{bound:?}: {left}");
        }
    }
}

/// y' = x2 + u, x2' = −0.1 x2: with u = 2 sin 0.1t the linear error equation, solved by hand
/// in the frequency domain, leaves 0.0866 and 0.2596.
#[test]
fn a_moving_input_leaves_an_error() {
    let driven = Driven {
        text: "model Ramp input Real u(min = -2, max = 2, start = 0); Real x1(start = 0, min = -20, max = 20);
          Real x2(start = 0, min = -5, max = 5); output Real y = x1;
          equation der(x1) = x2 + u; der(x2) = -0.1*x2; end Ramp;",
        poles: list(&[-1.0, -2.0]),
        filter: &[("u", &[-1000.0])],
        slopes: &[("u", &[0.2])],
        inputs: &[("u", "2*sin(0.1*time)")],
        until: 160.0,
    };
    let plant = plant(driven.text);
    let found = driven.certificate(&plant);
    assert_eq!(found.verdict(), Standing::Proved);
    assert!(found.ultimate[0].value >= 0.0866 && found.ultimate[1].value >= 0.2596);
    let bound = found.ultimate_bound.unwrap();
    assert!((0.2596..1.5).contains(&bound), "{bound}");
}

/// n = 2, r = 1; n = 3, r = 2 (U is u alone); n = 3, r = 1 (U is u, u').
#[test]
fn what_is_left_of_one_input_is_bounded() {
    let slopes: &[(&str, &[f64])] = &[("u", &[1.0])];
    Driven {
        text: "model A input Real u(min = -1, max = 1); Real a(start = 0, min = -4, max = 4); Real b(start = 0, min = -4, max = 4);
          output Real y = a; equation der(a) = b + u; der(b) = -0.5*sin(a) - b; end A;",
        poles: list(&[-4.0, -6.0]),
        filter: &[("u", &[-100.0])],
        slopes,
        inputs: &[("u", "sin(time)")],
        until: 24.0,
    }
    .kept(20.0);
    Driven {
        text: "model B input Real u(min = -1, max = 1); Real a(start = 0, min = -4, max = 4); Real b(start = 0, min = -4, max = 4);
          Real c(start = 0, min = -4, max = 4); output Real y = a;
          equation der(a) = b; der(b) = c + u; der(c) = -0.2*sin(a) - c - b; end B;",
        poles: list(&[-6.0, -7.0, -8.0]),
        filter: &[("u", &[-100.0])],
        slopes,
        inputs: &[("u", "sin(time)")],
        until: 24.0,
    }
    .kept(60.0);
    Driven {
        text: "model C input Real u(min = -1, max = 1); Real a(start = 0, min = -4, max = 4); Real b(start = 0, min = -4, max = 4);
          Real c(start = 0, min = -4, max = 4); output Real y = a;
          equation der(a) = b + u; der(b) = c; der(c) = -0.1*sin(a) - c - b; end C;",
        poles: list(&[-6.0, -7.0, -8.0]),
        filter: &[("u", &[-100.0, -120.0])],
        slopes: &[("u", &[1.0, 1.0])],
        inputs: &[("u", "sin(time)")],
        until: 24.0,
    }
    .kept(100.0);
}

/// n̄ = 0.2 a follows the state.
#[test]
fn a_factor_that_moves_is_bounded_on_the_box() {
    Driven {
        text: "model D input Real u(min = -1, max = 1); Real a(start = 0.5, min = -1, max = 1); Real b(start = 0, min = -1, max = 1);
          output Real y = a; equation der(a) = b + 0.2*a*u; der(b) = -a - 0.1*b; end D;",
        poles: list(&[-4.0, -6.0]),
        filter: &[("u", &[-300.0])],
        slopes: &[("u", &[2.0])],
        inputs: &[("u", "sin(2*time)")],
        until: 16.0,
    }
    .kept(100.0);
}

/// Two inputs that enter y' and y'', filters of orders 2 and 1; then two outputs.
#[test]
fn what_is_left_of_several_inputs_is_bounded() {
    Driven {
        text: "model E input Real u(min = -1, max = 1); input Real v(min = -1, max = 1);
          Real a(start = 0, min = -4, max = 4); Real b(start = 0, min = -4, max = 4); Real c(start = 0, min = -4, max = 4);
          output Real y = a;
          equation der(a) = b + 0.3*u; der(b) = c + 0.5*v; der(c) = -c - b - 0.3*sin(a); end E;",
        poles: list(&[-6.0, -7.0, -8.0]),
        filter: &[("u", &[-100.0, -120.0]), ("v", &[-100.0])],
        slopes: &[("u", &[1.0, 1.0]), ("v", &[2.0])],
        inputs: &[("u", "sin(time)"), ("v", "cos(2*time)")],
        until: 16.0,
    }
    .kept(100.0);
    Driven {
        text: "model F input Real u(min = -1, max = 1); Real a(start = 0, min = -4, max = 4); Real b(start = 0, min = -4, max = 4);
          Real c(start = 0, min = -4, max = 4); output Real y = a; output Real z = c;
          equation der(a) = b + u; der(b) = -a - b + 0.2*c; der(c) = -c + 0.2*sin(b); end F;",
        poles: Value::List(vec![list(&[-6.0, -8.0]), list(&[-8.0])]),
        filter: &[("u", &[-100.0])],
        slopes: &[("u", &[1.0])],
        inputs: &[("u", "sin(time)")],
        until: 16.0,
    }
    .kept(40.0);
}
