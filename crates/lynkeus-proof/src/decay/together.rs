//! Decay of e' = A(ξ) e where the entries of A are known together at every ξ of a box: one P for all of them,
//! checked part by part.
//!
//! By the mean value theorem the error of x' = f(x) obeys e' = Ā e, where Ā is the mean of f's Jacobian A over the
//! segment from x to x̂. For one P the inequality He(P A) + 2·rate·P < 0 holds of a mean if it holds of everything that
//! the mean is of: of A(ξ) at every ξ of a convex box. Slopes with ranges of their own
//! ([`ErrorModel`]) would have to be at their worst independently of each other; of x₁x₂ the slopes x₂ and x₁ are
//! at every point what they are there.

use lynkeus_expr::{Budget, Interval};
use nalgebra::DMatrix;

use super::check::is_form;
use super::{ErrorModel, Proof, prove};
use crate::definite::is_positive_definite;
use crate::matrix::{IntervalMatrix, points, product, square};

/// Parts of the box that are examined for one P, at most, and for all of a search.
pub(super) const PARTS: usize = 12_000;
const ALL_PARTS: usize = 32_000;
/// The same until it is given up that a decay can be faster than one that is known.
pub(super) const FIRST_PARTS: usize = 6_000;
/// Numbers of which every combination of ends is examined on a part.
const ENDS: usize = 6;
/// Corners of the box that P is sought for at first, at most.
const CORNERS: usize = 64;
/// Points that are added to them, at most.
const ADDED: usize = 40;
/// P is sought for rates faster by these shares of the limit, so that it is left a margin.
const MARGINS: [f64; 3] = [0.4, 0.12, 0.03];
/// The rate is found to this relative accuracy.
const ACCURACY: f64 = 0.03;
/// Rates below this share of the limit count as none.
const NEGLIGIBLE: f64 = 1e-3;

/// What encloses something on a part of a box.
type Enclosed<'a, T> = &'a dyn Fn(&[Interval]) -> T;

/// A as a function of a point of a box.
pub struct Field<'a> {
    /// encloses A on a part of the box
    pub on: Enclosed<'a, IntervalMatrix>,
    /// encloses the derivatives of A in each number there; none where A may jump
    pub slopes: Option<Enclosed<'a, Vec<IntervalMatrix>>>,
    /// the box
    pub sides: Vec<Interval>,
}

/// Whether the inequality holds on a box.
#[derive(Clone, Debug, PartialEq)]
pub enum Covered {
    /// on so many parts, and so on all of it
    By(usize),
    /// not, or not provably, at this point
    Not(Vec<f64>),
    /// too many parts, or the budget is spent
    Unknown,
}

/// A Lyapunov function eᵀPe with V' ≤ −2·rate·V.
#[derive(Clone, Debug, PartialEq)]
pub struct Together {
    /// P, without multipliers
    pub proof: Proof,
    /// parts into which the box is divided
    pub parts: usize,
}

/// Whether P > 0 and He(P A(ξ)) + 2·rate·P < 0 for every ξ of the box. Nothing but P, the rate and
/// interval arithmetic decides.
pub fn holds_together(field: &Field<'_>, P: &DMatrix<f64>, rate: f64, budget: &Budget) -> Covered {
    let mut left = PARTS;
    covered(field, Form::new(P, rate), &mut left, budget)
}

/// The same of a form that may change, with so many parts left to examine.
pub(super) fn covered(
    field: &Field<'_>,
    form: Option<Form>,
    left: &mut usize,
    budget: &Budget,
) -> Covered {
    let mut cover = Cover::new(field);
    // no other form follows
    cover.room = 0;
    cover.by(form, left, budget)
}

/// Entries of matrices that the parts of a cover keep together: some 50 MB.
const ROOM: usize = 2_000_000;

/// A box in parts: those that one form needed, from which another one goes on.
pub(super) struct Cover<'a> {
    field: &'a Field<'a>,
    parts: Vec<Part>,
    /// entries that these may still keep
    room: usize,
}

/// A part of a box with A on it, as far as it was asked about and there is room.
struct Part {
    sides: Vec<Interval>,
    whole: Option<IntervalMatrix>,
    center: Option<IntervalMatrix>,
    along: Option<Vec<IntervalMatrix>>,
    /// whether the last form fell there for its tangent plane, and not for all of its range
    by_plane: bool,
}

