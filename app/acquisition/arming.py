"""A run that is being armed: its disk is asked in a thread, which alone a hanging one holds up."""

import contextlib
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, wait

from app.acquisition.errors import JournalError
from app.acquisition.journal.journal import Journal
from app.acquisition.messages import RunSettings
from app.runs.metadata import RunMetadata
from messages.i18n import N_
from messages.message import Message

Prepared = tuple[Journal, Message]


class Arming:
    """Settings and metadata of a run, and what comes of `prepare`: its journal and a note about the disk."""

    def __init__(self, run: RunSettings, metadata: RunMetadata, prepare: Callable[[], Prepared]) -> None:
        self.run = run
        self.metadata = metadata
        self._began_s = time.perf_counter()
        self._prepared: Future[Prepared] = Future()
        threading.Thread(target=self._prepare, args=(prepare,), name="arming", daemon=True).start()

    def wait(self, timeout_s: float) -> None:
        """Wait until the disk has answered, at most so long."""
        wait([self._prepared], timeout_s)

    def poll(self, timeout_s: float) -> Prepared | None:
        """Return journal and note once they are there.

        Raises what `prepare` raised, or JournalError where there was no answer for `timeout_s` since the
        beginning; a journal that comes later is removed.
        """
        if self._prepared.done():
            return self._prepared.result()
        if time.perf_counter() - self._began_s < timeout_s:
            return None
        self.abandon()
        template = N_("{folder}: its disk gives no answer for {timeout_s:.0f} s. Check it, or choose another")
        raise JournalError(template, folder=self.run.directory, timeout_s=timeout_s)

    def abandon(self) -> None:
        """Remove the journal once it is there."""
        self._prepared.add_done_callback(_remove)

    def _prepare(self, prepare: Callable[[], Prepared]) -> None:
        try:
            self._prepared.set_result(prepare())
        except BaseException as error:
            self._prepared.set_exception(error)


def _remove(prepared: "Future[Prepared]") -> None:
    if prepared.exception() is None:
        journal, _ = prepared.result()
        with contextlib.suppress(JournalError):
            journal.close()
        journal.remove()
