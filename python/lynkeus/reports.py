"""What reports hold: the entries of ``answer.summary`` and their types.

Every object is a dictionary whose entries are attributes as well: ``run.errors.level.peak`` and
``run.summary["errors"]["level"]["peak"]`` are the same number. Type checkers see the attributes. Numbers are
in the units of the model, times in its unit of time, from the same origin as the log's or simulation's;
what is not known is ``None``. Written by ``python/reports.py`` from the JSON Schema of answers.
"""

from __future__ import annotations

from typing import ClassVar, Literal, TypeAlias

from ._health import Health, Innovation, Revised, SensorHealth
from ._records import Named, Record

__all__ = [
    "Advice",
    "AtSamples",
    "AtTheta",
    "Blind",
    "CertificateEntries",
    "CertificateReport",
    "CheckEntries",
    "CheckReport",
    "Choice",
    "Compared",
    "ComparedSampling",
    "ComparisonEntries",
    "ComparisonReport",
    "Condition",
    "Constant",
    "Correlation",
    "Counted",
    "Declared",
    "DesignEntries",
    "DesignReport",
    "Doubt",
    "Ended",
    "ErrorRow",
    "ErrorTube",
    "Excitation",
    "Excursion",
    "FamilyFit",
    "FitEntries",
    "FitReport",
    "FittedErrors",
    "FittedOptimum",
    "FittedValue",
    "FollowedEntry",
    "Frozen",
    "Health",
    "HiddenBy",
    "HowWellEntries",
    "HowWellReport",
    "Injection",
    "Innovation",
    "InnovationCounts",
    "Knowledge",
    "Known",
    "Misfit",
    "Monitor",
    "MonteCarloEntries",
    "MonteCarloReport",
    "Named",
    "Next",
    "NextExperiment",
    "OneToOne",
    "OpenRunEntries",
    "OpenRunReport",
    "Outside",
    "OutsideBox",
    "ParticleCounts",
    "Peak",
    "Point",
    "PortionErrors",
    "Proof",
    "ProofSummary",
    "Proposal",
    "QuantityError",
    "Range",
    "Rank",
    "Record",
    "Revised",
    "RunEntries",
    "RunReport",
    "SampledProof",
    "SamplingLimits",
    "Scattered",
    "SensorHealth",
    "SensorSet",
    "SensorUsed",
    "SettledErrors",
    "Strays",
    "SweepEntries",
    "SweepReport",
    "SweptKey",
    "SweptRow",
    "Symmetry",
    "Tube",
    "TubeRow",
    "TubeWitness",
    "Uniformity",
    "Verdict",
]

#: a range, ``[smallest, largest]``; an end that is not declared is ``None``
Range: TypeAlias = list[float | None]


#: What is proved.
Verdict: TypeAlias = Literal["proved", "refuted", "undecided"]


class Point(Record):
    """A point of the box."""

    value: float | None
    """of what is in question there"""
    at: Named[float | None]
    """the point, by state and input"""


class Condition(Record):
    """A condition of a theorem."""

    name: str
    """the condition in words"""
    verdict: Verdict
    """what is proved of it on the box"""
    detail: str
    """why"""
    witness: list[Point] | None
    """points that refute it, where it is refuted"""
    box: Named[Range] | None
    """the part of the box on which it is undecided, where it is"""


class FamilyFit(Record):
    """An observer family and its conditions."""

    family: str
    """the name of the family"""
    fit: Literal["fits", "undecided", "does not fit"]
    """whether its theorem holds on the box"""
    summary: str
    """the same in a sentence"""
    chains: list[list[str]]
    """the states of each chain, from the sensor outward"""
    checks: list[Condition]
    """the conditions one by one"""


class Symmetry(Record):
    """Quantities that can change together without a trace in the outputs."""

    moves: list[str]
    """their names"""
    directions: int
    """in how many independent ways"""
    words: str
    """the same in words"""
    invariants: list[str]
    """combinations that are known nevertheless, as expressions"""


class OneToOne(Record):
    """Whether points far apart are told apart."""

    verdict: Verdict
    """what is proved"""
    detail: str
    """why"""
    alike: list[Point] | None
    """two points that the outputs do not distinguish, if there are any"""


class Blind(Record):
    """A constant input under which a state is not seen."""

    input: str
    """the input"""
    value: float
    """its value"""
    hidden: list[str]
    """what is not seen then"""