impl Part {
    fn new(sides: Vec<Interval>) -> Self {
        Self {
            sides,
            whole: None,
            center: None,
            along: None,
            by_plane: false,
        }
    }

    fn entries(&self) -> usize {
        let matrices = self.whole.iter().chain(&self.center);
        let matrices = matrices.chain(self.along.iter().flatten());
        matrices.map(|matrix| matrix.len() * matrix.len()).sum()
    }

    fn falls(&mut self, form: &Form, field: &Field<'_>) -> bool {
        form.falls(self.whole.get_or_insert_with(|| (field.on)(&self.sides)))
    }

    fn center(&mut self, field: &Field<'_>) -> &IntervalMatrix {
        let sides = &self.sides;
        self.center
            .get_or_insert_with(|| (field.on)(&points_of(&middle(sides))))
    }

    fn falls_along(&mut self, form: &Form, field: &Field<'_>) -> bool {
        let Some(slopes) = field.slopes else {
            return false;
        };
        self.center(field);
        let along = self.along.get_or_insert_with(|| slopes(&self.sides));
        let center = self.center.as_ref();
        center.is_some_and(|center| form.falls_along(center, along, &self.sides))
    }
}

impl<'a> Cover<'a> {
    pub fn new(field: &'a Field<'a>) -> Self {
        Self {
            field,
            parts: vec![Part::new(field.sides.clone())],
            room: ROOM,
        }
    }

    /// Keeps a part on which a form fell, with what decided that.
    fn keep(&mut self, mut part: Part) {
        if part.by_plane {
            part.whole = None;
        } else {
            (part.center, part.along) = (None, None);
        }
        match self.room.checked_sub(part.entries()) {
            Some(left) => self.room = left,
            None => (part.whole, part.center, part.along) = (None, None, None),
        }
        self.parts.push(part);
    }

    /// Whether a form falls everywhere, with so many parts left to examine. Where it does not, there is no telling what
    /// is left of the cover.
    pub fn by(&mut self, form: Option<Form>, left: &mut usize, budget: &Budget) -> Covered {
        let field = self.field;
        let Some(form) = form else {
            return Covered::Not(middle(&field.sides));
        };
        let mut open = std::mem::take(&mut self.parts);
        let least = left.saturating_sub(PARTS);
        while let Some(mut part) = open.pop() {
            if *left == least || budget.spent().is_some() {
                return Covered::Unknown;
            }
            *left -= 1;
            self.room += part.entries();
            let was_by_plane = part.by_plane;
            if was_by_plane && part.falls_along(&form, field) {
                self.keep(part);
                continue;
            }
            part.by_plane = false;
            if part.falls(&form, field) {
                self.keep(part);
                continue;
            }
            if !form.falls(part.center(field)) {
                return Covered::Not(middle(&part.sides));
            }
            if !was_by_plane && part.falls_along(&form, field) {
                part.by_plane = true;
                self.keep(part);
                continue;
            }
            match form.halves(field, &part.sides) {
                Some(halves) => open.extend(halves.map(Part::new)),
                None => return Covered::Not(middle(&part.sides)),
            }
        }
        Covered::By(self.parts.len())
    }
}

fn middle(part: &[Interval]) -> Vec<f64> {
    part.iter().map(|side| side.midpoint()).collect()
}

/// A in the middle of the box.
pub(super) fn in_the_middle(field: &Field<'_>) -> IntervalMatrix {
    (field.on)(&points_of(&middle(&field.sides)))
}

pub(super) fn points_of(point: &[f64]) -> Vec<Interval> {
    point.iter().map(|&x| Interval::point(x)).collect()
}

/// Adds a row so many times.
fn add(sums: &mut [Interval], times: Interval, row: &[Interval]) {
    for (sum, entry) in sums.iter_mut().zip(row) {
        if *entry != Interval::ZERO {
            *sum = *sum + times * *entry;
        }
    }
}

/// D + He(L A R) in axes T in which it is about −1: for an invertible T it is negative definite there where it is so in
/// axes of its own, and for another one nowhere. For V = eᵀPe it is P' + He(P A) + 2·rate·P.
pub(super) struct Form {
    /// TᵀL and RT
    sides: [IntervalMatrix; 2],
    /// TᵀDT
    decay: IntervalMatrix,
    /// how much an entry of A counts for: the lengths of the columns of TᵀL and of the rows of RT
    weights: [Vec<f64>; 2],
}

impl Form {
    fn new(P: &DMatrix<f64>, rate: f64) -> Option<Self> {
        Self::changing(P, &square(P.nrows(), |_, _| Interval::ZERO), rate)
    }

