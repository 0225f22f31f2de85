"""Validate files in a child process, before this one opens them."""

import atexit
import contextlib
import functools
import queue
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Literal, Self

import h5py
import msgspec

from app.child_process import ChildProcess, encode_line, json_decoder, spawn
from app.runs.errors import (
    BeingRecordedError,
    DamagedRunError,
    NotARunError,
    RunError,
    ValidationTimeoutError,
)
from app.runs.summary import RunSummary
from messages.message import Message

_START_S = 60.0
_STOP_S = 5.0
_REPLY_S = 60.0
"""For a slow disk, or a computer that is too busy; over a file that hangs HDF5 the process ends itself."""

Fault = Literal["", "not-a-run", "being-recorded", "damaged"]
_ERRORS: dict[Fault, type[RunError]] = {
    "not-a-run": NotARunError,
    "being-recorded": BeingRecordedError,
    "damaged": DamagedRunError,
}


class ValidatorReady(msgspec.Struct, frozen=True, tag=True):
    """The process takes paths."""


class ValidationReply(msgspec.Struct, frozen=True, tag=True):
    """Result for one path: a summary, or the kind and text of a fault."""

    summary: RunSummary | None = None
    fault: Fault = ""
    message: Message = Message("")


ValidatorEvent = ValidatorReady | ValidationReply
decode_validator_event: Callable[[bytes], ValidatorEvent] = json_decoder(ValidatorEvent)


class Validator:
    """Validates any number of files, one after another. A file that crashes the process is damaged.

    Several threads may share one; they wait for each other.
    """

    def __init__(self) -> None:
        self._child: _Child | None = None
        self._turn = threading.Lock()

    @classmethod
    def start(cls) -> Self:
        validator = cls()
        validator._child = _Child()
        return validator

    def validate(self, path: Path) -> RunSummary:
        """Validate a file as `app.runs.validation` says, and return its summary.

        Raises NotARunError, BeingRecordedError, DamagedRunError, ValidationTimeoutError (no answer came in
        time; the file may be sound).
        """
        with self._turn:
            self._child = self._child or _Child()
            try:
                reply = self._child.validate(str(path))
            except _CrashedError:
                self.stop()
                raise DamagedRunError(
                    "{path} is damaged (HDF5 crashed or hung on it). Restore a good copy, or recover it",
                    path=path,
                ) from None
            except queue.Empty:
                self.stop()
                raise ValidationTimeoutError(
                    "{path} was not validated within {timeout:g} s: this computer or the file's disk is"
                    " too busy. Try again later",
                    path=path,
                    timeout=_REPLY_S,
                ) from None
        if reply.summary is None:
            raise _ERRORS[reply.fault](reply.message)
        return reply.summary

    @property
    def pid(self) -> int | None:
        return self._child.pid if self._child else None

    def stop(self) -> None:
        if self._child:
            self._child.stop()
            self._child = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()


@functools.cache
def shared_validator() -> Validator:
    """The validator that this process keeps, started at the first call.

    Starting one takes longer than validating and reading a run of an hour.
    """
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
        except NotARunError:
            return
    raise RunError("a file that is no run was taken for one")


class _CrashedError(Exception):
    """The process ended over a file."""


class _Child:
    """The process; its replies come in the order of the paths."""

    def __init__(self) -> None:
        self._replies: queue.SimpleQueue[ValidatorEvent | None] = queue.SimpleQueue()
        self._child: ChildProcess[str, ValidatorEvent] = ChildProcess(
            spawn("app.runs.validator_process", discard_stderr=True),  # a crash becomes a fault of the file
            encode_line,
            decode_validator_event,
            self._replies.put,
            lambda _: self._replies.put(None),
        )
        self._is_ready = False

    @property
    def pid(self) -> int:
        return self._child.pid

    def validate(self, path: str) -> ValidationReply:
        """Return the reply for a path. Raises _CrashedError; queue.Empty where no reply comes."""
        self._await_start()
        self._child.send(path)
        reply = self._replies.get(timeout=_REPLY_S)
        if not isinstance(reply, ValidationReply):
            raise _CrashedError
        return reply

    def _await_start(self) -> None:
        if self._is_ready:
            return
        with contextlib.suppress(queue.Empty):
            self._is_ready = isinstance(self._replies.get(timeout=_START_S), ValidatorReady)
        if not self._is_ready:
            raise RunError("the process that examines run files does not start. Run `slipstand doctor`")

    def stop(self) -> None:
        """End the process, which has nothing to lose."""
        self._child.kill()
        self._child.stop(_STOP_S)
