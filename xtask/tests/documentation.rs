//! The documentation does not drift from what the repository holds.

use std::collections::BTreeSet;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn read(path: impl AsRef<Path>) -> String {
    let path = root().join(path);
    fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

#[test]
fn the_page_of_the_tanks_shows_the_shipped_plant_and_study() {
    let page = read("examples/two-tanks/README.md");
    for (language, file) in [("modelica", "two_tanks.mo"), ("toml", "study.toml")] {
        let shipped = read(Path::new("examples/two-tanks").join(file));
        let block = format!("```{language}\n{}\n```", shipped.trim_end());
        assert!(
            page.contains(&block),
            "examples/two-tanks/README.md shows another {file} than is shipped"
        );
    }
}

#[test]
fn links_between_files_lead_somewhere() {
    let broken: Vec<String> = pages()
        .iter()
        .flat_map(|page| {
            let text = outside_of_code(&read(page));
            let lost = targets(&text)
                .into_iter()
                .filter(|target| !root().join(page).with_file_name(target).exists());
            lost.map(|target| format!("{} → {target}", page.display()))
                .collect::<Vec<_>>()
        })
        .collect();
    assert!(broken.is_empty(), "broken links:\n{}", broken.join("\n"));
}

/// Every Markdown file of the root, of `docs` and of the examples, relative to the root.
fn pages() -> Vec<PathBuf> {
    let examples = names_in(Path::new("examples"));
    let here = ["", "docs", "docs/tutorials", "docs/how-to", "examples"];
    here.map(PathBuf::from)
        .into_iter()
        .chain(examples.filter(|path| root().join(path).is_dir()))
        .flat_map(|folder| names_in(&folder))
        .filter(|path| path.extension().is_some_and(|extension| extension == "md"))
        .collect()
}

/// The entries of a folder, relative to the root.
fn names_in(folder: &Path) -> impl Iterator<Item = PathBuf> + use<> {
    let entries = fs::read_dir(root().join(folder)).expect("a folder");
    let folder = folder.to_path_buf();
    entries
        .flatten()
        .map(move |entry| folder.join(entry.file_name()))
}

/// The targets of `[text](target)` that are files, without their anchors.
fn targets(text: &str) -> Vec<&str> {
    text.split("](")
        .skip(1)
        .filter_map(|rest| rest.split_once(')'))
        .map(|(target, _)| target.split('#').next().unwrap_or(target))
        .filter(|target| !target.is_empty() && !target.contains("://"))
        .collect()
}

/// How often a word that says who speaks, and not what, may stand in all pages.
const TOLD: usize = 10;

/// How many of a thousand words may be a verb in the passive voice.
const PASSIVE: usize = 8;

/// The lines of the README before it sends readers on.
const FIRST_SCREEN: usize = 80;

/// What the style checker Vale reads, too.
const RULES: &str = ".vale/Lynkeus";

/// The entries below a key of a rule.
fn entries(rule: &str, key: &str) -> Vec<String> {
    let text = read(Path::new(RULES).join(rule));
    let below = text
        .split_once(&format!("\n{key}:\n"))
        .map(|(_, below)| below);
    let lines = below.unwrap_or_default().lines();
    let entries: Vec<_> = lines
        .take_while(|line| line.starts_with("  "))
        .map(|line| line.trim().trim_start_matches("- ").to_owned())
        .collect();
    assert!(!entries.is_empty(), "{rule} has no entries below {key}");
    entries
}

#[test]
fn pages_keep_to_the_words_of_the_book() {
    let swapped = entries("Words.yml", "swap");
    let swapped = swapped.iter().filter_map(|entry| entry.split_once(": "));
    let left_out = entries("Weasels.yml", "tokens");
    let left_out = left_out.iter().map(|word| (word.as_str(), "nothing"));
    let rules: Vec<(&str, &str)> = swapped.chain(left_out).collect();
    let mut found = Vec::new();
    for page in pages() {
        let text = outside_of_code(&read(&page)).to_lowercase();
        let text = format!(" {} ", words(&text).collect::<Vec<_>>().join(" "));
        let broken = rules
            .iter()
            .filter(|(phrase, _)| text.contains(&format!(" {} ", phrase.replace('-', " "))));
        found.extend(
            broken.map(|(phrase, better)| {
                format!("{}: \"{phrase}\": better {better}", page.display())
            }),
        );
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn pages_speak_of_what_is_done_and_by_whom() {
    let (mut told, mut passive, mut all) = (0, 0, 0);
    for page in pages() {
        let text = outside_of_code(&read(&page)).to_lowercase();
        let words: Vec<&str> = words(&text).collect();
        told += words.iter().filter(|word| **word == "told").count();
        all += words.len();
        passive += words.windows(2).filter(|pair| is_passive(pair)).count();
    }
    assert!(told <= TOLD, "\"told\" stands {told} times in the pages");
    assert!(
        passive * 1000 <= PASSIVE * all,
        "{passive} of {all} words are verbs in the passive voice, more than {PASSIVE} of a thousand"
    );
}

/// A form of "to be" and a regular participle, as the rule of the style checker has it.
fn is_passive(pair: &[&str]) -> bool {
    const BE: [&str; 8] = ["am", "are", "be", "been", "being", "is", "was", "were"];
    matches!(pair, [be, verb] if BE.contains(be) && verb.ends_with("ed"))
}

#[test]
fn words_are_in_a_dictionary_or_in_that_of_the_field() {
    let field = read(Path::new(RULES).join("field.txt"));
    let field: BTreeSet<&str> = field.lines().collect();
    let text: Vec<String> = pages()
        .iter()
        .map(|page| outside_of_code(&read(page)))
        .collect();
    let spelled: BTreeSet<&str> = text.iter().flat_map(|text| plain_words(text)).collect();
    let asked: Vec<&str> = spelled.difference(&field).copied().collect();
    let Some(unknown) = misspelled(&asked) else {
        eprintln!("skipped: spelling: there is no hunspell with en_GB and en_US here");
        return;
    };
    assert!(
        unknown.is_empty(),
        "in no dictionary, nor in {RULES}/field.txt:\n{unknown}"
    );
}

/// Words of letters alone: no code, formula, link, abbreviation or name with capitals inside.
fn plain_words(text: &str) -> impl Iterator<Item = &str> {
    let prose = text.split('`').step_by(2).flat_map(outside_of_links);
    let joined = |c: char| c.is_alphanumeric() || !c.is_ascii() || "_'/.=^".contains(c);
    let tokens = prose.flat_map(move |part| part.split(move |c: char| !joined(c)));
    tokens
        .map(|token| token.trim_matches(|c| "'./".contains(c)))
        .map(|token| token.trim_end_matches("'s"))
        .filter(|token| {
            token.len() > 2 && token.chars().all(|c| c.is_ascii_alphabetic() || c == '\'')
        })
        .filter(|token| token.chars().skip(1).all(|c| !c.is_ascii_uppercase()))
}

/// A text without the targets of `[text](target)`.
fn outside_of_links(text: &str) -> impl Iterator<Item = &str> {
    let pieces = text.split("](").enumerate();
    pieces.map(|(place, piece)| match piece.split_once(')') {
        Some((_, rest)) if place > 0 => rest,
        _ => piece,
    })
}

/// Those that the spelling checker does not know; nothing where it, or a dictionary, is missing.
fn misspelled(words: &[&str]) -> Option<String> {
    let mut hunspell = Command::new("hunspell");
    hunspell.args(["-l", "-d", "en_GB,en_US"]);
    hunspell.stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut checker = hunspell.stderr(Stdio::null()).spawn().ok()?;
    let asked = words.join("\n");
    let mut input = checker.stdin.take()?;
    // what it prints is read while it is still asked
    let asks = std::thread::spawn(move || input.write_all(asked.as_bytes()));
    let found = checker.wait_with_output().ok()?;
    asks.join().ok()?.ok()?;
    let unknown = String::from_utf8(found.stdout).ok()?;
    found.status.success().then_some(unknown)
}

/// Words of a sentence that is read at one go, up to a full stop, a colon or a semicolon.
const SENTENCE: usize = 40;

/// How many may be longer in the pages for users: what a formula or a list makes long.
const LONG_SENTENCES: usize = 9;

#[test]
fn sentences_are_short() {
    let for_users =
        |page: &&PathBuf| page.parent() != Some(Path::new("")) || page.ends_with("README.md");
    let mut long = Vec::new();
    for page in pages().iter().filter(for_users) {
        let text = prose(&read(page));
        let found = text
            .split(". ")
            .flat_map(|part| part.split([';', ':', '!', '?']));
        let found = found.filter(|sentence| sentence.split_whitespace().count() > SENTENCE);
        long.extend(found.map(|sentence| {
            let words: Vec<&str> = sentence.split_whitespace().take(12).collect();
            format!("{}: {} …", page.display(), words.join(" "))
        }));
    }
    assert!(
        long.len() <= LONG_SENTENCES,
        "{} sentences have more than {SENTENCE} words:\n{}",
        long.len(),
        long.join("\n")
    );
}

/// What of a page is read as sentences: without code, comments, tables, headings and quotations. A paragraph or an item
/// of a list ends a sentence.
fn prose(page: &str) -> String {
    let mut text = String::new();
    let mut is_comment = false;
    for line in outside_of_code(page).lines() {
        let line = line.trim();
        is_comment |= line.starts_with("<!--");
        let is_apart = line.is_empty() || line.starts_with(['|', '#', '>']);
        if is_comment || is_apart || line.starts_with("- ") {
            text += ". ";
        }
        if !is_comment && !is_apart {
            // code in a line is a word
            text += &line.split('`').step_by(2).collect::<Vec<_>>().join("x");
            text.push(' ');
        }
        is_comment &= !line.ends_with("-->");
    }
    text
}

#[test]
fn the_first_screen_of_the_readme_is_a_screen() {
    let readme = read("README.md");
    let first = readme.split("## Where next").next().unwrap_or_default();
    let lines = first.lines().count();
    assert!(lines <= FIRST_SCREEN, "{lines} lines before \"Where next\"");
}

/// A page without what stands in code blocks.
fn outside_of_code(text: &str) -> String {
    text.split("```").step_by(2).collect()
}

fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| !c.is_alphabetic())
        .filter(|word| !word.is_empty())
}
