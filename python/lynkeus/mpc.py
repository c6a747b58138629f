"""A study's estimator in the slot of an estimator of do-mpc."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._arguments import instance, optional, real, section, takes
from .errors import ArgumentError, InputError
from .study import Study


@dataclass(frozen=True)
class _Sample:
    """What was read at a time, and the snapshot of the estimator before it was taken."""

    before: bytes
    t: float
    readings: dict[str, float]


class Estimator:
    """What ``do_mpc.estimator.StateFeedback`` and ``EKF`` are for a loop: ``x0 = estimator.make_step(y0)``.

    Measurements, inputs and states are matched by name; of a vector ``T`` the entries are ``T[1]``,
    ``T[2]``, … as in the study.

    Parameters
    ----------
    study : Study
        What estimates.
    model : do_mpc.model.Model
        The model of the controller.
    t_step : float
        The time between calls, in the study's unit.
    names : mapping of str to str, optional
        The study's name of what the model calls otherwise.

    Raises
    ------
    InputError
        The study has more sensors than the model measures, or does not estimate a state of it.
    """

    @takes(study=instance(Study, "a Study"), t_step=real(), names=optional(section))
    def __init__(self, study: Study, model: Any, t_step: float, names: Mapping[str, str] | None = None) -> None:
        self._study = study
        self._t_step = t_step
        if not all(hasattr(model, part) for part in ("x", "y", "u")):
            raise ArgumentError.of("model", "a do_mpc.model.Model", model)
        known = dict(names or {})
        self._start: dict[str, float] = {}
        self._measured = _entries(model.y, known)
        self._inputs = _entries(model.u, known)
        self._states = _entries(model.x, known)
        self.reset_history()
        self._expect("signal", self._estimator.signals, [*self._measured, *self._inputs], "a measurement or an input")
        self._expect("state", self._states, self._estimator.names, "estimated by the study")

    def _expect(self, kind: str, names: list[str], among: list[str], what: str) -> None:
        if missing := [name for name in names if name not in among]:
            raise InputError(
                f"the {kind} {missing[0]!r} has no counterpart: expected {what}, one of {', '.join(among)}; "
                "`names` says what the study calls a name of the model"
            )

    def reset_history(self) -> None:
        """Back to the start, that of the study or what was given as ``x0``, at time 0."""
        self._estimator = self._study.estimator()
        self._steps = 0
        self._last: _Sample | None = None

    def set_initial_guess(self) -> None:
        """The estimator starts at what was given as ``x0``, else where the study says."""
        if self._start:
            told = self._study._core.sections().get("observer", {}).get("initial", {})
            self._study = self._study.replace(observer={"initial": {**told, **self._start}})
            self._start = {}
        self.reset_history()

    @property
    def x0(self) -> NDArray[np.float64]:
        """The states of the model, shape (n, 1)."""
        found = self._estimator.estimate
        return np.array([[found[name]] for name in self._states])

    @x0.setter
    def x0(self, values: ArrayLike) -> None:
        self._start = self._vector("x0", self._states, values)
        self.set_initial_guess()

    def make_step(self, y0: ArrayLike, u0: ArrayLike | None = None) -> NDArray[np.float64]:
        """The states from measurements, as do-mpc's ``EKF`` takes them. A call that fails changes nothing but the
        time.

        Parameters
        ----------
        y0 : array_like
            The measurements in the model's order and units; NaN is a sensor that did not report.
        u0 : array_like, optional
            Where the study has known inputs, those that were applied since the last call.

        Returns
        -------
        numpy.ndarray
            The states of the model, shape (n, 1).

        Raises
        ------
        InputError
            There are not as many values as names.
        """
        t = self._steps * self._t_step
        self._steps += 1
        readings = self._given("y0", self._measured, y0)
        inputs = {} if u0 is None else self._given("u0", self._inputs, u0)
        before = self._estimator.snapshot()
        try:
            if self._last is not None and inputs:
                self._take_again(self._last, inputs)
            last = _Sample(self._estimator.snapshot(), t, readings)
            self._estimator.update(t, {**readings, **inputs})
        except BaseException:
            self._estimator.restore(before)
            raise
        self._last = last
        return self.x0

    def _given(self, what: str, names: list[str], values: ArrayLike) -> dict[str, float]:
        given = self._vector(what, names, values)
        return {name: x for name, x in given.items() if name in self._estimator.signals}

    @staticmethod
    def _vector(what: str, names: list[str], values: ArrayLike) -> dict[str, float]:
        """A number for each name."""
        try:
            # do-mpc's structures have their numbers in `cat`
            flat = np.asarray(getattr(values, "cat", values)).astype(float).ravel()
        except (TypeError, ValueError, OverflowError):
            raise ArgumentError.of(what, "numbers", values) from None
        if len(flat) != len(names):
            raise InputError(f"{what}: expected a value for each of {', '.join(names)}, found {len(flat)} values")
        return {name: float(x) for name, x in zip(names, flat, strict=True)}

    def _take_again(self, last: _Sample, inputs: dict[str, float]) -> None:
        """The sample before, of which only now is known which inputs followed it."""
        self._estimator.restore(last.before)
        self._estimator.update(last.t, {**last.readings, **inputs})


def _entries(structure: Any, names: Mapping[str, str]) -> list[str]:
    """The study's names of the entries of a structure of do-mpc, in order."""
    found: list[str] = []
    for key in structure.keys():
        # what every structure has besides what was declared
        size = 0 if key == "default" else structure[key].numel()
        name = names.get(key, key)
        found += [name] if size == 1 else [f"{name}[{i + 1}]" for i in range(size)]
    return found
