//! Numbers as people read them, and findings in sentences.

use std::fmt;

use crate::{Dimension, Point, Reason, Shown, Verdict, Witness};

/// Powers of ten between which numbers are written without an exponent.
const PLAIN: std::ops::Range<i32> = -5..6;

/// So many significant digits, without zeros at the end: `0.3`, `-12.5`, `1.2e-9`.
///
/// ```
/// use lynkeus_structure::figures;
/// assert_eq!(figures(0.1 + 0.2, 6), "0.3");
/// assert_eq!(figures(31.4159, 4), "31.42");
/// assert_eq!(figures(3e20, 4), "3e20");
/// ```
pub fn figures(value: f64, count: usize) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if !value.is_finite() {
        return format!("{value}");
    }
    let behind = count.saturating_sub(1);
    let scientific = format!("{value:.behind$e}");
    let (mantissa, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    // that of the rounded number
    let power: i32 = exponent.parse().unwrap_or(0);
    if !PLAIN.contains(&power) {
        return format!("{}e{power}", trimmed(mantissa));
    }
    let decimals = usize::try_from(behind as i32 - power).unwrap_or(0);
    trimmed(&format!("{value:.decimals$}")).to_owned()
}

/// Six significant digits.
pub fn short(value: f64) -> String {
    figures(value, 6)
}

fn trimmed(text: &str) -> &str {
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.'),
        false => text,
    }
}

/// `1 slope`, `2 slopes`, for a noun whose plural has an s.
pub fn counted(count: usize, noun: &str) -> String {
    let plural = if count == 1 { "" } else { "s" };
    format!("{count} {noun}{plural}")
}

impl fmt::Display for Point {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", short(self.value))?;
        for (i, c) in self.coordinates.iter().enumerate() {
            let word = if i == 0 { " at" } else { "," };
            write!(f, "{word} {} = {}", c.name, short(c.value))?;
        }
        Ok(())
    }
}

impl fmt::Display for Witness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "it is {}", told(self))
    }
}

/// The points of a witness.
pub(crate) fn told(witness: &Witness) -> String {
    let points: Vec<String> = witness.points.iter().map(Point::to_string).collect();
    points.join(" and ")
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Verdict::Proved => write!(f, "proved"),
            Verdict::Refuted(witness) => write!(f, "refuted: {witness}"),
            Verdict::Undecided(place) if place.is_empty() => write!(f, "undecided"),
            Verdict::Undecided(place) => {
                let sides: Vec<String> = place.iter().map(within).collect();
                write!(f, "undecided on {}", sides.join(", "))
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

impl Reason {
    /// The sentence.
    pub fn text(&self) -> String {
        let range = |low: f64, high: f64, open: bool| {
            let reserve = if open { " as far as can be proved" } else { "" };
            format!("lies in [{}, {}]{reserve}", short(low), short(high))
        };
        match self {
            Self::Text(text) => text.clone(),
            Self::Regular => "every operation examined".into(),
            Self::NoValue {
                operation,
                place,
                certain,
            } => {
                let word = if *certain { "has" } else { "may have" };
                format!("{operation} {word} no value{}", at(place))
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
            Self::ByJump(reason) => format!("{}, but only by a jump", reason.text()),
            Self::NoMeanValue(reason) => {
                format!("the mean value theorem does not apply: {}", reason.text())
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
            Self::FarApart => "whether points far apart are told apart is not decided".into(),
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
            " and loses rank (det F_{k}ᵀF_{k}: {witness}); convergence rests on inputs that do not stay there (A4)"
        ),
        Shown::Gram(reason) => format!("; det F_{k}ᵀF_{k} = {}", reason.text()),
    }
}

impl From<String> for Reason {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<&str> for Reason {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        for (value, text) in [
            (0.0, "0"),
            (-0.0, "0"),
            (0.5, "0.5"),
            (-1.0, "-1"),
            (1234567.8, "1.23457e6"),
            (123456.7, "123457"),
            (999999.7, "1e6"),
            (1e-9, "1e-9"),
            (-3.05684123e-9, "-3.05684e-9"),
            (0.000012, "0.000012"),
            (100.0, "100"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(short(value), text);
        }
    }

    #[test]
    fn nouns_are_counted() {
        assert_eq!(counted(1, "slope"), "1 slope");
        assert_eq!(counted(0, "state"), "0 states");
    }
}
