//! The program `lynkeus`.

use std::process::ExitCode;

fn main() -> ExitCode {
    lynkeus_cli::run(std::env::args_os()).into()
}
