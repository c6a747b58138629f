//! "Did you mean …?": the nearest of the names that would have been right.

/// The candidate most like `name`, when one is near enough to be a slip of the pen.
pub fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let folded = name.to_lowercase();
    // one letter is like any word that begins with it
    let (least, most) = (name.len().div_ceil(2), 2 * name.len());
    candidates
        .into_iter()
        .filter(|c| (least..=most).contains(&c.len()))
        .map(|c| (strsim::jaro_winkler(&folded, &c.to_lowercase()), c))
        .filter(|(likeness, _)| *likeness >= 0.75)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, candidate)| candidate)
}

/// The hint for a name that is none of `candidates`: the nearest, or all of them.
pub fn suggest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str> + Clone) -> String {
    match nearest(name, candidates.clone()) {
        Some(near) => format!("did you mean \"{near}\"?"),
        None => format!("choose from: {}", list(candidates)),
    }
}

/// Names for a message, cut short when there are many: `a, b, c, … (17 more)`.
pub fn list<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    const SHOWN: usize = 16;
    let names: Vec<&str> = names.into_iter().collect();
    if names.is_empty() {
        return "(none)".to_owned();
    }
    let shown = names.iter().take(SHOWN).copied().collect::<Vec<_>>();
    match names.len().saturating_sub(SHOWN) {
        0 => shown.join(", "),
        more => format!("{}, … ({more} more)", shown.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_finds_its_word_and_a_stranger_the_whole_list() {
        assert_eq!(
            suggest("tehta", ["theta", "delta"]),
            "did you mean \"theta\"?"
        );
        assert_eq!(
            suggest("Level", ["level", "pump"]),
            "did you mean \"level\"?"
        );
        assert_eq!(suggest("zzz", ["theta", "r"]), "choose from: theta, r");
        assert_eq!(suggest("q", []), "choose from: (none)");
        assert_eq!(suggest("therm", ["t", "probe"]), "choose from: t, probe");
    }
}