    /// Of a P that changes at so much per unit of time.
    pub fn changing(P: &DMatrix<f64>, change: &IntervalMatrix, rate: f64) -> Option<Self> {
        let sound = is_form(P) && rate.is_finite() && is_positive_definite(&points(P));
        let T = sound.then(|| P.clone().cholesky()?.l().transpose().try_inverse())??;
        let (n, twice) = (P.nrows(), Interval::point(2.0) * Interval::point(rate));
        let decay = square(n, |i, j| change[i][j] + twice * Interval::point(P[(i, j)]));
        Some(Self::of([P, &DMatrix::identity(n, n)], &decay, &T))
    }

    /// Of L, R, D and T.
    pub fn of([L, R]: [&DMatrix<f64>; 2], decay: &IntervalMatrix, T: &DMatrix<f64>) -> Self {
        let [left, right, transposed] = [L, R, &T.transpose()].map(points);
        let T = points(T);
        let sides = [product(&transposed, &left), product(&right, &T)];
        let length = |entries: &mut dyn Iterator<Item = &Interval>| {
            let squares = entries.map(|entry| entry.midpoint().powi(2));
            squares.sum::<f64>().sqrt()
        };
        let column = |j: usize| length(&mut sides[0].iter().map(|row| &row[j]));
        Self {
            decay: product(&product(&transposed, decay), &T),
            weights: [
                (0..L.ncols()).map(column).collect(),
                sides[1].iter().map(|row| length(&mut row.iter())).collect(),
            ],
            sides,
        }
    }

    /// The lower triangle of −He(TᵀLART) less another form. Entries that are 0 count for nothing: what has no value
    /// anywhere in A comes with every row of TᵀL and with an entry of RT that is not 0.
    fn lower(&self, A: &IntervalMatrix, less: Option<&IntervalMatrix>) -> IntervalMatrix {
        let [left, right] = &self.sides;
        let n = A.len();
        let of = |i: usize, j: usize| less.map_or(Interval::ZERO, |less| -less[i][j]);
        let mut lower: IntervalMatrix = (0..n)
            .map(|i| (0..=i).map(|j| of(i, j)).collect())
            .collect();
        let mut along = vec![Interval::ZERO; n];
        for (i, weights) in left.iter().enumerate() {
            along.fill(Interval::ZERO);
            for (weight, row) in weights.iter().zip(A) {
                add(&mut along, *weight, row);
            }
            for (middle, row) in along.iter().zip(right) {
                if *middle == Interval::ZERO {
                    continue;
                }
                for (j, entry) in row.iter().enumerate().filter(|e| *e.1 != Interval::ZERO) {
                    let term = *middle * *entry;
                    let at = &mut lower[i.max(j)][i.min(j)];
                    *at = *at - term;
                    if i == j {
                        *at = *at - term;
                    }
                }
            }
        }
        lower
    }

    /// Whether it is negative definite for every A between these.
    fn falls(&self, A: &IntervalMatrix) -> bool {
        is_positive_definite(&self.lower(A, Some(&self.decay)))
    }

    /// Whether it is so for every A on a part, from A in its middle and A's derivatives on all of it:
    /// A = A₀ + Σ δ_k (D_k + R_k), where |δ_k| is at most half of a side, D_k is a number and R_k what is left. It is
    /// affine in the δ_k of the D_k, so that their ends decide.
    fn falls_along(
        &self,
        center: &IntervalMatrix,
        slopes: &[IntervalMatrix],
        part: &[Interval],
    ) -> bool {
        let n = center.len();
        let around = |side: &Interval| *side - Interval::point(side.midpoint());
        let mut reach: Vec<(f64, usize)> = (0..part.len())
            .map(|k| {
                (
                    around(&part[k]).magnitude()
                        * self.weighed(&slopes[k], |slope| slope.magnitude()),
                    k,
                )
            })
            .filter(|(size, _)| *size != 0.0)
            .collect();
        reach.sort_by(|a, b| b.0.total_cmp(&a.0));
        let ends: Vec<usize> = reach.iter().take(ENDS).map(|r| r.1).collect();
        let mut rest = center.clone();
        for (k, side) in part.iter().enumerate() {
            let δ = around(side);
            for i in 0..n {
                for j in 0..n {
                    let slope = slopes[k][i][j];
                    if slope == Interval::ZERO {
                        continue;
                    }
                    let own = match ends.contains(&k) {
                        true => slope - Interval::point(slope.midpoint()),
                        false => slope,
                    };
                    rest[i][j] = rest[i][j] + δ * own;
                }
            }
        }
        let whole = self.lower(&rest, Some(&self.decay));
        let along: Vec<(Interval, IntervalMatrix)> = ends
            .iter()
            .map(|&k| {
                let plane = square(n, |i, j| Interval::point(slopes[k][i][j].midpoint()));
                (around(&part[k]), self.lower(&plane, None))
            })
            .collect();
        (0..1_usize << along.len()).all(|choice| {
            let mut rows = whole.clone();
            for (bit, (δ, plane)) in along.iter().enumerate() {
                let end = Interval::point(if choice >> bit & 1 == 0 {
                    δ.lo()
                } else {
                    δ.hi()
                });
                for (row, plane) in rows.iter_mut().zip(plane) {
                    add(row, end, plane);
                }
            }
            is_positive_definite(&rows)
        })
    }

