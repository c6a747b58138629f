//! Structured Text of IEC 61131-3, for programmable controllers: a function block, and the functions that it
//! calls.

mod block;
mod bound;
mod call;
mod names;
mod print;
mod routine;
mod statement;
#[cfg(test)]
mod tests;
mod value;

use self::block::Block;
use self::bound::literal;
use self::print::{Printer, array_type, comment, lacks, plain, section};
use self::routine::Instance;
use self::value::part;
use super::c::{File, Precision, Sources, lost};
use super::device::Device;
use super::machine::{Field, Kind, Machine};
use super::syntax::{Program, Type, parsed};
use super::template::{chosen, parts};
use crate::Refusal;

const LIBRARY: &str = include_str!("../runtime/library.st");

/// Functions that the standard has not, or has with another meaning here: in the order in which they are written.
const OWN: [&str; 11] = [
    "infinite",
    "undefined",
    "smaller",
    "larger",
    "floor",
    "ceil",
    "power_of_two",
    "sinh",
    "cosh",
    "tanh",
    "atan2",
];

/// The function of the library for one of the draft.
fn library(name: &str) -> Option<&'static str> {
    OWN.into_iter().find(|own| *own == name)
}

/// The files of a device: `NAME.st` with types, functions and the block, and `example.st`.
///
/// # Errors
/// What cannot run there, or cannot be written.
pub fn sources(device: &Device<'_>, precision: Precision) -> Result<Sources, Refusal> {
    let machine = Machine::of(device)?;
    let holds: &[&str] = match precision {
        Precision::F64 => &[],
        Precision::F32 => &["single"],
    };
    let library = machine.library().into_iter();
    let library = library.filter(|(name, _)| self::library(name).is_none());
    let library: String = library.map(|(_, text)| format!("{text}\n\n")).collect();
    let draft = format!("{}\n{library}{}", machine.tables, machine.source);
    let items = parsed(&chosen(&draft, holds))?;
    let program = Program::of(&items, &machine.fields);
    let prefix = block::program(device.name);
    let mut printer = Printer::new(
        &items,
        &program,
        (&machine.fields, &machine.sizes),
        (precision, &prefix),
    );
    let taken = printer.instance(Instance {
        function: "take".to_owned(),
        sizes: vec![device.signals.len(), device.estimates.len()],
        fields: vec![],
    })?;
    let verdict = match machine.is_judged() {
        true => Some(printer.instance(Instance {
            function: "is_credible".to_owned(),
            ..Instance::default()
        })?),
        false => None,
    };
    let frame = Frame {
        device,
        machine: &machine,
        real: printer.kind(Type::Real),
        prefix: &prefix,
    };
    let state = frame.state(&mut printer);
    let block = Block::of(&frame, verdict, &mut printer);
    let file = |name: String, text: String| File { name, text };
    let arrays = printer.arrays.iter().map(|(kind, size)| {
        let name = array_type(&prefix, kind, *size);
        format!(
            "TYPE\n    {name} : ARRAY [0..{}] OF {kind};\nEND_TYPE\n\n",
            size - 1
        )
    });
    let text = format!(
        "{}\n{}{state}{}{}{}{}",
        frame.head(),
        arrays.collect::<String>(),
        frame.library(&printer),
        frame.init()?,
        printer.text,
        block.text(&taken)
    );
    Ok(Sources {
        files: vec![
            file(format!("{prefix}.st"), text),
            file("example.st".to_owned(), block.example()),
        ],
        lost: lost(&machine, precision),
    })
}

struct Frame<'a> {
    device: &'a Device<'a>,
    machine: &'a Machine,
    real: &'static str,
    prefix: &'a str,
}

