"""Faults of the program itself: said in words, kept in a log with all that is known, never silent."""

import contextlib
import datetime
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

import platformdirs

from app.version import __version__
from messages.i18n import gettext

_REPEATED_S = 10.0
_LARGEST_BYTES = 1_000_000


@dataclass(frozen=True, slots=True)
class ErrorReport:
    """What went wrong: a line for the operator, and all that is known for who mends it."""

    message: str
    details: str


class ErrorReporter:
    """Takes faults from any thread and keeps them in a log; the window takes them out and shows them.

    Parameters
    ----------
    log : Path, optional
        File that they are appended to; a full one is kept once more beside it.
    clock : callable
        Seconds.
    """

    def __init__(self, log: Path | None = None, clock: Callable[[], float] = time.monotonic) -> None:
        self._log = log
        self._clock = clock
        self._waiting: deque[ErrorReport] = deque()
        self._last = ("", float("-inf"))

    def report(self, fault: ErrorReport) -> None:
        """Take a fault in; one that comes again and again is said once in a while."""
        now_s = self._clock()
        again = fault.message == self._last[0] and now_s - self._last[1] < _REPEATED_S
        if again:
            return
        self._last = fault.message, now_s
        self._write(fault)
        self._waiting.append(fault)

    def next_report(self) -> ErrorReport | None:
        """Take the oldest one out; None where there is none."""
        return self._waiting.popleft() if self._waiting else None

    def install_hooks(self) -> None:
        """Take in what no code of this process catches, of slots and threads, from now on."""
        sys.excepthook = self._on_uncaught
        threading.excepthook = lambda heard: self._on_uncaught(
            heard.exc_type, heard.exc_value or heard.exc_type(), heard.exc_traceback
        )

    def _on_uncaught(
        self, kind: type[BaseException], error: BaseException, trace: TracebackType | None = None
    ) -> None:
        sys.__excepthook__(kind, error, trace)
        if isinstance(error, Exception):
            self.report(error_report(error))

    def _write(self, fault: ErrorReport) -> None:
        if self._log is None:
            return
        with contextlib.suppress(OSError):  # what cannot be logged is still shown
            self._log.parent.mkdir(parents=True, exist_ok=True)
            if self._log.exists() and self._log.stat().st_size > _LARGEST_BYTES:
                self._log.replace(self._log.with_name(f"{self._log.name}.old"))
            with self._log.open("a", encoding="utf-8") as file:
                file.write(f"{datetime.datetime.now().astimezone().isoformat()}\n{fault.details}\n\n")


def log_file() -> Path:
    """Where faults are kept."""
    return platformdirs.user_log_path("slipstand", appauthor=False) / "faults.log"


def error_report(error: Exception) -> ErrorReport:
    """Put an error into words, with where it came from."""
    name, said = type(error).__name__, " ".join(str(error).split())
    words = said or name
    if not is_user_error(error):
        words = gettext(
            "Slipstand itself failed ({fault}). What is recorded is kept. Report what the details say",
            fault=f"{name}: {said}" if said else name,
        )
    import platform  # neither is needed as long as all is well
    import traceback

    trace = "".join(traceback.format_exception(error)).strip()
    about = f"Slipstand {__version__}, Python {platform.python_version()}, {platform.platform()}"
    return ErrorReport(words, f"{about}\n{trace}")


def is_user_error(error: Exception) -> bool:
    """Tell whether the error's own message is written for people, not a fault of the program."""
    # Imported late: the trees are only needed once something went wrong.
    from analysis.record import AnalysisError
    from app.acquisition.errors import AcquisitionError
    from app.runs.errors import RunError
    from config.schema import ConfigError
    from drivers.errors import DriverError

    return isinstance(
        error, AnalysisError | AcquisitionError | RunError | ConfigError | DriverError | OSError
    )
