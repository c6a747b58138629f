//! One case: what the library says of it, and what is wrong with that.

use std::cell::Cell;
use std::path::{Path, PathBuf};

use lynkeus::Study;
use lynkeus::expr::{Budget, Memory};
use lynkeus::observers::Observer;
use lynkeus::prepare::Prepared;
use lynkeus::structure::{AugmentedPlant, Standing, range};

use super::attack::Attack;
use super::case::{Case, Kind, Role};
use super::chance;
use super::claims::{self, Findings};
use super::error;
use super::facts::{self, Fact, Facts};
use super::pair::Pair;
use super::refute;
use super::retune;
use super::tally::Counts;
use super::tube;
use crate::numbers::Numbers;

/// What kind of claim turned out to be false.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Flaw {
    /// a proved bound of the error is exceeded
    Exceeded,
    /// every condition proved, and the plant contradicts one
    Condition(Fact),
    /// every condition proved, and the error grows from nothing for every gain
    Diverges,
    /// proved and refuted in one report
    Contradiction,
    /// the gain that is printed is not the observer's
    Gain,
    /// an error, or a filter's deviation, leaves its tube
    Error,
    /// too many runs are beyond a bound with a probability
    Chance,
    /// a run leaves the tube, or the witness of one that leaves the box does not
    Tube,
    /// a witness that shows nothing
    Witness,
    /// the library panics
    Panic,
}

/// A false claim with its evidence.
#[derive(Clone, Debug)]
pub struct Violation {
    pub flaw: Flaw,
    pub evidence: String,
}

/// How much of a case is looked at.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// simulations per proof
    pub runs: usize,
    /// errors and deviations that are driven to their ends
    pub targets: usize,
    /// conditions of all families instead of the study's
    pub thorough: bool,
    /// every family examines the plant; no observer is attacked
    pub refutations_only: bool,
    /// whether plant and gain are looked at beside the certificates
    pub facts: bool,
}

/// For the tube of a filter, which may be stiff or have many dimensions: most come to their end with half as many. And for
/// other tubes, beside which the gain is proved, too: one in some hundreds would take minutes.
const LOOKS: [usize; 2] = [300, 6000];

/// A limit that a seed reproduces, as no clock does: so many looks at it, of which a tube has two or more in each step. It is a
/// limit of memory, of which some more is in use with every look.
pub fn so_many_looks(looks: usize) -> Budget {
    // more than any work asks for at once
    const LOOK: usize = 1 << 40;
    thread_local! {
        static SO_FAR: Cell<usize> = const { Cell::new(0) };
    }
    SO_FAR.set(0);
    let used = || {
        SO_FAR.set(SO_FAR.get() + 1);
        SO_FAR.get() * LOOK
    };
    let memory = Memory {
        limit: looks * LOOK,
        used,
        before: 0,
    };
    Budget::new(None, Some(memory))
}

/// A folder in which the case is written for the library to read.
pub struct Desk(PathBuf);

impl Desk {
    pub fn new(folder: &Path) -> std::io::Result<Self> {
        std::fs::create_dir_all(folder)?;
        Ok(Self(folder.to_owned()))
    }

    pub fn write(&self, case: &Case) -> std::io::Result<PathBuf> {
        std::fs::write(self.0.join("plant.mo"), case.model())?;
        let study = self.0.join("study.toml");
        std::fs::write(&study, case.study())?;
        Ok(study)
    }
}

/// What was seen of a case.
pub struct Judgement {
    pub counts: Counts,
    pub violations: Vec<Violation>,
    /// the case as it was judged, with the gains that its theorem asks for
    pub case: Case,
}

