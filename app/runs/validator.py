"""Validate files, which may crash or hang HDF5, in a child process: `python -m app.runs.validator`."""

import atexit
import contextlib
import faulthandler
import functools
import math
import queue
import signal
import sys
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Literal, Self

import h5py
import msgspec

from app import child_process
from app.child_process import ChildProcess, CommandReader, EventSender
from app.log import start_log
from app.runs import errors
from app.runs.summary import RunSummary, summarize_file
from app.runs.validation import validate_file
from messages.i18n import N_
from messages.message import Message

_START_S = 60.0
_STOP_S = 5.0
_REPLY_S = 60.0
"""For a slow disk, or a computer that is too busy; over a file that hangs HDF5 the process ends itself."""
_MEMORY_BYTES = 2 << 30
_CPU_S = 2.0
_IDLE_S = 60.0

Fault = Literal["", "not-a-run", "being-recorded", "damaged"]
_ERRORS: dict[Fault, type[errors.RunError]] = {
    "not-a-run": errors.NotARunError,
    "being-recorded": errors.BeingRecordedError,
    "damaged": errors.DamagedRunError,
}


class ValidatorReady(msgspec.Struct, frozen=True, tag=True):
    """The process takes paths."""


class ValidationReply(msgspec.Struct, frozen=True, tag=True):
    """Result for one path: a summary, or the kind and text of a fault."""

    summary: RunSummary | None = None
    fault: Fault = ""
    message: Message = Message("")


ValidatorEvent = ValidatorReady | ValidationReply
decode_validator_event: Callable[[bytes], ValidatorEvent] = child_process.json_decoder(ValidatorEvent)


class Validator:
    """Validates files, one after another, for several threads. A file that crashes the process is damaged."""

    def __init__(self) -> None:
        self._child: ChildProcess[str, ValidatorEvent] | None = None
        self._replies: queue.SimpleQueue[ValidatorEvent | None] = queue.SimpleQueue()
        self._is_ready = False
        self._turn = threading.Lock()

    @classmethod
    def start(cls) -> Self:
        validator = cls()
        validator._started()
        return validator

    def validate(self, path: Path) -> RunSummary:
        """Validate a file as `app.runs.validation` says, and return its summary. Raises RunError."""
        with self._turn:
            reply = self._ask(self._started(), path)
        if reply.summary is None:
            raise _ERRORS[reply.fault](reply.message)
        return reply.summary

    @property
    def pid(self) -> int | None:
        return self._child.pid if self._child else None

    def stop(self) -> None:
        if self._child:
            self._child.kill()
            self._child.stop(_STOP_S)
            self._child = None

    def _started(self) -> "ChildProcess[str, ValidatorEvent]":
        if self._child is None:
            replies: queue.SimpleQueue[ValidatorEvent | None] = queue.SimpleQueue()
            process = child_process.spawn(
                "app.runs.validator", discard_stderr=True
            )  # a crash becomes a fault of the file
            self._child = ChildProcess(
                process,
                child_process.encode_line,
                decode_validator_event,
                replies.put,
                lambda _: replies.put(None),
            )
            self._replies, self._is_ready = replies, False
        return self._child

    def _ask(self, child: "ChildProcess[str, ValidatorEvent]", path: Path) -> ValidationReply:
        if not self._is_ready:
            with contextlib.suppress(queue.Empty):
                self._is_ready = isinstance(self._replies.get(timeout=_START_S), ValidatorReady)
        if not self._is_ready:
            raise errors.RunError(
                "the process that examines run files does not start. Run `slipstand doctor`"
            )
        child.send(str(path))
        try:
            reply = self._replies.get(timeout=_REPLY_S)
        except queue.Empty:
            self.stop()
            template = N_(
                "{path} was not validated within {timeout:g} s: this computer or the file's disk is"
                " too busy. Try again later"
            )
            raise errors.ValidationTimeoutError(template, path=path, timeout=_REPLY_S) from None
        if not isinstance(reply, ValidationReply):
            self.stop()
            template = N_(
                "{path} is damaged (HDF5 crashed or hung on it). Restore a good copy, or recover it"
            )
            raise errors.DamagedRunError(template, path=path)
        return reply

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()


@functools.cache
def shared_validator() -> Validator:
    """The validator that this process keeps: starting one takes longer than reading a run of an hour."""
    validator = Validator.start()
    atexit.register(validator.stop)
    return validator


def check_validator() -> None:
    """Validate a file that is HDF5 but no run. Raises RunError unless the validator says that."""
    with tempfile.TemporaryDirectory(prefix="slipstand-check-") as folder:
        path = Path(folder) / "no-run.h5"
        h5py.File(path, "w").close()
        try:
            with Validator() as validator:
                validator.validate(path)
        except errors.NotARunError:
            return
    raise errors.RunError("a file that is no run was taken for one")


def main() -> None:
    """Validate paths until stdin ends: one a line as JSON, with one reply a line on stdout."""
    start_log("validator")
    child_process.ignore_session_signals()
    _limit_memory()
    events: EventSender[ValidatorEvent] = EventSender(child_process.reserve_stdout())
    decoder = child_process.LineDecoder(child_process.json_decoder(str))
    paths: CommandReader[str] = CommandReader(0, decoder.feed)
    events.send(ValidatorReady())
    while not paths.is_closed:
        if (path := paths.take(_IDLE_S)) is not None:
            _limit_time(_CPU_S)
            reply = _validate(path)
            _limit_time(0.0)
            events.send(reply)
    events.close()


def _limit_memory() -> None:
    if sys.platform != "win32":
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        with contextlib.suppress(ValueError, OSError):  # macOS may refuse
            resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_BYTES, _MEMORY_BYTES))


def _limit_time(seconds: float) -> None:
    """End this process after so much processor time (Windows: five times that by the clock); 0: never."""
    if sys.platform != "win32":
        signal.setitimer(signal.ITIMER_PROF, seconds)
    elif seconds:  # a thread that needs no interpreter lock, so that a hung HDF5 cannot hold it up
        faulthandler.dump_traceback_later(5.0 * seconds, exit=True)
    else:
        faulthandler.cancel_dump_traceback_later()


def _checked(summary: RunSummary) -> RunSummary:
    """Check types and that numbers are finite: the values come from the file. Raises ValueError."""
    for name, value in msgspec.structs.asdict(summary).items():
        if isinstance(value, float) and not math.isfinite(value):
            raise ValueError(f"{name} is {value}")
    return msgspec.convert(msgspec.to_builtins(summary), RunSummary)


def _validate(path: str) -> ValidationReply:
    try:
        with h5py.File(path, "r", locking="best-effort") as file:
            validate_file(file)
            return ValidationReply(summary=_checked(summarize_file(file)))
    except errors.RunError as error:
        fault: Fault = "not-a-run" if isinstance(error, errors.NotARunError) else "damaged"
        return ValidationReply(fault=fault, message=error.message)
    except BlockingIOError:
        return ValidationReply(fault="being-recorded", message=errors.being_recorded(path).message)
    except Exception as error:
        return ValidationReply(fault="damaged", message=errors.damaged(path, error).message)


if __name__ == "__main__":
    main()
