//! How well the values are known.

use nalgebra::{DMatrix, DVector};

use super::problem::{Point, Problem};
use super::search::{Found, least, positive};
use crate::Error;

/// 95 % of a normal distribution are within so many deviations.
const DEVIATES: f64 = 1.959_963_984_540_054;

/// Twice what −log L may rise within an interval of 95 %: χ² of one degree of freedom, and of one side at a bound.
const RISES: [f64; 2] = [3.841_458_820_694_124, 2.705_543_454_095_404];

/// A value with how well it is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Known {
    pub value: f64,
    /// none at a bound, or where the Hessian is not positive
    pub sd: Option<f64>,
    pub interval: Option<(f64, f64)>,
    pub is_bound: bool,
}

/// Values and correlations of what is not at a bound.
#[derive(Clone, Debug, Default)]
pub(crate) struct Uncertainty {
    pub known: Vec<Known>,
    /// places of those that are not at a bound
    pub free: Vec<usize>,
    pub correlation: DMatrix<f64>,
    /// profiles that were asked for
    pub profiles: Vec<Profile>,
}

/// Values of one unknown with how much −log L rises there, the others being the best.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Profile {
    /// the place of the unknown
    pub place: usize,
    /// in the order of values
    pub points: Vec<(f64, f64)>,
    /// where its interval ends
    pub rise: f64,
}

/// From the Hessian at the end of a search.
pub(super) fn uncertainty(problem: &Problem<'_>, found: &Found) -> Uncertainty {
    let values = problem.values(&found.point.z);
    let free: Vec<usize> = (0..values.len()).filter(|&i| !found.is_bound[i]).collect();
    let own = DMatrix::from_fn(free.len(), free.len(), |i, j| {
        found.hessian[(free[i], free[j])]
    });
    let covariance = positive(own).map(|factor| factor.inverse());
    let deviation = |i: usize| {
        let place = free.iter().position(|&f| f == i)?;
        let covariance = covariance.as_ref()?;
        let slope = problem.unknowns[i].slope(values[i]);
        Some(covariance[(place, place)].sqrt() * slope.abs())
    };
    let known = values.iter().enumerate().map(|(i, &value)| {
        let sd = deviation(i);
        Known {
            value,
            sd,
            interval: sd.map(|sd| normal(problem, i, value, sd)),
            is_bound: found.is_bound[i],
        }
    });
    let known = known.collect();
    let correlation = match &covariance {
        None => DMatrix::from_element(free.len(), free.len(), f64::NAN),
        Some(covariance) => DMatrix::from_fn(free.len(), free.len(), |i, j| match i == j {
            true => 1.0,
            false => covariance[(i, j)] / (covariance[(i, i)] * covariance[(j, j)]).sqrt(),
        }),
    };
    Uncertainty {
        known,
        free,
        correlation,
        profiles: vec![],
    }
}

/// By the standard deviation: even about a value, by a factor about a noise.
fn normal(problem: &Problem<'_>, i: usize, value: f64, sd: f64) -> (f64, f64) {
    let unknown = &problem.unknowns[i];
    let (low, high) = match unknown.kind.is_noise() {
        true => {
            let factor = (DEVIATES * sd / value).exp();
            (value / factor, value * factor)
        }
        false => (value - DEVIATES * sd, value + DEVIATES * sd),
    };
    (low.max(unknown.low), high.min(unknown.high))
}

/// What profiles show beside intervals.
#[derive(Debug, Default)]
pub(super) struct Profiled {
    /// what speaks against the values
    pub warnings: Vec<String>,
    /// a point that is better than the end of the search
    pub better: Option<Point>,
}

/// −log L that is lower by more than this is found by a better search only.
const BETTER: f64 = 1e-3;

