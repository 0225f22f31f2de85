"""Looks for a lost device, in a thread of its own, until it is back."""

import threading
from collections.abc import Callable

from app.acquisition.stream.connection import Connection
from app.acquisition.stream.intake import ReadQueue
from drivers.errors import DriverError
from drivers.host_time import host_ns
from drivers.port import OpenPort
from drivers.source import SampleSource
from drivers.stoppable import StoppableLink

_OFTEN_S = 0.2
_SELDOM_S = 1.0
_OFTEN_UNTIL_S = 30.0
_ABSENT_S = 1.0
"""Who has not looked for so long got no processor, and nor did the search."""


class Reconnection:
    """A search that has begun.

    Parameters
    ----------
    reopen : callable
        Opens the port of the device, wherever it is now. Raises DriverError while it is not there.
    source : SampleSource
        Of the device; nobody else uses it meanwhile.
    intake : Intake
        Gets a read of no bytes, which says that the link was broken, and then what the new connection brings.
    """

    def __init__(self, reopen: Callable[[], OpenPort], source: SampleSource, intake: ReadQueue) -> None:
        self._began_ns = self._watched_ns = host_ns()
        self._watched_s = 0.0
        self._reopen = reopen
        self._source = source
        self._intake = intake
        self._failure: Exception | None = None
        self._connection: Connection | None = None
        self._is_done = threading.Event()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._search, name="reconnection", daemon=True)
        self._thread.start()

    @property
    def failure(self) -> Exception | None:
        """Why the latest attempt failed; None while the first one is under way."""
        return self._failure

    def elapsed_s(self) -> float:
        """How long it has gone on (s), but for what this computer slept or stood still. Ask often."""
        before_ns, self._watched_ns = self._watched_ns, host_ns()
        passed_s = (self._watched_ns - before_ns) * 1e-9
        self._watched_s += passed_s if passed_s < _ABSENT_S else 0.0
        return self._watched_s

    def take(self, timeout_s: float) -> Connection | None:
        """The new connection once there is one, which belongs to the caller then."""
        if not self._is_done.wait(timeout_s):
            return None
        connection, self._connection = self._connection, None
        return connection

    def stop(self) -> None:
        """Give the search up, and a connection that nobody took."""
        self._stopping.set()
        self._thread.join()
        if self._connection is not None:
            self._connection.close(stop_device=True)
            self._connection = None

    def _search(self) -> None:
        while not self._stopping.is_set():
            try:
                self._connection = self._attempt()
            except DriverError as error:
                self._failure = error
            except Exception as error:  # a search that dies unseen would be a device lost for ever
                self._failure = DriverError(
                    f"looking for the device failed ({type(error).__name__}: {error})"
                )
            else:
                self._is_done.set()
                return
            self._stopping.wait(_OFTEN_S if host_ns() - self._began_ns < _OFTEN_UNTIL_S * 1e9 else _SELDOM_S)

    def _attempt(self) -> Connection:
        port = self._reopen()
        try:
            first = self._source.resume(StoppableLink(port, self._stopping))
            self._intake.put(host_ns(), b"")
            return Connection(port, self._source, first, self._intake)
        except BaseException:
            port.close()
            raise
