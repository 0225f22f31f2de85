"""Child processes that exchange typed messages with their parent over stdin and stdout.

The parent holds a `ChildProcess`: commands go to the child's stdin, events come from its stdout. The child
holds a `CommandReader` and an `EventSender` on its end of the pipes. On both sides a thread reads and a
thread writes, so that neither process ever waits for the other one.

Death is seen at the pipes. When the parent dies, the child's stdin ends and `CommandReader.is_closed` becomes
true. When the child dies, its stdout ends and the parent's `on_exit` is called with the exit code.
"""

import contextlib
import json
import logging
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Generic, Self, TypeVar

import msgspec

from app.child import ONE_THREAD

_log = logging.getLogger(__name__)

Command = TypeVar("Command")
Event = TypeVar("Event")
Decoded = TypeVar("Decoded")

CHILD_OPTION = "--run-child"
"""First argument of a frozen build that runs `main` of a module instead of the command line."""
READ_BYTES = 1 << 16  # of one read: what a pipe holds on Linux

START_S = 60.0
"""Longest time that a child takes to start, on a computer that is busy."""
_STOP_S = 5.0
_KILLED_S = 5.0
"""Wait for a killed process no longer: one that is blocked by a dead disk does not end even then."""
_POLL_S = 0.1
_LINE_BYTES = 1 << 24  # more than that without a newline is no message
_SESSION_SIGNALS = ("SIGINT", "SIGHUP", "SIGBREAK")
"""They reach all processes of a terminal; the parent decides what they mean."""
_END_SIGNALS = ("SIGINT", "SIGTERM", "SIGBREAK")
_STD_INPUT_HANDLE, _SYNCHRONIZE = -10, 0x10_0000  # of Windows


class LineDecoder(Generic[Decoded]):
    """Decodes one message a line; `on_invalid` gets the ValueErrors of `decode`, else `feed` raises."""

    def __init__(
        self, decode: Callable[[bytes], Decoded], on_invalid: Callable[[Exception], None] | None = None
    ) -> None:
        self._decode = decode
        self._on_invalid = on_invalid
        self._rest = b""

    def feed(self, data: bytes) -> Iterator[Decoded]:
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in filter(bytes.strip, lines):
            try:
                yield self._decode(line)
            except ValueError as error:
                if self._on_invalid is None:
                    raise
                self._on_invalid(error)
        if len(self._rest) > _LINE_BYTES:
            raise ValueError(f"{len(self._rest)} bytes without a newline")


def encode_line(message: object) -> bytes:
    """Encode a message as one line of JSON, newline included."""
    try:
        return msgspec.json.encode(message) + b"\n"
    except UnicodeEncodeError:  # a file name that is no text, which Python holds with lone surrogates
        return json.dumps(msgspec.to_builtins(message)).encode() + b"\n"


def child_command(module: str, *arguments: str) -> list[str]:
    """Command that runs a module of the program in a process of its own."""
    if getattr(sys, "frozen", False):  # its executable is not Python
        return [sys.executable, CHILD_OPTION, module, *arguments]
    return [sys.executable, "-P", "-m", "app.child", module, *arguments]


def spawn(
    module: str, *arguments: str, is_background: bool = False, discard_stderr: bool = False
) -> "subprocess.Popen[bytes]":
    """Start `main` of a module in a process with pipes; less priority in the background. Raises OSError."""
    flags = getattr(subprocess, "CREATE_NO_WINDOW", 0)  # Windows opens a console window otherwise
    if is_background:
        flags |= getattr(subprocess, "BELOW_NORMAL_PRIORITY_CLASS", 0)
    with hold_interrupts():
        return subprocess.Popen(
            child_command(module, *arguments),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL if discard_stderr else None,
            env=os.environ | ONE_THREAD,
            creationflags=flags,
        )


