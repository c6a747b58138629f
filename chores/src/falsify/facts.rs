//! What "every condition proved" says of a plant, by its values alone: it has a value
//! everywhere on the box, it does not jump in the states, and along a chain each state
//! moves the one before it in one direction.

use lynkeus::structure::AugmentedPlant;

use super::pair::Pair;
use crate::numbers::Numbers;

/// What contradicts a claim about the plant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Fact {
    Undefined,
    Jumps,
    Sign,
}

/// Points at which values are computed.
const POINTS: usize = 120;
/// Lines along which a jump is searched, and pieces of each.
const LINES: usize = 24;
const PIECES: usize = 24;

pub struct Facts<'a> {
    pub pair: &'a mut Pair,
    /// of the plant's states
    pub states: Vec<[f64; 2]>,
    /// of all its inputs
    pub inputs: Vec<[f64; 2]>,
}

impl Facts<'_> {
    /// The first contradiction found, with the place.
    pub fn against(
        &mut self,
        numbers: &mut Numbers,
        chains: &[(usize, usize)],
    ) -> Option<(Fact, String)> {
        self.undefined(numbers)
            .or_else(|| self.jumps(numbers))
            .or_else(|| self.signs(numbers, chains))
    }

    fn point(&self, numbers: &mut Numbers) -> (f64, Vec<f64>, Vec<f64>) {
        let ends = numbers.chance(0.2);
        let mut place = |[low, high]: &[f64; 2]| match (ends, numbers.unit()) {
            (true, x) if x < 0.5 => *low,
            (true, _) => *high,
            (false, x) => low + x * (high - low),
        };
        let x = self.states.iter().map(&mut place).collect();
        let u = self.inputs.iter().map(&mut place).collect();
        (numbers.between(-10.0, 10.0), x, u)
    }

    fn undefined(&mut self, numbers: &mut Numbers) -> Option<(Fact, String)> {
        for _ in 0..POINTS {
            let (t, x, u) = self.point(numbers);
            let values = self.pair.plant(t, &x, &u);
            if let Some(i) = values.iter().position(|v| !v.is_finite()) {
                let what = format!(
                    "value {i} is {} at t = {t}, x = {x:?}, u = {u:?}",
                    values[i]
                );
                return Some((Fact::Undefined, what));
            }
        }
        None
    }

    /// Halves lines in the states' space toward the largest change of a value.
    fn jumps(&mut self, numbers: &mut Numbers) -> Option<(Fact, String)> {
        for line in 0..LINES {
            let (t, from, u) = self.point(numbers);
            let (_, mut to, _) = self.point(numbers);
            if line % 2 == 0 {
                // along one axis
                let (axis, end) = (numbers.below(from.len()), to.clone());
                to.clone_from(&from);
                to[axis] = end[axis];
            }
            let at = |share: f64| -> Vec<f64> {
                from.iter()
                    .zip(&to)
                    // rounding must not leave the box: at its end a step may begin
                    .map(|(a, b)| (a + share * (b - a)).clamp(a.min(*b), a.max(*b)))
                    .collect()
            };
            let count = self.pair.states + self.pair.measured;
            for i in 0..count {
                let mut value = |share: f64| self.pair.plant(t, &at(share), &u)[i];
                let ends: Vec<f64> = (0..=PIECES)
                    .map(|k| value(k as f64 / PIECES as f64))
                    .collect();
                let step = |k: &usize| (ends[k + 1] - ends[*k]).abs();
                let steepest = (0..PIECES).max_by(|a, b| step(a).total_cmp(&step(b)))?;
                let (mut low, mut high) = (
                    steepest as f64 / PIECES as f64,
                    (steepest + 1) as f64 / PIECES as f64,
                );
                for _ in 0..44 {
                    let middle = f64::midpoint(low, high);
                    let (a, b, c) = (value(low), value(middle), value(high));
                    *(if (b - a).abs() > (c - b).abs() {
                        &mut high
                    } else {
                        &mut low
                    }) = middle;
                }
                let (a, b) = (value(low), value(high));
                let size = ends.iter().fold(1e-12_f64, |m, v| m.max(v.abs()));
                if (b - a).abs() > 1e-4 * size || !(b - a).is_finite() {
                    let what = format!(
                        "value {i} goes from {a} to {b} at t = {t}, x = {:?}, u = {u:?}",
                        at(low)
                    );
                    return Some((Fact::Jumps, what));
                }
            }
        }
        None
    }

    /// Whether x_column moves x'_row up here and down there.
    fn signs(
        &mut self,
        numbers: &mut Numbers,
        chains: &[(usize, usize)],
    ) -> Option<(Fact, String)> {
        for &(row, column) in chains {
            let mut seen: Option<(f64, String)> = None;
            for _ in 0..60 {
                let (t, mut x, u) = self.point(numbers);
                let [low, high] = self.states[column];
                let before = self.pair.plant(t, &x, &u)[row];
                let from = x[column];
                let far = numbers.size(1e-4, 1.0) * (high - low);
                x[column] = if from + far <= high {
                    from + far
                } else {
                    from - far
                };
                if x[column] < low {
                    continue;
                }
                let after = self.pair.plant(t, &x, &u)[row];
                let slope = (after - before) / (x[column] - from);
                // differences of rounded values say nothing where they are small
                if (after - before).abs() < 1e-9 * (before.abs() + 1e-9) {
                    continue;
                }
                let here = format!(
                    "slope {slope} of x'[{row}] in x[{column}] at t = {t}, x = {x:?}, u = {u:?}"
                );
                match &seen {
                    Some((other, there)) if other * slope < 0.0 => {
                        return Some((Fact::Sign, format!("{there}; {here}")));
                    }
                    Some(_) => {}
                    None => seen = Some((slope, here)),
                }
            }
        }
        None
    }
}

/// Ends of declared ranges; something finite where there are none.
pub fn finite(low: f64, high: f64) -> [f64; 2] {
    [
        if low.is_finite() {
            low
        } else {
            high.min(1.0) - 3.0
        },
        if high.is_finite() {
            high
        } else {
            low.max(-1.0) + 3.0
        },
    ]
}

/// (row, column) of neighbours in chains of plant states.
pub fn neighbours(chains: &[Vec<String>], augmented: &AugmentedPlant<'_>) -> Vec<(usize, usize)> {
    let index = |name: &String| {
        let found = augmented.state_index(name);
        found.filter(|i| *i < augmented.plant_states())
    };
    let pairs = chains.iter().flat_map(|chain| chain.windows(2));
    pairs
        .filter_map(|pair| Some((index(&pair[0])?, index(&pair[1])?)))
        .collect()
}
