//! One mode: its value, and enclosures of the function that decides it.

use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Evaluator, Interval, Jets, Reals, Tape};

use super::effort::Effort;
use super::isolate::Isolation;
use super::timeline::{Timeline, apart};
use crate::Error;

/// Highest derivative that is looked at: a function whose k-th derivative keeps its
/// sign falls into at most k monotone parts.
pub(super) const ORDER: usize = 3;

/// A mode and the function of time that decides it. Both read time and the modes
/// inside it, between whose instants the function is smooth.
#[derive(Clone, Debug)]
pub(super) struct Indicator {
    parts: Parts,
    mode: Evaluator,
    /// t, modes read
    inputs: Vec<f64>,
}

/// What an [`Indicator`] is made of.
#[derive(Clone, Debug)]
pub(super) struct Parts {
    /// how it reads, for messages
    pub expression: String,
    /// true where passing any integer, not only zero, changes the mode
    pub counts: bool,
    /// the mode, over time and the modes read
    pub mode: Tape,
    /// what decides it, over the same
    pub quantity: Tape,
    /// which of the indicators before are read
    pub reads: Vec<usize>,
}

impl Indicator {
    pub(super) fn new(parts: Parts) -> Self {
        Self {
            mode: parts.mode.evaluator(),
            inputs: vec![0.0; 1 + parts.reads.len()],
            parts,
        }
    }

    /// Writes the mode over the interval of `effort` to `timeline`; `before` are the
    /// timelines of the indicators before.
    pub(super) fn follow(
        &mut self,
        effort: &mut Effort,
        before: &[Timeline],
        timeline: &mut Timeline,
    ) -> Result<(), Error> {
        timeline.clear();
        let mut ends: Vec<f64> = self
            .parts
            .reads
            .iter()
            .flat_map(|&i| before[i].instants())
            .copied()
            .collect();
        ends.sort_unstable_by(f64::total_cmp);
        ends.push(effort.to);
        let mut start = effort.from;
        for end in ends {
            if end - start <= apart(end) {
                continue;
            }
            let middle = start + 0.5 * (end - start);
            for (input, &i) in self.inputs[1..].iter_mut().zip(&self.parts.reads) {
                *input = before[i].at(middle);
            }
            self.piece(start, end, effort, timeline)?;
            start = end;
        }
        Ok(())
    }

    /// Over a piece on which the modes inside stay.
    fn piece(
        &mut self,
        start: f64,
        end: f64,
        effort: &mut Effort,
        timeline: &mut Timeline,
    ) -> Result<(), Error> {
        let instants = Isolation::new(self, start, end, effort).run()?;
        let mut from = start;
        for to in instants.into_iter().chain([end]) {
            let value = self.value(from + 0.5 * (to - from));
            timeline.push(from, value);
            from = to;
        }
        Ok(())
    }

    /// How the expression reads.
    pub(super) fn expression(&self) -> &str {
        &self.parts.expression
    }

    /// Whether each integer passed is a switch.
    pub(super) fn counts(&self) -> bool {
        self.parts.counts
    }

    /// The mode at `t`, as computed.
    pub(super) fn value(&mut self, t: f64) -> f64 {
        self.inputs[0] = t;
        let mut value = [0.0];
        self.mode.eval(&self.inputs, &mut value);
        value[0]
    }

    /// Whether the mode is certainly the same all over `stretch`.
    pub(super) fn is_constant(&self, stretch: Interval) -> bool {
        let inputs: Vec<Interval> = std::iter::once(stretch)
            .chain(self.inputs[1..].iter().map(|&mode| Interval::point(mode)))
            .collect();
        let values = self.parts.mode.eval_in(&Intervals, &inputs);
        values
            .iter()
            .all(|v| v.is_empty() || (v.is_point() && v.is_defined()))
    }

    /// Whether a mode decided by a quantity in `enclosure` can have one value only.
    pub(super) fn decides(&self, enclosure: Interval) -> bool {
        let image = if self.parts.counts {
            enclosure.floor()
        } else {
            enclosure.sign()
        };
        enclosure.is_defined() && image.is_point()
    }

    /// The first Taylor coefficients of the quantity, enclosed over `stretch`.
    pub(super) fn series<const N: usize>(&self, stretch: Interval) -> [Interval; N] {
        let mut time = vec![stretch, Interval::ONE];
        time.truncate(N);
        let inputs: Vec<Vec<Interval>> = std::iter::once(time)
            .chain(
                self.inputs[1..]
                    .iter()
                    .map(|&mode| vec![Interval::point(mode)]),
            )
            .collect();
        let jets = Jets {
            inner: &Intervals,
            order: N.saturating_sub(1),
        };
        let series = self.parts.quantity.eval_in(&jets, &inputs).swap_remove(0);
        std::array::from_fn(|k| series.get(k).copied().unwrap_or(Interval::ZERO))
    }

    /// The Taylor coefficient of power `k` at `t`.
    pub(super) fn coefficient(&self, k: usize, t: f64) -> f64 {
        let inputs: Vec<Vec<f64>> = std::iter::once(vec![t, 1.0])
            .chain(self.inputs[1..].iter().map(|&mode| vec![mode]))
            .collect();
        let jets = Jets {
            inner: &Reals,
            order: k,
        };
        let series = self.parts.quantity.eval_in(&jets, &inputs).swap_remove(0);
        series.get(k).copied().unwrap_or(0.0)
    }
}
