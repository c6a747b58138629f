"""What `check`, `design`, `certify` and `how_well` report; see :mod:`lynkeus.reports`."""

from __future__ import annotations

from typing import ClassVar, Literal, TypeAlias

from ._records import Named, Record

#: what is proved
Verdict: TypeAlias = Literal["proved", "refuted", "undecided"]
#: a range, ``[smallest, largest]``; an end that is not declared is ``None``
Range: TypeAlias = list[float | None]


class Declared(Record):
    """What of the study's declarations an answer counts."""

    counted: list[str]
    """kinds that it counts, ``ranges`` for example"""
    left_aside: Named[str]
    """kinds that it leaves aside, with the reason"""


# check


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


class Blind(Record):
    """A constant input under which a state is not seen."""

    input: str
    """the input"""
    value: float
    """its value"""
    hidden: list[str]
    """what is not seen then"""


class OneToOne(Record):
    """Whether points far apart are told apart."""

    verdict: Verdict
    """what is proved"""
    detail: str
    """why"""
    alike: list[Point] | None
    """two points that the outputs do not tell apart, where there are such"""


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
    """What can be known of a quantity."""

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
    """where it can be known; ``decays``: it cannot, but an error in it decays"""
    hidden_by: HiddenBy | None
    """the input at which it is not seen, of one that is known while excited"""
    hidden_share: float | None
    """share of the box in which it is not seen"""
    hidden_at: Named[float] | None
    """a point at which it is not seen"""
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

    key: str
    """the key of ``[observer]``"""
    value: float | list[float | None] | None
    """its value, in 1/(unit of time)"""
    why: str
    """where it comes from"""


class Choice(Record):
    """Which family ``family = "auto"`` takes."""

    family: str
    """its name"""
    asked_for: bool
    """whether the study asks for a choice"""
    grounds: Literal["proved", "undecided", "filter"]
    """what speaks for it"""
    proposed: Proposal | None
    """a tuning, where the study has none"""
    passed_over: list[str]
    """families that come before it, and why they were passed over"""
    ended: str | None
    """what ended the search, where a limit did"""


class Next(Record):
    """What to do next."""

    commands: list[str]
    """commands"""
    observer: str | None
    """a section to be pasted into the study"""
    study: str | None
    """a study to begin with"""


class CheckEntries:
    """What :meth:`lynkeus.Study.check` answers."""

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


# design and certify


class Injection(Record):
    """The correction of a state by an output, ∂F/∂y, where it is no constant gain."""

    expression: str
    """as an expression"""
    at_start: float | None
    """its value at the start"""


class Constant(Record):
    """A constant of a theorem."""

    name: str
    """its letter in the paper"""
    value: float | None
    """its value"""
    meaning: str
    """what it is"""


class Excursion(Record):
    """Where a quantity is outside of its range."""

    box: Range
    """the range"""
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
    """each quantity that is"""


class OutsideBox(Record):
    """Where plant and estimate are outside of the box; ``None`` where they stay inside."""

    plant: Outside | None
    """of the true values, where they are known"""
    estimate: Outside | None
    """of the estimates"""


class Strays(OutsideBox):
    """The same of a certificate's box."""

    simulated: bool
    """whether that is of the study's simulation; else only of the start"""


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
        return float(self["from"])


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
    """the norm below which the error ends in the root of the mean square, under noise"""
    mean_square_bounds: Named[float | None]
    """the same for each quantity, in its unit"""
    box: Named[Range]
    """the ranges on which it holds"""
    constants: list[Constant]
    """constants of the theorem"""


class Proof(ProofSummary):
    """A certificate."""

    hypotheses: list[Condition]
    """its hypotheses one by one"""
    declared: Declared
    """what of the study's declarations was counted"""
    outside_box: Strays
    """where the study's own start or simulation leaves the box"""
    excitation: Excitation | None
    """what was measured of it, of observers whose theorem needs it"""
    sampling: SamplingLimits | None
    """the study's samples beside what the observer stands"""
    theorem: ProofSummary | None
    """what the family's theorem gives, where it was asked"""
    notes: list[str]
    """what you should know"""


class CertificateEntries:
    """What :meth:`lynkeus.Study.certify` answers."""

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


class DesignEntries(CertificateEntries):
    """What :meth:`lynkeus.Study.design` answers."""

    fit: Literal["fits", "undecided", "does not fit"]
    """whether the family's conditions hold"""
    chains: list[list[str]]
    """the states of each chain, from the sensor outward"""
    parameters: Named[str]
    """parameters of the observer, as texts"""
    initial: Named[float | None]
    """the start of each of its states"""


class DesignReport(DesignEntries, Record):
    """The summary of a :class:`lynkeus.Design`."""

    notes: list[str]
    """what you should know"""


# how_well


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
