//! The vertices of a box.

/// α₁ ≤ a(t) ≤ α₂, both positive: what is known of one partial derivative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// α₁
    pub lower: f64,
    /// α₂
    pub upper: f64,
}

impl Bounds {
    /// The bounds of a multiple of it by a positive factor.
    pub fn scaled(self, factor: f64) -> Self {
        Self {
            lower: self.lower * factor,
            upper: self.upper * factor,
        }
    }
}

impl From<(f64, f64)> for Bounds {
    fn from((lower, upper): (f64, f64)) -> Self {
        Self { lower, upper }
    }
}

/// Every choice of one end per bound; ends that coincide count once.
pub fn vertices(bounds: &[Bounds]) -> impl Iterator<Item = Vec<f64>> {
    let open: Vec<usize> = (0..bounds.len())
        .filter(|&i| bounds[i].lower < bounds[i].upper)
        .collect();
    let lower: Vec<f64> = bounds.iter().map(|b| b.lower).collect();
    let bounds = bounds.to_vec();
    (0..1usize << open.len()).map(move |choice| {
        let mut a = lower.clone();
        for (bit, &i) in open.iter().enumerate() {
            if choice >> bit & 1 == 1 {
                a[i] = bounds[i].upper;
            }
        }
        a
    })
}
