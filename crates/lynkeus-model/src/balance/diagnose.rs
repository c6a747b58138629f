//! Which equation is missing, and which is one too many.

use lynkeus_expr::Node;

use super::matching::Matching;
use super::system::{FlatEquation, Incidence, System, Unknown, lines, listed};
use crate::diagnostic::{Problem, Result, Span};

/// A system with a maximum matching, which shows what is wrong with its balance.
pub(super) struct Balance<'a> {
    pub system: &'a System<'a>,
    pub incidence: &'a Incidence,
    pub matching: &'a Matching,
    pub source: &'a str,
}

impl Balance<'_> {
    pub(super) fn check(&self, model: Span) -> Result<()> {
        let System {
            equations,
            unknowns,
            inputs,
            ..
        } = self.system;
        if !unknowns.iter().any(|unknown| unknown.state.is_some()) {
            return Err(
                Problem::new(model, "the model has no state: nothing stands under `der`")
                    .hint("a plant has at least one equation `der(x) = …`"),
            );
        }
        let surplus = first_free(&self.matching.of_equation);
        let missing = first_free(&self.matching.of_unknown);
        let lacking = missing.and_then(|place| Some((place, unknowns.get(place)?)));
        if let Some(place) = surplus
            && let Some(equation) = equations.get(place)
        {
            return Err(self.surplus(place, equation, lacking, inputs));
        }
        match lacking {
            Some((place, unknown)) => Err(self.missing(place, unknown)),
            None => Ok(()),
        }
    }

    fn count(&self) -> String {
        let (equations, unknowns) = (self.system.equations.len(), self.system.unknowns.len());
        let plural = |n: usize| if n == 1 { "" } else { "s" };
        let (e, u) = (plural(equations), plural(unknowns));
        format!("{equations} equation{e} for {unknowns} unknown{u}")
    }

    /// The unknowns and equations that share the lack, by alternating paths.
    fn missing(&self, place: usize, unknown: &Unknown) -> Box<Problem> {
        let (unknowns, equations) = self.reached_from_unknown(place);
        let name = &unknown.name;
        let message = format!("variable `{name}` lacks an equation");
        let problem = Problem::new(unknown.span, message).label(self.count());
        if equations.is_empty() {
            return problem.hint(format!(
                "no equation contains `{name}`: add one, as `{name} = …` or `der({name}) = …`, \
                 or declare it as a parameter or an input"
            ));
        }
        let spans = equations
            .iter()
            .filter_map(|&e| Some(self.system.equations.get(e)?.span));
        let lines = lines(self.source, spans);
        let (equations, verb) = match equations.len() {
            1 => ("1 equation".to_owned(), "contains"),
            n => (format!("{n} equations"), "contain"),
        };
        problem.hint(format!(
            "{equations} on {lines} {verb} {} unknowns: {}",
            unknowns.len(),
            self.listed(&unknowns)
        ))
    }

    fn surplus(
        &self,
        place: usize,
        equation: &FlatEquation,
        lacking: Option<(usize, &Unknown)>,
        inputs: &[Node],
    ) -> Box<Problem> {
        let message = format!("one equation too many{}", equation.which_element());
        let problem = Problem::new(equation.span, message).label(self.count());
        let mut hint = self.surplus_hint(place, equation, inputs);
        if let Some((_, unknown)) = lacking {
            hint.push_str(&format!("; variable `{}` lacks an equation", unknown.name));
        }
        problem.hint(hint)
    }

    fn surplus_hint(&self, place: usize, equation: &FlatEquation, inputs: &[Node]) -> String {
        let graph = self.system.graph;
        let name = |node: Node| graph.symbol_name(node).unwrap_or_default();
        let contained = self
            .incidence
            .of_equation
            .get(place)
            .map_or(&[][..], Vec::as_slice);
        if !contained.is_empty() {
            let (unknowns, equations) = self.reached_from_equation(place);
            let others = equations.iter().filter(|&&other| other != place);
            let spans = others.filter_map(|&e| Some(self.system.equations.get(e)?.span));
            let lines = lines(self.source, spans);
            return format!("{lines} already determines {}", self.listed(&unknowns));
        }
        let sides = [equation.left, equation.right];
        if let Some(&input) = sides.iter().find(|side| inputs.contains(side)) {
            let name = name(input);
            return format!("`{name}` is an input and must not be defined by an equation");
        }
        let is_state = |side: &&Node| {
            self.system
                .unknowns
                .iter()
                .any(|unknown| unknown.state == Some(**side))
        };
        if let Some(&state) = sides.iter().find(is_state) {
            let name = name(state);
            return format!("`{name}` is a state, as `der({name})` is used: it follows from that");
        }
        let tied = graph.symbols_of(&sides);
        let tied = self.system.unknowns.iter().filter(|unknown| {
            let state = unknown.state.as_ref();
            state.is_some_and(|state| tied.contains(state))
        });
        let names: Vec<String> = tied.take(4).map(|u| format!("`{}`", u.name)).collect();
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

    fn listed(&self, unknowns: &[usize]) -> String {
        let unknowns = unknowns.iter();
        listed(unknowns.filter_map(|&place| self.system.unknowns.get(place)))
    }

    fn reached_from_unknown(&self, start: usize) -> (Vec<usize>, Vec<usize>) {
        let mut of_unknown = vec![vec![]; self.system.unknowns.len()];
        for (equation, unknowns) in self.incidence.of_equation.iter().enumerate() {
            for &unknown in unknowns {
                of_unknown[unknown].push(equation);
            }
        }
        reached(start, &of_unknown, &self.matching.of_equation)
    }

    fn reached_from_equation(&self, start: usize) -> (Vec<usize>, Vec<usize>) {
        let edges = &self.incidence.of_equation;
        let (equations, unknowns) = reached(start, edges, &self.matching.of_unknown);
        (unknowns, equations)
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