def allow_open_files(count: int) -> int:
    """Let this process and its children have more files open where they may; return how many they may.

    `count` is what is wanted. macOS lets a program open 256 at first, which many processes at once exceed.
    """
    if sys.platform == "win32":  # its limit is some 16 million handles
        return count
    import resource

    now, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    if now == resource.RLIM_INFINITY or now >= count:
        return count
    wanted = count if most == resource.RLIM_INFINITY else min(count, most)
    with contextlib.suppress(ValueError, OSError):
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, most))
    return resource.getrlimit(resource.RLIMIT_NOFILE)[0]


@contextlib.contextmanager
def hold_interrupts() -> Iterator[None]:
    """Block Ctrl-C here and in processes that are started meanwhile, where the system can.

    It would end a process that is starting with a traceback.
    """
    if sys.platform == "win32":
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class ChildProcess(Generic[Command, Event]):
    """Parent's side of a child process, which `spawn` starts; `send` never waits for the child.

    The reading thread calls `on_event` with each event and `on_exit` with the exit code. Lines that `decode`
    refuses are skipped.
    """

    def __init__(
        self,
        process: "subprocess.Popen[bytes]",
        encode: Callable[[Command], bytes],
        decode: Callable[[bytes], Event],
        on_event: Callable[[Event], None],
        on_exit: Callable[[int], None] = lambda _: None,
        queue_size: int = 1024,
    ) -> None:
        if process.stdin is None or process.stdout is None:
            raise ValueError("the process has no pipes: start it with spawn()")
        self.pid = process.pid
        self._process = process
        self._stdin, self._stdout = process.stdin, process.stdout
        self._encode = encode
        self._decoder = LineDecoder(decode, lambda error: _log.warning("child %d: %s", process.pid, error))
        self._on_event = on_event
        self._on_exit = on_exit
        self._commands: queue.Queue[bytes | None] = queue.Queue(queue_size)
        self._last_event_s = time.perf_counter()
        self._is_killed = False
        self._has_ended = threading.Event()
        self._threads = [
            threading.Thread(target=work, name=f"child {name}", daemon=True)
            for name, work in (("commands", self._write), ("events", self._read))
        ]
        _log.info("child %d started: %s", process.pid, process.args)
        for thread in self._threads:
            thread.start()

    @property
    def has_ended(self) -> bool:
        return self._has_ended.is_set()

    @property
    def is_running(self) -> bool:
        return self._process.poll() is None

    def send(self, command: Command, timeout_s: float = 0.0) -> bool:
        """Queue a command. False when the queue stays full for `timeout_s`: the child takes nothing."""
        return self._put(self._encode(command), timeout_s)

    def stop(self, timeout_s: float, *, wait_while_active: bool = False) -> None:
        """Close stdin and wait; kill the child `timeout_s` later, or so long after its last event."""
        start_s = time.perf_counter()
        is_closing = self._put(None, timeout_s)
        while is_closing:
            since_s = max(start_s, self._last_event_s) if wait_while_active else start_s
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(max(0.0, min(_POLL_S, since_s + timeout_s - time.perf_counter())))
                break
            is_closing = time.perf_counter() - since_s < timeout_s
        self.kill()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(_KILLED_S)
        self._put(None, 0.0)
        for thread in self._threads:
            thread.join(_KILLED_S)

    def kill(self) -> None:
        if self.is_running:
            _log.info("child %d is killed", self.pid)
            self._is_killed = True
            self._process.kill()

    def _put(self, data: bytes | None, timeout_s: float) -> bool:
        try:
            self._commands.put(data, block=timeout_s > 0.0, timeout=timeout_s or None)
        except queue.Full:
            return self._has_ended.is_set()
        return True

    def _write(self) -> None:
        with contextlib.suppress(OSError), self._stdin:
            while (data := self._commands.get()) is not None:
                self._stdin.write(data)
                self._stdin.flush()

    def _read(self) -> None:
        with contextlib.suppress(OSError, ValueError), self._stdout:
            while data := self._stdout.read1(READ_BYTES):  # type: ignore[attr-defined]
                self._last_event_s = time.perf_counter()
                for event in self._decoder.feed(data):
                    self._on_event(event)
        code = self._process.wait()
        level = logging.WARNING if code and not self._is_killed else logging.INFO
        _log.log(level, "child %d ended with code %d", self.pid, code)
        self._on_exit(code)
        self._has_ended.set()
        self._put(None, 0.0)  # a thread that is busy writing ends with its pipe


