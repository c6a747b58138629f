//! Decay for every pair of solutions in the box, by intervals.

use lynkeus_expr::{Budget, Interval, MissingInput, Node, components, jacobian};
use lynkeus_proof::decay::{ErrorModel, Sector, fastest};
use lynkeus_proof::matrix::sum;
use lynkeus_proof::spectrum;
use nalgebra::DMatrix;

use crate::detectability::hidden::{Detectability, Hidden, Observability};
use crate::{Verdict, range_within};

/// States that are hidden together, beyond which no proof is tried.
const STATES: usize = 24;
/// States that are coupled, beyond which no proof is tried.
const COUPLED: usize = 8;
/// Of several blocks in a row any rate below the least is proved; this share of it is given.
const BELOW: f64 = 0.99;

/// Per augmented state what is proved, if anything is.
pub(super) fn hidden_errors(
    hidden: &Hidden<'_, '_>,
) -> Result<Vec<Option<Detectability>>, MissingInput> {
    let augmented = hidden.augmented;
    let mut found = vec![None; hidden.observability.len()];
    let (states, inputs) = hidden.free();
    let region = augmented.region();
    if states.is_empty()
        || states.len() > STATES
        || augmented.regularity(&region)?.verdict != Verdict::Proved
    {
        return Ok(found);
    }
    let system = enclosed(hidden)?.reduced();
    let rates = system.rates();
    let decays = |rate: f64| Detectability::Decays {
        rate,
        is_proved: true,
    };
    let of_row = |row: &Row| {
        let finite = row.a.iter().all(|x| x.is_bounded());
        let read = (0..row.a.len()).filter(|&s| !row.a[s].is_zero());
        let rate = read.map(|s| rates[s]).collect::<Option<Vec<f64>>>()?;
        let rate = rate.into_iter().fold(f64::INFINITY, f64::min);
        (finite && rate.is_finite() && row.is_free_of_inputs()).then(|| decays(rate))
    };
    for (s, &place) in states.iter().enumerate() {
        let own = rates[s].map(decays);
        found[place] = own.or_else(|| system.bounded(s, &rates));
    }
    for (s, row) in &system.followers {
        found[states[*s]] = of_row(row);
    }
    for (row, &place) in system.inputs.iter().zip(&inputs) {
        found[place] = row.as_ref().and_then(of_row);
    }
    Ok(found)
}

/// What is left of the differences: blocks of coupled states, one driving the next.
impl System {
    fn row(&self, s: usize) -> Option<&Row> {
        self.flow[s].as_ref()
    }

    fn reads(&self, s: usize, q: usize) -> bool {
        self.row(s).is_some_and(|row| !row.a[q].is_zero())
    }

    /// The rate at which each state's difference is proved to decay.
    fn rates(&self) -> Vec<Option<f64>> {
        let n = self.flow.len();
        let reads = |s: usize| (0..n).filter(|&q| self.reads(s, q)).collect();
        let reads: Vec<Vec<usize>> = (0..n).map(reads).collect();
        let mut rates = vec![None; n];
        // of everything that acts on a state, itself included
        let mut least = vec![None; n];
        for block in components(&reads) {
            let own = self.of_block(&block);
            let sources = || block.iter().flat_map(|&s| &reads[s]);
            let mut others = sources().filter(|q| !block.contains(q)).peekable();
            let is_alone = others.peek().is_none();
            let all = others.fold(own, |all, &q| Some(all?.min(least[q]?)));
            for &s in &block {
                least[s] = all;
                rates[s] = all.map(|rate: f64| if is_alone { rate } else { BELOW * rate });
            }
        }
        rates
    }

    /// The rate of coupled states that nothing drives; none where an unknown input does, or
    /// something follows from others.
    fn of_block(&self, states: &[usize]) -> Option<f64> {
        let rows: Vec<&Row> = states.iter().map(|&s| self.row(s)).collect::<Option<_>>()?;
        match rows.iter().all(|row| row.is_free_of_inputs()) {
            true => self.decay(states, &rows),
            false => None,
        }
    }

    fn decay(&self, states: &[usize], rows: &[&Row]) -> Option<f64> {
        let entry = |i: usize, j: usize| rows[i].a[states[j]];
        let n = states.len();
        // what comes from outside of the block has to be bounded as well
        let mut read = rows.iter().flat_map(|row| &row.a);
        if n > COUPLED || !read.all(|x| x.is_bounded()) {
            return None;
        }
        if let [_] = states {
            let rate = -entry(0, 0).hi();
            return (rate > 0.0).then_some(rate);
        }
        let middle = DMatrix::from_fn(n, n, |i, j| entry(i, j).midpoint());
        let slowest = spectrum::abscissa(middle)?;
        let model = model(n, &entry);
        let width = |&s: &usize| {
            Some(self.scales[s])
                .filter(|w| w.is_finite() && *w > 0.0)
                .unwrap_or(1.0)
        };
        let scales: Vec<f64> = states.iter().map(width).collect();
        let proof = fastest(&[model], &scales, -slowest.min(0.0), &self.budget)?;
        (proof.rate > 0.0).then_some(proof.rate)
    }

