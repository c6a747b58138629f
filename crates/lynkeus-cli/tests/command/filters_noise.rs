//! Standard deviations of filters: coarse samples, noise that grows with the value, limits of sensors,
//! declared ranges, smoothers.

use crate::{Folder, csv};

const FILTERS: [&str; 3] = ["ekf", "ukf", "mhe"];

/// The last value of a column.
fn last(table: &str, name: &str) -> f64 {
    column(table, name).last().copied().unwrap()
}

fn column(table: &str, name: &str) -> Vec<f64> {
    let (header, rows) = csv(table);
    let place = header.iter().position(|n| n == name);
    let place = place.unwrap_or_else(|| panic!("{name} in {header:?}"));
    rows.iter().map(|row| row[place]).collect()
}

/// One state that does not move, from `sensors` on.
fn constant(range: &str, study: &str) -> Folder {
    let folder = Folder::empty();
    let model = format!(
        "model M\n  Real x({range});\n  output Real y = x;\n  output Real z = x;\nequation\n  der(x) = 0;\nend M;\n"
    );
    folder.write("m.mo", &model);
    folder.write(
        "s.toml",
        &format!("plant = \"m.mo\"\n{study}\n[estimate]\nsd = true\n"),
    );
    folder
}

/// x1' = −x1 + 40x2, x2' = −40x2 + w every 2: W₁₁ = ∫ (40/39)²(e^−s − e^−40s)² ds.
#[test]
fn process_noise_goes_through_the_flow_between_coarse_samples() {
    for family in FILTERS {
        let folder = Folder::empty();
        folder.write("m.mo", "model M\n  Real x1(start = 0, min = -9, max = 9);\n  Real x2(start = 0, min = -9, max = 9);\n  output Real y = x2;\nequation\n  der(x1) = -x1 + 40*x2;\n  der(x2) = -40*x2;\nend M;\n");
        folder.write("s.toml", &format!("plant = \"m.mo\"\n[sensors]\nnoise = {{ y = 100 }}\n[process_noise]\nx1 = 0\nx2 = 1\n[observer]\nfamily = \"{family}\"\ninitial_variance = {{ default = 0 }}\n[estimate]\nsd = true\nrtol = 1e-10\natol = 1e-12\n"));
        folder.write("log.csv", "t,y\n0,0\n2,0.1\n4,-0.1\n6,0.05\n");
        let ended = folder.run(&["estimate", "s.toml", "log.csv"]);
        // ∫ of the square from 0 to T, T = 6: a reading with noise of 100 tells nothing
        let part = |rate: f64| (1.0 - (-6.0 * rate).exp()) / rate;
        let share = (40.0_f64 / 39.0).powi(2);
        let variance = share * (part(2.0) - 2.0 * part(41.0) + part(80.0));
        let found = last(&ended.out, "x1_sd");
        assert!(
            (found / variance.sqrt() - 1.0).abs() < 1e-4,
            "{family}: {found}"
        );
    }
}

/// x is 1 and expected to be 0: a share of nothing is no perfect sensor. Beside a sensor with a noise of
/// its own, and started much too surely.
#[test]
fn a_share_of_a_prediction_of_zero_is_no_perfect_reading() {
    for family in FILTERS {
        for (measured, start) in [
            ("noise = { y = \"20%\" }\nmeasured = [\"y\"]", "x = 1"),
            ("noise = { y = \"20%\", z = 0.5 }", "x = 1"),
            ("noise = { y = \"10%\" }\nmeasured = [\"y\"]", "x = 0.04"),
        ] {
            let study = format!(
                "[sensors]\n{measured}\n[process_noise]\nx = 0\n[observer]\nfamily = \"{family}\"\ninitial = {{ x = 0 }}\ninitial_variance = {{ {start} }}\n[simulate]\nuntil = 60\noutput_step = 0.1\nseed = 5"
            );
            let folder = constant("start = 1, min = -4, max = 4", &study);
            let ended = folder.run(&["simulate", "s.toml", "-o", "o.csv"]);
            let table = folder.read("o.csv");
            let (x, sd) = (last(&table, "x_hat"), last(&table, "x_sd"));
            let what = format!("{family}, {measured}, {start}: {x} +- {sd} {}", ended.err);
            assert!(sd > 0.003 && (x - 1.0).abs() <= 4.0 * sd, "{what}");
        }
    }
}