class Uniformity(Record):
    """Whether states are told apart under every input."""

    verdict: Verdict
    """what is proved"""
    detail: str
    """why"""
    one_to_one: OneToOne
    """the same of points far apart"""
    share: float | None
    """share of the box where it may fail"""
    singular: list[Named[Range]]
    """parts of the box where it may fail"""
    blind: list[Blind]
    """constant inputs under which it fails for every state"""


class HiddenBy(Record):
    """A value of an input at which a quantity is not seen."""

    input: str
    """the input"""
    value: float
    """its value"""


class Known(Record):
    """What can be known of a quantity, and where; ``decays``: it cannot be known, but an error in it decays."""

    known: Literal[
        "everywhere",
        "everywhere while inputs are constant",
        "locally everywhere",
        "locally everywhere while inputs are constant",
        "almost everywhere",
        "in part of the box",
        "while excited",
        "within limits",
        "up to disturbances",
        "decays",
        "no",
        "undecided",
    ]
    hidden_share: float | None
    """share of the box in which it is not seen"""
    hidden_at: Named[float] | None
    """a point at which it is not seen"""
    hidden_by: HiddenBy | None
    """the input at which it is not seen"""
    otherwise: Known | None
    """what is known within the limits of sensors, or were there no disturbances"""
    sensors: list[str] | None
    """sensors within whose limits it is known"""
    disturbances: list[str] | None
    """disturbances up to which it is known"""
    bound: float | None
    """how far it may be off in the end, in its unit"""
    rate: float | None
    """rate at which an error in it decays, in 1/(unit of time)"""
    proved: bool | None
    """whether that is proved on the box; else it is that of a linearisation"""
    error: Literal["stays", "grows", "moved by an unknown input", "undecided"] | None
    """what becomes of an error in it"""


class Knowledge(Record):
    """What can be known under an assumption on the unknown inputs."""

    unknown_inputs: Literal["none", "arbitrary", "wandering"]
    """the assumption"""
    words: str
    """the same in words"""
    quantities: Named[Known]
    """what can be known of each quantity"""
    linearised_at: Named[float] | None
    """the point at which it was linearised, where it was"""


class Proposal(Record):
    """A value for a key that the study leaves out."""

    key: Literal["theta", "poles"]
    """the key of ``[observer]``"""
    value: float | list[float | None] | None
    """a number or a list of them, in 1/(unit of time)"""
    why: str
    """where it comes from"""


class Choice(Record):
    """Which family is taken, as ``family = "auto"`` does."""

    family: str
    """its name"""
    asked_for: bool
    """whether the study names it"""
    grounds: Literal["proved", "undecided", "filter"]
    """what speaks for it"""
    proposed: Proposal | None
    """a value for a key that the study leaves out"""
    passed_over: list[str]
    """families that may fit and are not taken, with the reason"""
    ended: str | None
    """what ended the search, where a limit did"""


class Declared(Record):
    """What a claim counts of what the study declares, and what it leaves aside, with the reason. What is not
    declared is in neither."""

    counted: list[str]
    """kinds of declarations that it counts, ``ranges`` for example"""
    left_aside: Named[str]
    """kinds that it leaves aside, with the reason"""


class Next(Record):
    """What to do next."""

    commands: list[str]
    """commands to type; for people, each with what it does"""
    observer: str | None
    """``[observer]``, and what else belongs to it, as TOML; ``None`` where the study has it all"""
    study: str | None
    """a whole study for a bare model, ``[observer]`` included"""


class CheckEntries:
    """What :meth:`lynkeus.Study.check` answers."""

    lynkeus: str
    """The version of Lynkeus that answers."""
    plant: str
    """the name of the model"""
    states: list[str]
    """names of its states"""
    measured: list[str]
    """outputs that have sensors"""
    unknown: list[str]
    """inputs and parameters that nobody measures"""
    recommended: str | None
    """the family that is recommended"""
    warnings: list[str]
    """what is odd in the model"""
    families: list[FamilyFit]
    """each family with its conditions"""
    visible: Named[bool]
    """whether each quantity is observable"""
    observability: Named[Literal["observable", "unobservable", "undecided"]]
    """the same with what is undecided"""
    about: Named[Literal["observable", "unobservable", "undecided"]]
    """the same of each expression that was asked about"""
    symmetries: list[Symmetry]
    """quantities that can change together unseen"""
    derivatives: int
    """derivatives of the outputs that were used"""
    rank: int
    """independent directions of the unknowns that are seen"""
    unknowns: int
    """unknowns, derivatives of unknown inputs included"""
    observability_notes: list[str]
    """how far these answers can be trusted"""
    uniform: Uniformity | None
    """whether states are told apart under every input, where that was examined"""
    knowledge: list[Knowledge]
    """what can be known, under each assumption on the unknown inputs"""
    choice: Choice | None
    """what ``family = "auto"`` takes, where a family fits"""
    declared: Declared
    """what of the study's declarations was counted"""
    next: Next | None
    """what to do next"""


