//! What cannot be used is refused by its line, and changes nothing.

use super::process::Serving;
use super::*;

/// Lines that no row is made of; `k` makes them differ.
fn hostile(k: usize, random: &mut Normal) -> Vec<u8> {
    let number = (random.uniform() * 1e6) as u32;
    let text = match k % 16 {
        0 => format!("{{\"t\":{number},\"y\":\"1\"}}"),
        1 => "{\"t\":1e999,\"y\":1}".to_owned(),
        2 => "{\"t\":NaN,\"y\":1,\"u\":1}".to_owned(),
        3 => format!("{{\"y\":{number}}}"),
        4 => "[".repeat(1 + number as usize % 5000),
        5 => format!("{{\"t\":\"2026-02-30T00:00:{}\"}}", number % 60),
        6 => "{\"t\":{},\"y\":[]}".to_owned(),
        7 => format!("{{\"t\":{number},\"y\":{{\"a\":1}}}}"),
        8 => "../../etc/passwd".to_owned(),
        9 => format!("{{\"t\":true,\"y\":{number}}}"),
        10 => "x".repeat(70_000),
        11 => format!("{{\"t\":\"2026-01-01T00:00:00Z\",\"y\":{number},\"u\":1}}"),
        12 => "\u{1}\u{1b}[2J".to_owned(),
        13 => format!("{{\"t\":-{number}.5,\"y\":1,\"u\":1}}"),
        14 => "{\"t\":1,\"t\":{\"t\":1},\"u\":null".to_owned(),
        _ => {
            let bytes =
                (0..1 + number as usize % 200).map(|_| 128 + (random.uniform() * 128.0) as u8);
            return bytes.chain([b'\n']).collect();
        }
    };
    format!("{text}\n").into_bytes()
}

#[test]
fn a_thousand_hostile_lines_change_nothing() {
    let folder = folder(
        "ekf",
        "[estimate]\nsd = true\n[serve]\nstate = \"tank.state\"",
    );
    let rows = rows(21, 50, true);
    let mut random = Normal(21);
    let mut input = vec![];
    for (k, row) in rows.iter().enumerate() {
        input.extend_from_slice(row.json().as_bytes());
        for j in 0..20 {
            input.extend(hostile(20 * k + j, &mut random));
        }
    }
    let file = folder.path.path().join("input");
    std::fs::write(&file, &input).unwrap();
    let mut serving = Serving::new(&folder, "json", "exec <input;");
    let mut answers = vec![];
    while let Some(line) = serving.answer() {
        answers.push(line);
    }
    assert_eq!(answers.len(), 21 * rows.len());
    assert!(
        answers
            .iter()
            .all(|line| !line.chars().any(char::is_control))
    );
    let answers = lines(&answers.join("\n"));
    for (place, line) in answers.iter().enumerate() {
        match place % 21 {
            0 => assert!(line["error"].is_null(), "{line}"),
            _ => assert_eq!(line["line"], place as u64 + 1, "{line}"),
        }
    }
    let told: Vec<Value> = answers.into_iter().step_by(21).collect();
    assert!(last(&told) == estimated(&folder, &rows));
    let ended = serving.end();
    assert_eq!(ended.code, 0, "{}", ended.err);
}

/// A time so far on that no integration comes there ends with a refusal, and the next row goes on.
#[test]
fn a_clock_that_is_far_off_changes_nothing() {
    let folder = folder(
        "ekf",
        "[estimate]\nsd = true\nmethod = \"rk4\"\nstep = 0.01",
    );
    let rows = rows(22, 20, true);
    let far = Row {
        t: 1e300,
        ..rows[3]
    };
    let input = [json(&rows[..10]), far.json(), json(&rows[10..])].concat();
    let answers = lines(&served(&folder, "json", &input).out);
    assert_eq!(answers.len(), 21);
    assert!(answers[10]["error"].is_string(), "{}", answers[10]);
    let told: Vec<Value> = answers
        .into_iter()
        .filter(|l| l["error"].is_null())
        .collect();
    assert!(last(&told) == estimated(&folder, &rows));
}

#[test]
fn what_the_first_row_lacks_is_said() {
    let folder = folder("ekf", "[estimate]\nsd = true");
    let input = "{\"t\":0,\"y\":2}\n{\"t\":1,\"y\":2,\"u\":0.4,\"levle\":3}\n";
    let ended = served(&folder, "json", input);
    let answers = lines(&ended.out);
    assert!(
        answers[0]["error"]
            .as_str()
            .unwrap()
            .contains("the first row needs u")
    );
    assert_eq!(answers[1]["revision"], 0);
    assert!(
        ended
            .err
            .contains("\"levle\" of a message is read by nobody"),
        "{}",
        ended.err
    );
}
