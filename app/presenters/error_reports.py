"""Reports of errors of the program itself: shown in the window and logged."""

import logging
import platform
import sys
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType

from app.acquisition.errors import AcquisitionError
from app.version import version_text
from config.schema import ConfigError
from messages.message import EMPTY, Message, MessageError, message, message_of

_REPEATED_S = 10.0  # an error that repeats, as one of a timer does, is reported this often
_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class ErrorReport:
    """Error in one line for the operator, and in detail for a developer."""

    message: Message
    details: str


class ErrorReporter:
    """Takes reports from any thread, logs them, and hands them to the window; `clock` is monotonic (s)."""

    def __init__(self, clock: Callable[[], float] = time.perf_counter) -> None:
        self._clock = clock
        self._waiting: deque[ErrorReport] = deque()
        self._last = (EMPTY, float("-inf"))

    def report(self, report: ErrorReport) -> None:
        """Add a report, unless the same one was added just before."""
        now_s = self._clock()
        if report.message == self._last[0] and now_s - self._last[1] < _REPEATED_S:
            return
        self._last = report.message, now_s
        _log.error("%s\n%s", report.message, report.details)
        self._waiting.append(report)

    def next_report(self) -> ErrorReport | None:
        return self._waiting.popleft() if self._waiting else None

    def install_hooks(self) -> None:
        sys.excepthook = self._on_uncaught
        threading.excepthook = lambda args: self._on_uncaught(
            args.exc_type, args.exc_value or args.exc_type(), args.exc_traceback
        )

    def _on_uncaught(
        self, kind: type[BaseException], error: BaseException, trace: TracebackType | None = None
    ) -> None:
        if not isinstance(error, Exception) or not is_user_error(error):
            sys.__excepthook__(kind, error, trace)
        if isinstance(error, Exception):
            self.report(error_report(error))


def error_report(error: Exception) -> ErrorReport:
    """Report an error with its traceback and the version of everything."""
    name, text = type(error).__name__, " ".join(str(error).split())
    shown = message_of(error)
    if not is_user_error(error):
        shown = message(
            "Slipstand itself failed ({fault}). What is recorded is kept. Report what the details say",
            fault=f"{name}: {text}" if text else name,
        )
    trace = "".join(traceback.format_exception(error)).strip()
    about = f"Slipstand {version_text()}, Python {platform.python_version()}, {platform.platform()}"
    return ErrorReport(shown, f"{about}\n{trace}")


def is_user_error(error: Exception) -> bool:
    """Tell whether the message of an error is written for the operator; other errors are bugs."""
    return isinstance(error, MessageError | AcquisitionError | ConfigError | OSError)
