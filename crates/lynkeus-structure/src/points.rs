//! Generic points of a box.

/// A well-spread number in [0.1, 0.9] for each (point, variable).
pub(crate) fn spread(point: usize, variable: usize) -> f64 {
    let golden = 0.618_033_988_749_894_9;
    let x = (point as f64 + 1.0) * golden + variable as f64 * 0.754_877_666_246_692_7;
    0.1 + 0.8 * x.fract()
}

/// The place in a range, 0 … 1 from end to end; near zero or the end where one is open.
pub(crate) fn inside(min: f64, max: f64, share: f64) -> f64 {
    match (min.is_finite(), max.is_finite()) {
        (true, true) => min + share * (max - min),
        (true, false) => min + 2.0 * share,
        (false, true) => max - 2.0 * share,
        (false, false) => 2.0 * share,
    }
}
