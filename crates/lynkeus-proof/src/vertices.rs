//! The vertices of a box: where a function that is convex in several numbers is largest.

/// What is known of a number: lower ≤ a(t) ≤ upper. Of a partial derivative along a chain
/// these are the α₁ and α₂ of Hammouri, Targui and Armanet (2002).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// α₁
    pub lower: f64,
    /// α₂
    pub upper: f64,
}

impl Bounds {
    fn vary(&self) -> bool {
        self.lower < self.upper
    }
}

impl From<(f64, f64)> for Bounds {
    fn from((lower, upper): (f64, f64)) -> Self {
        Self { lower, upper }
    }
}

/// How many of the numbers vary: their box has two to this power vertices.
pub fn varying(bounds: &[Bounds]) -> usize {
    bounds.iter().filter(|b| b.vary()).count()
}

/// Every choice of one end per bound; ends that coincide count once.
///
/// ```
/// use lynkeus_proof::vertices;
///
/// let found: Vec<_> = vertices(&[(1.0, 2.0).into(), (5.0, 5.0).into()]).collect();
/// assert_eq!(found, [[1.0, 5.0], [2.0, 5.0]]);
/// ```
pub fn vertices(bounds: &[Bounds]) -> impl Iterator<Item = Vec<f64>> + use<> {
    let bounds = bounds.to_vec();
    let first: Vec<f64> = bounds.iter().map(|b| b.lower).collect();
    // counts in binary, the upper end being the digit one
    std::iter::successors(Some(first), move |vertex| {
        let mut next = vertex.clone();
        for (a, b) in next.iter_mut().zip(&bounds).filter(|(_, b)| b.vary()) {
            if *a == b.lower {
                *a = b.upper;
                return Some(next);
            }
            *a = b.lower;
        }
        None
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_vertex_comes_once() {
        let bounds = [(0.0, 1.0), (2.0, 2.0), (-3.0, 4.0), (5.0, 6.0)].map(Bounds::from);
        let found: Vec<Vec<f64>> = vertices(&bounds).collect();
        assert_eq!((found.len(), varying(&bounds)), (8, 3));
        for (i, vertex) in found.iter().enumerate() {
            let ends = vertex.iter().zip(&bounds);
            assert!(ends.clone().all(|(a, b)| *a == b.lower || *a == b.upper));
            assert!(!found[..i].contains(vertex));
        }
        assert_eq!(vertices(&[]).count(), 1);
    }
}
