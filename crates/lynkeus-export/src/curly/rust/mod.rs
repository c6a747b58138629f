//! Rust without its standard library: a crate, with an example that replays a log.

mod print;
mod value;

use self::print::{documented, plain, printed};
use self::value::{OWN, kind};
use super::c::{File, Precision, Sources, lost, prefix};
use super::device::{CREDIBLE, Device, Entry, PATIENCE, READINGS};
use super::estimator::drafted;
use super::machine::{Field, Machine};
use super::syntax::Type;
use super::template::mentions;
use crate::Refusal;

const REPLAY: &str = include_str!("../runtime/replay.rs");

/// The files of a device: `Cargo.toml`, `src/lib.rs`, `examples/replay.rs`.
///
/// # Errors
/// What cannot run there, or cannot be written.
pub fn sources(device: &Device<'_>, precision: Precision) -> Result<Sources, Refusal> {
    let name = format!("{}_estimator", prefix(device.name));
    let machine = &drafted(device)?;
    let frame = Frame {
        device,
        machine,
        precision,
    };
    let manifest = format!(
        "[package]\nname = \"{name}\"\nversion = \"0.1.0\"\nedition = \"2024\"\n\
         rust-version = \"1.85\"\npublish = false\n\n[dependencies]\nlibm = \"0.2.16\"\n"
    );
    let cast = match precision {
        Precision::F64 => "",
        Precision::F32 => " as f32",
    };
    let replay = REPLAY.replace("@CRATE@", &name).replace("@AS_REAL@", cast);
    let file = |name: &str, text: String| File {
        name: name.to_owned(),
        text,
    };
    Ok(Sources {
        files: vec![
            file("Cargo.toml", manifest),
            file("src/lib.rs", frame.library()?),
            file("examples/replay.rs", replay),
        ],
        lost: lost(machine, precision),
    })
}

struct Frame<'a> {
    device: &'a Device<'a>,
    machine: &'a Machine,
    precision: Precision,
}

