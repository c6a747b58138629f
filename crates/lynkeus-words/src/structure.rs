//! What is found in the structure of a plant.

use lynkeus_structure::{Coordinate, Dimension, Misfit, Point, Reason, Shown, Verdict, Witness};

use crate::chains::chains;
use crate::{Words, short};

impl Words for Point {
    fn words(&self) -> String {
        let at = |c: &Coordinate| format!("{} = {}", c.name, short(c.value));
        let at: Vec<String> = self.coordinates.iter().map(at).collect();
        let joint = if at.is_empty() { "" } else { " at " };
        format!("{}{joint}{}", short(self.value), at.join(", "))
    }
}

impl Words for Witness {
    fn words(&self) -> String {
        let points: Vec<String> = self.points.iter().map(Words::words).collect();
        points.join(" and ")
    }
}

impl Words for Verdict {
    fn words(&self) -> String {
        match self {
            Verdict::Proved => "proved".to_owned(),
            Verdict::Refuted(witness) => format!("refuted: it is {}", witness.words()),
            Verdict::Undecided(place) if place.is_empty() => "undecided".to_owned(),
            Verdict::Undecided(place) => {
                let sides: Vec<String> = place.iter().map(within).collect();
                format!("undecided on {}", sides.join(", "))
            }
        }
    }
}

/// `x in [0, 1]`
fn within(side: &Dimension) -> String {
    let Dimension { name, min, max, .. } = side;
    format!("{name} in [{}, {}]", short(*min), short(*max))
}

/// ` at x = 0, y in [1, 2]`
fn at(place: &[Dimension]) -> String {
    let side = |(i, side): (usize, &Dimension)| {
        let joint = if i == 0 { " at" } else { "," };
        let (low, high) = (side.min, side.max);
        let narrow = (high - low).abs() <= 1e-3 * low.abs().max(high.abs()).max(1.0);
        match narrow {
            true => format!("{joint} {} = {}", side.name, short(nearest(low, high))),
            false => format!("{joint} {}", within(side)),
        }
    };
    place.iter().enumerate().map(side).collect()
}

/// The roundest number of a narrow range: zero or one of its ends.
fn nearest(low: f64, high: f64) -> f64 {
    if low <= 0.0 && high >= 0.0 {
        return 0.0;
    }
    let length = |x: f64| format!("{x}").len();
    match length(low) <= length(high) {
        true => low,
        false => high,
    }
}

impl Words for Reason {
    fn words(&self) -> String {
        let range = |low: f64, high: f64, open: bool| {
            let reserve = if open { " as far as can be proved" } else { "" };
            format!("lies in [{}, {}]{reserve}", short(low), short(high))
        };
        match self {
            Self::Misfit(misfit) => misfit.words(),
            Self::Regular => "every operation examined".into(),
            Self::Delayed { delay, states } => {
                let states = match states {
                    1 => "1 state".to_owned(),
                    count => format!("{count} states"),
                };
                format!("{delay} is held by {states}, which is not all of the delay: nothing is proved")
            }
            Self::NoValue {
                operation,
                place,
                certain,
            } => {
                let word = if *certain { "has" } else { "may have" };
                format!("{operation} {word} no value{}", at(place))
            }
            Self::StateJumps { line } => {
                format!("the state jumps at events (`when` of line {line})")
            }
            Self::Jumps { operation, place } => format!("{operation} jumps{}", at(place)),
            Self::Lies {
                expression,
                low,
                high,
                open,
                undeclared,
            } => {
                let text = format!("{expression} {}", range(*low, *high, *open));
                match undeclared.is_empty() {
                    true => text,
                    false => format!("{text}; declare min and max of {}", undeclared.join(", ")),
                }
            }
            Self::Vanishes(expression) => format!("{expression} can vanish or change its sign"),
            Self::ByJump(reason) => format!("{}, but only by a jump", reason.words()),
            Self::NoMeanValue(reason) => {
                format!("the mean value theorem does not apply: {}", reason.words())
            }
            Self::RowsApart => "the mean value theorem does not decide it: rows taken at different points can be dependent".into(),
            Self::ManyMinors(rows, columns) => {
                format!("a {rows}×{columns} matrix has too many minors to decide")
            }
            Self::ZeroMinors(rows, n) => {
                format!("every {n}×{n} minor of the {rows}×{n} matrix is zero")
            }
            Self::ZeroDeterminant => "det is zero everywhere, by the zeros of the matrix".into(),
            Self::DeterminantVanishes => "det vanishes or changes its sign".into(),
            Self::Determinant { low, high, open } => format!("|det| {}", range(*low, *high, *open)),
            Self::RegularParts(parts) => format!(
                "the ranges of its entries keep it regular, on each of {parts} parts of the box"
            ),
            Self::OpenParts(parts, rows) => format!(
                "{parts} parts of the box do not decide for a block of {rows} rows; the column rcond shows it along the estimate"
            ),
            Self::Factor { k, size, shows } => {
                format!("F_{k} is {}×{}{}", size.0, size.1, factor(*k, shows))
            }
            Self::StateByState => "state by state, along slopes that keep their sign".into(),
            Self::PairsApart(parts) => format!(
                "the ranges of the Jacobian and of the map tell all points apart, on {parts} pairs of parts of the box"
            ),
            Self::Alike(exactly) => {
                let reserve = if *exactly { "" } else { " to twelve digits" };
                format!("two points of the box have the same values{reserve}")
            }
            Self::FarApart => "whether the outputs distinguish points far apart is not decided".into(),
        }
    }
}

