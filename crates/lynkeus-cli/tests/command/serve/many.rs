//! Many plants of one study.

use super::process::Serving;
use super::*;

#[test]
fn each_asset_is_what_it_is_alone() {
    let parameters = "parameter Real k = 0.2;\n  input Real u;";
    let with = |more: &str| {
        let folder = folder("ekf", more);
        folder.change("tank.mo", "input Real u;", parameters);
        folder.change("tank.mo", "0.2*level", "k*level");
        folder
    };
    let folder =
        with("[estimate]\nsd = true\n[serve]\nassets = \"assets.csv\"\nstate = \"all.state\"");
    let ks = [0.2, 0.25, 0.2];
    let assets: String = ks
        .iter()
        .enumerate()
        .map(|(i, k)| format!("tank {i},{k}\n"))
        .collect();
    folder.write("assets.csv", &format!("asset,k\n{assets}"));
    let all: Vec<Vec<Row>> = (0..3).map(|i| rows(50 + i, 60, true)).collect();
    let mut input = vec![];
    for k in 0..60 {
        for (i, rows) in all.iter().enumerate() {
            let row = rows[k].json();
            input.push(format!("{{\"asset\":\"tank {i}\",{}", &row[1..]));
        }
    }
    // a restart in the middle
    let mut answers = vec![];
    for part in input.chunks(90) {
        let ended = served(&folder, "json", &part.concat());
        assert_eq!(ended.code, 0, "{}", ended.err);
        answers.extend(lines(&ended.out));
    }
    assert_eq!(answers.len(), 180);
    for (i, (rows, k)) in all.iter().zip(ks).enumerate() {
        let alone = with(&format!("[estimate]\nsd = true\n[parameters]\nk = {k}"));
        let own = answers
            .iter()
            .filter(|line| line["asset"] == format!("tank {i}"));
        let own: Vec<Value> = own.cloned().collect();
        assert!(last(&own) == estimated(&alone, rows), "{i}");
    }
    let ended = served(
        &folder,
        "json",
        "{\"asset\":\"tank 9\",\"t\":1}\n{\"t\":1}\n",
    );
    let errors = lines(&ended.out);
    assert!(
        errors[0]["error"]
            .as_str()
            .unwrap()
            .contains("no asset is called \"tank 9\"")
    );
    assert!(
        errors[1]["error"]
            .as_str()
            .unwrap()
            .contains("under \"asset\"")
    );
}

#[test]
fn assets_that_are_wrong_are_refused_by_their_line() {
    for (table, words) in [
        (
            "asset,k\na,1\na,2\n",
            "assets.csv:3: the asset \"a\" is there in line 2 already",
        ),
        (
            "asset,k\na,x\n",
            "assets.csv:2: k of \"a\": expected a number",
        ),
        ("name\na\n", "expected a column \"asset\""),
        ("asset\n", "found none"),
        ("asset,nothing\na,1\n", "nothing"),
    ] {
        let folder = folder("ekf", "[serve]\nassets = \"assets.csv\"");
        folder.write("assets.csv", table);
        let ended = served(&folder, "json", "");
        assert_eq!(ended.code, 2);
        assert!(ended.err.contains(words), "{}", ended.err);
    }
}

/// Rows since the last snapshot are those of their assets, wherever these stand in the table after a kill.
#[test]
fn a_table_may_change_after_a_kill() {
    let folder = folder(
        "ekf",
        "[estimate]\nsd = true\n[serve]\nassets = \"assets.csv\"\nstate = \"all.state\"",
    );
    folder.write("assets.csv", "asset\na\nb\nc\n");
    let all: Vec<Vec<Row>> = (0..3).map(|i| rows(60 + i, 20, true)).collect();
    let input = |range: std::ops::Range<usize>| -> String {
        let names = ["a", "b", "c"].iter().zip(&all);
        let rows =
            names.flat_map(|(name, rows)| rows[range.clone()].iter().map(move |row| (name, row)));
        rows.map(|(name, row)| format!("{{\"asset\":\"{name}\",{}", &row.json()[1..]))
            .collect()
    };
    let mut serving = Serving::new(&folder, "json", "");
    serving.send(&input(0..10));
    let mut answers: Vec<Value> = (0..30)
        .map(|_| serde_json::from_str(&serving.answer().unwrap()).unwrap())
        .collect();
    serving.kill();
    folder.write("assets.csv", "asset\nnew\nc\na\n");
    let ended = served(&folder, "json", &input(10..20));
    assert!(
        ended.err.contains("the state of \"b\" is left out"),
        "{}",
        ended.err
    );
    assert!(
        ended.err.contains("the state before is all.state.20"),
        "{}",
        ended.err
    );
    answers.extend(lines(&ended.out));
    let alone = super::folder("ekf", "[estimate]\nsd = true");
    for (name, rows) in [("a", &all[0]), ("c", &all[2])] {
        let own = answers.iter().filter(|line| line["asset"] == name);
        let own: Vec<Value> = own.cloned().collect();
        assert!(last(&own) == estimated(&alone, rows), "{name}");
    }
}
