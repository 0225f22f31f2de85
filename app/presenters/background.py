"""A thread that does one thing after another, and can be given up when the program ends."""

import queue
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeVar

Answer = TypeVar("Answer")


class Background:
    """Does calls in the order in which they were submitted.

    Unlike an executor's, the thread does not keep the program from ending: a call that never returns
    is given up.

    Parameters
    ----------
    name : str
        Of the thread.
    """

    def __init__(self, name: str) -> None:
        self._calls: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._work, name=name, daemon=True)
        self._thread.start()

    def submit(self, call: Callable[[], Answer]) -> Future[Answer]:
        """Do `call` after those before it; what it returns or raises is in the future."""
        future: Future[Answer] = Future()
        self._calls.put(lambda: _into(future, call))
        return future

    def close(self, patience_s: float) -> bool:
        """Do what was submitted, and end; False if that takes longer than `patience_s`."""
        self._calls.put(None)
        self._thread.join(patience_s)
        return not self._thread.is_alive()

    def _work(self) -> None:
        while (call := self._calls.get()) is not None:
            call()


def _into(future: Future[Answer], call: Callable[[], Answer]) -> None:
    try:
        future.set_result(call())
    except Exception as error:
        future.set_exception(error)
