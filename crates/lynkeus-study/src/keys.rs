//! Every key of a study but the families' own, in one place: refusals of unknown keys, the
//! tables in `docs/study.md` and the schema for editors come from here.

mod judged;

use std::ops::RangeInclusive;

use lynkeus_observers::{KeySpec, REQUIRED, Shape};
use lynkeus_run::Tolerances;

pub(super) use judged::{CANDIDATE, COMPARE, FIT, PLOT, PRIOR, RANGE, TUNE};

/// A number, or a Modelica expression of time.
const EXPRESSION: Shape = Shape::Either(&[Shape::Number, Shape::Text]);

/// The keys of the top level.
pub(super) const KEYS: [KeySpec; 5] = [
    KeySpec {
        name: "plant",
        shape: Shape::Text,
        default: "required by the command",
        meaning: "the Modelica file",
    },
    KeySpec {
        name: "model",
        shape: Shape::Text,
        default: "the file's only model",
        meaning: "which model, where the file holds several",
    },
    KeySpec {
        name: "parameters",
        shape: Shape::Table(&Shape::Number),
        default: "none",
        meaning: "values that replace those of the plant",
    },
    KeySpec {
        name: "tables",
        shape: Shape::Word(&["linear", "monotone"]),
        default: "`\"linear\"`",
        meaning: "how the plant's [tables](modelica.md#tables) are interpolated: by straight lines, or monotone cubics, whose slopes do not jump",
    },
    KeySpec {
        name: "delay_states",
        shape: Shape::Whole(1),
        default: "6",
        meaning: "states that represent each [`delay`](modelica.md#delays) of the plant; at most 10",
    },
];

/// The sections.
pub(super) const SECTIONS: [KeySpec; 14] = [
    KeySpec {
        name: "sensors",
        shape: Shape::Section(&[&SENSORS]),
        default: "none",
        meaning: "what is measured, what is unknown, how noisy",
    },
    KeySpec {
        name: "process_noise",
        shape: Shape::Table(&Shape::NotNegative),
        default: "0; for an unknown input, from its range and the log's length",
        meaning: "spectral density (variance per unit of time) of white noise on a state's derivative; for an unknown input, how fast it wanders. Read by the [filters](ekf.md), `sd` and `--how-well`; `simulate` moves the plant's states by it, and [`certify`](certificates.md) then bounds the error in mean square",
    },
    KeySpec {
        name: "manifold",
        shape: Shape::Section(&[&MANIFOLD]),
        default: "none",
        meaning: "which states and outputs are angles or rotations, for the [filters](ekf.md)",
    },
    KeySpec {
        name: "observer",
        shape: Shape::Section(&[&OBSERVER]),
        default: "none",
        meaning: "the observer family and its tuning",
    },
    KeySpec {
        name: "box",
        shape: RANGES,
        default: "none",
        meaning: "ranges narrower than the model's `min` and `max`",
    },
    KeySpec {
        name: "certify",
        shape: Shape::Section(&[&CERTIFY]),
        default: "none",
        meaning: "assumptions of a guarantee",
    },
    KeySpec {
        name: "simulate",
        shape: Shape::Section(&[&SIMULATE, &INTEGRATOR]),
        default: "none",
        meaning: "how the plant and its observer are simulated",
    },
    KeySpec {
        name: "log",
        shape: Shape::Section(&[&LOG]),
        default: "none",
        meaning: "what the columns of a log are",
    },
    KeySpec {
        name: "estimate",
        shape: Shape::Section(&[&ESTIMATE, &INTEGRATOR]),
        default: "none",
        meaning: "how a log is replayed",
    },
    KeySpec {
        name: "tune",
        shape: Shape::Section(&[&TUNE]),
        default: "none",
        meaning: "which keys are swept, and how a value is judged",
    },
    KeySpec {
        name: "fit",
        shape: Shape::Section(&[&FIT]),
        default: "none",
        meaning: "which parameters and noises are estimated from logs ([fit](fit.md))",
    },
    KeySpec {
        name: "compare",
        shape: Shape::Section(&[&COMPARE]),
        default: "none",
        meaning: "which families are compared",
    },
    KeySpec {
        name: "serve",
        shape: Shape::Section(&[&SERVE]),
        default: "none",
        meaning: "how the estimator runs beside a plant ([serve](serve.md))",
    },
    KeySpec {
        name: "plot",
        shape: Shape::Section(&[&PLOT]),
        default: "none",
        meaning: "what is drawn",
    },
];

