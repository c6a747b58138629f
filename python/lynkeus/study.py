"""Studies: a plant, its sensors, an observer, and what is asked of them."""

from __future__ import annotations

import os
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, overload

from . import _batches, _lynkeus
from ._arguments import LIMITS, flag, function, instance, optional, path as path_of, progress as told_of
from ._arguments import real, several, takes, whole, word, words
from ._base import Base, plant_of, spelled
from ._batches import Options
from ._each import Errors
from ._export import EXPORT, Export, write
from ._logs import given
from ._lynkeus import MEMORY
from ._progress import Progress, told
from ._toml import document, valid
from .errors import InputError
from .systems import Functions, Observer
from .model import Model
from .results import (
    Certificate,
    Check,
    Comparison,
    Design,
    Estimation,
    HowWell,
    MonteCarlo,
    Simulation,
    Sweep,
    judged,
    warned,
)

Section = Mapping[str, Any]
#: what runs in batches takes
_BATCH = {"keep": optional(function), "workers": optional(whole), "errors": word, "progress": told_of, **LIMITS}


class Study:
    """Everything that is asked of a plant. Keys and sections are those of study files (docs/study.md).

    ``model`` is a :class:`Model`, or the path of one. ``measured``, ``unknown``, ``noise`` and the
    like are keys of ``[sensors]``; ``observer`` may be the name of a family.

    Examples:
        >>> import lynkeus
        >>> model = lynkeus.Model.from_modelica('''
        ...     model Tank
        ...       input Real inflow(min = 0, max = 5);
        ...       Real level(start = 4, min = 0.1, max = 10);
        ...       output Real y = level;
        ...     equation
        ...       der(level) = inflow - 0.5*sqrt(level);
        ...     end Tank;''')
        >>> study = lynkeus.Study(model, unknown=["inflow"], observer={"theta": 1.0},
        ...                       simulate={"until": 20, "output_step": 0.5, "inputs": {"inflow": 1.2}})
        >>> run = study.simulate()
        >>> float(abs(run["inflow_hat"][-1] - 1.2)) < 1e-3
        True
    """

    def __init__(
        self,
        model: Model | str | os.PathLike[str],
        *,
        measured: Sequence[str] | None = None,
        unknown: Sequence[str] | None = None,
        disturbances: Sequence[str] | None = None,
        noise: Section | None = None,
        limits: Section | None = None,
        sensors: Section | None = None,
        process_noise: Section | None = None,
        parameters: Section | None = None,
        observer: Section | str | None = None,
        box: Section | None = None,
        certify: Section | None = None,
        simulate: Section | None = None,
        estimate: Section | None = None,
        tune: Section | None = None,
        compare: Section | Sequence[str] | None = None,
        plot: Section | None = None,
        tables: str | None = None,
    ) -> None:
        given = {
            "tables": tables,
            "sensors": sensors,
            "process_noise": process_noise,
            "parameters": parameters,
            "observer": {"family": observer} if isinstance(observer, str) else observer,
            "box": box,
            "certify": certify,
            "simulate": simulate,
            "estimate": estimate,
            "tune": tune,
            "compare": compare,
            "plot": plot,
            "measured": measured,
            "unknown": unknown,
            "disturbances": disturbances,
            "noise": noise,
            "limits": limits,
        }
        text = document(spelled({name: value for name, value in given.items() if value is not None}))
        plant = plant_of("model", model)
        self._core = _lynkeus.Study.parse(text, "study", (plant.name, plant.text), plant.choose)

    @classmethod
    def _of(cls, core: _lynkeus.Study) -> Study:
        study = cls.__new__(cls)
        study._core = core
        return study

    @classmethod
    @takes(path=path_of, model=optional(word))
    def load(cls, path: str | os.PathLike[str], model: str | None = None) -> Study:
        """A study file, or a model, which stands for the study in which every output is measured and
        every input known; ``model`` chooses among several in its file. The plant's text is read as
        well: the study goes without files from here on."""
        return cls._of(_lynkeus.Study.load(os.fspath(path), model))

    @classmethod
    @takes(text=word, model=instance(Model, "a Model"), file=word)
    def parse(cls, text: str, model: Model, file: str = "study") -> Study:
        """A study's text in TOML with its model; ``file`` is what messages call it."""
        return cls._of(_lynkeus.Study.parse(valid(text), file, (model.name, model.text), model.choose))

    @property
    def text(self) -> str:
        """The study in TOML."""
        return self._core.text

    @property
    def model(self) -> Model:
        """The plant's equations."""
        plant = self._core.plant
        if plant is None:
            raise InputError('the study names no plant: expected `plant = "FILE.mo"`')
        name, text = plant
        return Model.load(name, self._core.model) if text is None else Model(text, name, self._core.model)

    def replace(self, **changes: Any) -> Study:
        """The same study with other keys; those of a section are added to it:
        ``study.replace(observer={"theta": 2.0}, parameters={"k": 0.1})``. A key that is ``None`` is
        left out. What :class:`Study` takes briefly is taken here as well (``unknown=["inflow"]``,
        ``compare=["ekf", "ukf"]``; ``observer="ekf"`` leaves no other tuning); ``plant`` is a :class:`Model` or
        the path of one, ``model`` the name of the one to take in it."""
        return Study._of(Base(self._core).changed(changes))

    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
        core = self._core
        return _restored, (core.text, core.file, core.plant, core.model)

    def __repr__(self) -> str:
        return f"<Study of {self.model.name}\n{self.text.rstrip()}>"

    @takes(parameters=flag, about=words, **LIMITS)
    def check(
        self,
        *,
        parameters: bool = False,
        about: str | Sequence[str] = (),
        time_limit: float | None = None,
        memory_limit: float = MEMORY,
    ) -> Check:
        """Which states, unknown inputs and (with ``parameters``) parameters can be known, and which
        observers fit; ``about``: an expression, or several, to decide on. ``time_limit`` in seconds and ``memory_limit`` in
        MiB, as everywhere: what a call may take until it ends with what is done by then."""
        asked = [valid(x) for x in about]
        return Check(self._core.check(parameters, asked, time_limit, memory_limit))

    @takes(**LIMITS)
    def design(self, *, time_limit: float | None = None, memory_limit: float = MEMORY) -> Design:
        """The observer, with its gains and certificate."""
        return Design(self._core.design(time_limit, memory_limit))

    @takes(**LIMITS)
    def certify(self, *, time_limit: float | None = None, memory_limit: float = MEMORY) -> Certificate:
        """What can be proved of the observer."""
        return Certificate(self._core.certify(time_limit, memory_limit))

    @takes(horizon=optional(real()), sensors=optional(word), **LIMITS)
    def how_well(
        self,
        *,
        horizon: float | None = None,
        sensors: str | None = None,
        time_limit: float | None = None,
        memory_limit: float = MEMORY,
    ) -> HowWell:
        """Standard errors for the declared noise; ``sensors``: try every ``"outputs"`` of the model, or
        ``"all"`` with its states."""
        return HowWell(self._core.how_well(horizon, sensors, time_limit, memory_limit))

    @overload
    def simulate(
        self, *, progress: Progress = ..., time_limit: float | None = ..., memory_limit: float = ...
    ) -> Simulation: ...
    @overload
    def simulate(
        self,
        *,
        runs: int,
        progress: Progress = ...,
        time_limit: float | None = ...,
        memory_limit: float = ...,
    ) -> MonteCarlo: ...
    @takes(runs=optional(whole), progress=told_of, **LIMITS)
    def simulate(
        self,
        *,
        runs: int | None = None,
        progress: Progress = False,
        time_limit: float | None = None,
        memory_limit: float = MEMORY,
    ) -> Simulation | MonteCarlo:
        """The plant with its observer; ``runs``: so many of them with other noise and starts."""
        if runs is not None and runs < 1:
            raise InputError(f"runs: expected at least 1, found {runs}")
        with told(progress, "simulating") as tell:
            if runs is None:
                return judged(Simulation(self._core.simulate(tell, time_limit, memory_limit)))
            return judged(MonteCarlo(self._core.monte_carlo(runs, tell, time_limit, memory_limit)))

    @takes(progress=told_of, **LIMITS)
    def estimate(
        self,
        log: Any,
        *,
        progress: Progress = False,
        time_limit: float | None = None,
        memory_limit: float = MEMORY,
    ) -> Estimation:
        """A log through the observer: a path, a mapping of columns, a data frame, an Arrow table or a
        simulation."""
        with told(progress, "estimating") as tell:
            return judged(Estimation(self._core.estimate(given(log), tell, time_limit, memory_limit)))

    @overload
    def estimate_each(
        self,
        logs: Any,
        *,
        by: str,
        keep: Callable[[Estimation], Any] | None = ...,
        workers: int | None = ...,
        errors: Errors = ...,
        progress: Progress = ...,
        time_limit: float | None = ...,
        memory_limit: float = ...,
    ) -> dict[Hashable, Any]: ...
    @overload
    def estimate_each(  # type: ignore[overload-overlap]  # a mapping is no list, but for types
        self,
        logs: Mapping[Any, Any],
        *,
        keep: Callable[[Estimation], Any] | None = ...,
        workers: int | None = ...,
        errors: Errors = ...,
        progress: Progress = ...,
        time_limit: float | None = ...,
        memory_limit: float = ...,
    ) -> dict[Hashable, Any]: ...
    @overload
    def estimate_each(
        self,
        logs: Iterable[Any],
        *,
        keep: Callable[[Estimation], Any] | None = ...,
        workers: int | None = ...,
        errors: Errors = ...,
        progress: Progress = ...,
        time_limit: float | None = ...,
        memory_limit: float = ...,
    ) -> list[Any]: ...
    @takes(by=optional(word), **_BATCH)
    def estimate_each(
        self,
        logs: Any,
        *,
        by: str | None = None,
        keep: Callable[[Estimation], Any] | None = None,
        workers: int | None = None,
        errors: Errors = "raise",
        progress: Progress = False,
        time_limit: float | None = None,
        memory_limit: float = MEMORY,
    ) -> list[Any] | dict[Hashable, Any]:
        """Many logs through the observer, on all cores: what :meth:`estimate` gives for each, in their
        order.

        ``logs`` is a list of what :meth:`estimate` takes, or a mapping of them by name; with ``by`` one
        table of all, in which that column names the asset of each row. Mappings and tables give a
        dictionary by name. ``keep`` makes of each result what is kept of it: so thousands of them need
        no memory. With ``errors="return"`` the exception of a log that fails stands in its place,
        instead of ending the rest. ``workers`` are threads, as many as there are cores; ``time_limit``
        is that of one log, in seconds, ``memory_limit`` that of all that run together, in MiB."""
        options = Options(keep, workers, errors, progress, time_limit, memory_limit)
        return _batches.estimate_each(self, logs, by, options)

    @takes(changes=several("dictionaries as of replace"), **_BATCH)
    def sweep(
        self,
        changes: Iterable[Section],
        log: Any = None,
        *,
        keep: Callable[[Any], Any] | None = None,
        workers: int | None = None,
        errors: Errors = "raise",
        progress: Progress = False,
        time_limit: float | None = None,
        memory_limit: float = MEMORY,
    ) -> list[Any]:
        """The study with each of the changes, simulated, or estimating from ``log``, on all cores.

        A change is what :meth:`replace` takes: ``{"observer": {"theta": 2.0}, "simulate": {"seed": 7}}``.
        The other options are those of :meth:`estimate_each`."""
        options = Options(keep, workers, errors, progress, time_limit, memory_limit)
        return _batches.sweep(self, changes, log, options)

    @takes(progress=told_of, **LIMITS)
    def tune(
        self,
        log: Any = None,
        *,
        progress: Progress = False,
        time_limit: float | None = None,
        memory_limit: float = MEMORY,
    ) -> Sweep:
        """The tuning of ``[tune]`` over its values, judged by simulation or by a log."""
        with told(progress, "tuning") as tell:
            return Sweep(self._core.tune(None if log is None else given(log), tell, time_limit, memory_limit))

    @takes(progress=told_of, **LIMITS)
    def compare(
        self,
        log: Any = None,
        *,
        progress: Progress = False,
        time_limit: float | None = None,
        memory_limit: float = MEMORY,
    ) -> Comparison:
        """Families side by side, on a simulation or on a log."""
        with told(progress, "comparing") as tell:
            recorded = None if log is None else given(log)
            return warned(Comparison(self._core.compare(recorded, tell, time_limit, memory_limit)))

    def plant(self) -> Functions:
        """The plant as functions, with the study's parameters and start."""
        return Functions(self._core.functions(), (Study.plant, (self,)))

    @takes(**LIMITS)
    def observer(self, *, time_limit: float | None = None, memory_limit: float = MEMORY) -> Observer:
        """The observer as functions of numbers, which python-control, CasADi, JAX and SciPy can run."""
        return Observer(self._core.observer(time_limit, memory_limit), (Study.observer, (self,)))

    @takes(**EXPORT, **LIMITS)
    def export(
        self,
        folder: str | os.PathLike[str],
        to: str = "c",
        *,
        precision: str = "f64",
        step: float | None = None,
        tunable: bool = False,
        fmi: str = "3",
        system: str | None = None,
        force: bool = False,
        time_limit: float | None = None,
        memory_limit: float = MEMORY,
    ) -> Export:
        """The estimator for other machines, as files in a folder that is new or empty (``force``: that
        may hold other files): ``to`` is ``"c"``, ``"js"``, ``"rust"``, ``"st"``, ``"fmu"`` (``fmi`` its version)
        or ``"html"``; ``step`` is the longest step of the integration, instead of the study's; with
        ``tunable`` θ, or what stands for it, may be changed while the estimator runs (an FMU has it
        anyway). With ``to="fmu"`` the ``system`` is ``"estimator"``, or in continuous time ``"plant"`` or
        ``"observer"``."""
        files, notes = self._core.export(
            to, precision, fmi, step, tunable, system, time_limit, memory_limit
        )
        return write(Path(folder), files, notes, force=force)

    def estimator(self) -> _lynkeus.Estimator:
        """An estimator for samples that come one by one."""
        return self._core.estimator(self)


def _restored(text: str, file: str, plant: tuple[str, str | None] | None, model: str | None) -> Study:
    return Study._of(_lynkeus.Study.parse(text, file, plant, model))


def _resumed(study: Study, snapshot: bytes) -> _lynkeus.Estimator:
    estimator = study.estimator()
    estimator.restore(snapshot)
    return estimator
