//! Where states and readings live: on lines, circles and among the rotations.
//!
//! An angle is kept on the line, and only what is compared with it is wrapped. A unit quaternion q keeps its four
//! numbers: what is not known of it is δq = ½ q⊗(0, θ) with θ the vector of a small rotation about the body's
//! axes, so that δq is tangent to the sphere, qᵀδq = 0, and so are the columns of every root of its covariance. The
//! retraction is q ⊞ δq = q⊗exp(θ/2), whatever the length of θ; what was tangent at q is carried over to q⁺ by the
//! multiplication with q⁺⊗q̄, which keeps θ. So filters are those of multiplicative errors (F. L. Markley, *Journal of
//! Guidance, Control, and Dynamics* 26 (2003) 311–317), and all that works on roots works on them.

use std::borrow::Cow;
use std::f64::consts::TAU;

/// Where the states of a plant and the readings of its sensors live; by default among the real numbers.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct Manifold {
    /// the places of states that are angles: a full turn changes nothing
    pub circles: Vec<usize>,
    /// the place of the first of the four numbers of each unit quaternion, the scalar
    pub rotations: Vec<usize>,
    /// the places of sensors that show an angle
    pub dials: Vec<usize>,
    /// by quaternion the places of sensors that change their sign with it
    pub mirrors: Vec<Vec<usize>>,
}

/// An angle in (−π, π], up to full turns.
#[must_use]
pub fn wrapped(angle: f64) -> f64 {
    angle - TAU * (angle / TAU - 0.5).ceil()
}

/// The angle of the rotation that takes one quaternion to another: in [0, π]. Of any length but 0.
#[must_use]
pub fn angle_between(one: [f64; 4], other: [f64; 4]) -> f64 {
    let [w, x, y, z] = times(conjugate(one), other);
    2.0 * (x * x + y * y + z * z).sqrt().atan2(w.abs())
}

/// A quaternion as one of length 1; none where it says no rotation.
#[must_use]
pub fn unit(q: [f64; 4]) -> Option<[f64; 4]> {
    let norm = length(&q);
    (norm > 0.0 && norm.is_finite()).then(|| q.map(|x| x / norm))
}

/// A rotation after another by a vector along the body's axes, of any length.
#[must_use]
pub fn turned(q: [f64; 4], [x, y, z]: [f64; 3]) -> [f64; 4] {
    let half = times(q, [0.0, 0.5 * x, 0.5 * y, 0.5 * z]);
    geodesic(q, half)
}

impl Manifold {
    /// Whether everything is a real number.
    #[must_use]
    pub fn is_flat(&self) -> bool {
        *self == Self::default()
    }

    /// Whether a sum of states is one of them.
    pub(crate) fn is_straight(&self) -> bool {
        self.rotations.is_empty()
    }

    /// A reading as the nearest one to what is predicted of those that say the same.
    pub(crate) fn lifted(&self, sensor: usize, reading: f64, predicted: f64) -> f64 {
        match self.dials.contains(&sensor) {
            true => predicted + wrapped(reading - predicted),
            false => reading,
        }
    }

