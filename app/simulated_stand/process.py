"""The simulated stand as a process of its own: what runs in it."""

import contextlib
import sys
import time
from collections.abc import Callable
from pathlib import Path

import msgspec

from analysis.record import AnalysisError
from app.simulated_stand.client import Ready, Refused
from app.simulated_stand.control import DisturbanceInput, stop_on_sigterm
from app.simulated_stand.options import SimulatedStandOptions
from app.simulated_stand.stand import SimulatedStandDevice
from app.simulated_stand.truth import Truth, write_truth
from config.schema import ConfigError
from drivers.errors import DriverError
from drivers.simulated.disturbances import Disturbance
from drivers.simulated.pseudo_terminal import has_pseudo_terminals, open_pseudo_terminal
from drivers.simulated.tcp import open_tcp_port
from drivers.simulated.transport import Transport


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