/// At the end of a sensor's range, beyond it, at its lower end and inside of it: within four
/// deviations, which are those that clipped readings allow.
#[test]
fn a_state_at_the_end_of_a_range_is_found_without_bias() {
    for family in FILTERS {
        for (limits, told) in [
            ("[0, 1]", Some(0.818_3)),
            ("[0, 0.9]", Some(0.470_3)),
            ("[1, 3]", Some(0.818_3)),
            ("[-2, 4]", Some(1.0)),
        ] {
            let study = format!(
                "[sensors]\nmeasured = [\"y\"]\nnoise = {{ y = 0.1 }}\nlimits = {{ y = {limits} }}\n[process_noise]\nx = 0\n[observer]\nfamily = \"{family}\"\ninitial = {{ x = 0.95 }}\ninitial_variance = {{ x = 0.1 }}\n[simulate]\nuntil = 100\noutput_step = 0.1\nseed = 2"
            );
            let folder = constant("start = 1, min = -4, max = 4", &study);
            let ended = folder.run(&["simulate", "s.toml", "-o", "o.csv"]);
            let table = folder.read("o.csv");
            let (x, sd) = (last(&table, "x_hat"), last(&table, "x_sd"));
            let what = format!("{family}, {limits}: {x} +- {sd} {}", ended.err);
            assert!((x - 1.0).abs() <= 4.0 * sd, "{what}");
            if let Some(told) = told {
                // 1001 readings beside the start
                let expected = f64::sqrt(0.01 / (1001.0 * told));
                assert!((sd / expected - 1.0).abs() < 0.12, "{what} for {expected}");
            }
        }
    }
}

/// Two outputs of x = 1.2, noise 0.1: the one that ends at 1 tells 13.4 % of what the other does.
#[test]
fn how_well_counts_what_clipped_readings_tell() {
    let study = "[sensors]\nnoise = { y = 0.1, z = 0.1 }\nlimits = { y = [0, 1] }\n[process_noise]\nx = 0\n[observer]\nfamily = \"ekf\"\n[simulate]\nuntil = 9\noutput_step = 0.1";
    let folder = constant("start = 1.2, min = 0, max = 2", study);
    let error = |folder: &Folder| {
        let ended = folder.run(&["check", "s.toml", "--how-well", "--json"]);
        ended.json()["standard_error"]["x"].as_f64().unwrap()
    };
    let both = (0.01_f64 / (91.0 * 1.133_714_95)).sqrt();
    let found = error(&folder);
    assert!((found / both - 1.0).abs() < 1e-3, "{found} for {both}");
    folder.change(
        "s.toml",
        "noise = { y = 0.1, z = 0.1 }",
        "measured = [\"y\"]\nnoise = { y = 0.1 }",
    );
    let alone = (0.01_f64 / (91.0 * 0.133_714_95)).sqrt();
    let found = error(&folder);
    assert!((found / alone - 1.0).abs() < 1e-3, "{found} for {alone}");
}

/// A level that is empty and a flow that leaves it: neither goes below zero.
#[test]
fn projected_estimates_keep_to_their_ranges() {
    for family in ["ekf", "ukf"] {
        let folder = Folder::empty();
        folder.write("m.mo", "model M\n  Real h(start = 0.1, min = 0, max = 2);\n  Real q(start = 0.05, min = 0, max = 1);\n  output Real y = h;\nequation\n  der(h) = -q;\n  der(q) = 0;\nend M;\n");
        let study = format!(
            "plant = \"m.mo\"\n[sensors]\nnoise = {{ y = 0.05 }}\n[process_noise]\nh = 1e-3\nq = 1e-3\n[observer]\nfamily = \"{family}\"\nbounds = \"project\"\n[estimate]\nsd = true\nmethod = \"rk4\"\nstep = 0.1\n"
        );
        folder.write("s.toml", &study);
        let rows: String = (0..80)
            .map(|k| format!("{},{}\n", 0.5 * f64::from(k), 0.05 * f64::from(k).sin()))
            .collect();
        folder.write("log.csv", &format!("t,y\n{rows}"));
        let ended = folder.run(&["estimate", "s.toml", "log.csv", "-o", "o.csv"]);
        assert!(
            ended.err.contains("put back into the declared ranges"),
            "{}",
            ended.err
        );
        let table = folder.read("o.csv");
        for (name, high) in [("h", 2.0), ("q", 1.0)] {
            let all = column(&table, &format!("{name}_hat"));
            assert!(
                all.iter().all(|x| (0.0..=high).contains(x)),
                "{family}: {all:?}"
            );
            assert!(
                column(&table, &format!("{name}_sd"))
                    .iter()
                    .all(|sd| *sd > 0.0)
            );
        }
        folder.change("s.toml", "bounds = \"project\"", "");
        folder.run(&["estimate", "s.toml", "log.csv", "-o", "free.csv"]);
        assert!(
            column(&folder.read("free.csv"), "h_hat")
                .iter()
                .any(|h| *h < 0.0)
        );
        folder.write("s.toml", &study.replace("sd = true", "smooth = true"));
        let refused = folder.run(&["estimate", "s.toml", "log.csv"]);
        assert!(
            refused.code == 2 && refused.err.contains("mhe"),
            "{}",
            refused.err
        );
        folder.write("s.toml", &study);
        let refused = folder.run(&["export", "s.toml", "--to", "c", "-o", "code"]);
        assert!(
            refused.code == 1 && refused.err.contains("project"),
            "{}",
            refused.err
        );
    }
}

