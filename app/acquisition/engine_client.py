"""The client of an engine, for the window and the command line."""

import contextlib
import queue
import shutil
import signal
import subprocess
import threading
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import Self

from app.acquisition import messages
from app.acquisition.errors import EngineDiedError, EngineFailedError, RingError
from app.acquisition.ring import RingReader, RingRows, open_ring
from app.child_process import ChildProcess, encode_line, end_signals, spawn
from messages.message import Message, message

_WAIT_S = 0.1


class EngineClient:
    """An engine in a process of its own, which outlives this handle only to finish a run."""

    _QUEUE_EVENTS = 1024  # health and live results are dropped while so many events wait
    _CLOSE_S = 180.0
    """An engine that is to end is killed after so long without an event. Closing a run takes as long as the
    run is large; the engine sends its health meanwhile."""
    _SEND_S = 1.0  # an engine that takes no command for so long hangs; the command is lost

    def __init__(self, process: "subprocess.Popen[bytes]") -> None:
        self.process_id = process.pid
        self._events: queue.Queue[messages.Event] = queue.Queue()
        self._has_failed = False
        self._ring: RingReader | None = None
        self._ring_folder: Path | None = None
        self._next_row = 0
        self._run_folder = ""
        self._child: ChildProcess[messages.Command, messages.Event] = ChildProcess(
            process, encode_line, messages.decode_event, self._on_event, self._on_exit
        )

    @classmethod
    def start(
        cls,
        port: messages.PortSettings,
        stand_file: str,
        gauges_file: str,
        *,
        low_latency: bool = False,
        directory: str = "",
    ) -> Self:
        """Start an engine and connect it; new rows come within 20 ms with `low_latency`, else 0.9 s.

        `directory` is the folder of the runs to come.
        """
        engine = cls(spawn("app.acquisition.engine"))
        engine.send(messages.Connect(port, stand_file, gauges_file, low_latency, directory))
        return engine

    @property
    def has_ended(self) -> bool:
        return self._child.has_ended and self._events.empty()

    def send(self, command: messages.Command) -> None:
        """Give a command. An engine that has ended has sent the reason as an event."""
        if isinstance(command, messages.Arm):
            self._run_folder = command.run.directory
        self._child.send(command, self._SEND_S)

    def poll(self) -> list[messages.Event]:
        """Events since the last call; the last one of an engine is `Failed` unless it was closed."""
        events = []
        with contextlib.suppress(queue.Empty):
            while True:
                events.append(self._events.get_nowait())
        return events

    def wait(self, timeout_s: float) -> messages.Event | None:
        with contextlib.suppress(queue.Empty):
            return self._events.get(timeout=timeout_s)
        return None

    def new_rows(self) -> RingRows | None:
        """Samples since the last call, the oldest of them left out if too many; None without any."""
        ring = self._ring
        if ring is None or ring.written == self._next_row:
            return None
        rows = ring.read_since(self._next_row)
        self._next_row = rows.end_index
        return rows

    def close(self) -> None:
        """Finish a run that is being recorded, and end the engine. Harmless when it has ended."""
        self.send(messages.Quit())
        self._child.stop(self._CLOSE_S, wait_while_active=True)
        if self._ring is not None:
            self._ring.close()
            self._ring = None
        if self._ring_folder is not None:  # where the engine was killed, or could not remove a mapped file
            shutil.rmtree(self._ring_folder, ignore_errors=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _on_event(self, event: messages.Event) -> None:
        self._has_failed = self._has_failed or isinstance(event, messages.Failed)
        if isinstance(event, messages.Connected):
            self._ring_folder = Path(event.ring_path).parent
            with contextlib.suppress(RingError):  # the engine has ended meanwhile, and sends the reason
                self._ring = open_ring(event.ring_path)
        elif isinstance(event, messages.RunEnded):
            self._run_folder = ""
        is_transient = isinstance(event, messages.Health | messages.LiveResult)
        if not is_transient or self._events.qsize() < self._QUEUE_EVENTS:
            self._events.put(event)

    def _on_exit(self, code: int) -> None:
        if code and not self._has_failed:
            died = message(
                "the engine ended by itself (code {code}). {remedy}", code=code, remedy=self._remedy()
            )
            self._events.put(messages.Failed(died))

    def _remedy(self) -> Message:
        if not self._run_folder:
            return message("Connect again")
        return message(
            "What came of the run is in its journal: slipstand recover {folder}", folder=self._run_folder
        )


def record_runs(
    port: messages.PortSettings,
    run: messages.RunSettings,
    stand_file: str,
    gauges_file: str,
    on_event: Callable[[messages.Event], None] | None = None,
    on_rows: Callable[[RingRows], None] | None = None,
    count: int = 1,
) -> Generator[messages.RunEnded]:
    """Record up to `count` runs one after another over one connection, yielding each at its end.

    Ctrl-C (or another of `end_signals`) ends the run that is being recorded and keeps it; no further run
    follows. A run without a path was interrupted before the table was pulled back. `on_event` receives each
    event of the engine, `on_rows` the latest samples, about ten times a second. Raises EngineFailedError
    without a connection or with impossible settings. Raises KeyboardInterrupt if interrupted before a run was
    armed.
    """
    files = stand_file, gauges_file
    with (
        _interrupts() as interrupted,
        EngineClient.start(port, *files, directory=run.directory) as engine,
    ):
        is_armed = is_stopped = False
        while True:
            event = engine.wait(_WAIT_S)
            if event is not None and on_event is not None:
                on_event(event)
            if on_rows is not None and (rows := engine.new_rows()) is not None and len(rows):
                on_rows(rows)
            match event:
                case messages.RunEnded(remaining=remaining):
                    yield event
                    if not remaining:
                        return
                case messages.Failed(message):
                    raise EngineFailedError(message)
                case messages.Connected():
                    engine.send(messages.Arm(run, count))
                    is_armed = True
                case None if engine.has_ended:
                    raise EngineDiedError("the engine ended without a word. Record again")
            if interrupted.is_set() and not is_stopped:
                if not is_armed:
                    raise KeyboardInterrupt
                engine.send(messages.Stop(messages.EndReason.INTERRUPTED))
                is_stopped = True


@contextlib.contextmanager
def _interrupts() -> Iterator[threading.Event]:
    interrupted = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield interrupted
        return
    numbers = end_signals()
    before = [signal.signal(number, lambda *_: interrupted.set()) for number in numbers]
    try:
        yield interrupted
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)
