//! Innovations over a run, in so little room that no run is too long.

use lynkeus_run::credible::CLIP;
use lynkeus_run::filter::Reading;

/// Stretches that are kept; half as many at least where there are readings enough.
const MOST: usize = 32;

/// A stretch of readings beside what was expected of them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stretch {
    /// times of its first and last reading
    pub from: f64,
    pub to: f64,
    /// readings that the gate kept out
    pub rejected: usize,
    /// readings taken of which it was known how far off they may be
    pub taken: usize,
    /// Σ z² of these, z = innovation/deviation
    pub squares: f64,
    /// the same with |z| of at most [`CLIP`]
    pub clipped: f64,
    /// the largest of these z², and its time
    pub largest: f64,
    pub largest_at: f64,
    /// Σ z·(the z before)
    pub products: f64,
}

impl Stretch {
    /// Readings of the sensor in it.
    pub fn readings(&self) -> usize {
        self.taken + self.rejected
    }

    /// Both together; `next` is the later one.
    pub fn and(self, next: Self) -> Self {
        if self.readings() == 0 {
            return next;
        }
        let (largest, largest_at) = match next.largest > self.largest {
            true => (next.largest, next.largest_at),
            false => (self.largest, self.largest_at),
        };
        Self {
            from: self.from,
            to: next.to,
            rejected: self.rejected + next.rejected,
            taken: self.taken + next.taken,
            squares: self.squares + next.squares,
            clipped: self.clipped + next.clipped,
            largest,
            largest_at,
            products: self.products + next.products,
        }
    }

    fn numbers(&self) -> [f64; 9] {
        [
            self.from,
            self.to,
            self.rejected as f64,
            self.taken as f64,
            self.squares,
            self.clipped,
            self.largest,
            self.largest_at,
            self.products,
        ]
    }

    fn of(numbers: &[f64]) -> Option<Self> {
        let &[
            from,
            to,
            rejected,
            taken,
            squares,
            clipped,
            largest,
            largest_at,
            products,
        ] = numbers
        else {
            return None;
        };
        Some(Self {
            from,
            to,
            rejected: rejected as usize,
            taken: taken as usize,
            squares,
            clipped,
            largest,
            largest_at,
            products,
        })
    }
}

/// A sensor's innovations in stretches of equally many readings.
#[derive(Clone, Debug, PartialEq)]
pub struct Trace {
    stretches: Vec<Stretch>,
    /// readings of each stretch but the last
    size: usize,
    /// the last z; NaN before the first
    last: f64,
}

impl Default for Trace {
    fn default() -> Self {
        Self {
            stretches: vec![],
            size: 1,
            last: f64::NAN,
        }
    }
}

impl Trace {
    /// What became of a reading at a time; z, its innovation in deviations, counts where it is finite.
    pub fn take(&mut self, t: f64, reading: Reading, z: f64) {
        match reading {
            Reading::Rejected => self.push(Stretch {
                from: t,
                to: t,
                rejected: 1,
                ..Stretch::default()
            }),
            Reading::Taken if z.is_finite() => self.push_deviate(t, z),
            _ => {}
        }
    }

    /// A reading taken, in deviations from what was expected.
    pub fn push_deviate(&mut self, t: f64, z: f64) {
        let before = std::mem::replace(&mut self.last, z);
        self.push(Stretch {
            from: t,
            to: t,
            rejected: 0,
            taken: 1,
            squares: z * z,
            clipped: (z * z).min(CLIP * CLIP),
            largest: z * z,
            largest_at: t,
            products: if before.is_finite() { z * before } else { 0.0 },
        });
    }

    fn push(&mut self, reading: Stretch) {
        match self.stretches.last_mut() {
            Some(last) if last.readings() < self.size => *last = last.and(reading),
            _ => {
                if self.stretches.len() == MOST {
                    let pairs = self.stretches.chunks(2);
                    let joined = pairs.map(|pair| {
                        let all = pair.iter().copied().reduce(Stretch::and);
                        all.unwrap_or_default()
                    });
                    self.stretches = joined.collect();
                    self.size *= 2;
                }
                self.stretches.push(reading);
            }
        }
    }

    pub fn stretches(&self) -> &[Stretch] {
        &self.stretches
    }

    /// Readings that were judged.
    pub fn readings(&self) -> usize {
        self.stretches.iter().map(Stretch::readings).sum()
    }

    /// All of it.
    pub fn whole(&self) -> Stretch {
        let all = self.stretches.iter().copied().reduce(Stretch::and);
        all.unwrap_or_default()
    }

    /// The last half of the readings, and the stretch in whose middle that begins.
    pub fn late(&self) -> Stretch {
        let half = self.readings() / 2;
        let mut late = Stretch::default();
        for stretch in self.stretches.iter().rev() {
            if late.readings() >= half.max(1) {
                break;
            }
            late = match late.readings() {
                0 => *stretch,
                _ => stretch.and(late),
            };
        }
        late
    }

    /// Everything, for a file.
    pub fn numbers(&self) -> Vec<f64> {
        let own = [self.size as f64, self.last];
        let stretches = self.stretches.iter().flat_map(Stretch::numbers);
        own.into_iter().chain(stretches).collect()
    }

    /// From these; none where they are no trace's.
    pub fn of(numbers: &[f64]) -> Option<Self> {
        let (&[size, last], stretches) = numbers.split_first_chunk()?;
        let stretches = stretches.chunks(9).map(Stretch::of);
        Some(Self {
            stretches: stretches.collect::<Option<_>>()?,
            size: (size as usize).max(1),
            last,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretches_hold_equally_many_readings_and_lose_none() {
        let mut trace = Trace::default();
        for k in 0..1000 {
            trace.push_deviate(f64::from(k), if k >= 500 { 3.0 } else { 1.0 });
            let stretches = trace.stretches();
            assert!(stretches.len() <= MOST && (k < 15 || stretches.len() >= MOST / 2));
        }
        let whole = trace.whole();
        assert_eq!((whole.taken, whole.squares), (1000, 5000.0));
        assert_eq!((whole.from, whole.to, whole.largest), (0.0, 999.0, 9.0));
        let late = trace.late();
        assert!((500..=532).contains(&late.taken) && late.to == 999.0);
        assert!(late.squares > 8.0 * late.taken as f64);
        assert_eq!(Trace::of(&trace.numbers()), Some(trace));
        assert_eq!(Trace::of(&[1.0, 2.0, 3.0]), None);
    }

    #[test]
    fn few_readings_are_kept_one_by_one() {
        let mut trace = Trace::default();
        for k in 0..5 {
            trace.push_deviate(f64::from(k), f64::from(k));
        }
        assert_eq!(trace.stretches().len(), 5);
        assert_eq!(trace.late().squares, 16.0 + 9.0);
        assert_eq!(trace.whole().products, 2.0 + 6.0 + 12.0);
    }
}
