//! Licences of all that is linked, beside those that `deny.toml` allows.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::path::Path;

use serde_json::Value;
use xtask::process::cargo;

const DENY: &str = include_str!("../../deny.toml");

/// Lists the licence of every dependency in a file, and refuses one that is not allowed.
///
/// # Errors
/// Which packages have which licence.
pub fn check(list: &Path) -> Result<(), String> {
    let asked = cargo(&[
        "metadata",
        "--format-version",
        "1",
        "--locked",
        "--all-features",
    ])
    .output();
    let asked = asked.map_err(|error| format!("cannot ask cargo for the dependencies: {error}"))?;
    let found: Value = serde_json::from_slice(&asked.stdout)
        .map_err(|error| format!("cannot read what cargo says of the dependencies: {error}"))?;
    let mut packages = BTreeMap::<&str, Vec<String>>::new();
    let all = found["packages"].as_array().into_iter().flatten();
    // the workspace's own have no source
    for package in all.filter(|package| !package["source"].is_null()) {
        let word = |key: &str| package[key].as_str().unwrap_or_default();
        let named = format!("{} {}", word("name"), word("version"));
        packages.entry(word("license")).or_default().push(named);
    }
    let mut text = String::new();
    for (licence, names) in &packages {
        let _ = writeln!(text, "{licence}: {}", names.join(", "));
    }
    fs::write(list, &text).map_err(|error| format!("cannot write {}: {error}", list.display()))?;
    let allowed = allowed(DENY);
    for (licence, names) in &mut packages {
        names.retain(|name| !is_excepted(name, licence, DENY));
    }
    let mut refused = packages
        .iter()
        .filter(|(licence, names)| !names.is_empty() && !holds(licence, &allowed));
    match refused.next() {
        None => Ok(()),
        Some((licence, names)) => Err(format!(
            "deny.toml does not allow \"{licence}\" of {}",
            names.join(", ")
        )),
    }
}

/// The licences of the list `allow`.
fn allowed(deny: &str) -> Vec<&str> {
    let list = deny.split_once("allow = [").map_or("", |(_, rest)| rest);
    let list = list.split(']').next().unwrap_or_default();
    list.split('"').skip(1).step_by(2).collect()
}

/// Whether a package, named with its version, may have a licence that others may not.
fn is_excepted(named: &str, licence: &str, deny: &str) -> bool {
    let name = named.split(' ').next().unwrap_or_default();
    deny.contains(&format!("crate = \"{name}\", allow = [\"{licence}\"]"))
}

/// Whether an expression of SPDX can be met by licences that are allowed. A slash is an old OR.
fn holds(expression: &str, allowed: &[&str]) -> bool {
    let spaced = expression.replace('/', " OR ");
    let spaced = spaced.replace('(', " ( ").replace(')', " ) ");
    let words: Vec<&str> = spaced.split_whitespace().collect();
    let mut reader = Reader {
        words: &words,
        allowed,
    };
    let holds = reader.any();
    holds && reader.words.is_empty()
}

struct Reader<'a> {
    words: &'a [&'a str],
    allowed: &'a [&'a str],
}

impl Reader<'_> {
    fn any(&mut self) -> bool {
        let mut holds = self.all();
        while self.takes("OR") {
            holds |= self.all();
        }
        holds
    }

    fn all(&mut self) -> bool {
        let mut holds = self.one();
        while self.takes("AND") {
            holds &= self.one();
        }
        holds
    }

    fn one(&mut self) -> bool {
        if self.takes("(") {
            let holds = self.any();
            return self.takes(")") && holds;
        }
        let Some((&name, rest)) = self.words.split_first() else {
            return false;
        };
        self.words = rest;
        let mut name = name.to_owned();
        if self.takes("WITH")
            && let Some((exception, rest)) = self.words.split_first()
        {
            name += &format!(" WITH {exception}");
            self.words = rest;
        }
        self.allowed.contains(&name.as_str())
    }

    fn takes(&mut self, word: &str) -> bool {
        let is_next = self.words.first() == Some(&word);
        if is_next {
            self.words = &self.words[1..];
        }
        is_next
    }
}

#[cfg(test)]
mod tests {
    use super::{DENY, allowed, holds};

    #[test]
    fn expressions_are_met_by_what_is_allowed() {
        let allowed = ["MIT", "Unicode-3.0", "Apache-2.0 WITH LLVM-exception"];
        for met in [
            "MIT",
            "MIT/Apache-2.0",
            "GPL-3.0 OR MIT",
            "(MIT OR Apache-2.0) AND Unicode-3.0",
            "Apache-2.0 WITH LLVM-exception OR GPL-2.0",
        ] {
            assert!(holds(met, &allowed), "{met}");
        }
        for refused in [
            "",
            "GPL-3.0",
            "MIT AND GPL-3.0",
            "Apache-2.0",
            "(MIT OR Apache-2.0) AND Zlib",
            "MIT GPL-3.0",
        ] {
            assert!(!holds(refused, &allowed), "{refused}");
        }
    }

    #[test]
    fn the_list_is_read() {
        let allowed = allowed(DENY);
        assert!(
            allowed.contains(&"MIT") && allowed.contains(&"Zlib"),
            "{allowed:?}"
        );
    }
}