/// How noisy a sensor is.
const LEVEL: Shape = Shape::Either(&[Shape::NotNegative, Shape::Text, Shape::Section(&[&NOISE])]);

/// `[sensors]`
pub(super) const SENSORS: [KeySpec; 13] = [
    KeySpec {
        name: "limits",
        shape: Shape::As(
            "table: output = `[lowest, highest]`",
            &Shape::Table(&Shape::List(&Shape::Number)),
        ),
        default: "none",
        meaning: "the range that a sensor can show. `simulate` clips readings to it, and `certify` proves nothing where readings may leave it. A reading at an end only says \"at most\" or \"at least\": the [filters](ekf.md) treat it as censored, and `--how-well` counts the information of a clipped reading (Fisher's); the other families use it unchanged, and a note counts such readings",
    },
    KeySpec {
        name: "measured",
        shape: Shape::As("list of outputs", &Shape::NAMES),
        default: "every output of the model",
        meaning: "the outputs with a sensor. The order counts: the first entry of `theta`, `S`, … belongs to the chain of the first measured output",
    },
    KeySpec {
        name: "unknown",
        shape: Shape::As("list of inputs and parameters", &Shape::NAMES),
        default: "none",
        meaning: "inputs that nobody measures, estimated along with the state; and parameters, estimated as constants",
    },
    KeySpec {
        name: "disturbances",
        shape: Shape::As("list of inputs", &Shape::NAMES),
        default: "none",
        meaning: "inputs that act on the plant and that the observer takes as zero",
    },
    KeySpec {
        name: "noise",
        shape: Shape::As(
            "table: output = number, text `\"5%\"`, or `{ uniform = number }`",
            &Shape::Table(&LEVEL),
        ),
        default: "no noise",
        meaning: "white measurement noise: its standard deviation, in the output's unit or as a share of its present value; or uniform noise, every error up to ± the number (in the output's unit) equally likely and none larger. Used by `simulate`, `tune`, the [filters](ekf.md), [`check --how-well`](precision.md) and [`certify`](certificates.md)",
    },
    KeySpec {
        name: "input_noise",
        shape: Shape::As(
            "table: known input = number, text `\"5%\"`, or `{ uniform = number }`",
            &Shape::Table(&LEVEL),
        ),
        default: "no noise",
        meaning: "error of the reading of a known input, given as in `noise`: the plant gets the input, the observer reads it with an error that each row draws again and holds until the next ([noisy inputs](#noisy-inputs-and-correlated-sensors)). Counted by the [filters](ekf.md), their smoothers, `sd`, `fit` and `--how-well`; `simulate` draws it",
    },
    KeySpec {
        name: "correlation",
        shape: Shape::As(
            "table: output = table: another output = number",
            &Shape::Table(&Shape::Table(&Shape::Number)),
        ),
        default: "independent noises",
        meaning: "correlation of the noises of two outputs, between −1 and 1: `{ left = { right = 0.6 } }`, each pair once. Both have a standard deviation in `noise`. Counted by the [filters](ekf.md), their smoothers, `fit` and `--how-well`; `simulate` draws it",
    },
    KeySpec {
        name: "bias",
        shape: Shape::As(
            "table: output or known input = number",
            &Shape::Table(&Shape::Positive),
        ),
        default: "none",
        meaning: "a constant offset of a sensor, estimated along with the state, y = h + b or f(u − b): a state `NAME_bias` that starts at 0. The number is its standard deviation there, for the [filters](ekf.md); with a density in `[process_noise]` it wanders",
    },
    KeySpec {
        name: "plausible",
        shape: Shape::As(
            "table: output = `[lowest, highest]`",
            &Shape::Table(&Shape::List(&Shape::Number)),
        ),
        default: "none",
        meaning: "a cell of a log outside of this range is no reading; a note counts such cells",
    },
    KeySpec {
        name: "repeats",
        shape: Shape::As(
            "table: output = `\"missing\"`",
            &Shape::Table(&Shape::Word(&["missing"])),
        ),
        default: "every cell is a reading",
        meaning: "a cell of a log that equals the one before is no reading: the logger held the value of a slower sensor",
    },
    KeySpec {
        name: "frozen",
        shape: Shape::As(
            "table: output = whole number",
            &Shape::Table(&Shape::Whole(1)),
        ),
        default: "none",
        meaning: "after so many equal cells in a row, further ones are no readings until the value changes: the sensor is frozen",
    },
    KeySpec {
        name: "delay",
        shape: Shape::As("table: output = number", &Shape::Table(&Shape::NotNegative)),
        default: "none",
        meaning: "delay of a reading after its sample, in the plant's unit of time: the reading in a row at t is of t minus this ([late readings](#late-readings))",
    },
    KeySpec {
        name: "taken_at",
        shape: Shape::As("table: output = column", &Shape::Table(&Shape::Text)),
        default: "none",
        meaning: "the column of a log, or an expression of columns, with the time at which the sample of the row's reading was taken, as of an assay that comes hours later ([late readings](#late-readings))",
    },
];

