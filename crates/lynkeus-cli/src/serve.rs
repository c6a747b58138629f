//! `serve`: the estimator beside a plant.

use std::io;
use std::sync::Arc;
use std::thread;

use clap::{Args, ValueEnum};

use lynkeus::{Answer, Error, Study, interrupt};
use lynkeus_serve::{Board, Engine, Format, Reader, http, mqtt};

use super::ending::Ending;
use super::inputs::Source;
use super::output;

/// How a study is served.
#[derive(Debug, Args)]
pub(super) struct Options {
    /// Read rows from standard input and write estimates to standard output in this format (default: as `mqtt` in [serve] says)
    #[arg(long, value_enum, value_name = "FORMAT")]
    stdio: Option<Messages>,
    /// Print warnings only, no notes
    #[arg(short, long)]
    quiet: bool,
}

/// [`Format`] in the words of the command line.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Messages {
    /// A JSON object in each line
    Json,
    /// InfluxDB's line protocol: a processor of Telegraf (`execd`)
    Influx,
}

impl From<Messages> for Format {
    fn from(messages: Messages) -> Self {
        match messages {
            Messages::Json => Self::Json,
            Messages::Influx => Self::Influx,
        }
    }
}

pub(super) fn serve(source: &Source, options: &Options) -> Result<Ending, Error> {
    let study = &source.study;
    let settings = &study.serve;
    if options.stdio.is_none() && settings.mqtt.is_none() {
        let error = Error::input("no rows would come").at(&study.file);
        return Err(error.hint(
            "add `--stdio json` (or influx), or `mqtt` with a broker to [serve] of the study",
        ));
    }
    let files = source
        .files()
        .reads("the assets", settings.assets.as_deref());
    let files = files.writes("`state` of [serve]", settings.state.as_deref());
    files.check()?;
    let assets = lynkeus_serve::assets(study)?;
    let Some((_, stream)) = assets.first().cloned() else {
        return Err(Error::input("there is no asset").at(&study.file));
    };
    let names: Vec<String> = assets.iter().map(|(name, _)| name.clone()).collect();
    let mut engine = Engine::new(assets);
    if let Some(pattern) = &settings.history {
        engine.write_history(pattern, settings.keep_days);
    }
    if let Some(path) = &settings.state {
        engine.keep(path)?;
    }
    let notes = stream.notes.iter().chain(engine.notes());
    notes
        .filter(|_| !options.quiet)
        .for_each(|text| output::note(text));
    let board = match &settings.http {
        None => None,
        Some(address) => {
            let board = Arc::new(Board::new(Arc::clone(&stream), names));
            let token = settings.token.as_ref().map(|token| token.text.clone());
            let listening = http::listen(&address.text, token, Arc::clone(&board));
            let own = listening.map_err(|error| address.blame(error))?;
            output::note(&format!("the page is at http://{own}/"));
            prove(study.clone(), Arc::clone(&board));
            Some(board)
        }
    };
    let reader = Reader::new(stream);
    let door = (reader, board.as_deref());
    match (options.stdio, &settings.mqtt) {
        (Some(messages), _) => lynkeus_serve::serve(
            &mut engine,
            door,
            messages.into(),
            (io::stdin(), &mut io::stdout()),
            &interrupt::interrupted,
            &mut output::warn,
        )?,
        (None, Some(settings)) => mqtt::serve(
            &mut engine,
            door,
            settings,
            &interrupt::interrupted,
            &mut output::note,
        )?,
        (None, None) => {}
    }
    Ok(Ending::Done)
}

/// Finds in a thread of its own what is proved of a study's observer, for the page.
fn prove(study: Study, board: Arc<Board>) {
    thread::spawn(move || {
        // what the command would refuse to prove is not known
        if let Ok(report) = lynkeus::certify(&study) {
            board.is_proved(report.document().to_html());
        }
    });
}
