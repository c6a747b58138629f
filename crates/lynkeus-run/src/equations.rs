//! Systems as expressions of a graph.

use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard};

use lynkeus_expr::{Graph, MissingInput, Node};
use lynkeus_model::Whens;

use crate::events::{
    Jump, Surface, TimeEvents, WhenRoots, bends, by_the_clock, state_events, time_events,
};

/// x' = f(t, x, w) and y = h(t, x, w), with all that jumps taken out, in a graph of their own.
#[derive(Debug)]
pub(crate) struct Equations {
    pub states: Vec<String>,
    pub signals: Vec<String>,
    pub outputs: Vec<String>,
    pub roots: Roots,
    /// the symbols of time, states, signals, modes and held modes
    pub inputs: Vec<Node>,
    /// what jumps or bends with time alone, of each part of the system; its values are the modes
    pub switches: Vec<TimeEvents>,
    /// what jumps with the state; its values are the held modes
    pub jumps: Vec<Jump>,
    pub graph: Mutex<Graph>,
}

/// x' and y: as expressions, as code, or at work.
#[derive(Clone, Debug, Default)]
pub(crate) struct Both<T> {
    pub derivatives: T,
    pub outputs: T,
}

/// What a system computes.
#[derive(Clone, Debug, Default)]
pub(crate) struct Roots {
    /// with what jumps with the state as the state says
    pub free: Both<Vec<Node>>,
    /// with what jumps with the state held
    pub held: Both<Vec<Node>>,
    /// on which it jumps with the state
    pub surfaces: Vec<Surface>,
    /// what vanishes where x' bends with the state
    pub bends: Vec<Node>,
    /// the clauses by which the state jumps
    pub whens: Option<WhenRoots>,
}

impl Equations {
    /// Copies expressions of `graph` and takes out what jumps. `symbols` are those of time, states
    /// and signals; the names of states, signals and outputs are left open.
    pub fn new(
        graph: &Graph,
        symbols: &[Node],
        derivatives: &[Node],
        outputs: &[Node],
        whens: &Whens,
    ) -> Result<Self, MissingInput> {
        let own = Graph::new();
        let (whens, compared) = by_the_clock(graph, symbols[0], whens);
        let read = WhenRoots::read(&whens);
        let clauses = &read[..WhenRoots::count(&whens)];
        let roots = [derivatives, outputs, clauses].concat();
        let image = own.copied(graph, &[symbols, &roots, &read].concat());
        let moving: Vec<Node> = symbols.iter().map(|s| image[s]).collect();
        let mut roots: Vec<Node> = roots.iter().map(|r| image[r]).collect();
        let count = derivatives.len();
        let all = roots.len() - clauses.len();
        let both = |roots: &[Node]| Both {
            derivatives: roots[..count].to_vec(),
            outputs: roots[count..].to_vec(),
        };
        let hidden: HashMap<Node, Node> = (compared.iter())
            .map(|node| (image[node], own.fresh("compared").node()))
            .collect();
        let clauses = own.substitute(&roots.split_off(all), &hidden);
        roots.extend(clauses);
        let (modes, switches) = time_events(&own, moving[0], &mut roots)?;
        let shown = hidden.into_iter().map(|(node, symbol)| (symbol, node));
        let clauses = own.substitute(&roots.split_off(all), &shown.collect());
        let whens = (!whens.is_empty()).then(|| {
            let (states, rates) = (&symbols[1..=count], &roots[..count]);
            WhenRoots::new(&own, &whens, states, &moving, rates, &clauses, &image)
        });
        let free = both(&roots);
        let (held_modes, jumps, mut surfaces) = state_events(&own, &moving, &mut roots, count);
        surfaces.extend(whens.iter().flat_map(|whens| whens.surfaces(&own)));
        Ok(Self {
            states: vec![],
            signals: vec![],
            outputs: vec![],
            roots: Roots {
                free,
                held: both(&roots),
                surfaces,
                bends: bends(&own, &moving[1..], &roots[..count]),
                whens,
            },
            inputs: [moving, modes, held_modes].concat(),
            switches: vec![switches],
            jumps,
            graph: Mutex::new(own),
        })
    }

    /// The graph, for as long as something is made of it.
    pub fn graph(&self) -> MutexGuard<'_, Graph> {
        // a graph only grows: it is whole wherever a thread left it
        self.graph.lock().unwrap_or_else(|e| e.into_inner())
    }

    /// How many values jump with time alone.
    pub fn modes(&self) -> usize {
        self.switches.iter().map(TimeEvents::modes).sum()
    }

    /// How many inputs there are without the held modes.
    pub fn smooth_inputs(&self) -> usize {
        self.inputs.len() - self.jumps.len()
    }

    /// The same expressions in another graph, `arguments` in the place of the inputs.
    pub fn over(&self, to: &Graph, arguments: &[Node]) -> Roots {
        let own = self.graph();
        let mut roots = self.roots.clone();
        let aside = roots.whens.iter_mut().flat_map(|whens| &mut whens.aside);
        let mut beside: HashMap<Node, Node> = HashMap::new();
        for symbol in aside {
            let image = to.fresh("before").node();
            beside.insert(std::mem::replace(symbol, image), image);
        }
        let mut places: Vec<&mut Node> = roots.nodes().collect();
        let places_of = self.inputs.iter().copied();
        let mut images: HashMap<Node, Node> = places_of.zip(arguments.iter().copied()).collect();
        images.extend(beside);
        for node in own.reachable(&places.iter().map(|node| **node).collect::<Vec<_>>()) {
            if !images.contains_key(&node)
                && let Some(image) = to.rebuilt(&own, node, |argument| images[&argument])
            {
                images.insert(node, image);
            }
        }
        for node in &mut places {
            **node = images[&**node];
        }
        roots
    }
}

impl Roots {
    fn nodes(&mut self) -> impl Iterator<Item = &mut Node> {
        let surfaces = self.surfaces.iter_mut().map(|surface| &mut surface.node);
        let both = [&mut self.free, &mut self.held].into_iter();
        let lists = both.flat_map(|both| [&mut both.derivatives, &mut both.outputs]);
        let clauses = self.whens.iter_mut().flat_map(|whens| &mut whens.nodes);
        let lists = lists.chain([&mut self.bends]).flatten();
        lists.chain(surfaces).chain(clauses)
    }
}
