"""The commands as functions: of a study, or of its path.

What they take beside the study, what they give and what they raise is that of :class:`Study`'s methods.
"""

from __future__ import annotations

import os
from typing import Any, Literal, TypeAlias, overload

from ._inputs import Courses
from ._lynkeus import MEMORY
from ._progress import Progress
from ._types import ListOf, LogLike, Names
from .errors import ArgumentError
from .results import Certificate, Check, Comparison, Design, Estimation, Fit, HowWell, MonteCarlo, OpenRun
from .results import Simulation, Sweep
from .study import Study

_Study: TypeAlias = Study | str | os.PathLike[str]


def _study(study: _Study) -> Study:
    if isinstance(study, Study):
        return study
    if not isinstance(study, (str, os.PathLike)):
        raise ArgumentError.of("study", "a Study, or the path of one", study)
    return Study.load(study)


def check(
    study: _Study,
    *,
    parameters: bool = False,
    about: str | Names = (),
    time_limit: float | None = None,
    memory_limit: float = MEMORY,
) -> Check:
    """Which states, unknown inputs and parameters can be known, and which observers fit.

    Parameters
    ----------
    study : Study or path
        The study, or its file.
    parameters : bool
        Asks about the model's parameters as well.
    about : str or list of str
        An expression in Modelica, or several, to decide on as well.
    time_limit : float, optional
        What the call may take, in seconds.
    memory_limit : float
        What it may take, in MiB.

    Returns
    -------
    Check
        ``recommended``, ``families`` with every condition, ``knowledge``, ``observability``.

    Raises
    ------
    InputError
        The study does not fit its model, or an expression cannot be read.
    LimitError
        A limit ended it before there was an answer.
    """
    return _study(study).check(parameters=parameters, about=about, time_limit=time_limit, memory_limit=memory_limit)


def design(study: _Study, *, time_limit: float | None = None, memory_limit: float = MEMORY) -> Design:
    """The observer, with its gains and certificate.

    Parameters
    ----------
    study : Study or path
        The study, or its file.
    time_limit : float, optional
        What the call may take, in seconds.
    memory_limit : float
        What it may take, in MiB.

    Returns
    -------
    Design
        ``gain`` or ``injection``, ``parameters``, ``chains``, ``certificate``.

    Raises
    ------
    InputError
        The study does not fit its model.
    RefusedError
        No family fits, or a condition of the one that is asked for is refuted.
    LimitError
        A limit ended it before there was an answer.
    """
    return _study(study).design(time_limit=time_limit, memory_limit=memory_limit)


def certify(study: _Study, *, time_limit: float | None = None, memory_limit: float = MEMORY) -> Certificate:
    """What can be proved of the observer on the declared box.

    Parameters
    ----------
    study : Study or path
        The study, or its file.
    time_limit : float, optional
        What the call may take, in seconds.
    memory_limit : float
        What it may take, in MiB.

    Returns
    -------
    Certificate
        ``verdict``, and ``certificate`` with ``rate``, ``ultimate_bound``, ``hypotheses``.

    Raises
    ------
    InputError
        The study does not fit its model.
    RefusedError
        No family fits, or a condition of the one that is asked for is refuted.
    LimitError
        A limit ended it before there was an answer.
    """
    return _study(study).certify(time_limit=time_limit, memory_limit=memory_limit)


def how_well(
    study: _Study,
    *,
    horizon: float | None = None,
    sensors: Literal["outputs", "all"] | None = None,
    time_limit: float | None = None,
    memory_limit: float = MEMORY,
) -> HowWell:
    """Standard errors that any estimate has at least, for the declared noise.

    Parameters
    ----------
    study : Study or path
        The study, or its file.
    horizon : float, optional
        The longest span of readings, in the model's unit of time; that of ``[simulate]`` where it is left out.
    sensors : str, optional
        Tries other sensors: every one of the ``"outputs"`` of the model, or ``"all"`` with its states.
    time_limit : float, optional
        What the call may take, in seconds.
    memory_limit : float
        What it may take, in MiB.

    Returns
    -------
    HowWell
        ``standard_error``, ``ranked``, ``advice``; columns over the span of readings.

    Raises
    ------
    InputError
        The study does not fit its model, or has no ``[simulate]``.
    LimitError
        A limit ended it before there was an answer.
    """
    return _study(study).how_well(horizon=horizon, sensors=sensors, time_limit=time_limit, memory_limit=memory_limit)


