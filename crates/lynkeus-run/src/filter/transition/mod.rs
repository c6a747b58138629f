//! From one sample to the next: the estimate x̂, the state-transition matrix Φ and the covariance W of
//! what the process noise comes to.

mod joint;
mod piecewise;
mod series;
mod straight;

use std::sync::Arc;

use super::belief::Belief;
use super::profile::Profile;
use super::root::{Factor, Reflector, Root, dot};
use crate::Evaluation;
use crate::events::Memory;
use crate::manifold::Manifold;
use crate::snapshot::{Damaged, Persist, Walk};
use crate::{EstimatorSettings, Linearised, Method, Result, Step};
use joint::Joint;
use piecewise::Piecewise;
use series::Transition;
pub(crate) use straight::SQUARES;

/// Up to so many states x̂, Φ and W are integrated together, and wherever steps are given: these are
/// then the steps of all three.
const FEW: usize = 8;

/// A flow under way with Φ' = FΦ and W' = FW + WFᵀ + Q along the estimate, from Φ = I and W = 0 at a
/// sample: the transition, and W = ∫ Φ(T,s) Q Φ(T,s)ᵀ ds, what the process noise comes to at the next sample.
#[derive(Clone, Debug)]
pub(crate) struct Propagation {
    pub driven: Evaluation,
    scheme: Scheme,
    transition: Transition<Profile>,
    /// the transition is that of a way before the last
    is_behind: bool,
    /// the estimate at the end of the last way
    pub end: Vec<f64>,
    /// of W
    factor: Factor,
    /// the states as its factor goes, where they do not stand so
    order: Option<Vec<usize>>,
    /// W in that order
    ordered: Vec<f64>,
    rows: Vec<f64>,
    room: Room,
    /// so many last states are drawn anew in every row
    drawn: usize,
}

/// How Φ and W are found.
#[derive(Clone, Debug)]
enum Scheme {
    Joint(Box<Joint>),
    Piecewise(Box<Piecewise>),
}

impl Propagation {
    /// Of a flow with F, and the densities of the noise on its states.
    pub fn new(flow: &Linearised, process_noise: &[f64], run: EstimatorSettings) -> Result<Self> {
        let method = run.method;
        let n = flow.system().states().len();
        let is_given = matches!(method, Method::Rk4(Step::AtMost(_) | Step::Substeps(_)));
        // Φ jumps with the state
        let has_clauses = flow.system().has_clauses();
        let scheme = match n <= FEW || is_given || has_clauses {
            true => Scheme::Joint(Box::new(Joint::new(flow, process_noise, method)?)),
            false => Scheme::Piecewise(Box::new(Piecewise::new(flow, process_noise, method)?)),
        };
        // the others are as exact as is asked for
        let has_steps = matches!((&scheme, method), (Scheme::Joint(_), Method::Rk4(_)));
        let order = has_steps.then(|| flow.order_of(process_noise));
        Ok(Self {
            driven: flow.system().driven(run.between),
            scheme,
            transition: Transition::start(n, process_noise.iter().any(|q| *q > 0.0)),
            is_behind: false,
            end: vec![],
            factor: Factor::default(),
            order: order.flatten(),
            ordered: vec![],
            rows: vec![],
            room: Room::default(),
            drawn: 0,
        })
    }

    /// The same with so many last states that are drawn anew in every row: [`Propagation::stage`] goes to one.
    pub fn drawing(mut self, count: usize) -> Self {
        self.drawn = count;
        self
    }

    /// The way to the next sample from the belief's estimate, which stays.
    pub fn advance(&mut self, belief: &Belief, from: f64, to: f64) -> Result<()> {
        self.is_behind = false;
        let (driven, x) = (&mut self.driven, &mut self.end);
        x.clone_from(&belief.x);
        match &mut self.scheme {
            Scheme::Joint(joint) => {
                joint.advance(driven, &belief.root, from, to, x, &mut self.transition)?;
            }
            Scheme::Piecewise(variation) => {
                self.transition = variation.advance(driven, belief, from, to, x)?;
            }
        }
        Ok(())
    }

    /// x̂⁻ and P⁻ = ΦPΦᵀ + W at the next sample. A flow that fails leaves the belief as it was.
    pub fn predict(&mut self, belief: &mut Belief, from: f64, to: f64) -> Result<()> {
        self.is_behind = match &mut self.scheme {
            Scheme::Joint(joint) => joint.leap(&mut self.driven, belief, from, to),
            Scheme::Piecewise(_) => false,
        };
        if !self.is_behind {
            self.advance(belief, from, to)?;
            belief.x.clone_from(&self.end);
        }
        let is_carried = match &mut self.scheme {
            Scheme::Joint(joint) => joint.take(&mut belief.root),
            Scheme::Piecewise(_) => false,
        };
        if !is_carried {
            self.carry(&mut belief.root);
        }
        Ok(())
    }

