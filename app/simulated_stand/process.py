"""The simulated stand as a process of its own: what runs in it."""

import contextlib
import os
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
from app.simulated_stand.stand import StandOnWire
from app.simulated_stand.truth import Truth, write_truth
from config.schema import ConfigError
from drivers.errors import DriverError
from drivers.simulated.transport import open_pseudo_terminal


def serve(
    options: SimulatedStandOptions,
    announce: Callable[[Ready], None],
    ended: Callable[[], bool],
    tell: Callable[[Truth], None] | None = None,
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

    Raises
    ------
    ConfigError, DriverError, AnalysisError
        If it cannot be set up as asked; nothing was announced then.
    """

    def tell_all(truth: Truth) -> None:
        if options.truth_file:
            write_truth(Path(options.truth_file), truth)
        if tell is not None:
            tell(truth)

    transport = open_pseudo_terminal()
    try:
        stand = StandOnWire(options, transport, tell_all)
        announce(Ready(transport.url, options.protocol, options.rate_hz, options.series, options.truth_file))
        tell_all(stand.truth())
        while not ended():
            transport.wait(stand.step(time.monotonic_ns()))
        tell_all(stand.truth())
    finally:
        transport.close()


def interrupted_or_orphaned() -> Callable[[], bool]:
    """Become true with SIGINT or SIGTERM, or when the parent process has gone. For a command line."""
    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ended.set())
    parent = os.getppid()
    return lambda: ended.is_set() or os.getppid() != parent


def stdin_closed() -> Callable[[], bool]:
    """Become true with the end of stdin, which is the end of whoever holds the other end, or with SIGTERM.

    SIGINT is ignored: a Ctrl-C reaches all processes of a terminal, and the owner decides what it means.
    """
    ended = threading.Event()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: ended.set())

    def drain() -> None:
        # Not sys.stdin: its lock would be held for ever, and the interpreter could not finish.
        while os.read(0, 4096):
            pass
        ended.set()

    threading.Thread(target=drain, name="stdin", daemon=True).start()
    return ended.is_set


def main() -> int:
    """Run as `python -m app.simulated_stand OPTIONS`, for `SimulatedStand`."""
    ended = stdin_closed()
    options = msgspec.json.decode(sys.argv[1], type=SimulatedStandOptions)
    try:
        with contextlib.suppress(BrokenPipeError):  # the owner is gone
            serve(options, _write_line, ended, _write_line)
    except (ConfigError, DriverError, AnalysisError) as error:
        _write_line(Refused(str(error)))
        return 1
    return 0


def _write_line(said: Ready | Refused | Truth) -> None:
    sys.stdout.buffer.write(msgspec.json.encode(said) + b"\n")
    sys.stdout.buffer.flush()
