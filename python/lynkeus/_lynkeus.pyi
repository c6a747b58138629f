"""The compiled half of the package."""

import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._columns import Given as _Given
from ._progress import Terms as _Terms
from .errors import LynkeusError
from .reports import Health as _Health, Innovation as _Innovation, Revised as _Revised
from .study import Study as _Study

_Column = NDArray[np.float64]

#: of the package and of the command
__version__: str

#: MiB that a call may take where nothing else is said
MEMORY: float

class Answer:
    """What a command answers, in the engine."""

    def text(self) -> str: ...
    def html(self) -> str: ...
    def json(self) -> str: ...
    def headers(self) -> list[str]: ...
    def rows(self) -> int: ...
    def column(self, place: int) -> _Column | None: ...
    def arrow_schema(self) -> object: ...
    def arrow_stream(self) -> object: ...
    def svg(self) -> str | None: ...
    def panels(self) -> tuple[str, list[tuple[str, str]]] | None:
        """The label of the time axis, and name and caption of each panel of the picture, from the top."""

    def corrections(self) -> tuple[list[str], list[str], list[tuple[str, _Column]]] | None:
        """Names of sensors and states, and by name the entries of what a filter's corrections are made of, row after
        row."""

    def origin(self) -> tuple[int, bool, float] | None:
        """What stands for zero where times are dates: nanoseconds since 1970, and whether that is UTC."""

    def refusal(self) -> LynkeusError | None: ...
    def log(self) -> list[tuple[str, _Column]]: ...
    def warnings(self) -> list[str]:
        """What of a log contradicts itself, or counts nowhere."""


class Log:
    """A table of named columns of equal length."""

    @staticmethod
    def load(path: str | os.PathLike[str]) -> Log:
        """A log in a file.

        Parameters
        ----------
        path : path
            CSV or Parquet.

        Returns
        -------
        Log
            Its columns.

        Raises
        ------
        InputError
            There is no such file, or it cannot be read.
        """

    @staticmethod
    def from_columns(columns: Sequence[tuple[str, _Given]]) -> Log:
        """A log of columns.

        Parameters
        ----------
        columns : list of pairs
            Headers with numbers, shape (rows,), or with another of the forms of ``_columns.py``; what is not
            finite is missing.

        Returns
        -------
        Log
            The columns.

        Raises
        ------
        InputError
            They are not of one length.
        """

    @staticmethod
    def from_arrow(table: Any) -> Log:
        """A log of a table of Arrow. It is not copied where it lies in one piece: by Arrow's contract nobody
        changes it then, nor the arrays of NumPy that it was made of.

        Parameters
        ----------
        table : table
            Anything with ``__arrow_c_stream__`` or ``__arrow_c_array__``.

        Returns
        -------
        Log
            Its columns.

        Raises
        ------
        InputError
            It is no table.
        """

    def headers(self) -> list[str]:
        """Headers of the columns.

        Returns
        -------
        list of str
            In the order of the file or table.
        """

    def column(self, name: str) -> _Column:
        """A column.

        Parameters
        ----------
        name : str
            Its header.

        Returns
        -------
        numpy.ndarray
            Shape (rows,), as the log has it; NaN where a reading is missing, instants in seconds since the first.

        Raises
        ------
        InputError
            There is no such column, or it cannot be read.
        """

    def values(self, name: str) -> _Column | None:
        """A column as it is.

        Parameters
        ----------
        name : str
            Its header.

        Returns
        -------
        numpy.ndarray or None
            Shape (rows,), NaN where a reading is missing; ``None`` where it cannot be read.
        """

    def refusal(self, name: str) -> str | None:
        """Why a column cannot be read.

        Parameters
        ----------
        name : str
            Its header.

        Returns
        -------
        str or None
            ``None`` where it can.
        """

    def origin(self, name: str) -> str | None:
        """What stands for zero in a column of dates and times.

        Parameters
        ----------
        name : str
            Its header.

        Returns
        -------
        str or None
            An instant; ``None`` of a column of numbers.
        """

    def __len__(self) -> int: ...

