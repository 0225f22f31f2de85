"""Opens files that may crash or hang HDF5: `python -m app.runs.validator_process`, driven by `Validator`.

One path a line on stdin, as JSON; one reply a line on stdout. Memory and processor time are limited
where the system can, so that a hostile file ends this process and nothing else.
"""

import contextlib
import faulthandler
import math
import signal
import sys

import h5py
import msgspec

from app.child_process import (
    CommandReader,
    EventSender,
    LineDecoder,
    ignore_session_signals,
    json_decoder,
    reserve_stdout,
)
from app.log import start_log
from app.runs.errors import NotARunError, RunError, being_recorded, damaged
from app.runs.summary import RunSummary, summarize_file
from app.runs.validation import validate_file
from app.runs.validator import Fault, ValidationReply, ValidatorEvent, ValidatorReady

_MEMORY_BYTES = 2 << 30
_CPU_S = 2.0
_IDLE_S = 60.0


def main() -> None:
    """Answer until stdin ends."""
    start_log("validator")
    ignore_session_signals()
    _limit_memory()
    events: EventSender[ValidatorEvent] = EventSender(reserve_stdout())
    paths: CommandReader[str] = CommandReader(0, LineDecoder(json_decoder(str)))
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
    """Let the system end this process after so much processor time; 0 lifts the limit.

    Windows measures no processor time here: five times as long by the clock, as a disk may be slow.
    """
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
    except RunError as error:
        fault: Fault = "not-a-run" if isinstance(error, NotARunError) else "damaged"
        return ValidationReply(fault=fault, message=error.message)
    except BlockingIOError:
        return ValidationReply(fault="being-recorded", message=being_recorded(path).message)
    except Exception as error:
        return ValidationReply(fault="damaged", message=damaged(path, error).message)


if __name__ == "__main__":
    main()
