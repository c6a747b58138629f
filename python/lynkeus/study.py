"""Studies: a plant, its sensors, an observer, and what is asked of them."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, Unpack, overload

from . import _lynkeus
from ._arguments import LIMITS, flag, instance, optional, path as path_of, progress as told_of
from ._arguments import real, takes, whole, word, words
from ._base import FILE, Base, plant_of, spelled, spoken
from ._batched import Batched
from ._export import EXPORT, Export, write
from ._inputs import Courses, driven
from ._logs import given, given_each
from ._lynkeus import MEMORY
from ._progress import Progress, Terms, told
from ._toml import document, valid
from ._types import ListOf, LogLike, Names, Number, Numbers, Whole
from .errors import InputError, LimitError
from .likelihood import Likelihood, likelihood
from .systems import Functions, Observer
from .model import Model
from .results import (
    Certificate,
    Check,
    Comparison,
    Design,
    Estimation,
    Fit,
    HowWell,
    MonteCarlo,
    OpenRun,
    Simulation,
    Sweep,
    judged,
    warned,
)
from .sections import (
    BoxSection,
    CertifySection,
    Changes,
    CompareSection,
    EstimateSection,
    Family,
    FitSection,
    LogSection,
    ManifoldSection,
    ObserverSection,
    ParametersSection,
    PlotSection,
    ProcessNoiseSection,
    ServeSection,
    SensorsNoise,
    SensorsSection,
    SimulateSection,
    TuneSection,
)


class Study(Batched):
    """Everything that is asked of a plant. Sections and keys are those of study files (docs/study.md), and
    :mod:`lynkeus.sections` has their types.

    Parameters
    ----------
    model : Model or path
        The plant's equations.
    measured, unknown, disturbances : list of str, optional
        Outputs with sensors; inputs and parameters that nobody measures; inputs that the observer takes as
        zero. As ``noise`` and ``limits`` they are keys of ``[sensors]``, which stand for themselves.
    noise : mapping of str to float, str or dict, optional
        Standard deviations by output, in its unit, ``"5%"`` of its value, or ``{"uniform": 0.1}``.
    limits : mapping of str to list of float, optional
        The ranges that sensors can show, ``[lowest, highest]`` in their units.
    sensors : dict, optional
        The section ``[sensors]`` as a whole.
    process_noise : mapping of str to float, optional
        Spectral densities by state and unknown input: variance per unit of time.
    parameters : mapping of str to float, optional
        Values that replace those of the model, in its units.
    manifold : dict, optional
        Which states are angles (``circle``) and unit quaternions (``quaternion``), each a list of names.
    observer : dict or str, optional
        The section ``[observer]``, or the name of a family.
    box : mapping of str to float or list of float, optional
        Ranges narrower than the model's, in its units.
    certify, simulate, log, estimate, tune, fit, serve, plot : dict, optional
        The sections of these names.
    compare : dict or list of str, optional
        The section ``[compare]``, or the names of families.
    tables : str, optional
        ``"linear"`` or ``"monotone"``: what the model's tables are between their points.
    delay_states : int, optional
        States that hold each delay of the model, at most 10.

    Raises
    ------
    InputError
        A section or key that is not known, a value of another kind than its key takes, a name that the model
        does not have, a model that cannot be read.

    Examples
    --------
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
        measured: Names | None = None,
        unknown: Names | None = None,
        disturbances: Names | None = None,
        noise: Mapping[str, Number | str | SensorsNoise] | None = None,
        limits: Mapping[str, Numbers] | None = None,
        sensors: SensorsSection | None = None,
        process_noise: ProcessNoiseSection | None = None,
        parameters: ParametersSection | None = None,
        manifold: ManifoldSection | None = None,
        observer: ObserverSection | Family | None = None,
        box: BoxSection | None = None,
        certify: CertifySection | None = None,
        simulate: SimulateSection | None = None,
        log: LogSection | None = None,
        estimate: EstimateSection | None = None,
        tune: TuneSection | None = None,
        fit: FitSection | None = None,
        compare: CompareSection | Names | None = None,
        serve: ServeSection | None = None,
        plot: PlotSection | None = None,
        tables: Literal["linear", "monotone"] | None = None,
        delay_states: Whole | None = None,
    ) -> None:
        given = {
            "tables": tables,
            "delay_states": delay_states,
            "sensors": sensors,
            "process_noise": process_noise,
            "parameters": parameters,
            "manifold": manifold,
            "observer": {"family": observer} if isinstance(observer, str) else observer,
            "box": box,
            "certify": certify,
            "simulate": simulate,
            "log": log,
            "estimate": estimate,
            "tune": tune,
            "fit": fit,
            "compare": compare,
            "serve": serve,
            "plot": plot,
            "measured": measured,
            "unknown": unknown,
            "disturbances": disturbances,
            "noise": noise,
            "limits": limits,
        }
        text = document(spelled({name: value for name, value in given.items() if value is not None}))
        plant = plant_of("model", model)
        with spoken():
            self._core = _lynkeus.Study.parse(text, FILE, (plant.name, plant.text), plant.choose)
            try:
                self._core.refuse_misfits()
            except LimitError:
                pass  # whoever asks something of it may allow more

    @classmethod
    def _of(cls, core: _lynkeus.Study) -> Study:
        study = cls.__new__(cls)
        study._core = core
        return study

    @classmethod
    @takes(path=path_of, model=optional(word))
    def load(cls, path: str | os.PathLike[str], model: str | None = None) -> Study:
        """A study file with its plant: the study goes without files from here on.

        Parameters
        ----------
        path : path
            A study in TOML, or a model, which stands for the study in which every output is measured and every
            input known.
        model : str, optional
            The model to take, where the plant's file holds several.

        Returns
        -------
        Study
            What the file says.

        Raises
        ------
        InputError
            There is no such file, or it cannot be read.
        """
        return cls._of(_lynkeus.Study.load(os.fspath(path), model))

    @classmethod
    @takes(text=word, model=instance(Model, "a Model"), file=word)
    def parse(cls, text: str, model: Model, file: str = "study") -> Study:
        """A study's text with its model.

        Parameters
        ----------
        text : str
            The study in TOML.
        model : Model
            The plant's equations.
        file : str
            What messages call the text.

        Returns
        -------
        Study
            What the text says.

        Raises
        ------
        InputError
            The text is no study; its place is told.
        """
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
        return Model.load(name, self._core.model) if text is None else Model._unread(text, name, self._core.model)

    def replace(self, **changes: Unpack[Changes]) -> Study:
        """The same study with other keys; those of a section are added to it:
        ``study.replace(observer={"theta": 2.0}, parameters={"k": 0.1})``.

        Parameters
        ----------
        **changes
            What :class:`Study` takes, briefly or not (``unknown=["inflow"]``, ``compare=["ekf", "ukf"]``;
            ``observer="ekf"`` leaves no other tuning). A key that is ``None`` is left out. ``plant`` is a
            :class:`Model` or the path of one, ``model`` the name of the one to take in it.

        Returns
        -------
        Study
            Another study; this one stays as it is.

        Raises
        ------
        InputError
            As of :class:`Study`.
        """
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
        about: str | Names = (),
        time_limit: float | None = None,
        memory_limit: float = MEMORY,
    ) -> Check:
        """Which states, unknown inputs and parameters can be known, and which observers fit.

        Parameters
        ----------
        parameters : bool
            Asks about the model's parameters as well.
        about : str or list of str
            An expression in Modelica, or several, to decide on as well.
        time_limit : float, optional
            What the call may take, in seconds: then it ends with what is done by then. As everywhere.
        memory_limit : float
            What it may take, in MiB. As everywhere.

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
        asked = [valid(x) for x in about]
        return Check(self._core.check(parameters, asked, Terms(time_limit, memory_limit)))

    @takes(**LIMITS)
    def design(self, *, time_limit: float | None = None, memory_limit: float = MEMORY) -> Design:
        """The observer, with its gains and certificate.

        Parameters
        ----------
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
        return Design(self._core.design(Terms(time_limit, memory_limit)))

    @takes(**LIMITS)
    def certify(self, *, time_limit: float | None = None, memory_limit: float = MEMORY) -> Certificate:
        """What can be proved of the observer on the declared box.

        Parameters
        ----------
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
        return Certificate(self._core.certify(Terms(time_limit, memory_limit)))

    @takes(horizon=optional(real()), sensors=optional(word), **LIMITS)
    def how_well(
        self,
        *,
        horizon: float | None = None,
        sensors: Literal["outputs", "all"] | None = None,
        time_limit: float | None = None,
        memory_limit: float = MEMORY,
    ) -> HowWell:
        """Standard errors that any estimate has at least, for the declared noise.

        Parameters
        ----------
        horizon : float, optional
            The longest span of readings, in the model's unit of time; that of ``[simulate]`` where it is
            left out.
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
        return HowWell(self._core.how_well(horizon, sensors, Terms(time_limit, memory_limit)))

    @overload
    def simulate(
        self,
        *,
        inputs: Courses | None = ...,
        runs: None = ...,
        progress: Progress = ...,
        time_limit: float | None = ...,
        memory_limit: float = ...,
    ) -> Simulation: ...
    @overload
    def simulate(
        self,
        *,
        inputs: Courses | None = ...,
        runs: int,
        progress: Progress = ...,
        time_limit: float | None = ...,
        memory_limit: float = ...,
    ) -> MonteCarlo: ...
    @overload
    def simulate(
        self,
        *,
        inputs: LogLike,
        runs: None = ...,
        progress: Progress = ...,
        time_limit: float | None = ...,
        memory_limit: float = ...,
    ) -> OpenRun: ...
    @takes(runs=optional(whole), progress=told_of, **LIMITS)
    def simulate(
        self,
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
        if runs is not None and runs < 1:
            raise InputError(f"runs: expected at least 1, found {runs}")
        core = self._core
        if inputs is not None:
            sections = core.sections()
            found = driven(
                inputs, sections.get("log", {}).get("time") or sections.get("estimate", {}).get("time")
            )
            if not isinstance(found, dict):
                return self._open_run(found, runs, progress, Terms(time_limit, memory_limit))
            known = sections.get("simulate", {}).get("inputs", {})
            core = self.replace(simulate={"inputs": {**known, **found}})._core
        with told(progress, "simulating") as tell:
            if runs is None:
                return judged(Simulation(core.simulate(Terms(time_limit, memory_limit, tell))))
            return judged(MonteCarlo(core.monte_carlo(runs, Terms(time_limit, memory_limit, tell))))

    def _open_run(
        self, log: _lynkeus.Log | str, runs: int | None, progress: Progress, terms: Terms
    ) -> OpenRun:
        """The plant alone on a log."""
        if runs is not None:
            raise InputError("runs: the plant alone has no noise on a log, and all its runs are the same")
        with told(progress, "simulating") as tell:
            return judged(OpenRun(self._core.open_run(log, terms._replace(progress=tell))))

    @takes(record=flag, progress=told_of, **LIMITS)
    def estimate(
        self,
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
        log : path, mapping of columns, data frame, table or run
            A file (CSV, Parquet), columns of shape (rows,) by their headers, a data frame of pandas or
            polars, a table of Arrow, a structured array or a simulation.
        record : bool
            Keeps what a filter made of each row, for :attr:`Estimation.filter`: so many numbers as its matrices
            have, row by row.
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
            The study cannot be run, the log lacks what it reads, or ``record`` is asked of an observer that is
            no filter.
        RefusedError
            A condition is refuted, or the estimate diverges.
        LimitError
            A limit ended it before its first row.
        """
        with told(progress, "estimating") as tell:
            return judged(Estimation(self._core.estimate(given(log), Terms(time_limit, memory_limit, tell), record)))

    @takes(progress=told_of, **LIMITS)
    def tune(
        self,
        log: LogLike | None = None,
        *,
        progress: Progress = False,
        time_limit: float | None = None,
        memory_limit: float = MEMORY,
    ) -> Sweep:
        """The tuning of ``[tune]`` over its values.

        Parameters
        ----------
        log : path, mapping of columns, data frame, table or run, optional
            What the values are judged by, as of :meth:`estimate`; simulation where it is left out.
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
        with told(progress, "tuning") as tell:
            return Sweep(self._core.tune(None if log is None else given(log), Terms(time_limit, memory_limit, tell)))

    @takes(profiles=flag, next_experiment=flag, progress=told_of, **LIMITS)
    def fit(
        self,
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
        logs : path, mapping of columns, data frame, table or run, or a list of them
            What the values are fitted to, each as of :meth:`estimate`. A start is found for each of them.
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
        with told(progress, "fitting") as tell:
            found, text = self._core.fit(
                given_each(logs), profiles, next_experiment, Terms(time_limit, memory_limit, tell)
            )
        core = self._core
        fitted = None if text is None else _lynkeus.Study.parse(text, core.file, core.plant, core.model, core)
        return judged(Fit(found, None if fitted is None else Study._of(fitted)))

    @takes(**LIMITS)
    def likelihood(
        self, logs: LogLike | ListOf[LogLike], *, time_limit: float | None = None, memory_limit: float = MEMORY
    ) -> Likelihood:
        """What :meth:`fit` makes least, as a function for optimisers and samplers of others.

        Parameters
        ----------
        logs : path, mapping of columns, data frame, table or run, or a list of them
            As of :meth:`fit`.
        time_limit : float, optional
            What making it may take, in seconds.
        memory_limit : float
            What that may take, in MiB.

        Returns
        -------
        Likelihood
            ``nll``, ``gradient``, ``hessian``, ``innovations``, ``log_posterior`` of θ.

        Raises
        ------
        InputError
            As of :meth:`fit`.
        LimitError
            A limit ended it.
        """
        return likelihood(self._core.likelihood(given_each(logs), Terms(time_limit, memory_limit)), self)

    @takes(progress=told_of, **LIMITS)
    def compare(
        self,
        log: LogLike | None = None,
        *,
        progress: Progress = False,
        time_limit: float | None = None,
        memory_limit: float = MEMORY,
    ) -> Comparison:
        """Families side by side.

        Parameters
        ----------
        log : path, mapping of columns, data frame, table or run, optional
            What they estimate from, as of :meth:`estimate`; a simulation where it is left out.
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
        with told(progress, "comparing") as tell:
            recorded = None if log is None else given(log)
            return warned(Comparison(self._core.compare(recorded, Terms(time_limit, memory_limit, tell))))

    def plant(self) -> Functions:
        """The plant as functions of numbers.

        Returns
        -------
        Functions
            x' = f(t, x, u) and y = h(t, x, u), with the study's parameters and start.

        Raises
        ------
        InputError
            The plant cannot be read, or a parameter has no value.
        """
        return Functions(self._core.functions(), (Study.plant, (self,)))

    @takes(**LIMITS)
    def observer(self, *, time_limit: float | None = None, memory_limit: float = MEMORY) -> Observer:
        """The observer as functions of numbers, which python-control, CasADi, JAX and SciPy can run.

        Parameters
        ----------
        time_limit : float, optional
            What the call may take, in seconds.
        memory_limit : float
            What it may take, in MiB.

        Returns
        -------
        Observer
            z' = f(t, z, w) and the estimates h(t, z, w).

        Raises
        ------
        InputError
            The study does not fit its model.
        RefusedError
            No family fits, or a condition of the one that is asked for is refuted.
        LimitError
            A limit ended it before there was an answer.
        """
        return Observer(self._core.observer(Terms(time_limit, memory_limit)), (Study.observer, (self,)))

    @takes(**EXPORT, **LIMITS)
    def export(
        self,
        folder: str | os.PathLike[str],
        to: Literal["c", "js", "rust", "st", "fmu", "html"] = "c",
        *,
        precision: Literal["f64", "f32"] = "f64",
        step: float | None = None,
        tunable: bool = False,
        fmi: Literal["3", "2"] = "3",
        system: Literal["estimator", "plant", "observer"] | None = None,
        force: bool = False,
        time_limit: float | None = None,
        memory_limit: float = MEMORY,
    ) -> Export:
        """The estimator for other machines, as files.

        Parameters
        ----------
        folder : path
            A folder that is new or empty.
        to : str
            ``"c"``, ``"js"``, ``"rust"``, ``"st"``, ``"fmu"`` or ``"html"``.
        precision : str
            ``"f64"``, or ``"f32"``: numbers of 64 or 32 bits.
        step : float, optional
            The longest step of the integration in the model's unit of time, instead of the study's.
        tunable : bool
            θ, or what stands for it, may be changed while the estimator runs (an FMU has it anyway).
        fmi : str
            The version of an FMU, ``"3"`` or ``"2"``.
        system : str, optional
            Of an FMU: ``"estimator"``, or in continuous time ``"plant"`` or ``"observer"``.
        force : bool
            The folder may hold other files; what has the same names is replaced.
        time_limit : float, optional
            What the call may take, in seconds.
        memory_limit : float
            What it may take, in MiB.

        Returns
        -------
        Export
            ``files`` that were written, and ``notes``.

        Raises
        ------
        InputError
            The study does not fit its model, the folder holds files, or cannot be written to.
        RefusedError
            The observer cannot be exported, or a condition of it is refuted.
        LimitError
            A limit ended it before there was an answer.
        """
        files, notes = self._core.export(
            to, precision, fmi, step, tunable, system, Terms(time_limit, memory_limit)
        )
        return write(Path(folder), files, notes, force=force)

    @takes(wait=real())
    def estimator(self, *, wait: float = 0.0) -> _lynkeus.Estimator:
        """An estimator for samples that come one by one.

        Parameters
        ----------
        wait : float
            How much later than another a sample may come, in the model's unit of time: it is put in its place. The
            readings of a sensor with a ``delay`` are put in theirs whatever this says.

        Returns
        -------
        Estimator
            At its start, before the first sample.

        Raises
        ------
        InputError
            The study does not fit its model.
        RefusedError
            No family fits, or a condition of the one that is asked for is refuted.
        """
        return self._core.estimator(self, wait)


def _restored(text: str, file: str, plant: tuple[str, str | None] | None, model: str | None) -> Study:
    return Study._of(_lynkeus.Study.parse(text, file, plant, model))


def _resumed(study: Study, snapshot: bytes, wait: float = 0.0) -> _lynkeus.Estimator:
    estimator = study.estimator(wait=wait)
    estimator.restore(snapshot)
    return estimator
