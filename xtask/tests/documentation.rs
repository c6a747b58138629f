//! The documentation does not drift from what the repository holds.

use std::fs;
use std::path::{Path, PathBuf};

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

/// The lines of the README before it sends readers on.
const FIRST_SCREEN: usize = 80;

#[test]
fn pages_keep_to_the_words_of_the_book() {
    let style = read("docs/style.toml");
    let rules: Vec<(&str, &str)> = style
        .lines()
        .filter(|line| line.starts_with('"'))
        .filter_map(|line| line.split_once(" = "))
        .map(|(phrase, better)| (phrase.trim_matches('"'), better))
        .collect();
    assert!(rules.len() > 10, "docs/style.toml has no rules");
    let mut found = Vec::new();
    let mut told = 0;
    for page in pages() {
        let text = outside_of_code(&read(&page)).to_lowercase();
        told += words(&text).filter(|word| *word == "told").count();
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
    assert!(told <= TOLD, "\"told\" stands {told} times in the pages");
}

/// Words of a sentence that is read at one go, up to a full stop, a colon or a semicolon.
const SENTENCE: usize = 40;

/// How many may be longer in the pages for users: what a formula or a list makes long.
const LONG_SENTENCES: usize = 12;

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