@overload
def simulate(
    study: _Study,
    *,
    inputs: Courses | None = ...,
    runs: None = ...,
    progress: Progress = ...,
    time_limit: float | None = ...,
    memory_limit: float = ...,
) -> Simulation: ...
@overload
def simulate(
    study: _Study,
    *,
    inputs: Courses | None = ...,
    runs: int,
    progress: Progress = ...,
    time_limit: float | None = ...,
    memory_limit: float = ...,
) -> MonteCarlo: ...
@overload
def simulate(
    study: _Study,
    *,
    inputs: LogLike,
    runs: None = ...,
    progress: Progress = ...,
    time_limit: float | None = ...,
    memory_limit: float = ...,
) -> OpenRun: ...
def simulate(
    study: _Study,
    *,
    inputs: LogLike | Courses | None = None,
    runs: int | None = None,
    progress: Progress = False,
    time_limit: float | None = None,
    memory_limit: float = MEMORY,
) -> Simulation | MonteCarlo | OpenRun:
    """The plant with its observer, once or many times; or the plant alone on a log.

    Parameters
    ----------
    study : Study or path
        The study, or its file.
    inputs : log, or mapping of str to array, function, float or str, optional
        What drives the plant. A log (a path, a mapping of columns, a data frame) drives the plant alone, row by row,
        without observer and noise; in a mapping with times under ``"t"`` a column may be a function of time or a
        number as well. Without columns, numbers, expressions of time in Modelica and functions of time that can be
        traced (``lambda t: lynkeus.sin(t)``) stand for those of ``[simulate]``.
    runs : int, optional
        So many runs with other noise and starts, at least 1.
    progress : bool or function
        Shows how far it is, or calls the function with the share that is done, from 0 to 1.
    time_limit : float, optional
        What the call may take, in seconds.
    memory_limit : float
        What it may take, in MiB.

    Returns
    -------
    Simulation, MonteCarlo or OpenRun
        A run, with ``runs`` what they have in common, on a log the plant alone with its errors.

    Raises
    ------
    InputError
        The study cannot be run, or an input has no value.
    RefusedError
        A condition is refuted, or the estimate diverges.
    LimitError
        A limit ended it before its first row.
    """
    ask: Any = _study(study).simulate  # which of its kinds of answers it is depends on both
    found: Simulation | MonteCarlo | OpenRun = ask(
        inputs=inputs, runs=runs, progress=progress, time_limit=time_limit, memory_limit=memory_limit
    )
    return found


def estimate(
    study: _Study,
    log: LogLike,
    *,
    record: bool = False,
    progress: Progress = False,
    time_limit: float | None = None,
    memory_limit: float = MEMORY,
) -> Estimation:
    """A log through the observer.

    Parameters
    ----------
    study : Study or path
        The study, or its file.
    log : path, mapping of columns, data frame, table or run
        A file (CSV, Parquet), columns of shape (rows,) by their headers, a data frame of pandas or polars, a
        table of Arrow, a structured array or a simulation.
    record : bool
        Keeps what a filter made of each row, for :attr:`Estimation.filter`.
    progress : bool or function
        Shows how far it is, or calls the function with the share that is done, from 0 to 1.
    time_limit : float, optional
        What the call may take, in seconds.
    memory_limit : float
        What it may take, in MiB.

    Returns
    -------
    Estimation
        Columns of estimates; ``final``, ``errors``, ``innovations``, ``doubts``.

    Raises
    ------
    InputError
        The study cannot be run, the log lacks what it reads, or ``record`` is asked of an observer that is no filter.
    RefusedError
        A condition is refuted, or the estimate diverges.
    LimitError
        A limit ended it before its first row.
    """
    asked = _study(study)
    return asked.estimate(
        log, record=record, progress=progress, time_limit=time_limit, memory_limit=memory_limit
    )


