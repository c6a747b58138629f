//! Nothing lost, nothing twice: through `kill -9`, a full disk, and a second instance.

use super::process::{Serving, served_after};
use super::*;

const KEPT: &str = "[estimate]\nsd = true\n[serve]\nstate = \"tank.state\"\n";

/// Sends rows until all are answered, killing the service now and then; what was not answered is sent again, as a
/// client does that knows no better. The answers, in their order.
fn through_kills(folder: &Folder, rows: &[Row], kills: usize, random: &mut Normal) -> Vec<Value> {
    let mut answers: Vec<Value> = vec![];
    let mut answered = 0;
    for round in 0..=kills {
        let mut serving = Serving::new(folder, "json", "");
        let left = rows.len() - answered;
        let is_last = round == kills;
        let sent = match is_last {
            true => left,
            // no more than a pipe holds is on its way at once
            false => (left.min(4000) as f64 * 0.1 * random.uniform()).ceil() as usize,
        };
        serving.send(&json(&rows[answered..answered + sent]));
        let wanted = match is_last {
            true => sent,
            false => (sent as f64 * random.uniform()) as usize,
        };
        // one line of each row at least, more where it corrects others
        let mut owed = wanted;
        while owed > 0 {
            let line: Value = serde_json::from_str(&serving.answer().unwrap()).unwrap();
            let is_own = |t: f64| rows[answered..answered + sent].iter().any(|r| r.t == t);
            let t = line["t"].as_f64().unwrap_or_else(|| panic!("{line}"));
            assert!(is_own(t) || line["revision"] != 0, "{line}");
            if rows[answered + wanted - owed].t == t {
                owed -= 1;
            }
            answers.push(line);
        }
        answered += wanted;
        match is_last {
            true => drop(serving.end()),
            false => serving.kill(),
        }
    }
    answers
}

fn killed(kills: usize, seed: u64) {
    let folder = folder("ekf", KEPT);
    let rows = rows(seed, 40 * kills, true);
    let mut random = Normal(seed);
    let answers = through_kills(&folder, &rows, kills, &mut random);
    assert!(answers.iter().all(|line| line["revision"] == 0));
    assert!(last(&answers) == estimated(&folder, &rows));
}

#[test]
fn killed_a_few_times_it_gives_what_estimate_gives() {
    killed(6, 11);
}

#[test]
#[ignore = "takes minutes"]
fn killed_200_times_it_gives_what_estimate_gives() {
    killed(200, 12);
}

/// Rows in any order within the wait, with a kill after each tenth.
#[test]
fn late_rows_find_their_place_after_a_kill() {
    let folder = folder("ekf", &format!("{KEPT}wait = 5"));
    let rows = rows(13, 60, true);
    let mut late = rows.clone();
    for pair in late[1..].chunks_mut(3) {
        pair.reverse();
    }
    let mut answers = vec![];
    for part in late.chunks(10) {
        let mut serving = Serving::new(&folder, "json", "");
        serving.send(&json(part));
        let mut own = 0;
        while own < part.len() {
            let line: Value = serde_json::from_str(&serving.answer().unwrap()).unwrap();
            own += usize::from(line["revision"] == 0);
            answers.push(line);
        }
        // corrections of the last row follow it at once; they are asked for again
        serving.kill();
    }
    let mut serving = Serving::new(&folder, "json", "");
    serving.send(&json(&rows[50..]));
    for _ in 50..60 {
        answers.push(serde_json::from_str(&serving.answer().unwrap()).unwrap());
    }
    let expected = estimated(&folder, &rows);
    let found = last_of(&answers);
    assert!(
        rows[50..]
            .iter()
            .all(|row| expected[&row.t.to_bits()] == found[&row.t.to_bits()])
    );
}

/// As [`last`], where revisions may have gone unheard.
fn last_of(lines: &[Value]) -> BTreeMap<u64, Told> {
    let told = lines
        .iter()
        .map(|line| (line["t"].as_f64().unwrap().to_bits(), told(line)));
    told.collect()
}

