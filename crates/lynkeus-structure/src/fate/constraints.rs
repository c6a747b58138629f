//! Rows in the hidden quantities, and the elimination of some by others.

use lynkeus_expr::Interval;

/// a·δη + b·δv with coefficients that enclose those between any two points of the box.
#[derive(Clone, Debug)]
pub(super) struct Row {
    /// of states
    pub a: Vec<Interval>,
    /// of unknown inputs
    pub b: Vec<Interval>,
}

/// Whether a coefficient is nothing at all.
pub(super) fn is_zero(x: &Interval) -> bool {
    x.lo() == 0.0 && x.hi() == 0.0
}

/// Whether it never vanishes.
fn has_sign(x: &Interval) -> bool {
    x.is_defined() && (x.lo() > 0.0 || x.hi() < 0.0)
}

/// factor·by added, where neither is nothing: 0·∞ shall be 0.
fn add(to: &mut [Interval], factor: Interval, row: &[Interval]) {
    for (x, y) in to.iter_mut().zip(row).filter(|(_, y)| !is_zero(y)) {
        *x = *x + factor * *y;
    }
}

impl Row {
    /// The row with δv_u put in from 0 = `given`.
    fn without_input(&mut self, u: usize, given: &Row) {
        let factor = -self.b[u] / given.b[u];
        if is_zero(&self.b[u]) {
            return;
        }
        self.b[u] = Interval::ZERO;
        add(&mut self.a, factor, &given.a);
    }

    /// The row with δη_p put in from 0 = `given`, which has no inputs.
    fn without_state(&mut self, p: usize, given: &Row) {
        let factor = -self.a[p] / given.a[p];
        if is_zero(&self.a[p]) {
            return;
        }
        let mut others = given.a.clone();
        others[p] = Interval::ZERO;
        self.a[p] = Interval::ZERO;
        add(&mut self.a, factor, &others);
    }

    pub fn is_free_of_inputs(&self) -> bool {
        self.b.iter().all(is_zero)
    }
}

/// The differences of two solutions.
#[derive(Clone, Debug)]
pub(super) struct System {
    /// δη' by state; none where the state follows from others
    pub flow: Vec<Option<Row>>,
    /// 0 = row
    pub constraints: Vec<Row>,
    /// δη of a state that was eliminated, by the others
    pub followers: Vec<(usize, Row)>,
    /// δv by states
    pub inputs: Vec<Option<Row>>,
}

impl System {
    /// Eliminates unknown inputs, then states, by the constraints.
    pub fn reduced(mut self) -> Self {
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
            has_sign(&row.b[u]) && others.all(|(_, x)| is_zero(x))
        };
        let Some(place) = self.constraints.iter().position(tells) else {
            return;
        };
        let given = self.constraints.remove(place);
        self.rows().for_each(|row| row.without_input(u, &given));
        let mut own = Row {
            a: vec![Interval::ZERO; given.a.len()],
            b: given.b.iter().map(|_| Interval::ZERO).collect(),
        };
        own.b[u] = Interval::ONE;
        own.without_input(u, &given);
        self.inputs[u] = Some(own);
    }

    /// An input that acts on one state only: a constraint gives that state, and its equation
    /// is what the input is for.
    fn spend_equation(&mut self, u: usize) {
        let acts = |row: &Option<Row>| row.as_ref().is_some_and(|row| !is_zero(&row.b[u]));
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
        let mut own = Row {
            a: vec![Interval::ZERO; given.a.len()],
            b: given.b.clone(),
        };
        own.a[p] = Interval::ONE;
        own.without_state(p, &given);
        self.followers.push((p, own));
        true
    }
}
