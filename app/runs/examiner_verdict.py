"""Inside the examiner process: a path in, a verdict out."""

import json

import h5py
import msgspec

from app.runs.errors import NotARunError, RunError
from app.runs.examination import examine_file
from app.runs.examiner import Verdict
from app.runs.summary import summarise


def answer(line: bytes) -> bytes:
    """Verdict, as one line of JSON, on the file whose path is in `line`."""
    return json.dumps(msgspec.to_builtins(_judge(json.loads(line)))).encode() + b"\n"


def _judge(path: str) -> Verdict:
    try:
        with h5py.File(path, "r", locking="best-effort") as file:
            examine_file(file)
            return Verdict(summary=summarise(file))
    except RunError as error:
        return Verdict(
            fault="not-a-run" if isinstance(error, NotARunError) else "damaged", message=str(error)
        )
    except BlockingIOError:
        return Verdict(
            fault="being-recorded", message=f"{path} is being recorded. Wait until the run has ended"
        )
    except Exception as error:
        fault = " ".join(str(error).split())[:160]
        return Verdict(
            fault="damaged", message=f"{path} is damaged ({fault}). Restore a good copy, or recover it"
        )