    /// The part cut in two where that helps most; none where it cannot be cut.
    fn halves(&self, field: &Field<'_>, part: &[Interval]) -> Option<[Vec<Interval>; 2]> {
        let cut = |side: usize| {
            let (whole, middle) = (part[side], part[side].midpoint());
            let is_inner = whole.lo() < middle && middle < whole.hi();
            let halves = [(whole.lo(), middle), (middle, whole.hi())];
            let [low, high] = halves.map(|(lo, hi)| {
                let mut half = part.to_vec();
                half[side] = Interval::new(lo, hi).ok()?;
                Some(half)
            });
            Some([low?, high?]).filter(|_| is_inner)
        };
        let narrowed = (0..part.len()).filter_map(|side| {
            let halves = cut(side)?;
            Some((self.spread(field, &halves[0]), halves))
        });
        let least = narrowed.min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(least.1)
    }

    /// How far A goes on a part, or where it has derivatives how far from a plane.
    fn spread(&self, field: &Field<'_>, part: &[Interval]) -> f64 {
        let Some(slopes) = field.slopes else {
            return self.weighed(&(field.on)(part), |entry| entry.width());
        };
        let each = slopes(part).into_iter().zip(part);
        each.map(|(slope, side)| side.width() * self.weighed(&slope, |slope| slope.width()))
            .sum()
    }

    /// The sum of what entries have, as they count.
    fn weighed(&self, A: &IntervalMatrix, size: impl Fn(&Interval) -> f64) -> f64 {
        let [rows, columns] = &self.weights;
        let mut sum = 0.0;
        for (row, weight) in A.iter().zip(rows) {
            for (entry, column) in row.iter().zip(columns) {
                sum += size(entry) * weight * column;
            }
        }
        sum
    }
}

/// The middle of a box and corners of it: of many some, spread.
pub(super) fn first_points(sides: &[Interval], count: usize) -> Vec<Vec<f64>> {
    let mut found = vec![middle(sides)];
    let widths = sides.iter().map(|side| side.lo() < side.hi());
    let wide: Vec<usize> = widths.enumerate().filter(|w| w.1).map(|w| w.0).collect();
    let all = 1_usize.checked_shl(wide.len() as u32).unwrap_or(usize::MAX);
    let corners = count.saturating_sub(1).max(1);
    let stride = (all / corners).max(1) | 1;
    for k in 0..all.min(corners) {
        let corner = k.wrapping_mul(stride);
        let mut point = found[0].clone();
        for (bit, &side) in wide.iter().enumerate() {
            let ends = sides[side];
            point[side] = match corner >> bit & 1 {
                0 => ends.lo(),
                _ => ends.hi(),
            };
        }
        found.push(point);
    }
    found
}

/// What is sought for a field: a form that falls, proposed for some points and decided on the whole box.
pub(super) trait Sought {
    /// what makes a form
    type Found;

    /// Something that falls at a rate for these A, as far as numbers tell.
    fn propose(&self, points: &[IntervalMatrix], rate: f64, budget: &Budget)
    -> Option<Self::Found>;

    /// Its form at a rate; none where it has none. A is one of the points.
    fn form(&self, found: &Self::Found, rate: f64, A: &IntervalMatrix) -> Option<Form>;
}

/// Proofs for a field, from the points that earlier ones failed at.
pub(super) struct Search<'a, S> {
    field: &'a Field<'a>,
    sought: S,
    budget: &'a Budget,
    /// A at points of the box, in its middle first
    points: Vec<IntervalMatrix>,
    /// parts that may be examined, and that still may be
    all: usize,
    left: usize,
}

