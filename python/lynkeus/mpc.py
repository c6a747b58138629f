"""A study's estimator in the slot of an estimator of do-mpc."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import InputError
from .study import Study


class Estimator:
    """What ``do_mpc.estimator.StateFeedback`` and ``EKF`` are for a loop: ``x0 = estimator.make_step(y0)``.

    ``model`` is the ``do_mpc.model.Model`` of the controller, ``t_step`` the time between calls.
    Measurements, inputs and states are matched by name; of a vector ``T`` the entries are ``T[1]``,
    ``T[2]``, … as in the study. ``names`` gives the study's name where the model has another. A study
    with more sensors than the model measures, or that does not estimate a state of it, is refused.
    """

    def __init__(self, study: Study, model: Any, t_step: float, names: Mapping[str, str] | None = None) -> None:
        self._study = study
        self._t_step = t_step
        known = dict(names or {})
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
        """Back to the start of the study, at time 0."""
        self._estimator = self._study.estimator()
        self._steps = 0

    def set_initial_guess(self) -> None:
        """Nothing is guessed: the start is the study's."""

    @property
    def x0(self) -> NDArray[np.float64]:
        """The states of the model, shape (n, 1)."""
        found = self._estimator.estimate
        return np.array([[found[name]] for name in self._states])

    def make_step(self, y0: ArrayLike, u0: ArrayLike | None = None) -> NDArray[np.float64]:
        """The states from the measurements ``y0`` and, where the study has known inputs, the inputs
        ``u0`` from here on; NaN is a sensor that did not report."""
        given = dict(zip(self._measured, np.ravel(y0), strict=True))
        if u0 is not None:
            given |= zip(self._inputs, np.ravel(u0), strict=True)
        readings = {name: float(given[name]) for name in self._estimator.signals if name in given}
        self._estimator.update(self._steps * self._t_step, readings)
        self._steps += 1
        return self.x0


def _entries(structure: Any, names: Mapping[str, str]) -> list[str]:
    """The study's names of the entries of a structure of do-mpc, in order."""
    found: list[str] = []
    for key in structure.keys():
        # what every structure has besides what was declared
        size = 0 if key == "default" else structure[key].numel()
        name = names.get(key, key)
        found += [name] if size == 1 else [f"{name}[{i + 1}]" for i in range(size)]
    return found
