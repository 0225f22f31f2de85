"""Has files looked over by a process of its own, before this one opens them."""

import atexit
import contextlib
import functools
import json
import queue
import subprocess
import sys
import threading
from pathlib import Path
from types import TracebackType
from typing import Literal, Self

import msgspec

from app.runs.errors import (
    BeingRecordedError,
    DamagedRunError,
    NotARunError,
    RunError,
    ValidationTimeoutError,
)
from app.runs.summary import RunSummary

_START_S = 60.0
_VERDICT_S = 60.0
"""For a slow disk, or a computer that is too busy; over a file that hangs HDF5 the process ends itself."""

Fault = Literal["", "not-a-run", "being-recorded", "damaged"]
_ERRORS: dict[Fault, type[RunError]] = {
    "not-a-run": NotARunError,
    "being-recorded": BeingRecordedError,
    "damaged": DamagedRunError,
}


class ValidationReply(msgspec.Struct, frozen=True):
    """What the examining process found: a summary, or the kind and text of a fault."""

    summary: RunSummary | None = None
    fault: Fault = ""
    message: str = ""


class Validator:
    """Examines as many files as wanted, one after another; a file that brings the process down is damaged.

    Several threads may share one: they wait for each other.
    """

    def __init__(self) -> None:
        self._child: _Child | None = None
        self._turn = threading.Lock()

    @classmethod
    def start(cls) -> Self:
        """Start the process now; otherwise the first file starts it."""
        validator = cls()
        validator._child = _Child()
        return validator

    def validate(self, path: Path) -> RunSummary:
        """Look a file over, as told in `app.runs.validation`.

        Raises
        ------
        NotARunError, BeingRecordedError, DamagedRunError
        ValidationTimeoutError
            There was no verdict in time, which says nothing about the file.
        """
        with self._turn:
            self._child = self._child or _Child()
            try:
                line = self._child.ask(str(path))
            except _BrokenDownError:
                self.stop()
                raise DamagedRunError(
                    f"{path} is damaged (HDF5 crashed or hung on it). Restore a good copy, or recover it"
                ) from None
            except queue.Empty:
                self.stop()
                raise ValidationTimeoutError(
                    f"{path} was not looked over within {_VERDICT_S:g} s: this computer or the file's disk is"
                    " too busy. Try again later"
                ) from None
        verdict = msgspec.convert(json.loads(line), ValidationReply)
        if verdict.summary is None:
            raise _ERRORS[verdict.fault](verdict.message)
        return verdict.summary

    @property
    def pid(self) -> int | None:
        """Process number while there is a process."""
        return self._child.pid if self._child else None

    def stop(self) -> None:
        """End the process."""
        if self._child:
            self._child.stop()
            self._child = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()


@functools.cache
def shared_validator() -> Validator:
    """The validator of a process that opens runs now and then: started when first asked for, and kept.

    Starting one takes longer than examining and reading the run of an hour.
    """
    validator = Validator.start()
    atexit.register(validator.stop)
    return validator


class _BrokenDownError(Exception):
    """The process ended over a file."""


class _Child:
    """The process, and a thread that hears it, so that waiting for it can have an end."""

    def __init__(self) -> None:
        command = [sys.executable, "-P", "-m", "app.runs.validator_process"]
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,  # a crash is told as a verdict
            creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
        )
        self._lines: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._hear, daemon=True)
        self._thread.start()
        self._ready = False

    @property
    def pid(self) -> int:
        return self._process.pid

    def ask(self, path: str) -> bytes:
        """Verdict on a path. Raises _BrokenDownError if the process ends, queue.Empty if none comes."""
        self._await_start()
        line = b""
        if self._process.stdin is not None:
            with contextlib.suppress(OSError):
                self._process.stdin.write(json.dumps(path).encode() + b"\n")
                self._process.stdin.flush()
                line = self._lines.get(timeout=_VERDICT_S)
        if not line:
            raise _BrokenDownError
        return line

    def _await_start(self) -> None:
        if self._ready:
            return
        with contextlib.suppress(queue.Empty):
            self._ready = bool(self._lines.get(timeout=_START_S))
        if not self._ready:
            raise RunError("the process that examines run files does not start. Run `slipstand doctor`")

    def stop(self) -> None:
        """End the process, which has nothing to lose."""
        self._process.kill()
        self._thread.join()
        if self._process.stdin:
            with contextlib.suppress(OSError):
                self._process.stdin.close()
        self._process.wait()

    def _hear(self) -> None:
        if self._process.stdout is None:
            return
        with self._process.stdout as stream:
            for line in stream:
                self._lines.put(line)
        self._lines.put(b"")
