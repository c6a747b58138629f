"""Sections of studies and their keys, for type checkers: what :class:`lynkeus.Study` and its ``replace`` take.

A dictionary that is written in the call is checked by itself. One that is made beforehand says what it is::

    from lynkeus.sections import ObserverSection

    observer: ObserverSection = {"family": "triangular", "theta": 2.0}

A key that is ``None`` is left out. Written by ``python/sections.py`` from the JSON Schema of study files.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Literal, NotRequired, TypeAlias, TypedDict

from ._types import Matrix, Names, Nested, Number, Numbers, Whole
from .model import Model

#: names of observer families
Family: TypeAlias = Literal[
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
]


class SensorsNoise(TypedDict):
    """A value of ``noise`` in ``[sensors]``."""

    uniform: Number
    """every error up to ± this, in the output's unit, is equally likely and none is larger (number ≥ 0;
    default: required)"""


class SensorsInputNoise(TypedDict):
    """A value of ``input_noise`` in ``[sensors]``."""

    uniform: Number
    """every error up to ± this, in the output's unit, is equally likely and none is larger (number ≥ 0;
    default: required)"""


class SensorsSection(TypedDict, total=False):
    """what is measured, what is unknown, how noisy (table; default: none)"""

    limits: Mapping[str, Numbers] | None
    """the range that a sensor can show. `simulate` clips readings to it, and `certify` proves nothing where
    readings may leave it. A reading at an end only says "at most" or "at least": the filters treat it as
    censored, and `--how-well` counts the information of a clipped reading (Fisher's); the other families
    use it unchanged, and a note counts such readings (table: output = `[lowest, highest]`; default: none)"""

    measured: Names | None
    """the outputs with a sensor. The order counts: the first entry of `theta`, `S`, … belongs to the chain of
    the first measured output (list of outputs; default: every output of the model)"""

    unknown: Names | None
    """inputs that nobody measures, estimated along with the state; and parameters, estimated as constants
    (list of inputs and parameters; default: none)"""

    disturbances: Names | None
    """inputs that act on the plant and that the observer takes as zero (list of inputs; default: none)"""

    noise: Mapping[str, Number | str | SensorsNoise] | None
    """white measurement noise: its standard deviation, in the output's unit or as a share of its present
    value; or uniform noise, every error up to ± the number (in the output's unit) equally likely and none
    larger. Used by `simulate`, `tune`, the filters, `check --how-well` and `certify` (table: output =
    number, text `"5%"`, or `{ uniform = number }`; default: no noise)"""

    input_noise: Mapping[str, Number | str | SensorsInputNoise] | None
    """error of the reading of a known input, given as in `noise`: the plant gets the input, the observer
    reads it with an error that each row draws again and holds until the next (noisy inputs). Counted by
    the filters, their smoothers, `sd`, `fit` and `--how-well`; `simulate` draws it (table: known input =
    number, text `"5%"`, or `{ uniform = number }`; default: no noise)"""

    correlation: Mapping[str, Mapping[str, Number]] | None
    """correlation of the noises of two outputs, between −1 and 1: `{ left = { right = 0.6 } }`, each pair
    once. Both have a standard deviation in `noise`. Counted by the filters, their smoothers, `fit` and
    `--how-well`; `simulate` draws it (table: output = table: another output = number; default: independent
    noises)"""

    bias: Mapping[str, Number] | None
    """a constant offset of a sensor, estimated along with the state, y = h + b or f(u − b): a state
    `NAME_bias` that starts at 0. The number is its standard deviation there, for the filters; with a
    density in `[process_noise]` it wanders (table: output or known input = number; default: none)"""

    plausible: Mapping[str, Numbers] | None
    """a cell of a log outside of this range is no reading; a note counts such cells (table: output =
    `[lowest, highest]`; default: none)"""

    repeats: Mapping[str, Literal["missing"]] | None
    """a cell of a log that equals the one before is no reading: the logger held the value of a slower sensor
    (table: output = `"missing"`; default: every cell is a reading)"""

    frozen: Mapping[str, Whole] | None
    """after so many equal cells in a row, further ones are no readings until the value changes: the sensor is
    frozen (table: output = whole number; default: none)"""

    delay: Mapping[str, Number] | None
    """delay of a reading after its sample, in the plant's unit of time: the reading in a row at t is of t
    minus this (late readings) (table: output = number; default: none)"""

    taken_at: Mapping[str, str] | None
    """the column of a log, or an expression of columns, with the time at which the sample of the row's
    reading was taken, as of an assay that comes hours later (late readings) (table: output = column;
    default: none)"""


#: spectral density (variance per unit of time) of white noise on a state's derivative; for an unknown input,
#: how fast it wanders. Read by the filters, `sd` and `--how-well`; `simulate` moves the plant's states by it,
#: and `certify` then bounds the error in mean square (table: name = number ≥ 0; default: 0; for an unknown
#: input, from its range and the log's length)
ProcessNoiseSection: TypeAlias = Mapping[str, Number | None]


#: values that replace those of the plant (table: name = number; default: none)
ParametersSection: TypeAlias = Mapping[str, Number | None]


class ManifoldSection(TypedDict, total=False):
    """which states and outputs are angles or rotations, for the filters (table; default: none)"""

    circle: Names | None
    """angles in radians: θ and θ + 2π are the same. Innovations and errors are wrapped, the box has no ends
    there, and estimates are shown in the declared range (`min` and `max`, or `[box]`) if that is one turn,
    else unwrapped. An output that turns with such a state is an angle as well (list of states and outputs;
    default: none)"""

    quaternion: Names | None
    """attitudes: arrays `Real q[4]` of states, a unit quaternion with the scalar first, whose equation is q'
    = ½ q⊗(0, ω). `initial_variance`, `[process_noise]`, `spread` and `NAME_sd` are those of the vector of
    a small rotation about the body's axes, in rad: one number for the array, and one column (list of
    states; default: none)"""


class ObserverS(TypedDict):
    """A value of ``S`` in ``[observer]``."""

    diag: Numbers
    """on the diagonal (list of n numbers; default: required)"""

    off: Numbers
    """beside it (list of n − 1 numbers; default: required)"""


class ObserverTransient(TypedDict):
    """triangular, block-triangular: another θ up to a time, then the study's; `fall` is the time constant of
    a smooth change (`{ theta = …, until = …, fall = … }`; default: none)"""

    theta: Number | Numbers
    """θ at the start (number > 0, or one per chain; default: required)"""

    until: Number
    """the time up to which it holds, on the axis of the study (number; default: required)"""

    fall: NotRequired[Number]
    """the time constant of the change (number > 0; default: at once)"""


class ObserverSection(TypedDict, total=False):
    """the observer family and its tuning"""

    family: Family | None
    """the observer family; `auto` takes the first with a theorem that is proved to fit, has its keys and is
    fast enough for the run, else `ekf` (`"auto"`, `"triangular"`, `"block-triangular"`, `"state-affine"`,
    `"drift-observable"`, `"unknown-input"`, `"ekf"`, `"ukf"`, `"mhe"`, `"particle"`; default: `"auto"`)"""

    initial: Mapping[str, Number | Numbers] | None
    """where the estimate starts, `{ q = [1, 0, 0, 0] }`; `default` holds for everything not listed (table:
    name = number, an array = list of numbers, and `default`; default: the plant's start values)"""

    clamp: bool | None
    """the plant's functions see the estimate limited to `[min, max]`; the reported estimate is never altered
    (true, false; default: false)"""

    theta: Number | Numbers | None
    """triangular: the speed θ, in 1/(unit of time): larger converges faster, peaks higher and passes more
    noise (number > 0, or one per chain; default: required); or block-triangular: θᵢ (number > 0, or one
    per chain; default: required); or state-affine: the speed θ, in 1/(unit of time): the gain of block k
    grows like θ^k. Theorem 1 is stated for θ ≥ 1, so choose a unit of time in which the entries of F are
    of the order of 1 (number > 0; default: required); or unknown-input: θ1 for the unknown inputs and x₁¹,
    θ2 for the rest (list of two numbers > 0, [θ1, θ2]; default: from the proof, where a bound exists)"""

    delta: Number | Numbers | None
    """triangular: the exponents δ of θ (number > 0, or one per chain; default: 1, and the middle of Theorem
    2's window)"""

    r: Number | Numbers | None
    """triangular: the factor r of the gain; with Lemma 1 its ρ/2 (number > 0, or one per chain; default: 1)"""

    gain: Literal["lemma1", "lmi"] | None
    """triangular: where the gain comes from: Lemma 1's S (unless `S` is given), or a linear matrix inequality
    (`"lemma1"`, `"lmi"`; default: `"lemma1"`); or block-triangular: a certified gain instead of the
    paper's (`"lmi"`; default: by `k` or `k_poles`)"""

    S: Sequence[ObserverS] | None
    """triangular: explicit tridiagonal matrices: n numbers on the diagonal, n − 1 beside it (list of `{ diag
    = […], off = […] }`, one per chain; default: Lemma 1's)"""

    partials: bool | None
    """triangular: divide the gain by the chain's partials at the estimate (true, false; default: false)"""

    chains: Sequence[Names] | None
    """triangular, block-triangular: the states of each chain, from the sensor outward (list of lists of
    names; default: found)"""

    leading: str | None
    """triangular: which of several chains plays the first part in Theorem 2, where more than one can (name of
    a measured output; default: the first chain that can; with `delta`, one for which it lies in the
    window)"""

    prolong: bool | None
    """triangular, block-triangular: outside of the declared ranges the plant's functions are prolonged as the
    papers ask, so that the theorem holds for every start of the estimate (true, false; default: false); or
    state-affine: the observer runs on F(u, σ(x̂))x̂ + φ(u, σ(x̂)), σ the limits of the declared ranges, as
    A2 asks: the theorem then holds for every start of the estimate (true, false; default: false)"""

    rate: Number | None
    """triangular, block-triangular: the decay to be proved, in 1/(unit of time) (number > 0; default:
    required with `"lmi"` unless `gain_limit` is given)"""

    gain_limit: Number | None
    """triangular, block-triangular: the largest entry of the gain K on ŷ − y, with `"lmi"` (number > 0;
    default: none)"""

    minimise: Literal["noise", "gain", "peak"] | None
    """triangular, block-triangular: what the gain makes small at that rate, with `"lmi"` (`"noise"`,
    `"gain"`, `"peak"`; default: `"noise"`)"""

    innovation_limit: Number | Numbers | None
    """triangular, block-triangular: the correction sees the innovation limited to ± this: a remedy against
    peaking (number > 0, or one per output; default: none)"""

    transient: ObserverTransient | None
    """triangular, block-triangular: another θ up to a time, then the study's; `fall` is the time constant of
    a smooth change (`{ theta = …, until = …, fall = … }`; default: none)"""

    form: Literal["standard", "low-power"] | None
    """triangular, block-triangular: the observer with gains of order θ² at most, with `low_power_poles` or
    `low_power_k` (`"standard"`, `"low-power"`; default: `"standard"`)"""

    low_power_poles: Matrix | None
    """triangular, block-triangular: with `form = "low-power"`: the eigenvalues of the form's error system
    (one list per chain of 2n − 2 negative numbers; default: −1, −1, …)"""

    low_power_k: Sequence[Matrix] | None
    """triangular, block-triangular: with `form = "low-power"`: its coefficients (one list per chain of a pair
    `[k1, k2]` per state but the last; default: by `low_power_poles`)"""

    k: Matrix | None
    """block-triangular: Kᵢ: the coefficients that place the poles of Aᵢ − KᵢCᵢ (list of lists of numbers, one
    per chain; default: poles at −1)"""

    k_poles: Matrix | None
    """block-triangular: the eigenvalues of Aᵢ − KᵢCᵢ, instead of `k` (list of lists of negative numbers, one
    per chain; default: −1, −1, …)"""

    correction: Literal["lee", "classical"] | None
    """block-triangular: observer (7), or (3) (`"lee"`, `"classical"`; default: `"lee"`)"""

    order: Names | None
    """block-triangular: the order of the blocks (list of every measured output; default: searched)"""

    S0: Number | Matrix | None
    """state-affine: S(0) = s·I, or the matrix; rows and columns in the order of the plant's states, then the
    unknown inputs (number s > 0, or a matrix as a list of rows; default: 1)"""

    alarm: Number | None
    """state-affine: the flag is raised where `excitation` is below this (number > 0; default: see below)"""

    partition: Names | None
    """unknown-input: the outputs of x₁¹ (list of measured outputs; default: found)"""

    variant: Literal["bounded", "theoretical", "practical"] | None
    """drift-observable: which observer (`"bounded"`, `"theoretical"`, `"practical"`; default: see above)"""

    poles: Nested | None
    """drift-observable: the eigenvalues of A − KC, see below (n poles; for several outputs one list of μ_i
    each, or the slowest pole of each; default: required, or `alpha`)"""

    alpha: Number | None
    """drift-observable: the decay α: poles by Lemma 3.2 instead, see below (number > 0; default: required, or
    `poles`); or ukf: α, the spread of the sigma points: λ = α²(n + κ) − n (number > 0; default: 1)"""

    beta: Number | None
    """drift-observable: poles by Lemma 3.2 instead, with `alpha`, see below (number > 0; default: 1); or ukf:
    β, what the first weight of the covariance gets on top (number; default: 0)"""

    gamma: Number | None
    """drift-observable: poles by Lemma 3.2 instead, with `alpha`, see below (number > 0; default: required
    with `alpha`)"""

    filter_poles: Number | Numbers | Matrix | Mapping[str, Number | Numbers | Matrix] | None
    """drift-observable: the eigenvalues of the input filter (n − r poles or the slowest; for several inputs a
    table `{ u = […], v = […] }`; default: 10 times the slowest pole, each 1.2 times the one before)"""

    filter_initial: Number | Numbers | Mapping[str, Number | Numbers] | None
    """drift-observable: x̂ₐ(0) (as `filter_poles`; default: the input's start value, then zeros)"""

    indices: Whole | Sequence[Whole] | None
    """drift-observable: how many derivatives of each output count (a whole number per measured output;
    default: found)"""

    input_derivatives: Number | Numbers | Mapping[str, Number | Numbers] | None
    """drift-observable: bounds of |u'|, …, |u^(n−r)|, read by guarantees only (n − r numbers; for several
    inputs a table; default: those of `[certify]`)"""

    initial_variance: Mapping[str, Number | Numbers] | None
    """ekf, ukf, mhe, particle: how uncertain the first estimate is: the variance of each state and unknown
    input; `default` holds for everything not listed (table: name = number ≥ 0, an array = list of them,
    and `default`; default: the square of a quarter of the declared range (without a range: of the start
    value, or 1; of an angle or a rotation: of a turn))"""

    gate: Number | None
    """ekf, ukf, mhe, particle: a reading whose innovation exceeds so many of its standard deviations is
    rejected and counted (number > 0; default: none)"""

    gate_patience: Whole | None
    """ekf, ukf, mhe, particle: after so many rejections of a sensor in a row, at least half of which moved,
    its next reading is accepted (whole number ≥ 1; default: 10)"""

    bounds: Literal["project"] | None
    """ekf, ukf: "project" keeps the estimate in the declared ranges `[min, max]`: each prediction and
    correction moves it to the nearest point inside in the metric of the covariance, so that correlated
    quantities move along; the covariance stays ("project"; default: none)"""

    iterations: Whole | None
    """ekf: how often, at most, the readings of a sample are linearised: about the prediction, then about the
    resulting estimate, until it stays (the iterated extended Kalman filter); for a start that is far off,
    with nonlinear sensors (whole number ≥ 1; default: 1; 20 with a quaternion)"""

    kappa: Number | None
    """ukf: κ, with n + κ above 0; the defaults make the cubature filter (number; default: 0)"""

    horizon: Whole | None
    """mhe: number of samples in the window that is estimated at each sample, within `[min, max]` (whole
    number ≥ 1; default: 10)"""

    particles: Whole | None
    """particle: how many; the error that they add falls with the root of their number (whole number ≥ 2;
    default: 1000)"""

    proposal: Literal["bootstrap", "auxiliary", "ensemble"] | None
    """particle: "bootstrap": particles run, then are weighed; "auxiliary": those are drawn to run that the
    flow without noise takes to where the next readings are likely, which pays where readings are precise
    and the process noise is small; "ensemble": none is weighed, and readings move all together by Kalman's
    formula with their covariances, for many states that few runs of the plant have to stand for
    (`"bootstrap"`, `"auxiliary"`, `"ensemble"`; default: `"bootstrap"`)"""

    inflation: Number | None
    """particle: of an ensemble: by this factor the particles are farther from their mean after each update,
    which makes up for their small number (number; default: 1)"""

    resample_below: Number | None
    """particle: particles are resampled when their effective number falls below this share of them; 1: after
    every reading (number in [0.0, 1.0]; default: 0.5)"""

    seed: Whole | None
    """particle: of the random numbers: the same seed gives the same digits, on any number of threads (whole
    number ≥ 0; default: 0)"""


#: ranges narrower than the model's `min` and `max` (table: name = number, or `[smallest, largest]`; default:
#: none)
BoxSection: TypeAlias = Mapping[str, Number | Numbers | None]


class CertifySection(TypedDict, total=False):
    """assumptions of a guarantee (table; default: none)"""

    tube: Number | None
    """every state stays within this distance of its start value, too (number > 0; default: none)"""

    start: Mapping[str, Number | Numbers] | None
    """from where the plant starts: ranges of states, and of unknown inputs that stay constant. `certify` then
    proves or refutes that the plant stays in the box until `until`; a state that is not listed starts
    where the simulation starts (table: name = number, or `[smallest, largest]`; default: none)"""

    until: Number | None
    """until when, in the plant's unit of time (number > `start` of `[simulate]`; default: that of
    `[simulate]`)"""

    slew: Mapping[str, Number] | None
    """bounds of the rates of change of unknown inputs (table: unknown input = number > 0; default: 0:
    constant)"""

    input_derivatives: Mapping[str, Number | Numbers] | None
    """bounds of |u'|, |u''|, …, for theorems that need them (table: known input = number ≥ 0, or a list of
    them; default: none)"""


class SimulateSection(TypedDict, total=False):
    """how the plant and its observer are simulated (table; default: none)"""

    until: Number | None
    """the last instant (number > `start`; default: required)"""

    start: Number | None
    """the first instant (number; default: 0)"""

    output_step: Number | None
    """spacing of the rows of the result (number > 0; default: 500 rows)"""

    sample_step: Number | None
    """spacing of the sensor's samples where there is noise (number > 0; default: `output_step`)"""

    inputs: Mapping[str, Number | str] | None
    """the plant's inputs, the unknown ones included; `pi` is known (table: name = number, or Modelica
    expression of `time` as text; default: the inputs' start values)"""

    initial: Mapping[str, Number | Numbers] | None
    """where the *plant* starts (table: name = number, an array = list of numbers; default: the plant's start
    values)"""

    seed: Whole | None
    """seed of the noise and of `spread` (whole number ≥ 0; default: 0)"""

    spread: Mapping[str, Number] | None
    """standard deviation by which `simulate` moves where the plant starts, and the plant's parameters, from
    run to run (normal, by the seed); the observer keeps the values of the model (table: state or parameter
    (or an array of them) = number ≥ 0; default: none)"""

    method: Literal["adaptive", "explicit", "stiff", "rk4"] | None
    """step control with a solver chosen by the tool, with the explicit or the stiff one; or the classical
    Runge–Kutta method with fixed steps (`"adaptive"`, `"explicit"`, `"stiff"`, `"rk4"`; default:
    `"adaptive"`)"""

    rtol: Number | None
    """relative tolerance of the adaptive methods (number in [1e-13, 0.1]; default: 1e-9)"""

    atol: Number | None
    """absolute tolerance of the adaptive methods (number > 0; default: 1e-12)"""

    step: Number | None
    """longest step of `rk4` (number > 0; default: `substeps`)"""

    substeps: Whole | None
    """steps of `rk4` from one row to the next, where `step` is not given (whole number ≥ 1; default: 16)"""


class LogSection(TypedDict, total=False):
    """what the columns of a log are (table; default: none)"""

    time: str | None
    """the log's time column (text: a header, or an expression of headers; default: `"t"`; `"time"` where the
    log has an output or an input called `t`)"""

    columns: Mapping[str, str] | None
    """where the log names a signal differently, or has it in another unit: `T = "(T_F - 32)/1.8"` (table:
    name = header, or expression of headers; default: the plant's names)"""

    time_unit: str | None
    """the plant's unit of time, into which dates and durations are converted (a year has 365.25 days); it is
    also that of `[plot]` (`"ns"`, `"us"`, `"ms"`, `"s"`, `"min"`, `"h"`, `"d"`, `"week"`, `"year"`;
    default: seconds)"""

    time_format: str | None
    """what the times of a CSV file are written like: `"%d.%m.%Y %H:%M:%S"` (text in the directives of
    `strftime`; default: dates as in RFC 3339)"""

    decimal: Literal[".", ","] | None
    """the decimal mark of a CSV file; the other one groups thousands (`"."`, `","`; default: found out, or
    the column is refused)"""

    delimiter: str | None
    """what stands between the cells of a CSV file (text of one character; default: comma, semicolon or tab,
    whichever the header has most of)"""

    skip: Whole | None
    """lines of a CSV file before its header (whole number ≥ 0; default: 0)"""


class EstimateGeneratorPoles(TypedDict):
    """A value of ``generator.poles`` in ``[estimate]``."""

    re: Number
    """real part of both (number < 0; default: required)"""

    im: Number
    """imaginary part of one of them (number; default: required)"""


class EstimateGenerator(TypedDict):
    """A value of ``generator`` in ``[estimate]``."""

    poles: Number | EstimateGeneratorPoles | Sequence[Number | EstimateGeneratorPoles]
    """the filter's poles, as many as the observer reads of u, u', … or more; its gain is one (negative
    number, or a list of them and of pairs `{ re, im }`; default: required)"""

    initial: NotRequired[Number | Numbers]
    """u, u', … at the first row (number, or list of numbers; default: the input's start value, then zeros)"""

    command: NotRequired[str]
    """the log's column of what the filter reads (text; default: `"<input>_command"`)"""


class EstimateSection(TypedDict, total=False):
    """how a log is replayed (table; default: none)"""

    late: Number | None
    """how late a row may come, in units of time: it is put in its place; one that is later says that the
    clock jumped, and is refused (number > 0; default: ten usual steps)"""

    smooth: bool | None
    """also `<name>_smooth`, the estimate given all rows, later ones included (filters only) (true, false;
    default: false)"""

    lag: Whole | None
    """also `<name>_smooth`, the estimate that uses so many later rows: causal with that delay (whole number ≥
    1; default: none)"""

    sd: bool | None
    """also `<name>_sd`, the standard deviation of each estimate; with `smooth` or `lag` also
    `<name>_smooth_sd` (true, false; default: false)"""

    innovations: bool | None
    """also `<name>_innovation` and `<name>_innovation_sd` of each measured output: its reading minus the
    prediction, and the standard deviation of that (how they are judged) (true, false; default: false)"""

    ess: bool | None
    """also `ess` of a particle filter: how many particles count after each row, (Σw)²/Σw² (true, false;
    default: false)"""

    between_samples: Literal["hold", "predict", "linear"] | None
    """what the observer uses between two rows: the latest row, as a live observer does; the model's
    prediction from the latest reading (`w' = L_f h(x̂)`, the inter-sample predictor); or the straight line
    to the next, which looks ahead one sample (`"hold"`, `"predict"`, `"linear"`; default: `"hold"`)"""

    time: str | None
    """`time` of `[log]` (text; default: that of [`log]`)"""

    columns: Mapping[str, str] | None
    """`columns` of `[log]` (table: name = text; default: those of [`log]`)"""

    input_derivatives: Mapping[str, str | Names] | None
    """the log's columns of u', u'', … of a known input, for an observer that reads them (drift-observable,
    `variant = "theoretical"`) (table: input = text, or list of texts; default: none)"""

    generator: Mapping[str, Number | str | EstimateGenerator] | None
    """what makes a known input, for an observer that reads u', u'', …: see below (table: input = expression
    of `time`, or `{ poles, initial, command }`; default: none)"""

    strict: bool | None
    """refuse a log in which a cell that is read has no number, or whose times do not increase (`true`,
    `false`; default: `false`)"""

    method: Literal["adaptive", "explicit", "stiff", "rk4"] | None
    """step control with a solver chosen by the tool, with the explicit or the stiff one; or the classical
    Runge–Kutta method with fixed steps (`"adaptive"`, `"explicit"`, `"stiff"`, `"rk4"`; default:
    `"adaptive"`)"""

    rtol: Number | None
    """relative tolerance of the adaptive methods (number in [1e-13, 0.1]; default: 1e-9)"""

    atol: Number | None
    """absolute tolerance of the adaptive methods (number > 0; default: 1e-12)"""

    step: Number | None
    """longest step of `rk4` (number > 0; default: `substeps`)"""

    substeps: Whole | None
    """steps of `rk4` from one row to the next, where `step` is not given (whole number ≥ 1; default: 16)"""


#: A value of ``keys`` in ``[tune]``.
TuneKeys = TypedDict(
    "TuneKeys",
    # from: the first value (number; default: a quarter of the study's value)
    # to: the last value (number; default: four times the study's value)
    # points: how many, ends included (whole number ≥ 2; default: 21)
    # scale: equal ratios, or equal differences (`"log"`, `"linear"`; default: `"log"`)
    {
        "from": Number,
        "to": Number,
        "points": Whole,
        "scale": Literal["log", "linear"],
    },
    total=False,
)


class TuneSection(TypedDict, total=False):
    """which keys are swept, and how a value is judged (table; default: none)"""

    keys: Mapping[str, Numbers | TuneKeys | Mapping[str, Numbers | TuneKeys]] | None
    """what is swept; several keys make a grid. The values of a key that is a list, of `process_noise` and of
    `noise` as a whole are factors on all its numbers. `points` is 21, `scale` `"log"` (or `"linear"`)
    (table: key of `[observer]`, or an entry of one such as `"theta[1]"`; for filters also
    `process_noise.NAME` and `noise.OUTPUT` = list of numbers, or `{ from, to, points, scale }`; default:
    see tuning)"""

    tolerance: Number | None
    """error, as a share of the range, below which an estimate is settled (number between 0 and 1; default:
    0.05)"""

    disturbance: Mapping[str, Number | str] | None
    """added to inputs of the plant, unseen by the observer, for the ultimate bound (table: input = number, or
    expression of `time`; default: none)"""

    held_out: Number | None
    """on a log: share of each block that is held out (number between 0 and 1; default: 0.25)"""

    blocks: Whole | None
    """on a log: number of blocks (whole number ≥ 2; default: 20)"""


class FitPriors(TypedDict):
    """A value of ``priors`` in ``[fit]``."""

    mean: Number
    """the mean (number; default: required)"""

    sd: Number
    """the standard deviation (number > 0; default: required)"""


class FitCandidatesSensors(TypedDict):
    """A value of ``candidates.sensors`` in ``[fit]``."""

    uniform: Number
    """every error up to ± this, in the output's unit, is equally likely and none is larger (number ≥ 0;
    default: required)"""


class FitCandidates(TypedDict, total=False):
    """A value of ``candidates`` in ``[fit]``."""

    sensors: Mapping[str, Number | str | FitCandidatesSensors]
    """sensors of this experiment besides `measured`, with their noise (table: output or state = noise, as in
    `noise` of `[sensors]`; default: none)"""

    inputs: Mapping[str, Number | str]
    """known inputs; they are held from one row to the next (table: name = number, or Modelica expression of
    `time` as text; default: those of the first log, over again)"""

    every: Number
    """the usual time between two rows; sensors that report at some rows only do so at as many of them (number
    > 0; default: that of the first log)"""

    duration: Number
    """how long it lasts (number > 0; default: that of the first log)"""


class FitSection(TypedDict, total=False):
    """which parameters and noises are estimated from logs (fit) (table; default: none)"""

    parameters: Names | None
    """parameters of the plant to estimate, within the model's `min` and `max` or `bounds` (list of
    parameters; default: none)"""

    log: Names | None
    """those to search as logarithms: their ranges must be positive. Noises and densities always are (list of
    parameters; default: none)"""

    noise: bool | Names | Mapping[str, bool | str] | None
    """measured outputs whose noise is estimated; the search starts at `noise` of `[sensors]`, or at the
    scatter of the readings. In a table, a name says whose value the standard deviation is: `{ y = "s", z =
    "s" }` for a parameter that two sensors share; or a variable that computes it, of states and inputs,
    too (true, list of names, or table: output = true, parameter or variable; default: none)"""

    process_noise: bool | Names | None
    """states and unknown inputs whose spectral density is estimated; `true`: those with a density above 0 in
    `[process_noise]`, where the search starts. A density neither estimated nor declared is 0 (true, or
    list of names; default: none)"""

    initial: Names | None
    """states whose start is estimated, one for each log; their `initial_variance` counts as 0 (list of
    states; default: none)"""

    bounds: Mapping[str, Numbers] | None
    """ranges of the estimated values, by the name of a parameter or a state, or `"noise.level"`,
    `"process_noise.x"`, `"initial.x"` (table: name = `[least, greatest]`; default: `min` and `max` of the
    model)"""

    priors: Mapping[str, FitPriors] | None
    """prior knowledge: a normal distribution under the same names (table: name = table; default: none)"""

    objective: Literal["innovations", "simulation"] | None
    """the likelihood of the filter's innovations, or of the errors of the plant alone: then all errors are
    the sensors', and neither densities nor `initial_variance` are read (`"innovations"`, `"simulation"`;
    default: `"innovations"`)"""

    starts: Whole | None
    """searches: from the study's own values, then from seeded points spread over the bounds (whole number ≥
    1; default: 1, and 4 further ones where the first ends at a bound, without convergence or with errors
    that are not white)"""

    seed: Whole | None
    """seed of those points (whole number ≥ 0; default: 0)"""

    held_out: Number | None
    """share at the end of each log that is predicted, not fitted, and reported separately (number between 0
    and 1; default: none)"""

    candidates: Mapping[str, FitCandidates] | None
    """experiments that `--next-experiment` compares, under names of your choice (table: name = table;
    default: see the next experiment)"""


class CompareSection(TypedDict, total=False):
    """which families are compared (table; default: none)"""

    families: Names | None
    """what `compare` runs; each gets the keys of `[observer]` that it owns (list of families; default: every
    family that is not refuted, and the filters but `particle`)"""


class ServeMqtt(TypedDict):
    """the MQTT broker from which rows come and to which estimates go (serve) (table; default: none)"""

    url: str
    """address of the broker: `"mqtt://host:1883"`, or `"mqtts://host:8883"` for an encrypted connection
    (text; default: required)"""

    version: NotRequired[Literal["3.1.1", "5"]]
    """version of MQTT (`"3.1.1"`, `"5"`; default: `"3.1.1"`)"""

    user: NotRequired[str]
    """name of the user at the broker (text; default: none)"""

    password: NotRequired[str]
    """the user's password (text; default: the variable `LYNKEUS_MQTT_PASSWORD` of the environment, if there
    is one)"""

    ca: NotRequired[str]
    """PEM file of the authorities' certificates for the broker's (path, from the study's folder; default:
    those of the system)"""

    cert: NotRequired[str]
    """PEM file of this client's certificate, where the broker asks for one (path, from the study's folder;
    default: none)"""

    key: NotRequired[str]
    """PEM file of the private key of `cert` (path, from the study's folder; default: none)"""

    client: NotRequired[str]
    """the client's name at the broker, the same at each start; two clients with one name close each other's
    connection (text; default: `lynkeus-` and the name of the study's file)"""

    topics: NotRequired[Mapping[str, str]]
    """the topics of single values, by the names that columns have in a log. With `assets` a level `{asset}`
    of a topic is the asset's name (table: column = topic; default: none)"""

    rows: NotRequired[str]
    """the topic of whole rows as JSON objects (topic; default: none)"""

    publish: NotRequired[str]
    """the topic of the estimates, a JSON object for each line; `{asset}` in it is the asset's name (topic;
    default: none: nothing is published)"""

    status: NotRequired[str]
    """the topic that holds `online` as long as the service is connected, and `offline` after it (a last will)
    (topic; default: none)"""

    qos: NotRequired[Literal[0, 1]]
    """whether messages are acknowledged, and sent again until they are (1), or not (0) (0, 1; default: 1)"""

    retain: NotRequired[bool]
    """whether the broker keeps the last estimate for those who subscribe later (true, false; default: false)"""


class ServeOpcua(TypedDict):
    """the OPC UA server whose nodes are read and written (serve) (table; default: none)"""

    url: str
    """where the server is: `"opc.tcp://host:4840"`, with the path that it may have (text; default: required)"""

    nodes: Mapping[str, str]
    """the nodes that are read, by the names that columns have in a log: `level = "ns=2;s=Tank.Level"`. With
    `assets`, `{asset}` in a node is the asset's name (table: column = node; default: required)"""

    write: NotRequired[Mapping[str, str]]
    """the nodes that are written, by the names in the answers of `serve`: `upper_hat = "ns=2;s=Tank.Upper"`
    (table: estimate = node; default: none: nothing is written)"""

    interval: NotRequired[Number]
    """seconds between what the server sends; every change in between is in it (number in [0.01, 3600.0];
    default: 0.5)"""

    user: NotRequired[str]
    """who this is to the server (text; default: none: anonymous)"""

    password: NotRequired[str]
    """the user's password (text; default: the variable `LYNKEUS_OPCUA_PASSWORD` of the environment, if there
    is one)"""

    security: NotRequired[Literal["None", "Basic256Sha256", "Aes128_Sha256_RsaOaep", "Aes256_Sha256_RsaPss"]]
    """the security policy; with any but `None` messages are signed and encrypted (`"None"`,
    `"Basic256Sha256"`, `"Aes128_Sha256_RsaOaep"`, `"Aes256_Sha256_RsaPss"`; default: `"None"`)"""

    pki: NotRequired[str]
    """folder of certificates, where `security` needs them: `own/cert.der` and `private/private.pem` of this
    client (made if they are not there), `trusted/` for the server's (path, from the study's folder;
    default: `"pki"`)"""


class ServeSection(TypedDict, total=False):
    """how the estimator runs beside a plant (serve) (table; default: none)"""

    wait: Number | None
    """how late a row may come after newer ones, in the plant's unit of time: it is put in its place, and the
    estimates since are corrected (number ≥ 0; default: 0: rows come in the order of their times)"""

    state: str | None
    """the file that stores the estimator's state: a row is in it before it is answered, and after any end the
    next start continues from there (path, from the study's folder; default: none: each start is a new one)"""

    history: str | None
    """CSV or Parquet files of the published estimates, one for each day: `"tank-%Y-%m-%d.csv"` (path with
    `%Y`, `%m` and `%d`, from the study's folder; default: none)"""

    keep_days: Whole | None
    """number of days for which the history is kept (whole number ≥ 1; default: all)"""

    assets: str | None
    """the CSV file of many plants of this study: their names under `asset`, and their own parameters in the
    other columns (path, from the study's folder; default: one plant, and messages without a name)"""

    http: str | None
    """address of the page with the estimates, of their events, `/estimates` and `/metrics`:
    `"127.0.0.1:8080"` (address and port; default: none)"""

    token: str | None
    """token that a request must carry, as `Authorization: Bearer …` or `?token=…` (text; default: none: only
    this machine has access)"""

    mqtt: ServeMqtt | None
    """the MQTT broker from which rows come and to which estimates go (serve) (table; default: none)"""

    opcua: ServeOpcua | None
    """the OPC UA server whose nodes are read and written (serve) (table; default: none)"""


class PlotSection(TypedDict, total=False):
    """what is drawn (table; default: none)"""

    show: Names | None
    """the quantities to draw, one panel each (list of names; default: unknown inputs, hidden states, then
    what is measured; six at most)"""

    time_unit: str | None
    """the unit on the time axis (text; default: that of [`log]`)"""


class Sections(TypedDict, total=False):
    """What :class:`lynkeus.Study` takes beside its model."""

    measured: Names | None
    """the outputs with a sensor. The order counts: the first entry of `theta`, `S`, … belongs to the chain of
    the first measured output (list of outputs; default: every output of the model)"""

    unknown: Names | None
    """inputs that nobody measures, estimated along with the state; and parameters, estimated as constants
    (list of inputs and parameters; default: none)"""

    disturbances: Names | None
    """inputs that act on the plant and that the observer takes as zero (list of inputs; default: none)"""

    noise: Mapping[str, Number | str | SensorsNoise] | None
    """white measurement noise: its standard deviation, in the output's unit or as a share of its present
    value; or uniform noise, every error up to ± the number (in the output's unit) equally likely and none
    larger. Used by `simulate`, `tune`, the filters, `check --how-well` and `certify` (table: output =
    number, text `"5%"`, or `{ uniform = number }`; default: no noise)"""

    limits: Mapping[str, Numbers] | None
    """the range that a sensor can show. `simulate` clips readings to it, and `certify` proves nothing where
    readings may leave it. A reading at an end only says "at most" or "at least": the filters treat it as
    censored, and `--how-well` counts the information of a clipped reading (Fisher's); the other families
    use it unchanged, and a note counts such readings (table: output = `[lowest, highest]`; default: none)"""

    sensors: SensorsSection | None
    """what is measured, what is unknown, how noisy (table; default: none)"""

    process_noise: ProcessNoiseSection | None
    """spectral density (variance per unit of time) of white noise on a state's derivative; for an unknown
    input, how fast it wanders. Read by the filters, `sd` and `--how-well`; `simulate` moves the plant's
    states by it, and `certify` then bounds the error in mean square (table: name = number ≥ 0; default: 0;
    for an unknown input, from its range and the log's length)"""

    parameters: ParametersSection | None
    """values that replace those of the plant (table: name = number; default: none)"""

    manifold: ManifoldSection | None
    """which states and outputs are angles or rotations, for the filters (table; default: none)"""

    observer: ObserverSection | Family | None
    """the observer family and its tuning"""

    box: BoxSection | None
    """ranges narrower than the model's `min` and `max` (table: name = number, or `[smallest, largest]`;
    default: none)"""

    certify: CertifySection | None
    """assumptions of a guarantee (table; default: none)"""

    simulate: SimulateSection | None
    """how the plant and its observer are simulated (table; default: none)"""

    log: LogSection | None
    """what the columns of a log are (table; default: none)"""

    estimate: EstimateSection | None
    """how a log is replayed (table; default: none)"""

    tune: TuneSection | None
    """which keys are swept, and how a value is judged (table; default: none)"""

    fit: FitSection | None
    """which parameters and noises are estimated from logs (fit) (table; default: none)"""

    compare: CompareSection | Names | None
    """which families are compared (table; default: none)"""

    serve: ServeSection | None
    """how the estimator runs beside a plant (serve) (table; default: none)"""

    plot: PlotSection | None
    """what is drawn (table; default: none)"""

    tables: Literal["linear", "monotone"] | None
    """how the plant's tables are interpolated: by straight lines, or monotone cubics, whose slopes do not
    jump (`"linear"`, `"monotone"`; default: `"linear"`)"""

    delay_states: Whole | None
    """states that represent each `delay` of the plant; at most 10 (whole number ≥ 1; default: 6)"""


class Changes(Sections, total=False):
    """What :meth:`lynkeus.Study.replace` takes, and each change of :meth:`lynkeus.Study.sweep`."""

    plant: Model | str | os.PathLike[str]
    """the model, or the path of one"""

    model: str | None
    """which model, where the text of the plant holds several"""