/// What falls on a box, at which rate, and on how many parts.
pub(super) type Fallen<T> = (T, f64, usize);

impl<'a, S: Sought> Search<'a, S> {
    /// A search that examines so many parts.
    pub fn new(field: &'a Field<'a>, sought: S, parts: usize, budget: &'a Budget) -> Self {
        let mut search = Self {
            field,
            sought,
            budget,
            points: vec![],
            all: parts,
            left: parts,
        };
        for point in first_points(&field.sides, CORNERS + 1) {
            search.add(&point);
        }
        search
    }

    /// A at the points that counted.
    pub fn points(&self) -> &[IntervalMatrix] {
        &self.points
    }

    /// Whether A has a value there, and another one than at the points before.
    fn add(&mut self, point: &[f64]) -> bool {
        let A = (self.field.on)(&points_of(point));
        let is_bounded = A.iter().flatten().all(|entry| entry.is_bounded());
        let is_new = is_bounded && !self.points.contains(&A);
        if is_new {
            self.points.push(A);
        }
        is_new
    }

    /// A proof at a rate, from what falls faster. Nothing decays faster than `limit`.
    pub fn prove(&mut self, rate: f64, limit: f64) -> Option<Fallen<S::Found>> {
        let mut faster = MARGINS.iter().map(|share| rate + share * limit);
        faster.find_map(|faster| self.prove_by(rate, faster))
    }

    fn prove_by(&mut self, rate: f64, faster: f64) -> Option<Fallen<S::Found>> {
        for _ in 0..ADDED {
            if self.left == 0 {
                return None;
            }
            let found = self.sought.propose(&self.points, faster, self.budget)?;
            let form = self.sought.form(&found, rate, self.points.first()?);
            match covered(self.field, form, &mut self.left, self.budget) {
                Covered::By(parts) => return Some((found, rate, parts)),
                Covered::Not(point) => {
                    if !self.add(&point) {
                        return None;
                    }
                }
                Covered::Unknown => return None,
            }
        }
        None
    }

    /// The fastest decay from a rate up to `limit` that is proved, by bisection; none where nothing that fast is.
    pub fn fastest(&mut self, least: f64, limit: f64) -> Option<Fallen<S::Found>> {
        if least > 0.0 {
            self.left = FIRST_PARTS.min(self.all);
        }
        let mut best = self.prove(least.max(NEGLIGIBLE * limit), limit)?;
        self.left = self.all;
        let mut high = limit;
        while best.1 < high * (1.0 - ACCURACY) && self.budget.spent().is_none() {
            let rate = match best.1 < 0.1 * high {
                true => (best.1 * high).sqrt(),
                false => f64::midpoint(best.1, high),
            };
            match self.prove(rate, limit) {
                Some(found) => best = found,
                None => high = rate,
            }
        }
        Some(best)
    }
}

/// V = eᵀPe for states of such sizes.
struct OneForm<'a>(&'a [f64]);

impl Sought for OneForm<'_> {
    type Found = DMatrix<f64>;

    fn propose(
        &self,
        points: &[IntervalMatrix],
        rate: f64,
        budget: &Budget,
    ) -> Option<Self::Found> {
        let model = |A: &IntervalMatrix| ErrorModel {
            constant: A.clone(),
            sectors: vec![],
        };
        let models: Vec<ErrorModel> = points.iter().map(model).collect();
        prove(&models, self.0, rate, budget).map(|proof| proof.P)
    }

    fn form(&self, P: &Self::Found, rate: f64, _: &IntervalMatrix) -> Option<Form> {
        Form::new(P, rate)
    }
}

impl From<Fallen<DMatrix<f64>>> for Together {
    fn from((P, rate, parts): Fallen<DMatrix<f64>>) -> Self {
        let multipliers = vec![];
        let proof = Proof {
            rate,
            P,
            multipliers,
        };
        Self { proof, parts }
    }
}

/// A proof of decay at `rate` on the box; none where none is found. Nothing decays faster than `limit`.
pub fn prove_together(
    field: &Field<'_>,
    scale: &[f64],
    (rate, limit): (f64, f64),
    budget: &Budget,
) -> Option<Together> {
    let mut search = Search::new(field, OneForm(scale), ALL_PARTS, budget);
    search.prove(rate, limit).map(Together::from)
}

