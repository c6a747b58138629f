"""Lynkeus: from a plant's equations and a few sensors to estimates of what nobody measures.

    import lynkeus

    study = lynkeus.Study.load("study.toml")
    print(study.check())
    run = study.estimate("log.csv")
    run["pump_hat"]
"""

from ._lynkeus import Estimator, Log
from ._lynkeus import __version__ as __version__
from .errors import ArgumentError, InputError, LimitError, LogWarning, LynkeusError, NotCredible, RefusedError, TraceError
# not among the names of `from lynkeus import *`: it would hide Python's own
from .functions import abs as abs
from .functions import acos, asin, atan, atan2, ceil, cos, cosh, exp, floor, interp, log, log10
from .functions import maximum, minimum, sign, sin, sinh, sqrt, tan, tanh, where
from .filtered import Filtered
from .likelihood import Innovations, Likelihood
from .model import Model
from .results import (
    Answer,
    Certificate,
    Check,
    Comparison,
    Design,
    Estimation,
    Fit,
    HowWell,
    MonteCarlo,
    OpenRun,
    Record,
    Run,
    Simulation,
    Sweep,
    Table,
)
from .study import Study
from .systems import Driven, Functions, Observer
from .verbs import certify, check, compare, design, estimate, fit, how_well, simulate, tune

__all__ = [
    "Answer",
    "ArgumentError",
    "Certificate",
    "Check",
    "Comparison",
    "Design",
    "Driven",
    "Estimation",
    "Estimator",
    "Filtered",
    "Fit",
    "Functions",
    "HowWell",
    "Innovations",
    "InputError",
    "Likelihood",
    "LimitError",
    "Log",
    "LogWarning",
    "LynkeusError",
    "Model",
    "MonteCarlo",
    "NotCredible",
    "Observer",
    "OpenRun",
    "Record",
    "RefusedError",
    "Run",
    "Simulation",
    "Study",
    "Sweep",
    "Table",
    "TraceError",
    "acos",
    "asin",
    "atan",
    "atan2",
    "ceil",
    "certify",
    "check",
    "compare",
    "cos",
    "cosh",
    "design",
    "estimate",
    "exp",
    "fit",
    "floor",
    "how_well",
    "interp",
    "log",
    "log10",
    "maximum",
    "minimum",
    "sign",
    "simulate",
    "sin",
    "sinh",
    "sqrt",
    "tan",
    "tanh",
    "tune",
    "where",
]
