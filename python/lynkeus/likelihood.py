"""The likelihood of logs as a function of parameters and noises, for optimisers and samplers of others."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _lynkeus
from .errors import ArgumentError, InputError, LogWarning
from .systems import vector

if TYPE_CHECKING:
    from .study import Study

Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Innovations:
    """What the readings of a log say beside their predictions: :meth:`Likelihood.innovations`.

    The outputs of a row count one after the other, in the order of :attr:`outputs`: the innovation of a later one is
    what the earlier ones leave of it, so that all are independent and ``nll`` is their sum
    ½ Σ (log 2πS + ν²/S). Of one output, or of the first, they are those of :class:`lynkeus.Filtered`. Where an output
    did not report they are NaN.
    """

    log: str
    """the file, or what stands for it"""
    outputs: list[str]
    """names of the measured outputs"""
    t: Array
    """the time of each row in the model's unit, shape (rows,)"""
    innovation: Array
    """ν = y − ŷ in the units of the outputs, shape (rows, outputs); of a reading at an end of its sensor's range the
    end less ŷ"""
    variance: Array
    """S, shape (rows, outputs)"""
    at_limit: NDArray[np.bool_]
    """whether the reading is at an end of its sensor's range, and counts as "there or beyond", shape (rows, outputs)"""
    fitted: int
    """how many of the first rows count in ``nll``; those after them are held out"""

    def __repr__(self) -> str:
        return f"<Innovations of {self.log}: {len(self.t)} rows, outputs {', '.join(self.outputs)}>"


