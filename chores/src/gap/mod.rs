//! `docs/gap.md`: how much gain a plant needs, how much a theorem asks for, and how much
//! a linear matrix inequality proves enough.
//!
//! Every number comes from the built command: `simulate` from seeded starts, `certify`.
//! The text around the table is written by hand and stays.

mod rows;
mod search;
mod study;
mod tool;
mod trial;

use std::fmt::Write as _;
use std::fs;

use rows::{ROWS, Row};
use search::{Found, smallest};
use study::Text;
use xtask::process::{cargo, root, run};

const BEGIN: &str = "<!-- table: cargo xtask gap -->\n";
const END: &str = "<!-- end of table -->";
const HEAD: &str = "\
| study | box | 1 % by | simulation | theorem | inequality | inequality ÷ simulation | rate proved at the study's tuning | with `gain = \"lmi\"` |
|---|---|---|---|---|---|---|---|---|
";

/// Computes the table again; only rows whose study contains `only`, the others stay.
pub fn tabulate(only: Option<&str>) -> Result<(), String> {
    run(&mut cargo(&["build", "--release", "-p", "lynkeus-cli"]))?;
    let page = root().join("docs").join("gap.md");
    let text = fs::read_to_string(&page).map_err(|e| format!("{}: {e}", page.display()))?;
    let (before, rest) = text
        .split_once(BEGIN)
        .ok_or("docs/gap.md has no table mark")?;
    let (old, after) = rest
        .split_once(END)
        .ok_or("docs/gap.md: the table has no end")?;
    let mut table = HEAD.to_owned();
    for row in ROWS {
        let label = format!("| {} |", row.label);
        let kept = old.lines().find(|line| line.starts_with(&label));
        let line = match (only, kept) {
            (Some(only), Some(kept)) if !row.study.contains(only) => kept.to_owned(),
            _ => line(row)?,
        };
        eprintln!("{line}");
        let _ = writeln!(table, "{line}");
    }
    let text = format!("{before}{BEGIN}{table}{END}{after}");
    fs::write(&page, text).map_err(|e| format!("{}: {e}", page.display()))
}

fn line(row: &Row) -> Result<String, String> {
    let text = Text::of(row)?;
    let certified = tool::certify(&text.scaled(1.0))?;
    let asked = 100.0_f64.ln() / row.by;
    let starts = trial::starts(row, &text, &certified)?;
    let simulated = smallest(-10..=8, |factor| {
        Ok(trial::converges(row, &text.scaled(factor), &starts))
    })?;
    let proved = match row.inequality {
        None => smallest(-8..=12, |factor| {
            let certificate = tool::certify(&text.scaled(factor))?;
            Ok(certificate.rate_by_inequality().is_some_and(|r| r >= asked))
        })?,
        Some(_) => Found::Never,
    };
    let cells = [
        row.label.to_owned(),
        row.place.to_owned(),
        format!("{} {}", row.by, row.unit),
        in_words(row, &text, simulated),
        theorem(row)?,
        match row.inequality {
            Some(reason) => reason.to_owned(),
            None => in_words(row, &text, proved),
        },
        match (proved, simulated) {
            (Found::From(p), Found::From(s)) => number(p / s),
            _ => "–".to_owned(),
        },
        rate(row, certified.rate_by_inequality()),
        designed(row, &text)?,
    ];
    Ok(format!("| {} |", cells.join(" | ")))
}

fn in_words(row: &Row, text: &Text, found: Found) -> String {
    match found {
        Found::From(factor) => format!("{} = {}", row.key, text.tuning(factor)),
        Found::Any => "any".to_owned(),
        Found::Never => "none".to_owned(),
    }
}

fn rate(row: &Row, rate: Option<f64>) -> String {
    rate.map_or("–".to_owned(), |r| format!("{}/{}", number(r), row.unit))
}

/// What the family's theorem asks for.
fn theorem(row: &Row) -> Result<String, String> {
    let Some((constant, name)) = row.theorem else {
        return Ok("not covered".to_owned());
    };
    let text = Text::for_theorem(row)?;
    let value = tool::certify(&text.scaled(1.0))?.constant(constant);
    Ok(value.map_or("none".to_owned(), |value| {
        format!("{name} = {}", number(value))
    }))
}

/// The fastest decay with gains no larger than the study's.
fn designed(row: &Row, text: &Text) -> Result<String, String> {
    if !row.redesign {
        return Ok("–".to_owned());
    }
    let limit = tool::largest_gain(&text.scaled(1.0))?;
    let found = tool::certify(&text.with_designed_gain(limit));
    let found = found.ok().and_then(|c| c.rate_by_inequality());
    Ok(match found {
        Some(_) => format!("{} with gains ≤ {}", rate(row, found), number(limit)),
        None => format!("none with gains ≤ {}", number(limit)),
    })
}

/// Two or three digits, as people write them.
fn number(x: f64) -> String {
    let size = x.abs();
    if !(1e-3..1e5).contains(&size) {
        return format!("{x:.1e}")
            .replace('e', "·10^")
            .replace("10^-", "10^−");
    }
    let digits = (2.0 - size.log10().floor()).clamp(0.0, 4.0);
    let text = format!("{x:.*}", digits as usize);
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}