/// Judges a case; with `tune` its gains are raised to what a theorem asks for.
pub fn judge(
    case: &Case,
    desk: &Desk,
    numbers: &mut Numbers,
    effort: Effort,
    tune: bool,
) -> Result<Judgement, String> {
    let mut case = case.clone();
    for round in 0..3 {
        let study = desk.write(&case).map_err(|e| e.to_string())?;
        let mut study = Study::load(&study).map_err(|e| e.to_string())?;
        if case.tube.is_some() {
            // what is proved until then stands
            study.budget = so_many_looks(LOOKS[usize::from(case.kind != Kind::Filter)]);
        }
        let plant = lynkeus::prepare::plant(&study).map_err(|e| e.to_string())?;
        let prepared = Prepared::new(&study, &plant).map_err(|e| e.to_string())?;
        let augmented = prepared.augmented();
        let found = match effort.refutations_only {
            true => claims::examined(&prepared),
            false => claims::findings(&prepared, effort.thorough),
        };
        let tuned = tune && !effort.refutations_only;
        if tuned && round < 2 && retune::raised(&mut case, &found, augmented, numbers) {
            continue;
        }
        let meant = found.meant(&case);
        let mut looked = Look {
            case: &meant,
            augmented,
            found: &found,
            effort,
            violations: vec![],
            counts: found.counts.clone(),
        };
        looked.everything(&study, numbers);
        let (counts, violations) = (looked.counts, looked.violations);
        let simulated = effort.facts && !effort.refutations_only;
        let simulated = simulated && case.course.is_none();
        if violations.is_empty() && simulated && found.fits() && numbers.chance(0.15) {
            let mut judgement = Judgement {
                counts,
                violations,
                case,
            };
            let diverges = retune::diverges(&judgement.case, desk, numbers)?;
            judgement.violations.extend(diverges);
            return Ok(judgement);
        }
        return Ok(Judgement {
            counts,
            violations,
            case,
        });
    }
    Err("no round".into())
}

struct Look<'a, 'p> {
    case: &'a Case,
    augmented: &'a AugmentedPlant<'p>,
    found: &'a Findings,
    effort: Effort,
    violations: Vec<Violation>,
    counts: Counts,
}

impl Look<'_, '_> {
    fn everything(&mut self, study: &Study, numbers: &mut Numbers) {
        if self.effort.refutations_only {
            self.witnesses();
            self.counts.violated = usize::from(!self.violations.is_empty());
            return;
        }
        if self.found.contradicts {
            self.note(
                Flaw::Contradiction,
                "theorem proved, inequality refuted".into(),
            );
        }
        let is_filter = self.case.kind == Kind::Filter;
        if let Some(design) = self.found.design.as_ref().filter(|_| !is_filter) {
            self.against_claims(&design.observer, numbers);
            self.against_chances(&design.observer, numbers);
            self.against_samples(&design.observer, numbers);
        }
        self.against_tube(numbers);
        self.against_error(study, numbers);
        if is_filter {
            self.witnesses();
            self.counts.violated = usize::from(!self.violations.is_empty());
            return;
        }
        if self.effort.facts && self.found.fits() {
            self.against_facts(numbers);
        }
        self.witnesses();
        if let Some(design) = &self.found.design {
            self.against_print(&design.observer, numbers);
        }
        self.counts.violated = usize::from(!self.violations.is_empty());
    }

    fn note(&mut self, flaw: Flaw, evidence: String) {
        self.violations.push(Violation { flaw, evidence });
    }

    fn against_claims(&mut self, observer: &Observer, numbers: &mut Numbers) {
        let Ok(mut pair) = Pair::new(self.augmented.plant, self.augmented, observer) else {
            return self.note(
                Flaw::Exceeded,
                "the observer reads what nobody knows".into(),
            );
        };
        if pair.estimates() != self.augmented.states.len() {
            return;
        }
        let found = self.found;
        if found.claims.is_empty() {
            return;
        }
        let mut attack = attack(self.case, self.augmented, &mut pair, &found.claims);
        if let Some(evidence) = attack.secant(numbers) {
            return self.note(Flaw::Exceeded, evidence);
        }
        let (plan, worst) = attack.search(numbers, self.effort.runs);
        if worst.long {
            self.counts.followed += self.found.claims.len();
        }
        if worst.ratio > 1.0 + 1e-4 {
            let evidence = format!("{} (ratio {})\n{plan:#?}", worst.what, worst.ratio);
            self.note(Flaw::Exceeded, evidence);
        }
    }

