//! Time events: instants at which an expression jumps or bends because of time alone.
//!
//! The argument of each such operation is enclosed by interval arithmetic, with its derivatives,
//! between the instants of those inside it. A stretch of time on which the enclosure stays on one
//! side has no event; one on which the function is proved monotone, or falls into monotone parts
//! because a higher derivative keeps its sign, has its events bisected to the last bit; any other
//! is cut in two. So no pulse is too short to be seen. What rounding errors hide, and what switches
//! too often, is refused by name.

use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Algebra, Evaluator, Graph, Interval, Jets, MissingInput, Node, Reals, Tape};

use super::guards::interval;
use crate::snapshot::{Damaged, Persist, Walk};
use crate::{Error, Result};

/// Switching instants allowed in one interval, over all indicators of a system.
const SWITCHES: usize = 100_000;

/// Stretches that may be looked at for them.
const LOOKS: usize = 500_000;

/// What a run may have in all, in multiples of what an interval may.
const INTERVALS: usize = 4;

/// What each interval adds to that of the run.
const MORE_SWITCHES: usize = 1000;
const MORE_LOOKS: usize = 4000;

/// Part of the interval in which rounding errors may hide the mode.
const DOUBTFUL: f64 = 1e-6;

/// Highest derivative that is looked at: a function whose k-th derivative keeps its
/// sign falls into at most k monotone parts.
const ORDER: usize = 3;

/// The time events of a system: what jumps is a *mode*, constant between two instants.
#[derive(Clone, Debug)]
pub(crate) struct TimeEvents {
    /// each after those that it reads
    indicators: Vec<Indicator>,
    /// the modes as functions of time alone
    values: Evaluator,
    /// what finding them may still cost
    effort: Effort,
}

impl TimeEvents {
    /// Of indicators, each after those that it reads, and of the modes as functions of time.
    pub(super) fn new(indicators: Vec<Indicator>, values: &Tape) -> Self {
        Self {
            indicators,
            values: values.evaluator(),
            effort: Effort::new(),
        }
    }

    /// How many modes there are.
    pub(crate) fn modes(&self) -> usize {
        self.values.tape().outputs()
    }

    /// Writes the modes' values at `t`.
    pub(crate) fn modes_at(&mut self, t: f64, modes: &mut [f64]) {
        if !modes.is_empty() {
            self.values.eval(&[t], modes);
        }
    }

    /// Whether there is nothing to find.
    pub(crate) fn is_empty(&self) -> bool {
        self.indicators.is_empty()
    }

    /// Appends the instants of the events strictly inside (`from`, `to`).
    pub(crate) fn instants(&mut self, from: f64, to: f64, times: &mut Vec<f64>) -> Result<()> {
        if self.indicators.is_empty() {
            return Ok(());
        }
        self.effort.begin(from, to);
        for i in 0..self.indicators.len() {
            let (before, rest) = self.indicators.split_at_mut(i);
            let followed = rest[0].follow(&mut self.effort, before);
            followed.map_err(|error| error.about(&rest[0].expression))?;
            times.extend(rest[0].timeline.instants());
        }
        self.effort.end();
        Ok(())
    }
}

impl Persist for TimeEvents {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        walk.optional(&mut self.effort.since, Walk::number)?;
        walk.count(&mut self.effort.switches_of_run)?;
        walk.count(&mut self.effort.granted)?;
        walk.count(&mut self.effort.looks_of_run)
    }
}

/// What following the switches may still cost: in the run, and over the interval under way.
#[derive(Clone, Debug, Default)]
struct Effort {
    /// start of the first interval
    since: Option<f64>,
    switches_of_run: usize,
    /// switches found and left
    granted: usize,
    looks_of_run: usize,
    /// the interval
    from: f64,
    to: f64,
    switches: usize,
    looks: usize,
    /// where the switches that the limit is for begin
    counted_from: f64,
    limit: usize,
    /// length of time on which rounding errors may still hide a mode
    doubtful: f64,
}

impl Effort {
    /// Before the first interval.
    fn new() -> Self {
        Self {
            switches_of_run: INTERVALS * SWITCHES,
            granted: INTERVALS * SWITCHES,
            looks_of_run: INTERVALS * LOOKS,
            ..Self::default()
        }
    }

