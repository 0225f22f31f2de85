"""Drill: the program that records is killed in a run; `python -m tests.drills.kill_window --count 50`.

The engine finishes a run that needs nobody any more, and ends any other; either is closed, checked and
stored without a journal being left, each row is what the stand sent, and no process stays.
"""

import random
import subprocess
import sys
import time
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from app.runs.reader import Run, load_counts, open_run
from app.simulated_stand.client import SimulatedStand
from app.simulated_stand.options import SimulatedStandOptions
from config.files import settings_file
from tests.drills.processes import descendants_of, gone
from tests.drills.report import DrillReport, arguments, run_ways
from tests.drills.sent import Sent, truth_of_now
from tests.drills.starving import Starving

RATE_HZ = 1000.0
DURATION_S = 1.5
PRETRIGGER_S = 0.5
_PATIENCE_S = 60.0

OWNER = """
import sys
from app.acquisition.engine_client import EngineClient
from app.acquisition.messages import Arm, Connected, PortSettings, RunSettings, RunStarted
url, folder, stand, gauges = sys.argv[1:5]
engine = EngineClient.start(PortSettings(url=url, protocol="slipstand-binary"), stand, gauges)
while True:
    event = engine.wait(1.0)
    if isinstance(event, Connected):
        run = RunSettings(folder, series="1FFM0", pretrigger_s={pretrigger}, duration_s={duration})
        engine.send(Arm(run))
        print("armed", flush=True)
    elif isinstance(event, RunStarted):
        print("started", flush=True)
"""


@dataclass(slots=True)
class WindowReport(DrillReport):
    """What came of it."""

    kills: int = 0
    whole: int = 0
    """Runs that were finished as if nothing had happened."""
    cut_short: int = 0
    """Runs that needed somebody, and were ended and stored."""
    none: int = 0
    """Killed before a sample was recorded."""
    stored_after_s: list[float] = field(default_factory=list)
    """From the kill to the last process gone."""

    def figures(self) -> str:
        after_s = self.stored_after_s or [np.nan]
        return (
            f"{self.kills} kills: {self.whole} runs finished, {self.cut_short} ended and stored, {self.none}"
            f" not begun; all over {np.median(after_s):.1f} s after the kill (median),"
            f" {np.max(after_s):.1f} s (longest)"
        )


def kill_window(
    count: int, folder: Path, seed: int | None = None, starve: tuple[str, ...] = ()
) -> WindowReport:
    """Kill a recording program once in each of `count` runs from one simulated stand.

    Parameters
    ----------
    count : int
    folder : Path
        For the runs.
    seed : int, optional
        Makes the moments repeatable.
    starve : sequence of str
        Programs that are stopped now and then meanwhile, of `tests.drills.starving.ROLES`.
    """
    options = SimulatedStandOptions(
        rate_hz=RATE_HZ, seed=1, rest_s=0.6, pull_s=0.3, hold_s=0.6, decay_s=1.6, recentre_s=0.4
    )
    report, moments, sent = WindowReport(), random.Random(seed), Sent()
    with SimulatedStand.start(options) as stand:
        for number in range(count):
            inside = folder / f"window-{number:03d}"
            inside.mkdir()
            try:
                with Starving(moments, starve):
                    _one_kill(stand, inside, moments, report)
                _check(inside, stand, sent, report)
            except (AssertionError, ValueError, TimeoutError) as error:
                report.faults.append(f"run {number} in {inside}: {error}")
    return report


def _one_kill(stand: SimulatedStand, folder: Path, moments: random.Random, report: WindowReport) -> None:
    """Half of the moments fall after the release, when the run needs nobody."""
    code = OWNER.format(pretrigger=PRETRIGGER_S, duration=DURATION_S)
    files = (str(settings_file("stand.toml")), str(settings_file("gauges.toml")))
    command = [sys.executable, "-c", code, stand.port, str(folder), *files]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as owner:
        assert owner.stdout is not None
        _await_line(owner, "armed")
        if moments.random() < 0.5:
            _await_line(owner, "started")
            time.sleep(moments.uniform(0.0, 1.2 * DURATION_S))
        else:
            time.sleep(moments.uniform(0.0, 2.0))
        running = descendants_of(owner.pid)
        owner.kill()
        killed_s = time.monotonic()
    report.kills += 1
    if not all(gone(process_id, _PATIENCE_S) for process_id in running):
        raise ValueError("processes go on")
    report.stored_after_s.append(time.monotonic() - killed_s)


def _await_line(owner: "subprocess.Popen[str]", word: str) -> None:
    assert owner.stdout is not None
    line = owner.stdout.readline().strip()
    if line != word:
        raise ValueError(f"the program says {line!r} instead of {word!r}")


def _check(folder: Path, stand: SimulatedStand, sent: Sent, report: WindowReport) -> None:
    left = list(folder.iterdir())
    if not left:
        report.none += 1
        return
    if [path.suffix for path in left] != [".h5"]:
        raise ValueError(f"the folder holds {sorted(path.name for path in left)}")
    run = open_run(left[0])
    if run.end is None or run.end.ended not in ("duration", "interrupted"):
        raise ValueError(f"the run ended {run.end}")
    if run.end.ended == "duration":
        report.whole += 1
        if len(run) != round((PRETRIGGER_S + DURATION_S) * RATE_HZ):
            raise ValueError(f"{len(run)} rows in a run that was finished")
    else:
        report.cut_short += 1
    _check_rows(run, stand, sent)


def _check_rows(run: Run, stand: SimulatedStand, sent: Sent) -> None:
    counts = load_counts(run)
    assert counts is not None
    sent.check(truth_of_now(stand), counts, run.status)


def main() -> int:
    """Run the drill and print what came of it."""
    given = arguments(__doc__, 50).parse_args()
    return run_ways(given.count, {"window": partial(kill_window, seed=given.seed)})


if __name__ == "__main__":
    sys.exit(main())
