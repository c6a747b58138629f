//! The correction of observer (7), by the five steps of the paper.

use lynkeus_expr::{Expr, Graph, Node, jacobian};
use lynkeus_structure::{Chain, Extended};

/// M̄, L and W of the five steps.
struct Steps {
    M̄: Vec<Vec<Sparse>>,
    L: Vec<Sparse>,
    W: Vec<Vec<Sparse>>,
}

impl Steps {
    fn new(extended: &Extended<'_>, chain: &Chain) -> Self {
        let graph = extended.graph();
        let n = chain.states.len();
        let F = own_jacobian(extended, chain);
        // Step 1: M̄ = (C; CF; …; CF^{n−1}), lower triangular, and the next power CFⁿ
        let mut rows = vec![unit(graph, n)];
        for k in 0..n {
            rows.push(times(graph, &rows[k], &F));
        }
        let next = rows.pop().unwrap_or_default();
        let M̄ = rows;
        // Steps 2 and 3: the last row q of M̄FM̄⁻¹ − A solves q M̄ = CFⁿ; L_j = q_{n−j+1}
        let q = solve_left(graph, &M̄, next);
        let L: Vec<Sparse> = q.into_iter().rev().collect();
        // Step 4: W = (C; C(A + LC); …)
        let Ā = |row: &[Sparse]| -> Vec<Sparse> {
            (0..n)
                .map(|j| match j {
                    0 => dot(graph, row, &L),
                    _ => row[j - 1],
                })
                .collect()
        };
        let mut W = vec![unit(graph, n)];
        for k in 1..n {
            W.push(Ā(&W[k - 1]));
        }
        Self { M̄, L, W }
    }
}

/// M⁻¹(L + Δ⁻¹K) by the five steps. Since M = W⁻¹M̄, it is M̄⁻¹W(L + Δ⁻¹K): one
/// triangular solve.
pub(super) fn lee(extended: &Extended<'_>, chain: &Chain, gains: &[Node]) -> Vec<Node> {
    let graph = extended.graph();
    let Steps { M̄, L, W } = Steps::new(extended, chain);
    // Step 5, multiplied out
    let v: Vec<Sparse> = L
        .iter()
        .zip(gains)
        .map(|(&l, &k)| sum(graph, l, Some(k)))
        .collect();
    let right: Vec<Sparse> = W.iter().map(|row| dot(graph, row, &v)).collect();
    let zero = graph.constant(0.0).node();
    let gain = solve_lower(graph, &M̄, right);
    gain.into_iter().map(|g| g.unwrap_or(zero)).collect()
}

/// The similarity transformation of the error, row by row.
pub(super) struct Transformation {
    /// M = W⁻¹M̄
    pub M: Vec<Vec<Sparse>>,
    /// M⁻¹ = M̄⁻¹W
    pub inverse: Vec<Vec<Sparse>>,
    /// L
    pub L: Vec<Sparse>,
}

/// M, M⁻¹ and L of Step 5, for the proof; the observer needs none of them.
pub(super) fn transformation(extended: &Extended<'_>, chain: &Chain) -> Transformation {
    let graph = extended.graph();
    let Steps { M̄, L, W } = Steps::new(extended, chain);
    let solved = |A: &[Vec<Sparse>], B: &[Vec<Sparse>]| {
        let n = A.len();
        let column = |j: usize| solve_lower(graph, A, B.iter().map(|row| row[j]).collect());
        let columns: Vec<Vec<Sparse>> = (0..n).map(column).collect();
        let row = |i: usize| columns.iter().map(|c| c[i]).collect();
        (0..n).map(row).collect()
    };
    Transformation {
        M: solved(&W, &M̄),
        inverse: solved(&M̄, &W),
        L,
    }
}

/// An entry that may be zero everywhere.
pub(super) type Sparse = Option<Node>;

/// F_i = ∂f_i/∂x_i, row by row.
pub(super) fn own_jacobian(extended: &Extended<'_>, chain: &Chain) -> Vec<Vec<Sparse>> {
    let f: Vec<Node> = chain
        .states
        .iter()
        .map(|&i| extended.derivatives[i])
        .collect();
    let x: Vec<Node> = chain
        .states
        .iter()
        .map(|&i| extended.states[i].node)
        .collect();
    let jacobian = jacobian::forward(extended.graph(), &f, &x);
    let n = f.len();
    (0..n)
        .map(|i| (0..n).map(|j| jacobian.get(i, j)).collect())
        .collect()
}

/// C = (1, 0, …, 0)
fn unit(graph: &Graph, n: usize) -> Vec<Sparse> {
    let one = graph.constant(1.0).node();
    (0..n).map(|j| (j == 0).then_some(one)).collect()
}

fn sum(graph: &Graph, a: Sparse, b: Sparse) -> Sparse {
    match (a, b) {
        (Some(a), Some(b)) => Some((graph.expr(a) + graph.expr(b)).node()),
        (a, b) => a.or(b),
    }
}

fn product<'g>(graph: &'g Graph, a: Sparse, b: Sparse) -> Option<Expr<'g>> {
    Some(graph.expr(a?) * graph.expr(b?))
}

fn dot(graph: &Graph, a: &[Sparse], b: &[Sparse]) -> Sparse {
    let terms = a.iter().zip(b).filter_map(|(&a, &b)| product(graph, a, b));
    terms.reduce(|a, b| a + b).map(Expr::node)
}

fn times(graph: &Graph, row: &[Sparse], F: &[Vec<Sparse>]) -> Vec<Sparse> {
    let column = |j: usize| F.iter().map(|r| r[j]).collect::<Vec<_>>();
    (0..row.len())
        .map(|j| dot(graph, row, &column(j)))
        .collect()
}

/// (right − known)/pivot
fn eliminated(graph: &Graph, right: Sparse, known: Sparse, pivot: Sparse) -> Sparse {
    let numerator = match (right, known) {
        (Some(r), Some(k)) => graph.expr(r) - graph.expr(k),
        (Some(r), None) => graph.expr(r),
        (None, Some(k)) => -graph.expr(k),
        (None, None) => return None,
    };
    Some(match pivot {
        Some(pivot) => (numerator / graph.expr(pivot)).node(),
        None => numerator.node(),
    })
}

/// x with M x = b for a lower triangular M.
fn solve_lower(graph: &Graph, M: &[Vec<Sparse>], b: Vec<Sparse>) -> Vec<Sparse> {
    let mut x: Vec<Sparse> = vec![];
    for (i, right) in b.into_iter().enumerate() {
        let known = dot(graph, &M[i][..i], &x);
        x.push(eliminated(graph, right, known, M[i][i]));
    }
    x
}

/// q with q M = c for a lower triangular M.
fn solve_left(graph: &Graph, M: &[Vec<Sparse>], c: Vec<Sparse>) -> Vec<Sparse> {
    let n = c.len();
    let mut q: Vec<Sparse> = vec![None; n];
    for j in (0..n).rev() {
        let column: Vec<Sparse> = M.iter().map(|row| row[j]).collect();
        let known = dot(graph, &q[j + 1..], &column[j + 1..]);
        q[j] = eliminated(graph, c[j], known, M[j][j]);
    }
    q
}
