"""Errors of run files. Each message names the file, the fault and the remedy in one line."""

import os
import traceback
from pathlib import Path
from typing import cast

from app.interrupts import was_interrupted
from config.durable_files import file_in_use, is_in_use
from messages.i18n import N_
from messages.message import Message, MessageError, lacking_resource, message


class RunError(MessageError):
    """Root of the run file errors."""

    stored_samples: int = 0  # rows that the file holds although its writer failed


class RunNotFoundError(RunError):
    """There is no such file, or this user cannot open it."""


class NotARunError(RunError):
    """The file is not a run of this program: other bytes, or HDF5 of another kind."""


class BeingRecordedError(RunError):
    """The run is still being written. Live samples come from the engine, not from the file."""


class RunInUseError(RunError):
    """Another program has the file open and lets nobody else read it. The file may be sound."""


class DamagedRunError(RunError):
    """A run file contradicts itself, cannot be read, or needs too much memory or time."""


class ValidationTimeoutError(RunError):
    """The validator process gave no answer in time. The file may be sound."""


class RunExistsError(RunError):
    """The file to be written exists. Nothing is overwritten."""


class MetadataError(RunError, ValueError):
    """A value of the metadata cannot be stored."""


class ConditionError(MetadataError):
    """A condition of a test cannot be stored: `name` and `reason` are values of its message."""

    @property
    def name(self) -> str:
        return str(self.message.values["name"])

    @property
    def reason(self) -> Message:
        """Value, fault and remedy, without the name."""
        return cast(Message, self.message.values["reason"])


class DiskFullError(RunError):
    """The disk or a quota is full. The samples stored before are in the file."""


class WriteError(RunError):
    """The run could not be written for a reason other than space."""


class WriterBehindError(WriteError):
    """The writer cannot keep up. The run can still be closed."""


class UnsuitableRunError(RunError):
    """A valid run that does not hold what the caller needs."""


class NoResultError(RunError):
    """None of several runs gives a result."""


class ImportFileError(RunError):
    """A foreign record cannot be read: names file, row or column, and remedy."""


class ExtraMissingError(RunError):
    """The library of a file format is not installed."""


class ClusterError(RunError):
    """The Dask scheduler does not answer, or its workers cannot do the work."""


def no_such_run(path: Path) -> RunNotFoundError:
    """Error for a path without a file."""
    return RunNotFoundError("{path}: there is no such file. Give the path of a run", path=path)


def unreadable(path: Path, error: OSError) -> RunError:
    """Error for a file that the operating system refuses to open."""
    if is_in_use(error, path):
        return in_use(path)
    if lacking := lacking_resource(error):
        return RunError("{path}: {fault}", path=path, fault=lacking)
    return RunNotFoundError(
        "{path}: cannot be read ({reason}). Check its rights", path=path, reason=error.strerror
    )


def in_use(path: Path | str) -> RunInUseError:
    """Error for a file that another program has open for itself."""
    return RunInUseError(file_in_use(path).message)


def being_recorded(path: Path | str) -> BeingRecordedError:
    """Error for a run whose writer is still at work."""
    return BeingRecordedError("{path} is being recorded. Wait until the run has ended", path=path)


def damaged(path: Path | str, fault: Exception | Message | str) -> DamagedRunError:
    """Error for a damaged file; the text of an exception of HDF5 is cut to one line of 160 characters."""
    if isinstance(fault, Exception):
        fault = one_line(fault)[:160]
    return DamagedRunError(
        "{path} is damaged ({fault}). Restore a good copy, or recover it", path=path, fault=fault
    )


def one_line(error: BaseException) -> str:
    """Text of an exception without line breaks."""
    return " ".join(str(error).split())


def internal_error(error: Exception) -> Message:
    """Message for a fault of the program itself; with SLIPSTAND_DEBUG its traceback goes to stderr.

    Worker processes write to the stderr of the process that started them. Raises KeyboardInterrupt where the
    error came of one, as compiled code passes it on.
    """
    if was_interrupted():
        raise KeyboardInterrupt from error
    if os.environ.get("SLIPSTAND_DEBUG"):
        traceback.print_exception(error)
    template = N_(
        "Slipstand itself failed ({kind}: {text}). "
        "Set SLIPSTAND_DEBUG=1, run it again and report what it prints"
    )
    return message(template, kind=type(error).__name__, text=one_line(error))
