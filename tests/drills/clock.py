"""Drill: the clock of the computer is set while runs are recorded; `python -m tests.drills.clock`.

Linux only. Engine and writer load a library (`preload.c`) that shifts their time of day: by hours, forward or
back, in the middle of a run; or so that winter or summer time begins within it. Two runs are recorded. Each
must begin when it began and end so long after that as it is long, its rows be in order, the operator be told
of a clock that was set, and not of a change of season. The health of the engine must come as often as before,
and the list of runs have them in the order of their beginnings.
"""

import argparse
import datetime
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.acquisition.engine_client import EngineClient
from app.acquisition.messages import (
    Arm,
    Connected,
    EndReason,
    Health,
    PortSettings,
    RunEnded,
    RunSettings,
    RunStarted,
)
from app.runs.listing import list_runs
from app.runs.reader import load_counts, open_run
from app.simulated_stand.client import SimulatedStand
from app.simulated_stand.options import SimulatedStandOptions
from config.files import settings_file
from tests.drills.power_loss import environment
from tests.drills.preload import CLOCK, build_library, has_compiler
from tests.drills.report import DrillReport, chosen_ways, run_ways
from tests.drills.sent import Sent, truth_of_now
from tests.drills.unplug import wait_for

RATE_HZ = 500.0
DURATION_S = 6.0
SET_AFTER_S = 1.0
NOTICED_S = 2.0
"""After which the engine has noticed a clock that was set, and tells nothing of it in the next run."""
HEALTH_MAX_S = 2.0
"""Longest time between two reports of health; they come each 0.4 s on a computer that is not busy."""
BEGAN_WITHIN_S = 1.5
_ZONE = "CET-1CEST,M3.5.0,M10.5.0/3"
_WINTER = datetime.datetime(2026, 10, 25, 1, 0, tzinfo=datetime.UTC)
_SUMMER = datetime.datetime(2026, 3, 29, 1, 0, tzinfo=datetime.UTC)
LEAPS_S = {"five hours forward": 5 * 3600, "seven hours back": -7 * 3600, "a day back": -86400}
SEASONS = {"winter time begins": _WINTER, "summer time begins": _SUMMER}
WAYS = (*LEAPS_S, *SEASONS)


@dataclass(slots=True)
class ClockReport(DrillReport):
    """What came of it."""

    way: str
    samples: int = 0
    said: str = ""
    health_s: float = 0.0
    """Longest time between two reports of health."""

    def figures(self) -> str:
        return f"{self.samples} samples, health each {self.health_s:.1f} s at most; {self.said}"


class Clock:
    """The time of day of programs that have loaded the library."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.offset_s = 0.0
        self.set(0.0)

    def set(self, offset_s: float) -> None:
        """Shift it by so much (s) from the true time, at once."""
        other = self.path.with_suffix(".new")
        other.write_text(f"{offset_s:.3f}")
        other.replace(self.path)
        self.offset_s = offset_s

    def now(self) -> datetime.datetime:
        return datetime.datetime.now(datetime.UTC) + datetime.timedelta(seconds=self.offset_s)


def set_clock(way: str, place: Path) -> ClockReport:
    """Record two runs in an empty folder, and set the clock within the first as `way` says."""
    report, runs = ClockReport(way), place / "runs"
    clock = Clock(place / "offset")
    options = SimulatedStandOptions(rate_hz=RATE_HZ, seed=1, tcp_port=0, table_drift_m_per_s=1e-3)
    files = (str(settings_file("stand.toml")), str(settings_file("gauges.toml")))
    preloaded = {"LD_PRELOAD": str(build_library(place)), CLOCK: str(clock.path), "TZ": _ZONE}
    with (
        SimulatedStand.start(options) as stand,
        environment(preloaded),
        EngineClient.start(PortSettings(stand.port, options.protocol), *files) as engine,
    ):
        wait_for(engine, Connected)
        try:
            _record_two(engine, clock, runs, stand, report)
        except (ValueError, TimeoutError, OSError) as error:
            report.faults.append(f"{way}: {error}")
    return report


def _record_two(
    engine: EngineClient, clock: Clock, runs: Path, stand: SimulatedStand, report: ClockReport
) -> None:
    way = report.way
    if way in SEASONS:
        before_s = (SEASONS[way] - datetime.datetime.now(datetime.UTC)).total_seconds()
        clock.set(before_s - NOTICED_S - SET_AFTER_S)
        time.sleep(NOTICED_S)
    paths, began = list[str](), list[datetime.datetime]()
    settings = RunSettings(str(runs), series="1FFM0", trigger="none", duration_s=DURATION_S)
    for number in range(2):
        began.append(clock.now())
        engine.send(Arm(settings))
        wait_for(engine, RunStarted)
        if number == 0 and way in LEAPS_S:
            clock.set(LEAPS_S[way])
        ended, longest_s = _await_end(engine)
        report.health_s = max(report.health_s, longest_s)
        if number == 0:
            report.said = str(ended.message)
        paths.append(_check_run(ended, began[number], stand, report))
    if ("clock of this computer was set" in report.said) != (way in LEAPS_S):
        raise ValueError(f"of the clock it is said: {report.said!r}")
    if report.health_s > HEALTH_MAX_S:
        raise ValueError(f"no health for {report.health_s:.1f} s")
    in_order = [path for _, path in sorted(zip(began, paths, strict=True))]
    listed = [str(one.path) for one in list_runs(runs)]
    if listed not in (in_order, in_order[::-1]):
        raise ValueError(f"the runs are listed as {listed}")


def _await_end(engine: EngineClient) -> tuple[RunEnded, float]:
    """The end of a run, and the longest time between two reports of health until then."""
    before_s, longest_s = time.monotonic(), 0.0
    while time.monotonic() < before_s + 60.0:
        event = engine.wait(0.05)
        if isinstance(event, RunEnded):
            return event, longest_s
        if isinstance(event, Health):
            longest_s, before_s = max(longest_s, time.monotonic() - before_s), time.monotonic()
    raise TimeoutError("no end within 60 s")


def _check_run(ended: RunEnded, began: datetime.datetime, stand: SimulatedStand, report: ClockReport) -> str:
    run = open_run(ended.path)
    if ended.ended is not EndReason.DURATION or len(run) != ended.samples or run.end is None:
        raise ValueError(f"{ended.path} ended as {ended.ended}: {ended.message}")
    report.samples += len(run)
    Sent().check(truth_of_now(stand), load_counts(run), run.status)  # type: ignore[arg-type]
    if not (np.diff(run.time_s) > 0).all():
        raise ValueError(f"the times of {ended.path} are not in order")
    start = run.metadata.known_start_time
    if abs((start - began).total_seconds()) > BEGAN_WITHIN_S:
        raise ValueError(f"a run that began at {began} is said to begin at {start}")
    length_s = (run.end.end_time - start).total_seconds()  # type: ignore[operator]
    if not DURATION_S - 0.1 <= length_s <= DURATION_S + 1.0:
        raise ValueError(f"a run of {DURATION_S:g} s is said to be {length_s:.1f} s long")
    return ended.path


def main() -> int:
    """Run the drill in all ways and print what came of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--ways", default=",".join(WAYS), help="separated by commas")
    given = parser.parse_args()
    if not has_compiler():
        sys.stdout.write("there is no C compiler here, or this is not Linux\n")
        return 1
    ways = chosen_ways(parser, given.ways, WAYS)
    return run_ways(len(ways), {way: lambda _, folder, way=way: set_clock(way, folder) for way in ways})


if __name__ == "__main__":
    sys.exit(main())
