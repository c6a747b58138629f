"""What runs, sweeps, comparisons and live estimators report; see :mod:`lynkeus.reports`."""

from __future__ import annotations

from typing import ClassVar, Literal, TypedDict

from ._analyses import Declared, OutsideBox, SamplingLimits
from ._records import Named, Record


# runs


class QuantityError(Record):
    """The error of an estimate against the truth."""

    rms_last_half: float | None
    """root mean square over the last half of the rows, in the quantity's unit"""
    peak: float
    """the largest after the first row"""
    peak_at: float
    """its time"""
    settled_at: float | None
    """the time from which on it is within 5 % of the declared range"""
    within_2_sd: float | None
    """share of the last half within two standard deviations, where these are told"""
    rms_in_sd: float | None
    """root mean square in standard deviations: 1 where these are true"""


class Frozen(Record):
    """A sensor that hangs."""

    output: str
    """the measured output"""
    value: float
    """the number at which it hangs"""
    to: float
    """time of the last of the equal readings"""
    rows: int
    """number of them"""
    at_end_of_range: bool
    """whether that number is an end of what the log holds"""
    _ITEMS: ClassVar = {"from": float}

    @property
    def since(self) -> float:
        """The entry ``from``: time of the first of the equal readings."""
        return float(self["from"])


class Monitor(Record):
    """A monitor of the observer."""

    alarm_at: float | None
    """the first time at which it was below its alarm"""
    column: str
    """the header of its column"""


class InnovationCounts(Record):
    """The readings of a sensor beside what was expected of them."""

    taken: int
    """readings that were taken"""
    missing: int
    """readings that were missing"""
    rejected: int
    """readings that the gate rejected"""
    at_limit: int
    """readings at a limit of the sensor"""
    consistency: float | None
    """mean of (innovation/its standard deviation)²: 1 where noise is as declared"""
    consistency_last_half: float | None
    """the same over the last half of the rows"""


class Doubt(Record):
    """Something that speaks against a result."""

    kind: Literal["ended", "range", "innovations", "rejected", "frozen", "jump", "noise", "coloured"]
    """what it is about"""
    name: str
    """the quantity or sensor that it is of"""
    text: str
    """in words"""
    level: Literal["note", "warning", "refusal"]
    """how much it weighs; a refusal makes the result not credible"""


class Ended(Record):
    """Why a run ended before its last row."""

    message: str
    """in words"""
    by_limit: bool
    """whether a limit of time or memory ended it"""


class RunEntries:
    """What :meth:`lynkeus.Study.simulate` and :meth:`lynkeus.Study.estimate` answer."""

    plant: str
    """the name of the model"""
    family: str
    """the observer family"""
    chains: list[list[str]]
    """the states of each chain, from the sensor outward"""
    gains: Named[Named[float]]
    """the gain by measured output, then by state, of families with a constant one"""
    rows: int
    """number of rows"""
    estimates: Named[str]
    """headers of the estimates, by quantity"""
    final: Named[float]
    """the last estimate of each quantity, in its unit"""
    rms_error_last_half: Named[float]
    """root mean square error of each quantity over the last half of the rows, where its truth is known"""
    errors: Named[QuantityError]
    """errors of each quantity whose truth is known"""
    sampling: SamplingLimits | None
    """the log's samples beside what the observer stands"""
    frozen: list[Frozen]
    """sensors that hang"""
    monitors: Named[Monitor]
    """monitors of the observer"""
    outside_box: OutsideBox
    """where the run leaves the declared ranges"""
    innovations: Named[InnovationCounts]
    """of a filter, by sensor"""
    credible: bool
    """whether nothing speaks against the estimates"""
    declared: Declared
    """what of the study's declarations was counted"""
    ended: Ended | None
    """why it ended before its last row, where it did"""
    doubts: list[Doubt]
    """what speaks against the estimates"""
    warnings: list[str]
    """what of the log contradicts itself, or counts nowhere"""


class RunReport(RunEntries, Record):
    """The summary of a :class:`lynkeus.Simulation` or :class:`lynkeus.Estimation`."""

    columns: list[str]
    """headers of the columns"""
    notes: list[str]
    """what you should know"""


class Counted(Record):
    """Runs that went another way."""

    count: int
    """how many"""
    seeds: list[int]
    """their seeds"""
    first_reason: str | None
    """why the first of them did"""


class SettledErrors(Record):
    """Root mean square errors over the last half of the rows, over many runs."""

    mean: float | None
    """their mean"""
    q95: float | None
    """95 % of the runs are below"""
    worst: float | None
    """the worst"""
    worst_seed: int | None
    """the seed of the worst run"""


class Scattered(Record):
    """A quantity over many runs."""

    unit: str | None
    """its unit"""
    columns: list[str]
    """headers of its columns"""
    rms_last_half: SettledErrors
    """errors over the last half of the rows, in its unit"""
    within_2_sd: float | None
    """share of that within two standard deviations, where these are told"""
    rms_in_sd: float | None
    """root mean square in standard deviations: 1 where these are true"""


class MonteCarloEntries:
    """What :meth:`lynkeus.Study.simulate` answers with ``runs``."""

    plant: str
    """the name of the model"""
    family: str
    """the observer family"""
    runs: int
    """runs that were asked for"""
    completed: int
    """runs that came to their end"""
    failed: Counted
    """runs that did not"""
    not_credible: Counted
    """runs against which something speaks"""
    credible: bool
    """whether nothing speaks against the whole"""
    ended: Ended | None
    """why there are no more runs, where a limit ended them"""
    rows: int
    """number of rows"""
    quantities: Named[Scattered]
    """each estimated quantity"""


