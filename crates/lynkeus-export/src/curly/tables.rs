//! Numbers as text of the draft.

/// A number.
pub(super) fn number(value: f64) -> String {
    match value {
        v if v == f64::INFINITY => "INFINITY".to_owned(),
        v if v == f64::NEG_INFINITY => "-INFINITY".to_owned(),
        v if v < 0.0 => format!("-R({:?})", -v),
        v => format!("R({v:?})"),
    }
}

/// A table of numbers.
pub(super) fn table(name: &str, values: &[f64]) -> String {
    let texts: Vec<String> = values.iter().map(|value| number(*value)).collect();
    listed("real", name, texts, "R(0.0)")
}

/// A table of places.
pub(super) fn places(name: &str, values: impl Iterator<Item = usize>) -> String {
    let texts = values.map(|value| value.to_string()).collect();
    listed("int", name, texts, "0")
}

/// No language has a table without entries.
fn listed(kind: &str, name: &str, mut texts: Vec<String>, zero: &str) -> String {
    if texts.is_empty() {
        texts.push(zero.to_owned());
    }
    let count = texts.len();
    format!(
        "static const {kind} {name}[{count}] = {{{}}};\n",
        texts.join(", ")
    )
}