    /// Runs with random noise, counted.
    fn against_chances(&mut self, observer: &Observer, numbers: &mut Numbers) {
        let found = self.found;
        let all = found.claims.iter().enumerate();
        let probable = all.filter_map(|(i, c)| Some((i, c.probable.as_ref()?)));
        for (i, bounds) in probable {
            let Ok(mut pair) = Pair::new(self.augmented.plant, self.augmented, observer) else {
                return;
            };
            let claims = &found.claims[i..=i];
            let mut attack = attack(self.case, self.augmented, &mut pair, claims);
            let density = |v: &lynkeus::model::Variable| {
                let own = self.case.process.iter().find(|(name, _)| *name == v.name);
                own.map_or(0.0, |(_, density)| *density)
            };
            // noise on an unknown input moves none of the plant's states: it stays where it is
            let states = &self.augmented.states[..self.augmented.plant_states()];
            let densities: Vec<f64> = states.iter().map(density).collect();
            let rate = found.claims[i].rate;
            let Some(counted) = chance::count(&mut attack, bounds, rate, &densities, numbers)
            else {
                continue;
            };
            self.counts.probable += 1;
            if let Some(evidence) = counted.evidence {
                self.note(Flaw::Chance, evidence);
            }
        }
    }

    /// Runs of the study's own filter or observer.
    fn against_error(&mut self, study: &Study, numbers: &mut Numbers) {
        let tube = self.found.error_tube.as_ref();
        let Some(tube) = tube.filter(|_| self.case.course.is_some()) else {
            return;
        };
        let mut study = study.clone();
        study.budget = Budget::default();
        for is_exact in [false, true] {
            let followed = if is_exact { &tube.exact } else { &tube.noisy };
            let Some(followed) = followed.as_ref().filter(|f| f.reached > tube.from) else {
                continue;
            };
            let attack = error::Attack::new(self.case, &study, self.augmented, tube, is_exact);
            let worst = match attack {
                Ok(mut attack) => attack.search(numbers, self.effort.targets),
                Err(missing) => return self.note(Flaw::Error, missing),
            };
            if worst.is_whole && !is_exact {
                self.counts.errors += 1;
                self.counts.bounded += usize::from(followed.reached >= tube.until);
            }
            if worst.ratio > 1.0 {
                self.note(Flaw::Error, worst.what);
            }
        }
    }

    /// Plant and sampled observer, with samples as far apart as is claimed or less.
    fn against_samples(&mut self, observer: &Observer, numbers: &mut Numbers) {
        let Some((claim, longest, together)) = &self.found.sampled else {
            return;
        };
        let claims = std::slice::from_ref(claim);
        let sampled = observer.sampled(self.augmented).map(|s| s.observer);
        let pair = sampled.and_then(|s| Pair::new(self.augmented.plant, self.augmented, &s));
        let Ok(mut pair) = pair else {
            return self.note(
                Flaw::Exceeded,
                "the sampled observer reads what nobody knows".into(),
            );
        };
        let mut attack = attack(self.case, self.augmented, &mut pair, claims);
        // predictions have to stay where the plant's outputs are, too
        let region = self.augmented.region();
        let outputs = self.augmented.outputs.iter().map(|o| o.variable.node);
        attack.guards = (self.augmented.states.len()..)
            .zip(outputs)
            .filter_map(|(index, h)| {
                let shown = range(&self.augmented.plant.graph, h, &region)
                    .ok()?
                    .enclosure;
                Some((index, [shown.lo(), shown.hi()]))
            })
            .collect();
        attack.samples = Some(*longest);
        self.counts.sampled += 1;
        self.counts.sampled_together += usize::from(*together);
        let (plan, worst) = attack.search(numbers, self.effort.runs);
        if worst.ratio > 1.0 + 1e-4 {
            let evidence = format!("{} (ratio {})\n{plan:#?}", worst.what, worst.ratio);
            self.note(Flaw::Exceeded, evidence);
        }
    }

    /// Runs of the plant alone, with everything that is declared.
    fn against_tube(&mut self, numbers: &mut Numbers) {
        let Some(tube) = &self.found.tube else {
            return;
        };
        let Ok(mut attack) = tube::Attack::new(self.case, tube, self.augmented.plant) else {
            return self.note(Flaw::Tube, "the plant reads what nobody knows".into());
        };
        if let Some(evidence) = attack.misled() {
            self.note(Flaw::Tube, evidence);
        }
        if tube.reached <= tube.from {
            return;
        }
        let worst = attack.search(numbers, self.effort.runs);
        if worst.is_whole {
            self.counts.tubes += 1;
            self.counts.stay += usize::from(tube.verdict == Standing::Proved);
        }
        if worst.ratio > 1.0 {
            self.note(Flaw::Tube, worst.what);
        }
    }

