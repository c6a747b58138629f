"""Lynkeus: from a plant's equations and a few sensors to estimates of what nobody measures.

    import lynkeus

    study = lynkeus.Study.load("study.toml")
    print(study.check())
    run = study.estimate("log.csv")
    run["pump_hat"]
"""

from ._lynkeus import Estimator, Log
from .errors import InputError, LimitError, LynkeusError, NotCredible, RefusedError, TraceError
from .functions import Driven, Functions, Observer
from .model import Model
from .results import (
    Answer,
    Certificate,
    Check,
    Comparison,
    Design,
    Estimation,
    HowWell,
    MonteCarlo,
    Record,
    Run,
    Simulation,
    Sweep,
    Table,
)
from .study import Study
from .verbs import certify, check, compare, design, estimate, how_well, simulate, tune

__all__ = [
    "Answer",
    "Certificate",
    "Check",
    "Comparison",
    "Design",
    "Driven",
    "Estimation",
    "Estimator",
    "Functions",
    "HowWell",
    "InputError",
    "LimitError",
    "Log",
    "LynkeusError",
    "Model",
    "MonteCarlo",
    "NotCredible",
    "Observer",
    "Record",
    "RefusedError",
    "Run",
    "Simulation",
    "Study",
    "Sweep",
    "Table",
    "TraceError",
    "certify",
    "check",
    "compare",
    "design",
    "estimate",
    "how_well",
    "simulate",
    "tune",
]