impl Frame<'_> {
    fn real(&self) -> &'static str {
        kind(Type::Real, self.precision)
    }

    fn library(&self) -> Result<String, Refusal> {
        let (draft, own) = self.draft();
        let body = printed(&draft, &self.machine.fields, self.precision)?;
        let about = self.device.about.iter();
        let about = about.map(|line| format!("// {}", plain(line)).trim_end().to_owned() + "\n");
        let real = self.real();
        Ok(format!(
            "//! An estimator for `{title}`: [`State::push`] takes a sample.\n\n{about}\n\
             #![no_std]\n#![forbid(unsafe_code)]\n\
             // names are the model's, operations in the order in which they were differentiated\n\
             #![allow(non_snake_case)]\n\
             #![allow(clippy::style, clippy::complexity, clippy::manual_memcpy)]\n\
             // x == x asks whether x is a number, and where a size is 0 its loop is empty\n\
             #![allow(clippy::approx_constant, clippy::eq_op, clippy::reversed_empty_ranges)]\n\n\
             {lists}{sizes}\n{codes}\n{readings}{state}\n\
             impl State {{\n{new}\n\
             \x20   /// Goes to time `t` and takes the signals there; NaN: a sensor did not report, an input stays.\n\
             \x20   /// The first sample only updates the start.\n    ///\n\
             \x20   /// # Errors\n    /// [`Refused`]; the state, but for `refused`, and the estimates are then what they were. When the\n\
             \x20   /// equations had no value, or an estimate ran away, {PATIENCE} times in a row, an absurd reading is behind\n\
             \x20   /// it that was taken before: the state is then a new one, and the next sample the first.\n\
             \x20   pub fn push(\n        &mut self,\n        t: f64,\n        signals: &[{real}; SIGNALS],\n\
             \x20       estimates: &mut [{real}; ESTIMATES],\n    ) -> Result<(), Refused> {{\n\
             \x20       let before = self.clone();\n\
             \x20       let refused = Refused::of(take(self, t, signals, estimates));\n\
             \x20       match refused {{\n            None => Ok(()),\n            Some(refused) => {{\n\
             \x20               *self = before;\n                self.give_up(refused);\n                Err(refused)\n            }}\n        }}\n    }}\n\n\
             \x20   /// Where an absurd reading that was taken is behind it, the next sample is the first.\n\
             \x20   fn give_up(&mut self, refused: Refused) {{\n\
             \x20       if matches!(refused, Refused::Diverged | Refused::NotFinite) {{\n            self.refused += 1;\n\
             \x20           if self.refused >= {PATIENCE} {{\n{restart}            }}\n        }}\n    }}\n{verdict}}}\n\n\
             impl Default for State {{\n    fn default() -> Self {{\n        Self::new()\n    }}\n}}\n\n\
             // places are counted up to a million\nconst _: () = assert!(usize::BITS >= 32);\n\n\
             {own}{body}",
            title = plain(self.device.name).replace('`', "'"),
            about = about.collect::<String>(),
            lists = self.lists(),
            sizes = self.sizes(&draft),
            codes = codes(self.device),
            readings = self.readings(),
            state = self.state(),
            new = self.new_state(),
            verdict = match self.machine.is_judged() {
                true => format!(
                    "\n    /// Whether {CREDIBLE}.\n    #[must_use]\n    pub fn is_credible(&self) -> bool {{\n        is_credible(self)\n    }}\n"
                ),
                false => String::new(),
            },
            restart = match self.device.tunables {
                [] => "                *self = Self::new();\n",
                _ =>
                    "                let tuning = self.tuning;\n                *self = Self { tuning, ..Self::new() };\n",
            },
        ))
    }

    /// What is printed, and what is not drafted.
    fn draft(&self) -> (String, String) {
        let mut draft = match self.machine.tables.is_empty() {
            true => String::new(),
            false => format!("{}\n", self.machine.tables),
        };
        let mut others = String::new();
        let suffix = match self.precision {
            Precision::F64 => "",
            Precision::F32 => "f",
        };
        for (name, text) in self.machine.library() {
            match OWN.iter().find(|own| own.0 == name) {
                Some((_, own)) => {
                    let own = own.replace("REAL", self.real()).replace("SUFFIX", suffix);
                    others += &format!("{own}\n\n");
                }
                None => draft += &format!("{text}\n\n"),
            }
        }
        draft += &self.machine.source;
        (draft, others)
    }

    fn lists(&self) -> String {
        let list = |name: &str, count: &str, about: &str, entries: &[Entry]| {
            let each = entries.iter().map(|entry| {
                let about = match entry.about.is_empty() {
                    true => String::new(),
                    false => format!(" // {}", plain(&entry.about)),
                };
                format!("    {:?},{about}\n", entry.name)
            });
            format!(
                "/// How many there are of [`{name}`].\npub const {count}: usize = {};\n\
                 /// {about}\npub const {name}: [&str; {count}] = [\n{}];\n\n",
                entries.len(),
                each.collect::<String>()
            )
        };
        let signals = "What is given: measured outputs, then known inputs.";
        let estimates =
            "What is returned: estimates, their standard deviations where there are any, monitors.";
        let tunables = "What may be changed while it runs, in the order of [`State::tuning`].";
        let entries: Vec<Entry> = self
            .device
            .tunables
            .iter()
            .map(|t| t.entry.clone())
            .collect();
        let mut lists = list("SIGNAL_NAMES", "SIGNALS", signals, self.device.signals);
        lists += &list(
            "ESTIMATE_NAMES",
            "ESTIMATES",
            estimates,
            self.device.estimates,
        );
        if !entries.is_empty() {
            lists += &list("TUNABLE_NAMES", "TUNABLES", tunables, &entries);
        }
        lists
    }

    /// Those that are used; how long the lists are, is known already.
    fn sizes(&self, draft: &str) -> String {
        let sizes = self.machine.sizes.iter();
        let used = sizes.filter(|size| {
            !["SIGNALS", "TUNABLES"].contains(&size.0.as_str()) && mentions(draft, &size.0)
        });
        let lines = used.map(|(name, size)| format!("const {name}: usize = {size};\n"));
        lines.collect()
    }

    fn readings(&self) -> String {
        let has_readings = self.machine.fields.iter().any(|f| f.name == "became");
        let each = READINGS.iter().enumerate().filter(|_| has_readings);
        let each = each.map(|(k, (word, about))| {
            format!("/// What became of a reading: {about}.\npub const {word}: usize = {k};\n")
        });
        match each.collect::<String>() {
            none if none.is_empty() => none,
            readings => readings + "\n",
        }
    }

    fn state(&self) -> String {
        let fields = self.machine.fields.iter().map(|field| {
            let kind = kind(field.kind, self.precision);
            let kind = match field.count {
                None => kind.to_owned(),
                Some(count) => format!("[{kind}; {count}]"),
            };
            let about = match field.about.is_empty() {
                true => String::new(),
                false => format!("    /// {}\n", documented(&plain(&field.about))),
            };
            format!("{about}    pub {}: {kind},\n", field.name)
        });
        format!(
            "/// All there is to an estimator under way: a clone is a snapshot.\n\
             #[derive(Clone, Debug, PartialEq)]\npub struct State {{\n{}}}\n",
            fields.collect::<String>()
        )
    }

    fn new_state(&self) -> String {
        let fields = self.machine.fields.iter();
        let fields =
            fields.map(|field| format!("            {}: {},\n", field.name, self.start(field)));
        format!(
            "    /// Before the first sample.\n    #[must_use]\n    pub const fn new() -> Self {{\n        Self {{\n{}        }}\n    }}\n",
            fields.collect::<String>()
        )
    }

    /// A field at the start.
    fn start(&self, field: &Field) -> String {
        let value = |value: f64| match (field.kind, self.precision) {
            (Type::Int, _) => format!("{}", value as i64),
            (Type::Truth, _) => format!("{}", value != 0.0),
            (Type::Real, Precision::F32) => match value as f32 {
                v if v.is_finite() => format!("{v:?}"),
                v if v > 0.0 => "f32::INFINITY".to_owned(),
                _ => "f32::NEG_INFINITY".to_owned(),
            },
            _ => format!("{value:?}"),
        };
        let Some(count) = field.count else {
            return value(field.start.first().copied().unwrap_or_default());
        };
        let is_same = field
            .start
            .windows(2)
            .all(|pair| pair[0].to_bits() == pair[1].to_bits());
        if let (Some(&first), true) = (field.start.first(), is_same) {
            return format!("[{}; {count}]", value(first));
        }
        let texts: Vec<String> = field.start.iter().map(|v| value(*v)).collect();
        let rows: Vec<String> = texts.chunks(8).map(|row| row.join(", ")).collect();
        format!("[{}]", rows.join(",\n                "))
    }
}

