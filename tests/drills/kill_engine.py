"""Drill: the engine is killed at a random moment of a run; `python -m tests.drills.kill_engine --count 200`.

After each kill the file must open as it was left, and `recover` must give a run whose every row is what the
stand sent at that place. Lost is what the stand had sent when it was asked, just before the kill. A quarter
of the moments lies in the making of the run file, half of them within 4 ms of one of its flushes, both with
the writer, so that nobody closes the file; the others fall anywhere from arming to closing, half of them with
the writer. No process of the dead engine may stay.
"""

import contextlib
import os
import random
import signal
import sys
import time
from dataclasses import dataclass, field
from enum import Enum, auto
from functools import partial
from pathlib import Path

import h5py
import numpy as np

from app.acquisition.engine_client import EngineClient
from app.acquisition.journal.recovery import Recovery, RecoveryState, recover_folder
from app.acquisition.messages import Arm, Connected, Event, Failed, PortSettings, RunSettings
from app.runs.creation import UNFINISHED_SUFFIX
from app.runs.errors import RunError
from app.runs.lock import RECORDING_SUFFIX, is_being_recorded
from app.runs.reader import Run, load_counts, open_run
from app.runs.schema import STORED, TIME
from app.runs.validation import is_finished
from app.simulated_stand.client import SimulatedStand
from app.simulated_stand.options import SimulatedStandOptions
from config.files import settings_file
from drivers.simulated.stream_sender import TransmissionLog
from tests.drills.processes import children_of, gone
from tests.drills.report import DrillReport, arguments, run_ways
from tests.drills.sent import Sent, truth_of_now
from tests.drills.starving import Starving

RATES_HZ = (1000.0, 2000.0)
DURATION_S = 3.0
LOST_LIMIT_S = 0.1
NOTICED_LIMIT_S = 1.0
KINDS = ("pullback", "none")
_WRITER_S = 30.0


class Aim(Enum):
    """What a kill is meant to hit."""

    MAKING = auto()
    FLUSH = auto()
    ANYWHERE = auto()


@dataclass(slots=True)
class KillReport(DrillReport):
    """What came of it."""

    kills: int = 0
    with_writer: int = 0
    """Of these, kills of the writer too."""
    inside_flush: int = 0
    """Kills that left rows in the file which it does not yet say are there."""
    making: int = 0
    """Kills that left an unfinished file, which has no name yet."""
    without_file: int = 0
    """Killed before the release was sure: only the journal was there."""
    whole: int = 0
    """Killed after the run was safe."""
    rows: int = 0
    rows_added: int = 0
    """By recovery, to what the writer had stored by itself."""
    lost_s: list[float] = field(default_factory=list)
    noticed_s: list[float] = field(default_factory=list)
    recover_s: list[float] = field(default_factory=list)

    def figures(self) -> str:
        lost_ms, noticed_ms = (np.array(values or [np.nan]) * 1e3 for values in (self.lost_s, self.noticed_s))
        return (
            f"{self.kills} kills, {self.with_writer} with the writer, {self.inside_flush} of them seen to be"
            f" inside a flush, {self.making} in the making of the file; {self.without_file} before there was"
            f" a file, {self.whole} after the run was safe; {self.rows} rows recovered,"
            f" {self.rows_added} of them not in the file that was left;"
            f" lost {np.median(lost_ms):.0f} ms (median), {np.max(lost_ms):.0f} ms (most); noticed after"
            f" {np.max(noticed_ms):.0f} ms at most; recovered in"
            f" {np.median(self.recover_s or [np.nan]):.2f} s (median)"
        )


@dataclass(frozen=True, slots=True)
class Kill:
    """One engine that was killed, and where its run is."""

    folder: Path
    sent: TransmissionLog
    """What the stand had sent just before."""
    killed_s: float
    """By the clock `time.monotonic`."""
    noticed_s: float
    children: list[int]
    """Processes that the engine had."""
    with_writer: bool
    """They were killed too."""


