"""Drill: programs get no processor for seconds; `python -m tests.drills.starved --count 20`. Linux only.

Engine, writer and live identification, and where something is killed the simulated stand too, are stopped
(SIGSTOP) at random moments for 0.2 to 5 s, one of them or all, as an overloaded computer does to them, while
an engine starts and records a run, the recording program or the engine is killed, or files may not grow. Or a
writer is stopped for 130 s at the end of its run (`stopped_writer`). Rows that the engine could not fetch in
time are marked and no others, each run ends with a reason that is true, no fault of the device is told of
that was none, and no process stays.
"""

import random
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from app.acquisition.engine_client import EngineClient
from app.acquisition.messages import (
    Arm,
    Connected,
    EndReason,
    Event,
    Failed,
    PortSettings,
    Reconnecting,
    RunEnded,
    RunSettings,
    StateChanged,
)
from app.runs.reader import load_counts, open_run
from app.simulated_stand.client import SimulatedStand
from app.simulated_stand.options import SimulatedStandOptions
from config.files import settings_file
from tests.drills.disk_full import disk_full
from tests.drills.kill_engine import kill_engine
from tests.drills.kill_window import kill_window
from tests.drills.processes import descendants_of, gone
from tests.drills.report import DrillReport, arguments, run_ways
from tests.drills.sent import Sent, truth_of_now
from tests.drills.starving import ROLES, Starving
from tests.drills.stopped_writer import stopped_writer

RATE_HZ = 1000.0
DURATION_S = 6.0
COMPUTER = ("engine", "writer", "live")
"""Programs that are stopped in runs of which a word is judged. A stand that was stopped sends late and then
faster than it samples, which no device does: what is said of its rate then is true."""
_PATIENCE_S = 120.0
FALSE_WORDS = ("silent for", "brought no sample", "samples a second instead", "slept", "was set", "was away")
"""Of a device that only this computer kept waiting."""


@dataclass(slots=True)
class StarvedReport(DrillReport):
    """What came of it."""

    runs: int = 0
    starts: int = 0
    samples: int = 0
    missing: int = 0
    stops: int = 0
    stopped_s: float = 0.0
    connected_s: list[float] = field(default_factory=list)
    clock_off: list[float] = field(default_factory=list)
    """By how many standard uncertainties the clock of the stand was mistaken."""
    ended_s: list[float] = field(default_factory=list)
    """From the last word of a run to the end of all processes."""

    def figures(self) -> str:
        connected_s, ended_s = (np.array(values or [np.nan]) for values in (self.connected_s, self.ended_s))
        return (
            f"{self.starts} starts, {self.runs} runs, {self.samples} samples, {self.missing} of them marked"
            f" as missing; {self.stops} stops, {self.stopped_s:.0f} s in all; connected after"
            f" {np.median(connected_s):.1f} s (median), {np.max(connected_s):.1f} s (longest), all processes"
            f" gone after {np.max(ended_s):.1f} s at most; clock off by"
            f" {np.max(self.clock_off or [np.nan]):.1f} standard uncertainties at most"
        )


def starved_runs(
    count: int, folder: Path, kind: str = "none", tcp: bool = False, seed: int | None = None
) -> StarvedReport:
    """Start an engine for each of `count` runs and record it while programs are stopped.

    Parameters
    ----------
    count : int
    folder : Path
        For the runs.
    kind : str
        Trigger of the runs, `pullback` or `none`.
    tcp : bool
        Over TCP, which holds what nobody fetches; else over a pseudo-terminal, which does not.
    seed : int, optional
        Makes the moments repeatable.
    """
    options = SimulatedStandOptions(
        rate_hz=RATE_HZ, seed=1, rest_s=0.6, pull_s=0.3, hold_s=0.6, decay_s=1.6, recentre_s=0.4,
        tcp_port=0 if tcp else None,
    )  # fmt: skip
    report, moments, sent = StarvedReport(), random.Random(seed), Sent()
    with SimulatedStand.start(options) as stand:
        for number in range(count):
            inside = folder / f"{kind}-{number:03d}"
            inside.mkdir()
            try:
                with Starving(moments, COMPUTER) as starving:
                    ended = _one_run(stand, inside, kind, report)
                _account(starving, report)
                _check(ended, stand, sent, report)
            except (ValueError, TimeoutError) as error:
                report.faults.append(f"run {number} in {inside}: {error}")
    return report