/// Sets intervals by profile likelihood: of all values, or of what is at a bound or no more than nothing. They end
/// where one of them meets a better point.
///
/// # Errors
/// As [`Problem::at`].
pub(super) fn profiles(
    problem: &mut Problem<'_>,
    found: &Found,
    uncertainty: &mut Uncertainty,
    are_all: bool,
) -> Result<Profiled, Error> {
    let (mut warnings, mut cut) = (vec![], vec![]);
    let mut better = None;
    for i in 0..uncertainty.known.len() {
        let known = uncertainty.known[i];
        let unknown = &problem.unknowns[i];
        let may_be_nothing = unknown.reaches_zero() && !known.is_bound;
        let is_nothing = may_be_nothing && is_nothing(problem, found, i, &known)?;
        if is_nothing {
            warnings.push(unknown.not_told_from_0());
        }
        if !(are_all || known.is_bound || is_nothing) {
            continue;
        }
        let is_one_sided = known.is_bound || is_nothing;
        let rise = 0.5 * RISES[usize::from(is_one_sided)];
        let mut way = Way {
            points: vec![(found.point.z[i], 0.0)],
            better: None,
        };
        let sides = sides(problem, found, (i, &known, is_nothing), rise, &mut way)?;
        if way.better.is_some() {
            better = way.better;
            break;
        }
        match sides {
            Some(sides) => uncertainty.known[i].interval = Some(sides),
            None => cut.push(unknown.words()),
        }
        let mut points = way.points;
        if are_all {
            points.retain(|(_, rise)| rise.is_finite());
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            let values = points.into_iter();
            uncertainty.profiles.push(Profile {
                place: i,
                points: values.map(|(z, rise)| (unknown.value(z), rise)).collect(),
                rise,
            });
        }
    }
    if !cut.is_empty() {
        warnings.push(format!(
            "a limit ended the profiles of {}: what they have of intervals is by their deviations",
            cut.join(", ")
        ));
    }
    Ok(Profiled { warnings, better })
}

/// The points of a profile.
struct Way {
    /// values of the unknown, as it is searched, with how far −log L rises
    points: Vec<(f64, f64)>,
    better: Option<Point>,
}

/// The interval in which −log L, the other unknowns being the best for each value, rises by no more than 95 % of logs
/// let it; one-sided at a bound, and of a noise that is no more than nothing. None where a limit struck, or where it
/// falls instead.
fn sides(
    problem: &mut Problem<'_>,
    found: &Found,
    (i, known, is_nothing): (usize, &Known, bool),
    rise: f64,
    way: &mut Way,
) -> Result<Option<(f64, f64)>, Error> {
    let unknown = &problem.unknowns[i];
    let mut ends = [unknown.low, unknown.high];
    for (side, end) in ends.iter_mut().enumerate() {
        let sign = [-1.0, 1.0][side];
        let limit = unknown.searched([unknown.low, unknown.high][side]);
        let at = found.point.z[i];
        let is_there = known.is_bound && (limit - at).abs() < 1e-9 * (1.0 + at.abs());
        if is_there || (is_nothing && side == 0) {
            continue;
        }
        let size = match known.sd {
            Some(sd) => sd / unknown.slope(known.value).abs(),
            None if unknown.is_log => 1.0,
            None => 0.1 * (unknown.high - unknown.low).min(at.abs().max(1e-3)),
        };
        let mut edge = Edge {
            problem,
            held: i,
            from: found.point.z.clone(),
            least: found.point.value,
            rise,
            way,
        };
        match edge.find(at, sign, size, limit)? {
            Some(z) => *end = unknown.value(z),
            None => return Ok(None),
        }
    }
    Ok(Some((ends[0], ends[1])))
}

/// Noises whose deviation is a smaller share of them are not taken for nothing: −log L falls by far more between.
const CLEAR: f64 = 0.25;

/// Whether 5 % of the logs of a plant without this noise show as much of it.
///
/// # Errors
/// As [`Problem::at`].
fn is_nothing(
    problem: &mut Problem<'_>,
    found: &Found,
    i: usize,
    known: &Known,
) -> Result<bool, Error> {
    if known.sd.is_some_and(|sd| sd < CLEAR * known.value) {
        return Ok(false);
    }
    let unknown = &problem.unknowns[i];
    let mut start = found.point.z.clone();
    start[i] = unknown.searched(unknown.low);
    let mut held = vec![false; start.len()];
    held[i] = true;
    let (there, _) = least(problem, start, &held)?;
    Ok(2.0 * (there.value - found.point.value) <= RISES[1])
}

