//! For every quantity one of four things: known everywhere; known only while inputs excite it; not
//! observable, but its error decays by itself; not known. For each assumption on the unknown inputs.

use lynkeus_answer::Document;
use lynkeus_model::Home;
use lynkeus_observability::{Answer, Verdict};
use lynkeus_structure::detectability::{Detectability, Hidden, HiddenErrors, Observability};
use lynkeus_structure::{self as structure, AugmentedPlant, Coordinate, Uniformity};

use lynkeus_experiment::words::{listed, number};

/// What can be known of one quantity.
#[derive(Clone, Debug, PartialEq)]
pub enum Known {
    /// on the whole box and for all inputs of the assumption: proved
    Everywhere,
    /// on the whole box while known inputs stay constant: proved; at almost every state and input
    /// else
    WhileConstant,
    /// neighbouring states are told apart on the whole box: proved; whether states far apart are is not
    Locally {
        /// while known inputs stay constant
        constant: bool,
    },
    /// at almost every state and input; everywhere is not decided
    AlmostEverywhere,
    /// in some of the branches of the model's choices only
    InPart {
        /// the share of the box in the others, estimated
        share: f64,
        /// a point there
        at: Vec<(String, f64)>,
    },
    /// not while this input has this value
    WhileExcited {
        /// name of the input
        input: String,
        /// a constant value of it that hides the quantity
        value: f64,
    },
    /// only where sensors are within their limits, or but for what disturbances do
    Reserved {
        /// what is known then
        known: Box<Known>,
        /// the reserve
        reserve: Reserve,
    },
    /// the outputs do not determine it; what becomes of an error in it
    Hidden(Detectability),
    /// a limit ended the analysis, or it does not apply
    Undecided,
}

/// What stands between a quantity and its outputs.
#[derive(Clone, Debug, PartialEq)]
pub enum Reserve {
    /// measured outputs beyond whose limits nothing shows it
    Limits(Vec<String>),
    /// inputs that act on the plant and that the observer takes as zero
    Disturbances {
        /// their names
        names: Vec<String>,
        /// how far they can move what the outputs tell of it, in its unit; none where no bound is proved
        bound: Option<f64>,
    },
}

/// What is taken for granted of the unknown inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Assumption {
    /// there are none
    NoneUnknown,
    /// any functions of time
    Arbitrary,
    /// constants that wander slowly
    Wandering {
        /// as `[process_noise]` says
        declared: bool,
    },
}

/// What can be known under one assumption.
#[derive(Clone, Debug)]
pub struct Knowledge {
    /// what is assumed of the unknown inputs
    pub assumption: Assumption,
    /// names of the unknown inputs
    pub unknown: Vec<String>,
    /// states, then unknown inputs
    pub quantities: Vec<(String, Known)>,
    /// where it was linearised; empty where it was not
    pub point: Vec<Coordinate>,
    /// what the states that are no real numbers are known up to, in words
    pub turns: Vec<String>,
}

/// What the examination of the box has found.
pub(super) struct Found<'a> {
    pub uniform: Option<&'a Uniformity>,
    /// known everywhere by elimination, per augmented state
    pub determined: &'a [bool],
}

impl Knowledge {
    /// Sorts the quantities of `augmented` by the exact verdicts of `answer`.
    pub(super) fn new(
        augmented: &AugmentedPlant<'_>,
        assumption: Assumption,
        answer: &Answer,
        found: &Found<'_>,
    ) -> Result<Self, lynkeus_expr::MissingInput> {
        let verdicts: Vec<Option<Verdict>> = augmented
            .states
            .iter()
            .map(|s| answer.verdict(&s.name))
            .collect();
        // what is known in part may differ between two solutions for ever
        let is_in_part = |i: usize| {
            matches!(
                found.seen(augmented, i, assumption, answer),
                Known::InPart { .. }
            )
        };
        let observability = verdicts
            .iter()
            .enumerate()
            .map(|(i, verdict)| match verdict {
                Some(Verdict::Observable) if is_in_part(i) => Observability::Open,
                Some(Verdict::Observable) => Observability::Determined,
                Some(Verdict::Unobservable) => Observability::Hidden,
                Some(Verdict::Undecided) | None => Observability::Open,
            });
        let hidden = Hidden {
            observability: observability.collect(),
            arbitrary: assumption == Assumption::Arbitrary,
            directions: answer.symmetries.iter().map(|s| s.directions).sum(),
            augmented,
        };
        let hidden_errors = match hidden.observability.contains(&Observability::Hidden) {
            true => hidden.hidden_errors()?,
            false => HiddenErrors {
                of: vec![None; verdicts.len()],
                point: vec![],
            },
        };
        let known = |i: usize| match verdicts[i] {
            Some(Verdict::Observable) => found.seen(augmented, i, assumption, answer),
            Some(Verdict::Unobservable) => {
                Known::Hidden(hidden_errors.of[i].unwrap_or(Detectability::Undecided))
            }
            Some(Verdict::Undecided) | None => Known::Undecided,
        };
        let asked = (0..verdicts.len()).filter(|&i| verdicts[i].is_some());
        Ok(Self {
            assumption,
            unknown: augmented.states[augmented.plant_states()..]
                .iter()
                .map(|s| s.name.clone())
                .collect(),
            quantities: asked
                .map(|i| (augmented.states[i].name.clone(), known(i)))
                .collect(),
            point: hidden_errors.point,
            turns: turns(augmented),
        })
    }

