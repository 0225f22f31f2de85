"""The run writer as a child process: commands are frames of bytes with arrays, replies lines of JSON."""

import struct
import subprocess
import threading
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import Any, Self, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from app.child_process import ChildProcess, json_decoder, spawn
from app.runs import errors
from app.runs.blocks import BlockLayout, RunBlock, StoredRun
from app.runs.journal import JournalSpan
from app.runs.metadata import EndMetadata, RunMetadata
from messages.i18n import N_
from messages.message import Message

_FRAME = struct.Struct("<BI")
_ROWS = struct.Struct("<I")
_OPEN, _APPEND, _CLOSE = b"OAC"
FRAME_BYTES_MAX = 1 << 28

ERRORS: dict[str, type[errors.RunError]] = {
    "disk-full": errors.DiskFullError,
    "write-error": errors.WriteError,
    "exists": errors.RunExistsError,
    "metadata": errors.MetadataError,
}


class OpenRun(msgspec.Struct, frozen=True):
    """Begin a run under the next free name in `folder`."""

    folder: str
    metadata: RunMetadata
    layout: BlockLayout = BlockLayout()
    journal: JournalSpan | None = None
    identifier: str = ""


class Opened(msgspec.Struct, frozen=True, tag=True):
    """The run file exists under its final name."""

    path: str


class Closed(msgspec.Struct, frozen=True, tag=True):
    """The run file is complete, verified and on disk."""

    run: StoredRun


class Failed(msgspec.Struct, frozen=True, tag=True):
    """The command failed; the writer process ends after it."""

    reason: str
    message: Message
    samples: int = 0


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
        columns = (column.view(np.uint8).data for column in command.columns(self._layout))
        return _frame(_APPEND, _ROWS.pack(len(command)), *columns)


class FrameDecoder:
    """Decodes frames that come cut anywhere."""

    def __init__(self) -> None:
        self._layout = BlockLayout()
        self._parts: list[bytes] = []
        self._size = 0  # bytes of all parts
        self._wanted = _FRAME.size  # with so many bytes, there is something to decode

    def feed(self, data: bytes) -> Iterator[WriterCommand]:
        """Yield the commands that `data` completes. Raises ValueError, msgspec.DecodeError."""
        self._parts.append(data)
        self._size += len(data)
        while self._size >= self._wanted:
            joined = b"".join(self._parts)  # once for the header, once for the frame
            kind, length = _FRAME.unpack_from(joined)
            if length > FRAME_BYTES_MAX:
                raise ValueError(f"a frame of {length} bytes")
            end = _FRAME.size + length
            is_whole = self._size >= end
            rest = joined[end:] if is_whole else joined
            self._parts, self._size = [rest], len(rest)
            self._wanted = _FRAME.size if is_whole else end
            if is_whole:
                yield self._command(kind, memoryview(joined)[_FRAME.size : end])

    def _command(self, kind: int, payload: memoryview) -> WriterCommand:
        if kind == _OPEN:
            request = _OPEN_RUN.decode(payload)
            self._layout = request.layout
            return request
        if kind == _CLOSE:
            return _ENDING.decode(payload)
        if kind == _APPEND:
            return _unpack_block(payload, self._layout)
        raise ValueError(f"frame of unknown kind {kind}")


def _frame(kind: int, *payload: bytes | memoryview) -> bytes:
    return b"".join((_FRAME.pack(kind, sum(map(len, payload))), *payload))


def _unpack_block(payload: memoryview, layout: BlockLayout) -> RunBlock:
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


T = TypeVar("T")

_QUEUE_COMMANDS = 1024
_WAIT_S = 30.0
_STOP_S = 60.0


class WriterClient:
    """One writer process. Runs are written one after another; after a failure start a new client.

    `open` and `close` return futures. No call waits for the disk: `append` raises when the queue is full.
    """

    def __init__(self, process: "subprocess.Popen[bytes]") -> None:
        self._opening: deque[Future[Path]] = deque()
        self._closing: deque[Future[StoredRun]] = deque()
        self._guard = threading.Lock()
        self._failure: errors.RunError | None = None
        self._child: ChildProcess[WriterCommand, Reply] = ChildProcess(
            process, FrameEncoder(), decode_reply, self._on_reply, self._on_exit, _QUEUE_COMMANDS
        )

    @classmethod
    def start(cls) -> Self:
        """Start the process; it is ready some 0.3 s later, and takes requests at once."""
        return cls(spawn("app.runs.writer"))

    @property
    def pid(self) -> int:
        return self._child.pid

    @property
    def failure(self) -> errors.RunError | None:
        """What ended the writer, None while it works."""
        return self._failure

    def open(self, request: OpenRun) -> "Future[Path]":
        return self._ask(request, self._opening)

    def append(self, block: RunBlock) -> None:
        """Hand rows over. Raises WriteError; WriterBehindError where the queue is full; ValueError."""
        if self._failure:
            raise self._failure
        if not self._child.send(block):
            template = N_("the disk is too slow: {blocks} blocks wait to be written. Record to a faster disk")
            raise errors.WriterBehindError(template, blocks=_QUEUE_COMMANDS)

    def close(self, ending: EndMetadata) -> "Future[StoredRun]":
        return self._ask(ending, self._closing)

    def give_up(self, error: errors.RunError) -> None:
        """Count as failed: the process gives no answer."""
        self._fail(error)

    def kill(self) -> None:
        """End a process that gives no answer at once, so that the run it has finished is locked no longer."""
        self._child.kill()

    def stop(self) -> None:
        """End the process; a run still open is closed as interrupted."""
        self._child.stop(_STOP_S)

    def abandon(self) -> None:
        """As `stop`, but without waiting for a process that has failed, and may hang."""
        threading.Thread(target=self.stop, name="leaving a writer", daemon=True).start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _ask(self, command: OpenRun | EndMetadata, waiting: "deque[Future[T]]") -> "Future[T]":
        answer: Future[T] = Future()
        with self._guard:
            if self._failure:
                answer.set_exception(self._failure)
                return answer
            waiting.append(answer)
        if not self._child.send(command, _WAIT_S):
            self._fail(
                errors.WriteError(
                    "the run writer took nothing for {timeout:g} s. Check the disk", timeout=_WAIT_S
                )
            )
        return answer

    def _on_exit(self, code: int) -> None:
        if code or self._opening or self._closing:
            self._fail(errors.WriteError("the run writer ended by itself (code {code})", code=code))

    def _on_reply(self, reply: Reply) -> None:
        if isinstance(reply, Failed):
            error = ERRORS.get(reply.reason, errors.WriteError)(reply.message)
            error.stored_samples = reply.samples
            self._fail(error)
        elif isinstance(reply, Opened):
            self._settle(self._opening, Path(reply.path))
        else:
            self._settle(self._closing, reply.run)

    def _settle(self, waiting: "deque[Future[T]]", result: T) -> None:
        with self._guard:
            answer = waiting.popleft() if waiting else None
        if answer:  # None where it was given up before
            answer.set_result(result)

    def _fail(self, error: errors.RunError) -> None:
        with self._guard:
            self._failure = self._failure or error
            waiting: list[Future[Any]] = [*self._opening, *self._closing]
            self._opening.clear()
            self._closing.clear()
        for answer in waiting:
            answer.set_exception(self._failure)
