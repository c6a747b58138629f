//! Square roots of covariances: P = S Sᵀ, matrices row by row.

use std::ops::Range;

/// A lower triangular root S of P, n × n. Whatever is done to S, S Sᵀ has no negative eigenvalue.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Root {
    pub n: usize,
    pub entries: Vec<f64>,
}

impl Root {
    /// Of a diagonal covariance.
    pub fn diagonal(variances: &[f64]) -> Self {
        let n = variances.len();
        let mut entries = vec![0.0; n * n];
        for (i, variance) in variances.iter().enumerate() {
            entries[i * n + i] = variance.sqrt();
        }
        Self { n, entries }
    }

    /// Row i of S.
    pub fn row(&self, i: usize) -> &[f64] {
        &self.entries[i * self.n..(i + 1) * self.n]
    }

    /// √P_ii.
    pub fn deviation(&self, i: usize) -> f64 {
        self.row(i).iter().map(|s| s * s).sum::<f64>().sqrt()
    }

    /// Sᵀc.
    pub fn transposed_times(&self, c: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        for (i, c) in c.iter().enumerate().filter(|(_, c)| **c != 0.0) {
            for (out, s) in out.iter_mut().zip(&self.row(i)[..=i]) {
                *out += c * s;
            }
        }
    }

    /// P v.
    pub fn covariance_times(&self, v: &[f64]) -> Vec<f64> {
        let mut half = vec![0.0; self.n];
        self.transposed_times(v, &mut half);
        (0..self.n)
            .map(|i| dot(&self.row(i)[..=i], &half[..=i]))
            .collect()
    }

    /// The last states are independent of all else, with variance 1.
    pub fn renew(&mut self, count: usize) {
        let first = self.n - count;
        for (i, row) in self
            .entries
            .chunks_exact_mut(self.n.max(1))
            .enumerate()
            .skip(first)
        {
            row.fill(0.0);
            row[i] = 1.0;
        }
    }

    /// The lower root of the same covariance, after rows of S were changed.
    pub fn restore(&mut self) {
        let n = self.n;
        let mut rows = vec![0.0; n * n];
        for (i, row) in self.entries.chunks_exact(n.max(1)).enumerate() {
            (0..n).for_each(|k| rows[k * n + i] = row[k]);
        }
        self.of_rows(&mut rows, &mut vec![]);
    }

    /// φ with φS = b; components along which P has no variance but this share of what the state has are 0.
    pub fn against(&self, b: &[f64], share: f64) -> Vec<f64> {
        let mut result = vec![0.0; self.n];
        let mut rest = b.to_vec();
        for k in (0..self.n).rev() {
            let row = &self.row(k)[..=k];
            if row[k] > 0.0 && (share == 0.0 || row[k] > share * self.deviation(k)) {
                result[k] = rest[k] / row[k];
            }
            for (rest, s) in rest.iter_mut().zip(row) {
                *rest -= result[k] * s;
            }
        }
        result
    }

    /// Carlson's update by one reading y = cᵀx + noise of variance `r`: S becomes the lower root
    /// of (I − k cᵀ) P (I − k cᵀ)ᵀ + r k kᵀ, and k is written to `gain`. `projected` is Sᵀc. False
    /// where neither the reading nor the estimate has any variance: there is no gain then.
    ///
    /// N. A. Carlson, "Fast triangular formulation of the square root filter", *AIAA Journal* 11
    /// (1973) 1259–1265, for a lower root: from the last column to the first.
    pub fn update(&mut self, projected: &[f64], r: f64, gain: &mut Vec<f64>) -> bool {
        let n = self.n;
        let variance = dot(projected, projected) + r;
        if variance.is_nan() || variance <= 0.0 {
            return false;
        }
        gain.clear();
        gain.resize(n, 0.0);
        let mut alpha = r;
        let mut root = r.sqrt();
        for (j, v) in projected.iter().enumerate().rev() {
            let before = alpha;
            alpha += v * v;
            let root_before = std::mem::replace(&mut root, alpha.sqrt());
            // what is left of the column, and what the later ones take
            let left = match alpha > 0.0 {
                true => (before / alpha).sqrt(),
                false => 1.0,
            };
            let taken = match before > 0.0 {
                true => v / (root_before * root),
                false => 0.0,
            };
            let column = self.entries[j * (n + 1)..].iter_mut().step_by(n);
            for (s, sum) in column.zip(&mut gain[j..]) {
                let own = *s;
                *s = own * left - *sum * taken;
                *sum += own * v;
            }
        }
        gain.iter_mut().for_each(|k| *k /= variance);
        true
    }

