"""The highest rate at which a minute comes in without loss, for each driver through the whole engine.

`python benchmarks/highest_rates.py [--seconds 60] [--probe 5] [--only gsv,modbus]` climbs a ladder of rates
with short runs until one loses a sample, takes a whole minute at the rung below, and goes down as long as
that loses any, each time with a second try; it prints the table of docs/benchmarks.md. A run is without loss
if its driver accounts for every sample and the port took all that the stand sent. Machine and load decide as
much as the driver: on a busy machine `chrt -r 1` before the command shows what a quiet one would do.
"""

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from app.acquisition.engine_client import EngineClient
from app.acquisition.messages import (
    Arm,
    Connected,
    Event,
    Failed,
    PortSettings,
    RunEnded,
    RunSettings,
    RunStarted,
)
from app.simulated_stand.client import SimulatedStand
from app.simulated_stand.options import SimulatedStandOptions
from config.files import settings_file
from tests.drivers.examples import recording_examples

FILES = (str(settings_file("stand.toml")), str(settings_file("gauges.toml")))
POLLED = recording_examples()["modbus"].rates_hz
GAUGES: tuple[Literal["table", "relative"], ...] = ("table", "relative")
TRIES = 2
"""A busy machine may stop any run for a moment."""
ENDLESS_S = 3600.0
SETTLED_S = 0.3


@dataclass(frozen=True)
class Contender:
    """A driver, the rates that are tried, and how its simulated device is set up."""

    name: str
    protocol: str
    rates_hz: Sequence[int]
    is_polled: bool = False
    """Its device samples at its own pace, and is asked at the rate that is tried."""
    gauges: tuple[Literal["table", "relative"] | None, ...] = (None,)
    """Of each device; None: both gauges are on the one."""
    settings: dict[str, str] = field(default_factory=dict)


CONTENDERS = (
    *(
        Contender(
            example.title,
            example.protocol,
            example.rates_hz,
            is_polled=example.polled_hz is not None,
            settings=example.settings,
            gauges=GAUGES if example.is_pair else (None,),
        )
        for example in recording_examples().values()
    ),
    Contender("two Modbus devices of one gauge", "modbus", POLLED, is_polled=True, gauges=GAUGES),
)


class LostError(Exception):
    """A run that was not without loss; says how much."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--probe", type=float, default=5.0)
    parser.add_argument("--only", default="", help="protocols, separated by commas")
    parser.add_argument("--port", choices=("pty", "tcp", "both"), default="both")
    chosen = parser.parse_args()
    wanted = [one for one in CONTENDERS if not chosen.only or one.protocol in chosen.only.split(",")]
    ports = {"pty": (False,), "tcp": (True,), "both": (False, True)}[chosen.port]
    print(f"load {os.getloadavg()[0]:.1f}, {os.cpu_count()} cores, {chosen.seconds:g} s each")
    print("| driver | port | highest rate without loss, Hz | samples | the next rate |")
    print("|---|---|---|---|---|")
    for contender in wanted:
        for tcp in ports:
            print(climb(contender, tcp, chosen.probe, chosen.seconds), flush=True)


def climb(contender: Contender, tcp: bool, probe_s: float, seconds: float) -> str:
    """Row of the table for one driver on one kind of port."""
    good, beyond = -1, "was not tried: none is faster"
    for number, rate_hz in enumerate(contender.rates_hz):
        said = lost(contender, tcp, rate_hz, probe_s)
        if said:
            beyond = f"{rate_hz}: {said} in {probe_s:g} s"
            break
        good = number
    while good >= 0:
        rate_hz = contender.rates_hz[good]
        said = lost(contender, tcp, rate_hz, seconds)
        if not said:
            break
        beyond, good = f"{rate_hz}: {said} in {seconds:g} s", good - 1
    place = f"| {contender.name} | {'TCP' if tcp else 'pseudo-terminal'} "
    if good < 0:
        return f"{place}| none | | {beyond} |"
    rate_hz = contender.rates_hz[good]
    return f"{place}| {rate_hz} | {round(rate_hz * seconds)} | {beyond} |"


def lost(contender: Contender, tcp: bool, rate_hz: float, seconds: float) -> str:
    """What was lost in a run at a rate, and in a second one; empty where one of them lost nothing."""
    said = ""
    for _ in range(TRIES):
        try:
            record(contender, tcp, rate_hz, seconds)
        except LostError as loss:
            said = str(loss)
        else:
            return ""
    return said


def record(contender: Contender, tcp: bool, rate_hz: float, seconds: float) -> None:
    """Record one run. Raises LostError."""
    with running(contender, tcp, rate_hz) as (stands, engine, folder):
        before = samples_lost(stands)  # to be asked during the run would keep a stand from answering
        engine.send(Arm(RunSettings(directory=folder, trigger="none", duration_s=seconds)))
        until(engine, RunStarted)
        ended = until(engine, RunEnded)
        on_way = samples_lost(stands) - before
    accounted = ended.missing + ended.missing_estimated + ended.damaged
    if ended.ended != "duration":
        raise LostError(ended.message or str(ended.ended))
    if accounted or on_way:
        raise LostError(f"{max(accounted, on_way) / (rate_hz * seconds):.2g} of the samples lost")


@contextmanager
def running(
    contender: Contender, tcp: bool, rate_hz: float
) -> Iterator[tuple[list[SimulatedStand], EngineClient, str]]:
    """Stands that rest, and an engine that reads them."""
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        stands = [
            stack.enter_context(SimulatedStand.start(options))
            for options in stand_options(contender, tcp, rate_hz)
        ]
        urls = [stand.port for stand in stands]
        port = PortSettings(
            urls[0],
            contender.protocol,
            rate_hz=rate_hz,
            device=contender.settings,
            relative_url="".join(urls[1:]),
        )
        engine = stack.enter_context(EngineClient.start(port, *FILES))
        until(engine, Connected)
        time.sleep(SETTLED_S)
        yield stands, engine, folder


def stand_options(contender: Contender, tcp: bool, rate_hz: float) -> Iterator[SimulatedStandOptions]:
    """What each simulated device is."""
    for number, gauge in enumerate(contender.gauges):
        yield SimulatedStandOptions(
            protocol=contender.protocol,
            device=contender.settings,
            rate_hz=2000.0 if contender.is_polled else rate_hz,
            seed=number,
            tcp_port=0 if tcp else None,
            rest_s=ENDLESS_S,
            gauge=gauge,
        )


def samples_lost(stands: list[SimulatedStand]) -> int:
    """Samples that the ports did not take until now."""
    for stand in stands:
        stand.disturb("jump 1 at 1e9")  # changes nothing but makes it tell the truth of now
    time.sleep(SETTLED_S)
    return sum(stand.truth().wire.samples_lost for stand in stands)


def until(engine: EngineClient, kind: type[Event], patience_s: float = 600.0) -> Event:
    """Next event of a kind. Raises LostError where the device cannot be read at all."""
    end = time.monotonic() + patience_s
    while time.monotonic() < end:
        event = engine.wait(0.5)
        if isinstance(event, kind):
            return event
        if isinstance(event, Failed):
            raise LostError(event.message)
    raise LostError(f"no {kind.__name__} in {patience_s:g} s")


if __name__ == "__main__":
    main()