class CheckReport(CheckEntries, Record):
    """The summary of a :class:`lynkeus.Check`."""


class SensorUsed(Record):
    """A sensor."""

    name: str
    """the output"""
    noise: str
    """its noise in words"""
    noise_stated: bool
    """whether the study says it"""
    measured: bool
    """whether the study measures it; else it was tried"""


class Rank(Record):
    """Directions of the state that the readings show."""

    seen: int
    """how many are seen"""
    of: int
    """how many there are"""
    weakest_seen: float | None
    """the weakest that counts as seen"""
    strongest_unseen: float | None
    """the strongest that does not"""
    threshold: float | None
    """the border between them"""
    doubtful: bool
    """whether that border is in doubt"""


class SensorSet(Record):
    """A set of sensors."""

    sensors: list[str]
    """the outputs"""
    unseen: int
    """quantities that it does not show"""
    mean_share: float | None
    """standard errors of what is seen as a share of their scales, the geometric mean"""
    worst: str | None
    """the quantity that is known worst"""
    worst_share: float | None
    """its standard error as a share of its scale"""


class Advice(Record):
    """Which sensors to add or to take."""

    present: SensorSet
    """the study's sensors"""
    same_size: list[SensorSet]
    """other sets of as many"""
    same_size_complete: bool
    """whether all of these were tried"""
    additions: list[SensorSet]
    """the study's with one more"""
    singles: list[SensorSet]
    """one sensor alone"""
    pairs: list[SensorSet]
    """two sensors alone"""


class HowWellEntries:
    """What :meth:`lynkeus.Study.how_well` answers."""

    lynkeus: str
    """The version of Lynkeus that answers."""
    plant: str
    """the name of the model"""
    start: float
    """the first instant"""
    sample_step: float
    """time between samples"""
    horizon: float | None
    """the longest span of readings"""
    sensors: list[SensorUsed]
    """sensors and their noise"""
    scale: Named[float]
    """the size of each quantity that its error is compared with, in its unit"""
    standard_error: Named[float | None]
    """of the present value of each quantity, in its unit; ``None`` where it is not seen"""
    standard_error_of_start: Named[float | None]
    """of the value at the start"""
    standard_error_exact_model: Named[float | None]
    """of the present value were the model exact"""
    filter_sd: Named[float | None]
    """standard deviation that an extended Kalman filter has at the end, where it does not break down"""
    counts_process_noise: bool
    """whether ``[process_noise]`` is counted"""
    declared: Declared
    """what of the study's declarations was counted"""
    disturbances_taken_as_zero: list[str]
    """disturbances that are not counted"""
    ranked: list[str]
    """quantities, the one that is known best first"""
    rank: Rank
    """how many directions are seen"""
    over_horizon: Named[list[float | None]]
    """standard errors over the span of readings, as the columns"""
    advice: Advice | None
    """which sensors to add or to take, where that was asked"""


class HowWellReport(HowWellEntries, Record):
    """The summary of a :class:`lynkeus.HowWell`."""


class Injection(Record):
    """The correction of a state by an output, an entry of ∂F/∂y, where it is no constant gain."""

    expression: str
    """the derivative, cut with ``…`` where it is very long"""
    at_start: float | None
    """its value at the start of the study, where the output is what the estimate says; ``None`` where the
    study gives an input no value"""


class Constant(Record):
    """A constant of a theorem."""

    name: str
    """its letter in the paper"""
    value: float | None
    """its value"""
    meaning: str
    """what it is"""


class Excursion(Record):
    """One quantity that leaves its side of the box."""

    box: Range
    """its smallest and largest value in the box"""
    rows: float
    """share of the rows at which it is outside"""
    first: float
    """time of the first of them"""
    value: float
    """its value there"""
    farthest: float
    """the value that is farthest outside"""


