"""The run writer as a process of its own: `python -m app.runs.writer_process`, fed by `WriterClient`.

HDF5 can crash the process that it runs in, at the close after a full disk above all; the engine and
its journal must not go down with it. Frames come in on stdin, JSON lines go out on stdout. When stdin
ends, the engine is gone: the run is closed as interrupted and the process ends.
"""

import os
from pathlib import Path

from app.child_process import CommandReader, EventSender, ignore_session_signals, reserve_stdout
from app.log import start_log
from app.runs.blocks import RunBlock
from app.runs.errors import DiskFullError, RunError, WriteError
from app.runs.metadata import EndMetadata
from app.runs.writer import RunWriter, create_run_in
from app.runs.writer_client import Closed, FrameDecoder, Opened, OpenRun, Reply, WriterCommand, failure

_QUEUE_COMMANDS = 64
_IDLE_S = 0.05


def main() -> None:
    """Serve until stdin ends. Signals that end a session are left to the engine, whose end is seen here."""
    start_log("writer")
    ignore_session_signals("SIGTERM")
    commands: CommandReader[WriterCommand] = CommandReader(0, FrameDecoder(), queue_size=_QUEUE_COMMANDS)
    WriterServer(commands, EventSender(reserve_stdout())).serve()


class WriterServer:
    """Writes runs, one after another, until its input ends."""

    def __init__(self, commands: CommandReader[WriterCommand], replies: EventSender[Reply]) -> None:
        self._commands = commands
        self._replies = replies
        self._writer: RunWriter | None = None

    def serve(self) -> None:
        """Work until the input ends. A failure ends the process at once.

        Python would close the file on its way out; where HDF5 has failed that can crash or hang.
        """
        try:
            while not self._commands.is_closed:
                self._step(self._commands.take(_IDLE_S))
            self._finish("interrupted", "the program that recorded ended")
        except Exception as error:
            self._fail(error)
            self._replies.close()
            os._exit(1)
        self._replies.close()

    def _step(self, command: WriterCommand | None) -> None:
        """Execute a command; bring older rows to disk while none comes."""
        if command is not None:
            self._execute(command)
        elif self._writer is not None:
            self._writer.flush_if_due()

    def _fail(self, error: Exception) -> None:
        """Close the run if that can be done, and say what went wrong."""
        told = (
            error
            if isinstance(error, RunError)
            else WriteError("the run writer failed: {error}", error=error)
        )
        writer = self._writer
        try:
            self._finish("disk-full" if isinstance(error, DiskFullError) else "write-error", str(told))
        except RunError as second:
            told = second
        self._replies.send(failure(told, writer.flushed_samples if writer else 0))

    def _execute(self, message: WriterCommand) -> None:
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
        self._writer = create_run_in(
            Path(request.folder), request.metadata, request.layout, request.journal, request.identifier
        )
        self._replies.send(Opened(str(self._writer.path)))

    def _close(self, writer: RunWriter, ending: EndMetadata) -> None:
        stored = writer.close(ending)
        self._writer = None
        self._replies.send(Closed(stored))

    def _finish(self, ended: str, message: str) -> None:
        writer, self._writer = self._writer, None
        if writer and writer.usable:
            writer.interrupt(ended, message)


if __name__ == "__main__":
    main()
