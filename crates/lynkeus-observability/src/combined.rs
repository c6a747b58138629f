//! One answer for all branches.

use lynkeus_expr::Node;
use lynkeus_model::Plant;

use crate::analysis::in_branch;
use crate::branches::{self, Branch, Branches, Choices};
use crate::hidden::hide_alike;
use crate::model::{Model, check_names, expressions, measured};
use crate::settled::Settled;
use crate::switched::Switched;
use crate::{Answer, Note, Partial, Question, QuestionError, Verdict};

/// Decides what can be known.
///
/// # Errors
/// [`QuestionError`].
pub fn analyse(plant: &Plant, question: &Question) -> Result<Answer, QuestionError> {
    let between = between_events(plant, question)?;
    Ok(match plant.whens.is_empty() {
        true => between,
        false => beyond_events(between),
    })
}

/// What is seen before the first event is seen; what is hidden until then, an event may show.
fn beyond_events(mut answer: Answer) -> Answer {
    let mut doubted = vec![];
    for asked in answer.asked_mut() {
        if asked.verdict == Verdict::Unobservable {
            asked.verdict = Verdict::Undecided;
            doubted.push(asked.name.clone());
        }
    }
    answer.symmetries.clear();
    if !doubted.is_empty() {
        answer.notes.push(Note::BetweenEvents(doubted));
    }
    answer
}

fn between_events(plant: &Plant, question: &Question) -> Result<Answer, QuestionError> {
    let outputs = measured(plant, question)?;
    let about = expressions(plant, question)?;
    check_names(plant, question)?;
    let roots = [&plant.derivatives[..], &outputs, &about].concat();
    let mut settled = Settled::new(plant, question, &roots);
    if settled.made.is_empty() {
        return Ok(by_branches(plant, question, outputs, about));
    }
    let about = settled
        .roots
        .split_off(plant.derivatives.len() + outputs.len());
    let outputs = settled.roots.split_off(plant.derivatives.len());
    let derivatives = settled.roots;
    let plant = Plant {
        derivatives,
        ..plant.clone()
    };
    let mut answer = by_branches(&plant, question, outputs, about);
    answer.notes.push(Note::Settled(settled.made));
    Ok(answer)
}

/// With the choices that are open on the box.
fn by_branches(plant: &Plant, question: &Question, outputs: Vec<Node>, about: Vec<Node>) -> Answer {
    let own = in_branch(plant, question, (&outputs, &about), None);
    let choices = Choices::of(plant, &outputs);
    let branches = (!choices.is_empty()).then(|| choices.branches(plant, question));
    let Some(branches) = branches.flatten() else {
        return own;
    };
    let combination = Combination {
        plant,
        question,
        outputs,
        about,
        choices,
        branches,
    };
    combination.answer(own)
}

/// A question, and the branches of its model.
struct Combination<'a> {
    plant: &'a Plant,
    question: &'a Question,
    outputs: Vec<Node>,
    about: Vec<Node>,
    choices: Choices,
    branches: Branches,
}

/// What is hidden whatever the choices do.
struct Hidden {
    /// of everything asked, in order
    is_hidden: Vec<bool>,
    answer: Answer,
}

fn verdicts(answer: &Answer) -> Vec<Verdict> {
    answer.asked().map(|asked| asked.verdict).collect()
}