class Outside(Record):
    """Where a run is outside of the box."""

    rows: float
    """share of the rows at which any quantity is"""
    first: float
    """time of the first of them"""
    quantities: Named[Excursion]
    """the quantities, the one that leaves first first"""


class Strays(Record):
    """Where the study's own plant and estimate are outside of the box."""

    simulated: bool
    """whether that is of the study's simulation; else only of the start"""
    plant: Outside | None
    """of the plant"""
    estimate: Outside | None
    """of the estimate"""


class AtTheta(Record):
    """Excitation measured at a value of θ."""

    theta: float
    """θ, in 1/(unit of time)"""
    excitation: float | None
    """the smallest eigenvalue of S"""
    condition: float | None
    """σ_s·L/θ, to be below ½"""
    error: float | None
    """the largest root mean square error, in widths of the declared range"""
    failure: str | None
    """why there are no figures"""


class Excitation(Record):
    """Excitation along the study's simulation: measured, no part of a proof."""

    until: float
    """the last instant"""
    rows: list[AtTheta]
    """one for each value of θ"""
    exponent: float | None
    """excitation falls like θ to minus this"""
    vanishes: bool | None
    """whether α(θ)/θ² falls at the largest θ, as the theorem asks; ``None`` where that cannot be told"""
    best: float | None
    """the θ of the smallest error"""
    _ITEMS: ClassVar = {"from": float}

    @property
    def since(self) -> float:
        """The entry ``from``: the first instant."""
        found: float = self["from"]
        return found


class SamplingLimits(Record):
    """The interval between samples, beside what the observer stands (an estimate, no proof)."""

    log: float | None
    """the interval of the log"""
    simulation: float | None
    """the interval of the simulation"""
    largest_predict: float | None
    """the largest with ``between_samples = "predict"``"""
    largest_hold: float | None
    """the largest with held measurements"""
    beyond: bool | None
    """whether the study's is beyond them; of certificates"""


class AtSamples(Record):
    """What is proved for samples at most some interval apart."""

    interval: float
    """the longest time from one to the next"""
    rate: float
    """the decay of the error that is proved, in 1/(unit of time)"""
    overshoot: float | None
    """the factor by which the error may peak"""
    ultimate_bound: float | None
    """the norm below which the error ends where samples are just so far apart"""
    ultimate_bounds: Named[float | None]
    """the same for each quantity, in its unit"""


class SampledProof(Record):
    """What is proved of samples with measurements that follow the model between them."""

    longest: AtSamples | None
    """for every sequence of samples no further apart than the longest interval found"""
    at: AtSamples | None
    """for the samples of the study's simulation; ``None`` where it has none or they are not proved"""
    broken: float | None
    """an interval T such that some sequence of samples at most T apart would let the error grow, if slopes
    changed within their ranges, or from one point of the box to another, as the proof allows; ``None``
    where that was not seen"""
    held: AtSamples | None
    """for readings that are held instead, as far apart as the study's: with the proof for continuous sensors"""
    obstacle: str | None
    """why there is no proof, or what ended the search"""


class TubeRow(Record):
    """A part of a tube."""

    to: float
    """to when"""
    range: Named[Range]
    """ranges of the states"""
    _ITEMS: ClassVar = {"from": float}

    @property
    def since(self) -> float:
        """The entry ``from``: from when."""
        found: float = self["from"]
        return found


class TubeWitness(Record):
    """A run that leaves the box for certain."""

    at: Named[float]
    """where states and constants start, and what the inputs are all the time"""
    state: str
    """the state that is outside"""
    time: float
    """when"""
    value: list[float]
    """where it is then, for certain"""


class Tube(Record):
    """What is proved of the plant's way from a set of starts."""

    verdict: Verdict
    """whether it stays in the box until the time asked for"""
    until: float
    """until when it is asked"""
    reached: float
    """until when the ranges are proved"""
    start: Named[Range]
    """ranges of the states at the start"""
    constants: Named[Range]
    """ranges of unknown inputs that stay constant"""
    inputs: Named[Range]
    """ranges of inputs that may vary as they like"""
    range: Named[Range]
    """ranges of the states over all of the time that is reached"""
    end: Named[Range]
    """ranges of the states at the end of it"""
    rows: list[TubeRow]
    """where the states are from one time to the next"""
    obstacle: str | None
    """why it is not proved"""
    witness: TubeWitness | None
    """a run that leaves the box for certain"""
    notes: list[str]
    """what it leaves aside"""
    _ITEMS: ClassVar = {"from": float}

    @property
    def since(self) -> float:
        """The entry ``from``: when it starts."""
        found: float = self["from"]
        return found


