//! Measurement errors that certificates count with: disturbances that stand in an output,
//! and uniform noise, whose bound is hard.

use crate::{Folder, csv};

/// der(a) = −0.1 a, y = `output`, one of the families.
fn folder(observer: &str, output: &str, sensors: &str) -> Folder {
    let folder = Folder::empty();
    let model = format!(
        "model M
  input Real d(min = -1, max = 1);
  Real a(start = 2, min = -5, max = 5);
  Real v(start = 1, min = -5, max = 5);
  output Real y = {output};
equation
  der(a) = -0.1*a + v;
  der(v) = 0;
end M;"
    );
    folder.write("m.mo", &model);
    folder.write(
        "study.toml",
        &format!(
            "plant = \"m.mo\"\n[sensors]\n{sensors}\n[observer]\n{observer}\n[simulate]\nuntil = 20\ninputs = {{ d = 0 }}\n"
        ),
    );
    folder
}

#[track_caller]
fn bound(folder: &Folder) -> f64 {
    let report = folder.run(&["certify", "study.toml", "--json"]).json();
    let certificate = &report["certificate"];
    assert_eq!(certificate["verdict"], "proved", "{certificate}");
    certificate["ultimate_bound"].as_f64().unwrap()
}

const FAMILIES: [&str; 3] = [
    "family = \"triangular\"\ntheta = 4",
    "family = \"state-affine\"\ntheta = 4",
    "family = \"block-triangular\"\ntheta = 2\nk_poles = [[-1, -2]]",
];

/// A constant d of 1 in y = a + d is an error of 1 of the measurement, and the estimate of
/// a ends where the innovation has none: 1 beside the truth.
#[test]
fn a_disturbance_in_an_output_counts_as_an_error_of_it() {
    for observer in FAMILIES {
        let disturbed = bound(&folder(observer, "a + d", "disturbances = [\"d\"]"));
        assert!(disturbed >= 1.0, "{observer}: {disturbed}");
        let twice = bound(&folder(observer, "a + 2*d", "disturbances = [\"d\"]"));
        assert!(
            (twice / disturbed - 2.0).abs() < 1e-3,
            "{observer}: {twice}"
        );
        let uniform = "disturbances = [\"d\"]\nnoise = { y = { uniform = 1 } }";
        let same = bound(&folder(observer, "a + 0*d", uniform));
        assert!((same / disturbed - 1.0).abs() < 1e-3, "{observer}: {same}");
    }
}

/// 3σ of a Gaussian noise, the bound itself of a uniform one; nothing for a noise of none.
#[test]
fn uniform_noise_is_bounded_by_what_is_stated() {
    for observer in FAMILIES {
        let of = |noise: &str| bound(&folder(observer, "a + 0*d", noise));
        let gaussian = of("disturbances = [\"d\"]\nnoise = { y = 0.1 }");
        let uniform = of("disturbances = [\"d\"]\nnoise = { y = { uniform = 0.3 } }");
        assert!((uniform / gaussian - 1.0).abs() < 1e-9, "{observer}");
        assert_eq!(
            of("disturbances = [\"d\"]\nnoise = { y = { uniform = 0 } }"),
            0.0
        );
    }
}

/// No sample is further off than the bound, most of it is used, and the error of the
/// estimate keeps the guarantee.
#[test]
fn uniform_noise_is_simulated() {
    let noise = "disturbances = [\"d\"]\nnoise = { y = { uniform = 0.3 } }";
    let folder = folder(FAMILIES[0], "a + 0*d", noise);
    let bound = bound(&folder);
    let ended = folder.run(&["simulate", "study.toml", "--log", "log.csv"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let (header, rows) = csv(&ended.out);
    let (log_header, log) = csv(&folder.read("log.csv"));
    let place = |header: &[String], name: &str| header.iter().position(|h| h == name).unwrap();
    let (a, hat, y) = (
        place(&header, "a"),
        place(&header, "a_hat"),
        place(&log_header, "y"),
    );
    let errors: Vec<f64> = rows.iter().zip(&log).map(|(r, l)| l[y] - r[a]).collect();
    let largest = errors.iter().fold(0.0, |m: f64, e| m.max(e.abs()));
    assert!(largest <= 0.3 + 1e-9 && largest > 0.29, "{largest}");
    let square = errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64;
    assert!((square / 0.03 - 1.0).abs() < 0.2, "{square}");
    let late = rows.iter().skip(rows.len() / 2);
    let off = late.map(|r| (r[a] - r[hat]).abs()).fold(0.0, f64::max);
    assert!(off <= bound && off > 0.0, "{off} against {bound}");
}