impl Frame<'_> {
    fn head(&self) -> String {
        let about = self.device.about.iter();
        let about = about.map(|line| format!("   {}", plain(line)).trim_end().to_owned() + "\n");
        format!(
            "(* {}: an estimator as a function block\n{}*)\n",
            plain(self.device.name),
            about.collect::<String>()
        )
    }

    /// What is called of the library, and what that calls.
    fn library(&self, printer: &Printer<'_>) -> String {
        let all: Vec<(&str, &str)> = parts(LIBRARY).collect();
        let mut needed: Vec<(&str, &str)> = vec![];
        for part in all.into_iter().rev() {
            let name = format!("@_{}", part.0);
            let is_called = needed
                .iter()
                .any(|other| other.1.contains(&format!("{name}(")));
            if printer.own.contains(part.0) || is_called {
                needed.insert(0, part);
            }
        }
        let whole = if self.real == "REAL" {
            "8388608.0"
        } else {
            "4503599627370496.0"
        };
        let texts = needed.into_iter().map(|(_, text)| {
            let text = text.replace("LREAL", "$").replace("REAL", self.real);
            let text = text.replace('$', "LREAL").replace("WHOLE", whole);
            text.replace('@', self.prefix) + "\n\n"
        });
        texts.collect()
    }

    fn kind(&self, kind: Kind) -> Type {
        match kind {
            Kind::Real => Type::Real,
            Kind::Double => Type::Double,
            Kind::Int => Type::Int,
            Kind::Truth => Type::Truth,
        }
    }

    /// The type of the state.
    fn state(&self, printer: &mut Printer<'_>) -> String {
        let mut lines = String::new();
        for field in &self.machine.fields {
            let kind = self.kind(field.kind);
            let kind = match field.count {
                None => printer.kind(kind).to_owned(),
                Some(count) => printer.array(kind, count),
            };
            let about = about(&field.about);
            lines += &format!("        {} : {kind};{about}\n", part(field.name));
        }
        format!(
            "TYPE\n    {}_state : STRUCT\n{lines}    END_STRUCT;\nEND_TYPE\n\n",
            self.prefix
        )
    }

    /// The function that makes a state what it is before the first sample.
    fn init(&self) -> Result<String, Refusal> {
        let prefix = self.prefix;
        let mut lines = String::new();
        for field in &self.machine.fields {
            lines += &self.start(field)?;
        }
        let shared = section("VAR_IN_OUT", &[format!("s : {prefix}_state;")]);
        let own = section("VAR", &["k : DINT;".to_owned()]);
        Ok(format!(
            "(* Before the first sample. *)\nFUNCTION {prefix}_init : BOOL\n{shared}{own}{lines}    \
             {prefix}_init := TRUE;\nEND_FUNCTION\n\n"
        ))
    }

    /// A field at the start, entry by entry where they are not 0.
    fn start(&self, field: &Field) -> Result<String, Refusal> {
        if field.start.iter().any(|value| !value.is_finite()) {
            return Err(lacks("a start that is no finite number"));
        }
        let name = part(field.name);
        let line = |target: &str, value: f64| {
            format!("    s.{target} := {};\n", self.number(field.kind, value))
        };
        let Some(count) = field.count else {
            return Ok(line(name, field.start.first().copied().unwrap_or(0.0)));
        };
        let zeros = format!(
            "    FOR k := 0 TO {} DO\n    {}    END_FOR;\n",
            count.max(1) - 1,
            line(&format!("{name}[k]"), 0.0)
        );
        let others = field.start.iter().enumerate();
        let others = others.filter(|start| *start.1 != 0.0);
        let others = others.map(|(place, value)| line(&format!("{name}[{place}]"), *value));
        Ok(zeros + &others.collect::<String>())
    }

    /// A number in a statement.
    fn number(&self, kind: Kind, value: f64) -> String {
        match kind {
            Kind::Int => format!("{}", value as i64),
            Kind::Truth => if value == 0.0 { "FALSE" } else { "TRUE" }.to_owned(),
            Kind::Real | Kind::Double => {
                let is_single = self.real == "REAL" && kind == Kind::Real;
                let most = if is_single { 3.4e38 } else { f64::MAX };
                let sign = if value < 0.0 { "-" } else { "" };
                let size = value.abs().min(most);
                format!("{sign}{}", literal(&format!("{size:?}")).text)
            }
        }
    }
}

/// Words behind a declaration.
fn about(words: &str) -> String {
    match comment(words).replace('\n', " ").trim_end() {
        "" => String::new(),
        words => format!(" {words}"),
    }
}