    /// Readings with the signs of what is expected, where a quaternion and its negative say the same.
    pub(crate) fn signed<'r>(&self, readings: &'r [f64], expected: &[f64]) -> Cow<'r, [f64]> {
        let mut signed = Cow::Borrowed(readings);
        for mirror in &self.mirrors {
            let read = mirror.iter().filter(|i| readings[**i].is_finite());
            let along: f64 = read.map(|&i| readings[i] * expected[i]).sum();
            if along < 0.0 {
                let own = signed.to_mut();
                mirror.iter().for_each(|&i| own[i] = -own[i]);
            }
        }
        signed
    }

    /// Quaternions of length 1 in the place of those that came off the sphere.
    pub fn normalise(&self, x: &mut [f64]) {
        for place in &self.rotations {
            if let Some(q) = unit(rotation(x, *place)) {
                x[*place..place + 4].copy_from_slice(&q);
            }
        }
    }

    /// x = from + δ becomes from ⊞ δ.
    pub(crate) fn retract(&self, from: &[f64], x: &mut [f64]) {
        for place in &self.rotations {
            let (q, moved) = (rotation(from, *place), rotation(x, *place));
            let step = std::array::from_fn(|i| moved[i] - q[i]);
            x[*place..place + 4].copy_from_slice(&geodesic(q, step));
        }
    }

    /// x becomes the x̃ with x = from ⊞ (x̃ − from): its quaternions are put into the plane that touches the sphere.
    pub(crate) fn flatten(&self, from: &[f64], x: &mut [f64]) {
        for place in &self.rotations {
            let (q, p) = (rotation(from, *place), rotation(x, *place));
            let along = dot(q, p);
            // the nearer of the two that are one rotation
            let (along, p) = match along < 0.0 {
                true => (-along, p.map(|p| -p)),
                false => (along, p),
            };
            let across: [f64; 4] = std::array::from_fn(|i| p[i] - along * q[i]);
            let sine = length(&across);
            let share = match sine > 0.0 {
                true => sine.atan2(along) / sine,
                false => 1.0,
            };
            for (i, x) in x[*place..place + 4].iter_mut().enumerate() {
                *x = q[i] + share * across[i];
            }
        }
    }

    /// The rows of a matrix with `width` columns that belong to a quaternion, without what is not tangent at x.
    pub(crate) fn project(&self, x: &[f64], matrix: &mut [f64], width: usize) {
        for place in &self.rotations {
            let q = rotation(x, *place);
            columns(matrix, *place, width, |column| {
                let along = dot(q, column);
                std::array::from_fn(|i| column[i] - along * q[i])
            });
        }
    }

    /// Deviations that are told in the plane that touches at one place, told in that which touches at another, to first
    /// order about that: with c the vector of the rotation between them θ becomes J(c)θ, J the right Jacobian.
    pub(crate) fn recharted(&self, from: &[f64], to: &[f64], matrix: &mut [f64], width: usize) {
        for place in &self.rotations {
            let (q, p) = (rotation(from, *place), rotation(to, *place));
            let way = logarithm(times(conjugate(q), p));
            columns(matrix, *place, width, |column| {
                tangent(p, right_jacobian(way, vector(q, column)))
            });
        }
    }

    /// The same of a place: the x = from + δ in the plane at `from` becomes the to + J(c)(δ − c) in that at `to`.
    pub(crate) fn recentred(&self, from: &[f64], to: &[f64], x: &mut [f64]) {
        for place in &self.rotations {
            let (q, p) = (rotation(from, *place), rotation(to, *place));
            let way = logarithm(times(conjugate(q), p));
            let told = rotation(x, *place);
            let δ = vector(q, std::array::from_fn(|i| told[i] - q[i]));
            let δ = right_jacobian(way, std::array::from_fn(|i| δ[i] - way[i]));
            let δ = tangent(p, δ);
            for (i, x) in x[*place..place + 4].iter_mut().enumerate() {
                *x = p[i] + δ[i];
            }
        }
    }

    /// The rows of a matrix that belong to a quaternion carried to another place, their axes those of the world: what
    /// turns q before it turns q⊗p.
    pub(crate) fn transport_in_world(
        &self,
        from: &[f64],
        to: &[f64],
        matrix: &mut [f64],
        width: usize,
    ) {
        for place in &self.rotations {
            let way = times(conjugate(rotation(from, *place)), rotation(to, *place));
            columns(matrix, *place, width, |column| times(column, way));
        }
    }

    /// The rows of a matrix that belong to a quaternion, tangent at x, as those of the vector of a rotation: three of
    /// them, after one of zeros.
    pub(crate) fn as_vectors(&self, x: &[f64], matrix: &mut [f64], width: usize) {
        for place in &self.rotations {
            let q = rotation(x, *place);
            columns(matrix, *place, width, |column| {
                let [x, y, z] = vector(q, column);
                [0.0, x, y, z]
            });
        }
    }

    /// The same rows carried from where they are tangent to another place.
    pub(crate) fn transport(&self, from: &[f64], to: &[f64], matrix: &mut [f64], width: usize) {
        for place in &self.rotations {
            let way = times(rotation(to, *place), conjugate(rotation(from, *place)));
            columns(matrix, *place, width, |column| times(way, column));
        }
    }
}

/// The quaternion whose scalar stands at a place.
fn rotation(x: &[f64], place: usize) -> [f64; 4] {
    std::array::from_fn(|i| x[place + i])
}

/// Changes four rows from `first` on, column by column.
fn columns(matrix: &mut [f64], first: usize, width: usize, change: impl Fn([f64; 4]) -> [f64; 4]) {
    for c in 0..width {
        let at = |i: usize| (first + i) * width + c;
        let changed = change(std::array::from_fn(|i| matrix[at(i)]));
        for (i, value) in changed.into_iter().enumerate() {
            matrix[at(i)] = value;
        }
    }
}