/// `{ uniform = … }` of `noise` in `[sensors]`
pub(super) const NOISE: [KeySpec; 1] = [KeySpec {
    name: "uniform",
    shape: Shape::NotNegative,
    default: REQUIRED,
    meaning: "every error up to ± this, in the output's unit, is equally likely and none is larger",
}];

/// `[manifold]`
pub(super) const MANIFOLD: [KeySpec; 2] = [
    KeySpec {
        name: "circle",
        shape: Shape::As("list of states and outputs", &Shape::NAMES),
        default: "none",
        meaning: "angles in radians: θ and θ + 2π are the same. Innovations and errors are wrapped, the box has no ends there, and estimates are shown in the declared range (`min` and `max`, or `[box]`) if that is one turn, else unwrapped. An output that turns with such a state is an angle as well",
    },
    KeySpec {
        name: "quaternion",
        shape: Shape::As("list of states", &Shape::NAMES),
        default: "none",
        meaning: "attitudes: arrays `Real q[4]` of states, a unit quaternion with the scalar first, whose equation is q' = ½ q⊗(0, ω). `initial_variance`, `[process_noise]`, `spread` and `NAME_sd` are those of the vector of a small rotation about the body's axes, in rad: one number for the array, and one column",
    },
];

/// `[observer]`, for every family.
pub(super) const OBSERVER: [KeySpec; 3] = [
    KeySpec {
        name: "family",
        shape: Shape::Word(&[
            "auto",
            "triangular",
            "block-triangular",
            "state-affine",
            "drift-observable",
            "unknown-input",
            "ekf",
            "ukf",
            "mhe",
            "particle",
        ]),
        default: "`\"auto\"`",
        meaning: "the observer family; `auto` takes the first with a theorem that is proved to fit, has its keys and is fast enough for the run, else `ekf`",
    },
    KeySpec {
        name: "initial",
        shape: Shape::As(
            "table: name = number, an array = list of numbers, and `default`",
            &Shape::Table(&Shape::Either(&[
                Shape::Number,
                Shape::List(&Shape::Number),
            ])),
        ),
        default: "the plant's start values",
        meaning: "where the estimate starts, `{ q = [1, 0, 0, 0] }`; `default` holds for everything not listed",
    },
    KeySpec {
        name: "clamp",
        shape: Shape::Flag,
        default: "false",
        meaning: "the plant's functions see the estimate limited to `[min, max]`; the reported estimate is never altered",
    },
];