/// The fastest decay from a rate up to `limit` that is proved on the box, by bisection; none where nothing that fast is.
pub fn fastest_together(
    field: &Field<'_>,
    scale: &[f64],
    (least, limit): (f64, f64),
    budget: &Budget,
) -> Option<Together> {
    let mut search = Search::new(field, OneForm(scale), ALL_PARTS, budget);
    search.fastest(least, limit).map(Together::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn side(low: f64, high: f64) -> Interval {
        Interval::new(low, high).unwrap()
    }

    /// e₁' = −e₁ + x e₂, e₂' = −x e₁ − e₂: of independent entries no P serves for |x| ≤ 5, but whatever x is, |e|² falls.
    fn turning(part: &[Interval]) -> IntervalMatrix {
        let x = part[0];
        vec![vec![-Interval::ONE, x], vec![-x, -Interval::ONE]]
    }

    #[test]
    fn what_turns_either_way_decays_by_its_own_damping() {
        let field = Field {
            on: &turning,
            slopes: None,
            sides: vec![side(-5.0, 5.0)],
        };
        let budget = Budget::default();
        let found = fastest_together(&field, &[1.0, 1.0], (0.0, 1.0), &budget).unwrap();
        assert!(
            found.proof.rate > (1.0 - ACCURACY) * (1.0 - 0.03),
            "{found:?}"
        );
        let P = &found.proof.P;
        assert!((P[(0, 0)] - P[(1, 1)]).abs() < 0.2 * P[(0, 0)], "{P}");
        assert_eq!(
            holds_together(&field, P, found.proof.rate, &budget),
            Covered::By(found.parts)
        );
        // nothing decays faster than the trace says
        assert!(matches!(
            holds_together(&field, P, 1.01, &budget),
            Covered::Not(_)
        ));
        assert_eq!(
            prove_together(&field, &[1.0, 1.0], (1.01, 1.0), &budget),
            None
        );
    }

    /// The same matrices as two slopes that do not know of each other.
    #[test]
    fn apart_the_slopes_are_too_many() {
        let sector = |column: usize, row: usize| {
            let mut direction = vec![Interval::ZERO; 2];
            direction[row] = Interval::ONE;
            super::super::Sector {
                column,
                direction,
                range: side(-5.0, 5.0),
            }
        };
        let constant = square(2, |i, j| {
            if i == j {
                -Interval::ONE
            } else {
                Interval::ZERO
            }
        });
        let model = ErrorModel {
            constant,
            sectors: vec![sector(1, 0), sector(0, 1)],
        };
        assert_eq!(prove(&[model], &[1.0, 1.0], 0.0, &Budget::default()), None);
    }

    /// A place where A is unstable is found however small it is beside the box, or at least nothing is said to hold.
    #[test]
    fn a_narrow_peak_is_not_passed_over() {
        for place in [0.123_456, -3.3, 7.999] {
            let peak = |part: &[Interval]| {
                let away = (part[0] - Interval::point(place)) * Interval::point(200.0);
                let bump = Interval::point(2.0) / (Interval::ONE + away.powi(2));
                vec![vec![bump - Interval::ONE]]
            };
            let field = Field {
                on: &peak,
                slopes: None,
                sides: vec![side(-8.0, 8.0)],
            };
            let P = DMatrix::identity(1, 1);
            let found = holds_together(&field, &P, 0.0, &Budget::default());
            assert!(!matches!(found, Covered::By(_)), "{place}: {found:?}");
        }
    }

    #[test]
    fn a_form_that_is_none_holds_nowhere() {
        let field = Field {
            on: &turning,
            slopes: None,
            sides: vec![side(-1.0, 1.0)],
        };
        for P in [
            DMatrix::from_row_slice(2, 2, &[1.0, 2.0, 2.0, 1.0]),
            DMatrix::from_row_slice(2, 2, &[1.0, 0.1, 0.0, 1.0]),
            DMatrix::from_row_slice(2, 2, &[f64::NAN, 0.0, 0.0, 1.0]),
        ] {
            let found = holds_together(&field, &P, 0.1, &Budget::default());
            assert!(matches!(found, Covered::Not(_)), "{P}");
        }
        let open = Field {
            on: &turning,
            slopes: None,
            sides: vec![Interval::ENTIRE],
        };
        let found = holds_together(&open, &DMatrix::identity(2, 2), 0.1, &Budget::default());
        assert!(!matches!(found, Covered::By(_)));
    }
}