    /// ΦPΦᵀ + W over the last way.
    pub fn carry(&mut self, root: &mut Root) {
        self.catch_up();
        let mut rows = std::mem::take(&mut self.rows);
        rows.clear();
        self.push_root(&mut rows);
        carry(&self.transition.matrix, root, &mut rows, &mut self.room);
        self.rows = rows;
    }

    /// The way from a state, without carrying a belief along it; the root chooses units where there
    /// are many states.
    pub fn stage(&mut self, about: Belief, from: f64, to: f64) -> Result<Stage> {
        self.advance(&about, from, to)?;
        let mut noise = vec![];
        self.push_root(&mut noise);
        let (mut end, mut transition) = (self.end.clone(), self.transition.matrix.clone());
        if self.drawn > 0 {
            let n = end.len();
            let first = n - self.drawn;
            end[first..].fill(0.0);
            transition.clear_last(self.drawn);
            noise.resize(n * n, 0.0);
            (first..n).for_each(|i| noise[i * n + i] = 1.0);
        }
        Ok(Stage {
            about: about.x,
            end,
            transition: Arc::new(transition),
            noise,
        })
    }

    /// Φ of the last way.
    pub fn transition(&mut self) -> &Profile {
        self.catch_up();
        &self.transition.matrix
    }

    fn catch_up(&mut self) {
        if let (true, Scheme::Joint(joint)) = (self.is_behind, &self.scheme) {
            joint.write_last(&mut self.transition);
            self.is_behind = false;
        }
    }

    /// What is remembered of clauses.
    pub fn memory(&mut self) -> Option<&mut Memory> {
        match &mut self.scheme {
            Scheme::Joint(joint) => Some(joint.integrator.memory()),
            Scheme::Piecewise(_) => None,
        }
    }

    /// Whether noise moves the states.
    pub fn is_noisy(&self) -> bool {
        self.transition.noise.is_some()
    }

    /// Adds rows whose sum of squares is W.
    pub fn push_root(&mut self, rows: &mut Vec<f64>) {
        let Some(noise) = &self.transition.noise else {
            return;
        };
        let n = self.transition.matrix.size();
        let mut entries = noise.entries();
        if let Some(order) = &self.order {
            let pairs = order.iter().flat_map(|i| order.iter().map(move |j| (i, j)));
            self.ordered.clear();
            self.ordered.extend(pairs.map(|(i, j)| entries[i * n + j]));
            entries = &self.ordered;
        }
        let lower = self.factor.of(entries, n);
        let first = rows.len();
        rows.resize(first + n * n, 0.0);
        let rows = &mut rows[first..];
        for (i, row) in lower.chunks_exact(n).enumerate() {
            let place = self.order.as_ref().map_or(i, |order| order[i]);
            for (k, entry) in row[..=i].iter().enumerate() {
                rows[k * n + place] = *entry;
            }
        }
    }
}

impl Persist for Propagation {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        self.driven.walk(walk)?;
        match &mut self.scheme {
            Scheme::Joint(joint) => {
                joint.integrator.walk(walk)?;
                match self.driven.system().has_clauses() {
                    true => joint.integrator.memory().walk(walk),
                    false => Ok(()),
                }
            }
            Scheme::Piecewise(variation) => variation.walk(walk),
        }
    }
}

/// x⁻ = φ(x̃) + Φ(x − x̃) and P⁻ = ΦPΦᵀ + W about a state x̃.
#[derive(Clone, Debug, Default)]
pub(crate) struct Stage {
    /// x̃
    about: Vec<f64>,
    /// φ(x̃)
    end: Vec<f64>,
    pub transition: Arc<Profile>,
    /// rows whose sum of squares is W; none where nothing disturbs the states
    noise: Vec<f64>,
}

impl Stage {
    /// Of so many states.
    pub fn walk(&mut self, walk: &mut Walk<'_>, states: usize) -> Result<(), Damaged> {
        for vector in [&mut self.about, &mut self.end] {
            vector.resize(states, 0.0);
            walk.numbers(vector)?;
        }
        Arc::make_mut(&mut self.transition).walk(walk, states)?;
        let mut is_disturbed = !self.noise.is_empty();
        walk.flag(&mut is_disturbed)?;
        let count = if is_disturbed { states * states } else { 0 };
        self.noise.resize(count, 0.0);
        walk.numbers(&mut self.noise)
    }

    /// No way at all.
    pub fn none(x: &[f64]) -> Self {
        Self {
            about: x.to_vec(),
            end: x.to_vec(),
            transition: Arc::new(Profile::identity(x.len())),
            noise: vec![],
        }
    }

