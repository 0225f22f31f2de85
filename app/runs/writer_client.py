"""The engine's side of the writer process: hands rows over without waiting, and hears how it went."""

import subprocess
import threading
from collections import deque
from concurrent.futures import Future
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar

from app.child_process import ChildProcess, spawn
from app.runs.blocks import RunBlock, StoredRun
from app.runs.errors import RunError, WriteError, WriterBehindError
from app.runs.metadata import EndMetadata
from app.runs.writer_messages import (
    Failed,
    FrameEncoder,
    Opened,
    OpenRun,
    Reply,
    WriterCommand,
    decode_reply,
    error_of,
)

T = TypeVar("T")

_QUEUE_COMMANDS = 1024
_WAIT_S = 30.0
_STOP_S = 60.0


class WriterClient:
    """One writer process. Runs are written one after another; after a failure start a new client.

    `open` and `close` return futures that hold the result, or the error. No call waits for the disk:
    when the writer falls behind by more than the queue holds, `append` raises.
    """

    def __init__(self, process: "subprocess.Popen[bytes]") -> None:
        self._opening: deque[Future[Path]] = deque()
        self._closing: deque[Future[StoredRun]] = deque()
        self._guard = threading.Lock()
        self._failure: RunError | None = None
        self._child: ChildProcess[WriterCommand, Reply] = ChildProcess(
            process, FrameEncoder(), decode_reply, self._on_reply, self._on_exit, _QUEUE_COMMANDS
        )

    @classmethod
    def start(cls) -> Self:
        """Start the process; it is ready some 0.3 s later, and takes requests at once."""
        return cls(spawn("app.runs.writer_process"))

    @property
    def pid(self) -> int:
        """Process number of the writer."""
        return self._child.pid

    @property
    def failure(self) -> RunError | None:
        """What ended the writer, None while it works."""
        return self._failure

    def open(self, request: OpenRun) -> "Future[Path]":
        """Begin a run; the future holds the path of its file."""
        return self._ask(request, self._opening)

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
        if not self._child.send(block):
            raise WriterBehindError(
                "the disk is too slow: {blocks} blocks wait to be written. Record to a faster disk",
                blocks=_QUEUE_COMMANDS,
            )

    def close(self, ending: EndMetadata) -> "Future[StoredRun]":
        """Complete the run; the future holds what was stored."""
        return self._ask(ending, self._closing)

    def stop(self) -> None:
        """End the process; a run still open is closed as interrupted."""
        self._child.stop(_STOP_S)

    def abandon(self) -> None:
        """As `stop`, but without waiting for a process that has failed, and may hang."""
        threading.Thread(target=self.stop, name="leaving a writer", daemon=True).start()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
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
                WriteError("the run writer took nothing for {timeout:g} s. Check the disk", timeout=_WAIT_S)
            )
        return answer

    def _on_exit(self, code: int) -> None:
        if code or self._opening or self._closing:
            self._fail(WriteError("the run writer ended by itself (code {code})", code=code))

    def _on_reply(self, reply: Reply) -> None:
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
