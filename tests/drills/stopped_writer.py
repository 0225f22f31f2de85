"""Drill: a writer is stopped (SIGSTOP) for 130 s at the end of its run; Linux only.

A way of `tests.drills.starved`. The engine waits 120 s for its answer. A run that the writer had finished is
told as any other, without a journal beside it. Of one that it had not finished, all samples are in the
journal, and rebuilt. Half of the moments lie where the file is closed and not yet read again and synced,
the others from 0.3 s before the end of the run to 0.3 s after.
"""

import contextlib
import os
import random
import signal
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

from app.acquisition.engine_client import EngineClient
from app.acquisition.journal.recovery import RecoveryState, recover_folder
from app.acquisition.messages import (
    Arm,
    Connected,
    EndReason,
    Failed,
    PortSettings,
    RunEnded,
    RunSettings,
    RunStarted,
)
from app.runs.errors import RunError
from app.runs.file_operations import inspect_run
from app.runs.lock import is_being_recorded
from app.runs.reader import load_counts, open_run
from app.simulated_stand.client import SimulatedStand
from app.simulated_stand.options import SimulatedStandOptions
from config.files import settings_file
from tests.drills.processes import descendants_of, gone
from tests.drills.report import DrillReport
from tests.drills.sent import Sent, truth_of_now
from tests.drills.starving import is_a
from tests.drills.unplug import wait_for

STOPPED_S = 130.0
ANSWER_S = 60.0
"""An end that came sooner is the answer of the writer; without it the engine waits for 120 s."""
_AT_ONCE = 8
_AIMING = threading.Lock()
"""Held from the start of a run to the stop of its writer, whose moment lasts a few milliseconds."""
_DURATION_S = 3.0
_PATIENCE_S = 220.0


@dataclass(slots=True)
class StoppedWriterReport(DrillReport):
    """What came of it."""

    runs: int = 0
    answered: int = 0
    """Runs whose writer had answered before it was stopped."""
    finished: int = 0
    rebuilt: int = 0
    samples: int = 0
    ended_s: list[float] = field(default_factory=list)
    """From the stop of the writer to the end of the run."""

    def figures(self) -> str:
        return (
            f"{self.runs} runs, {self.finished} finished and told as such, {self.rebuilt} rebuilt from the"
            f" journal, {self.answered} had been told before; {self.samples} samples told and held; told"
            f" after {max(self.ended_s, default=0):.0f} s at most"
        )


@dataclass(frozen=True, slots=True)
class StoppedRun:
    """How a run ended whose writer was stopped."""

    ended: RunEnded
    ended_s: float
    """From the stop of the writer to the end of the run."""
    was_finished: bool
    """The file was whole while the writer stood still."""


def stopped_writer(count: int, folder: Path, seed: int | None = None) -> StoppedWriterReport:
    """Record `count` runs, some at once, each from a stand of its own, and stop the writers at their ends."""
    report, moments = StoppedWriterReport(), random.Random(seed)
    given = [(folder / f"{number:03d}", random.Random(moments.random())) for number in range(count)]
    with ThreadPoolExecutor(_AT_ONCE) as pool:
        faults = list(pool.map(lambda one: _one_run(*one, report), given))
    report.faults += filter(None, faults)
    return report


def _one_run(place: Path, moments: random.Random, report: StoppedWriterReport) -> str:
    """Record a run and hold it against what was sent; what was wrong."""
    place.mkdir()
    options = SimulatedStandOptions(rate_hz=500.0, seed=moments.randrange(1000), tcp_port=0)
    files = (str(settings_file("stand.toml")), str(settings_file("gauges.toml")))
    try:
        with SimulatedStand.start(options) as stand:
            port = PortSettings(stand.port, protocol=options.protocol)
            with EngineClient.start(port, *files) as engine:
                run = _stop_at_end(engine, place, moments)
                running = [engine.process_id, *descendants_of(engine.process_id)]
            _check(run, running, place, stand, report)
    except (ValueError, TimeoutError, OSError, RunError) as error:
        return f"{place.name}: {error}"
    return ""