/// Ranges by name.
const RANGES: Shape = Shape::As(
    "table: name = number, or `[smallest, largest]`",
    &Shape::Table(&Shape::Either(&[
        Shape::Number,
        Shape::List(&Shape::Number),
    ])),
);

/// `[certify]`
pub(super) const CERTIFY: [KeySpec; 5] = [
    KeySpec {
        name: "tube",
        shape: Shape::Positive,
        default: "none",
        meaning: "every state stays within this distance of its start value, too",
    },
    KeySpec {
        name: "start",
        shape: RANGES,
        default: "none",
        meaning: "from where the plant starts: ranges of states, and of unknown inputs that stay constant. `certify` then proves or refutes that [the plant stays in the box](certificates.md#the-plant-stays-in-the-box) until `until`; a state that is not listed starts where the simulation starts",
    },
    KeySpec {
        name: "until",
        shape: Shape::As("number > `start` of `[simulate]`", &Shape::Number),
        default: "that of `[simulate]`",
        meaning: "until when, in the plant's unit of time",
    },
    KeySpec {
        name: "slew",
        shape: Shape::As(
            "table: unknown input = number > 0",
            &Shape::Table(&Shape::Positive),
        ),
        default: "0: constant",
        meaning: "bounds of the rates of change of unknown inputs",
    },
    KeySpec {
        name: "input_derivatives",
        shape: Shape::As(
            "table: known input = number ≥ 0, or a list of them",
            &Shape::Table(&Shape::Either(&[
                Shape::NotNegative,
                Shape::List(&Shape::NotNegative),
            ])),
        ),
        default: "none",
        meaning: "bounds of &#124;u'&#124;, &#124;u''&#124;, …, for theorems that need them",
    },
];

/// The integrator, in `[simulate]` and `[estimate]`.
pub(super) const INTEGRATOR: [KeySpec; 5] = [
    KeySpec {
        name: "method",
        shape: Shape::Word(&["adaptive", "explicit", "stiff", "rk4"]),
        default: "`\"adaptive\"`",
        meaning: "step control with a solver chosen by the tool, with the explicit or the stiff one; or the classical Runge–Kutta method with fixed steps",
    },
    KeySpec {
        name: "rtol",
        shape: Shape::Between {
            least: *Tolerances::RELATIVE.start(),
            most: *Tolerances::RELATIVE.end(),
        },
        default: "1e-9",
        meaning: "relative tolerance of the adaptive methods",
    },
    KeySpec {
        name: "atol",
        shape: Shape::Positive,
        default: "1e-12",
        meaning: "absolute tolerance of the adaptive methods",
    },
    KeySpec {
        name: "step",
        shape: Shape::Positive,
        default: "`substeps`",
        meaning: "longest step of `rk4`",
    },
    KeySpec {
        name: "substeps",
        shape: Shape::Whole(1),
        default: "16",
        meaning: "steps of `rk4` from one row to the next, where `step` is not given",
    },
];