class ErrorRow(Record):
    """A part of it."""

    to: float
    """to when"""
    error: Named[Range]
    """ranges of estimate minus truth"""
    deviation: Named[Range]
    """ranges of a filter's own standard deviations"""
    _ITEMS: ClassVar = {"from": float}

    @property
    def since(self) -> float:
        """The entry ``from``: from when."""
        found: float = self["from"]
        return found


class FollowedEntry(Record):
    """The error, and a filter's own standard deviations, along a tube."""

    reached: float
    """until when the ranges are proved"""
    error: Named[Range]
    """ranges of estimate minus truth over all of the time"""
    error_end: Named[Range]
    """the same at the end of it"""
    deviation: Named[Range]
    """ranges of a filter's own standard deviations over all of the time; empty for other observers"""
    deviation_end: Named[Range]
    """the same at the end of it"""
    monitors: Named[Range]
    """ranges of the observer's monitors over all of the time, where they have bounds"""
    rows: list[ErrorRow]
    """errors and deviations from one time to the next"""


class ErrorTube(Record):
    """What is proved of the error of an observer or of an extended Kalman filter from a set of starts."""

    verdict: Verdict
    """whether the error has the bounds until the time asked for"""
    until: float
    """until when it is asked"""
    every: float | None
    """the time from one sample to the next; ``None`` where sensors are read continuously"""
    start: Named[Range]
    """ranges of plant states and unknown inputs at the start"""
    estimate: Named[float]
    """where the estimate starts"""
    readings: Named[float]
    """bounds of the errors of readings, by output; of relative noise as a share of what is shown"""
    inputs: Named[Range]
    """ranges of inputs that may vary as they like"""
    noisy: FollowedEntry | None
    """with these errors of readings"""
    exact: FollowedEntry | None
    """with readings without noise: what the start and disturbances leave"""
    obstacle: str | None
    """why it is not proved"""
    notes: list[str]
    """what it leaves aside"""
    _ITEMS: ClassVar = {"from": float}

    @property
    def since(self) -> float:
        """The entry ``from``: when it starts."""
        found: float = self["from"]
        return found


class ProofSummary(Record):
    """What one way of proof gives."""

    basis: str
    """the way of proof"""
    verdict: Verdict
    """whether the error decays"""
    rate: float | None
    """the decay of the error that is proved, in 1/(unit of time)"""
    ultimate_bound: float | None
    """the norm below which the error ends"""
    ultimate_bounds: Named[float | None]
    """the same for each quantity, in its unit"""
    mean_square_bound: float | None
    """the norm below which the error ends in the root of the mean square, under Gaussian noise"""
    mean_square_bounds: Named[float | None]
    """the same for each quantity, in its unit"""
    probable_bound: float | None
    """the norm below which the error is in the end, at any one time with a probability of 0.99, under
    Gaussian noise"""
    probable_bounds: Named[float | None]
    """the same for each quantity, in its unit"""
    box: Named[Range]
    """the ranges on which it holds"""
    constants: list[Constant]
    """constants of the theorem"""


class Proof(Record):
    """A certificate."""

    basis: str
    """the way of proof"""
    verdict: Verdict
    """whether the error decays"""
    rate: float | None
    """the decay of the error that is proved, in 1/(unit of time)"""
    ultimate_bound: float | None
    """the norm below which the error ends"""
    ultimate_bounds: Named[float | None]
    """the same for each quantity, in its unit"""
    mean_square_bound: float | None
    """the norm below which the error ends in the root of the mean square, under Gaussian noise"""
    mean_square_bounds: Named[float | None]
    """the same for each quantity, in its unit"""
    probable_bound: float | None
    """the norm below which the error is in the end, at any one time with a probability of 0.99, under
    Gaussian noise"""
    probable_bounds: Named[float | None]
    """the same for each quantity, in its unit"""
    box: Named[Range]
    """the ranges on which it holds"""
    constants: list[Constant]
    """constants of the theorem"""
    hypotheses: list[Condition]
    """its hypotheses one by one: those of the inequality, then those of the theorem"""
    declared: Declared
    """what of the study's declarations was counted"""
    outside_box: Strays
    """where the study's own start or simulation leaves the box"""
    excitation: Excitation | None
    """what was measured of it, of observers whose theorem needs it"""
    sampling: SamplingLimits | None
    """the study's samples beside what the observer stands"""
    sampled: SampledProof | None
    """what is proved of samples with measurements that follow the model between them (``between_samples =
    "predict"``); ``None`` where nothing is proved of sensors that are read continuously"""
    tube: Tube | None
    """whether the plant stays in the box from the starts of ``[certify]``; ``None`` where that is not asked"""
    error_tube: ErrorTube | None
    """what is proved of the observer's error from these starts; ``None`` where that is not asked"""
    notes: list[str]
    """what you should know"""
    theorem: ProofSummary | None
    """what the family's theorem gives, where it was asked"""


