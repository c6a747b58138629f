//! Replays a log through the estimator: a table with a column t (time, where a signal is called t) and one
//! for each signal, comma separated, from standard input; estimates to standard output. An empty cell is a
//! sensor that did not report.

use std::io::BufRead;
use std::process::ExitCode;

use @CRATE@::{ESTIMATE_NAMES, ESTIMATES, SIGNAL_NAMES, SIGNALS, State};

/// The cells of a line; quotes around one are taken off.
fn cells(line: &str) -> Vec<String> {
    let mut cells = vec![String::new()];
    let mut is_quoted = false;
    for letter in line.trim_end().chars() {
        match letter {
            '"' => is_quoted = !is_quoted,
            ',' if !is_quoted => cells.push(String::new()),
            other => {
                if let Some(cell) = cells.last_mut() {
                    cell.push(other);
                }
            }
        }
    }
    cells.iter().map(|cell| cell.trim().to_owned()).collect()
}

/// A cell as a number, NaN where it is empty.
fn number(cells: &[String], place: usize) -> Result<f64, String> {
    match cells.get(place).map_or("", String::as_str) {
        "" => Ok(f64::NAN),
        cell => cell.parse().map_err(|_| format!("expected a number, found {cell}")),
    }
}

fn replayed() -> Result<(), String> {
    let mut lines = std::io::stdin().lock().lines();
    let head = lines.next().ok_or("expected a table on standard input, found nothing")?;
    let head = cells(&head.map_err(|error| error.to_string())?);
    let column = |name: &str| {
        let place = head.iter().position(|cell| cell == name);
        place.ok_or(format!("expected a column {name}"))
    };
    let time_name = if SIGNAL_NAMES.contains(&"t") { "time" } else { "t" };
    let time = column(time_name)?;
    let mut places = [0; SIGNALS];
    for (place, name) in places.iter_mut().zip(SIGNAL_NAMES) {
        *place = column(name)?;
    }
    let names = ESTIMATE_NAMES.map(|name| match name.contains(',') {
        true => format!("\"{name}\""),
        false => name.to_owned(),
    });
    println!("{time_name},{}", names.join(","));
    let mut state = State::new();
    let mut estimates = [0.0; ESTIMATES];
    for (row, line) in lines.enumerate() {
        let line = line.map_err(|error| error.to_string())?;
        if line.trim().is_empty() {
            continue;
        }
        let cells = cells(&line);
        let at_row = |error: String| format!("row {}: {error}", row + 2);
        let t = number(&cells, time).map_err(at_row)?;
        let mut signals = [0.0; SIGNALS];
        for (signal, place) in signals.iter_mut().zip(places) {
            *signal = number(&cells, place).map_err(at_row)?@AS_REAL@;
        }
        let taken = state.push(t, &signals, &mut estimates);
        taken.map_err(|refused| format!("row {}, t = {t}: {refused}", row + 2))?;
        let texts = estimates.map(|estimate| estimate.to_string());
        println!("{t},{}", texts.join(","));
    }
    Ok(())
}

fn main() -> ExitCode {
    match replayed() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