    fn against_print(&mut self, observer: &Observer, numbers: &mut Numbers) {
        let Ok(mut pair) = Pair::new(self.augmented.plant, self.augmented, observer) else {
            return;
        };
        if pair.estimates() != self.augmented.states.len() {
            return;
        }
        let names: Vec<String> = self
            .augmented
            .states
            .iter()
            .map(|s| s.name.clone())
            .collect();
        let mut attack = attack(self.case, self.augmented, &mut pair, &[]);
        if let Some(evidence) = attack.misprint(numbers, &self.found.gain, &names) {
            self.note(Flaw::Gain, evidence);
        }
    }

    fn against_facts(&mut self, numbers: &mut Numbers) {
        let Some(design) = &self.found.design else {
            return;
        };
        let Ok(mut pair) = Pair::new(self.augmented.plant, self.augmented, &design.observer) else {
            return;
        };
        let plant = self.augmented.plant;
        let side = |v: &lynkeus::model::Variable| facts::finite(v.min, v.max);
        let mut facts = Facts {
            pair: &mut pair,
            states: plant.states.iter().map(side).collect(),
            inputs: plant.inputs.iter().map(side).collect(),
        };
        // what the observer takes as zero is no part of the conditions
        for input in &self.case.inputs {
            let place = plant.inputs.iter().position(|i| i.name == input.side.name);
            if let (Role::Disturbance, Some(i)) = (input.role, place) {
                facts.inputs[i] = [0.0, 0.0];
            }
        }
        let chained = matches!(
            self.case.kind,
            Kind::Triangular | Kind::BlockTriangular | Kind::Designed
        );
        let chains = match &self.found.examination {
            Some(examination) if chained => facts::neighbours(&examination.chains, self.augmented),
            _ => vec![],
        };
        if let Some((fact, evidence)) = facts.against(numbers, &chains) {
            self.note(Flaw::Condition(fact), evidence);
        }
    }

    fn witnesses(&mut self) {
        for refutation in &self.found.refutations {
            match refute::check(refutation, self.augmented, self.found.design.as_deref()) {
                refute::Answer::Confirmed => self.counts.refutations += 1,
                refute::Answer::Unread => self.counts.unread += 1,
                refute::Answer::Wrong(evidence) => {
                    self.counts.refutations += 1;
                    self.counts.wrong += 1;
                    let evidence = format!("{:?}: {evidence}", refutation.condition);
                    self.note(Flaw::Witness, evidence);
                }
            }
        }
    }
}

/// The attack with the box of everything that is estimated.
pub fn attack<'a>(
    case: &'a Case,
    augmented: &AugmentedPlant<'_>,
    pair: &'a mut Pair,
    claims: &'a [claims::Claim],
) -> Attack<'a> {
    let side = |state: &lynkeus::model::Variable| {
        let own = claims
            .iter()
            .flat_map(|c| &c.sides)
            .filter(|s| s.name == state.name);
        // the smallest of the boxes, where two proofs have two
        own.fold([state.min, state.max], |[low, high], own| {
            [low.max(own.min), high.min(own.max)]
        })
    };
    let sides: Vec<[f64; 2]> = augmented.states.iter().map(side).collect();
    // the practical observer of Germani and Manes follows the inputs by filters
    let filtered = case.setting("variant") == Some("\"practical\"");
    let extra = pair.start.len().saturating_sub(sides.len());
    let known: Vec<_> = case
        .inputs
        .iter()
        .filter(|i| i.role == Role::Known)
        .collect();
    let mut guards = vec![];
    if filtered && extra > 0 && !known.is_empty() {
        for (k, index) in (sides.len()..pair.start.len()).enumerate() {
            let orders = extra / known.len();
            let slope = case.slope.unwrap_or(f64::INFINITY);
            guards.push((
                index,
                match k % orders.max(1) {
                    0 => {
                        let side = &known[(k / orders.max(1)).min(known.len() - 1)].side;
                        [side.low, side.high]
                    }
                    _ => [-slope, slope],
                },
            ));
        }
    }
    Attack {
        case,
        pair,
        claims,
        sides,
        guards,
        samples: None,
    }
}