class DesignEntries:
    """What :meth:`lynkeus.Study.design` answers."""

    lynkeus: str
    """The version of Lynkeus that answers."""
    plant: str
    """the name of the model"""
    family: str
    """the observer family"""
    fit: Literal["fits", "undecided", "does not fit"]
    """whether the family's conditions hold"""
    chains: list[list[str]]
    """the states of each chain, from the sensor outward"""
    gain: Named[Named[float]] | None
    """the gain by state, then by measured output; ``None`` where it is no constant"""
    injection: Named[Named[Injection]] | None
    """what takes its place then"""
    parameters: Named[str]
    """parameters of the observer, as texts"""
    initial: Named[float | None]
    """the start of each of its states"""
    certificate: Proof
    """what is proved"""


class DesignReport(DesignEntries, Record):
    """The summary of a :class:`lynkeus.Design`."""

    notes: list[str]
    """what you should know"""


class CertificateEntries:
    """What :meth:`lynkeus.Study.certify` answers."""

    lynkeus: str
    """The version of Lynkeus that answers."""
    plant: str
    """the name of the model"""
    family: str
    """the observer family"""
    gain: Named[Named[float]] | None
    """the gain by state, then by measured output; ``None`` where it is no constant"""
    injection: Named[Named[Injection]] | None
    """what takes its place then"""
    certificate: Proof
    """what is proved"""


class CertificateReport(CertificateEntries, Record):
    """The summary of a :class:`lynkeus.Certificate`."""


class QuantityError(Record):
    """The error of one estimated quantity against the truth."""

    rms_last_half: float | None
    """root mean square over the last half of the rows, in the quantity's unit; ``None`` where its true value
    is known in the first half only"""
    peak: float
    """the largest after the first row, in the quantity's unit"""
    peak_at: float
    """its time"""
    settled_at: float | None
    """the time from which on it is within 5 % of the declared range; ``None`` where it is not up to the end"""
    within_2_sd: float | None
    """share of the last half of the rows within two standard deviations, where these are told"""
    rms_in_sd: float | None
    """root mean square there in standard deviations: 1 where these are true"""


class Frozen(Record):
    """A sensor whose readings are one number for improbably long."""

    output: str
    """the measured output"""
    value: float
    """the number that it repeats"""
    to: float
    """time of the last of the equal readings"""
    rows: int
    """number of them"""
    at_end_of_range: bool
    """no reading of the log is larger, or none smaller: an end of the sensor's range as well"""
    _ITEMS: ClassVar = {"from": float}

    @property
    def since(self) -> float:
        """The entry ``from``: time of the first of the equal readings."""
        found: float = self["from"]
        return found


class Monitor(Record):
    """The trust in an estimate over time, and whether it was ever lost."""

    alarm_at: float | None
    """the first time at which it was below its alarm"""
    column: str
    """the header of its column: the monitor's name unless the model has that name"""


class OutsideBox(Record):
    """Where plant and estimate are outside of the box; ``None`` where they stay inside."""

    plant: Outside | None
    """of the true values, where they are known"""
    estimate: Outside | None
    """of the estimates"""


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


class ParticleCounts(Record):
    """How particles went."""

    particles: int
    """how many there are"""
    updates: int
    """updates by readings"""
    resampled: int
    """number of resamplings"""
    lowest_ess: float | None
    """the least number that counted after an update, (Σw)²/Σw²"""
    starved: int
    """updates whose readings no particle explains"""
    alone: int
    """updates after which one had all the weight"""


class Ended(Record):
    """Why a run ended before its last row."""

    message: str
    """in words"""
    by_limit: bool
    """whether a limit of time or memory ended it, and nothing is wrong with what there is"""