    /// |δη| ≤ Σ |B|·width/rate in the end, for one state that unknown inputs drive.
    fn bounded(&self, s: usize, rates: &[Option<f64>]) -> Option<Detectability> {
        let row = self.row(s)?;
        let rate = self.decay(&[s], &[row])?;
        let others = (0..row.a.len()).filter(|&q| q != s && self.reads(s, q));
        let mut others = others.map(|q| rates[q]);
        if others.any(|rate| rate.is_none()) {
            return None;
        }
        let terms = row.b.iter().zip(&self.reach).filter(|(b, _)| !b.is_zero());
        let terms =
            terms.map(|(b, width)| Interval::point(b.magnitude()) * Interval::point(*width));
        let sum = sum(terms);
        let bound = (sum / Interval::point(rate)).hi();
        // the range itself is a bound
        let tells = bound < self.scales[s] && sum.is_defined();
        tells.then_some(Detectability::Bounded {
            bound,
            is_kept: false,
        })
    }
}

/// A constant part, and a sector for every entry that varies.
fn model(n: usize, entry: &dyn Fn(usize, usize) -> Interval) -> ErrorModel {
    let mut constant = vec![vec![Interval::ZERO; n]; n];
    let mut sectors = vec![];
    for (i, row) in constant.iter_mut().enumerate() {
        for (j, place) in row.iter_mut().enumerate() {
            let range = entry(i, j);
            if range.is_point() {
                *place = range;
                continue;
            }
            let mut direction = vec![Interval::ZERO; n];
            direction[i] = Interval::ONE;
            sectors.push(Sector {
                column: j,
                direction,
                range,
            });
        }
    }
    ErrorModel { constant, sectors }
}

/// Cells examined per end of the range of an entry.
const CELLS: usize = 400;

/// Encloses the differences of any two solutions in the box: slopes averaged along the line
/// between two points lie in the range of the slopes.
fn enclosed(hidden: &Hidden<'_, '_>) -> Result<System, MissingInput> {
    let augmented = hidden.augmented;
    let region = augmented.region();
    let (states, inputs) = hidden.free();
    let equation = |&i: &usize| augmented.derivatives[i];
    let determined = (0..hidden.observability.len())
        .filter(|&i| hidden.observability[i] == Observability::Determined && !hidden.is_signal(i));
    let determined: Vec<usize> = determined.collect();
    let equations = states.iter().chain(&determined).map(equation);
    let functions: Vec<Node> = equations.chain(augmented.output_nodes()).collect();
    let symbol = |&i: &usize| augmented.states[i].node;
    let symbols: Vec<Node> = states.iter().chain(&inputs).map(symbol).collect();
    let slopes = jacobian::forward(augmented.graph(), &functions, &symbols);
    let mut rows = vec![];
    for i in 0..functions.len() {
        let mut all = vec![Interval::ZERO; symbols.len()];
        for (j, slope) in slopes.row(i) {
            all[j] = range_within(augmented.graph(), slope, &region, CELLS)?.enclosure;
        }
        let b = all.split_off(states.len());
        rows.push(Row { a: all, b });
    }
    let constraints = rows.split_off(states.len());
    let is_said = |row: &Row| !row.a.iter().chain(&row.b).all(|x| x.is_zero());
    let width = |i: &usize| augmented.states[*i].max - augmented.states[*i].min;
    Ok(System {
        scales: states.iter().map(width).collect(),
        reach: inputs.iter().map(width).collect(),
        budget: augmented.graph().budget(),
        flow: rows.into_iter().map(Some).collect(),
        constraints: constraints.into_iter().filter(is_said).collect(),
        followers: vec![],
        inputs: vec![None; inputs.len()],
    })
}

/// a·δη + b·δv with coefficients that enclose those between any two points of the box.
#[derive(Clone, Debug)]
struct Row {
    /// of states
    a: Vec<Interval>,
    /// of unknown inputs
    b: Vec<Interval>,
}

/// Whether it never vanishes.
fn has_sign(x: &Interval) -> bool {
    x.is_defined() && (x.lo() > 0.0 || x.hi() < 0.0)
}

/// factor·by added, where neither is nothing: 0·∞ shall be 0.
fn add(to: &mut [Interval], factor: Interval, row: &[Interval]) {
    for (x, y) in to.iter_mut().zip(row).filter(|(_, y)| !y.is_zero()) {
        *x = *x + factor * *y;
    }
}

