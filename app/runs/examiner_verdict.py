"""Inside the examiner process: a path in, a verdict out."""

import json
import math

import h5py
import msgspec

from app.runs.errors import NotARunError, RunError
from app.runs.examination import validate_file
from app.runs.examiner import ValidationReply
from app.runs.summary import RunSummary, summarize_file


def answer(line: bytes) -> bytes:
    """Verdict, as one line of JSON, on the file whose path is in `line`."""
    return json.dumps(msgspec.to_builtins(_judge(json.loads(line)))).encode() + b"\n"


def _checked(summary: RunSummary) -> RunSummary:
    """A summary whose values are of their types, and finite: they are as the file says. Raises ValueError."""
    for name, value in msgspec.structs.asdict(summary).items():
        if isinstance(value, float) and not math.isfinite(value):
            raise ValueError(f"{name} is {value}")
    return msgspec.convert(msgspec.to_builtins(summary), RunSummary)


def _judge(path: str) -> ValidationReply:
    try:
        with h5py.File(path, "r", locking="best-effort") as file:
            validate_file(file)
            return ValidationReply(summary=_checked(summarize_file(file)))
    except RunError as error:
        return ValidationReply(
            fault="not-a-run" if isinstance(error, NotARunError) else "damaged", message=str(error)
        )
    except BlockingIOError:
        return ValidationReply(
            fault="being-recorded", message=f"{path} is being recorded. Wait until the run has ended"
        )
    except Exception as error:
        fault = " ".join(str(error).split())[:160]
        return ValidationReply(
            fault="damaged", message=f"{path} is damaged ({fault}). Restore a good copy, or recover it"
        )