    /// An interval begins.
    fn begin(&mut self, from: f64, to: f64) {
        let since = *self.since.get_or_insert(from);
        self.switches_of_run = self.switches_of_run.saturating_add(MORE_SWITCHES);
        self.granted = self.granted.saturating_add(MORE_SWITCHES);
        self.looks_of_run = self.looks_of_run.saturating_add(MORE_LOOKS);
        (self.counted_from, self.limit) = match self.switches_of_run < SWITCHES {
            true => (since, self.granted),
            false => (from, SWITCHES),
        };
        (self.from, self.to) = (from, to);
        self.switches = self.switches_of_run.min(SWITCHES);
        self.looks = self.looks_of_run.min(LOOKS);
        self.doubtful = DOUBTFUL * (to - from);
    }

    /// The run pays for the interval.
    fn end(&mut self) {
        self.switches_of_run -= self.switches_of_run.min(SWITCHES) - self.switches;
        self.looks_of_run -= self.looks_of_run.min(LOOKS) - self.looks;
    }

    /// Pays for one look.
    fn look(&mut self, at: f64) -> Result<()> {
        self.looks = self.looks.checked_sub(1).ok_or_else(|| unresolved(at))?;
        Ok(())
    }

    /// Pays for a stretch at `at` on which the mode is not certain.
    fn doubt(&mut self, at: f64, width: f64) -> Result<()> {
        // around a simple zero some last bits are always in doubt
        if width > 64.0 * apart(at) {
            self.doubtful -= width;
        }
        if self.doubtful < 0.0 {
            return Err(unresolved(at));
        }
        Ok(())
    }

    /// Refuses more than the switches that are left.
    fn check(&self, count: f64) -> Result<()> {
        if count <= self.switches as f64 {
            return Ok(());
        }
        Err(Error::TooManySwitches {
            expression: String::new(),
            from: self.counted_from,
            to: self.to,
            limit: self.limit,
        })
    }

    /// Pays for a switch.
    fn switch(&mut self) -> Result<()> {
        self.check(1.0)?;
        self.switches -= 1;
        Ok(())
    }
}

/// Of what it is said is filled in by whoever knows.
fn unresolved(time: f64) -> Error {
    Error::UnresolvedSwitches {
        expression: String::new(),
        time,
    }
}

/// The values of one mode over an interval, each with where it begins.
#[derive(Clone, Debug, Default)]
struct Timeline(Vec<(f64, f64)>);

impl Timeline {
    /// The mode is `value` from `t` on.
    fn push(&mut self, t: f64, value: f64) {
        if !self.0.last().is_some_and(|(_, last)| same(*last, value)) {
            self.0.push((t, value));
        }
    }

    /// Where the value changes, increasing.
    fn instants(&self) -> impl Iterator<Item = f64> {
        self.0.iter().skip(1).map(|(begin, _)| *begin)
    }

    /// The value at `t`, which is no instant; NaN before the first value is known.
    fn at(&self, t: f64) -> f64 {
        let begun = self.0.partition_point(|(begin, _)| *begin <= t);
        self.0[..begun].last().map_or(f64::NAN, |(_, value)| *value)
    }
}

/// Equality for which NaN, "not defined here", equals NaN.
fn same(a: f64, b: f64) -> bool {
    a == b || (a.is_nan() && b.is_nan())
}

/// Two instants closer than this are one: rounding put them apart.
fn apart(t: f64) -> f64 {
    4.0 * f64::EPSILON * t.abs()
}

/// A mode and the function of time that decides it. Both read time and the modes
/// inside it, between whose instants the function is smooth.
#[derive(Clone, Debug)]
pub(super) struct Indicator {
    /// how it reads, for messages
    expression: String,
    /// true where passing any integer, not only zero, changes the mode
    counts: bool,
    /// the mode, over time and the modes read
    mode: Evaluator,
    /// what decides it, over the same
    quantity: Tape,
    /// which of the indicators before are read
    reads: Vec<usize>,
    /// t, modes read
    inputs: Vec<f64>,
    /// what was found in the interval asked for last
    timeline: Timeline,
}

