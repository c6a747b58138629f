//! Slopes and gaps that change: samples how far apart let an error grow where they come, and slopes change between them,
//! for the worst.

use std::collections::HashMap;

use nalgebra::DMatrix;

use super::{FINER, LARGEST, LARGEST_STEP, ROUNDING, radius};

/// Slopes may change this often from one sample to the next.
const PIECES: usize = 4;
/// From a sample to the next, as shares of the longest interval.
const GAPS: [f64; 6] = [1.0, 0.75, 0.5, 0.3, 0.2, 0.1];
/// A course repeats itself after so many samples.
const PERIODS: [usize; 4] = [1, 2, 3, 4];
/// A course is changed for the worse until no single change is, or so many times through.
const SWEEPS: usize = 4;
/// A change counts that raises the spectral radius by this share.
const WORSE: f64 = 1e-3;
/// The shortest interval is sought to this factor.
const ACCURATE: f64 = 1.01;
/// Courses that are tried, times the cube of the size: about a second.
const WORK: f64 = 1e8;

/// Error systems (e, ε)' = M e, each as of a [`SampledError`](super::SampledError), any of which may hold at any time.
pub struct Switching<'a> {
    /// M of a choice
    pub of: &'a dyn Fn(&[usize]) -> DMatrix<f64>,
    /// how many values each entry of a choice has
    pub counts: &'a [usize],
    /// entries of e
    pub n: usize,
}

/// Per sample where in [`GAPS`] it has its gap, and what is chosen for each piece of it, one after the other.
struct Course {
    choices: Vec<usize>,
    /// the spectral radius of what it makes of e
    radius: f64,
}

impl Switching<'_> {
    /// The shortest interval found, at most `longest`, such that some course with samples no further apart lets e grow;
    /// none where none is found.
    ///
    /// The search starts from slopes that stay as they are and equal gaps, and from the worst course found of fewer
    /// samples. It changes one of the gaps or slopes after the other for the one with which the product of the flows has
    /// the largest spectral radius, for shorter and shorter intervals. Where it is above 1, so is the joint spectral radius
    /// of all courses, and no proof holds for them all (Jungers, *The Joint Spectral Radius*, 2009, section 1.2).
    #[must_use]
    pub fn grows_from(&self, staying: &[usize], longest: f64) -> Option<f64> {
        let size = (self.of)(staying).nrows();
        if size > LARGEST || !longest.is_finite() {
            return None;
        }
        let mut left = (WORK / (size * size * size) as f64) as usize;
        let between = [&[0][..], &staying.repeat(PIECES)].concat();
        let mut found: Option<(f64, Vec<usize>)> = None;
        for period in PERIODS {
            let known = found.clone().map(|(_, choices)| choices);
            for start in [Some(between.clone()), known].into_iter().flatten() {
                let choices = start.into_iter().cycle().take(period * self.stride());
                self.shortened(choices.collect(), longest, &mut found, &mut left);
            }
        }
        found.map(|(interval, _)| interval)
    }

    /// From a course and what is found on, for as long as courses that grow are found for shorter intervals.
    fn shortened(
        &self,
        mut choices: Vec<usize>,
        longest: f64,
        found: &mut Option<(f64, Vec<usize>)>,
        left: &mut usize,
    ) {
        let mut finer = FINER;
        while *left > 0 && finer > ACCURATE {
            let interval = match found {
                None => longest,
                Some((interval, _)) => *interval / finer,
            };
            let course = self.worst(choices.clone(), interval, left);
            match (course.grows(), &found) {
                (true, _) => {
                    choices.clone_from(&course.choices);
                    *found = Some((interval, course.choices));
                }
                (false, None) => return,
                (false, Some(_)) => finer = finer.sqrt(),
            }
        }
    }

    /// The worst course that single changes lead to, or the first that lets e grow.
    fn worst(&self, choices: Vec<usize>, interval: f64, left: &mut usize) -> Course {
        let mut flows = Flows {
            of: self,
            interval,
            known: HashMap::new(),
        };
        let radius = flows.grown(&choices);
        let mut course = Course { choices, radius };
        for _ in 0..SWEEPS {
            let before = course.radius;
            for place in 0..course.choices.len() {
                for value in 0..self.values(place) {
                    if course.grows() || *left == 0 {
                        return course;
                    }
                    if course.choices[place] != value {
                        *left -= 1;
                        course.try_at(place, value, &mut flows);
                    }
                }
            }
            if course.radius <= before {
                break;
            }
        }
        course
    }

    /// Entries of a course from one sample to the next.
    fn stride(&self) -> usize {
        1 + PIECES * self.counts.len()
    }

    fn values(&self, place: usize) -> usize {
        match (place % self.stride()).checked_sub(1) {
            None => GAPS.len(),
            Some(entry) => self.counts[entry % self.counts.len()],
        }
    }
}