class MonteCarloReport(MonteCarloEntries, Record):
    """The summary of a :class:`lynkeus.MonteCarlo`."""

    notes: list[str]
    """what you should know"""


# tune


class SweptKey(Record):
    """A key that is swept."""

    key: str
    """the key of ``[observer]``"""
    factor: bool
    """whether its values are factors on all numbers of a list"""


class Peak(Record):
    """The largest error of a run."""

    name: str
    """the quantity"""
    estimate: float
    """its estimate there"""
    time: float
    """the time"""


class SweptRow(Record):
    """A tuning and its figures; errors are shares of the declared ranges."""

    mean_error: float | None
    """mean error, noise included; in simulation"""
    mean_error_exact: float | None
    """mean error without noise"""
    mean_error_noise: float | None
    """mean error that the noise makes"""
    settling_time: float | None
    """the time from which on the error is small"""
    peak_error: float | None
    """the largest error"""
    noise_gain: float | None
    """noise of the estimates beside that of the sensors"""
    ultimate_bound: float | None
    """the error in the end under ``disturbance``"""
    sampling_margin: float | None
    """the longest stable step beside the step of the samples"""
    held_out_error: float | None
    """error on samples that were held out; on a log"""
    innovation: float | None
    """innovation, root mean square"""
    ljung_box: float | None
    """Ljung–Box statistic per lag; of white innovations 1"""
    outside_band: float | None
    """share of autocorrelations outside of the 95 % band"""
    peak: Peak | None
    """the largest error, where it is known"""
    failure: str | None
    """why there are no figures"""
    _ITEMS: ClassVar = {"keys": Named[float]}

    @property
    def values_of_keys(self) -> Named[float]:
        """The entry ``keys``: the value of each key that is swept."""
        found: Named[float] = self["keys"]
        return found


class SweepEntries:
    """What :meth:`lynkeus.Study.tune` answers."""

    plant: str
    """the name of the model"""
    log: str | None
    """the log by which it was judged; ``None`` in simulation"""
    present: Named[float | None]
    """the study's own value of each key"""
    knee: SweptRow | None
    """the tuning of the least error"""
    nearly_as_good: list[float] | None
    """values of the first key whose error is within 10 % of that, ``[smallest, largest]``"""
    rows: list[SweptRow]
    """each tuning"""
    declared: Declared
    """what of the study's declarations was counted"""


class SweepReport(SweepEntries, Record):
    """The summary of a :class:`lynkeus.Sweep`; its entry ``keys`` are the :class:`SweptKey` of the sweep."""

    notes: list[str]
    """what you should know"""
    _ITEMS: ClassVar = {"keys": list[SweptKey]}


# compare


class ComparedSampling(Record):
    """The samples of a comparison."""

    interval: float
    """time between them"""
    chosen_by: Literal["study", "errors have settled", "cost"]
    """why that time"""


class Compared(Record):
    """A family in a comparison; one that was refused has ``family`` and ``refused`` only."""

    family: str
    """its name"""
    rms: Named[float | None]
    """root mean square error of each quantity over the last half of the rows, in its unit"""
    peak: float | None
    """the largest error after the first row, in widths of the declared ranges"""
    settling_time: float | None
    """time until every error stays within 5 % of its range; ``None`` where it does not"""
    roughness: float | None
    """scatter of the estimates from sample to sample, in widths of the declared ranges"""
    seconds_per_sample: float
    """computing time of a sample, in seconds"""
    credible: bool
    """whether nothing speaks against it"""
    doubts: list[Doubt]
    """what speaks against it"""
    refused: str | None
    """why it did not run, where it did not"""


class ComparisonEntries:
    """What :meth:`lynkeus.Study.compare` answers."""

    plant: str
    """the name of the model"""
    against: Literal["simulation", "log", "nothing"]
    """where the truth comes from"""
    sampling: ComparedSampling | None
    """the samples, in simulation"""
    families: list[Compared]
    """the families"""
    warnings: list[str]
    """what of the log contradicts itself, or counts nowhere"""


class ComparisonReport(ComparisonEntries, Record):
    """The summary of a :class:`lynkeus.Comparison`."""


# live estimation


class Innovation(TypedDict):
    """What the last reading of a sensor said."""

    innovation: float
    """the reading less what was expected, in the sensor's unit; NaN where there is none"""
    sd: float
    """the standard deviation of that"""
    expected: float
    """what was expected"""
    reading: Literal["missing", "taken", "rejected", "at a limit"]
    """what became of the reading"""


class SensorHealth(TypedDict):
    """Counts of a sensor's readings."""

    taken: int
    """readings that were taken"""
    missing: int
    """readings that were missing"""
    rejected: int
    """readings that the gate rejected"""
    at_limit: int
    """readings at a limit of the sensor"""
    locked_out: int
    """readings rejected in a row, up to now"""


class Health(TypedDict):
    """Counts of an estimator."""

    sensors: dict[str, SensorHealth]
    """by sensor"""
    inputs_held: int
    """values of known inputs that were missing, where the last one held"""
    confined: int
    """samples at which the estimate was put back to where the plant has values"""
    unsolved: int
    """samples at which a moving horizon did not come to its minimum"""