/// `[simulate]` without the integrator.
pub(super) const SIMULATE: [KeySpec; 8] = [
    KeySpec {
        name: "until",
        shape: Shape::As("number > `start`", &Shape::Number),
        default: REQUIRED,
        meaning: "the last instant",
    },
    KeySpec {
        name: "start",
        shape: Shape::Number,
        default: "0",
        meaning: "the first instant",
    },
    KeySpec {
        name: "output_step",
        shape: Shape::Positive,
        default: "500 rows",
        meaning: "spacing of the rows of the result",
    },
    KeySpec {
        name: "sample_step",
        shape: Shape::Positive,
        default: "`output_step`",
        meaning: "spacing of the sensor's samples where there is noise",
    },
    KeySpec {
        name: "inputs",
        shape: Shape::As(
            "table: name = number, or Modelica expression of `time` as text",
            &Shape::Table(&EXPRESSION),
        ),
        default: "the inputs' start values",
        meaning: "the plant's inputs, the unknown ones included; `pi` is known",
    },
    KeySpec {
        name: "initial",
        shape: Shape::As(
            "table: name = number, an array = list of numbers",
            &Shape::Table(&Shape::Either(&[
                Shape::Number,
                Shape::List(&Shape::Number),
            ])),
        ),
        default: "the plant's start values",
        meaning: "where the *plant* starts",
    },
    KeySpec {
        name: "seed",
        shape: Shape::Whole(0),
        default: "0",
        meaning: "seed of the noise and of `spread`",
    },
    KeySpec {
        name: "spread",
        shape: Shape::As(
            "table: state or parameter (or an array of them) = number ≥ 0",
            &Shape::Table(&Shape::NotNegative),
        ),
        default: "none",
        meaning: "standard deviation by which `simulate` moves where the plant starts, and the plant's parameters, from run to run (normal, by the seed); the observer keeps the values of the model",
    },
];

/// `{ re, im }` of a pole.
pub(super) const PAIR: [KeySpec; 2] = [
    KeySpec {
        name: "re",
        shape: Shape::As("number < 0", &Shape::Number),
        default: REQUIRED,
        meaning: "real part of both",
    },
    KeySpec {
        name: "im",
        shape: Shape::Number,
        default: REQUIRED,
        meaning: "imaginary part of one of them",
    },
];

/// A pole, or two conjugate ones.
const POLE: Shape = Shape::Either(&[Shape::Number, Shape::Section(&[&PAIR])]);

/// A filter under `generator` in `[estimate]`.
pub(super) const GENERATOR: [KeySpec; 3] = [
    KeySpec {
        name: "poles",
        shape: Shape::As(
            "negative number, or a list of them and of pairs `{ re, im }`",
            &Shape::Either(&[POLE, Shape::List(&POLE)]),
        ),
        default: REQUIRED,
        meaning: "the filter's poles, as many as the observer reads of u, u', … or more; its gain is one",
    },
    KeySpec {
        name: "initial",
        shape: Shape::As(
            "number, or list of numbers",
            &Shape::Either(&[Shape::Number, Shape::List(&Shape::Number)]),
        ),
        default: "the input's start value, then zeros",
        meaning: "u, u', … at the first row",
    },
    KeySpec {
        name: "command",
        shape: Shape::Text,
        default: "`\"<input>_command\"`",
        meaning: "the log's column of what the filter reads",
    },
];

/// `[log]`
pub(super) const LOG: [KeySpec; 7] = [
    KeySpec {
        name: "time",
        shape: Shape::As("text: a header, or an expression of headers", &Shape::Text),
        default: "`\"t\"`; `\"time\"` where the log has an output or an input called `t`",
        meaning: "the log's time column",
    },
    KeySpec {
        name: "columns",
        shape: Shape::As(
            "table: name = header, or expression of headers",
            &Shape::Table(&Shape::Text),
        ),
        default: "the plant's names",
        meaning: "where the log names a signal differently, or has it in another unit: `T = \"(T_F - 32)/1.8\"`",
    },
    KeySpec {
        name: "time_unit",
        shape: Shape::As(
            "`\"ns\"`, `\"us\"`, `\"ms\"`, `\"s\"`, `\"min\"`, `\"h\"`, `\"d\"`, `\"week\"`, `\"year\"`",
            &Shape::Text,
        ),
        default: "seconds",
        meaning: "the plant's unit of time, into which dates and durations are converted (a year has 365.25 days); it is also that of `[plot]`",
    },
    KeySpec {
        name: "time_format",
        shape: Shape::As("text in the directives of `strftime`", &Shape::Text),
        default: "dates as in RFC 3339",
        meaning: "what the times of a CSV file are written like: `\"%d.%m.%Y %H:%M:%S\"`",
    },
    KeySpec {
        name: "decimal",
        shape: Shape::Word(&[".", ","]),
        default: "found out, or the column is refused",
        meaning: "the decimal mark of a CSV file; the other one groups thousands",
    },
    KeySpec {
        name: "delimiter",
        shape: Shape::As("text of one character", &Shape::Text),
        default: "comma, semicolon or tab, whichever the header has most of",
        meaning: "what stands between the cells of a CSV file",
    },
    KeySpec {
        name: "skip",
        shape: Shape::Whole(0),
        default: "0",
        meaning: "lines of a CSV file before its header",
    },
];