    /// What is known of a quantity.
    pub(super) fn of(&self, name: &str) -> Option<&Known> {
        let mut quantities = self.quantities.iter();
        quantities.find(|(n, _)| n == name).map(|(_, known)| known)
    }

    /// Names of what is known, of what follows in the end, of what is not known, and of what is
    /// not decided.
    pub(super) fn sorted(&self) -> Sorted<'_> {
        let quantities = self.quantities.iter();
        Sorted::of_knowledge(quantities.map(|(name, known)| (name.as_str(), known)))
    }

    /// The assumption in words.
    pub fn words(&self) -> String {
        let names = self.unknown.join(", ");
        match self.assumption {
            Assumption::NoneUnknown => "what can be known".to_owned(),
            Assumption::Arbitrary => format!("what can be known, whatever {names} does"),
            Assumption::Wandering { declared: true } => {
                format!("the same if {names} only wanders, as [process_noise] says")
            }
            Assumption::Wandering { declared: false } => {
                format!("the same if {names} is constant or wanders slowly")
            }
        }
    }
}

impl Found<'_> {
    /// What is proved on the box settles what `answer` left undecided: a map that is
    /// regular everywhere, or an elimination, shows the quantity near every point.
    pub(super) fn settle(
        &self,
        augmented: &AugmentedPlant<'_>,
        assumption: Assumption,
        answer: &mut Answer,
    ) {
        for (asked, _) in &mut answer.quantities {
            let place = augmented.state_index(&asked.name);
            let is_proved = place.is_some_and(|place| {
                self.determined.get(place) == Some(&true)
                    || self.is_one_to_one(place, assumption)
                    || self.is_regular(assumption)
            });
            if asked.verdict == Verdict::Undecided && is_proved {
                asked.verdict = Verdict::Observable;
            }
        }
    }

    /// Whether the map from states to outputs is proved to be regular on the box, where the
    /// unknown inputs are as `assumption` says: it was examined with inputs that stay constant,
    /// known ones and unknown ones.
    fn is_regular(&self, assumption: Assumption) -> bool {
        let is_proved = |u: &Uniformity| u.regular.verdict == structure::Verdict::Proved;
        assumption != Assumption::Arbitrary && self.uniform.is_some_and(is_proved)
    }

    /// Whether no two points of the box that differ in this state have equal outputs for ever, under the same assumptions.
    fn is_one_to_one(&self, place: usize, assumption: Assumption) -> bool {
        let is_proved = |u: &Uniformity| u.one_to_one.known.get(place) == Some(&true);
        assumption != Assumption::Arbitrary && self.uniform.is_some_and(is_proved)
    }

    /// Of a quantity that is observable at generic points.
    fn seen(
        &self,
        augmented: &AugmentedPlant<'_>,
        place: usize,
        assumption: Assumption,
        answer: &Answer,
    ) -> Known {
        let name = &augmented.states[place].name;
        if self.determined.get(place) == Some(&true) {
            return Known::Everywhere;
        }
        let constant = !augmented.inputs.is_empty();
        if self.is_one_to_one(place, assumption) {
            return match constant {
                true => Known::WhileConstant,
                false => Known::Everywhere,
            };
        }
        if self.is_regular(assumption) {
            return Known::Locally { constant };
        }
        if let Some(part) = answer.partial.iter().find(|part| part.name == *name) {
            return Known::InPart {
                share: part.share,
                at: part.at.clone(),
            };
        }
        let blind = self.uniform.into_iter().flat_map(|u| &u.blind);
        let mut hides = blind.filter(|b| b.hidden.is_empty() || b.hidden.contains(name));
        match hides.next() {
            Some(blind) => Known::WhileExcited {
                input: blind.input.clone(),
                value: blind.value,
            },
            None => Known::AlmostEverywhere,
        }
    }
}

impl Known {
    /// Whether the outputs tell it, be it in part.
    pub(super) fn is_seen(&self) -> bool {
        !matches!(self, Known::Hidden(_) | Known::Undecided)
    }

