//! The report for machines.

use lynkeus_model::Diagnostic;
use lynkeus_observability as observability;
use lynkeus_observers::Examination;
use lynkeus_structure::{self as structure, Place, Uniformity};
use lynkeus_words::Words;
use serde::Serialize;
use serde_json::{Value, json};

use super::known::KnowledgeEntry;
use super::{Next, Report, Uniform};
use lynkeus_experiment::entries::{Condition, Fit, Named, Point, Range, Verdict, finite, sides};
use lynkeus_experiment::prepare::choice::Chosen;
use lynkeus_experiment::prepare::declared::Account;

/// Parts of the singular set listed for machines.
const LISTED: usize = 256;

/// The answer of `check`.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct CheckReport<'a> {
    /// the name of the model
    plant: &'a str,
    /// names of its states
    states: &'a [String],
    /// outputs that have sensors
    measured: &'a [String],
    /// inputs and parameters that nobody measures
    unknown: &'a [String],
    /// the family that is recommended
    recommended: Option<&'static str>,
    /// what is odd in the model
    warnings: Vec<String>,
    /// each family with its conditions
    families: Vec<FamilyFit<'a>>,
    /// whether each quantity is observable
    visible: Named<bool>,
    /// the same with what is undecided
    observability: Named<Observability>,
    /// the same of each expression that was asked about
    about: Named<Observability>,
    /// quantities that can change together unseen
    symmetries: Vec<Symmetry<'a>>,
    /// derivatives of the outputs that were used
    derivatives: usize,
    /// independent directions of the unknowns that are seen
    rank: usize,
    /// unknowns, derivatives of unknown inputs included
    unknowns: usize,
    /// how far these answers can be trusted
    observability_notes: Vec<String>,
    /// whether states are told apart under every input, where that was examined
    uniform: Option<UniformityEntry<'a>>,
    /// what can be known, under each assumption on the unknown inputs
    knowledge: Vec<KnowledgeEntry<'a>>,
    /// what `family = "auto"` takes, where a family fits
    choice: Option<Chosen<'a>>,
    /// what of the study's declarations was counted
    declared: &'a Account,
    /// what to do next
    next: Option<&'a Next>,
}

/// An observer family and its conditions.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
struct FamilyFit<'a> {
    /// the name of the family
    family: &'static str,
    /// whether its theorem holds on the box
    fit: Fit,
    /// the same in a sentence
    summary: String,
    /// the states of each chain, from the sensor outward
    chains: &'a [Vec<String>],
    /// the conditions one by one
    checks: Vec<Condition>,
}

/// Whether a quantity can be known.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
enum Observability {
    Observable,
    Unobservable,
    Undecided,
}

/// Quantities that can change together without a trace in the outputs.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
struct Symmetry<'a> {
    /// their names
    moves: &'a [String],
    /// in how many independent ways
    directions: usize,
    /// the same in words
    words: String,
    /// combinations that are known nevertheless, as expressions
    invariants: &'a [String],
}

/// Whether states are told apart under every input.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema), schemars(rename = "Uniformity"))]
struct UniformityEntry<'a> {
    /// what is proved
    verdict: Verdict,
    /// why
    detail: String,
    /// the same of points far apart
    one_to_one: OneToOne,
    /// share of the box where it may fail
    share: Option<f64>,
    /// parts of the box where it may fail
    singular: Vec<Named<Range>>,
    /// constant inputs under which it fails for every state
    blind: Vec<Blind<'a>>,
}

/// Whether points far apart are told apart.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
struct OneToOne {
    /// what is proved
    verdict: Verdict,
    /// why
    detail: String,
    /// two points that the outputs do not distinguish, if there are any
    alike: Option<Vec<Point>>,
}

/// A constant input under which a state is not seen.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
struct Blind<'a> {
    /// the input
    input: &'a str,
    /// its value
    value: f64,
    /// what is not seen then
    hidden: &'a [String],
}

impl Report {
    /// The report for machines.
    pub fn entries(&self) -> Value {
        let answer = &self.answer;
        let quantities = || answer.quantities.iter().map(|(asked, _)| asked);
        let said = self.uniform.as_ref().and_then(Uniform::said);
        json!(CheckReport {
            plant: &self.plant,
            states: &self.states,
            measured: &self.measured,
            unknown: &self.unknown,
            recommended: self.recommended,
            warnings: self.warnings.iter().map(Diagnostic::one_line).collect(),
            families: self.examinations.iter().map(FamilyFit::from).collect(),
            visible: quantities()
                .map(|q| {
                    let is_visible = q.verdict == observability::Verdict::Observable;
                    (q.name.clone(), is_visible)
                })
                .collect(),
            observability: quantities().map(verdict).collect(),
            about: answer.about.iter().map(verdict).collect(),
            symmetries: answer.symmetries.iter().map(Symmetry::from).collect(),
            derivatives: answer.order,
            rank: answer.rank,
            unknowns: answer.unknowns,
            observability_notes: answer.notes.iter().map(Words::words).collect(),
            uniform: said.map(UniformityEntry::from),
            knowledge: self.knowledge.iter().map(KnowledgeEntry::from).collect(),
            choice: self.choice.as_ref().map(Chosen::from),
            declared: &self.declared,
            next: self.next.as_ref(),
        })
    }
}

fn verdict(asked: &observability::Asked) -> (String, Observability) {
    let verdict = match asked.verdict {
        observability::Verdict::Observable => Observability::Observable,
        observability::Verdict::Unobservable => Observability::Unobservable,
        observability::Verdict::Undecided => Observability::Undecided,
    };
    (asked.name.clone(), verdict)
}

impl<'a> From<&'a Examination> for FamilyFit<'a> {
    fn from(examination: &'a Examination) -> Self {
        Self {
            family: examination.family.name(),
            fit: examination.fit().into(),
            summary: examination.summary.words(),
            chains: &examination.chains,
            checks: examination.conditions().map(Condition::from).collect(),
        }
    }
}

impl<'a> From<&'a observability::Symmetry> for Symmetry<'a> {
    fn from(symmetry: &'a observability::Symmetry) -> Self {
        Self {
            moves: &symmetry.moves,
            directions: symmetry.directions,
            words: symmetry.words(),
            invariants: &symmetry.invariants,
        }
    }
}

impl<'a> From<&'a Uniformity> for UniformityEntry<'a> {
    fn from(uniformity: &'a Uniformity) -> Self {
        let structure::OneToOne { finding, alike, .. } = &uniformity.one_to_one;
        let parts = uniformity.singular.iter().take(LISTED);
        let blind = uniformity.blind.iter().map(|blind| Blind {
            input: &blind.input,
            value: blind.value,
            hidden: &blind.hidden,
        });
        Self {
            verdict: uniformity.regular.verdict.standing().into(),
            detail: uniformity.regular.reason.words(),
            one_to_one: OneToOne {
                verdict: finding.verdict.standing().into(),
                detail: finding.reason.words(),
                alike: alike
                    .as_ref()
                    .map(|alike| alike.points.iter().map(Point::from).collect()),
            },
            share: finite(uniformity.share),
            singular: parts.map(|part: &Place| sides(part)).collect(),
            blind: blind.collect(),
        }
    }
}
