//! Events at which a flow's state jumps, in the draft: the clauses, and what is remembered of them.

use lynkeus_run::{Method, System, WhenExpressions};

use super::device::Entry;
use super::draft::{Arguments, Target, draft, places, times};
use super::machine::{Machine, code, step_length};
use super::pass::holds;
use super::syntax::Type;
use super::template::chosen;
use crate::Refusal;
use crate::code::{Code, Solver};

const EVENTS: &str = include_str!("runtime/events.c");

impl Machine {
    /// The clauses of a flow, and what is remembered of them; nothing where its state never jumps.
    pub fn events(
        &mut self,
        flow: &System,
        arguments: &Arguments,
        method: Method,
    ) -> Result<(), Refusal> {
        let Some(whens) = flow.whens() else {
            return Ok(());
        };
        let states = flow.states();
        self.memory(&whens, states.len());
        self.tables_of_clauses(&whens);
        self.clauses(flow, &whens, arguments)?;
        let text = chosen(EVENTS, &holds(flow));
        self.add(&text.replace("STEP_LENGTH", &step_length(method)?));
        Ok(())
    }

    fn memory(&mut self, whens: &WhenExpressions<'_>, states: usize) {
        let (relations, conditions) = (whens.relations.len(), whens.conditions.len());
        let (clauses, timers) = (whens.clauses.len(), whens.timers.len());
        self.size("CLAUSES", clauses);
        self.size("CHANGES", whens.values.len());
        self.size("CONDITIONS", conditions);
        self.size("CONDITIONS_ROOM", conditions.max(1));
        self.size("RELATIONS", relations);
        self.size("RELATIONS_ROOM", relations.max(1));
        self.size("TIMERS", timers);
        let inputs = whens.inputs.len() - 1 - states;
        self.size("VIEW", inputs);
        let (mut size, mut allowed) = (0, 0);
        for (name, count) in [
            ("STARTED", 1),
            ("ENDLESS", 1),
            ("HAS_LAST", 1),
            ("SUSPECT", 1),
            ("NEWEST", 1),
            ("AT_ONCE", 1),
            ("HAPPENED", 1),
            ("ALLOWED", 1),
            ("TRUTHS", conditions),
            ("NEXT", timers),
            ("LAST", states),
            ("FROM", 1),
            ("UNTIL", 1),
            ("LEFT", relations),
            ("HURRY", 4 * clauses),
        ] {
            if name == "ALLOWED" {
                allowed = size;
            }
            self.size(name, size);
            size += count;
        }
        self.size("MEMORY", size);
        let about = "what is remembered of events: conditions that hold, the next instants of timers, \
                     the state behind the last interval, how soon clauses took effect";
        let mut start = vec![0.0; size];
        // as many events as come
        start[allowed] = -1.0;
        self.field("memory", Type::Double, about, start);
    }

    fn tables_of_clauses(&mut self, whens: &WhenExpressions<'_>) {
        let ends = |count: fn(&lynkeus_run::ClauseShape) -> usize| {
            let mut end = 0;
            let each = whens.clauses.iter().map(move |clause| {
                end += count(clause);
                end
            });
            std::iter::once(0).chain(each)
        };
        let clauses = || whens.clauses.iter().enumerate();
        let owners = clauses().flat_map(|(k, c)| std::iter::repeat_n(k, c.conditions));
        let changed = clauses().flat_map(|(_, c)| c.changes.iter().copied());
        let relations = whens.relations.len();
        let needs = whens.needs.iter().flat_map(|needs| {
            let is_needed = |r| usize::from(needs.contains(&r));
            (0..relations).map(is_needed).collect::<Vec<_>>()
        });
        self.tables += &places("first_conditions", ends(|c| c.conditions));
        self.tables += &places("first_changes", ends(|c| c.changes.len()));
        self.tables += &places("groups", whens.clauses.iter().map(|c| c.group));
        self.tables += &places("clause_of", owners);
        self.tables += &places("changed", changed);
        self.tables += &places("needs", needs);
        let timers = || whens.timers.iter();
        if timers().next().is_some() {
            let initial = timers().map(|timer| usize::from(timer.is_initial));
            self.tables += &places("timer_is_initial", initial);
            self.tables += &times("timer_firsts", timers().map(|timer| timer.first));
            // that of the start has no next one
            let steps = timers().map(|timer| if timer.is_initial { 0.0 } else { timer.step });
            self.tables += &times("timer_steps", steps);
            self.tables += &times("timer_scales", timers().map(|timer| timer.scale));
        }
    }

    /// The functions that clauses are made of.
    fn clauses(
        &mut self,
        flow: &System,
        whens: &WhenExpressions<'_>,
        arguments: &Arguments,
    ) -> Result<(), Refusal> {
        let own = flow.expressions();
        let n = flow.states().len();
        let before = flow.states().iter().map(|name| format!("pre {name}"));
        let timers = (1..=whens.timers.len()).map(|k| format!("timer {k}"));
        let view = Arguments {
            x: arguments.x.clone(),
            w: arguments
                .w
                .iter()
                .cloned()
                .chain(before.chain(timers).map(Entry::named))
                .collect(),
        };
        let seen = |parts: &[&[lynkeus_expr::Node]]| {
            Code::of(&own.graph, &whens.inputs, parts, Solver::Conditioned)
        };
        let nodes = |entries: &[(usize, usize, lynkeus_expr::Node)]| {
            entries.iter().map(|entry| entry.2).collect::<Vec<_>>()
        };
        let at = |entries: &[(usize, usize, lynkeus_expr::Node)], width: usize| {
            let places = entries.iter().map(|entry| entry.0 * width + entry.1);
            places.collect::<Vec<usize>>()
        };
        let texts = [
            draft(
                "Which conditions of clauses hold; w has the states before, and timers, too.",
                "conditions",
                &seen(&[whens.conditions])?,
                &view,
                &[Target::all("truths", whens.conditions.len())],
            )?,
            draft(
                "What clauses give.",
                "new_values",
                &seen(&[whens.values])?,
                &view,
                &[Target::all("values", whens.values.len())],
            )?,
            draft(
                "Its derivatives by the states, the states before, and time, row by row.",
                "value_slopes",
                &seen(&[&nodes(&whens.slopes)])?,
                &view,
                &[Target {
                    name: "c",
                    places: at(&whens.slopes, 2 * n + 1),
                }],
            )?,
            draft(
                "Which relations of conditions hold, and what vanishes where they change.",
                "relations",
                &code(&own, &[whens.relations, whens.quantities])?,
                arguments,
                &[
                    Target::all("holds", whens.relations.len()),
                    Target::all("quantities", whens.quantities.len()),
                ],
            )?,
            draft(
                "The derivatives of the latter by the states and time, row by row.",
                "gradient",
                &code(&own, &[&nodes(&whens.gradient)])?,
                arguments,
                &[Target {
                    name: "c",
                    places: at(&whens.gradient, n + 1),
                }],
            )?,
        ];
        texts.iter().for_each(|text| self.add(text));
        Ok(())
    }
}
