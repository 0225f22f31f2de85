"""Who does the work: a crew to which it is handed, run by run."""

from collections.abc import Callable
from concurrent.futures import Future
from typing import Protocol, TypeVar

Item = TypeVar("Item")
Answer = TypeVar("Answer")


class Executor(Protocol):
    """Workers that share one `concurrent.futures.Executor`. Use it in a `with` statement of `crew_of`."""

    @property
    def workers(self) -> int:
        """How many pieces of work are done at once."""

    def submit(self, work: Callable[[Item], Answer], item: Item) -> "Future[Answer]":
        """Hand over a piece of work; both must be picklable, `work` by its name.

        The future fails with `concurrent.futures.BrokenExecutor` where a worker died, with whatever was
        in work then.
        """

    def renew(self) -> None:
        """Take new workers, after one died."""

    def close(self, *, now: bool) -> None:
        """End once all is done that is being done; or `now`, and give it up."""


class SerialExecutor:
    """No crew: work is done in this process, at once."""

    workers = 1

    def submit(self, work: Callable[[Item], Answer], item: Item) -> "Future[Answer]":
        """Do the work. What it raises is in the future, as an interruption is not."""
        future: Future[Answer] = Future()
        try:
            future.set_result(work(item))
        except Exception as error:
            future.set_exception(error)
        return future

    def renew(self) -> None:
        """Nothing can have died."""

    def close(self, *, now: bool) -> None:
        """Nothing is being done."""