impl Combination<'_> {
    fn answer(&self, own: Answer) -> Answer {
        // the first is the model's own
        let others = self.branches.found.iter().skip(1);
        let others = others.map(|branch| verdicts(&self.in_branch(branch, &[])));
        let found: Vec<Vec<Verdict>> = std::iter::once(verdicts(&own)).chain(others).collect();
        let sees = |all: &Vec<Verdict>, place: usize| all[place] == Verdict::Observable;
        let is_open = |place: &usize| !found.iter().any(|all| sees(all, *place));
        let open: Vec<usize> = (0..found[0].len()).filter(is_open).collect();
        let hidden = (!open.is_empty()).then(|| self.hidden(&own));
        let mut answer = own;
        let (mut doubted, mut partial) = (vec![], vec![]);
        for (place, asked) in answer.asked_mut().enumerate() {
            let is_hidden = |hidden: &Hidden| hidden.is_hidden[place];
            let verdict = match open.contains(&place) {
                false => Verdict::Observable,
                true if hidden.as_ref().is_some_and(is_hidden) => Verdict::Unobservable,
                true => Verdict::Undecided,
            };
            if asked.verdict == Verdict::Unobservable && verdict == Verdict::Undecided {
                doubted.push(asked.name.clone());
            }
            asked.verdict = verdict;
            let blind = found.iter().zip(&self.branches.found);
            let blind = blind.filter(|(all, _)| !sees(all, place));
            let blind: Vec<&Branch> = blind.map(|(_, branch)| branch).collect();
            if let (Verdict::Observable, Some(first)) = (verdict, blind.first()) {
                partial.push(Partial {
                    name: asked.name.clone(),
                    share: blind.iter().map(|branch| branch.shares[first.moment]).sum(),
                    at: self.named(first),
                });
            }
        }
        answer.partial = partial;
        let told = hidden.filter(|hidden| hidden.is_hidden.contains(&true));
        answer.symmetries = told.map_or(vec![], |hidden| hidden.answer.symmetries);
        answer.notes.retain(|note| *note != Note::OwnBranch);
        answer.notes.push(self.branches.note());
        if !doubted.is_empty() {
            answer.notes.push(Note::WithinBranches(doubted));
        }
        answer
    }

    /// The answer in a branch, with some guards measured beside the outputs.
    fn in_branch(&self, branch: &Branch, guards: &[Node]) -> Answer {
        let outputs = [&self.outputs[..], guards].concat();
        let reference = Some(&branch.reference);
        in_branch(
            self.plant,
            self.question,
            (&outputs, &self.about),
            reference,
        )
    }

    /// What no branch shows, nor a change of the branch, nor several branches together.
    fn hidden(&self, own: &Answer) -> Hidden {
        let quantities = own.quantities.len();
        // an expression that chooses itself has a gradient in each branch
        let chooses = |about: &Node| Choices::are_made(&self.plant.graph, *about);
        let is_plain = |place: usize| match place.checked_sub(quantities) {
            Some(about) => !chooses(&self.about[about]),
            None => true,
        };
        if let Some(hidden) = self.alike() {
            return hidden;
        }
        let answer = self.switched();
        let is_hidden = own.asked().enumerate().map(|(place, asked)| {
            let told = match place.checked_sub(quantities) {
                Some(about) => Some(answer.about[about].verdict),
                None => answer.verdict(&asked.name),
            };
            // what no path of equations leads from is hidden in the other branches, too
            let is_apart = place < quantities && !self.choices.feel(&asked.name);
            match is_apart {
                true => asked.verdict == Verdict::Unobservable,
                false => told == Some(Verdict::Unobservable) && is_plain(place),
            }
        });
        Hidden {
            is_hidden: is_hidden.collect(),
            answer,
        }
    }

    /// With unknown inputs, which may answer differently in each branch: what is hidden in all branches where these leave
    /// the same of states and parameters unseen, guards measured. None where that is not so.
    fn alike(&self) -> Option<Hidden> {
        if self.question.unknown.is_empty() || !self.branches.all {
            return None;
        }
        let guards = &self.choices.guards;
        let outputs = [&self.outputs[..], guards].concat();
        let model = |branch: &Branch| {
            let (roots, reference) = ((&outputs[..], &self.about[..]), &branch.reference);
            Model::new(self.plant, self.question, roots, Some(reference)).ok()
        };
        let models = self.branches.found.iter().map(model);
        if !hide_alike(models.collect::<Option<_>>()?) {
            return None;
        }
        let mut answers = self
            .branches
            .found
            .iter()
            .map(|b| self.in_branch(b, guards));
        let answer = answers.next()?;
        let mut is_hidden = vec![true; verdicts(&answer).len()];
        for all in std::iter::once(verdicts(&answer)).chain(answers.map(|a| verdicts(&a))) {
            for (is_hidden, verdict) in is_hidden.iter_mut().zip(all) {
                *is_hidden &= verdict == Verdict::Unobservable;
            }
        }
        Some(Hidden { is_hidden, answer })
    }

    /// The values of what the choices read, by name.
    fn named(&self, branch: &Branch) -> Vec<(String, f64)> {
        let plant = self.plant;
        let read = plant.graph.symbols_of(&self.choices.guards);
        let variables = plant.states.iter().chain(&plant.inputs);
        let variables = variables.map(|v| (v.name.as_str(), v.node));
        let all = variables.chain([("time", plant.time)]);
        let read = all.filter(|(_, node)| read.contains(node));
        read.map(|(name, node)| (name.to_owned(), branch.reference[&node]))
            .collect()
    }

    /// With the choices made from outside. Unknown inputs are known here: what is hidden then, they do not show.
    fn switched(&self) -> Answer {
        let own = branches::own(self.plant, self.question);
        let switched = Switched::new(self.plant, &self.outputs, &self.choices, &own);
        let question = Question {
            unknown: vec![],
            ..self.question.clone()
        };
        let roots = (&switched.outputs[..], &self.about[..]);
        in_branch(&switched.plant, &question, roots, Some(&switched.reference))
    }
}