def kill_engine(
    count: int,
    folder: Path,
    rate_hz: float = 1000.0,
    kind: str = "pullback",
    seed: int | None = None,
    starve: tuple[str, ...] = (),
) -> KillReport:
    """Kill the engine once in each of `count` runs from one simulated stand.

    Parameters
    ----------
    count : int
    folder : Path
        For the runs.
    rate_hz : float
    kind : str
        Trigger of the runs, `pullback` or `none`.
    seed : int, optional
        Makes the moments repeatable.
    starve : sequence of str
        Programs that are stopped now and then meanwhile, of `tests.drills.starving.ROLES`. What an engine
        that stood still had not read when it was killed never reached it, and does not count as lost.
    """
    options = SimulatedStandOptions(
        rate_hz=rate_hz, seed=1, rest_s=0.6, pull_s=0.3, hold_s=0.6, decay_s=1.6, recentre_s=0.4,
    )  # fmt: skip
    report, moments, sent = KillReport(), random.Random(seed), Sent()
    with SimulatedStand.start(options) as stand:
        port = PortSettings(url=stand.port, protocol=options.protocol)
        for number in range(count):
            inside = folder / f"{kind}-{rate_hz:g}-{number:03d}"
            inside.mkdir()
            try:
                with Starving(moments, starve, lambda: truth_of_now(stand).wire.samples) as starving:
                    killed = _one_kill(stand, port, inside, kind, moments)
                _check(killed, starving.readable_samples(killed.killed_s), stand, sent, report)
            except (AssertionError, ValueError, TimeoutError, RunError) as error:
                report.faults.append(f"{kind} run {number} at {rate_hz:g} Hz in {inside}: {error}")
    return report


def _one_kill(
    stand: SimulatedStand, port: PortSettings, folder: Path, kind: str, moments: random.Random
) -> Kill:
    files = (str(settings_file("stand.toml")), str(settings_file("gauges.toml")))
    aim = moments.choice([Aim.MAKING, Aim.FLUSH, Aim.FLUSH, Aim.ANYWHERE])
    with_writer = aim is not Aim.ANYWHERE or moments.random() < 0.5
    with EngineClient.start(port, *files) as engine:
        _wait_for(engine, Connected)
        # A hold that has begun when armed is waited out: at most one cycle of the stand.
        engine.send(Arm(RunSettings(str(folder), series="1FFM0", trigger=kind, duration_s=DURATION_S)))
        if aim is Aim.ANYWHERE:
            time.sleep(moments.uniform(0.0, 2.0 if kind == "pullback" else DURATION_S + 0.5))
        else:
            _await_file(folder)
            time.sleep(moments.uniform(0.0, 0.1 if aim is Aim.MAKING else DURATION_S / 2))
        children = children_of(engine.process_id)
        later_s = moments.uniform(0.0, 4e-3) if aim is Aim.FLUSH else None
        sent = truth_of_now(stand).wire if later_s is None else _await_write(folder, stand, later_s)
        for process_id in children if with_writer else ():
            with contextlib.suppress(ProcessLookupError):
                os.kill(process_id, signal.SIGKILL)
        os.kill(engine.process_id, signal.SIGKILL)
        killed_s = time.monotonic()
        _wait_for(engine, Failed)
        return Kill(folder, sent, killed_s, time.monotonic() - killed_s, children, with_writer)


def _await_file(folder: Path, patience_s: float = 60.0) -> None:
    """Wait until the writer is about to make the run file: it takes its lock first."""
    deadline = time.monotonic() + patience_s
    while not any(folder.glob(f"*.h5{RECORDING_SUFFIX}")):
        if time.monotonic() > deadline:
            raise TimeoutError(f"no run file within {patience_s:g} s")
        time.sleep(0.001)


def _await_write(
    folder: Path, stand: SimulatedStand, later_s: float, patience_s: float = 3.0
) -> TransmissionLog:
    """Wait until the run file is written to, and so much longer; not at all where there is none to come.

    Returns what the stand had sent within the tenth of a second before.
    """
    path = next(folder.glob("*.h5"), None)
    sent, asked = truth_of_now(stand).wire, time.monotonic()
    deadline = asked + patience_s
    before = path.stat().st_mtime_ns if path else 0
    while path and path.stat().st_mtime_ns == before and time.monotonic() < deadline:
        if time.monotonic() - asked > 0.1:
            sent, asked = truth_of_now(stand).wire, time.monotonic()
    time.sleep(later_s)
    return sent