/// Where a profile has risen by so much.
struct Edge<'e, 'p> {
    problem: &'e mut Problem<'p>,
    /// the unknown that is moved
    held: usize,
    /// where the search for the others starts
    from: DVector<f64>,
    least: f64,
    rise: f64,
    way: &'e mut Way,
}

/// Values of the unknown that are tried on a side.
const TRIALS: usize = 40;

impl Edge<'_, '_> {
    /// The edge on a side of `at`, by doubling, then by the secant of the root of the rise, which is nearly
    /// straight; the limit where it is not reached. None where a limit struck, or where it falls instead.
    fn find(&mut self, at: f64, sign: f64, size: f64, limit: f64) -> Result<Option<f64>, Error> {
        let root = |rise: f64| rise.max(0.0).sqrt();
        let goal = root(self.rise);
        let mut inside = (at, 0.0);
        let mut outside: Option<(f64, f64)> = None;
        let mut width = f64::INFINITY;
        let mut next = at + sign * size * goal * 2.0_f64.sqrt();
        for _ in 0..TRIALS {
            let z = if sign > 0.0 {
                next.min(limit)
            } else {
                next.max(limit)
            };
            let Some(rise) = self.rise_at(z)? else {
                return Ok(None);
            };
            let reached = root(rise);
            if (reached - goal).abs() < 1e-3 * goal {
                return Ok(Some(z));
            }
            match reached < goal {
                true if z == limit => return Ok(Some(limit)),
                true => inside = (z, reached),
                false => outside = Some((z, reached)),
            }
            let Some(outside) = outside else {
                let slope = (reached / (z - at).abs()).max(f64::MIN_POSITIVE);
                let far = (goal / slope).min(4.0 * (z - at).abs());
                next = at + sign * far.max(1.5 * (z - at).abs());
                continue;
            };
            let now = (outside.0 - inside.0).abs();
            if now < 1e-9 * (1.0 + at.abs()) {
                return Ok(Some(inside.0));
            }
            // where the rise has a knee, the secant would only creep
            let share = match outside.1.is_finite() && now <= 0.5 * width {
                true => ((goal - inside.1) / (outside.1 - inside.1)).clamp(0.02, 0.98),
                false => 0.5,
            };
            width = now;
            next = inside.0 + share * (outside.0 - inside.0);
        }
        Ok(Some(outside.map_or(limit, |_| inside.0)))
    }

    /// The same with noises that are at nothing where the study has them; none where there are none. A density is
    /// searched as a logarithm, and near nothing −log L has no slope along that: what ended there once stays there.
    fn lifted(&self, z: &DVector<f64>) -> Option<DVector<f64>> {
        let mut lifted = z.clone();
        for (i, unknown) in self.problem.unknowns.iter().enumerate() {
            let is_nothing = i != self.held && unknown.is_nothing(z[i]);
            if is_nothing {
                lifted[i] = unknown.searched(unknown.start);
            }
        }
        (lifted != *z).then_some(lifted)
    }

    fn rise_at(&mut self, z: f64) -> Result<Option<f64>, Error> {
        let mut start = self.from.clone();
        start[self.held] = z;
        let mut held = vec![false; start.len()];
        held[self.held] = true;
        let (mut point, mut is_done) = least(self.problem, start, &held)?;
        if let Some(lifted) = self.lifted(&point.z) {
            let (other, is_other_done) = least(self.problem, lifted, &held)?;
            is_done &= is_other_done;
            if other.value < point.value {
                point = other;
            }
        }
        let rise = point.value - self.least;
        if rise < -BETTER {
            self.way.better = Some(point);
            return Ok(None);
        }
        if !is_done {
            return Ok(None);
        }
        // from far off nobody finds back
        if rise <= 4.0 * self.rise {
            self.from = point.z;
        }
        self.way.points.push((z, rise));
        Ok(Some(rise))
    }
}
