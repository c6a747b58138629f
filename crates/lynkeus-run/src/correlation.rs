//! Noises of sensors that go together.

use nalgebra::{DMatrix, SymmetricEigen};

/// Correlations of the noises of sensors, as what they have in common and what each has of its own.
#[derive(Clone, Debug, PartialEq)]
pub struct Correlation {
    /// of each sensor's variance the share that is its own
    own: Vec<f64>,
    /// G: of each sensor, in its deviations, what it has of each common noise
    common: Vec<Vec<f64>>,
}

impl Correlation {
    /// Of so many sensors, by the places of two and their correlation.
    ///
    /// # Errors
    /// The smallest eigenvalue of the matrix of correlations where it is not positive.
    pub fn new(sensors: usize, pairs: &[(usize, usize, f64)]) -> Result<Self, f64> {
        let mut own = vec![1.0; sensors];
        let mut common = vec![vec![]; sensors];
        for group in groups(sensors, pairs) {
            let matrix = matrix(&group, pairs);
            let SymmetricEigen {
                eigenvalues,
                eigenvectors,
            } = SymmetricEigen::new(matrix);
            let least = eigenvalues.min();
            if least.is_nan() || least <= ROUNDING {
                return Err(least);
            }
            for (mode, value) in eigenvalues.iter().enumerate() {
                if value - least <= ROUNDING {
                    continue;
                }
                common.iter_mut().for_each(|row| row.push(0.0));
                for (k, sensor) in group.iter().enumerate() {
                    let share = (value - least).sqrt() * eigenvectors[(k, mode)];
                    if let Some(place) = common[*sensor].last_mut() {
                        *place = share;
                    }
                }
            }
            group.iter().for_each(|sensor| own[*sensor] = least);
        }
        Ok(Self { own, common })
    }

    /// How many common noises there are.
    pub(crate) fn width(&self) -> usize {
        self.common.first().map_or(0, Vec::len)
    }

    /// The share of a sensor's variance that is its own.
    pub(crate) fn own(&self, sensor: usize) -> f64 {
        self.own[sensor]
    }

    /// What a sensor has of each common noise, in its deviations.
    pub(crate) fn common(&self, sensor: usize) -> &[f64] {
        &self.common[sensor]
    }
}

/// Eigenvalues of correlations below this are none.
const ROUNDING: f64 = 1e-12;

/// The matrix of the correlations of these sensors.
fn matrix(group: &[usize], pairs: &[(usize, usize, f64)]) -> DMatrix<f64> {
    let of = |a: usize, b: usize| {
        let is_own = |pair: &&(usize, usize, f64)| {
            (pair.0, pair.1) == (group[a], group[b]) || (pair.1, pair.0) == (group[a], group[b])
        };
        match a == b {
            true => 1.0,
            false => pairs.iter().find(is_own).map_or(0.0, |pair| pair.2),
        }
    };
    DMatrix::from_fn(group.len(), group.len(), of)
}

/// Sensors that pairs connect, in their order.
fn groups(sensors: usize, pairs: &[(usize, usize, f64)]) -> Vec<Vec<usize>> {
    let mut first: Vec<usize> = (0..sensors).collect();
    for _ in 0..sensors {
        for (a, b, _) in pairs {
            let least = first[*a].min(first[*b]);
            (first[*a], first[*b]) = (least, least);
        }
    }
    let of = |k: usize| (0..sensors).filter(|i| first[*i] == k).collect();
    let all = (0..sensors).map(of);
    all.filter(|group: &Vec<usize>| group.len() > 1).collect()
}

/// The lower factor of the matrix of such correlations of so many sensors, row by row.
pub(crate) fn factor(sensors: usize, pairs: &[(usize, usize, f64)]) -> Option<Vec<f64>> {
    let all: Vec<usize> = (0..sensors).collect();
    let lower = matrix(&all, pairs).cholesky()?.unpack();
    Some(
        lower
            .row_iter()
            .flat_map(|row| row.iter().copied().collect::<Vec<_>>())
            .collect(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(found: f64, expected: f64, what: &str) {
        assert!(
            (found - expected).abs() < 1e-12,
            "{what}: {found} {expected}"
        );
    }

    #[test]
    fn what_sensors_have_in_common_makes_their_correlations() {
        let pairs = [(0, 3, 0.6), (3, 1, -0.4), (0, 1, 0.1)];
        let Correlation { own, common } = Correlation::new(5, &pairs).unwrap();
        for i in 0..5 {
            for j in 0..5 {
                let both: f64 = common[i].iter().zip(&common[j]).map(|(a, b)| a * b).sum();
                let same =
                    |pair: &&(usize, usize, f64)| [(i, j), (j, i)].contains(&(pair.0, pair.1));
                let expected = match i == j {
                    true => 1.0 - own[i],
                    false => pairs.iter().find(same).map_or(0.0, |pair| pair.2),
                };
                close(both, expected, "correlation");
            }
        }
        // two alone need one common noise; one that nothing is said of has none
        assert_eq!((own[2], own[4]), (1.0, 1.0));
        assert_eq!(Correlation::new(2, &[(0, 1, 0.5)]).unwrap().width(), 1);
        // 1 + 0.9, 1 + 0.9, 1 − 1.8
        let impossible = [(0, 1, 0.9), (0, 2, 0.9), (1, 2, -0.9)];
        let least = Correlation::new(3, &impossible).unwrap_err();
        close(least, -0.8, "smallest eigenvalue");
        assert!(factor(3, &impossible).is_none());
        let lower = factor(2, &[(0, 1, 0.6)]).unwrap();
        for (found, expected) in lower.iter().zip([1.0, 0.0, 0.6, 0.8]) {
            close(*found, expected, "factor");
        }
    }
}
