"""What a Kalman filter made of each row of a log."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Filtered:
    """Innovations, covariances, gains and likelihood of a filter, a row for each row of the run:
    ``study.estimate(log, record=True).filter``.

    Units are those of the model. A sensor that did not report has NaN in :attr:`innovation` and in its row and
    column of :attr:`innovation_covariance`, and 0 in :attr:`gain`. A reading that the gate rejects has an
    innovation and its covariance, a gain of 0, and no part in :attr:`log_likelihood`. A reading at a limit of its
    sensor stands for an ordinary one, whose innovation and gain are told; its likelihood is that of the output being
    there or beyond.
    """

    sensors: list[str]
    """names of the measured outputs"""
    states: list[str]
    """names of the states, unknown inputs and estimated parameters among them"""
    predicted: Numbers
    """ŷ = h(x̂⁻) before the row's readings count, shape (rows, sensors); whether the sensor reported or not"""
    innovation: Numbers
    """ν = y − ŷ, shape (rows, sensors)"""
    innovation_covariance: Numbers
    """S = CP⁻Cᵀ + R, shape (rows, sensors, sensors)"""
    gain: Numbers
    """K, shape (rows, states, sensors): x̂⁺ = x̂⁻ + Kν where ``bounds`` do not move it; NaN of ``mhe``, which
    estimates a window anew and has none"""
    covariance: Numbers
    """P after the row's readings, shape (rows, states, states)"""
    log_likelihood: Numbers
    """−½(log det 2πS + νᵀS⁻¹ν) over the row's readings, shape (rows,); 0 where none corrected"""

    @property
    def nll(self) -> float:
        """The negative log-likelihood of the log: the rows' sum, the first row included."""
        return -float(np.sum(self.log_likelihood))

    def __repr__(self) -> str:
        rows = len(self.log_likelihood)
        return f"<Filtered: {rows} rows, sensors {', '.join(self.sensors)}, states {', '.join(self.states)}>"

    @classmethod
    def _of(cls, kept: Any) -> Filtered:
        """Of what the engine kept: names, and numbers row after row."""
        sensors, states, parts = kept
        n, m = len(states), len(sensors)
        shapes = {
            "predicted": (m,),
            "innovation": (m,),
            "innovation_covariance": (m, m),
            "gain": (n, m),
            "covariance": (n, n),
            "log_likelihood": (),
        }
        arrays = {name: np.asarray(values).reshape(-1, *shapes[name]) for name, values in parts}
        for array in arrays.values():
            array.flags.writeable = False
        return cls(list(sensors), list(states), **arrays)
