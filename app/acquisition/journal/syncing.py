"""Brings a file to disk in a thread of its own: what comes meanwhile need not wait for a slow disk."""

import os
import queue
import threading


class Syncer:
    """Syncs one file after another; the thread begins with the first of them and ends with `stop`."""

    def __init__(self) -> None:
        self._handles: queue.SimpleQueue[int | None] = queue.SimpleQueue()
        self._is_idle = threading.Event()
        self._is_idle.set()
        self._failure: OSError | None = None
        self._thread: threading.Thread | None = None

    @property
    def is_idle(self) -> bool:
        """Tell whether the last sync is done."""
        return self._is_idle.is_set()

    def begin(self, descriptor: int) -> None:
        """Sync what was written to a file until now; it may be closed meanwhile. Ask only when idle."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._work, name="journal sync", daemon=True)
            self._thread.start()
        self._is_idle.clear()
        self._handles.put(os.dup(descriptor))

    def wait(self) -> None:
        """Return when the last sync is done."""
        self._is_idle.wait()

    def take_failure(self) -> OSError | None:
        """How a sync has failed since this was asked the last time; None if none has."""
        failure, self._failure = self._failure, None
        return failure

    def stop(self) -> None:
        """End the thread, when the last sync is done."""
        self.request_stop()
        if self._thread is not None:
            self._thread.join()

    def request_stop(self) -> None:
        """As `stop`, without waiting; how the last sync goes is of no interest any more."""
        self._handles.put(None)

    def _work(self) -> None:
        while (handle := self._handles.get()) is not None:
            try:
                os.fsync(handle)
            except OSError as error:
                self._failure = error
            finally:
                os.close(handle)
                self._is_idle.set()
