"""Work on many things by a crew: answers in the order of the things, few of them in flight at a time."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor, Future, wait
from dataclasses import dataclass
from itertools import islice
from typing import Generic, TypeVar

from app.runs.batch.executors import Executor, SerialExecutor

Item = TypeVar("Item")
Answer = TypeVar("Answer")

_AHEAD = 8
"""Pieces of work in flight for each worker: one slow run must not leave the others idle."""
_TICK_S = 0.2
"""Windows hears Ctrl-C between two waits only."""


@dataclass(frozen=True, slots=True)
class FailedItem(Generic[Item]):
    """Work that brought its worker down, or could not be done at all; `message` is one line for people."""

    item: Item
    message: str


def ordered_map(
    executor: Executor, work: Callable[[Item], Answer], items: Iterable[Item]
) -> Iterator[Answer | FailedItem[Item]]:
    """Do `work` on each item; answers come in the order of the items.

    Where a worker dies, nobody knows whose fault it was: all that was in flight is done once more, one
    at a time, and what brings its worker down again is a `FailedItem`.

    Parameters
    ----------
    crew
        Does the work. Items are taken as they are needed, so that there may be any number.
    work
        Function of a module.
    items
    """
    source = iter(items)
    flying: deque[tuple[Item, Future[Answer]]] = deque()
    room = 1 if isinstance(executor, SerialExecutor) else executor.workers * _AHEAD
    try:
        while True:
            for item in islice(source, room - len(flying)):
                flying.append((item, _handed(executor, work, item)))
            if not flying:
                return
            if isinstance(_error_of(flying[0][1]), BrokenExecutor):
                suspects = list(flying)
                flying.clear()
                yield from _one_at_a_time(executor, work, suspects)
            else:
                item, future = flying.popleft()
                answer: Answer | FailedItem[Item] = _answer(item, future)
                yield answer
    finally:
        for _, future in flying:
            future.cancel()


def _handed(crew: Executor, work: Callable[[Item], Answer], item: Item) -> "Future[Answer]":
    """Hand work over; a crew that cannot take it has failed in it."""
    try:
        return crew.submit(work, item)
    except (BrokenExecutor, RuntimeError, OSError) as error:
        future: Future[Answer] = Future()
        future.set_exception(error)
        return future


def _error_of(future: "Future[Answer]") -> BaseException | None:
    while not wait([future], timeout=_TICK_S).done:
        pass
    return future.exception()


def _one_at_a_time(
    crew: Executor, work: Callable[[Item], Answer], suspects: "list[tuple[Item, Future[Answer]]]"
) -> Iterator[Answer | FailedItem[Item]]:
    crew.renew()
    for item, earlier in suspects:
        future = earlier
        if isinstance(_error_of(future), BrokenExecutor):
            future = _handed(crew, work, item)
        if isinstance(_error_of(future), BrokenExecutor):
            crew.renew()
            yield FailedItem(
                item, "it brought the process down that worked on it, twice: out of memory, or killed"
            )
        else:
            answer: Answer | FailedItem[Item] = _answer(item, future)
            yield answer


def _answer(item: Item, future: "Future[Answer]") -> Answer | FailedItem[Item]:
    error = _error_of(future)
    if error is None:
        return future.result()
    if not isinstance(error, Exception):
        raise error
    words = " ".join(str(error).split())[:200]
    return FailedItem(item, f"its worker failed ({type(error).__name__}: {words})")
