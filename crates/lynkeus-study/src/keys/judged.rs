//! How runs are judged and shown: `[tune]`, `[compare]` and `[plot]`.

use lynkeus_observers::{KeySpec, Shape};

use super::EXPRESSION;

/// `[tune]`
pub(crate) const TUNE: [KeySpec; 5] = [
    KeySpec {
        name: "keys",
        shape: Shape::As(
            "table: key of `[observer]`, or an entry of one such as `\"theta[1]\"`; for filters also `process_noise.NAME` and `noise.OUTPUT` = list of numbers, or `{ from, to, points, scale }`",
            &Shape::Table(&Shape::Either(&[
                Shape::List(&Shape::Number),
                Shape::Section(&[&RANGE]),
                // `noise.y` is a table in a table
                Shape::Table(&VALUES),
            ])),
        ),
        default: "see [tuning](tune.md)",
        meaning: "what is swept; several keys make a grid. The values of a key that is a list, of `process_noise` and of `noise` as a whole are factors on all its numbers. `points` is 21, `scale` `\"log\"` (or `\"linear\"`)",
    },
    KeySpec {
        name: "tolerance",
        shape: Shape::Share,
        default: "0.05",
        meaning: "error, as a share of the range, below which an estimate is settled",
    },
    KeySpec {
        name: "disturbance",
        shape: Shape::As(
            "table: input = number, or expression of `time`",
            &Shape::Table(&EXPRESSION),
        ),
        default: "none",
        meaning: "added to inputs of the plant, unseen by the observer, for the ultimate bound",
    },
    KeySpec {
        name: "held_out",
        shape: Shape::Share,
        default: "0.25",
        meaning: "on a log: share of each block that is held out",
    },
    KeySpec {
        name: "blocks",
        shape: Shape::Whole(2),
        default: "20",
        meaning: "on a log: number of blocks",
    },
];

/// The values of a key.
const VALUES: Shape = Shape::Either(&[Shape::List(&Shape::Number), Shape::Section(&[&RANGE])]);

/// A range of values in `keys` of `[tune]`.
pub(crate) const RANGE: [KeySpec; 4] = [
    KeySpec {
        name: "from",
        shape: Shape::Number,
        default: "a quarter of the study's value",
        meaning: "the first value",
    },
    KeySpec {
        name: "to",
        shape: Shape::Number,
        default: "four times the study's value",
        meaning: "the last value",
    },
    KeySpec {
        name: "points",
        shape: Shape::Whole(2),
        default: "21",
        meaning: "how many, ends included",
    },
    KeySpec {
        name: "scale",
        shape: Shape::Word(&["log", "linear"]),
        default: "`\"log\"`",
        meaning: "equal ratios, or equal differences",
    },
];

/// `[compare]`
pub(crate) const COMPARE: [KeySpec; 1] = [KeySpec {
    name: "families",
    shape: Shape::As("list of families", &Shape::NAMES),
    default: "every family that is not refuted, and the filters",
    meaning: "what `compare` runs; each gets the keys of `[observer]` that it owns",
}];

/// `[plot]`
pub(crate) const PLOT: [KeySpec; 2] = [
    KeySpec {
        name: "show",
        shape: Shape::NAMES,
        default: "unknown inputs, hidden states, then what is measured; six at most",
        meaning: "the quantities to draw, one panel each",
    },
    KeySpec {
        name: "time_unit",
        shape: Shape::Text,
        default: "none",
        meaning: "the unit on the time axis",
    },
];
