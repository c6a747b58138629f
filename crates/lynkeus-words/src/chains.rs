//! Chains of states and their eigenvalues.

use crate::short;

/// `(x1 → x2) and (x3)`
pub(crate) fn chains(all: &[Vec<String>], between: &str) -> String {
    let one = |states: &Vec<String>| format!("({})", states.join(" → "));
    all.iter().map(one).collect::<Vec<_>>().join(between)
}

/// `eigenvalues −1, −2 ± 1i`, conjugate pairs once, or that none were found.
pub(crate) fn eigenvalues(found: &[(f64, f64)]) -> String {
    if found.is_empty() {
        return "eigenvalues beyond the range of numbers".to_owned();
    }
    let one = |&(re, im): &(f64, f64)| match im == 0.0 {
        true => short(re),
        false => format!("{} ± {}i", short(re), short(im)),
    };
    let upper = found.iter().filter(|λ| λ.1 >= 0.0);
    format!(
        "eigenvalues {}",
        upper.map(one).collect::<Vec<_>>().join(", ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_are_listed_once() {
        let found = [(-3.0, 0.0), (1.0, 2.0), (1.0, -2.0)];
        assert_eq!(eigenvalues(&found), "eigenvalues -3, 1 ± 2i");
    }
}
