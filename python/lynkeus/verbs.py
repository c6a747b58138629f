"""The commands as functions: of a study, or of its path."""

from __future__ import annotations

import os
from typing import Any

from .errors import ArgumentError
from .results import Certificate, Check, Comparison, Design, Estimation, HowWell, MonteCarlo, Simulation, Sweep
from .study import Study

_Study = Study | str | os.PathLike[str]


def _study(study: _Study) -> Study:
    if isinstance(study, Study):
        return study
    if not isinstance(study, (str, os.PathLike)):
        raise ArgumentError.of("study", "a Study, or the path of one", study)
    return Study.load(study)


def check(study: _Study, **options: Any) -> Check:
    """:meth:`Study.check`"""
    return _study(study).check(**options)


def design(study: _Study, **options: Any) -> Design:
    """:meth:`Study.design`"""
    return _study(study).design(**options)


def certify(study: _Study, **options: Any) -> Certificate:
    """:meth:`Study.certify`"""
    return _study(study).certify(**options)


def how_well(study: _Study, **options: Any) -> HowWell:
    """:meth:`Study.how_well`"""
    return _study(study).how_well(**options)


def simulate(study: _Study, **options: Any) -> Simulation | MonteCarlo:
    """:meth:`Study.simulate`"""
    found: Simulation | MonteCarlo = _study(study).simulate(**options)
    return found


def estimate(study: _Study, log: Any, **options: Any) -> Estimation:
    """:meth:`Study.estimate`"""
    return _study(study).estimate(log, **options)


def tune(study: _Study, log: Any = None, **options: Any) -> Sweep:
    """:meth:`Study.tune`"""
    return _study(study).tune(log, **options)


def compare(study: _Study, log: Any = None, **options: Any) -> Comparison:
    """:meth:`Study.compare`"""
    return _study(study).compare(log, **options)