class RequestProcess(Generic[Command, Event]):
    """Child process that answers requests one after another, started when it is needed.

    Its first event says that it takes requests. Its stderr is discarded: the caller reports a crash.
    """

    def __init__(self, module: str, decode: Callable[[bytes], Event]) -> None:
        self._module = module
        self._decode = decode
        self._child: ChildProcess[Command, Event] | None = None
        self._events: queue.SimpleQueue[Event | None] = queue.SimpleQueue()
        self._is_ready = False

    @property
    def pid(self) -> int | None:
        return self._child.pid if self._child else None

    @property
    def has_ended(self) -> bool:
        """Whether the process ended by itself and was not stopped."""
        return self._child is not None and self._child.has_ended

    def start(self) -> None:
        """Start the process, if there is none, without waiting for it. Raises OSError."""
        if self._child is None:
            events: queue.SimpleQueue[Event | None] = queue.SimpleQueue()
            process = spawn(self._module, discard_stderr=True)
            self._child = ChildProcess(
                process, encode_line, self._decode, events.put, lambda _: events.put(None)
            )
            self._events, self._is_ready = events, False

    def send(self, request: Command) -> bool:
        """Send a request. False where the process does not start. Raises OSError."""
        self.start()
        if not self._is_ready:
            with contextlib.suppress(TimeoutError):
                self._is_ready = self.receive(START_S) is not None
        return self._is_ready and self._child is not None and self._child.send(request)

    def receive(self, timeout_s: float) -> Event | None:
        """Return the next event, None where the process has ended. Raises TimeoutError.

        Without an event the process is stopped; the next request starts another.
        """
        try:
            event = self._events.get(timeout=timeout_s)
        except queue.Empty:
            self.stop()
            raise TimeoutError from None
        if event is None:
            self.stop()
        return event

    def stop(self) -> None:
        """Kill the process, if there is one."""
        if self._child:
            self._child.kill()
            self._child.stop(_STOP_S)
            self._child = None


class CommandReader(Generic[Command]):
    """Child's side: reads commands from a pipe in a thread of its own; `decode` takes bytes cut anywhere.

    The pipe is not read through a buffered file: its lock would be held by the thread for ever, and the
    interpreter could not finish. An error of `decode` closes the reader like the end of the pipe.
    """

    def __init__(
        self,
        descriptor: int,
        decode: Callable[[bytes], Iterable[Command]],
        on_closed: Callable[[], None] = lambda: None,
        queue_size: int = 1024,
    ) -> None:
        self._descriptor = descriptor
        self._decode = decode
        self._on_closed = on_closed
        self._commands: queue.Queue[Command | None] = queue.Queue(queue_size)
        self._arrived = threading.Event()
        self._is_closed = False
        threading.Thread(target=self._read, name="commands", daemon=True).start()

    @classmethod
    def of_stdin(
        cls,
        decode: Callable[[bytes], Iterable[Command]],
        on_closed: Callable[[], None] = lambda: None,
        queue_size: int = 1024,
    ) -> Self:
        """Read the commands of this process's owner."""
        return cls(reserve_stdin(), decode, on_closed, queue_size)

    @property
    def is_closed(self) -> bool:
        """Tell whether `take` has come to the end of the pipe: the parent has gone or closed it."""
        return self._is_closed

    def wait(self, timeout_s: float) -> None:
        """Wait until a command or the end of the pipe has come since `take` found none, at most so long."""
        self._arrived.wait(timeout_s)

    def take(self, timeout_s: float = 0.0) -> Command | None:
        if self._is_closed:
            return None
        self._arrived.clear()  # before the queue is looked at: what comes after that sets it again
        try:
            command = self._commands.get(block=timeout_s > 0.0, timeout=timeout_s or None)
        except queue.Empty:
            return None
        self._is_closed = command is None
        return command

    def _read(self) -> None:
        try:
            while data := os.read(self._descriptor, READ_BYTES):
                for command in self._decode(data):
                    self._commands.put(command)
                    self._arrived.set()
        except (OSError, ValueError) as error:
            _log.warning("commands: %s", error)
        self._on_closed()
        self._commands.put(None)
        self._arrived.set()


