"""Progress of long calls."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

from ._lynkeus import MEMORY

Progress = bool | Callable[[float], Any]


class Terms(NamedTuple):
    """What a call may take, in seconds and MiB, and whom it tells the fraction done."""

    time_limit: float | None = None
    memory_limit: float = MEMORY
    progress: Callable[[float], Any] | None = None


@contextmanager
def told(progress: Progress, what: str) -> Iterator[Callable[[float], Any] | None]:
    """A function that is told the fraction done: the caller's own, or a bar of ``tqdm`` where that
    is installed and ``progress`` is true."""
    if not progress:
        yield None
        return
    if callable(progress):
        last = None

        def heard(fraction: float) -> None:
            nonlocal last
            if last == 1.0:
                return  # a run is done before what is said of it
            last = fraction
            progress(fraction)

        yield heard
        if last != 1.0:
            progress(1.0)
        return
    try:
        from tqdm.auto import tqdm
    except ImportError:
        yield None
        return
    with tqdm(total=1.0, desc=what, bar_format="{l_bar}{bar}| {elapsed}<{remaining}") as bar:

        def tell(fraction: float) -> None:
            bar.update(fraction - bar.n)

        yield tell
        tell(1.0)
