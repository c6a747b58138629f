//! Tables as monotone cubics: Fritsch and Carlson, SIAM J. Numer. Anal. 17 (1980), with the
//! slopes of Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5 (1984): C¹, exact at the points,
//! rising where they rise and nowhere beyond them.

use lynkeus_expr::{Expr, Graph, Node};

/// The piece between two points.
struct Piece<'g> {
    left: End<'g>,
    right: End<'g>,
    /// what is added to the left value for the right one
    rise: Expr<'g>,
}

/// A point of the table with the slope there.
#[derive(Clone, Copy)]
struct End<'g> {
    x: Expr<'g>,
    y: Expr<'g>,
    slope: Expr<'g>,
}

impl<'g> End<'g> {
    fn tangent(&self, u: Expr<'g>) -> Expr<'g> {
        self.y + self.slope * (u - self.x)
    }
}

impl<'g> Piece<'g> {
    /// Hermite's cubic. Written so that at both ends the value, and what the rules of
    /// differentiation make of the slope, are those of the ends to the bit: neighbours meet
    /// without a jump, and what looks for jumps sees that they do.
    fn cubic(&self, u: Expr<'g>) -> Expr<'g> {
        let (from, to) = (u - self.left.x, self.right.x - u);
        let width = self.right.x - self.left.x;
        let (share, rest) = (from / width, to / width);
        let rise = self.rise * (share * share * (3.0 - 2.0 * share));
        let left = self.left.slope * (from * (rest * rest));
        let right = self.right.slope * (to * (share * share));
        self.left.y + rise + (left - right)
    }
}

/// The cubic through the points (x[i], y[i]) at u, and along its tangents outside of them.
pub(super) fn monotone_cubic(graph: &Graph, x: &[Node], y: &[Node], u: Node) -> Node {
    let of = |nodes: &[Node]| nodes.iter().map(|&n| graph.expr(n)).collect::<Vec<_>>();
    let (x, y, u) = (of(x), of(y), graph.expr(u));
    let (values, rises) = met(&y);
    let widths: Vec<Expr<'_>> = x.windows(2).map(|x| x[1] - x[0]).collect();
    let slopes = slopes(&widths, &rises);
    let ends = x.into_iter().zip(values).zip(slopes);
    let ends: Vec<End<'_>> = ends.map(|((x, y), slope)| End { x, y, slope }).collect();
    let (first, last) = match ends[..] {
        [first, .., last] => (first, last),
        // a single point is a constant
        _ => return y.first().map_or(u, |y| *y).node(),
    };
    if rises.len() == 1 {
        return first.tangent(u).node();
    }
    // the pieces from −∞ to ∞, each with where it ends
    let inner = ends.windows(2).zip(&rises).map(|(pair, &rise)| {
        let [left, right] = [pair[0], pair[1]];
        (Piece { left, right, rise }.cubic(u), right.x)
    });
    let pieces: Vec<(Expr<'_>, Expr<'_>)> = std::iter::once((first.tangent(u), first.x))
        .chain(inner)
        .collect();
    chosen(&pieces, last.tangent(u), u).node()
}

/// The piece that holds u, by halves: a chain of choices would be as deep as the table is long.
fn chosen<'g>(pieces: &[(Expr<'g>, Expr<'g>)], beyond: Expr<'g>, u: Expr<'g>) -> Expr<'g> {
    let (before, after) = pieces.split_at(pieces.len() / 2);
    match after.split_first() {
        None => beyond,
        Some((&(piece, end), after)) => u
            .less(end)
            .select(chosen(before, piece, u), chosen(after, beyond, u)),
    }
}

/// The values, each the sum of the one before and the rise to it, as rounded, with the rises: at
/// most one rounding off, and pieces that add their rise end where the next ones begin.
fn met<'g>(y: &[Expr<'g>]) -> (Vec<Expr<'g>>, Vec<Expr<'g>>) {
    let (mut values, mut rises): (Vec<Expr<'g>>, Vec<Expr<'g>>) = (vec![], vec![]);
    for &value in y {
        values.push(match values.last() {
            Some(&before) => {
                let rise = value - before;
                rises.push(rise);
                before + rise
            }
            None => value,
        });
    }
    (values, rises)
}

/// The slopes at the points; none without two points.
fn slopes<'g>(widths: &[Expr<'g>], rises: &[Expr<'g>]) -> Vec<Expr<'g>> {
    let secants = rises.iter().zip(widths).map(|(&rise, &width)| rise / width);
    let secants: Vec<Expr<'g>> = secants.collect();
    let n = secants.len();
    if n < 2 {
        return secants.repeat(2);
    }
    let edge = |a: usize, b: usize| at_the_edge([widths[a], widths[b]], [secants[a], secants[b]]);
    let inner = widths.windows(2).zip(secants.windows(2));
    let inner = inner.map(|(h, d)| inside([h[0], h[1]], [d[0], d[1]]));
    let (first, last) = (edge(0, 1), edge(n - 1, n - 2));
    std::iter::once(first).chain(inner).chain([last]).collect()
}

/// Between two pieces that rise or fall alike the weighted harmonic mean of their secants, else 0.
fn inside<'g>(width: [Expr<'g>; 2], secant: [Expr<'g>; 2]) -> Expr<'g> {
    let weights = [2.0 * width[1] + width[0], width[1] + 2.0 * width[0]];
    let mean = (weights[0] + weights[1]) / (weights[0] / secant[0] + weights[1] / secant[1]);
    let zero = mean.graph().constant(0.0);
    let alike = (secant[0].sign() * secant[1].sign()).greater(zero);
    alike.select(mean, zero)
}

/// At the first or last point, nearest piece first: that of the parabola through three points, held to
/// what keeps the piece monotone.
fn at_the_edge<'g>(width: [Expr<'g>; 2], secant: [Expr<'g>; 2]) -> Expr<'g> {
    let parabola =
        ((2.0 * width[0] + width[1]) * secant[0] - width[0] * secant[1]) / (width[0] + width[1]);
    let zero = parabola.graph().constant(0.0);
    let rises = (parabola.sign() * secant[0].sign()).greater(zero);
    let turns = (secant[0].sign() * secant[1].sign()).less_eq(zero);
    let steep = parabola.abs().greater(3.0 * secant[0].abs());
    let held = (turns.and(steep)).select(3.0 * secant[0], parabola);
    rises.select(held, zero)
}