def _stop_at_end(engine: EngineClient, place: Path, moments: random.Random) -> StoppedRun:
    wait_for(engine, Connected)
    with _AIMING:
        engine.send(Arm(RunSettings(str(place), series="1FFM0", trigger="none", duration_s=_DURATION_S)))
        started = wait_for(engine, RunStarted)
        assert isinstance(started, RunStarted)
        path = Path(started.path)
        writer = next(one for one in descendants_of(engine.process_id) if is_a(one, "writer"))
        if moments.random() < 0.5:
            _await_closed_file(writer, path)
        else:
            time.sleep(_DURATION_S + moments.uniform(-0.3, 0.3))
        os.kill(writer, signal.SIGSTOP)
        stopped_at_s = time.perf_counter()
    try:
        ended = _await_end(engine)
        ended_s = time.perf_counter() - stopped_at_s
        left = inspect_run(path, locked=True)
        time.sleep(max(0.0, STOPPED_S - (time.perf_counter() - stopped_at_s)))
    finally:
        with contextlib.suppress(ProcessLookupError):  # the engine ends one that has finished
            os.kill(writer, signal.SIGCONT)
    return StoppedRun(ended, ended_s, left is not None and left.end is not None)


def _await_closed_file(writer: int, path: Path) -> None:
    """Wait until a writer has closed its run file, which it then reads again and syncs."""
    links = [link for link in Path(f"/proc/{writer}/fd").iterdir() if _target(link) == str(path)]
    deadline_s = time.perf_counter() + 60.0
    while any(_target(link) == str(path) for link in links):
        if time.perf_counter() > deadline_s:
            raise TimeoutError("the writer does not close the run file within 60 s")


def _target(link: Path) -> str:
    try:
        return os.readlink(link)  # noqa: PTH115
    except OSError:  # closed
        return ""


def _await_end(engine: EngineClient) -> RunEnded:
    deadline_s = time.perf_counter() + _PATIENCE_S
    while time.perf_counter() < deadline_s:
        match engine.wait(0.5):
            case RunEnded() as ended:
                return ended
            case Failed(message):
                raise ValueError(f"the engine failed: {message}")
    raise TimeoutError(f"the run does not end within {_PATIENCE_S:g} s")


def _check(
    run: StoppedRun, running: list[int], place: Path, stand: SimulatedStand, report: StoppedWriterReport
) -> None:
    """The samples that were told must be in the run, or in what is rebuilt of it; no process may stay."""
    if not all(gone(process_id) for process_id in running):
        raise ValueError("processes go on")
    ended, path = run.ended, Path(run.ended.path)
    is_good = ended.ended is EndReason.DURATION and not ended.message
    if not is_good and (run.was_finished or ended.ended is not EndReason.WRITE_ERROR):
        raise ValueError(f"{'whole, but ' if run.was_finished else ''}ended {ended.ended}: {ended.message}")
    deadline_s = time.perf_counter() + 30.0
    while is_being_recorded(path) and time.perf_counter() < deadline_s:
        time.sleep(0.05)
    found = recover_folder(place)
    if is_good and found:
        raise ValueError(f"a journal is left beside a whole run: {found}")
    if any(one.state not in (RecoveryState.RECOVERED, RecoveryState.WHOLE) or one.kept for one in found):
        raise ValueError(f"recover says: {found}")
    held = open_run(Path(found[0].run) if found else path)
    counts = load_counts(held)
    assert counts is not None
    Sent().check(truth_of_now(stand), counts, held.status)
    if len(held) < ended.samples:
        raise ValueError(f"{ended.samples} samples were told, {len(held)} are held")
    report.runs += 1
    report.samples += ended.samples
    report.ended_s.append(run.ended_s)
    if not is_good:
        report.rebuilt += 1
    elif run.ended_s < ANSWER_S:
        report.answered += 1
    else:
        report.finished += 1
