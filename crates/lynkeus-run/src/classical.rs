//! The classical Runge–Kutta method over expressions: a step is then one function.

use lynkeus_expr::Expr;

/// An expression, or nothing where it is zero whatever the inputs are.
pub(crate) type Term<'g> = Option<Expr<'g>>;

/// The sum, of which what is zero is left out.
pub(crate) fn sum<'g>(a: Term<'g>, b: Term<'g>) -> Term<'g> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a + b),
        (a, b) => a.or(b),
    }
}

/// z at t + h for z' = `slope`(t, z). Operation by operation it is what [`Rk4`](crate::Rk4) does.
pub(crate) fn classical_step<'g>(
    t: Expr<'g>,
    h: Expr<'g>,
    z: &[Term<'g>],
    slope: impl Fn(Expr<'g>, &[Term<'g>]) -> Vec<Term<'g>>,
) -> Vec<Term<'g>> {
    let moved = |factor: Expr<'g>, k: &[Term<'g>]| -> Vec<Term<'g>> {
        let ends = z.iter().zip(k);
        ends.map(|(&z, k)| sum(z, k.map(|k| factor * k))).collect()
    };
    let half = h * 0.5;
    let k1 = slope(t, z);
    let k2 = slope(t + half, &moved(half, &k1));
    let k3 = slope(t + half, &moved(half, &k2));
    let k4 = slope(t + h, &moved(h, &k3));
    let next = z.iter().enumerate().map(|(i, &z)| {
        let twice = sum(k2[i], k3[i]).map(|k| 2.0 * k);
        let all = sum(sum(k1[i], twice), k4[i]);
        sum(z, all.map(|k| h / 6.0 * k))
    });
    next.collect()
}
