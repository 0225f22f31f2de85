"""Messages of the writer process.

Commands carry arrays and are frames of bytes; replies are lines of JSON.
"""

import struct
from collections.abc import Callable, Iterator
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from app.child_process import json_decoder
from app.runs.blocks import BlockLayout, RunBlock, StoredRun
from app.runs.errors import DiskFullError, MetadataError, RunError, RunExistsError, WriteError
from app.runs.journal import JournalSpan
from app.runs.metadata import EndMetadata, RunMetadata
from messages.message import Message

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


class Opened(msgspec.Struct, frozen=True, tag=True):
    """The run file exists under its final name."""

    path: str


class Closed(msgspec.Struct, frozen=True, tag=True):
    """The run file is complete, verified and on disk."""

    run: StoredRun


class Failed(msgspec.Struct, frozen=True, tag=True):
    """It could not be done; the writer process ends after it."""

    reason: str
    message: Message
    samples: int = 0
    """Rows that the file holds all the same."""


WriterCommand = OpenRun | RunBlock | EndMetadata
Reply = Opened | Closed | Failed
decode_reply: Callable[[bytes], Reply] = json_decoder(Reply)
_OPEN_RUN = msgspec.json.Decoder(OpenRun)
_ENDING = msgspec.json.Decoder(EndMetadata)


class FrameEncoder:
    """Encodes commands; blocks by the layout of the run that was opened last."""

    def __init__(self) -> None:
        self._layout = BlockLayout()

    def __call__(self, command: WriterCommand) -> bytes:
        """Return the frame of a command. Raises ValueError for a block that does not fit the layout."""
        if isinstance(command, OpenRun):
            self._layout = command.layout
            return _frame(_OPEN, msgspec.json.encode(command))
        if isinstance(command, EndMetadata):
            return _frame(_CLOSE, msgspec.json.encode(command))
        columns = command.columns(self._layout)
        return _frame(_APPEND, _ROWS.pack(len(command)) + b"".join(column.tobytes() for column in columns))


class FrameDecoder:
    """Decodes frames that come cut anywhere."""

    def __init__(self) -> None:
        self._layout = BlockLayout()
        self._rest = bytearray()

    def feed(self, data: bytes) -> Iterator[WriterCommand]:
        """Yield the commands that `data` completes. Raises ValueError, msgspec.DecodeError."""
        self._rest += data
        while len(self._rest) >= _FRAME.size:
            kind, length = _FRAME.unpack_from(self._rest)
            if length > FRAME_BYTES_MAX:
                raise ValueError(f"a frame of {length} bytes")
            end = _FRAME.size + length
            if len(self._rest) < end:
                return
            payload = bytes(self._rest[_FRAME.size : end])
            del self._rest[:end]
            yield self._command(kind, payload)

    def _command(self, kind: int, payload: bytes) -> WriterCommand:
        if kind == _OPEN:
            request = _OPEN_RUN.decode(payload)
            self._layout = request.layout
            return request
        if kind == _CLOSE:
            return _ENDING.decode(payload)
        if kind == _APPEND:
            return _unpack_block(payload, self._layout)
        raise ValueError(f"frame of unknown kind {kind}")


def failure(error: RunError, samples: int = 0) -> Failed:
    """Say over the pipe what went wrong, and how many rows the file holds."""
    reasons = [reason for reason, kind in ERRORS.items() if isinstance(error, kind)]
    return Failed(reasons[0] if reasons else "write-error", error.message, samples)


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
