//! A study's estimator, sample by sample, is what `estimate` makes of the log.

use lynkeus::{Study, Table};

use crate::Folder;

const FILTER: &str = "
[process_noise]
pump = 0.001

[observer]
family = \"FAMILY\"

[estimate]
sd = true
method = \"rk4\"
substeps = 2
";

/// The two tanks' study with another observer.
fn with(folder: &Folder, family: &str) {
    let study = folder.read("study.toml");
    let from = study.find("[observer]").unwrap();
    let text = FILTER.replace("FAMILY", family);
    folder.write("study.toml", &format!("{}{text}", &study[..from]));
}

#[test]
fn live_samples_give_what_the_log_gives() {
    for family in ["triangular", "ekf", "ukf", "mhe"] {
        let folder = Folder::new();
        match family {
            "triangular" => folder.change("study.toml", "\"linear\"", "\"predict\""),
            filter => with(&folder, filter),
        }
        // a sensor that is silent now and then
        let text: Vec<String> = folder
            .read("log.csv")
            .lines()
            .take(120)
            .map(str::to_owned)
            .collect();
        let silent = text.iter().enumerate().map(|(k, line)| {
            let cells: Vec<&str> = line.split(',').collect();
            match (k % 7, &cells[..]) {
                (3, [t, _, pump]) => format!("{t},,{pump}\n"),
                _ => format!("{line}\n"),
            }
        });
        folder.write("log.csv", &silent.collect::<String>());
        let study = Study::load(folder.path.path().join("study.toml")).unwrap();
        let log = Table::load(folder.path.path().join("log.csv")).unwrap();
        let outcome =
            lynkeus::estimate(&study, &log, &mut |_| std::ops::ControlFlow::Continue(())).unwrap();
        let mut live = lynkeus::estimator(&study).unwrap();
        assert_eq!(live.signals(), ["level"], "{family}");
        let (times, readings) = (log.time("t").unwrap(), log.readings("level").unwrap());
        for (row, (t, level)) in times.iter().zip(readings).enumerate() {
            live.push(t, &[level]).unwrap();
            for (i, name) in live.names().iter().enumerate() {
                let quantity = outcome.quantities.iter().find(|q| q.name == *name).unwrap();
                let replayed = quantity.estimate.as_ref().unwrap().get(row).unwrap();
                assert_eq!(
                    live.estimate()[i].to_bits(),
                    replayed.to_bits(),
                    "{family}: {name} in row {row}"
                );
                if let Some(deviation) = &quantity.deviation {
                    assert_eq!(
                        live.deviations().unwrap()[i].to_bits(),
                        deviation.get(row).unwrap().to_bits()
                    );
                }
            }
        }
        assert_eq!(live.health().sensors[0].missing, 17, "{family}");
    }
}

#[test]
fn what_only_a_log_could_tell_is_asked_for() {
    let refusal = |folder: &Folder| {
        let study = Study::load(folder.path.path().join("study.toml")).unwrap();
        lynkeus::estimator(&study).unwrap_err().to_string()
    };
    let folder = Folder::new();
    assert!(refusal(&folder).contains("looks ahead"));
    with(&folder, "ekf");
    folder.change("study.toml", "noise = { level", "# noise = { level");
    assert!(refusal(&folder).contains("noise = { level = … } under [sensors]"));
    folder.change("study.toml", "# noise = { level", "noise = { level");
    folder.change("study.toml", "pump = 0.001", "lower = 0.001");
    assert!(refusal(&folder).contains("pump = … under [process_noise]"));
}
