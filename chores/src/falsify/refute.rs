//! Refutations, looked at again with many digits: does the witness show what it is
//! said to show? Slopes are differences of the equations' values, so the library's
//! derivatives are judged as well.

mod stability;

use astro_float_num::BigFloat;
use lynkeus::expr::{Algebra, Node, Tape};
use lynkeus::observers::{Design, Statement};
use lynkeus::structure::{AugmentedPlant, Point};

use super::claims::Refutation;
use super::precise::Precise;

/// The judgement on a refutation.
pub enum Answer {
    Confirmed,
    /// of a condition that is not known here
    Unread,
    /// with the evidence
    Wrong(String),
}

/// Judges a refutation.
pub fn check(
    refutation: &Refutation,
    augmented: &AugmentedPlant<'_>,
    design: Option<&Design>,
) -> Answer {
    let judged = match (
        refutation.of_error,
        slope_of(&refutation.condition, augmented),
    ) {
        (false, Some(slope)) => finely(|lens| sign(&slope, refutation, augmented, lens)),
        (true, _) => match design {
            Some(design) => {
                finely(|lens| stability::unstable(&design.observer, refutation, augmented, lens))
            }
            None => Ok(Answer::Unread),
        },
        _ => Ok(Answer::Unread),
    };
    judged.unwrap_or_else(Answer::Wrong)
}

/// A slope: of `value` in the symbol `of`.
struct Slope {
    value: Node,
    of: Node,
}

/// The slope that a condition is about.
fn slope_of(condition: &Statement, augmented: &AugmentedPlant<'_>) -> Option<Slope> {
    let (value, by) = match condition {
        Statement::PartialKeepsSign { of, by } => {
            (augmented.derivatives[augmented.state_index(of)?], by)
        }
        Statement::OutputKeepsSign { output, state } => {
            let mut outputs = augmented.outputs.iter();
            let found = outputs.find(|o| o.variable.name == *output)?;
            (found.variable.node, state)
        }
        _ => return None,
    };
    let of = augmented.states[augmented.state_index(by)?].node;
    Some(Slope { value, of })
}

/// How finely a witness is looked at.
struct Lens {
    precise: Precise,
    /// of differences
    step: BigFloat,
    /// whether the slopes to both sides of a point are looked at, too: at a kink and at
    /// the edge of where a function has a value, a slope is that to one side
    one_sided: bool,
}

impl Lens {
    /// Seventy digits with steps of 1e-36.
    fn coarse() -> Result<Self, String> {
        Self::new(256, 120, false)
    }

    /// Five thousand digits with steps of 1e-421: beside sinh(500) or the thousandth power
    /// of a thousand a slope of one can still be seen, and a pole may be as near as
    /// numbers of double precision come.
    fn fine() -> Result<Self, String> {
        Self::new(16_384, 1400, true)
    }

    fn new(bits: usize, halvings: i32, one_sided: bool) -> Result<Self, String> {
        let precise = Precise::new(bits)?;
        let step = precise.powi(&precise.number(2.0), -halvings);
        Ok(Self {
            precise,
            step,
            one_sided,
        })
    }

    /// The slope from `below` to `above`, so many steps away from each other.
    fn slope(&self, above: &BigFloat, below: &BigFloat, steps: f64) -> BigFloat {
        let far = self.precise.mul(&self.step, &self.precise.number(steps));
        self.precise.div(&self.precise.sub(above, below), &far)
    }
}

/// A judgement by the coarse lens where that confirms, else by the fine one.
fn finely(judge: impl Fn(&Lens) -> Result<Answer, String>) -> Result<Answer, String> {
    match judge(&Lens::coarse()?) {
        Err(_) => judge(&Lens::fine()?),
        judged => judged,
    }
}

/// Slopes below it count as zero.
const ZERO: f64 = 1e-26;

fn sign(
    slope: &Slope,
    refutation: &Refutation,
    augmented: &AugmentedPlant<'_>,
    lens: &Lens,
) -> Result<Answer, String> {
    let values: Vec<f64> = refutation
        .points
        .iter()
        .map(|point| slope_at(slope, point, augmented, lens))
        .collect::<Result<_, _>>()?;
    let sizes = values.iter().map(|v| v.abs()).filter(|v| v.is_finite());
    let size = sizes.fold(0.0, f64::max);
    for (point, value) in refutation.points.iter().zip(&values) {
        let near = (value - point.value).abs() <= 1e-6 * (1e-3 + size);
        // beyond the largest number of double precision
        if !near && *value != point.value {
            return Err(format!(
                "the slope is {value}, said to be {} at {:?}",
                point.value, point.coordinates
            ));
        }
    }
    let vanishes = values.iter().any(|v| v.abs() <= ZERO);
    let differs = values.iter().any(|v| *v < -ZERO) && values.iter().any(|v| *v > ZERO);
    match vanishes || differs {
        true => Ok(Answer::Confirmed),
        false => Err(format!(
            "the slopes {values:?} show no change of sign: {:?}",
            refutation.points
        )),
    }
}

/// Places tried for what the slope does not depend on.
const PLACES: usize = 12;