/// A constant given all rows is known as well at each of them as at the last one.
#[test]
fn smoothers_say_how_sure_they_are() {
    for family in FILTERS {
        for smooth in ["smooth = true", "lag = 4"] {
            let study = format!(
                "[sensors]\nmeasured = [\"y\"]\nnoise = {{ y = 0.1 }}\n[process_noise]\nx = 0\n[observer]\nfamily = \"{family}\"\ninitial_variance = {{ x = 1 }}\nSMOOTH"
            );
            let folder = constant("start = 1, min = -9, max = 9", &study);
            folder.change("s.toml", "SMOOTH", "");
            folder.change("s.toml", "sd = true", &format!("sd = true\n{smooth}"));
            let rows: String = (0..20).map(|k| format!("{k},1.0{}\n", k % 7)).collect();
            folder.write("log.csv", &format!("t,y\n{rows}"));
            let ended = folder.run(&["estimate", "s.toml", "log.csv"]);
            let (header, _) = csv(&ended.out);
            let expected = ["t", "x_hat", "x_sd", "x_smooth", "x_smooth_sd"];
            assert_eq!(header[..5], expected, "{}", ended.err);
            let (filter, smoothed) = (
                column(&ended.out, "x_sd"),
                column(&ended.out, "x_smooth_sd"),
            );
            for (k, sd) in smoothed.iter().enumerate() {
                let as_of = if smooth == "lag = 4" {
                    (k + 4).min(19)
                } else {
                    19
                };
                let off = (sd / filter[as_of] - 1.0).abs();
                assert!(
                    off < 1e-6,
                    "{family}, {smooth}, row {k}: {sd} for {}",
                    filter[as_of]
                );
            }
        }
    }
}

/// A fast state whose variance vanishes leaves no deviation of the others behind: the smoother of `ukf` has those of `ekf`.
#[test]
fn smoothed_deviations_survive_a_state_without_variance() {
    let table = |family: &str| {
        let folder = Folder::empty();
        folder.write("m.mo", "model M Real x(start = 0); Real z(start = 0); output Real y = x + z; equation der(x) = -0.1*x; der(z) = -20*z; end M;");
        let study = format!(
            "plant = \"m.mo\"\n[sensors]\nnoise = {{ y = 0.1 }}\n[process_noise]\nx = 0.1\n[observer]\nfamily = \"{family}\"\ninitial_variance = {{ x = 1, z = 1 }}\n[estimate]\nsd = true\nsmooth = true\n"
        );
        folder.write("s.toml", &study);
        let rows = (0..40).map(|k| format!("{k},{}\n", if k % 2 == 0 { 0.1 } else { -0.1 }));
        folder.write("log.csv", &format!("t,y\n{}", rows.collect::<String>()));
        let ended = folder.run(&["estimate", "s.toml", "log.csv", "-o", "o.csv"]);
        assert_eq!(ended.code, 0, "{}", ended.err);
        column(&folder.read("o.csv"), "x_smooth_sd")
    };
    for (k, (of_ekf, of_ukf)) in table("ekf").iter().zip(table("ukf")).enumerate() {
        assert!(
            (of_ukf / of_ekf - 1.0).abs() < 1e-6,
            "{k}: {of_ekf} {of_ukf}"
        );
    }
}

/// x' = −100x³ + w starts where nothing draws it back, and scatters as exp(−50x⁴) says: by quadrature with 0.2186.
#[test]
fn process_noise_is_drawn_for_where_it_takes_the_plant() {
    let folder = Folder::empty();
    folder.write(
        "m.mo",
        "model M Real x(start = 0); output Real y = x; equation der(x) = -100*x^3; end M;",
    );
    folder.write("s.toml", "plant = \"m.mo\"\n[sensors]\nnoise = { y = 0.1 }\n[process_noise]\nx = 1\n[observer]\nfamily = \"ekf\"\n[simulate]\nuntil = 1500\noutput_step = 1\nseed = 3\n");
    let ended = folder.run(&["simulate", "s.toml", "-o", "o.csv"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let x = column(&folder.read("o.csv"), "x");
    let variance = x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64;
    // of 1,500 independent samples to 1.5 %
    assert!(
        (variance.sqrt() / 0.2186 - 1.0).abs() < 0.06,
        "{}",
        variance.sqrt()
    );
}
