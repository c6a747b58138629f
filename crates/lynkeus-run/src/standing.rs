//! Where an observer stands, by name: what another one, with other numbers, goes on from.

use crate::filter::root::Root;
use crate::{Error, Result};

/// Where an observer stands at a time, as [`Estimator::standing`](crate::Estimator::standing) says it and
/// [`Estimator::resume`](crate::Estimator::resume) of another observer with the same states takes it.
#[derive(Clone, Debug, PartialEq)]
pub struct Standing {
    /// of the last sample or prediction
    pub time: f64,
    /// known inputs by name, with the values that hold
    pub inputs: Vec<(String, f64)>,
    /// states by name
    pub states: Vec<(String, f64)>,
    /// so many of them, the first, are those that another observer has to have, too: the others are what was read, and
    /// what every row draws anew
    pub own: usize,
    /// what is known of their errors
    pub errors: Errors,
    /// what is estimated by name, monitors last
    pub estimates: Vec<(String, f64)>,
}

/// What is known of the errors of some states.
#[derive(Clone, Debug, PartialEq)]
pub enum Errors {
    /// nobody follows them
    Unknown,
    /// a lower triangular root S of their covariance, S Sᵀ, row by row
    Root(Vec<f64>),
    /// particles stand for the states
    Particles {
        /// the states of each, one after the other
        x: Vec<f64>,
        /// the logarithms of their weights
        log: Vec<f64>,
        /// rounds of random numbers so far
        round: u64,
    },
}

/// What a runner says of itself.
#[derive(Debug)]
pub(crate) struct Stand<'a> {
    pub names: &'a [String],
    pub own: usize,
    pub x: &'a [f64],
    pub errors: Errors,
}

impl Standing {
    /// By state of an observer with these names, of which the first `own` have to be there, the place of what stands
    /// here.
    ///
    /// # Errors
    /// [`Error::Setting`]: other states.
    pub(crate) fn places(&self, names: &[String], own: usize) -> Result<Vec<Option<usize>>> {
        let needed = names.get(..own).unwrap_or(names);
        let there = |name: &String| self.states.iter().position(|(known, _)| known == name);
        let stands = self.states.iter().take(self.own);
        let is_whole = needed.iter().all(|name| there(name).is_some())
            && stands.clone().all(|(known, _)| needed.contains(known));
        if !is_whole {
            let found: Vec<&str> = stands.map(|(name, _)| name.as_str()).collect();
            return Err(Error::setting(
                "the states that are taken over",
                needed.join(", "),
                found.join(", "),
            ));
        }
        Ok(names.iter().map(there).collect())
    }

    /// The values of states at their places; what is not there stays.
    pub(crate) fn fill(&self, places: &[Option<usize>], x: &mut [f64]) {
        for (x, place) in x.iter_mut().zip(places) {
            if let Some((_, value)) = place.and_then(|place| self.states.get(place)) {
                *x = *value;
            }
        }
    }

    /// The covariance of states at their places; a state that is not there has its own variance, and is independent.
    ///
    /// # Errors
    /// [`Error::Setting`]: the root is none of so many states.
    pub(crate) fn fill_root(&self, places: &[Option<usize>], root: &mut Root) -> Result<()> {
        let Errors::Root(entries) = &self.errors else {
            return Ok(());
        };
        let (m, n) = (self.states.len(), root.n);
        if entries.len() != m * m {
            let expected = format!("{m} × {m}");
            return Err(Error::setting("entries of a root", expected, entries.len()));
        }
        // the rows of Aᵀ with S' = A, whose columns are those of S and then one for each state that is not there
        let mut rows = vec![0.0; (m + n) * n];
        for (i, place) in places.iter().enumerate() {
            match place {
                Some(place) => {
                    let own = entries[place * m..][..m].iter().enumerate();
                    own.for_each(|(k, s)| rows[k * n + i] = *s);
                }
                None => rows[(m + i) * n + i] = root.deviation(i),
            }
        }
        let is_lower = places.iter().enumerate().all(|(i, p)| *p == Some(i)) && m == n;
        match is_lower {
            // to the bit
            true => root.entries.clone_from(entries),
            false => root.of_rows(&mut rows, &mut vec![]),
        }
        Ok(())
    }
}

/// Errors that are known in another way.
pub(crate) fn other_errors(expected: &str, found: &str) -> Error {
    Error::setting("the errors that are taken over", expected, found)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn standing() -> Standing {
        Standing {
            time: 0.0,
            inputs: vec![],
            states: vec![("a".into(), 1.0), ("b".into(), 2.0), ("w".into(), 3.0)],
            own: 2,
            // S Sᵀ = [4 2 6; 2 10 9; 6 9 14]
            errors: Errors::Root(vec![2.0, 0.0, 0.0, 1.0, 3.0, 0.0, 3.0, 2.0, 1.0]),
            estimates: vec![],
        }
    }

    fn names(names: &[&str]) -> Vec<String> {
        names.iter().map(|name| (*name).to_owned()).collect()
    }

    #[test]
    fn a_covariance_is_taken_over_by_name() {
        let standing = standing();
        let places = standing.places(&names(&["b", "a", "v"]), 2).unwrap();
        assert_eq!(places, [Some(1), Some(0), None]);
        let mut x = [0.0; 3];
        standing.fill(&places, &mut x);
        assert_eq!(x, [2.0, 1.0, 0.0]);
        let mut root = Root::diagonal(&[1.0, 1.0, 25.0]);
        standing.fill_root(&places, &mut root).unwrap();
        let covariance: Vec<f64> = (0..3)
            .flat_map(|j| {
                let unit: Vec<f64> = (0..3).map(|i| f64::from(u8::from(i == j))).collect();
                root.covariance_times(&unit)
            })
            .collect();
        let expected = [10.0, 2.0, 0.0, 2.0, 4.0, 0.0, 0.0, 0.0, 25.0];
        for (found, expected) in covariance.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{covariance:?}");
        }
    }

    #[test]
    fn other_states_are_none() {
        let standing = standing();
        for (other, own) in [(&["a"][..], 1), (&["a", "b", "c"], 3), (&["a", "c"], 2)] {
            let error = standing.places(&names(other), own).unwrap_err();
            assert!(error.to_string().contains("found a, b"), "{error}");
        }
        assert!(standing.places(&names(&["a", "b", "c"]), 2).is_ok());
    }
}