def _one_run(stand: SimulatedStand, folder: Path, kind: str, report: StarvedReport) -> RunEnded:
    files = (str(settings_file("stand.toml")), str(settings_file("gauges.toml")))
    began_s = time.monotonic()
    with EngineClient.start(PortSettings(url=stand.port, protocol="slipstand-binary"), *files) as engine:
        report.starts += 1
        _await(engine, Connected)
        report.connected_s.append(time.monotonic() - began_s)
        engine.send(Arm(RunSettings(str(folder), series="1FFM0", trigger=kind, duration_s=DURATION_S)))
        ended = _await(engine, RunEnded)
        running = [engine.process_id, *descendants_of(engine.process_id)]
        ended_s = time.monotonic()
    if not all(gone(process_id) for process_id in running):
        raise ValueError("processes go on")
    report.ended_s.append(time.monotonic() - ended_s)
    assert isinstance(ended, RunEnded)
    return ended


def _await(engine: EngineClient, kind: type[Event]) -> Event:
    """Wait for an event, and read what is said meanwhile."""
    deadline = time.monotonic() + _PATIENCE_S
    while time.monotonic() < deadline:
        event = engine.wait(0.05)
        match event:
            case Failed(message):
                raise ValueError(f"the engine failed: {message}")
            case Reconnecting(message):
                raise ValueError(f"a device is said to be lost: {message}")
            case StateChanged(note=words) | RunEnded(message=words):
                _check_words(str(words))
        if isinstance(event, kind):
            return event
    raise TimeoutError(f"no {kind.__name__} within {_PATIENCE_S:g} s")


def _check_words(words: str) -> None:
    if any(false in words for false in FALSE_WORDS):
        raise ValueError(f"it is said of a good device: {words}")


def _account(starving: Starving, report: StarvedReport) -> None:
    report.stops += len(starving.stops)
    report.stopped_s += sum(stop.ended_s - stop.began_s for stop in starving.stops)


def _check(ended: RunEnded, stand: SimulatedStand, sent: Sent, report: StarvedReport) -> None:
    report.runs += 1
    report.samples += ended.samples
    report.missing += ended.missing
    if ended.ended is not EndReason.DURATION:
        raise ValueError(f"ended {ended.ended}: {ended.message}")
    path = Path(ended.path)
    left = sorted(one.name for one in path.parent.iterdir())
    if left != [path.name]:
        raise ValueError(f"the folder holds {left}: {ended.message}")
    run = open_run(path)
    if len(run) != ended.samples:
        raise ValueError(f"{len(run)} rows are in the file, {ended.samples} were told")
    counts = load_counts(run)
    assert counts is not None
    truth = truth_of_now(stand)
    sent.check(truth, counts, run.status)
    assert run.end is not None
    off = abs(run.end.time_base.scale - RATE_HZ / truth.wire.true_rate_hz)
    report.clock_off.append(off / run.end.time_base.scale_standard_uncertainty)


def main() -> int:
    """Run the drill in all its forms and print what came of it."""
    parser = arguments(__doc__, 20)
    parser.add_argument("--only", default="", help="ways whose names begin so")
    given = parser.parse_args()
    ways: dict[str, Callable[[int, Path], DrillReport]] = {
        f"{kind}, {'TCP' if tcp else 'pseudo-terminal'}": partial(
            starved_runs, kind=kind, tcp=tcp, seed=given.seed
        )
        for kind in ("none", "pullback")
        for tcp in (False, True)
    }
    ways["window killed"] = partial(kill_window, seed=given.seed, starve=tuple(ROLES))
    ways["engine killed"] = partial(kill_engine, seed=given.seed, starve=tuple(ROLES))
    ways["writer stopped for 130 s"] = partial(stopped_writer, seed=given.seed)
    ways["disk full"] = partial(disk_full, way="limit", seed=given.seed, starve=tuple(ROLES))
    chosen = {name: way for name, way in ways.items() if name.startswith(given.only)}
    return run_ways(given.count, chosen if sys.platform == "linux" else {})


if __name__ == "__main__":
    sys.exit(main())
