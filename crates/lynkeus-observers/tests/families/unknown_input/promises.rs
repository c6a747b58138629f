//! What the theorem promises, kept by simulations of plants with blocks that are not square,
//! several unknown inputs, and disturbances of states and outputs.

use crate::common::{constant, plant, run};
use lynkeus_model::Plant;
use lynkeus_observers::{
    Assumptions, Certificate, Tuning, UltimateBound, unknown_input::UNKNOWN_INPUT,
};
use lynkeus_structure::{AugmentedPlant, Sensors, Standing};

use super::shapes::{TALL, sensors};
use super::{tuning, with_partition};

/// Errors at every row of a run against what is promised.
struct Promise<'a> {
    plant: &'a Plant,
    sensors: Sensors,
    /// bounds of what acts on the states and of v'
    drift: &'a [f64],
    noise: &'a [f64],
    x0: &'a [f64],
    /// the unknown inputs over time
    truth: fn(f64) -> Vec<f64>,
}

impl Promise<'_> {
    fn certificate(&self, tuning: &Tuning) -> Certificate {
        let augmented = AugmentedPlant::new(self.plant, &self.sensors).unwrap();
        let assumptions = Assumptions::new(&augmented, augmented.region())
            .unwrap()
            .with_drift(self.drift.to_vec())
            .with_noise(self.noise.to_vec());
        UNKNOWN_INPUT
            .theorem(&augmented, tuning, &assumptions)
            .unwrap()
    }

    fn kept(&self, tuning: &Tuning, inputs: &[(&str, &str)], step: f64) {
        let found = self.certificate(tuning);
        assert_eq!(found.verdict(), Standing::Proved, "{:#?}", found.hypotheses);
        let augmented = AugmentedPlant::new(self.plant, &self.sensors).unwrap();
        let design = UNKNOWN_INPUT.design(&augmented, tuning).unwrap();
        let times: Vec<f64> = (0..=100).map(|i| 0.05 * f64::from(i)).collect();
        let n = self.x0.len();
        let errors = |row: &[f64]| -> Vec<f64> {
            let truth = row[1..=n].iter().copied().chain((self.truth)(row[0]));
            truth
                .zip(&row[n + 1..])
                .map(|(x, x̂)| (x - x̂).abs())
                .collect()
        };
        let size = |e: &[f64]| e.iter().map(|e| e * e).sum::<f64>().sqrt();
        let rows = run(self.plant, &design, inputs, self.x0, &times, step).rows;
        let peak = constant(&found, "λθ1") * size(&errors(&rows[0]));
        let (rate, bound) = (found.rate.unwrap(), found.ultimate_bound.unwrap());
        for row in &rows {
            let (e, rest) = (errors(row), peak * (-rate * row[0]).exp());
            assert!(size(&e) <= rest + bound, "t = {}: {e:?}", row[0]);
            for (e, UltimateBound { name, value: bound }) in e.iter().zip(&found.ultimate) {
                assert!(*e <= rest + bound, "{name}: {e} against {bound}");
            }
        }
    }
}

/// Bounded v', and a disturbance in every output, at several frequencies.
#[test]
fn the_promise_is_kept_with_a_left_inverse_and_disturbed_outputs() {
    let plant = plant(TALL);
    let mut tuning = tuning(300.0, 15.0);
    tuning.initial.values = [("b", 0.1), ("c", -0.2), ("d", 0.2), ("e", 0.1)]
        .map(|(name, x)| (name.to_owned(), x))
        .into();
    let promise = |noise: &'static [f64]| Promise {
        plant: &plant,
        sensors: sensors(),
        drift: &[0.0, 0.0, 0.0, 0.0, 0.0, 0.3],
        noise,
        x0: &[0.1, -0.1, 0.2, 0.3, -0.2],
        truth: |t| vec![0.3 * t.sin()],
    };
    let noisy = promise(&[0.01; 3]);
    let exact = promise(&[0.0; 3]).certificate(&tuning);
    assert!(noisy.certificate(&tuning).ultimate_bound > exact.ultimate_bound);
    for n in [
        "0.01",
        "0.01*sin(3*time)",
        "0.01*sin(40*time)",
        "0.01*sin(400*time)",
    ] {
        noisy.kept(&tuning, &[("v", "0.3*sin(time)"), ("n", n)], 1e-3);
    }
}

/// Two unknown inputs that move, four outputs, a disturbance behind them and none.
#[test]
fn the_promise_is_kept_for_two_unknown_inputs_with_four_outputs() {
    let plant = plant(
        "model Pair input Real v1(min = -1, max = 1); input Real v2(min = -1, max = 1);
         input Real d(min = -0.05, max = 0.05);
         Real a1(min = -1, max = 1); Real a2(min = -1, max = 1); Real b1(min = -1, max = 1);
         Real b2(min = -1, max = 1); Real c1(min = -1, max = 1); Real c2(min = -1, max = 1);
         output Real y1 = a1; output Real y2 = a2; output Real y3 = b1; output Real y4 = b2;
         equation
         der(a1) = -a1 + v1 + 0.2*v2; der(a2) = -a2 + 0.5*v2;
         der(b1) = c1 + 0.1*sin(b2) + 0.3*v1; der(b2) = c2 + 0.1*c1;
         der(c1) = -sin(c1) + d; der(c2) = -c2 + 0.2*sin(c1) + 0.1*v2; end Pair;",
    );
    let promise = Promise {
        plant: &plant,
        sensors: Sensors {
            unknown: vec!["v1".into(), "v2".into()],
            disturbances: vec!["d".into()],
            ..Sensors::default()
        },
        drift: &[0.0, 0.0, 0.0, 0.0, 0.05, 0.0, 0.6, 0.4],
        noise: &[0.0; 4],
        x0: &[0.1, -0.1, 0.2, 0.1, -0.3, 0.3],
        truth: |t| vec![0.3 * (2.0 * t).sin(), 0.4 * t.cos()],
    };
    let partition = |θ1, θ2| with_partition(tuning(θ1, θ2), &["y1", "y2"]);
    let asked = promise.certificate(&partition(1.0, 1.0));
    let θ = ["θ1,0", "θ2,0"].map(|name| constant(&asked, name));
    for d in ["0", "0.05", "0.05*sin(2*time)"] {
        let inputs = [("v1", "0.3*sin(2*time)"), ("v2", "0.4*cos(time)"), ("d", d)];
        let tuning = partition(1.1 * θ[0], θ[1]);
        promise.kept(&tuning, &inputs, 0.3 / θ[0]);
    }
}