/// `[estimate]` without the integrator.
pub(super) const ESTIMATE: [KeySpec; 12] = [
    KeySpec {
        name: "late",
        shape: Shape::Positive,
        default: "ten usual steps",
        meaning: "how late a row may come, in units of time: it is put in its place; one that is later says that the clock jumped, and is refused",
    },
    KeySpec {
        name: "smooth",
        shape: Shape::Flag,
        default: "false",
        meaning: "also `<name>_smooth`, the estimate given all rows, later ones included ([filters](ekf.md) only)",
    },
    KeySpec {
        name: "lag",
        shape: Shape::Whole(1),
        default: "none",
        meaning: "also `<name>_smooth`, the estimate that uses so many later rows: causal with that delay",
    },
    KeySpec {
        name: "sd",
        shape: Shape::Flag,
        default: "false",
        meaning: "also `<name>_sd`, the standard deviation of each estimate; with `smooth` or `lag` also `<name>_smooth_sd`",
    },
    KeySpec {
        name: "innovations",
        shape: Shape::Flag,
        default: "false",
        meaning: "also `<name>_innovation` and `<name>_innovation_sd` of each measured output: its reading minus the prediction, and the standard deviation of that ([how they are judged](credibility.md))",
    },
    KeySpec {
        name: "ess",
        shape: Shape::Flag,
        default: "false",
        meaning: "also `ess` of a [particle filter](particle.md): how many particles count after each row, (Σw)²/Σw²",
    },
    KeySpec {
        name: "between_samples",
        shape: Shape::Word(&["hold", "predict", "linear"]),
        default: "`\"hold\"`",
        meaning: "what the observer uses between two rows: the latest row, as a live observer does; the model's prediction from the latest reading (`w' = L_f h(x̂)`, the inter-sample predictor); or the straight line to the next, which looks ahead one sample",
    },
    KeySpec {
        name: "time",
        shape: Shape::Text,
        default: "that of [`[log]`](#log)",
        meaning: "`time` of `[log]`",
    },
    KeySpec {
        name: "columns",
        shape: Shape::Table(&Shape::Text),
        default: "those of [`[log]`](#log)",
        meaning: "`columns` of `[log]`",
    },
    KeySpec {
        name: "input_derivatives",
        shape: Shape::As(
            "table: input = text, or list of texts",
            &Shape::Table(&Shape::Either(&[Shape::Text, Shape::NAMES])),
        ),
        default: "none",
        meaning: "the log's columns of u', u'', … of a known input, for an observer that reads them ([drift-observable](drift-observable.md), `variant = \"theoretical\"`)",
    },
    KeySpec {
        name: "generator",
        shape: Shape::As(
            "table: input = expression of `time`, or `{ poles, initial, command }`",
            &Shape::Table(&Shape::Either(&[EXPRESSION, Shape::Section(&[&GENERATOR])])),
        ),
        default: "none",
        meaning: "what makes a known input, for an observer that reads u', u'', …: [see below](#what-makes-an-input)",
    },
    KeySpec {
        name: "strict",
        shape: Shape::As("`true`, `false`", &Shape::Flag),
        default: "`false`",
        meaning: "refuse a log in which a cell that is read has no number, or whose times do not increase",
    },
];