def _check(
    killed: Kill, readable_samples: int | None, stand: SimulatedStand, sent: Sent, report: KillReport
) -> None:
    """Hold what is left, and what is recovered from it, against what was sent."""
    report.kills += 1
    report.with_writer += killed.with_writer
    report.noticed_s.append(killed.noticed_s)
    if killed.noticed_s > NOTICED_LIMIT_S:
        raise ValueError(f"noticed only after {killed.noticed_s:.2f} s")
    left = _left(killed.folder)
    report.making += any(killed.folder.glob(f"*{UNFINISHED_SUFFIX}"))
    report.inside_flush += left is not None and _is_torn(left.path)
    if not all(gone(process_id) for process_id in killed.children):
        raise ValueError("processes of the dead engine go on")
    began_s = time.monotonic()
    found = recover_folder(killed.folder)
    report.recover_s.append(time.monotonic() - began_s)
    if not found:  # before it was armed, or after the run was safe
        report.without_file += left is None
        report.whole += left is not None
        if left is not None:
            _check_rows(left, stand, sent)
        return
    run = _recovered(found, killed.folder)
    if run is None:
        report.without_file += 1
        return
    report.without_file += left is None
    report.rows += len(run)
    report.rows_added += len(run) - (len(left) if left is not None else 0)
    if left is not None and len(left) > len(run):
        raise ValueError(f"{len(left)} rows were there, {len(run)} are left")
    next_sample = _check_rows(run, stand, sent)
    if run.end is not None and run.end.ended == "interrupted":
        readable = killed.sent.samples if readable_samples is None else readable_samples
        report.lost_s.append(max(0, readable - next_sample) / killed.sent.rate_hz)
        if report.lost_s[-1] > LOST_LIMIT_S:
            raise ValueError(f"the last {report.lost_s[-1] * 1e3:.0f} ms before the kill are lost")


def _left(folder: Path) -> Run | None:
    """The run file as the dead engine's writer leaves it; it must open."""
    deadline = time.monotonic() + _WRITER_S
    time.sleep(0.05)
    while any(is_being_recorded(path) for path in folder.glob("*.h5")):
        if time.monotonic() > deadline:
            raise TimeoutError("the writer of the dead engine does not end")
        time.sleep(0.02)
    files = list(folder.glob("*.h5"))
    return open_run(files[0]) if files else None


def _is_torn(path: Path) -> bool:
    with h5py.File(path) as file:
        return not is_finished(file) and len(file[TIME]) > file[STORED][()]


def _recovered(found: list[Recovery], folder: Path) -> Run | None:
    (recovery,) = found
    if recovery.state is RecoveryState.EMPTY:
        return None
    if recovery.state not in (RecoveryState.RECOVERED, RecoveryState.WHOLE) or recovery.kept:
        raise ValueError(f"recover says: {recovery}")
    left_over = sorted(path.name for path in folder.iterdir())
    if left_over != [Path(recovery.run).name]:
        raise ValueError(f"the folder holds {left_over}")
    return open_run(recovery.run)


def _check_rows(run: Run, stand: SimulatedStand, sent: Sent) -> int:
    """Hold all rows against what was sent; return the sample after the last."""
    counts = load_counts(run)
    assert counts is not None
    return sent.check(truth_of_now(stand), counts, run.status)


def _wait_for(engine: EngineClient, kind: type[Event], patience_s: float = 60.0) -> Event:
    deadline = time.monotonic() + patience_s
    while time.monotonic() < deadline:
        event = engine.wait(0.02)
        match event:
            case kind():
                return event
            case Failed(message):
                raise ValueError(f"the engine failed: {message}")
    raise TimeoutError(f"no {kind.__name__} within {patience_s:g} s")


def main() -> int:
    """Run the drill in all its forms and print what came of it."""
    parser = arguments(__doc__, 200)
    parser.add_argument("--keep", type=Path, default=None, help="folder for the runs, which are kept")
    given = parser.parse_args()
    return run_ways(
        given.count,
        {
            f"{kind} at {rate_hz:g} Hz": partial(kill_engine, rate_hz=rate_hz, kind=kind, seed=given.seed)
            for kind in KINDS
            for rate_hz in RATES_HZ
        },
        given.keep,
    )


if __name__ == "__main__":
    sys.exit(main())