class Study:
    @staticmethod
    def load(path: str, model: str | None = None) -> Study: ...
    @staticmethod
    def parse(
        text: str,
        file: str,
        plant: tuple[str, str | None] | None = None,
        model: str | None = None,
        origin: Study | None = None,
    ) -> Study:
        """``origin`` is the study that this is a change of: what it and its other changes have prepared is used
        where it is the same."""

    @property
    def file(self) -> str: ...
    @property
    def text(self) -> str: ...
    def html(self) -> str: ...
    def log(self, path: str | os.PathLike[str]) -> Log:
        """A log in a file that is written as the study says, all of its columns."""

    def sections(self) -> dict[str, Any]:
        """The text as dictionaries."""

    @property
    def plant(self) -> tuple[str, str | None] | None: ...
    @property
    def model(self) -> str | None: ...
    def check(self, parameters: bool, about: Sequence[str], terms: _Terms | None = None) -> Answer: ...
    def export(
        self,
        to: str,
        precision: str,
        fmi: str,
        step: float | None = None,
        tunable: bool = False,
        system: str | None = None,
        terms: _Terms | None = None,
    ) -> tuple[list[tuple[str, bytes]], list[str]]: ...
    def design(self, terms: _Terms | None = None) -> Answer: ...
    def certify(self, terms: _Terms | None = None) -> Answer: ...
    def how_well(self, horizon: float | None, sensors: str | None, terms: _Terms | None = None) -> Answer: ...
    def simulate(self, terms: _Terms | None = None) -> Answer: ...
    def open_run(self, log: Log | str, terms: _Terms | None = None) -> Answer: ...
    def monte_carlo(self, runs: int, terms: _Terms | None = None) -> Answer: ...
    def refuse_misfits(self) -> None:
        """Raises where the study names what its plant does not have."""

    def estimate(self, log: Log | str, terms: _Terms | None = None, record: bool = False) -> Answer: ...
    def side_by_side(self) -> int: ...
    def estimate_together(
        self, logs: list[Log | str], terms: _Terms | None = None
    ) -> list[Answer | BaseException]: ...
    def tune(self, log: Log | str | None, terms: _Terms | None = None) -> Answer: ...
    def fit(
        self,
        logs: list[Log | str],
        profiles: bool = False,
        next_experiment: bool = False,
        terms: _Terms | None = None,
    ) -> tuple[Answer, str | None]:
        """The fit, and the text of the study with the values found, where nothing speaks against these."""

    def likelihood(self, logs: Sequence[Log | str], terms: _Terms | None = None) -> Likelihood: ...
    def compare(self, log: Log | str | None, terms: _Terms | None = None) -> Answer: ...
    def functions(self) -> Functions: ...
    def observer(self, terms: _Terms | None = None) -> Functions: ...
    def estimator(self, study: _Study, wait: float) -> Estimator: ...

class Functions:
    """A system's functions, in the engine."""

    @property
    def title(self) -> str: ...
    @property
    def states(self) -> list[str]: ...
    @property
    def inputs(self) -> list[str]: ...
    @property
    def outputs(self) -> list[str]: ...
    @property
    def start(self) -> _Column: ...
    @property
    def family(self) -> str | None: ...
    @property
    def is_filter(self) -> bool: ...
    @property
    def sensors(self) -> int: ...
    def f(self, t: float, x: _Column, u: _Column) -> _Column: ...
    def h(self, t: float, x: _Column, u: _Column) -> _Column: ...
    def jacobian_x(self, t: float, x: _Column, u: _Column) -> _Column: ...
    def source(self, language: str) -> tuple[str, bool]: ...

