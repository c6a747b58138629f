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
fn the_readme_shows_the_shipped_plant_and_study() {
    let readme = read("README.md");
    for (language, file) in [("modelica", "two_tanks.mo"), ("toml", "study.toml")] {
        let shipped = read(Path::new("examples/two-tanks").join(file));
        let block = format!("```{language}\n{}\n```", shipped.trim_end());
        assert!(
            readme.contains(&block),
            "README.md shows another {file} than examples/two-tanks"
        );
    }
}

#[test]
fn links_between_files_lead_somewhere() {
    let broken: Vec<String> = pages()
        .iter()
        .flat_map(|page| {
            let text = read(page);
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
    [PathBuf::new(), "docs".into(), "examples".into()]
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