/// `[serve]`
pub(super) const SERVE: [KeySpec; 9] = [
    KeySpec {
        name: "wait",
        shape: Shape::NotNegative,
        default: "0: rows come in the order of their times",
        meaning: "how late a row may come after newer ones, in the plant's unit of time: it is put in its place, and the estimates since are corrected",
    },
    KeySpec {
        name: "state",
        shape: Shape::As("path, from the study's folder", &Shape::Text),
        default: "none: each start is a new one",
        meaning: "the file that stores the estimator's state: a row is in it before it is answered, and after any end the next start continues from there",
    },
    KeySpec {
        name: "history",
        shape: Shape::As(
            "path with `%Y`, `%m` and `%d`, from the study's folder",
            &Shape::Text,
        ),
        default: "none",
        meaning: "CSV or Parquet files of the published estimates, one for each day: `\"tank-%Y-%m-%d.csv\"`",
    },
    KeySpec {
        name: "keep_days",
        shape: Shape::Whole(1),
        default: "all",
        meaning: "number of days for which the history is kept",
    },
    KeySpec {
        name: "assets",
        shape: Shape::As("path, from the study's folder", &Shape::Text),
        default: "one plant, and messages without a name",
        meaning: "the CSV file of many plants of this study: their names under `asset`, and their own parameters in the other columns",
    },
    KeySpec {
        name: "http",
        shape: Shape::As("address and port", &Shape::Text),
        default: "none",
        meaning: "address of the page with the estimates, of their events, `/estimates` and `/metrics`: `\"127.0.0.1:8080\"`",
    },
    KeySpec {
        name: "token",
        shape: Shape::Text,
        default: "none: only this machine has access",
        meaning: "token that a request must carry, as `Authorization: Bearer …` or `?token=…`",
    },
    KeySpec {
        name: "mqtt",
        shape: Shape::Section(&[&MQTT]),
        default: "none",
        meaning: "the MQTT broker from which rows come and to which estimates go ([serve](serve.md#mqtt))",
    },
    KeySpec {
        name: "opcua",
        shape: Shape::Section(&[&OPCUA]),
        default: "none",
        meaning: "the OPC UA server whose nodes are read and written ([serve](serve.md#opc-ua))",
    },
];

/// Seconds between what a server of OPC UA sends.
pub(super) const INTERVALS: RangeInclusive<f64> = 0.01..=3600.0;

/// `opcua` in `[serve]`
pub(super) const OPCUA: [KeySpec; 8] = [
    KeySpec {
        name: "url",
        shape: Shape::Text,
        default: REQUIRED,
        meaning: "where the server is: `\"opc.tcp://host:4840\"`, with the path that it may have",
    },
    KeySpec {
        name: "nodes",
        shape: Shape::As("table: column = node", &Shape::Table(&Shape::Text)),
        default: REQUIRED,
        meaning: "the nodes that are read, by the names that columns have in a log: `level = \"ns=2;s=Tank.Level\"`. With `assets`, `{asset}` in a node is the asset's name",
    },
    KeySpec {
        name: "write",
        shape: Shape::As("table: estimate = node", &Shape::Table(&Shape::Text)),
        default: "none: nothing is written",
        meaning: "the nodes that are written, by the names in the answers of `serve`: `upper_hat = \"ns=2;s=Tank.Upper\"`",
    },
    KeySpec {
        name: "interval",
        shape: Shape::Between {
            least: *INTERVALS.start(),
            most: *INTERVALS.end(),
        },
        default: "0.5",
        meaning: "seconds between what the server sends; every change in between is in it",
    },
    KeySpec {
        name: "user",
        shape: Shape::Text,
        default: "none: anonymous",
        meaning: "who this is to the server",
    },
    KeySpec {
        name: "password",
        shape: Shape::Text,
        default: "the variable `LYNKEUS_OPCUA_PASSWORD` of the environment, if there is one",
        meaning: "the user's password",
    },
    KeySpec {
        name: "security",
        shape: Shape::Word(&[
            "None",
            "Basic256Sha256",
            "Aes128_Sha256_RsaOaep",
            "Aes256_Sha256_RsaPss",
        ]),
        default: "`\"None\"`",
        meaning: "the security policy; with any but `None` messages are signed and encrypted",
    },
    KeySpec {
        name: "pki",
        shape: Shape::As("path, from the study's folder", &Shape::Text),
        default: "`\"pki\"`",
        meaning: "folder of certificates, where `security` needs them: `own/cert.der` and `private/private.pem` of this client (made if they are not there), `trusted/` for the server's",
    },
];