    /// The lower triangular root of AᵀA, for the rows A (each of n entries): what is left of A
    /// after Householder's reflections. The diagonal is not negative.
    pub fn of_rows(&mut self, rows: &mut [f64], room: &mut Reflector) {
        let n = self.n;
        triangularise(rows, n, room);
        self.entries.fill(0.0);
        for i in 0..n.min(rows.len() / n.max(1)) {
            let sign = if rows[i * n + i] < 0.0 { -1.0 } else { 1.0 };
            for j in i..n {
                self.entries[j * n + i] = sign * rows[i * n + j];
            }
        }
    }
}

/// Σ a_i b_i over the shorter of the two, in four partial sums, which processors add side by side.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let count = a.len().min(b.len());
    let (fours, rest) = a[..count].as_chunks::<4>();
    let (others, last) = b[..count].as_chunks::<4>();
    let mut sums = [0.0; 4];
    for (a, b) in fours.iter().zip(others) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += a * b;
        }
    }
    let tail: f64 = rest.iter().zip(last).map(|(a, b)| a * b).sum();
    sums[0] + sums[1] + sums[2] + sums[3] + tail
}

/// The entries of a reflector that are not 0, and where the rows that they change begin.
pub(crate) type Reflector = Vec<(usize, f64)>;

/// Reflections that make the first n rows of A upper triangular.
fn triangularise(rows: &mut [f64], n: usize, reflector: &mut Reflector) {
    let count = rows.len() / n.max(1);
    for k in 0..n.min(count) {
        let column = (k..count).map(|i| (i * n, rows[i * n + k]));
        reflector.clear();
        reflector.extend(column.filter(|(_, entry)| *entry != 0.0));
        // in units in which squares neither vanish nor overflow: what decays without noise comes
        // to any size, and must not spoil what it is correlated with
        let Some(unit) = unit(reflector.iter().map(|(_, entry)| *entry)) else {
            continue;
        };
        let over = 1.0 / unit;
        reflector.iter_mut().for_each(|(_, entry)| *entry *= over);
        let squares = reflector.iter().map(|(_, entry)| entry.powi(2));
        let norm = squares.sum::<f64>().sqrt();
        let pivot = rows[k * n + k] * over;
        let head = if pivot > 0.0 { -norm } else { norm };
        // v = (pivot − head, the rest), H = I − v vᵀ/β, β = −head·v₀
        let first = pivot - head;
        match reflector.first_mut() {
            Some((row, entry)) if *row == k * n => *entry = first,
            _ => reflector.insert(0, (k * n, first)),
        }
        reflect(rows, k + 1..n, reflector, -head * first);
        for (row, _) in &*reflector {
            rows[row + k] = 0.0;
        }
        rows[k * n + k] = head * unit;
    }
}

/// Takes v vᵀA/β from some columns of A, in blocks whose sums stay in registers.
fn reflect(rows: &mut [f64], columns: Range<usize>, reflector: &[(usize, f64)], beta: f64) {
    let mut first = columns.start;
    while columns.end - first >= 8 {
        reflect_block::<8>(rows, first, reflector, beta);
        first += 8;
    }
    let rest = columns.end - first;
    if rest & 4 > 0 {
        reflect_block::<4>(rows, first, reflector, beta);
        first += 4;
    }
    if rest & 2 > 0 {
        reflect_block::<2>(rows, first, reflector, beta);
        first += 2;
    }
    if rest & 1 > 0 {
        reflect_block::<1>(rows, first, reflector, beta);
    }
}

