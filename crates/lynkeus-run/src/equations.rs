//! Systems as expressions of a graph.

use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard};

use lynkeus_expr::{Graph, MissingInput, Node};

use crate::events::{Jumps, Surfaces, TimeEvents, extract};

/// x' = f(t, x, w) and y = h(t, x, w), with all that jumps taken out, in a graph of their own.
#[derive(Debug)]
pub(crate) struct Equations {
    pub states: Vec<String>,
    pub signals: Vec<String>,
    pub outputs: Vec<String>,
    pub roots: Roots,
    /// the symbols of time, states, signals, modes and held modes
    pub inputs: Vec<Node>,
    /// what jumps or bends with time alone, of each part of the system
    pub switches: Vec<TimeEvents>,
    /// how many values each of them has, which are the modes
    pub modes: Vec<usize>,
    /// what jumps with the state, of each part in which something does; the values of these
    /// operations are the held modes
    pub held: Vec<Jumps>,
    pub graph: Mutex<Graph>,
}

/// What a system computes.
#[derive(Clone, Debug, Default)]
pub(crate) struct Roots {
    pub derivatives: Vec<Node>,
    pub outputs: Vec<Node>,
    /// the same with what jumps with the state held
    pub held_derivatives: Vec<Node>,
    pub held_outputs: Vec<Node>,
    /// what vanishes on the surfaces on which it jumps
    pub surfaces: Vec<Node>,
    /// what vanishes where x' bends with the state
    pub bends: Vec<Node>,
}

impl Equations {
    /// Copies expressions of `graph` and takes out what jumps. `symbols` are those of time, states
    /// and signals; the names of states, signals and outputs are left open.
    pub fn new(
        graph: &Graph,
        symbols: &[Node],
        derivatives: &[Node],
        outputs: &[Node],
    ) -> Result<Self, MissingInput> {
        let own = Graph::new();
        let roots = [derivatives, outputs].concat();
        let image = own.copied(graph, &[symbols, &roots].concat());
        let moving: Vec<Node> = symbols.iter().map(|s| image[s]).collect();
        let roots: Vec<Node> = roots.iter().map(|r| image[r]).collect();
        let extracted = extract(&own, &moving, &roots, derivatives.len())?;
        let time = extracted.time;
        let mut inputs = [&moving[..], &time.modes].concat();
        let parted = |roots: &[Node]| {
            let (dx, y) = roots.split_at(derivatives.len());
            (dx.to_vec(), y.to_vec())
        };
        let (derivatives, outputs) = parted(&time.roots);
        let mut roots = Roots {
            held_derivatives: derivatives.clone(),
            held_outputs: outputs.clone(),
            derivatives,
            outputs,
            surfaces: extracted.surfaces,
            bends: extracted.bends,
        };
        let mut held = vec![];
        if let Some(taken) = extracted.state {
            inputs.extend(&taken.modes);
            (roots.held_derivatives, roots.held_outputs) = parted(&taken.roots);
            held.push(taken.events);
        }
        Ok(Self {
            states: vec![],
            signals: vec![],
            outputs: vec![],
            roots,
            inputs,
            modes: vec![time.modes.len()],
            switches: vec![time.events],
            held,
            graph: Mutex::new(own),
        })
    }

    /// The graph, for as long as something is made of it.
    pub fn graph(&self) -> MutexGuard<'_, Graph> {
        // a graph only grows: it is whole wherever a thread left it
        self.graph.lock().unwrap_or_else(|e| e.into_inner())
    }

    /// How many values jump with the state.
    pub fn held_modes(&self) -> usize {
        self.inputs.len() - self.smooth_inputs()
    }

    /// How many inputs there are without the held modes.
    pub fn smooth_inputs(&self) -> usize {
        1 + self.states.len() + self.signals.len() + self.modes.iter().sum::<usize>()
    }

    /// The surfaces on which it jumps with the state.
    pub fn surfaces(&self) -> Surfaces {
        let held = self.held.iter();
        Surfaces {
            nodes: self.roots.surfaces.clone(),
            names: held.clone().flat_map(|jumps| jumps.names.clone()).collect(),
            counts: held.flat_map(|jumps| jumps.counts.clone()).collect(),
        }
    }

    /// The same expressions in another graph, `arguments` in the place of the inputs.
    pub fn over(&self, to: &Graph, arguments: &[Node]) -> Roots {
        let own = self.graph();
        let mut images: HashMap<Node, Node> = self
            .inputs
            .iter()
            .copied()
            .zip(arguments.iter().copied())
            .collect();
        for node in own.reachable(&self.roots.all()) {
            if !images.contains_key(&node)
                && let Some(image) = to.rebuilt(&own, node, |argument| images[&argument])
            {
                images.insert(node, image);
            }
        }
        self.roots.map(|node| images[&node])
    }
}

impl Roots {
    fn lists(&self) -> [&Vec<Node>; 6] {
        [
            &self.derivatives,
            &self.outputs,
            &self.held_derivatives,
            &self.held_outputs,
            &self.surfaces,
            &self.bends,
        ]
    }

    fn all(&self) -> Vec<Node> {
        self.lists().into_iter().flatten().copied().collect()
    }

    fn map(&self, image: impl Fn(Node) -> Node) -> Self {
        let [
            derivatives,
            outputs,
            held_derivatives,
            held_outputs,
            surfaces,
            bends,
        ] = self
            .lists()
            .map(|list| list.iter().map(|&node| image(node)).collect());
        Self {
            derivatives,
            outputs,
            held_derivatives,
            held_outputs,
            surfaces,
            bends,
        }
    }
}
