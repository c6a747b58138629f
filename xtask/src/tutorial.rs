//! A page of the book, typed as it stands: its files are saved, its commands run.

use std::ffi::OsStr;
use std::fs;
use std::path::Path;
use std::process::Command;

use xtask::process::run;

/// Types a page into a folder. Commands have that `PATH` and nothing else of this environment.
///
/// # Errors
/// What cannot be saved, or which command failed.
pub fn type_in(page: &str, folder: &Path, path: &OsStr) -> Result<(), String> {
    for block in blocks(page) {
        if let Some(name) = block.title {
            let file = folder.join(name);
            let written = fs::write(&file, block.body);
            written.map_err(|error| format!("cannot write {}: {error}", file.display()))?;
        } else if block.language == "sh" {
            let mut shell = Command::new("bash");
            shell.args(["-ec", block.body]).current_dir(folder);
            shell.env_clear().env("PATH", path).env("LC_ALL", "C.UTF-8");
            run(&mut shell)?;
        }
    }
    Ok(())
}

/// A fenced block.
struct Block<'a> {
    language: &'a str,
    title: Option<&'a str>,
    body: &'a str,
}

fn blocks(page: &str) -> impl Iterator<Item = Block<'_>> {
    // what stands between fences is every other piece
    page.split("```").skip(1).step_by(2).map(|block| {
        let (head, body) = block.split_once('\n').unwrap_or((block, ""));
        let (language, info) = head.split_once(' ').unwrap_or((head, ""));
        let title = info.strip_prefix("title=\"");
        Block {
            language,
            title: title.and_then(|title| title.strip_suffix('"')),
            body,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::blocks;

    #[test]
    fn blocks_have_their_language_their_title_and_their_text() {
        let page = "a\n```toml title=\"s.toml\"\nx = 1\n```\nb\n```sh\nls\npwd\n```\n";
        let found: Vec<_> = blocks(page)
            .map(|block| (block.language, block.title, block.body))
            .collect();
        let expected = [
            ("toml", Some("s.toml"), "x = 1\n"),
            ("sh", None, "ls\npwd\n"),
        ];
        assert_eq!(found, expected);
    }
}