class Doubt(Record):
    """Something that speaks against an estimate."""

    kind: Literal[
        "ended",
        "range",
        "innovations",
        "rejected",
        "frozen",
        "jump",
        "particles",
        "noise",
        "coloured",
    ]
    """what it rests on"""
    name: str
    """the measured output, or the estimated quantity"""
    text: str
    """in words"""
    level: Literal["note", "warning", "refusal"]
    """how much it weighs; a refusal makes the result not credible"""


class RunEntries:
    """What :meth:`lynkeus.Study.simulate` and :meth:`lynkeus.Study.estimate` answers."""

    lynkeus: str
    """The version of Lynkeus that answers."""
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
    particles: ParticleCounts | None
    """of a particle filter"""
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
    """share of the last half of the rows within two standard deviations, where these are told"""
    rms_in_sd: float | None
    """root mean square there in standard deviations: 1 where these are true"""


class MonteCarloEntries:
    """What :meth:`lynkeus.Study.simulate` with ``runs`` answers."""

    lynkeus: str
    """The version of Lynkeus that answers."""
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


class Misfit(Record):
    """An output of the plant alone beside what a log has of it."""

    unit: str | None
    """its unit"""
    column: str
    """header of the column with reading − output"""
    readings: int
    """rows that count"""
    missing: int
    """rows without a reading"""
    at_ends: int
    """readings at an end of their sensor's range, which do not count"""
    rms: float | None
    """root mean square error, in its unit"""
    mean: float | None
    """mean error, in its unit"""
    fit_percent: float | None
    """100 (1 − ‖y − ŷ‖/‖y − mean of y‖), in percent; 100 is perfect, 0 no better than the mean of the
    readings"""


class OpenRunEntries:
    """What :meth:`lynkeus.Study.simulate` with a log as ``inputs`` answers."""

    lynkeus: str
    """The version of Lynkeus that answers."""
    plant: str
    """the name of the model"""
    log: str
    """the log whose inputs drive it"""
    rows: int
    """number of rows"""
    start: Named[float]
    """where each state starts"""
    errors: Named[Misfit]
    """errors of each output that the log has readings of"""
    ended: Ended | None
    """why it ended before its last row, where it did"""
    warnings: list[str]
    """what of the log contradicts itself, or counts nowhere"""


class OpenRunReport(OpenRunEntries, Record):
    """The summary of a :class:`lynkeus.OpenRun`."""

    columns: list[str]
    """headers of the columns"""
    notes: list[str]
    """what you should know"""


class SweptKey(Record):
    """A key that is swept."""

    key: str
    """the key of ``[observer]``, or ``process_noise.NAME``, ``noise.OUTPUT``"""
    factor: bool
    """whether its values are factors on all numbers of a list, or of a section"""


class Peak(Record):
    """The largest error of a run after its start."""

    name: str
    """the quantity"""
    estimate: float
    """its estimate there, in its unit"""
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
    nll_per_reading: float | None
    """−log of the likelihood of the innovations, over the number of readings that count; of filters on a log"""
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
    readings: int | None
    """readings that the likelihood counts; of filters on a log"""
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

    lynkeus: str
    """The version of Lynkeus that answers."""
    plant: str
    """the name of the model"""
    log: str | None
    """the log by which it was judged; ``None`` in simulation"""
    present: Named[float | None]
    """the study's own value of each key"""
    knee: SweptRow | None
    """the tuning of the least error; of filters on a log the most likely one"""
    nearly_as_good: list[float] | None
    """values of the first key whose error is within 10 % of that, ``[smallest, largest]``; of filters on a
    log those that are as likely within 95 %: the logarithm of the likelihood is at most 1.92 less"""
    rows: list[SweptRow]
    """each tuning"""
    declared: Declared
    """what of the study's declarations was counted"""


class SweepReport(SweepEntries, Record):
    """The summary of a :class:`lynkeus.Sweep`."""

    notes: list[str]
    """what you should know"""
    _ITEMS: ClassVar = {"keys": list[SweptKey]}


class FittedValue(Record):
    """A value that was found."""

    value: float
    """the value"""
    sd: float | None
    """its standard deviation; none at a bound"""
    interval: list[float] | None
    """95 %"""
    at_bound: bool
    """whether it is at a bound"""


class Correlation(Record):
    """Correlations of the errors of what is not at a bound."""

    names: list[str]
    """what stands in each row"""
    matrix: list[list[float | None]]
    """row by row"""


