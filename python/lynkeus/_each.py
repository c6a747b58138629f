"""Many calls on all cores, by threads: the engine works away from the interpreter's lock."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from queue import Empty, SimpleQueue
from typing import Literal, TypeVar

from ._progress import Progress, told
from .errors import InputError, LynkeusError

Item = TypeVar("Item")
Kept = TypeVar("Kept")
Errors = Literal["raise", "return"]
Tell = Callable[[float], None]
#: makes of some items what each of them gives: one function per item, which returns it or raises
Work = Callable[[Sequence[Item], Tell], Sequence[Callable[[], Kept]]]

#: in seconds, between two looks at what was told and at Ctrl-C
LOOK = 0.1


class _Ended(Exception):
    """Raised where a call tells its progress, to end it."""


class _Fractions:
    """What of each call is done; how a call is told that its answer is no longer wanted."""

    def __init__(self, count: int) -> None:
        self.done = [0.0] * count
        self.is_over = threading.Event()

    def tell(self, places: range) -> Tell:
        def tell(fraction: float) -> None:
            if self.is_over.is_set():
                raise _Ended
            for place in places:
                self.done[place] = fraction

        return tell


def each(
    work: Work[Item, Kept],
    items: Sequence[Item],
    names: Sequence[str],
    *,
    together: int = 1,
    workers: int | None,
    errors: Errors,
    progress: Progress,
    what: str,
) -> list[Kept | LynkeusError]:
    """What ``work`` makes of each item, at most so many ``together``, in their order. An error of ours stands in its
    place, or is raised with the item's name as a note and ends the rest."""
    chosen(errors)
    count = _workers(workers, len(items))
    fractions = _Fractions(len(items))

    def call(places: range) -> list[Kept | LynkeusError]:
        tell = fractions.tell(places)
        try:
            tell(0.0)  # ended while it waited
            given = work([items[place] for place in places], tell)
            return [kept(place, give) for place, give in zip(places, given, strict=True)]
        finally:
            tell_done(places)

    def kept(place: int, give: Callable[[], Kept]) -> Kept | LynkeusError:
        try:
            return give()
        except Exception as error:
            error.add_note(f"in {names[place]}")
            if errors == "return" and isinstance(error, LynkeusError):
                return error
            raise

    def tell_done(places: range) -> None:
        for place in places:
            fractions.done[place] = 1.0

    size = max(1, min(together, -(-len(items) // count)))
    with told(progress, what) as shown, ThreadPoolExecutor(count, "lynkeus") as pool:
        groups = [range(first, min(first + size, len(items))) for first in range(0, len(items), size)]
        futures = [pool.submit(call, places) for places in groups]
        try:
            _watch(futures, fractions, shown)
            return [found for future in futures for found in future.result()]
        finally:
            fractions.is_over.set()
            for future in futures:
                future.cancel()


def chosen(errors: str) -> None:
    """Refuses another word than those of :data:`Errors`."""
    if errors not in ("raise", "return"):
        raise InputError(f'errors: expected "raise" or "return", found {errors!r}')


def _workers(asked: int | None, items: int) -> int:
    if asked is None:
        usable = getattr(os, "sched_getaffinity", None)
        asked = len(usable(0)) if usable else os.cpu_count() or 1
    if asked < 1:
        raise InputError(f"workers: expected at least 1, found {asked}")
    return max(1, min(asked, items))


def _watch(
    futures: list[Future[list[Kept | LynkeusError]]],
    fractions: _Fractions,
    shown: Callable[[float], object] | None,
) -> None:
    """Until all are done; what one of them raises is raised at once."""
    done: SimpleQueue[Future[list[Kept | LynkeusError]]] = SimpleQueue()
    for future in futures:
        future.add_done_callback(done.put)
    waiting, due = len(futures), 0.0
    while waiting:
        try:
            done.get(timeout=LOOK).result()
            waiting -= 1
        except Empty:
            pass
        now = time.monotonic()
        if shown is not None and (now >= due or not waiting):
            shown(sum(fractions.done) / len(fractions.done))
            due = now + LOOK