impl Indicator {
    /// Of a mode and the quantity that decides it, which may read the symbols of the modes found
    /// before.
    pub(super) fn new(
        graph: &Graph,
        time: Node,
        found: &[Node],
        [mode, quantity]: [Node; 2],
        expression: String,
        counts: bool,
    ) -> Result<Self, MissingInput> {
        let symbols = graph.symbols_of(&[mode, quantity]);
        let reads: Vec<usize> = (0..found.len())
            .filter(|&i| symbols.contains(&found[i]))
            .collect();
        let mut inputs = vec![time];
        inputs.extend(reads.iter().map(|&i| found[i]));
        Ok(Self {
            expression,
            counts,
            mode: Tape::new(graph, &inputs, &[mode])?.evaluator(),
            quantity: Tape::new(graph, &inputs, &[quantity])?,
            inputs: vec![0.0; inputs.len()],
            timeline: Timeline::default(),
            reads,
        })
    }

    /// Finds the mode over the interval of `effort`; `before` are the indicators before.
    fn follow(&mut self, effort: &mut Effort, before: &[Self]) -> Result<()> {
        self.timeline.0.clear();
        let read = self.reads.iter().map(|&i| &before[i].timeline);
        let mut ends: Vec<f64> = read.flat_map(Timeline::instants).collect();
        ends.sort_unstable_by(f64::total_cmp);
        ends.push(effort.to);
        let mut start = effort.from;
        for end in ends {
            if end - start <= apart(end) {
                continue;
            }
            let middle = start + 0.5 * (end - start);
            for (input, &i) in self.inputs[1..].iter_mut().zip(&self.reads) {
                *input = before[i].timeline.at(middle);
            }
            self.piece(start, end, effort)?;
            start = end;
        }
        Ok(())
    }

    /// Over a piece on which the modes inside stay.
    fn piece(&mut self, start: f64, end: f64, effort: &mut Effort) -> Result<()> {
        let isolation = Isolation {
            indicator: self,
            effort,
            start,
            end,
            certain: None,
            instants: vec![],
        };
        let mut from = start;
        for to in isolation.run()?.into_iter().chain([end]) {
            let value = self.value(from + 0.5 * (to - from));
            self.timeline.push(from, value);
            from = to;
        }
        Ok(())
    }

    /// The mode at `t`, as computed.
    fn value(&mut self, t: f64) -> f64 {
        self.inputs[0] = t;
        self.mode.value(&self.inputs)
    }

    /// Whether the mode is certainly the same all over `stretch`.
    fn is_constant(&self, stretch: Interval) -> bool {
        let mut inputs = vec![stretch];
        inputs.extend(self.inputs[1..].iter().map(|&mode| Interval::point(mode)));
        let value = self.mode.tape().eval_in(&Intervals, &inputs)[0];
        value.is_empty() || (value.is_point() && value.is_defined())
    }

    /// Whether a mode decided by a quantity in `enclosure` can have one value only.
    fn decides(&self, enclosure: Interval) -> bool {
        let image = match self.counts {
            true => enclosure.floor(),
            false => enclosure.sign(),
        };
        enclosure.is_defined() && image.is_point()
    }

    /// The first Taylor coefficients of the quantity, over time and what reads of it.
    fn taylor<A: Algebra>(&self, inner: &A, time: A::Value, count: usize) -> Vec<A::Value> {
        let mut time = vec![time, inner.constant(1.0)];
        time.truncate(count);
        let modes = self.inputs[1..].iter();
        let modes = modes.map(|&mode| vec![inner.constant(mode)]);
        let inputs: Vec<_> = std::iter::once(time).chain(modes).collect();
        let jets = Jets {
            inner,
            order: count.saturating_sub(1),
        };
        self.quantity.eval_in(&jets, &inputs).swap_remove(0)
    }

    /// The first Taylor coefficients of the quantity, enclosed over `stretch`.
    fn series<const N: usize>(&self, stretch: Interval) -> [Interval; N] {
        let series = self.taylor(&Intervals, stretch, N);
        std::array::from_fn(|k| series.get(k).copied().unwrap_or(Interval::ZERO))
    }

    /// The Taylor coefficient of power `k` at `t`.
    fn coefficient(&self, k: usize, t: f64) -> f64 {
        let series = self.taylor(&Reals, t, k + 1);
        series.get(k).copied().unwrap_or(0.0)
    }
}