class Likelihood:
    """−log L of logs at θ, the vector of what the study's ``[fit]`` names, with its derivatives: what
    :meth:`Study.likelihood` gives, and what :meth:`Study.fit` makes least.

    θ is in the units of the study: parameters, noises and densities as they stand there, and no logarithms. Outside
    of :attr:`bounds`, and where the model has no value along the log, nothing is raised: ``nll`` is infinite,
    ``log_posterior`` minus infinity, and derivatives are NaN. A θ of another shape raises an :class:`InputError`.
    Steps of integration are settled at :attr:`start` and stay, so that the function is smooth.

    Threads may share it: their calls take turns, without Python's lock. It can be pickled.

    Examples
    --------
    >>> import lynkeus, numpy as np
    >>> leak = lynkeus.Model.from_modelica('''
    ...     model Leak
    ...       parameter Real k(min = 0.01, max = 1) = 0.2;
    ...       Real level(start = 4, min = 0, max = 10);
    ...       output Real y = level;
    ...     equation
    ...       der(level) = -k*level;
    ...     end Leak;''')
    >>> study = lynkeus.Study(leak, noise={"y": 0.1}, observer="ekf", fit={"parameters": ["k"], "noise": True})
    >>> t = np.arange(0.0, 10.0, 0.5)
    >>> likelihood = study.likelihood({"t": t, "y": 4 * np.exp(-0.3 * t)})
    >>> likelihood.names, likelihood.start
    (['k', 'noise.y'], array([0.2, 0.1]))
    >>> value, gradient = likelihood.value_and_gradient([0.3, 0.1])
    >>> bool(value < likelihood.nll([0.2, 0.1])), gradient.shape
    (True, (2,))
    >>> likelihood.nll([2.0, 0.1])
    inf
    """

    def __init__(self, core: _lynkeus.Likelihood, study: Study) -> None:
        self._core = core
        self._study = study
        self.names: list[str] = core.names
        """names of θ: ``k1``, ``noise.y``, ``process_noise.x``, ``initial.x[1]`` (the last of the first log)"""
        self.outputs: list[str] = core.outputs
        """names of the measured outputs"""
        self.start: Array = _constant(core.start)
        """the study's own θ, shape (n,)"""
        self.bounds: Array = _constant(core.bounds)
        """the least and the largest θ, shape (n, 2), as SciPy takes them; infinite where there is no bound"""
        self.is_log: NDArray[np.bool_] = _constant(core.is_log)
        """which of θ :meth:`Study.fit` searches as logarithms, shape (n,)"""
        self.priors: dict[str, tuple[float, float]] = core.priors
        """mean and standard deviation of what was known before, by name"""
        self.notes: list[str] = core.notes
        """what you should know"""
        means, deviations = zip(*(self.priors.get(name, (0.0, np.inf)) for name in self.names), strict=True)
        self._means, self._deviations = np.array(means), np.array(deviations)

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (self._study, self._core.logs())

    def nll(self, theta: ArrayLike) -> float:
        """−log L, without the share of priors.

        Parameters
        ----------
        theta : array_like
            θ, shape (n,), in the order of :attr:`names`.

        Returns
        -------
        float
            Of the rows that are fitted; infinite outside of the bounds and where the model has no value.

        Raises
        ------
        ArgumentError, InputError
            θ has no numbers, or another shape.
        """
        return self._core.at(self._theta(theta))[0]

    def gradient(self, theta: ArrayLike) -> Array:
        """The gradient of −log L: exact, but for rounding.

        Parameters
        ----------
        theta : array_like
            θ, shape (n,).

        Returns
        -------
        numpy.ndarray
            Shape (n,), per unit of each θ; NaN where −log L is infinite.

        Raises
        ------
        ArgumentError, InputError
            θ has no numbers, or another shape.
        """
        return self._core.at(self._theta(theta))[1]

    def value_and_gradient(self, theta: ArrayLike) -> tuple[float, Array]:
        """−log L and its gradient, which cost no more than one of them:
        ``scipy.optimize.minimize(likelihood.value_and_gradient, likelihood.start, jac=True, bounds=likelihood.bounds)``.

        Parameters
        ----------
        theta : array_like
            θ, shape (n,).

        Returns
        -------
        tuple of float and numpy.ndarray
            The value, and the gradient of shape (n,).

        Raises
        ------
        ArgumentError, InputError
            θ has no numbers, or another shape.
        """
        return self._core.at(self._theta(theta))[:2]

    def information(self, theta: ArrayLike) -> Array:
        """Fisher's information, from first derivatives: what the Hessian is on average over logs of that θ. It is
        never indefinite, and costs no more than the gradient.

        Parameters
        ----------
        theta : array_like
            θ, shape (n,).

        Returns
        -------
        numpy.ndarray
            Shape (n, n); NaN where −log L is infinite.

        Raises
        ------
        ArgumentError, InputError
            θ has no numbers, or another shape.
        """
        return self._core.at(self._theta(theta))[2]

    def hessian(self, theta: ArrayLike) -> Array:
        """The Hessian of −log L, by differences of exact gradients to fourth order: 4n gradients.

        Parameters
        ----------
        theta : array_like
            θ, shape (n,).

        Returns
        -------
        numpy.ndarray
            Shape (n, n), symmetric; NaN where −log L is infinite there, and where the model has no value beside.

        Raises
        ------
        ArgumentError, InputError
            θ has no numbers, or another shape.
        """
        return self._core.hessian(self._theta(theta))

    def log_prior(self, theta: ArrayLike) -> float:
        """What was known before, by ``priors`` of ``[fit]``: −½ Σ ((θ − mean)/sd)² within the bounds, up to a
        constant.

        Parameters
        ----------
        theta : array_like
            θ, shape (n,).

        Returns
        -------
        float
            At most 0; minus infinity outside of the bounds.

        Raises
        ------
        ArgumentError, InputError
            θ has no numbers, or another shape.
        """
        return self._prior(self._theta(theta))

    def log_posterior(self, theta: ArrayLike) -> float:
        """log L and the share of priors, up to a constant: what samplers take.

        Parameters
        ----------
        theta : array_like
            θ, shape (n,).

        Returns
        -------
        float
            ``log_prior(theta) - nll(theta)``; minus infinity outside of the bounds and where the model has no value.

        Raises
        ------
        ArgumentError, InputError
            θ has no numbers, or another shape.
        """
        at = self._theta(theta)
        prior = self._prior(at)
        return prior if np.isneginf(prior) else prior - self._core.at(at)[0]

    def log_posterior_and_gradient(self, theta: ArrayLike) -> tuple[float, Array]:
        """The same with its gradient, for samplers that follow it. Least of its negative is where :meth:`Study.fit`
        ends.

        Parameters
        ----------
        theta : array_like
            θ, shape (n,).

        Returns
        -------
        tuple of float and numpy.ndarray
            The value, and the gradient of shape (n,).

        Raises
        ------
        ArgumentError, InputError
            θ has no numbers, or another shape.
        """
        at = self._theta(theta)
        prior = self._prior(at)
        if np.isneginf(prior):
            return prior, np.full(len(at), np.nan)
        nll, gradient, _ = self._core.at(at)
        return prior - nll, -gradient - (at - self._means) / self._deviations**2

    def innovations(self, theta: ArrayLike) -> list[Innovations]:
        """The innovations of every reading with their variances.

        Parameters
        ----------
        theta : array_like
            θ, shape (n,).

        Returns
        -------
        list of Innovations
            One for each log, rows that are held out included; NaN outside of the bounds, and from the row on where
            the model has no value.

        Raises
        ------
        ArgumentError, InputError
            θ has no numbers, or another shape.
        """
        found = self._core.innovations(self._theta(theta))
        return [Innovations(outputs=list(self.outputs), **log) for log in found]

    def _theta(self, theta: ArrayLike) -> Array:
        given, count = vector("theta", theta), len(self.names)
        shape = np.shape(theta)
        if shape != (count,):
            raise InputError(f"theta: expected {count} values ({', '.join(self.names)}), found the shape {shape}")
        return given

    def _prior(self, theta: Array) -> float:
        if not np.all((self.bounds[:, 0] <= theta) & (theta <= self.bounds[:, 1])):
            return -np.inf
        return -0.5 * float(np.sum(((theta - self._means) / self._deviations) ** 2))

    def __repr__(self) -> str:
        return f"<Likelihood of {self._core.plant}: {', '.join(self.names)}>"


def likelihood(core: _lynkeus.Likelihood, study: Study) -> Likelihood:
    """The function, with a warning where its logs are not whole."""
    for text in core.warnings():
        warnings.warn(text, LogWarning, stacklevel=4)
    return Likelihood(core, study)


def _constant(values: NDArray[Any]) -> NDArray[Any]:
    values.flags.writeable = False
    return values


def _again(study: Study, logs: list[_lynkeus.Log]) -> Likelihood:
    return Likelihood(study._core.likelihood(logs), study)