/// What a factor shows, behind its name and size.
fn factor(k: usize, shows: &Shown) -> String {
    match shows {
        Shown::Always => " and constant, its columns independent by elimination in interval arithmetic".into(),
        Shown::Never => " and constant: whatever the input, the layer before does not show this direction, so that this arrangement of the states does not fit; measure another output".into(),
        Shown::Unknown => " and constant, so near to one that hides a direction that rounding errors keep from telling whether it does".into(),
        Shown::WhileMoving => ": it shows these states only while its entries move, so convergence rests on the excitation (A4)".into(),
        Shown::NotAt(witness) => format!(
            " and loses rank (det F_{k}ᵀF_{k}: it is {}); convergence rests on inputs that do not stay there (A4)",
            witness.words()
        ),
        Shown::Gram(reason) => format!("; det F_{k}ᵀF_{k} = {}", reason.words()),
    }
}

impl Words for Misfit {
    fn words(&self) -> String {
        let all = |names: &[String]| names.join(", ");
        match self {
            Self::NoState { output, expression } => format!(
                "the output {output} = {expression} is not a state times a factor; a chain has to start at a measured state"
            ),
            Self::MeasuredTwice(state) => {
                format!("two outputs measure the same state {state}; leave one out of 'measured'")
            }
            Self::ChainEnds { chain, left } => format!(
                "the chain {} ends at {}: no equation in it depends on {}; measure another output",
                chains(std::slice::from_ref(chain), ""),
                last(chain),
                all(left)
            ),
            Self::ChainBreaks { chain, new } => format!(
                "the chain {} breaks at the equation of {}: it depends on {} at once, where a triangular form has one new state per equation",
                chains(std::slice::from_ref(chain), ""),
                last(chain),
                all(new)
            ),
            Self::NoCut(reasons) => {
                let count = match reasons.len() {
                    2 => "two".to_owned(),
                    count => count.to_string(),
                };
                let reasons: Vec<String> = reasons.iter().map(Words::words).collect();
                format!(
                    "no cut into {count} chains covers every state: {}",
                    reasons.join("; ")
                )
            }
            Self::OtherChains(allowed) => format!(
                "no assignment has the chains asked for; the equations allow {}",
                alternatives(allowed, " and ")
            ),
            Self::OtherBlocks(allowed) => format!(
                "no arrangement has the chains asked for; the equations allow {}",
                alternatives(allowed, ", then ")
            ),
            Self::NoChain => "no chain starts at a measured state".into(),
            Self::OutOfReach(left) => {
                format!("no chain reaches {}; measure another output", all(left))
            }
            Self::BlockBreaks { of, new } => format!(
                "the equation of {of} depends on {} at once, beside measured states and earlier chains; a block has one new state per equation",
                all(new)
            ),
            Self::OrdersLeft(why) => format!(
                "{}; not every order of the outputs was tried: give it",
                why.words()
            ),
            Self::NothingUnknown => {
                "no input is unknown; name those that nobody measures under 'unknown'".into()
            }
            Self::UnknownMeasured(input) => {
                format!("the unknown input {input} is measured itself; leave it out of 'unknown'")
            }
            Self::FewOutputs {
                count,
                needed,
                unknown,
                revealed,
            } => format!(
                "{count} measured outputs are too few: (H4) needs at least {needed}, one for each unknown input ({}) and each state that the measured equations reveal ({}); measure another output",
                all(unknown),
                match revealed.is_empty() {
                    true => "at least one".into(),
                    false => all(revealed),
                }
            ),
            Self::Unaffine { of, input } => format!(
                "the equation of {of} is not affine in the unknown input {input}; (H3) asks for f̃ + G v"
            ),
            Self::HiddenFactor { of, input, reads } => format!(
                "in the equation of {of} the factor of {input} depends on {}, which is not measured; (H3) asks for a factor that is known",
                all(reads)
            ),
            Self::LayerGrows { layer, next } => format!(
                "the equations of {} depend on {} at once; the form (1) asks that each layer has no more states than the one before",
                all(layer),
                all(next)
            ),
            Self::NotRead(left) => format!(
                "no equation on the way from the measured states reads {}; measure another output",
                all(left)
            ),
            Self::NoWay(left) => format!(
                "no equation on the way from the outputs depends on {}; measure another output",
                all(left)
            ),
            Self::NotAffine {
                of,
                is_output,
                states,
                by,
                expression,
            } => {
                let what = if *is_output { "output" } else { "equation of" };
                let why = match by {
                    Some(by) => format!("∂/∂{by} = {expression}"),
                    None => format!("it switches with {expression}"),
                };
                format!("the {what} {of} is not affine in {}: {why}", all(states))
            }
            Self::InputNotAffine { of, input } => format!(
                "the equation of {of} is not affine in the input {input}; the form is x' = f(x) + g(x)u"
            ),
            Self::OutputReadsInput { output, input } => {
                format!("the output {output} reads the input {input}; the form is y = h(x)")
            }
        }
    }
}

fn last(chain: &[String]) -> &str {
    chain.last().map_or("", String::as_str)
}

/// `(a → b) and (c) or (a) and (c → b)`
fn alternatives(allowed: &[Vec<Vec<String>>], between: &str) -> String {
    let one = |all: &Vec<Vec<String>>| chains(all, between);
    let all: Vec<String> = allowed.iter().map(one).collect();
    all.join(" or ")
}