impl Course {
    fn grows(&self) -> bool {
        self.radius > 1.0 + ROUNDING
    }

    /// Takes another value at a place, if e grows more by it.
    fn try_at(&mut self, place: usize, value: usize, flows: &mut Flows<'_>) {
        let before = std::mem::replace(&mut self.choices[place], value);
        let radius = flows.grown(&self.choices);
        match radius > self.radius * (1.0 + WORSE) {
            true => self.radius = radius,
            false => self.choices[place] = before,
        }
    }
}

/// exp(M τ) over a piece, by gap and choice.
struct Flows<'a> {
    of: &'a Switching<'a>,
    interval: f64,
    known: HashMap<(usize, Vec<usize>), DMatrix<f64>>,
}

impl Flows<'_> {
    /// The spectral radius of what a course makes of e; 0 where it is not told.
    fn grown(&mut self, choices: &[usize]) -> f64 {
        let (n, width) = (self.of.n, self.of.counts.len());
        let mut product = DMatrix::identity(n, n);
        for between in choices.chunks(self.of.stride()) {
            let (gap, pieces) = (between[0], between[1..].chunks(width));
            let mut flow: Option<DMatrix<f64>> = None;
            for choice in pieces {
                let step = self.step(gap, choice);
                flow = Some(match flow {
                    None => step.columns(0, n).into_owned(),
                    Some(flow) => step * flow,
                });
            }
            if let Some(flow) = flow {
                product = flow.rows(0, n) * product;
            }
        }
        radius(product).unwrap_or(0.0)
    }

    fn step(&mut self, gap: usize, choice: &[usize]) -> &DMatrix<f64> {
        let length = GAPS[gap] * self.interval / PIECES as f64;
        let of = self.of.of;
        let known = self.known.entry((gap, choice.to_vec()));
        known.or_insert_with(|| {
            let M = of(choice) * length;
            match M.amax() < LARGEST_STEP {
                true => M.exp(),
                // what no spectral radius is told of
                false => M * f64::NAN,
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows<const N: usize>(rows: [[f64; N]; N]) -> DMatrix<f64> {
        DMatrix::from_row_slice(N, N, rows.as_flattened())
    }

    fn found(matrices: &[DMatrix<f64>], n: usize, longest: f64) -> Option<f64> {
        let of = |choice: &[usize]| matrices[choice[0]].clone();
        let counts = [matrices.len()];
        let switching = Switching {
            of: &of,
            counts: &counts,
            n,
        };
        switching.grows_from(&[0], longest)
    }

    /// Three integrators with all poles at −1 stand equal intervals of 2.899. Gaps of 1, 0.4, 1, 0.2 and 0.2 times 2 in turn
    /// let the error grow; with 1.5 no sequence of up to five such gaps does (all of them, by SciPy).
    #[test]
    fn gaps_that_change_break_what_equal_ones_do_not() {
        let chain = rows([
            [-3.0, 1.0, 0.0, 3.0],
            [-3.0, 0.0, 1.0, 3.0],
            [-1.0, 0.0, 0.0, 1.0],
            [0.0, 1.0, 0.0, 0.0],
        ]);
        let interval = found(&[chain], 3, 2.899).unwrap();
        assert!((1.5..2.05).contains(&interval), "{interval}");
    }

    /// An oscillator e₁' = e₂ − σ/10, e₂' = −k e₁ − e₂/10 decays with k = 1/2 and with k = 2, whenever samples come. With
    /// k = 2 on the way out and 1/2 on the way back it does not.
    #[test]
    fn slopes_that_change_break_what_those_that_stay_do_not() {
        let oscillator = |k: f64| rows([[-0.1, 1.0, 0.1], [-k, -0.1, 0.0], [0.0, 1.0, 0.0]]);
        let both = [oscillator(0.5), oscillator(2.0)];
        for one in &both {
            assert_eq!(found(std::slice::from_ref(one), 2, 10.0), None);
        }
        let interval = found(&both, 2, 10.0).unwrap();
        assert!(interval < 10.0, "{interval}");
    }

    /// x' = −x/2 with gain 3 decays whenever samples come; nothing is looked for without end.
    #[test]
    fn what_decays_by_itself_is_not_broken() {
        let M = rows([[-3.5, 3.0], [-0.5, 0.0]]);
        assert_eq!(found(std::slice::from_ref(&M), 1, 50.0), None);
        assert_eq!(found(&[M], 1, f64::INFINITY), None);
        assert_eq!(found(&[rows([[f64::NAN; 2]; 2])], 1, 1.0), None);
    }
}