fn reflect_block<const W: usize>(
    rows: &mut [f64],
    first: usize,
    reflector: &[(usize, f64)],
    beta: f64,
) {
    let mut sums = [0.0; W];
    for (row, v) in reflector {
        let Some(block) = rows[row + first..].first_chunk::<W>() else {
            return;
        };
        for (sum, a) in sums.iter_mut().zip(block) {
            *sum += v * a;
        }
    }
    for (row, v) in reflector {
        let Some(block) = rows[row + first..].first_chunk_mut::<W>() else {
            return;
        };
        let factor = v / beta;
        for (a, sum) in block.iter_mut().zip(&sums) {
            *a -= factor * sum;
        }
    }
}

/// The power of two of the largest of some numbers; none where all are as good as zero.
fn unit(numbers: impl Iterator<Item = f64>) -> Option<f64> {
    const EXPONENT: u64 = 0x7ff << 52;
    // of magnitudes the bits are in order
    let largest = numbers.fold(0, |all, x| x.abs().to_bits().max(all));
    let power = f64::from_bits(largest & EXPONENT);
    (power > 0.0).then_some(power)
}

/// The largest size of some numbers; not a number where the last of them is none.
pub(crate) fn largest(numbers: impl Iterator<Item = f64>) -> f64 {
    numbers.fold(0.0, |m: f64, x| if x.abs() <= m { m } else { x.abs() })
}

/// Room for the factor of a matrix.
#[derive(Clone, Debug, Default)]
pub(crate) struct Factor {
    lower: Vec<f64>,
    /// where the entries of each row that are not 0 begin
    firsts: Vec<usize>,
}

impl Factor {
    /// The lower triangular factor of a matrix that has no negative eigenvalue but by rounding: a
    /// pivot that rounding cannot tell from zero has none. What is zero before the first entry of a
    /// row stays so, and costs nothing.
    pub fn of(&mut self, matrix: &[f64], n: usize) -> &[f64] {
        let Self { lower, firsts } = self;
        let first =
            |(i, row): (usize, &[f64])| row[..i].iter().position(|e| *e != 0.0).unwrap_or(i);
        firsts.clear();
        firsts.extend(matrix.chunks_exact(n.max(1)).enumerate().map(first));
        lower.clear();
        lower.resize(n * n, 0.0);
        for j in 0..n {
            // sums are grouped by columns, wherever a row begins
            let own = &lower[j * n + (firsts[j] & !3)..j * n + j];
            let pivot = matrix[j * n + j] - dot(own, own);
            let noise = n as f64 * f64::EPSILON * matrix[j * n + j].abs();
            if pivot.is_nan() || pivot <= noise {
                continue;
            }
            let root = pivot.sqrt();
            lower[j * n + j] = root;
            for i in j + 1..n {
                let begin = firsts[i].max(firsts[j]) & !3;
                if firsts[i] > j {
                    continue;
                }
                let [own, other] = [i, j].map(|k| &lower[k * n + begin..k * n + j]);
                let known = dot(own, other);
                lower[i * n + j] = (matrix[i * n + j] - known) / root;
            }
        }
        lower
    }
}

