"""The engine's side of the writer process: hands rows over without waiting, and hears how it went."""

import contextlib
import queue
import subprocess
import sys
import threading
from collections import deque
from concurrent.futures import Future
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar

import msgspec

from app.runs.blocks import BlockLayout, RunBlock, StoredRun
from app.runs.errors import RunError, WriteError, WriterBehindError
from app.runs.metadata import EndMetadata
from app.runs.writer_messages import (
    Failed,
    Opened,
    OpenRun,
    Reply,
    decode_reply,
    error_of,
    pack_append,
    pack_close,
    pack_open,
)

T = TypeVar("T")

_QUEUE_FRAMES = 1024
_WAIT_S = 30.0
_STOP_S = 60.0
_KILLED_S = 5.0
"""A killed process is waited for no longer: one that waits for a dead disk does not even end then."""


class WriterClient:
    """One writer process. Runs are written one after another; after a failure start a new client.

    `open` and `close` return futures that hold the result, or the error. No call waits for the disk:
    when the writer falls behind by more than the queue holds, `append` raises.
    """

    def __init__(self, process: "subprocess.Popen[bytes]") -> None:
        if process.stdin is None or process.stdout is None:
            raise ValueError("the writer process has no pipes. Start it with WriterClient.start")
        self._process = process
        self._to_writer, self._from_writer = process.stdin, process.stdout
        self._frames: queue.Queue[bytes | None] = queue.Queue(_QUEUE_FRAMES)
        self._opening: deque[Future[Path]] = deque()
        self._closing: deque[Future[StoredRun]] = deque()
        self._guard = threading.Lock()
        self._layout = BlockLayout()
        self._failure: RunError | None = None
        self._threads = [threading.Thread(target=work, daemon=True) for work in (self._send, self._hear)]
        for thread in self._threads:
            thread.start()

    @classmethod
    def start(cls) -> Self:
        """Start the process; it is ready some 0.3 s later, and takes requests at once."""
        command = [sys.executable, "-P", "-m", "app.runs.writer_process"]
        no_window = getattr(subprocess, "CREATE_NO_WINDOW", 0)  # Windows opens a console for it otherwise
        pipe = subprocess.PIPE
        return cls(subprocess.Popen(command, stdin=pipe, stdout=pipe, creationflags=no_window))

    @property
    def pid(self) -> int:
        """Process number of the writer."""
        return self._process.pid

    @property
    def failure(self) -> RunError | None:
        """What ended the writer, None while it works."""
        return self._failure

    def open(self, request: OpenRun) -> "Future[Path]":
        """Begin a run; the future holds the path of its file."""
        self._layout = request.layout
        return self._ask(pack_open(request), self._opening)

    def append(self, block: RunBlock) -> None:
        """Hand rows over.

        Raises
        ------
        WriterBehindError
            The queue is full; the run can still be closed.
        DiskFullError, WriteError
            The writer failed earlier.
        ValueError
            The block does not fit the layout of the run.
        """
        if self._failure:
            raise self._failure
        try:
            self._frames.put_nowait(pack_append(block, self._layout))
        except queue.Full:
            raise WriterBehindError(
                f"the disk is too slow: {_QUEUE_FRAMES} blocks wait to be written. Record to a faster disk"
            ) from None

    def close(self, ending: EndMetadata) -> "Future[StoredRun]":
        """Complete the run; the future holds what was stored."""
        return self._ask(pack_close(ending), self._closing)

    def stop(self) -> None:
        """End the process; a run still open is closed as interrupted."""
        with contextlib.suppress(queue.Full):
            self._frames.put(None, timeout=_WAIT_S)
        try:
            self._process.wait(_STOP_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(_KILLED_S)
        for thread in self._threads:
            thread.join(_KILLED_S)

    def abandon(self) -> None:
        """As `stop`, but without waiting for a process that has failed, and may hang."""
        threading.Thread(target=self.stop, name="leaving a writer", daemon=True).start()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def _ask(self, frame: bytes, waiting: "deque[Future[T]]") -> "Future[T]":
        answer: Future[T] = Future()
        with self._guard:
            if self._failure:
                answer.set_exception(self._failure)
                return answer
            waiting.append(answer)
        try:
            self._frames.put(frame, timeout=_WAIT_S)
        except queue.Full:
            self._fail(WriteError(f"the run writer took nothing for {_WAIT_S:g} s. Check the disk"))
        return answer

    def _send(self) -> None:
        """Thread: queue to pipe, until told to end or nobody reads."""
        with contextlib.suppress(OSError), self._to_writer as stream:
            while (frame := self._frames.get()) is not None:
                stream.write(frame)
                stream.flush()

    def _hear(self) -> None:
        """Thread: replies, until the process ends."""
        with self._from_writer as stream:
            for line in stream:
                with contextlib.suppress(msgspec.DecodeError):  # half a line is its last word
                    self._take(decode_reply(line))
        code = self._process.wait()
        if code or self._opening or self._closing:
            self._fail(WriteError(f"the run writer ended by itself (code {code})"))
        with contextlib.suppress(queue.Full):
            self._frames.put_nowait(None)

    def _take(self, reply: Reply) -> None:
        if isinstance(reply, Failed):
            self._fail(error_of(reply))
        elif isinstance(reply, Opened):
            self._settle(self._opening, Path(reply.path))
        else:
            self._settle(self._closing, reply.run)

    def _settle(self, waiting: "deque[Future[T]]", result: T) -> None:
        with self._guard:
            answer = waiting.popleft() if waiting else None
        if answer:  # none where it was given up before
            answer.set_result(result)

    def _fail(self, error: RunError) -> None:
        with self._guard:
            self._failure = self._failure or error
            waiting: list[Future[Any]] = [*self._opening, *self._closing]
            self._opening.clear()
            self._closing.clear()
        for answer in waiting:
            answer.set_exception(self._failure)