impl Row {
    /// A row of its size in which nothing stands.
    fn empty(&self) -> Self {
        let zeros = |row: &[Interval]| vec![Interval::ZERO; row.len()];
        Self {
            a: zeros(&self.a),
            b: zeros(&self.b),
        }
    }

    /// The row with δv_u put in from 0 = `given`.
    fn without_input(&mut self, u: usize, given: &Row) {
        let factor = -self.b[u] / given.b[u];
        if self.b[u].is_zero() {
            return;
        }
        self.b[u] = Interval::ZERO;
        add(&mut self.a, factor, &given.a);
    }

    /// The row with δη_p put in from 0 = `given`, which has no inputs.
    fn without_state(&mut self, p: usize, given: &Row) {
        let factor = -self.a[p] / given.a[p];
        if self.a[p].is_zero() {
            return;
        }
        let mut others = given.a.clone();
        others[p] = Interval::ZERO;
        self.a[p] = Interval::ZERO;
        add(&mut self.a, factor, &others);
    }

    fn is_free_of_inputs(&self) -> bool {
        self.b.iter().all(|x| x.is_zero())
    }
}

/// The differences of two solutions.
#[derive(Clone, Debug)]
struct System {
    /// δη' by state; none where the state follows from others
    flow: Vec<Option<Row>>,
    /// 0 = row
    constraints: Vec<Row>,
    /// δη of a state that was eliminated, by the others
    followers: Vec<(usize, Row)>,
    /// δv by states
    inputs: Vec<Option<Row>>,
    /// widths of the states' ranges
    scales: Vec<f64>,
    /// widths of the unknown inputs' ranges
    reach: Vec<f64>,
    budget: Budget,
}

impl System {
    /// Eliminates unknown inputs, then states, by the constraints.
    fn reduced(mut self) -> Self {
        for u in 0..self.inputs.len() {
            self.solve_for_input(u);
        }
        for u in 0..self.inputs.len() {
            if self.inputs[u].is_none() {
                self.spend_equation(u);
            }
        }
        while self.eliminate_state(None) {}
        self
    }

    fn rows(&mut self) -> impl Iterator<Item = &mut Row> {
        let flow = self.flow.iter_mut().flatten();
        let inputs = self.inputs.iter_mut().flatten();
        let followers = self.followers.iter_mut().map(|(_, row)| row);
        flow.chain(&mut self.constraints)
            .chain(inputs)
            .chain(followers)
    }

    /// A constraint in which the input alone stands beside states tells it.
    fn solve_for_input(&mut self, u: usize) {
        let tells = |row: &Row| {
            let mut others = row.b.iter().enumerate().filter(|(j, _)| *j != u);
            has_sign(&row.b[u]) && others.all(|(_, x)| x.is_zero())
        };
        let Some(place) = self.constraints.iter().position(tells) else {
            return;
        };
        let given = self.constraints.remove(place);
        self.rows().for_each(|row| row.without_input(u, &given));
        let mut own = given.empty();
        own.b[u] = Interval::ONE;
        own.without_input(u, &given);
        self.inputs[u] = Some(own);
    }

    /// An input that acts on one state only: a constraint gives that state, and its equation
    /// is what the input is for.
    fn spend_equation(&mut self, u: usize) {
        let acts = |row: &Option<Row>| row.as_ref().is_some_and(|row| !row.b[u].is_zero());
        let mut driven = (0..self.flow.len()).filter(|&s| acts(&self.flow[s]));
        if let (Some(p), None) = (driven.next(), driven.next()) {
            self.eliminate_state(Some(p));
        }
    }

    /// Eliminates one state, this one or any, by a constraint without inputs.
    fn eliminate_state(&mut self, asked: Option<usize>) -> bool {
        let states = 0..self.flow.len();
        let mut pairs = self.constraints.iter().enumerate().flat_map(|(k, row)| {
            let is_asked = move |s: &usize| asked.is_none_or(|asked| asked == *s);
            let of_row = states.clone().filter(is_asked).map(move |s| (k, s));
            of_row.filter(|_| row.is_free_of_inputs())
        });
        let fits = |&(k, s): &(usize, usize)| {
            self.flow[s].is_some() && has_sign(&self.constraints[k].a[s])
        };
        let Some((k, p)) = pairs.find(fits) else {
            return false;
        };
        let given = self.constraints.remove(k);
        self.flow[p] = None;
        self.rows().for_each(|row| row.without_state(p, &given));
        let mut own = given.empty();
        own.a[p] = Interval::ONE;
        own.without_state(p, &given);
        self.followers.push((p, own));
        true
    }
}
