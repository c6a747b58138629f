"""What goes wrong: the command's messages as exceptions."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

import numpy as np


class LynkeusError(Exception):
    """The text is the command's: place, what is wrong, what was expected, what to do.

    ``message``, ``place`` (file, line, column; ``None`` where there is none) and ``hint`` are its parts.
    """

    def __init__(
        self,
        text: str,
        message: str | None = None,
        place: str | None = None,
        hint: str | None = None,
    ) -> None:
        super().__init__(text)
        self.message: str = text if message is None else message
        self.place = place
        self.hint = hint

    def __reduce__(self) -> tuple[type[LynkeusError], tuple[str, str, str | None, str | None]]:
        return type(self), (str(self), self.message, self.place, self.hint)


class InputError(LynkeusError, ValueError):
    """The input is at fault: a file, a key, a column, a name, a shape."""


class ArgumentError(InputError, TypeError):
    """An argument of another kind than its annotation says."""

    @classmethod
    def of(cls, argument: str, expected: str, found: object) -> ArgumentError:
        """The error of a value that is not what was expected of it.

        Parameters
        ----------
        argument : str
            The name of the argument.
        expected : str
            What was expected, in words.
        found : object
            The value.

        Returns
        -------
        ArgumentError
            To be raised.
        """
        return cls(f"{argument}: expected {expected}, found {_spoken(found)}")


def _spoken(value: object) -> str:
    """A short value as it is written, the kind of any other."""
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, (bool, int, float, str)):
        try:
            written = repr(value)
        except ValueError:  # a number of thousands of digits
            return "a number beyond all limits"
        return written if len(written) <= _SHORT else f"{written[:_SHORT]}…"
    return type(value).__name__


#: characters of a value that are told
_SHORT = 40


def near(name: str, known: Iterable[str]) -> str:
    """A question after the name that may be meant.

    Parameters
    ----------
    name : str
        What was written.
    known : iterable of str
        Names that there are.

    Returns
    -------
    str
        ``" (did you mean 'errors'?)"``, empty where no name is near.
    """
    found = get_close_matches(name, [each for each in known if not each.startswith("_")], n=1)
    return f" (did you mean {found[0]!r}?)" if found else ""


class RefusedError(LynkeusError):
    """The question is well posed and the answer is no: a condition is refuted, an estimate diverges."""


class LimitError(LynkeusError, TimeoutError):
    """A limit of time or memory ended the work before there was an answer."""


class NotCredible(UserWarning):
    """There is a result, and something speaks against it."""


class LogWarning(UserWarning):
    """A log contradicts itself, values of it count nowhere, or it tells little of a value that is fitted to it."""


class TraceError(InputError, TypeError):
    """A Python function does what no equation can say, an ``if`` on a traced value, for example."""