    /// The one that says less, of two that the outputs tell.
    pub(super) fn weaker<'k>(&'k self, other: &'k Self) -> &'k Self {
        let rank = |known: &Self| match known {
            Known::Everywhere => 0,
            Known::WhileConstant => 1,
            Known::Locally { .. } => 2,
            Known::AlmostEverywhere => 3,
            Known::WhileExcited { .. } => 4,
            Known::InPart { .. } => 5,
            _ => 6,
        };
        if rank(self) >= rank(other) {
            self
        } else {
            other
        }
    }

    /// The line under which it stands; `unit` is that of time.
    pub(crate) fn line(&self, unit: &str) -> String {
        match self {
            Known::Everywhere => "known everywhere (proved on the box)".to_owned(),
            Known::WhileConstant => {
                "known everywhere while inputs are constant (proved on the box), and for almost every other input".to_owned()
            }
            Known::Locally { constant } => format!(
                "known locally: the outputs distinguish neighbouring states everywhere{} (proved on the box), states far apart may not be",
                if *constant { " while inputs are constant" } else { "" }
            ),
            Known::AlmostEverywhere => {
                "known at almost every state and input, locally (everywhere is not proved)".to_owned()
            }
            Known::InPart { share, at } => in_part(*share, at),
            Known::WhileExcited { input, value } => {
                format!(
                    "known only while inputs excite it, and locally (hidden for {input} = {})",
                    number(*value)
                )
            }
            Known::Reserved { known, reserve } => reserve.line(&known.line(unit)),
            Known::Hidden(detectability) => told(*detectability, unit),
            Known::Undecided => "undecided".to_owned(),
        }
    }
}

/// What all that is said of the map to the outputs rests on, in words; nothing without reserves.
pub(super) fn reserves(all: &[Knowledge]) -> String {
    let known = all.iter().flat_map(|knowledge| &knowledge.quantities);
    let mut told: Vec<String> = vec![];
    for (_, known) in known {
        let Known::Reserved { reserve, .. } = known else {
            continue;
        };
        let words = match reserve {
            Reserve::Limits(sensors) => {
                format!(", where {} is within its limits", sensors.join(", "))
            }
            Reserve::Disturbances { names, .. } => {
                format!(", were the disturbance {} zero", names.join(", "))
            }
        };
        if !told.contains(&words) {
            told.push(words);
        }
    }
    told.concat()
}

impl Reserve {
    fn line(&self, otherwise: &str) -> String {
        match self {
            Reserve::Limits(sensors) => format!(
                "{otherwise}, where {} is within its limits: beyond, the reading hides it",
                sensors.join(", ")
            ),
            Reserve::Disturbances { names, bound } => {
                let names = names.join(", ");
                let size = match bound {
                    Some(bound) => format!("within {} (proved on the box)", number(*bound)),
                    None => "of which no bound is proved".to_owned(),
                };
                format!("known up to the disturbance {names}, {size}; were it zero: {otherwise}")
            }
        }
    }
}

/// What is known in some branches, of which one that hides it holds at a point.
pub(super) fn in_part(share: f64, at: &[(String, f64)]) -> String {
    let (part, then) = match at.iter().any(|(name, _)| name == "time") {
        true => ("at some times, or on a part of the box,", " at that time"),
        false => ("on a part of the box", ""),
    };
    let sides = at
        .iter()
        .map(|(name, x)| format!("{name} = {}", number(*x)));
    format!(
        "known {part} only: the model makes choices, and in the branch at {}, as on about {} % of the box{then}, the outputs do not show it",
        sides.collect::<Vec<_>>().join(", "),
        number((100.0 * share).round())
    )
}

fn told(detectability: Detectability, unit: &str) -> String {
    match detectability {
        Detectability::Decays {
            rate,
            is_proved: true,
        } => format!(
            "not observable, but its error decays by itself, at {} per {unit} or faster (proved on the box)",
            number(rate)
        ),
        Detectability::Decays {
            rate,
            is_proved: false,
        } => format!(
            "not observable, but its error decays by itself, at {} per {unit} (linearised at one point only, see below)",
            number(rate)
        ),
        Detectability::Bounded {
            bound,
            is_kept: true,
        } => format!(
            "not known: an unknown input keeps its error alive, in the end below {} (proved on the box)",
            number(bound)
        ),
        Detectability::Bounded {
            bound,
            is_kept: false,
        } => format!(
            "not known: its error ends below {} (proved on the box); whether it decays is not decided",
            number(bound)
        ),
        Detectability::Stays => {
            "not known: its error stays as it is, or hardly moves (linearised, see below)"
                .to_owned()
        }
        Detectability::Grows { rate } => format!(
            "not known: its error grows, at {} per {unit} (linearised, see below)",
            number(rate)
        ),
        Detectability::Moved => "not known: an unknown input moves it without a trace".to_owned(),
        Detectability::Undecided => "not known: whether its error decays is not decided".to_owned(),
    }
}

