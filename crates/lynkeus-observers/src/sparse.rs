//! Entries of matrices that may be zero everywhere, as expressions.

use lynkeus_expr::Expr;

/// An entry; none where it is zero everywhere.
pub(crate) type Sparse<'g> = Option<Expr<'g>>;

/// Σ of the terms that are not zero everywhere.
pub(crate) fn sum<'g>(terms: impl IntoIterator<Item = Sparse<'g>>) -> Sparse<'g> {
    terms.into_iter().flatten().reduce(|a, b| a + b)
}

pub(crate) fn times<'g>(a: Sparse<'g>, b: Sparse<'g>) -> Sparse<'g> {
    Some(a? * b?)
}

pub(crate) fn minus<'g>(a: Sparse<'g>, b: Sparse<'g>) -> Sparse<'g> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a - b),
        (None, Some(b)) => Some(-b),
        (a, None) => a,
    }
}

/// a·b
pub(crate) fn dot<'g>(a: &[Sparse<'g>], b: &[Sparse<'g>]) -> Sparse<'g> {
    sum(a.iter().zip(b).map(|(&a, &b)| times(a, b)))
}