class Likelihood:
    """−log L of logs, in the engine."""

    @property
    def plant(self) -> str: ...
    @property
    def names(self) -> list[str]: ...
    @property
    def outputs(self) -> list[str]: ...
    @property
    def start(self) -> _Column: ...
    @property
    def bounds(self) -> _Column: ...
    @property
    def is_log(self) -> NDArray[np.bool_]: ...
    @property
    def priors(self) -> dict[str, tuple[float, float]]:
        """By name the mean and the standard deviation."""

    @property
    def notes(self) -> list[str]: ...
    def warnings(self) -> list[str]: ...
    def logs(self) -> list[Log]: ...
    def at(self, theta: _Column) -> tuple[float, _Column, _Column]:
        """−log L, its gradient and Fisher's information."""

    def hessian(self, theta: _Column) -> _Column: ...
    def innovations(self, theta: _Column) -> list[dict[str, Any]]:
        """Of each log the fields of ``likelihood.Innovations`` but ``outputs``."""

class Estimator:
    """A study's estimator, for samples that come one by one. Its pickle is its snapshot."""

    def predict(self, t: float) -> None:
        """Goes to a time at which nothing is read.

        Parameters
        ----------
        t : float
            The time, in the model's unit, not before the last one.

        Raises
        ------
        ArgumentError, InputError
            It is no number or before the last one, there was no sample yet, or the equations have no value on
            the way.
        """

    def update(self, t: float, readings: Mapping[str, float | None]) -> None:
        """Goes to a time and takes what was read there. A call that fails changes nothing.

        Parameters
        ----------
        t : float
            The time, in the model's unit, not before the last one by more than :attr:`wait`.
        readings : mapping of str to float
            By signal, in its unit. A sensor that is left out, ``None`` or NaN did not report; of a known
            input the last value holds.

        Raises
        ------
        ArgumentError, InputError
            No signal has such a name, a reading is no number, the time is before the last one, or the equations
            have no value on the way.
        """

    def push(self, t: float, signals: Sequence[float]) -> None:
        """The same with all signals, in their order.

        Parameters
        ----------
        t : float
            The time, in the model's unit, not before the last one by more than :attr:`wait`.
        signals : list of float
            One for each of :attr:`signals`, shape (m,); NaN did not report.

        Raises
        ------
        ArgumentError, InputError
            There are not as many numbers as signals, the time is before the last one, or the equations have no
            value on the way.
        """

    @property
    def signals(self) -> list[str]:
        """Measured outputs, then known inputs."""

    @property
    def sensors(self) -> int:
        """How many of the signals are measured outputs."""

    @property
    def names(self) -> list[str]:
        """What is estimated."""

    @property
    def time(self) -> float | None:
        """The time of the last sample or prediction."""

    @property
    def wait(self) -> float:
        """How long what comes late is waited for; at least the largest ``delay`` of the study."""

    @property
    def revised(self) -> list[_Revised]:
        """The rows before the newest that the last call went over, because of a reading that came late: their
        estimates now."""

    @property
    def estimate(self) -> dict[str, float]:
        """What is estimated, by name."""

    @property
    def sd(self) -> dict[str, float] | None:
        """Standard deviations by name, where the observer has them."""

    def to_numpy(self) -> _Column:
        """What is estimated.

        Returns
        -------
        numpy.ndarray
            Shape (n,), in the order of :attr:`names` and in their units.
        """

    @property
    def innovations(self) -> dict[str, _Innovation]:
        """By sensor what the last reading said beside what the model expected; of a filter."""

    @property
    def health(self) -> _Health:
        """Counts by sensor, and of what was held, confined or not solved."""

    def snapshot(self) -> bytes:
        """Everything that the future depends on.

        Returns
        -------
        bytes
            For :meth:`restore`.
        """

    def restore(self, snapshot: bytes) -> None:
        """Goes to where another estimator of the same study was.

        Parameters
        ----------
        snapshot : bytes
            What :meth:`snapshot` gave.

        Raises
        ------
        InputError
            It is damaged, or of another study.
        """

def command(arguments: list[str]) -> int:
    """Runs a command line; its exit code."""

def families() -> list[tuple[str, bool]]:
    """Names of the families, and which are filters."""

def model_names(text: str, name: str) -> list[str]:
    """The models of a text; raises where it cannot be read so far that they are known."""

def schema() -> str:
    """The JSON Schema of study files."""