/// The sweep over one stretch, from left to right.
struct Isolation<'a> {
    indicator: &'a mut Indicator,
    effort: &'a mut Effort,
    start: f64,
    end: f64,
    /// the last time at which the mode was certain, and the mode there
    certain: Option<(f64, f64)>,
    instants: Vec<f64>,
}

impl Isolation<'_> {
    /// The instants strictly inside, increasing.
    fn run(mut self) -> Result<Vec<f64>> {
        let mut cells = vec![(self.start, self.end)];
        while let Some((a, b)) = cells.pop() {
            self.effort.look(a)?;
            match self.cell(a, b) {
                Some(times) if times.is_empty() => self.settle(a + 0.5 * (b - a), a)?,
                Some(times) => {
                    for pair in times.windows(2) {
                        self.monotone(pair[0], pair[1])?;
                    }
                }
                None if self.is_hidden(a, b)? => {
                    if self.is_certain(b) {
                        self.arrive(b)?;
                    }
                }
                None => {
                    let middle = a + 0.5 * (b - a);
                    cells.extend([(middle, b), (a, middle)]);
                }
            }
        }
        Ok(self.instants)
    }

    /// The times between which the quantity is monotone, ends included; no time where the mode stays.
    /// None where nothing is known.
    fn cell(&self, a: f64, b: f64) -> Option<Vec<f64>> {
        let stretch = interval(a, b);
        if self.indicator.is_constant(stretch) {
            return Some(vec![]);
        }
        let slope = self.indicator.series::<2>(stretch)[1];
        if slope == Interval::ZERO {
            return Some(vec![]);
        }
        if slope.is_defined() && keeps_sign(slope) {
            return Some(vec![a, b]);
        }
        if slope.is_defined() && self.excluded(a, b, slope) {
            return Some(vec![]);
        }
        let series = self.indicator.series::<{ ORDER + 1 }>(stretch);
        let defined = series.iter().take_while(|c| c.is_defined()).count();
        let order = (2..defined).find(|&k| keeps_sign(series[k]));
        order.map(|k| self.parts(a, b, k))
    }

    /// Whether the mean value form, with the derivative enclosed in `slope`, shows
    /// that the mode stays.
    fn excluded(&self, a: f64, b: f64, slope: Interval) -> bool {
        let middle = a + 0.5 * (b - a);
        let offset = interval(a, b) - Interval::point(middle);
        let [value] = self.indicator.series::<1>(Interval::point(middle));
        self.indicator.decides(value + slope * offset)
    }

    /// The ends and the extrema between them where derivative `order` keeps its sign:
    /// derivative k is monotone between the zeros of derivative k + 1.
    fn parts(&self, a: f64, b: f64, order: usize) -> Vec<f64> {
        debug_assert!(order <= ORDER);
        let mut times = vec![a, b];
        for k in (1..order).rev() {
            let pairs = times.windows(2);
            let zeros: Vec<f64> = pairs.filter_map(|p| self.zero(k, p[0], p[1])).collect();
            times.extend(zeros);
            times.sort_unstable_by(f64::total_cmp);
            times.dedup();
        }
        times
    }

    /// The zero of derivative `k`, monotone in [a, b], by regula falsi (Illinois). It
    /// ends early: near an extremum the function itself is flat.
    fn zero(&self, k: usize, mut a: f64, mut b: f64) -> Option<f64> {
        let close = 1e-10 * (b - a);
        let mut at_a = self.indicator.coefficient(k, a);
        let mut at_b = self.indicator.coefficient(k, b);
        let opposite = (at_a < 0.0 && at_b > 0.0) || (at_a > 0.0 && at_b < 0.0);
        if !opposite {
            return None;
        }
        for round in 0..100 {
            let middle = a + 0.5 * (b - a);
            let secant = (a * at_b - b * at_a) / (at_b - at_a);
            // every third cut in the middle, so that the end is in sight
            let t = match round % 3 < 2 && a < secant && secant < b {
                true => secant,
                false => middle,
            };
            let value = self.indicator.coefficient(k, t);
            if value == 0.0 || b - a <= close || middle <= a || middle >= b {
                return Some(t);
            }
            if (value < 0.0) == (at_a < 0.0) {
                (a, at_a, at_b) = (t, value, 0.5 * at_b);
            } else {
                (b, at_b, at_a) = (t, value, 0.5 * at_a);
            }
        }
        Some(a + 0.5 * (b - a))
    }

    /// Whether a cell that nothing is known of is not worth another cut: time does not
    /// resolve it, or rounding errors hide the mode in it.
    fn is_hidden(&mut self, a: f64, b: f64) -> Result<bool> {
        let width = b - a;
        if width <= apart(self.start.abs().max(self.end.abs())) {
            return Ok(true);
        }
        let middle = a + 0.5 * width;
        if width > 0.5 * DOUBTFUL * (self.effort.to - self.effort.from)
            || [a, middle, b].iter().any(|&t| self.is_certain(t))
        {
            return Ok(false);
        }
        self.effort.doubt(a, width)?;
        Ok(true)
    }

    /// Whether the mode at `t` is beyond rounding errors.
    fn is_certain(&self, t: f64) -> bool {
        self.indicator.is_constant(Interval::point(t))
    }

    /// Finds the switches of a part on which the quantity is monotone.
    fn monotone(&mut self, a: f64, b: f64) -> Result<()> {
        if self.indicator.counts {
            let levels = (self.indicator.value(b) - self.indicator.value(a)).abs();
            self.effort.check(levels.max(0.0))?;
        }
        let (Some(first), Some(last)) = (self.probe(a, b), self.probe(b, a)) else {
            return self.effort.doubt(a, b - a);
        };
        self.effort.doubt(a, first - a)?;
        self.effort.doubt(b, b - last)?;
        self.arrive(first)?;
        if first < last {
            self.arrive(last)?;
        }
        Ok(())
    }

    /// The time nearest to `end` at which the mode is certain, on the way to `other`.
    fn probe(&self, end: f64, other: f64) -> Option<f64> {
        let shares = (1..=17).rev().map(|k| 0.5_f64.powi(3 * k));
        let shares = std::iter::once(0.0).chain(shares).chain([0.5]);
        let mut times = shares.map(|share| end + share * (other - end));
        times.find(|&t| self.is_certain(t))
    }

    /// The mode is certain at `t`.
    fn arrive(&mut self, t: f64) -> Result<()> {
        let value = self.indicator.value(t);
        self.reach(t, value)
    }

    /// The mode is what it is at `inside` from `t` on.
    fn settle(&mut self, inside: f64, t: f64) -> Result<()> {
        let value = self.indicator.value(inside);
        self.reach(t, value)?;
        self.certain = Some((inside, value));
        Ok(())
    }

    /// Finds every switch between the last certain time and `t`, where the mode is `value`.
    fn reach(&mut self, t: f64, value: f64) -> Result<()> {
        while let Some((left, current)) = self.certain
            && !same(current, value)
        {
            let switch = self.bisect(left, t, current);
            self.push(switch)?;
            let next = match switch < t {
                true => self.indicator.value(switch),
                false => value,
            };
            self.certain = Some((switch, next));
        }
        self.certain = Some((t, value));
        Ok(())
    }

    fn push(&mut self, switch: f64) -> Result<()> {
        let last = self.instants.last().copied().unwrap_or(self.start);
        if switch - last <= apart(switch) || self.end - switch <= apart(self.end) {
            return Ok(());
        }
        self.effort.switch()?;
        self.instants.push(switch);
        Ok(())
    }

    /// The first float after the mode's value `current` ends in (`left`, `right`].
    fn bisect(&mut self, mut left: f64, mut right: f64, current: f64) -> f64 {
        loop {
            let middle = left + 0.5 * (right - left);
            if middle <= left || middle >= right {
                return right;
            }
            match same(self.indicator.value(middle), current) {
                true => left = middle,
                false => right = middle,
            }
        }
    }
}

fn keeps_sign(c: Interval) -> bool {
    c.lo() >= 0.0 || c.hi() <= 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_changes_are_instants() {
        let mut line = Timeline::default();
        for (t, value) in [(0.0, 1.0), (1.0, 1.0), (2.0, f64::NAN), (3.0, f64::NAN)] {
            line.push(t, value);
        }
        line.push(4.0, 0.0);
        assert_eq!(line.instants().collect::<Vec<_>>(), [2.0, 4.0]);
        assert_eq!((line.at(0.5), line.at(5.0)), (1.0, 0.0));
        assert!(line.at(2.5).is_nan() && Timeline::default().at(0.0).is_nan());
    }
}
