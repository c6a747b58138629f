//! The chores that run the product: what tries to break it, what draws its pictures and tables, and what times it
//! beside others. `cargo xtask <task>` builds and starts them.

mod attack;
mod draw;
mod exercise;
mod falsify;
mod figures;
mod gallery;
mod gap;
mod numbers;
mod options;
mod peers;

use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (task, rest) = match arguments.split_first() {
        Some((task, rest)) => (task.as_str(), rest),
        None => ("", &[][..]),
    };
    let outcome = match (task, rest) {
        ("gallery", []) => gallery::draw(),
        ("figures", []) => figures::draw(),
        ("gap", []) => gap::tabulate(None),
        ("gap", [name]) => gap::tabulate(Some(name)),
        ("attack", options) => attack::run(options),
        ("exercise", options) => exercise::run(options),
        ("falsify", options) => falsify::run(options),
        ("bench-peers", options) => peers::bench(options),
        ("bench-runs", options) => peers::runs::bench(options),
        ("bench-rows", options) => peers::rows::bench(options),
        // one of the peers, as a process of its own
        ("bench-ours", options) => peers::ours::print(options.first().map_or("", String::as_str)),
        _ => Err(format!(
            "no task `{}`: see `cargo xtask`",
            arguments.join(" ")
        )),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("{task}: {message}");
            ExitCode::FAILURE
        }
    }
}
