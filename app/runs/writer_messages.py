"""What is said over the pipes of a writer process: framed bytes to it, JSON lines back."""

import struct
from typing import IO, Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from app.runs.blocks import BlockLayout, RunBlock, StoredRun
from app.runs.errors import DiskFullError, MetadataError, RunError, RunExistsError, WriteError
from app.runs.journal import JournalSpan
from app.runs.metadata import EndMetadata, RunMetadata

_FRAME = struct.Struct("<BI")
_ROWS = struct.Struct("<I")
_OPEN, _APPEND, _CLOSE = b"OAC"
FRAME_BYTES_MAX = 1 << 28

ERRORS: dict[str, type[RunError]] = {
    "disk-full": DiskFullError,
    "write-error": WriteError,
    "exists": RunExistsError,
    "metadata": MetadataError,
}


class OpenRun(msgspec.Struct, frozen=True):
    """Begin a run under the next free name in `folder`."""

    folder: str
    metadata: RunMetadata
    layout: BlockLayout = BlockLayout()
    journal: JournalSpan | None = None
    identifier: str = ""
    """UUID of the run, a new one if empty."""


class Frame(NamedTuple):
    """One message to the writer, not yet unpacked."""

    kind: int
    payload: bytes


class Opened(msgspec.Struct, frozen=True, tag=True):
    """The run file exists under its final name."""

    path: str


class Closed(msgspec.Struct, frozen=True, tag=True):
    """The run file is complete, verified and on disk."""

    run: StoredRun


class Failed(msgspec.Struct, frozen=True, tag=True):
    """It could not be done; the writer process ends after it."""

    reason: str
    message: str
    samples: int = 0
    """Rows that the file holds all the same."""


Reply = Opened | Closed | Failed
_REPLIES: msgspec.json.Decoder[Reply] = msgspec.json.Decoder(Reply)
_OPEN_RUN = msgspec.json.Decoder(OpenRun)
_ENDING = msgspec.json.Decoder(EndMetadata)


def pack_open(request: OpenRun) -> bytes:
    """Frame of a request."""
    return _frame(_OPEN, msgspec.json.encode(request))


def pack_append(block: RunBlock, layout: BlockLayout) -> bytes:
    """Frame of a block. Raises ValueError where it does not fit `layout`."""
    columns = block.columns(layout)
    return _frame(_APPEND, _ROWS.pack(len(block)) + b"".join(column.tobytes() for column in columns))


def pack_close(ending: EndMetadata) -> bytes:
    """Frame of an ending."""
    return _frame(_CLOSE, msgspec.json.encode(ending))


def read_frame(stream: IO[bytes]) -> Frame | None:
    """Next whole frame; None at the end of the stream, or where it was cut off or is none."""
    header = stream.read(_FRAME.size)
    if len(header) < _FRAME.size:
        return None
    kind, length = _FRAME.unpack(header)
    if length > FRAME_BYTES_MAX:
        return None
    payload = stream.read(length)
    return Frame(kind, payload) if len(payload) == length else None


def unpack(frame: Frame, layout: BlockLayout) -> OpenRun | RunBlock | EndMetadata:
    """Value of a frame; `layout` is that of the run being written. Raises ValueError."""
    if frame.kind == _OPEN:
        return _OPEN_RUN.decode(frame.payload)
    if frame.kind == _CLOSE:
        return _ENDING.decode(frame.payload)
    if frame.kind == _APPEND:
        return _unpack_block(frame.payload, layout)
    raise ValueError(f"frame of unknown kind {frame.kind}")


def encode_reply(reply: Reply) -> bytes:
    """One line, newline included."""
    return msgspec.json.encode(reply) + b"\n"


def decode_reply(line: bytes) -> Reply:
    """Parse one line. Raises msgspec.ValidationError."""
    return _REPLIES.decode(line)


def failure(error: RunError, samples: int = 0) -> Failed:
    """Say over the pipe what went wrong, and how many rows the file holds."""
    reasons = [reason for reason, kind in ERRORS.items() if isinstance(error, kind)]
    return Failed(reasons[0] if reasons else "write-error", str(error), samples)


def error_of(failed: Failed) -> RunError:
    """Turn what the writer said back into its error."""
    error = ERRORS.get(failed.reason, WriteError)(failed.message)
    error.stored_samples = failed.samples
    return error


def _frame(kind: int, payload: bytes) -> bytes:
    return _FRAME.pack(kind, len(payload)) + payload


def _unpack_block(payload: bytes, layout: BlockLayout) -> RunBlock:
    (n,) = _ROWS.unpack_from(payload)
    position = _ROWS.size

    def take(dtype: str, count: int = 1) -> NDArray[Any]:
        nonlocal position
        columns = np.frombuffer(payload, dtype, n * count, position).reshape(count, n).T
        position += columns.nbytes
        return columns

    c = layout.channels
    return RunBlock(
        time_s=take("<f8")[:, 0],
        readings=take("<f8", c),
        status=take("<u1")[:, 0],
        counts=take(layout.counts, c) if layout.counts else None,
    )