fn dot(a: [f64; 4], b: [f64; 4]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
}

fn length(q: &[f64; 4]) -> f64 {
    dot(*q, *q).sqrt()
}

fn conjugate([w, x, y, z]: [f64; 4]) -> [f64; 4] {
    [w, -x, -y, -z]
}

/// The product of two quaternions.
fn times([a, b, c, d]: [f64; 4], [w, x, y, z]: [f64; 4]) -> [f64; 4] {
    [
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    ]
}

/// The vector of the rotation about the body's axes that a step from q is, where that is tangent.
fn vector(q: [f64; 4], step: [f64; 4]) -> [f64; 3] {
    let [_, x, y, z] = times(conjugate(q), step);
    [2.0 * x, 2.0 * y, 2.0 * z]
}

/// The step from q that such a vector is.
fn tangent(q: [f64; 4], [x, y, z]: [f64; 3]) -> [f64; 4] {
    times(q, [0.0, 0.5 * x, 0.5 * y, 0.5 * z])
}

/// The vector of a rotation, of at most half a turn.
fn logarithm([w, x, y, z]: [f64; 4]) -> [f64; 3] {
    let sine = (x * x + y * y + z * z).sqrt();
    let share = match sine > 0.0 {
        true => 2.0 * sine.atan2(w.abs()) / sine,
        false => 2.0,
    };
    // of the two that are one rotation the nearer to none
    let share = if w < 0.0 { -share } else { share };
    [x, y, z].map(|x| share * x)
}

/// J(c)v with exp(c + ε) = exp(c)·exp(J(c)ε) to first order (J. Solà, J. Deray, D. Atchuthan, *A micro Lie theory for
/// state estimation in robotics*, 2018, equation 143).
fn right_jacobian(c: [f64; 3], v: [f64; 3]) -> [f64; 3] {
    let square = c.iter().map(|x| x * x).sum::<f64>();
    let angle = square.sqrt();
    let (once, twice) = match angle > 1e-3 {
        true => (
            (1.0 - angle.cos()) / square,
            (angle - angle.sin()) / (square * angle),
        ),
        false => (0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0),
    };
    let across = cross(c, v);
    let again = cross(c, across);
    std::array::from_fn(|i| v[i] - once * across[i] + twice * again[i])
}

fn cross([a, b, c]: [f64; 3], [x, y, z]: [f64; 3]) -> [f64; 3] {
    [b * z - c * y, c * x - a * z, a * y - b * x]
}