/// The codes, and what they are for people.
fn codes(device: &Device<'_>) -> String {
    let all = || super::device::codes(device);
    let constants =
        all().map(|reason| format!("const {}: usize = {};\n", reason.word, reason.number));
    let variants =
        all().map(|reason| format!("    /// {}\n    {},\n", reason.about, camel(reason.word)));
    let known = all().map(|reason| {
        let word = reason.word;
        format!("            {word} => Self::{},\n", camel(word))
    });
    let words = all().map(|reason| {
        format!(
            "            Self::{} => {:?},\n",
            camel(reason.word),
            reason.about
        )
    });
    format!(
        "{}\n/// Why a sample was refused; nothing has changed then but `refused` of the state.\n\
         #[derive(Clone, Copy, Debug, PartialEq, Eq)]\npub enum Refused {{\n{}}}\n\n\
         impl Refused {{\n    fn of(code: usize) -> Option<Self> {{\n        Some(match code {{\n{}            _ => return None,\n        }})\n    }}\n}}\n\n\
         impl core::fmt::Display for Refused {{\n    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {{\n\
         \x20       f.write_str(match self {{\n{}        }})\n    }}\n}}\n\n\
         impl core::error::Error for Refused {{}}\n",
        constants.collect::<String>(),
        variants.collect::<String>(),
        known.collect::<String>(),
        words.collect::<String>(),
    )
}

/// `NOT_FINITE` as `NotFinite`.
fn camel(word: &str) -> String {
    let parts = word.split('_').map(|part| {
        let (first, rest) = part.split_at(part.len().min(1));
        format!("{first}{}", rest.to_ascii_lowercase())
    });
    parts.collect()
}