#[test]
fn one_state_has_one_instance() {
    let folder = folder("ekf", KEPT);
    let mut first = Serving::new(&folder, "json", "");
    first.send(&json(&rows(14, 1, false)));
    first.answer().unwrap();
    let second = served(&folder, "json", "");
    assert_eq!(second.code, 2);
    assert!(
        second.err.contains("another program keeps its state here"),
        "{}",
        second.err
    );
    drop(first);
    assert_eq!(served(&folder, "json", "").code, 0);
}

#[test]
fn a_state_of_another_plant_is_refused_and_left_alone() {
    let folder = folder("ekf", KEPT);
    let rows = rows(15, 20, true);
    served(&folder, "json", &json(&rows));
    let before = std::fs::read(folder.path.path().join("tank.state")).unwrap();
    let study = folder.read("study.toml");
    let other = ["Real q", "= q;", "0.1*q", "0.4*q", "der(q)"];
    let other = other.iter().fold(PLANT.to_owned(), |plant, part| {
        plant.replace(part, &part.replace('q', "r"))
    });
    folder.write("tank.mo", &other);
    folder.write("study.toml", &study.replace("q =", "r ="));
    let ended = served(&folder, "json", "");
    assert_eq!(ended.code, 2);
    assert!(ended.err.contains("cannot be taken over"), "{}", ended.err);
    // rolled back it goes on
    folder.write("study.toml", &study);
    folder.write("tank.mo", PLANT);
    assert!(before == std::fs::read(folder.path.path().join("tank.state")).unwrap());
    let ended = served(&folder, "json", "");
    assert!(ended.err.contains("went on after row 20"), "{}", ended.err);
    folder.write("tank.state", "something else");
    let ended = served(&folder, "json", "");
    assert!(
        ended.code == 2 && ended.err.contains("this is no state"),
        "{}",
        ended.err
    );
    assert_eq!(folder.read("tank.state"), "something else");
}

/// A disk that is full: rows are refused and change nothing; where there is room again it goes on.
#[test]
fn a_full_disk_is_told_and_loses_nothing() {
    let folder = folder("ekf", KEPT);
    let rows = rows(16, 300, true);
    // 16 blocks, of 512 or 1024 bytes
    let ended = served_after(&folder, "json", "ulimit -f 16;", &json(&rows));
    let answers = lines(&ended.out);
    assert_eq!(answers.len(), rows.len());
    let taken = answers
        .iter()
        .position(|line| !line["error"].is_null())
        .unwrap();
    assert!(taken > 0);
    let error = answers[taken]["error"].as_str().unwrap();
    assert!(
        error.starts_with("not taken: the state cannot be kept"),
        "{error}"
    );
    assert!(answers[taken..].iter().all(|line| !line["error"].is_null()));
    let rest = lines(&served(&folder, "json", &json(&rows[taken..])).out);
    let all = [&answers[..taken], &rest].concat();
    assert!(last(&all) == estimated(&folder, &rows));
}

/// Every line of the history is there once, through kills.
#[test]
fn the_history_has_each_line_once() {
    let folder = folder("ekf", &format!("{KEPT}history = \"tank-%Y-%m-%d.csv\"\n"));
    let rows = rows(17, 200, true);
    let answers = through_kills(&folder, &rows, 5, &mut Normal(17));
    let names = folder.files().into_iter();
    // the test may run over midnight
    let files: Vec<String> = names.filter(|name| name.starts_with("tank-")).collect();
    let mut found = vec![];
    for file in &files {
        assert_eq!(file.len(), "tank-2026-11-27.csv".len());
        let text = folder.read(file);
        let mut lines = text.lines();
        let header = "t,level_hat,level_sd,q_hat,q_sd,credible,revision";
        assert_eq!(lines.next(), Some(header));
        found.extend(lines.map(str::to_owned));
    }
    let expected: Vec<String> = answers
        .iter()
        .map(|line| {
            let cells = [
                "t",
                "level_hat",
                "level_sd",
                "q_hat",
                "q_sd",
                "credible",
                "revision",
            ];
            let cells = cells.map(|name| line[name].to_string());
            cells.join(",")
        })
        .collect();
    let unlike = |line: &String| line.replace(".0,", ",");
    assert_eq!(found.len(), rows.len());
    for (line, expected) in found.iter().zip(&expected) {
        assert_eq!(unlike(line), unlike(expected));
    }
}
