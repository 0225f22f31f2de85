"""Validate files, which may crash or hang HDF5, in a child process."""

import atexit
import contextlib
import faulthandler
import functools
import math
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
from app.child_process import CommandReader, EventSender, RequestProcess
from app.log import start_log
from app.runs import errors
from app.runs.summarize import summarize_file
from app.runs.summary import RunSummary
from app.runs.validation import validate_file
from config.durable_files import is_in_use
from messages.i18n import N_
from messages.message import Message

_REPLY_S = 60.0
"""For a slow disk, or a computer that is too busy; over a file that hangs HDF5 the process ends itself."""
_MEMORY_BYTES = 2 << 30
_CPU_S = 2.0
_IDLE_S = 60.0

Fault = Literal["", "not-a-run", "being-recorded", "in-use", "damaged"]
_ERRORS: dict[Fault, type[errors.RunError]] = {
    "not-a-run": errors.NotARunError,
    "being-recorded": errors.BeingRecordedError,
    "in-use": errors.RunInUseError,
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
        self._process: RequestProcess[str, ValidatorEvent] = RequestProcess(
            "app.runs.validator", decode_validator_event
        )
        self._turn = threading.Lock()

    @classmethod
    def start(cls) -> Self:
        validator = cls()
        validator._process.start()
        return validator

    def validate(self, path: Path) -> RunSummary:
        """Validate a file as `app.runs.validation` says, and return its summary. Raises RunError."""
        with self._turn:
            reply = self._ask(path)
        if reply.summary is None:
            raise _ERRORS[reply.fault](reply.message)
        return reply.summary

    @property
    def pid(self) -> int | None:
        return self._process.pid

    def stop(self) -> None:
        self._process.stop()

    def _ask(self, path: Path) -> ValidationReply:
        if not self._process.send(str(path)):
            raise errors.RunError(
                "the process that examines run files does not start. Run `slipstand doctor`"
            )
        try:
            reply = self._process.receive(_REPLY_S)
        except TimeoutError:
            template = N_(
                "{path} was not validated within {timeout:g} s: this computer or the file's disk is"
                " too busy. Try again later"
            )
            raise errors.ValidationTimeoutError(template, path=path, timeout=_REPLY_S) from None
        if not isinstance(reply, ValidationReply):
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
    paths: CommandReader[str] = CommandReader.of_stdin(decoder.feed)
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
        if is_in_use(error, Path(path)):
            return ValidationReply(fault="in-use", message=errors.in_use(path).message)
        return ValidationReply(fault="damaged", message=errors.damaged(path, error).message)
