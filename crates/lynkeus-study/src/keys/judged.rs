//! How runs are judged and shown: `[tune]`, `[fit]`, `[compare]` and `[plot]`.

use lynkeus_observers::{KeySpec, REQUIRED, Shape};

use super::{EXPRESSION, LEVEL};

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

/// All of a kind, or some by their names.
const CHOSEN: Shape = Shape::As(
    "true, or list of names",
    &Shape::Either(&[Shape::Flag, Shape::NAMES]),
);

/// The noise of an output.
const NOISE_OF: Shape = Shape::Either(&[Shape::Flag, Shape::Text]);

/// `[fit]`
pub(crate) const FIT: [KeySpec; 12] = [
    KeySpec {
        name: "parameters",
        shape: Shape::As("list of parameters", &Shape::NAMES),
        default: "none",
        meaning: "parameters of the plant to estimate, within the model's `min` and `max` or `bounds`",
    },
    KeySpec {
        name: "log",
        shape: Shape::As("list of parameters", &Shape::NAMES),
        default: "none",
        meaning: "those to search as logarithms: their ranges must be positive. Noises and densities always are",
    },
    KeySpec {
        name: "noise",
        shape: Shape::As(
            "true, list of names, or table: output = true, parameter or variable",
            &Shape::Either(&[Shape::Flag, Shape::NAMES, Shape::Table(&NOISE_OF)]),
        ),
        default: "none",
        meaning: "measured outputs whose noise is estimated; the search starts at `noise` of `[sensors]`, or at the scatter of the readings. In a table, a name says whose value the standard deviation is: `{ y = \"s\", z = \"s\" }` for a parameter that two sensors share; or a variable that computes it, of states and inputs, too",
    },
    KeySpec {
        name: "process_noise",
        shape: CHOSEN,
        default: "none",
        meaning: "states and unknown inputs whose spectral density is estimated; `true`: those with a density above 0 in `[process_noise]`, where the search starts. A density neither estimated nor declared is 0",
    },
    KeySpec {
        name: "initial",
        shape: Shape::As("list of states", &Shape::NAMES),
        default: "none",
        meaning: "states whose start is estimated, one for each log; their `initial_variance` counts as 0",
    },
    KeySpec {
        name: "bounds",
        shape: Shape::As(
            "table: name = `[least, greatest]`",
            &Shape::Table(&Shape::List(&Shape::Number)),
        ),
        default: "`min` and `max` of the model",
        meaning: "ranges of the estimated values, by the name of a parameter or a state, or `\"noise.level\"`, `\"process_noise.x\"`, `\"initial.x\"`",
    },
    KeySpec {
        name: "priors",
        shape: Shape::Table(&Shape::Section(&[&PRIOR])),
        default: "none",
        meaning: "prior knowledge: a normal distribution under the same names",
    },
    KeySpec {
        name: "objective",
        shape: Shape::Word(&["innovations", "simulation"]),
        default: "`\"innovations\"`",
        meaning: "the likelihood of the filter's innovations, or of the errors of the plant alone: then all errors are the sensors', and neither densities nor `initial_variance` are read",
    },
    KeySpec {
        name: "starts",
        shape: Shape::Whole(1),
        default: "1, and 4 further ones where the first ends at a bound, without convergence or with errors that are not white",
        meaning: "searches: from the study's own values, then from seeded points spread over the bounds",
    },
    KeySpec {
        name: "seed",
        shape: Shape::Whole(0),
        default: "0",
        meaning: "seed of those points",
    },
    KeySpec {
        name: "held_out",
        shape: Shape::Share,
        default: "none",
        meaning: "share at the end of each log that is predicted, not fitted, and reported separately",
    },
    KeySpec {
        name: "candidates",
        shape: Shape::Table(&Shape::Section(&[&CANDIDATE])),
        default: "see [the next experiment](fit.md#the-next-experiment)",
        meaning: "experiments that `--next-experiment` compares, under names of your choice",
    },
];

/// An experiment in `candidates` of `[fit]`.
pub(crate) const CANDIDATE: [KeySpec; 4] = [
    KeySpec {
        name: "sensors",
        shape: Shape::As(
            "table: output or state = noise, as in `noise` of `[sensors]`",
            &Shape::Table(&LEVEL),
        ),
        default: "none",
        meaning: "sensors of this experiment besides `measured`, with their noise",
    },
    KeySpec {
        name: "inputs",
        shape: Shape::As(
            "table: name = number, or Modelica expression of `time` as text",
            &Shape::Table(&EXPRESSION),
        ),
        default: "those of the first log, over again",
        meaning: "known inputs; they are held from one row to the next",
    },
    KeySpec {
        name: "every",
        shape: Shape::Positive,
        default: "that of the first log",
        meaning: "the usual time between two rows; sensors that report at some rows only do so at as many of them",
    },
    KeySpec {
        name: "duration",
        shape: Shape::Positive,
        default: "that of the first log",
        meaning: "how long it lasts",
    },
];

/// A prior of `[fit]`.
pub(crate) const PRIOR: [KeySpec; 2] = [
    KeySpec {
        name: "mean",
        shape: Shape::Number,
        default: REQUIRED,
        meaning: "the mean",
    },
    KeySpec {
        name: "sd",
        shape: Shape::Positive,
        default: REQUIRED,
        meaning: "the standard deviation",
    },
];

/// `[compare]`
pub(crate) const COMPARE: [KeySpec; 1] = [KeySpec {
    name: "families",
    shape: Shape::As("list of families", &Shape::NAMES),
    default: "every family that is not refuted, and the filters but `particle`",
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
        default: "that of [`[log]`](#log)",
        meaning: "the unit on the time axis",
    },
];