class EventSender(Generic[Event]):
    """Child's side: writes events in a thread of its own. A parent that does not read misses events."""

    _QUEUE_EVENTS = 4096
    _CLOSE_S = 2.0

    def __init__(self, descriptor: int, is_transient: Callable[[Event], bool] = lambda _: False) -> None:
        self._descriptor = descriptor
        self._is_transient = is_transient
        # `send` bounds it: a queue that bounds itself takes several times as long for each event.
        self._events: queue.SimpleQueue[Event | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._write, name="events", daemon=True)
        self._thread.start()

    def send(self, event: Event) -> None:
        if self._events.qsize() < self._QUEUE_EVENTS // (2 if self._is_transient(event) else 1):
            self._events.put(event)

    def close(self) -> None:
        self._events.put(None)
        self._thread.join(self._CLOSE_S)

    def _write(self) -> None:
        with contextlib.suppress(OSError):
            while (event := self._events.get()) is not None:
                line = encode_line(event)
                while line:
                    line = line[os.write(self._descriptor, line) :]


def reserve_stdin() -> int:
    """Return a descriptor of stdin for commands alone; whatever else reads stdin finds its end.

    On Windows a library that asks what stdin is waits as long as a thread reads that pipe, as BLAS does while
    it is loaded (numpy issue 24290). So this is called before the thread starts.
    """
    descriptor = os.dup(0)
    null = os.open(os.devnull, os.O_RDONLY)
    os.dup2(null, 0)
    os.close(null)
    if sys.platform == "win32":  # the C runtime of a program without a console does not do it
        import ctypes
        import msvcrt

        ctypes.windll.kernel32.SetStdHandle(_STD_INPUT_HANDLE, ctypes.c_void_p(msvcrt.get_osfhandle(0)))
    return descriptor


def reserve_stdout() -> int:
    """Return a descriptor of stdout for events alone; whatever else is printed goes to stderr."""
    descriptor = os.dup(1)
    with contextlib.suppress(OSError):  # a program without a console may have no stderr
        os.dup2(2, 1)
    return descriptor


def end_signals() -> list[signal.Signals]:
    """Signals that ask a program to end: Ctrl-C, `kill`, and Ctrl-Break of Windows."""
    return [getattr(signal, name) for name in _END_SIGNALS if hasattr(signal, name)]


def watch_parent() -> Callable[[], bool]:
    """Return a function that tells whether the process has ended that started this one."""
    parent = os.getppid()
    if sys.platform == "win32":  # the number of the parent stays the same there
        import ctypes

        kernel = ctypes.windll.kernel32
        handle = kernel.OpenProcess(_SYNCHRONIZE, False, parent)
        return lambda: bool(handle) and kernel.WaitForSingleObject(handle, 0) == 0
    return lambda: os.getppid() != parent


def ignore_session_signals(*more: str) -> None:
    """Ignore the signals that reach all processes of a terminal, and those in `more`."""
    for name in (*_SESSION_SIGNALS, *more):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)


def json_decoder(kind: Any) -> Callable[[bytes], Any]:  # mypy has no type for a union as a value
    """Return a function that decodes one line of JSON as `kind`, or raises ValueError."""
    decoder = msgspec.json.Decoder(kind)

    def decode(line: bytes) -> Any:
        try:
            return decoder.decode(line)
        except msgspec.DecodeError:
            if b"\\ud" not in line:
                raise
            return msgspec.convert(json.loads(line), kind)  # lone surrogates, see `encode_line`

    return decode