def tune(
    study: _Study,
    log: LogLike | None = None,
    *,
    progress: Progress = False,
    time_limit: float | None = None,
    memory_limit: float = MEMORY,
) -> Sweep:
    """The tuning of ``[tune]`` over its values.

    Parameters
    ----------
    study : Study or path
        The study, or its file.
    log : path, mapping of columns, data frame, table or run, optional
        What the values are judged by; simulation where it is left out.
    progress : bool or function
        Shows how far it is, or calls the function with the share that is done, from 0 to 1.
    time_limit : float, optional
        What the call may take, in seconds.
    memory_limit : float
        What it may take, in MiB.

    Returns
    -------
    Sweep
        A row for each value; ``knee``, ``nearly_as_good``.

    Raises
    ------
    InputError
        There is nothing to sweep, the study cannot be run, or the log lacks what it reads.
    LimitError
        A limit ended it before there was an answer.
    """
    return _study(study).tune(log, progress=progress, time_limit=time_limit, memory_limit=memory_limit)


def fit(
    study: _Study,
    logs: LogLike | ListOf[LogLike],
    *,
    profiles: bool = False,
    next_experiment: bool = False,
    progress: Progress = False,
    time_limit: float | None = None,
    memory_limit: float = MEMORY,
) -> Fit:
    """Parameters, noises, spectral densities and starts of ``[fit]`` from logs, by their likelihood.

    Parameters
    ----------
    study : Study or path
        The study, or its file.
    logs : path, mapping of columns, data frame, table or run, or a list of them
        What the values are fitted to. A start is found for each of them.
    profiles : bool
        Finds the intervals by profile likelihood: the other values are searched anew along each.
    next_experiment : bool
        Tells how well the values would be known with one more log, by candidates of ``[fit]`` or usual ones.
    progress : bool or function
        Shows how far it is, or calls the function with the share that is done, from 0 to 1.
    time_limit : float, optional
        What the call may take, in seconds.
    memory_limit : float
        What it may take, in MiB.

    Returns
    -------
    Fit
        ``parameters``, ``noise``, ``process_noise`` and ``initial`` with standard deviations and intervals;
        columns of innovations.

    Raises
    ------
    InputError
        ``[fit]`` does not fit the study, the study cannot be run, or a log lacks what it reads.
    RefusedError
        The likelihood has no value at any start.
    LimitError
        A limit ended it before there was an answer.
    """
    asked = _study(study)
    return asked.fit(
        logs,
        profiles=profiles,
        next_experiment=next_experiment,
        progress=progress,
        time_limit=time_limit,
        memory_limit=memory_limit,
    )


def compare(
    study: _Study,
    log: LogLike | None = None,
    *,
    progress: Progress = False,
    time_limit: float | None = None,
    memory_limit: float = MEMORY,
) -> Comparison:
    """Families side by side.

    Parameters
    ----------
    study : Study or path
        The study, or its file.
    log : path, mapping of columns, data frame, table or run, optional
        What they estimate from; a simulation where it is left out.
    progress : bool or function
        Shows how far it is, or calls the function with the share that is done, from 0 to 1.
    time_limit : float, optional
        What the call may take, in seconds.
    memory_limit : float
        What it may take, in MiB.

    Returns
    -------
    Comparison
        ``comparison["ekf"].rms``, ``families``.

    Raises
    ------
    InputError
        The study cannot be run, or the log lacks what it reads.
    RefusedError
        No family can be run.
    LimitError
        A limit ended it before there was an answer.
    """
    return _study(study).compare(log, progress=progress, time_limit=time_limit, memory_limit=memory_limit)