/// `mqtt` in `[serve]`
pub(super) const MQTT: [KeySpec; 14] = [
    KeySpec {
        name: "url",
        shape: Shape::Text,
        default: REQUIRED,
        meaning: "address of the broker: `\"mqtt://host:1883\"`, or `\"mqtts://host:8883\"` for an encrypted connection",
    },
    KeySpec {
        name: "version",
        shape: Shape::Word(&["3.1.1", "5"]),
        default: "`\"3.1.1\"`",
        meaning: "version of MQTT",
    },
    KeySpec {
        name: "user",
        shape: Shape::Text,
        default: "none",
        meaning: "name of the user at the broker",
    },
    KeySpec {
        name: "password",
        shape: Shape::Text,
        default: "the variable `LYNKEUS_MQTT_PASSWORD` of the environment, if there is one",
        meaning: "the user's password",
    },
    KeySpec {
        name: "ca",
        shape: Shape::As("path, from the study's folder", &Shape::Text),
        default: "those of the system",
        meaning: "PEM file of the authorities' certificates for the broker's",
    },
    KeySpec {
        name: "cert",
        shape: Shape::As("path, from the study's folder", &Shape::Text),
        default: "none",
        meaning: "PEM file of this client's certificate, where the broker asks for one",
    },
    KeySpec {
        name: "key",
        shape: Shape::As("path, from the study's folder", &Shape::Text),
        default: "none",
        meaning: "PEM file of the private key of `cert`",
    },
    KeySpec {
        name: "client",
        shape: Shape::Text,
        default: "`lynkeus-` and the name of the study's file",
        meaning: "the client's name at the broker, the same at each start; two clients with one name close each other's connection",
    },
    KeySpec {
        name: "topics",
        shape: Shape::As("table: column = topic", &Shape::Table(&Shape::Text)),
        default: "none",
        meaning: "the topics of single values, by the names that columns have in a log. With `assets` a level `{asset}` of a topic is the asset's name",
    },
    KeySpec {
        name: "rows",
        shape: Shape::As("topic", &Shape::Text),
        default: "none",
        meaning: "the topic of whole rows as JSON objects",
    },
    KeySpec {
        name: "publish",
        shape: Shape::As("topic", &Shape::Text),
        default: "none: nothing is published",
        meaning: "the topic of the estimates, a JSON object for each line; `{asset}` in it is the asset's name",
    },
    KeySpec {
        name: "status",
        shape: Shape::As("topic", &Shape::Text),
        default: "none",
        meaning: "the topic that holds `online` as long as the service is connected, and `offline` after it (a last will)",
    },
    KeySpec {
        name: "qos",
        shape: Shape::OneOf(&[0, 1]),
        default: "1",
        meaning: "whether messages are acknowledged, and sent again until they are (1), or not (0)",
    },
    KeySpec {
        name: "retain",
        shape: Shape::Flag,
        default: "false",
        meaning: "whether the broker keeps the last estimate for those who subscribe later",
    },
];