/// Every assumption that makes a difference.
pub(super) fn tell(document: &mut Document, all: &[Knowledge], unit: &str) {
    let mut before: Option<&Knowledge> = None;
    for knowledge in all {
        if before.is_some_and(|before| before.quantities == knowledge.quantities) {
            document.line(format!("{}: the same", knowledge.words()));
            continue;
        }
        document.heading(knowledge.words());
        let mut lines: Vec<(String, Vec<&str>)> = vec![];
        for (name, known) in &knowledge.quantities {
            let line = known.line(unit);
            match lines.iter_mut().find(|(l, _)| *l == line) {
                Some((_, names)) => names.push(name),
                None => lines.push((line, vec![name])),
            }
        }
        document.items(
            lines
                .iter()
                .map(|(line, names)| format!("{}: {line}", listed(names))),
        );
        document.items(caveats(knowledge));
        before = Some(knowledge);
    }
}

/// Coordinates of a point that are told.
const COORDINATES: usize = 8;

/// What angles and rotations are known up to.
fn turns(augmented: &AugmentedPlant<'_>) -> Vec<String> {
    let states = augmented.states.iter();
    let angles = states
        .clone()
        .filter(|s| matches!(s.home, Home::Circle { .. }));
    let angles: Vec<&str> = angles.map(|s| s.name.as_str()).collect();
    let rotations = states.filter(|s| s.home == Home::Rotation { element: 0 });
    let rotations = rotations.map(|s| {
        let name = s.name.split('[').next().unwrap_or(&s.name);
        format!("({name} is a unit quaternion: that its length is 1 counts as known, and {name} and -{name} are one rotation)")
    });
    let angles =
        (!angles.is_empty()).then(|| format!("({}: known up to a full turn)", listed(&angles)));
    angles.into_iter().chain(rotations).collect()
}

/// What the lines rest on.
fn caveats(knowledge: &Knowledge) -> Vec<String> {
    let mut told = knowledge.turns.clone();
    if !knowledge.point.is_empty() {
        let point = knowledge.point.iter().take(COORDINATES);
        let sides = point.map(|c| format!("{} = {}", c.name, number(c.value)));
        told.push(format!(
            "(linearised at {}; elsewhere it may be faster, slower, or not at all)",
            sides.collect::<Vec<_>>().join(", ")
        ));
    }
    let decays = |known: &Known| matches!(known, Known::Hidden(Detectability::Decays { .. }));
    if knowledge.quantities.iter().any(|(_, known)| decays(known)) {
        told.push(match knowledge.assumption {
            Assumption::Wandering { .. } => "(decays: the error of the start is forgotten; what wanders keeps a part of it alive)",
            _ => "(decays: once the observable quantities are known, for a model that is right)",
        }.to_owned());
    }
    told
}

/// Names by what can be known of them.
#[derive(Default)]
pub(super) struct Sorted<'a> {
    /// the outputs tell
    pub seen: Vec<&'a str>,
    /// known in the end, as errors decay
    pub follows: Vec<&'a str>,
    /// the outputs do not tell
    pub hidden: Vec<&'a str>,
    /// whether the outputs tell is not decided
    pub open: Vec<&'a str>,
}

impl<'a> Sorted<'a> {
    pub fn of_knowledge(quantities: impl Iterator<Item = (&'a str, &'a Known)>) -> Self {
        let mut sorted = Self::default();
        for (name, known) in quantities {
            let group = match known {
                Known::Everywhere
                | Known::WhileConstant
                | Known::Locally { .. }
                | Known::AlmostEverywhere
                | Known::WhileExcited { .. }
                | Known::InPart { .. }
                | Known::Reserved { .. } => &mut sorted.seen,
                Known::Hidden(Detectability::Decays { .. }) => &mut sorted.follows,
                Known::Hidden(_) => &mut sorted.hidden,
                Known::Undecided => &mut sorted.open,
            };
            group.push(name);
        }
        sorted
    }

    pub fn of_verdicts(quantities: impl Iterator<Item = (&'a str, Verdict)>) -> Self {
        let mut sorted = Self::default();
        for (name, verdict) in quantities {
            let group = match verdict {
                Verdict::Observable => &mut sorted.seen,
                Verdict::Unobservable => &mut sorted.hidden,
                Verdict::Undecided => &mut sorted.open,
            };
            group.push(name);
        }
        sorted
    }

    /// Whether an estimate of it is worth something.
    pub fn is_estimated(&self, name: &str) -> bool {
        self.seen.contains(&name) || self.follows.contains(&name)
    }
}