/// x with L Lᵀ x = b, in the place of b; components that L does not reach are 0.
pub(crate) fn substitute(lower: &[f64], m: usize, b: &mut [f64]) {
    let solved = |i: usize, rest: f64| match lower[i * m + i] {
        pivot if pivot > 0.0 => rest / pivot,
        _ => 0.0,
    };
    for i in 0..m {
        let known = dot(&lower[i * m..i * m + i], &b[..i]);
        b[i] = solved(i, b[i] - known);
    }
    for i in (0..m).rev() {
        let known: f64 = (i + 1..m).map(|j| lower[j * m + i] * b[j]).sum();
        b[i] = solved(i, b[i] - known);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn covariance(root: &Root) -> Vec<f64> {
        let n = root.n;
        (0..n * n)
            .map(|k| dot(root.row(k / n), root.row(k % n)))
            .collect()
    }

    fn close(a: &[f64], b: &[f64], tolerance: f64) {
        assert_eq!(a.len(), b.len());
        for (a, b) in a.iter().zip(b) {
            assert!((a - b).abs() <= tolerance, "{a} against {b}");
        }
    }

    #[test]
    fn rows_become_the_lower_root_of_their_sum_of_squares() {
        let rows = [1.0, 2.0, 0.5, -3.0, 0.0, 1.0, 2.0, 2.0, -1.0, 0.0, 0.0, 4.0];
        let expected: Vec<f64> = (0..9)
            .map(|k| {
                (0..4)
                    .map(|r| rows[r * 3 + k / 3] * rows[r * 3 + k % 3])
                    .sum()
            })
            .collect();
        let mut root = Root::diagonal(&[0.0; 3]);
        root.of_rows(&mut rows.clone(), &mut vec![]);
        close(&covariance(&root), &expected, 1e-13);
        assert!(
            (0..3).all(|i| root.row(i)[i] >= 0.0 && root.row(i)[i + 1..].iter().all(|s| *s == 0.0))
        );
        // fewer rows than columns: rank one
        let mut flat = Root::diagonal(&[0.0; 3]);
        flat.of_rows(&mut [1.0, 2.0, 3.0], &mut vec![]);
        close(
            &covariance(&flat),
            &[1.0, 2.0, 3.0, 2.0, 4.0, 6.0, 3.0, 6.0, 9.0],
            1e-14,
        );
    }

    /// What has decayed to any size takes nothing from what it is correlated with.
    #[test]
    fn tiny_and_huge_columns_leave_the_others_alone() {
        for exponent in -1080..=1000 {
            let tiny = 1.3 * 2.0_f64.powi(exponent);
            let mut root = Root::diagonal(&[0.0; 2]);
            root.of_rows(&mut [tiny, 0.6, 0.5 * tiny, 1.2, 0.0, 0.7], &mut vec![]);
            let found = root.deviation(1).powi(2);
            assert!((found - 2.29).abs() < 1e-14, "{found} beside {tiny:e}");
        }
    }

    /// Against P − P c cᵀ P/(cᵀPc + r), by hand for P = [[2, 1], [1, 3]], c = (1, 0), r = 2.
    #[test]
    fn a_reading_takes_what_the_formula_says() {
        let mut root = Root::diagonal(&[0.0; 2]);
        root.entries = Factor::default().of(&[2.0, 1.0, 1.0, 3.0], 2).to_vec();
        let mut projected = [0.0; 2];
        root.transposed_times(&[1.0, 0.0], &mut projected);
        let mut gain = vec![];
        assert!(root.update(&projected, 2.0, &mut gain));
        close(&gain, &[0.5, 0.25], 1e-15);
        close(&covariance(&root), &[1.0, 0.5, 0.5, 2.75], 1e-15);
        // a perfect reading leaves no variance, and a second one has nothing to say
        root.transposed_times(&[1.0, 0.0], &mut projected);
        assert!(root.update(&projected, 0.0, &mut gain));
        assert!(root.deviation(0) < 1e-15);
    }

    #[test]
    fn rows_are_divided_by_the_root() {
        let mut root = Root::diagonal(&[4.0, 9.0]);
        root.entries[2] = 1.0;
        // (5, 7) [[2, 0], [1, 3]] = (17, 21)
        close(&root.against(&[17.0, 21.0], 0.0), &[5.0, 7.0], 1e-15);
        assert_eq!(Root::diagonal(&[0.0]).against(&[0.0], 0.0), [0.0]);
    }

    #[test]
    fn what_has_no_variance_gives_no_gain() {
        let mut root = Root::diagonal(&[0.0, 1.0]);
        assert!(!root.update(&[0.0, 0.0], 0.0, &mut vec![]));
        assert_eq!(root.deviation(1), 1.0);
    }

    #[test]
    fn a_semidefinite_matrix_has_a_factor() {
        let v = [3.0, 0.0, -2.0];
        let matrix: Vec<f64> = (0..9).map(|k| v[k / 3] * v[k % 3]).collect();
        let mut factor = Factor::default();
        let lower = factor.of(&matrix, 3);
        for (k, entry) in matrix.iter().enumerate() {
            let (i, j) = (k / 3, k % 3);
            let found = dot(&lower[3 * i..3 * i + 3], &lower[3 * j..3 * j + 3]);
            assert!((found - entry).abs() <= 1e-14, "{found} against {entry}");
        }
    }
}
