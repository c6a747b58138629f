//! Which equation is missing, and which is one too many.

use lynkeus_expr::Node;

use super::system::System;
use crate::diagnostic::{Problem, Result, Span};

impl System<'_> {
    /// Refuses a system in which an equation is missing or one too many, as its maximum matching
    /// shows.
    pub(super) fn check_balance(&self, model: Span) -> Result<()> {
        if self.unknowns.iter().all(|unknown| unknown.state.is_none()) {
            return Err(
                Problem::new(model, "the model has no state: nothing stands under `der`")
                    .hint("a plant has at least one equation `der(x) = …`"),
            );
        }
        let missing = first_free(&self.matching.of_unknown);
        match (first_free(&self.matching.of_equation), missing) {
            (Some(surplus), missing) => Err(self.surplus(surplus, missing)),
            (None, Some(missing)) => Err(self.missing(missing)),
            (None, None) => Ok(()),
        }
    }

    fn count(&self) -> String {
        let (equations, unknowns) = (self.equations.len(), self.unknowns.len());
        let plural = |n: usize| if n == 1 { "" } else { "s" };
        let (e, u) = (plural(equations), plural(unknowns));
        format!("{equations} equation{e} for {unknowns} unknown{u}")
    }

    /// The unknowns and equations that share the lack, by alternating paths.
    fn missing(&self, place: usize) -> Box<Problem> {
        let mut of_unknown = vec![vec![]; self.unknowns.len()];
        for (equation, unknowns) in self.pattern.iter().enumerate() {
            for &unknown in unknowns {
                of_unknown[unknown].push(equation);
            }
        }
        let (unknowns, equations) = reached(place, &of_unknown, &self.matching.of_equation);
        let name = &self.unknowns[place].name;
        let message = format!("variable `{name}` lacks an equation");
        let problem = Problem::new(self.unknowns[place].span, message).label(self.count());
        if equations.is_empty() {
            return problem.hint(format!(
                "no equation contains `{name}`: add one, as `{name} = …` or `der({name}) = …`, \
                 or declare it as a parameter or an input"
            ));
        }
        let lines = self.lines(equations.iter().copied());
        let (equations, verb) = match equations.len() {
            1 => ("1 equation".to_owned(), "contains"),
            n => (format!("{n} equations"), "contain"),
        };
        problem.hint(format!(
            "{equations} on {lines} {verb} {} unknowns: {}",
            unknowns.len(),
            self.listed(unknowns.iter().copied())
        ))
    }

    fn surplus(&self, place: usize, missing: Option<usize>) -> Box<Problem> {
        let equation = &self.equations[place];
        let message = format!("one equation too many{}", equation.which_element());
        let problem = Problem::new(equation.span, message).label(self.count());
        let mut hint = self.surplus_hint(place);
        if let Some(missing) = missing {
            let name = &self.unknowns[missing].name;
            hint.push_str(&format!("; variable `{name}` lacks an equation"));
        }
        problem.hint(hint)
    }

    fn surplus_hint(&self, place: usize) -> String {
        if !self.pattern[place].is_empty() {
            let (equations, unknowns) = reached(place, &self.pattern, &self.matching.of_unknown);
            let lines = self.lines(equations.into_iter().filter(|&other| other != place));
            let unknowns = self.listed(unknowns.into_iter());
            return format!("{lines} already determines {unknowns}");
        }
        let name = |node: Node| self.graph.symbol_name(node).unwrap_or_default();
        let sides = [self.equations[place].left, self.equations[place].right];
        if let Some(&input) = sides.iter().find(|side| self.inputs.contains(side)) {
            let name = name(input);
            return format!("`{name}` is an input and must not be defined by an equation");
        }
        let states = || {
            self.unknowns
                .iter()
                .filter_map(|u| Some((u.state?, &u.name)))
        };
        if let Some(&state) = sides.iter().find(|&&side| states().any(|(s, _)| s == side)) {
            let name = name(state);
            return format!("`{name}` is a state, as `der({name})` is used: it follows from that");
        }
        let read = self.graph.symbols_of(&sides);
        let tied = states().filter(|(state, _)| read.contains(state));
        let names: Vec<String> = tied.take(4).map(|(_, name)| format!("`{name}`")).collect();
        let nothing = "it contains nothing that is still to be determined: states follow from \
                       their derivatives, inputs and parameters are given";
        match names.is_empty() {
            true => nothing.to_owned(),
            false => format!(
                "{nothing}. A constraint on the states {} raises the index above 1: replace it \
                 by its derivative with respect to time, or let it determine one of them instead \
                 of a `der`",
                names.join(", ")
            ),
        }
    }
}

fn first_free(partners: &[Option<usize>]) -> Option<usize> {
    partners.iter().position(Option::is_none)
}

/// Both kinds of places on alternating paths: along any edge there, along pairs back.
pub(super) fn reached(
    start: usize,
    edges: &[Vec<usize>],
    back: &[Option<usize>],
) -> (Vec<usize>, Vec<usize>) {
    let mut seen = vec![false; edges.len()];
    let mut seen_there = vec![false; back.len()];
    let (mut here, mut there) = (vec![start], vec![]);
    seen[start] = true;
    let mut next = 0;
    while let Some(&place) = here.get(next) {
        next += 1;
        for &other in &edges[place] {
            if std::mem::replace(&mut seen_there[other], true) {
                continue;
            }
            there.push(other);
            if let Some(partner) = back[other]
                && !std::mem::replace(&mut seen[partner], true)
            {
                here.push(partner);
            }
        }
    }
    here.sort_unstable();
    there.sort_unstable();
    (here, there)
}
