//! What a shell and its manual are given of the command line.

use clap::Command;
use clap_complete::Shell;
use lynkeus::Error;

use crate::output;

use super::ending::Ending;

/// Prints the script that completes the command in a shell.
pub(super) fn completions(mut whole: Command, shell: Shell) -> Result<Ending, Error> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut whole, "lynkeus", &mut script);
    output::print(script.as_slice())?;
    Ok(Ending::Done)
}

/// Prints the manual page of lynkeus, or of one of its commands.
pub(super) fn manual(mut whole: Command, command: Option<&str>) -> Result<Ending, Error> {
    // what every command takes, and its name beside that of the whole
    whole.build();
    let page = match command {
        None => whole,
        Some(name) => {
            let found = whole.find_subcommand(name).cloned();
            let all = whole.get_subcommands().map(Command::get_name);
            let all: Vec<&str> = all.collect();
            let wrong = || {
                Error::input(format!("lynkeus has no command {name}"))
                    .hint(format!("it has {}", all.join(", ")))
            };
            found.ok_or_else(wrong)?
        }
    };
    let mut roff = Vec::new();
    let rendered = clap_mangen::Man::new(page).render(&mut roff);
    rendered.map_err(|error| Error::input("the manual page cannot be made").caused_by(error))?;
    output::print(roff.as_slice())?;
    Ok(Ending::Done)
}
