//! An estimator of every kind.

use lynkeus::Study;
use lynkeus::run::Estimator;

use xtask::process::root;

/// An estimator before its first sample, and what is usual for it.
#[derive(Clone, Debug)]
pub struct Subject {
    pub name: String,
    pub estimator: Estimator,
    /// between two samples
    pub step: f64,
    /// about the size of its signals
    pub size: f64,
    /// its steps are controlled by their error: far in time it takes as many as it may
    pub is_adaptive: bool,
}

/// What a shipped model is observed by: the study without its plant.
struct Kind {
    name: &'static str,
    plant: &'static str,
    step: f64,
    size: f64,
    study: &'static str,
}

const TANKS: &str = "two-tanks/two_tanks.mo";
const FERMENTER: &str = "bioreactor/bioreactor.mo";
const MOTOR: &str = "induction-motor/induction_motor.mo";

const KINDS: &[Kind] = &[
    Kind {
        name: "triangular, held",
        plant: TANKS,
        step: 4.0,
        size: 5.0,
        study: r#"
            sensors = { measured = ["level"], unknown = ["pump"] }
            observer = { family = "triangular", theta = 0.03, clamp = true, partials = true }
            estimate = { method = "rk4", substeps = 2 }"#,
    },
    Kind {
        name: "triangular, predicted, sd",
        plant: TANKS,
        step: 4.0,
        size: 5.0,
        study: r#"
            sensors = { measured = ["level"], unknown = ["pump"], noise = { level = 0.02 } }
            process_noise = { pump = 0.001 }
            observer = { family = "triangular", theta = 0.03, clamp = true, partials = true }
            estimate = { method = "rk4", step = 1.5, sd = true, between_samples = "predict" }"#,
    },
    Kind {
        name: "drift-observable",
        plant: "germani-manes/germani_manes.mo",
        step: 0.005,
        size: 2.0,
        study: r#"
            observer = { family = "drift-observable", variant = "practical", poles = [-4, -4.8, -5.76], filter_poles = [-40, -48], filter_initial = [5, 12.5], initial = { x1 = 0.5, x2 = 1, x3 = 1 } }
            estimate = { method = "rk4", substeps = 2 }"#,
    },
    Kind {
        name: "block-triangular",
        plant: "lee/lee.mo",
        step: 0.01,
        size: 1.0,
        study: r#"
            sensors = { measured = ["y1", "y2"] }
            observer = { family = "block-triangular", theta = [3, 9], k = [[2, 1], [2, 1]], correction = "classical", initial = { default = 0.5 } }
            estimate = { between_samples = "predict" }"#,
    },
    Kind {
        name: "state-affine",
        plant: "ltaief/ltaief.mo",
        step: 0.01,
        size: 2.0,
        study: r#"
            sensors = { measured = ["y"], disturbances = ["e1"] }
            observer = { family = "state-affine", theta = 10, S0 = 1, initial = { x1 = 1, x2 = 2, x3 = -2 } }
            estimate = { method = "rk4", substeps = 2 }"#,
    },
    Kind {
        name: "unknown-input",
        plant: "farza/farza.mo",
        step: 0.01,
        size: 2.0,
        study: r#"
            sensors = { measured = ["y1", "y2", "y3"], unknown = ["v"] }
            observer = { family = "unknown-input", theta = [60, 15], initial = { x1 = 1, x2 = 1, x3 = 1, x4 = 0, x5 = 0, v = -1 } }
            estimate = { method = "rk4", substeps = 3 }"#,
    },
    Kind {
        name: "ekf",
        plant: MOTOR,
        step: 0.001,
        size: 50.0,
        study: r#"
            sensors = { measured = ["current_a", "current_b", "speed"], unknown = ["load"], noise = { current_a = 0.02, current_b = 0.02, speed = 0.1 } }
            process_noise = { load = 10 }
            observer = { family = "ekf", gate = 6 }
            estimate = { method = "rk4", substeps = 1 }"#,
    },
    Kind {
        name: "ekf, known input, adaptive",
        plant: FERMENTER,
        step: 0.1,
        size: 3.0,
        study: r#"
            sensors = { measured = ["cells", "substrate"], unknown = ["mu"], noise = { cells = 0.05, substrate = "2%" }, limits = { substrate = [0, 20] } }
            process_noise = { mu = 0.001 }
            observer = { family = "ekf" }"#,
    },
    Kind {
        name: "ukf",
        plant: TANKS,
        step: 4.0,
        size: 5.0,
        study: r#"
            sensors = { measured = ["level"], unknown = ["pump"], noise = { level = 0.02 } }
            process_noise = { pump = 0.001 }
            observer = { family = "ukf", alpha = 0.5, beta = 2, kappa = 0 }
            estimate = { method = "rk4", substeps = 2 }"#,
    },
    Kind {
        name: "mhe",
        plant: TANKS,
        step: 4.0,
        size: 5.0,
        study: r#"
            sensors = { measured = ["level"], unknown = ["pump"], noise = { level = 0.02 } }
            process_noise = { pump = 0.001 }
            observer = { family = "mhe", horizon = 4 }
            estimate = { method = "rk4", substeps = 1 }"#,
    },
    Kind {
        name: "particle",
        plant: TANKS,
        step: 4.0,
        size: 5.0,
        study: r#"
            sensors = { measured = ["level"], unknown = ["pump"], noise = { level = 0.02 } }
            process_noise = { pump = 0.001 }
            observer = { family = "particle", particles = 100, proposal = "auxiliary" }"#,
    },
];

/// All of them.
pub fn all() -> Result<Vec<Subject>, String> {
    KINDS.iter().map(subject).collect()
}

fn subject(kind: &Kind) -> Result<Subject, String> {
    let place = format!("study of \"{}\"", kind.name);
    let text: String = kind
        .study
        .lines()
        .map(|l| format!("{}\n", l.trim()))
        .collect();
    let study = Study::parse(&text, &place).map(|study| Study {
        plant: Some(root().join("examples").join(kind.plant)),
        ..study
    });
    let estimator = study.and_then(|study| lynkeus::estimator(&study));
    Ok(Subject {
        name: kind.name.to_owned(),
        estimator: estimator.map_err(|e| e.to_string())?,
        step: kind.step,
        size: kind.size,
        is_adaptive: !kind.study.contains("rk4"),
    })
}
