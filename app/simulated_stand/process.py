"""The simulated stand as a process of its own: what runs in it."""

import contextlib
import os
import queue
import signal
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import msgspec

from analysis.record import AnalysisError
from app.simulated_stand.client import Ready, Refused
from app.simulated_stand.options import SimulatedStandOptions
from app.simulated_stand.stand import SimulatedStandDevice
from app.simulated_stand.truth import Truth, write_truth
from config.schema import ConfigError
from drivers.errors import DriverError, SettingsError
from drivers.simulated.disturbances import Disturbance, parse_disturbance
from drivers.simulated.transport import Transport, has_pseudo_terminals, open_pseudo_terminal, open_tcp_port


def serve(
    options: SimulatedStandOptions,
    on_ready: Callable[[Ready], None],
    has_ended: Callable[[], bool],
    on_truth: Callable[[Truth], None] | None = None,
    next_disturbance: Callable[[], Disturbance | None] = lambda: None,
) -> None:
    """Be a simulated stand in this process until `ended()`.

    Parameters
    ----------
    options : SimulatedStandOptions
    announce : callable
        Takes what a reader must know, once the port can be opened.
    ended : callable
        Asked every few milliseconds.
    tell : callable, optional
        Takes the truth at first, at each turn of events, and at the end, as the truth file does.
    next_disturbance : callable
        Gives what is to happen to the device next, None if nothing; asked every few milliseconds.

    Raises
    ------
    ConfigError, DriverError, AnalysisError
        If it cannot be set up as asked; nothing was announced then.
    """

    def tell_all(truth: Truth) -> None:
        if options.truth_file:
            write_truth(Path(options.truth_file), truth)
        if on_truth is not None:
            on_truth(truth)

    transport = _open_transport(options.tcp_port)
    try:
        stand = SimulatedStandDevice(options, transport, tell_all)
        on_ready(Ready(transport.url, options.protocol, options.rate_hz, options.series, options.truth_file))
        tell_all(stand.truth())
        while not has_ended():
            while (disturbance := next_disturbance()) is not None:
                stand.disturb(disturbance, time.monotonic_ns())
            transport.wait(stand.step(time.monotonic_ns()))
        tell_all(stand.truth())
    finally:
        transport.close()


def main() -> int:
    """Run as `python -m app.simulated_stand OPTIONS`, for `SimulatedStand`."""
    ended = stop_on_sigterm()
    orders = DisturbanceInput()
    options = msgspec.json.decode(sys.argv[1], type=SimulatedStandOptions)
    try:
        with contextlib.suppress(BrokenPipeError):  # the owner is gone
            serve(options, _write_line, lambda: ended() or orders.is_closed, _write_line, orders.take)
    except (ConfigError, DriverError, AnalysisError) as error:
        _write_line(Refused(str(error)))
        return 1
    return 0


def _open_transport(tcp_port: int | None) -> Transport:
    if tcp_port is not None:
        return open_tcp_port(tcp_port)
    return open_pseudo_terminal() if has_pseudo_terminals() else open_tcp_port()


def _write_line(said: Ready | Refused | Truth) -> None:
    sys.stdout.buffer.write(msgspec.json.encode(said) + b"\n")
    sys.stdout.buffer.flush()


_LINE_BYTES = 4096


class DisturbanceInput:
    """Disturbances as lines on standard input, read by a thread of its own.

    Parameters
    ----------
    complain : callable, optional
        Takes what is wrong with a line that is none.
    """

    def __init__(self, on_error: Callable[[str], None] = lambda _: None) -> None:
        self._complain = on_error
        self._waiting: queue.SimpleQueue[Disturbance] = queue.SimpleQueue()
        self._over = threading.Event()
        threading.Thread(target=self._read, name="stdin", daemon=True).start()

    @property
    def is_closed(self) -> bool:
        """Tell whether standard input has ended, which is the end of whoever holds its other end."""
        return self._over.is_set()

    def take(self) -> Disturbance | None:
        """Next one; None while there is none."""
        try:
            return self._waiting.get_nowait()
        except queue.Empty:
            return None

    def _read(self) -> None:
        rest = b""
        # Not sys.stdin: its lock would be held for ever, and the interpreter could not finish.
        while data := os.read(0, _LINE_BYTES):
            *lines, rest = (rest + data).split(b"\n")
            for line in lines:
                self._obey(line.decode(errors="replace").strip())
            rest = rest[-_LINE_BYTES:]
        self._over.set()

    def _obey(self, line: str) -> None:
        if not line:
            return
        try:
            self._waiting.put(parse_disturbance(line))
        except SettingsError as error:
            self._complain(str(error))


def stop_on_signal_or_orphaned() -> Callable[[], bool]:
    """Become true with SIGINT or SIGTERM, or when the parent process has gone. For a command line."""
    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ended.set())
    parent = os.getppid()
    return lambda: ended.is_set() or os.getppid() != parent


def stop_on_sigterm() -> Callable[[], bool]:
    """Become true with SIGTERM.

    SIGINT is ignored: a Ctrl-C reaches all processes of a terminal, and the owner decides what it means.
    """
    ended = threading.Event()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: ended.set())
    return ended.is_set
