//! `docs/commands.md`, written from the command line's declaration.

use std::fmt::Write;
use std::path::Path;

use clap::{Arg, Command, CommandFactory};

use crate::Cli;

const HEAD: &str = "# Commands

Every command with its arguments and options. The program's own declarations generate this page.
Keys are those of [study files](study.md), and `--json` follows [a schema](answers.schema.json).

| exit code | meaning |
|---|---|
| 0 | done |
| 1 | the answer is no: a condition is refuted, an estimate diverged or is not credible, a picture has nothing to draw |
| 2 | the input cannot be used |
| 3 | a [limit](observability.md#limits) of time or memory ended the command |

Lynkeus writes all outputs or none, and never overwrites an input. It writes each output to a temporary file and renames it, so that
no reader sees half of it. `-` is standard input (a study, a log) or standard output (any one output). If a picture cannot be drawn, Lynkeus writes the other
outputs and ends with exit code 1.
";

#[test]
fn the_page_of_commands_is_that_of_the_program() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/commands.md");
    let expected = page();
    if std::env::var_os("LYNKEUS_WRITE_DOCS").is_some() {
        std::fs::write(&path, &expected).expect("docs/commands.md can be written");
    }
    let found = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        found == expected,
        "docs/commands.md differs from the program: LYNKEUS_WRITE_DOCS=1 writes it anew"
    );
}

fn page() -> String {
    let mut whole = Cli::command();
    whole.build();
    let mut text = HEAD.to_owned();
    let own = whole.get_subcommands().filter(|c| c.get_name() != "help");
    for command in own {
        section(&mut text, command);
    }
    text.push_str("\n## For every command\n\n");
    table(&mut text, &whole, |argument| argument.is_global_set());
    text
}

fn section(text: &mut String, command: &Command) {
    let usage = command.clone().render_usage().to_string();
    let usage = usage.trim_start_matches("Usage: ");
    let about = command.get_about().map(ToString::to_string);
    let about = about.unwrap_or_default();
    let _ = write!(
        text,
        "\n## {}\n\n{about}.\n\n```text\n{usage}\n```\n\n",
        command.get_name()
    );
    table(text, command, |argument| !argument.is_global_set());
}

/// A row for each of the arguments.
fn table(text: &mut String, command: &Command, is_asked: impl Fn(&Arg) -> bool) {
    let of_clap = ["help", "version"];
    let arguments = command.get_arguments();
    let mut rows = arguments
        .filter(|a| is_asked(a) && !a.is_hide_set() && !of_clap.contains(&a.get_id().as_str()))
        .peekable();
    if rows.peek().is_none() {
        return;
    }
    text.push_str("| argument | meaning |\n|---|---|\n");
    for argument in rows {
        let _ = writeln!(text, "| {} | {} |", name(argument), meaning(argument));
    }
}

/// `-o`, `--output FILE`
fn name(argument: &Arg) -> String {
    let values = argument.get_value_names().unwrap_or_default();
    let values: Vec<&str> = match argument.get_action().takes_values() {
        true => values.iter().map(|value| value.as_str()).collect(),
        false => Vec::new(),
    };
    let long = argument.get_long().map(|long| format!("--{long}"));
    let words: Vec<&str> = long.iter().map(String::as_str).chain(values).collect();
    let named = format!("`{}`", words.join(" "));
    match argument.get_short() {
        Some(short) => format!("`-{short}`, {named}"),
        None => named,
    }
}

/// The help, the words that it takes, and what holds without it.
fn meaning(argument: &Arg) -> String {
    let help = argument.get_long_help().or(argument.get_help());
    let mut text = help.map(ToString::to_string).unwrap_or_default();
    if argument.get_action().takes_values() {
        let values = argument.get_possible_values();
        let words: Vec<_> = values
            .iter()
            .map(|v| format!("`{}`", v.get_name()))
            .collect();
        if !words.is_empty() {
            let _ = write!(text, ": {}", words.join(", "));
        }
        let defaults = argument.get_default_values().iter();
        let defaults: Vec<_> = defaults.map(|value| value.to_string_lossy()).collect();
        if !defaults.is_empty() {
            let _ = write!(text, " (default `{}`)", defaults.join(", "));
        }
    }
    // a table's cell is one line, without bars of its own
    text.replace('\n', " ")
        .replace('|', "&#124;")
        .replace('<', "&lt;")
}