/// The slope at a point of the box.
fn slope_at(
    slope: &Slope,
    point: &Point,
    augmented: &AugmentedPlant<'_>,
    lens: &Lens,
) -> Result<f64, String> {
    let graph = augmented.graph();
    let region = augmented.region();
    let symbols = region.symbols();
    let moved = symbols
        .iter()
        .position(|s| *s == slope.of)
        .ok_or("no such symbol")?;
    let tape = Tape::new(graph, &symbols, &[slope.value]).map_err(|e| e.to_string())?;
    let mut found = f64::NAN;
    for attempt in 0..PLACES {
        let place = filled(point, augmented, attempt)?;
        let place: Vec<BigFloat> = place.iter().map(|x| lens.precise.number(*x)).collect();
        let at = |by: &BigFloat| {
            let mut place = place.clone();
            place[moved] = lens.precise.add(&place[moved], by);
            tape.eval_in(&lens.precise, &place).remove(0)
        };
        found = told(lens, at, point.value);
        if !found.is_nan() {
            break;
        }
    }
    Ok(found)
}

/// A place of the box that agrees with the point. What the slope does not depend on is
/// beside the middle of its range, where models like to switch, and elsewhere in further
/// attempts: the equation may have no value there.
fn filled(
    point: &Point,
    augmented: &AugmentedPlant<'_>,
    attempt: usize,
) -> Result<Vec<f64>, String> {
    let region = augmented.region();
    let sides = region.dimensions.iter().zip(region.centre()).enumerate();
    sides
        .map(|(i, (side, centre))| {
            let share = (0.6234 + 0.618 * (attempt * (i + 1)) as f64).fract();
            let width = (side.max - side.min).min(1e6);
            let coordinates = &point.coordinates;
            match coordinates.iter().find(|c| c.name == side.name) {
                None => Ok(centre + (share - 0.5) * width),
                Some(c) if side.min <= c.value && c.value <= side.max => Ok(c.value),
                Some(c) => Err(format!("{} = {} is outside of the box", c.name, c.value)),
            }
        })
        .collect()
}

/// The slope of `at` around 0; of those to both sides and between them the one that is
/// nearest to what is said, where the lens has them.
fn told(lens: &Lens, at: impl Fn(&BigFloat) -> BigFloat, said: f64) -> f64 {
    let zero = lens.precise.number(0.0);
    let (above, below) = (at(&lens.step), at(&lens.step.neg()));
    let between = Precise::rounded(&lens.slope(&above, &below, 2.0));
    if !lens.one_sided {
        return between;
    }
    let here = at(&zero);
    let up = Precise::rounded(&lens.slope(&above, &here, 1.0));
    let down = Precise::rounded(&lens.slope(&here, &below, 1.0));
    let apart = |x: &f64| match *x == said {
        true => 0.0,
        false => (x - said).abs(),
    };
    let slopes = [between, up, down].into_iter().filter(|x| !x.is_nan());
    let nearest = slopes.min_by(|x, y| apart(x).total_cmp(&apart(y)));
    nearest.unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lynkeus::expr::{Expr, Graph, Unary};

    fn seen(lens: &Lens, f: &dyn Fn(Expr<'_>) -> Node, x: f64, said: f64) -> f64 {
        let graph = Graph::new();
        let symbol = graph.symbol("x");
        let tape = Tape::new(&graph, &[symbol.node()], &[f(symbol)]).unwrap();
        let x = lens.precise.number(x);
        let at = |by: &BigFloat| {
            let place = [lens.precise.add(&x, by)];
            tape.eval_in(&lens.precise, &place).remove(0)
        };
        told(lens, at, said)
    }

    /// d(x + sinh(500))/dx, that of x + 1000^1000, and −1/x² at 1e-154.
    #[test]
    fn a_slope_beside_a_huge_value_and_beside_a_pole() {
        let (coarse, fine) = (Lens::coarse().unwrap(), Lens::fine().unwrap());
        let huge = |x: Expr<'_>| (x + x.graph().constant(500.0).sinh()).node();
        assert_ne!(seen(&coarse, &huge, 0.3, 1.0), 1.0);
        assert_eq!(seen(&fine, &huge, 0.3, 1.0), 1.0);
        let power = |x: Expr<'_>| (x + x.graph().constant(1000.0).powi(1000)).node();
        assert_eq!(seen(&fine, &power, 0.3, 1.0), 1.0);
        let pole = |x: Expr<'_>| (1.0 / x).node();
        let (found, slope) = (seen(&fine, &pole, 1e-154, -1e308), -1e308);
        assert!((found / slope - 1.0).abs() < 1e-9, "{found}");
        // what is said is no excuse
        let found = seen(&fine, &pole, 1e-154, 1.0);
        assert!((found / slope - 1.0).abs() < 1e-9, "{found}");
    }

    /// |x| has the slopes −1 and 1 at 0 and no other beside that between; the root begins
    /// at 0.
    #[test]
    fn at_a_kink_the_slope_is_that_to_one_side() {
        let fine = Lens::fine().unwrap();
        let kink = |x: Expr<'_>| x.graph().unary(Unary::Abs, x.node());
        let found = [-1.0, 0.0, 1.0, 0.6].map(|said| seen(&fine, &kink, 0.0, said));
        assert_eq!(found, [-1.0, 0.0, 1.0, 1.0]);
        let root = |x: Expr<'_>| (x.powi(2) * x.sqrt()).node();
        assert!(seen(&Lens::coarse().unwrap(), &root, 0.0, 0.0).is_nan());
        assert!(seen(&fine, &root, 0.0, 0.0).abs() < 1e-300);
    }
}