    /// The same with the next sample's quaternions told in the plane that touches at `to`. What came with the state
    /// keeps its axes in the world, as it turns before what noise adds does; that comes from the right.
    pub fn told_at(mut self, manifold: &Manifold, to: &[f64]) -> Self {
        let n = to.len();
        manifold.normalise(&mut self.end);
        let from = self.end.clone();
        let entries = Arc::make_mut(&mut self.transition).entries_mut();
        manifold.project(&from, entries, n);
        manifold.transport_in_world(&from, to, entries, n);
        for row in self.noise.chunks_exact_mut(n.max(1)) {
            manifold.project(&from, row, 1);
            manifold.recharted(&from, to, row, 1);
        }
        manifold.flatten(to, &mut self.end);
        self
    }

    /// What is believed at the next sample.
    pub fn carry(&self, after: &Belief) -> Belief {
        let pairs = after.x.iter().zip(&self.about);
        let off: Vec<f64> = pairs.map(|(x, a)| x - a).collect();
        let moved = self.end.iter().zip(self.transition.rows());
        let x = moved.map(|(x, (first, row))| x + dot(row, &off[first..]));
        let (mut root, mut rows) = (after.root.clone(), self.noise.clone());
        carry(&self.transition, &mut root, &mut rows, &mut Room::default());
        Belief {
            x: x.collect(),
            root,
        }
    }
}

/// Room to carry a root in.
#[derive(Clone, Debug, Default)]
struct Room {
    sums: Vec<f64>,
    reflector: Reflector,
}

/// ΦPΦᵀ + W, where `rows` are those of W: they come first, since their zeros are spared in the
/// reflections.
fn carry(transition: &Profile, root: &mut Root, rows: &mut Vec<f64>, room: &mut Room) {
    let Room { sums, reflector } = room;
    sums.resize(root.n, 0.0);
    let n = root.n;
    let begin = rows.len();
    rows.resize(begin + n * n, 0.0);
    for (i, (first, row)) in transition.rows().enumerate() {
        sums.fill(0.0);
        let entries = (first..).zip(row);
        for (j, phi) in entries.filter(|(_, phi)| **phi != 0.0) {
            for (sum, s) in sums.iter_mut().zip(&root.row(j)[..=j]) {
                *sum += phi * s;
            }
        }
        let column = rows[begin + i..].iter_mut().step_by(n);
        column.zip(&*sums).for_each(|(into, sum)| *into = *sum);
    }
    root.of_rows(rows, reflector);
}

#[cfg(test)]
mod tests {
    use lynkeus_expr::Graph;

    use super::*;

    /// x' = v, v' = a, a' = w over a step of length h. By hand W_aa = qh, W_va = qh²/2, W_vv = qh³/3, W_xa = qh³/6,
    /// W_xv = qh⁴/8 and W_xx = qh⁵/20. A step of Runge and Kutta tells all of them but W_xx, of which it says 0; the
    /// factor from a on has (1/36 + 1/48) qh⁵ there, which the others ask for.
    #[test]
    fn what_a_step_leaves_of_a_chain_is_of_order_five() {
        let g = Graph::new();
        let [time, x, v, a] = ["time", "x", "v", "a"].map(|name| g.symbol(name));
        let zero = g.constant(0.0);
        let states = [x, v, a].map(|x| (format!("{x:?}"), x.node(), 0.0));
        let derivatives = [v, a, zero].map(|x| x.node());
        let flow = Linearised::flow(
            &g,
            time.node(),
            &states,
            &[],
            &derivatives,
            &Default::default(),
        )
        .unwrap();
        let (h, q) = (0.15, 3.0);
        let run = EstimatorSettings {
            method: Method::Rk4(Step::Substeps(1)),
            ..EstimatorSettings::default()
        };
        let mut propagation = Propagation::new(&flow, &[0.0, 0.0, q], run).unwrap();
        let mut belief = Belief::new(&[0.0; 3], &[0.0; 3]);
        propagation.driven.start(&[]);
        propagation.predict(&mut belief, 0.0, h).unwrap();
        let expected = [
            7.0 / 144.0 * h.powi(5),
            h.powi(4) / 8.0,
            h.powi(3) / 6.0,
            h.powi(3) / 3.0,
            h.powi(2) / 2.0,
            h,
        ];
        let pairs = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
        for ((i, j), expected) in pairs.into_iter().zip(expected) {
            let found = dot(belief.root.row(i), belief.root.row(j));
            let off = (found / (q * expected) - 1.0).abs();
            assert!(off < 1e-13, "W{i}{j}: {found} beside {}", q * expected);
        }
    }
}