class FittedOptimum(Record):
    """An end of searches."""

    nll: float
    """−log L there"""
    found: int
    """how many searches ended there"""


class PortionErrors(Record):
    """Errors of predictions in some of the rows."""

    readings: int
    """readings there"""
    one_step: float | None
    """root mean square of the innovations"""
    squares: float | None
    """mean of the squared innovations over their variances: 1 where these are right"""
    free_run: float | None
    """root mean square error of the plant alone"""


class FittedErrors(Record):
    """Errors of predictions of an output."""

    fitted: PortionErrors
    """in the rows that were fitted"""
    held_out: PortionErrors | None
    """in those that were held out"""
    ljung_box: float | None
    """the statistic of Ljung and Box over its number of lags: about 1 where the innovations are white"""


class NextExperiment(Record):
    """How well the values would be known with one more log."""

    name: str
    """what is done: a name of the study's, or words"""
    rows: int
    """rows of the log"""
    readings: int
    """readings in it"""
    duration: float
    """from its first row to its last"""
    sensors: list[str]
    """sensors beside the study's, with their noise"""
    worst: str | None
    """the value that would then be known worst, as a share of it"""
    relative_sd: float | None
    """its relative standard error"""
    factor: float | None
    """the same over that of the value that is known worst now; ``None`` where the logs do not determine all
    values"""
    volume: float | None
    """the D criterion: volume of the ellipsoid of errors over what it is now"""
    trace: float | None
    """the A criterion: sum of the squared relative standard errors over what it is now"""
    sd: Named[float | None]
    """the standard error of each value, by what ``correlation`` calls it"""
    determines: list[str]
    """what the logs do not determine, and would with this one"""
    undetermined: list[str]
    """what they would not tell even so"""


class FitEntries:
    """What :meth:`lynkeus.Study.fit` answers."""

    lynkeus: str
    """The version of Lynkeus that answers."""
    plant: str
    """the name of the model"""
    logs: list[str]
    """what was fitted to"""
    nll: float | None
    """−log L at the values, without the share of priors"""
    nll_at_start: float | None
    """the same at the study's own values"""
    aic: float | None
    """Akaike's criterion, 2·nll + 2k with k values found"""
    bic: float | None
    """the Bayesian one, 2·nll + k·log(readings)"""
    converged: bool
    """whether nothing is left to gain nearby"""
    credible: bool
    """whether nothing speaks against the values"""
    doubts: list[Doubt]
    """what the readings say against them, what weighs most first"""
    readings: int
    """readings that were fitted"""
    evaluations: int
    """how often −log L was computed"""
    parameters: Named[FittedValue]
    """parameters of the plant"""
    noise: Named[FittedValue]
    """noises of the sensors, as the study has them"""
    process_noise: Named[FittedValue]
    """spectral densities"""
    initial: Named[list[FittedValue]]
    """starts, one per log"""
    correlation: Correlation
    """how the errors of the values depend on each other"""
    optima: list[FittedOptimum]
    """different ends of the searches that converged, the best first"""
    undetermined: list[str]
    """what the logs do not determine"""
    combinations: list[str]
    """combinations of the parameters that the outputs tell nevertheless"""
    errors: Named[FittedErrors]
    """errors of predictions, by output"""
    next_experiment: list[NextExperiment] | None
    """how well the values would be known with one more log, the best first; where that is asked"""
    warnings: list[str]
    """what speaks against the values"""


class FitReport(FitEntries, Record):
    """The summary of a :class:`lynkeus.Fit`."""

    notes: list[str]
    """what you should know"""


class ComparedSampling(Record):
    """How a simulation was sampled."""

    interval: float
    """time between two samples"""
    chosen_by: Literal["study", "errors have settled", "cost"]
    """why this one"""


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
    nll_per_reading: float | None
    """−log of the likelihood of the innovations, over the number of readings that count; of filters"""
    readings: int | None
    """readings that count in it: those that corrected, and those at a limit of their sensor"""
    held_out_error: float | None
    """root mean square error of the prediction on samples that were held out, over the span of the output"""
    innovation: float | None
    """root mean square of the innovations, over the span of the output"""
    ljung_box: float | None
    """Ljung–Box statistic of the innovations per lag; of white ones 1"""
    outside_band: float | None
    """share of their autocorrelations outside of the 95 % band"""
    unforetold: str | None
    """why that is not known, or not of all of the log"""
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

    lynkeus: str
    """The version of Lynkeus that answers."""
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
