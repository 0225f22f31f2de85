"""The simulated stand as a process of its own: what runs in it."""

import signal
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import msgspec

from analysis.record import AnalysisError
from app.child_process import (
    CommandReader,
    EventSender,
    LineDecoder,
    end_signals,
    ignore_session_signals,
    reserve_stdout,
    watch_parent,
)
from app.log import start_log
from app.simulated_stand.client import Ready, Refused, StandEvent, Started, TruthChanged
from app.simulated_stand.options import Gesture, SimulatedStandOptions
from app.simulated_stand.stand import SimulatedStandDevice
from app.simulated_stand.truth import Truth, write_truth
from config.schema import ConfigError
from drivers.errors import DriverError, SettingsError
from drivers.registry import find_driver
from drivers.simulated.faults import Disturbance, parse_disturbance
from drivers.simulated.transport import has_pseudo_terminals, open_pseudo_terminal, open_tcp_port


def serve(
    options: SimulatedStandOptions,
    on_ready: Callable[[Ready], None],
    has_ended: Callable[[], bool],
    on_truth: Callable[[Truth], None] | None = None,
    next_disturbance: Callable[[], Disturbance | Gesture | None] = lambda: None,
    is_orphaned: Callable[[], bool] = lambda: False,
) -> None:
    """Run a simulated stand in this process until `has_ended()`.

    Where `is_orphaned()`, it goes on only while somebody reads it: an engine that finishes a run.

    Raises ConfigError, DriverError, AnalysisError if it cannot be set up as asked; `on_ready` was not called
    then. `on_ready` receives what a reader must know, `on_truth` the truth at the start, at each change and
    at the end. `has_ended` and `next_disturbance` (None for none) are asked every few milliseconds.
    """

    def publish(truth: Truth) -> None:
        if options.truth_file:
            write_truth(Path(options.truth_file), truth)
        if on_truth is not None:
            on_truth(truth)

    is_tcp = options.tcp_port is not None or not has_pseudo_terminals()
    protocol = find_driver(options.protocol).make_simulated(options.device)
    transport = protocol.open_transport(options.sample_rate_hz)
    if transport is None:
        transport = open_tcp_port(options.tcp_port or 0) if is_tcp else open_pseudo_terminal()
    try:
        stand = SimulatedStandDevice(options, transport, publish)
        done = options.completed()
        files = done.truth_file, done.gauges_file
        on_ready(Ready(transport.url, done.protocol, done.sample_rate_hz, done.series, *files))
        publish(stand.truth())
        while not (has_ended() or stand.is_over) and (stand.has_reader or not is_orphaned()):
            while (disturbance := next_disturbance()) is not None:
                stand.disturb(disturbance, time.perf_counter_ns())
            transport.wait(stand.step(time.perf_counter_ns()))
        publish(stand.truth())
    finally:
        transport.close()


def main() -> int:
    """Be the device of a `SimulatedStand`, whose options are the argument, as JSON."""
    start_log("simulated-stand")
    ignore_session_signals()
    has_ended = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: has_ended.set())
    disturbances = read_disturbances()
    events: EventSender[StandEvent] = EventSender(reserve_stdout())
    options = msgspec.json.decode(sys.argv[1], type=SimulatedStandOptions)
    try:
        serve(
            options,
            lambda ready: events.send(Started(ready)),
            has_ended.is_set,
            lambda truth: events.send(TruthChanged(truth)),
            disturbances.take,
            lambda: disturbances.is_closed,
        )
    except (ConfigError, DriverError, AnalysisError) as error:
        events.send(Refused(str(error)))
        return 1
    finally:
        events.close()
    return 0


def read_disturbances(
    on_invalid: Callable[[Exception], None] = lambda _: None,
) -> CommandReader[Disturbance | Gesture]:
    """Read disturbances and gestures as lines on standard input; `on_invalid` receives faulty lines."""
    return CommandReader.of_stdin(LineDecoder(_decode_disturbance, on_invalid).feed)


def _decode_disturbance(line: bytes) -> Disturbance | Gesture:
    text = line.decode(errors="replace").strip()
    try:
        return Gesture(text) if text in set(Gesture) else parse_disturbance(text)
    except SettingsError as error:
        raise ValueError(str(error)) from None


def stop_on_signal_or_orphaned() -> Callable[[], bool]:
    """Become true with a signal that asks to end, or when the parent process has gone. For a command line."""
    ended = threading.Event()
    for number in end_signals():
        signal.signal(number, lambda *_: ended.set())
    is_orphaned = watch_parent()
    return lambda: ended.is_set() or is_orphaned()
