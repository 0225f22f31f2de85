"""The run writer as a process of its own: `python -m app.runs.writer_process`, fed by `WriterClient`.

HDF5 can crash the process that it runs in, at the close after a full disk above all; the engine and
its journal must not go down with it. Frames come in on stdin, JSON lines go out on stdout. When stdin
ends, the engine is gone: the run is closed as interrupted and the process ends.
"""

import os
import queue
import signal
import sys
import threading
from pathlib import Path
from typing import IO

from app.runs.blocks import BlockLayout, RunBlock
from app.runs.errors import DiskFullError, RunError, WriteError
from app.runs.metadata import EndMetadata
from app.runs.writer import RunWriter, create_run_in
from app.runs.writer_messages import (
    Closed,
    Frame,
    Opened,
    OpenRun,
    Reply,
    encode_reply,
    failure,
    read_frame,
    unpack,
)


def main() -> None:
    """Serve until stdin ends. Signals that end a session are left to the engine, whose end is seen here."""
    for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    WriterServer(sys.stdin.buffer, sys.stdout.buffer).serve()


_QUEUE_FRAMES = 64
_IDLE_S = 0.05


class WriterServer:
    """Writes runs, one after another, until its input ends."""

    def __init__(self, requests: IO[bytes], replies: IO[bytes]) -> None:
        self._requests = requests
        self._replies = replies
        self._frames: queue.Queue[Frame | None] = queue.Queue(_QUEUE_FRAMES)
        self._writer: RunWriter | None = None
        self._layout = BlockLayout()

    def serve(self) -> None:
        """Work until the input ends. A failure ends the process at once.

        Python would close the file on its way out; where HDF5 has failed that can crash or hang.
        """
        threading.Thread(target=self._read, name="frames", daemon=True).start()
        try:
            while (frame := self._next()) is not None:
                self._handle(frame)
            self._finish("interrupted", "the program that recorded ended")
        except Exception as error:
            self._fail(error)
            os._exit(1)

    def _fail(self, error: Exception) -> None:
        """Close the run if that can be done, and say what went wrong."""
        told = error if isinstance(error, RunError) else WriteError(f"the run writer failed: {error}")
        writer = self._writer
        try:
            self._finish("disk-full" if isinstance(error, DiskFullError) else "write-error", str(told))
        except RunError as second:
            told = second
        self._reply(failure(told, writer.flushed_samples if writer else 0))

    def _read(self) -> None:
        while (frame := read_frame(self._requests)) is not None:
            self._frames.put(frame)
        self._frames.put(None)

    def _next(self) -> Frame | None:
        """Next frame; brings older rows to disk while none comes."""
        while True:
            try:
                return self._frames.get(timeout=_IDLE_S)
            except queue.Empty:
                if self._writer:
                    self._writer.flush_if_due()

    def _handle(self, frame: Frame) -> None:
        message = unpack(frame, self._layout)
        if isinstance(message, OpenRun):
            self._open(message)
        elif self._writer is None:
            raise WriteError("rows came for the writer before a run was opened. Open one first")
        elif isinstance(message, RunBlock):
            self._writer.append(message)
        else:
            self._close(self._writer, message)

    def _open(self, request: OpenRun) -> None:
        self._finish("interrupted", "another run was begun")
        self._layout = request.layout
        self._writer = create_run_in(
            Path(request.folder), request.metadata, request.layout, request.journal, request.identifier
        )
        self._reply(Opened(str(self._writer.path)))

    def _close(self, writer: RunWriter, ending: EndMetadata) -> None:
        stored = writer.close(ending)
        self._writer = None
        self._reply(Closed(stored))

    def _finish(self, ended: str, message: str) -> None:
        writer, self._writer = self._writer, None
        if writer and writer.usable:
            writer.interrupt(ended, message)

    def _reply(self, reply: Reply) -> None:
        try:
            self._replies.write(encode_reply(reply))
            self._replies.flush()
        except OSError:  # nobody listens any more; the run is finished all the same
            pass


if __name__ == "__main__":
    main()
