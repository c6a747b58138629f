//! What can be known of a model, and how that was decided.

use lynkeus_observability::{Kind, Note, Symmetry};

use crate::{Words, counted};

/// Names before the rest becomes a count.
const LISTED: usize = 8;
const CHOICES: &str = "the model makes choices (if, abs, min, max, sign, floor …)";

impl Words for Symmetry {
    fn words(&self) -> String {
        let moves = listed(&self.moves);
        let how = match self.kind {
            Some(Kind::Scaling) => "scaled",
            Some(Kind::Shift) => "shifted",
            None => {
                let count = self.moves.len();
                let known = count - self.directions.min(count);
                let known = counted(known, "combination");
                return format!(
                    "{moves} can change together without a trace in the outputs: {known} of these {count} can be known"
                );
            }
        };
        match (self.invariants.is_empty(), &self.moves[..]) {
            (true, [only]) => format!("{only} can have any value: the outputs do not depend on it"),
            (true, _) => format!("{moves} can have any values: the outputs do not depend on them"),
            (false, _) => format!(
                "of {moves}, which can be {how} together, only {} can be known",
                listed(&self.invariants)
            ),
        }
    }
}

/// The first few, and how many there are.
fn listed(names: &[String]) -> String {
    match names.len() > LISTED {
        true => format!("{}, … ({} in all)", names[..LISTED].join(", "), names.len()),
        false => names.join(", "),
    }
}

impl Words for Note {
    fn words(&self) -> String {
        let contains = |what: &str| format!("undecided: the model contains {what}");
        match self {
            Note::Exact => "exact arithmetic in a prime field at a random point: \"observable\" is certain, \"unobservable\" is wrong with a probability below 1e-12".to_owned(),
            Note::Generic(functions) => format!(
                "exact arithmetic in a prime field at a random point; {} enter through their differential equations, with values drawn at random that keep the usual identities; beyond these, composed functions are taken as generic, and \"observable\" rests on that",
                functions.join(", ")
            ),
            Note::OwnBranch => format!(
                "{CHOICES}: the branch at its own values is analysed, and what another branch or the moment of the change would show is not"
            ),
            Note::Branches { count, later, all } => {
                let found = match count {
                    1 => "one branch was".to_owned(),
                    count => format!("{count} branches were"),
                };
                let times = if *later { " and at other times" } else { "" };
                let reserve = if *all { "" } else { ", and further ones were not" };
                format!("{CHOICES}: {found} found at points of the box{times}, each analysed{reserve}")
            }
            Note::Settled(made) => format!(
                "on the whole declared box one branch is taken (proved) of {}: that one is analysed",
                listed(made)
            ),
            Note::WithinBranches(names) => format!(
                "within each branch the outputs do not tell {}; the moments at which the branch changes may, or what several branches tell together",
                names.join(", ")
            ),
            Note::BetweenEvents(names) => format!(
                "between events (`when`) the outputs do not tell {}; what happens at one may",
                names.join(", ")
            ),
            Note::Derivatives(order) => format!(
                "start values are given: {order} derivatives of the outputs were taken, and what is undecided may show in a later one, or never"
            ),
            Note::Struck(limit, order) => format!(
                "the limit of {limit} struck after {order} derivatives of the outputs: what is called observable is so, the rest is undecided"
            ),
            Note::StruckAtOnce(limit) => {
                format!("undecided: the limit of {limit} struck at once")
            }
            Note::Singular => "undecided: its series is not defined at any of the random points tried: a division by zero, or roots of negative numbers".to_owned(),
            Note::Loop(text) => contains(&format!("an algebraic loop, {text}")),
            Note::ConditionEstimate => contains("the condition estimate of a linear system"),
            Note::NoValue(name) => contains(&format!("'{name}', which has no value")),
            Note::NotDefined(text) => {
                contains(&format!("{text}, which is not defined at the reference point"))
            }
            Note::SingularSystem => contains("a singular linear system"),
            Note::System => contains("a linear system as a value"),
            Note::Number(x) => contains(&format!("the number {x}")),
        }
    }
}