/// From q along the sphere, by a step that is tangent there.
fn geodesic(q: [f64; 4], step: [f64; 4]) -> [f64; 4] {
    let size = length(&step);
    if size == 0.0 {
        return q;
    }
    let (sine, cosine) = size.sin_cos();
    let moved = std::array::from_fn(|i| cosine * q[i] + sine / size * step[i]);
    unit(moved).unwrap_or(moved)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn angles_are_wrapped_to_half_a_turn_either_side() {
        for (angle, expected) in [
            (0.3, 0.3),
            (PI, PI),
            (-PI, PI),
            (4.0, 4.0 - TAU),
            (-4.0, TAU - 4.0),
            (100.0, 100.0 - 16.0 * TAU),
        ] {
            assert!((wrapped(angle) - expected).abs() < 1e-13, "{angle}");
        }
        assert!(wrapped(f64::NAN).is_nan());
    }

    fn one() -> Manifold {
        Manifold {
            rotations: vec![1],
            ..Manifold::default()
        }
    }

    /// By hand: a quarter of a turn about z, then 0.2 about the body's x.
    #[test]
    fn a_retraction_turns_about_the_bodys_axes() {
        let root = 0.5_f64.sqrt();
        let q = [root, 0.0, 0.0, root];
        let turned = turned(q, [0.2, 0.0, 0.0]);
        let (sine, cosine) = 0.1_f64.sin_cos();
        let expected = [root * cosine, root * sine, root * sine, root * cosine];
        let off = turned.iter().zip(expected).map(|(a, b)| (a - b).abs());
        assert!(off.fold(0.0, f64::max) < 1e-15, "{turned:?}");
        assert!((angle_between(q, turned) - 0.2).abs() < 1e-15);
        assert!((angle_between(q, turned.map(|x| -3.0 * x)) - 0.2).abs() < 1e-15);
        assert!((angle_between(q, [-root, 0.0, 0.0, root]) - PI).abs() < 1e-15);
    }

    /// The derivative of exp(−c)·exp(c + εv) by differences, for ways short and long; and what is told elsewhere leads to
    /// the same place.
    #[test]
    fn what_is_told_elsewhere_follows_the_right_jacobian() {
        let unit = [1.0, 0.0, 0.0, 0.0];
        for size in [0.0, 1e-5, 9e-4, 1.1e-3, 0.4, 2.5] {
            let c = [0.48, -0.6, 0.64].map(|x| size * x);
            let v = [0.3, 0.5, -0.2];
            let h = 1e-5;
            let there = |h: f64| turned(unit, std::array::from_fn(|i| c[i] + h * v[i]));
            let way = |h: f64| logarithm(times(conjugate(there(0.0)), there(h)));
            let (more, less) = (way(h), way(-h));
            let own = right_jacobian(c, v);
            for i in 0..3 {
                let found = (more[i] - less[i]) / (2.0 * h);
                assert!((own[i] - found).abs() < 1e-9, "{size}: {own:?} {found}");
            }
        }
        let from = [&[9.0][..], &turned(unit, [0.3, -1.0, 0.2])].concat();
        let near = turned(rotation(&from, 1), [0.5, 0.2, -0.9]);
        let to = [&[9.0][..], &near].concat();
        // a place near the new one is itself, whatever plane it is told in
        let place = turned(near, [1e-5, -2e-5, 3e-5]);
        let mut told = [&[7.0][..], &place.map(|x| -x)].concat();
        one().flatten(&from, &mut told);
        one().recentred(&from, &to, &mut told);
        one().retract(&to, &mut told);
        assert!(angle_between(rotation(&told, 1), place) < 1e-9 && told[0] == 7.0);
    }

    /// By hand: from the unit quaternion to a quarter of a turn about z the world's x is the body's −y.
    #[test]
    fn what_is_fixed_in_the_world_turns_in_the_body() {
        let root = 0.5_f64.sqrt();
        let (from, to) = ([0.0, 1.0, 0.0, 0.0, 0.0], [0.0, root, 0.0, 0.0, root]);
        let mut column = [4.0, 0.0, 0.5, 0.0, 0.0];
        one().transport_in_world(&from, &to, &mut column, 1);
        one().as_vectors(&to, &mut column, 1);
        let off = column.iter().zip([4.0, 0.0, 0.0, -1.0, 0.0]);
        assert!(
            off.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < 1e-15,
            "{column:?}"
        );
    }

    /// ⊞ undoes ⊟, for steps of up to half a turn and whichever of the two quaternions stands for the rotation; what
    /// is carried over keeps its lengths, is tangent, and has the same vector of rotation.
    #[test]
    fn differences_are_undone_and_tangents_carried_over() {
        let from = [9.0, 0.1, -0.7, 0.5, 0.5].map(|x: f64| x);
        let mut from = from.to_vec();
        one().normalise(&mut from);
        for (k, sign) in [(0.01, 1.0), (1.0, -1.0), (3.1, 1.0)] {
            let vector = [0.6 * k, 0.0, -0.8 * k];
            let to = turned(rotation(&from, 1), vector);
            let mut x = vec![7.0];
            x.extend(to.map(|x| sign * x));
            let there = x.clone();
            one().flatten(&from, &mut x);
            let step: [f64; 4] = std::array::from_fn(|i| x[1 + i] - from[1 + i]);
            let found = times(conjugate(rotation(&from, 1)), step);
            for (found, expected) in found[1..].iter().zip(vector) {
                assert!((2.0 * found - expected).abs() < 1e-14, "{found} {expected}");
            }
            assert!(found[0].abs() < 1e-15 && x[0] == 7.0);
            let mut carried = vec![5.0];
            carried.extend(step);
            one().transport(&from, &there, &mut carried, 1);
            let same = times(conjugate(rotation(&there, 1)), rotation(&carried, 1));
            for (same, found) in same.iter().zip(found) {
                assert!((same - sign.powi(2) * found).abs() < 1e-14);
            }
            one().retract(&from, &mut x);
            let off = angle_between(rotation(&x, 1), to);
            assert!(off < 1e-14, "{off}");
        }
    }
}
