"""Drill: the power fails while files are written; `python -m tests.drills.power_loss --count 2000`.

A run is recorded, edited, analysed, moved to the trash and back; settings, calibrations, checks, an index and
an export are written. strace logs each call. `disk_states` builds from these what a cut may leave on the
disk at any moment. Of each such state all that was synced before the cut must come back, all that was told
must hold, each file must open, and `recover` must leave no journal.
"""

import argparse
import datetime
import os
import random
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from app.acquisition.engine_client import EngineClient
from app.acquisition.errors import RecoveryError
from app.acquisition.journal.rebuild import Replay
from app.acquisition.journal.records import Opened, read_summary
from app.acquisition.journal.recovery import RecoveryState, recover_folder
from app.acquisition.messages import Arm, Connected, PortSettings, RunEnded, RunSettings
from app.runs.blocks import CalibratedBlock
from app.runs.disk import make_folder
from app.runs.edits import edit_run
from app.runs.errors import RunError
from app.runs.exchange.exporting import ExportRequest, export_runs
from app.runs.file_operations import move_to_trash, restore_from_trash
from app.runs.listing import index_path, list_runs
from app.runs.reader import Run, load_counts, open_run
from app.runs.saved_analyses import save_analysis
from app.runs.validator import shared_validator
from app.simulated_stand.client import SimulatedStand
from app.simulated_stand.options import SimulatedStandOptions
from config import files
from config.schema import ConfigError, GaugeCheck, Settings
from tests.app.runs.runs_kit import ANALYSIS
from tests.drills.disk_states import WAYS, Disk
from tests.drills.report import DrillReport, arguments
from tests.drills.system_calls import has_strace, log_calls
from tests.drills.unplug import wait_for

_HARMLESS = (".tmp", ".editing")
"""Files that `doctor` names when they are old, and locks, which nobody holds after a cut."""
DAY = datetime.date(2026, 1, 12)
RATE_HZ = 500.0
DURATION_S = 0.8


@dataclass(slots=True)
class PowerReport(DrillReport):
    """What came of it."""

    states: int = 0
    recovered: int = 0
    whole: int = 0
    """Journals of which the run file had everything."""
    samples: int = 0
    """Synced before the cut, in all states; each was there afterwards."""
    more: int = 0
    """Samples that were there beyond these."""
    kept_aside: int = 0
    """Files that held nothing readable, of which recovery told."""

    def figures(self) -> str:
        return (
            f"{self.states} states: {self.recovered} runs recovered, {self.whole} whole,"
            f" {self.kept_aside} torn files kept aside; {self.samples} samples had been synced or told and"
            f" are there, {self.more} more"
        )


def work(root: Path, told_path: Path, port: str, protocol: str) -> None:
    """Do all that is logged, and tell in a file of its own when a step has ended."""
    with told_path.open("w", buffering=1) as told:

        def tell(step: str) -> None:
            told.write(f"{step}\n")

        runs = root / "runs"
        path = _record(runs, port, protocol, tell)
        edit_run(path, "operator", note="edited")
        tell("edited")
        save_analysis(path, ANALYSIS, "hash")
        tell("analysed")
        trashed = move_to_trash(path)
        tell("trashed")
        tell("restoring")
        restore_from_trash(trashed)
        tell("restored")
        list_runs(runs)
        tell("listed")
        _write_settings(tell)
        make_folder(root / "exports")
        (outcome,) = export_runs(
            [path], root / "exports" / "run.csv", ExportRequest("csv", content="samples")
        )
        assert outcome.files, outcome.error
        tell("exported")


def _record(runs: Path, port: str, protocol: str, tell) -> Path:
    settings = RunSettings(str(runs), series="1FFM0", trigger="none", duration_s=DURATION_S)
    names = (str(files.settings_file("stand.toml")), str(files.settings_file("gauges.toml")))
    with EngineClient.start(PortSettings(url=port, protocol=protocol), *names) as engine:
        wait_for(engine, Connected)
        engine.send(Arm(settings))
        ended = wait_for(engine, RunEnded)
    assert isinstance(ended, RunEnded)
    tell(f"recorded {ended.samples} {Path(ended.path).name}")
    return Path(ended.path)


def _write_settings(tell) -> None:
    for operator in ("A", "B"):
        files.save_settings(Settings(operator=operator), DAY)
        tell(f"settings {operator}")
    gauges = files.load_gauges()
    made = files.save_calibration({"table": gauges.table}, files.settings_file("gauges.toml"), DAY)
    tell(f"calibration {made.name}")
    files.activate_calibration(made, DAY)
    tell("activated")
    at = datetime.datetime(2026, 1, 12, tzinfo=datetime.UTC)
    for number in (1, 2):
        files.append_check(GaugeCheck("table", at, True, 1e-3, 1e-3, 1e-5, 1e-9))
        tell(f"checked {number}")


class Log:
    """What was logged of `work`, and the run as it was in the end."""

    def __init__(self, place: Path) -> None:
        root, logs = place / "disk", place / "calls"
        for folder in (root, logs):
            folder.mkdir()
        options = SimulatedStandOptions(rate_hz=RATE_HZ, seed=1)
        with SimulatedStand.start(options) as stand:
            given = [str(root), str(place / "told"), stand.port, options.protocol]
            command = [sys.executable, "-m", "tests.drills.power_loss", "--work", *given]
            folders = {"SLIPSTAND_CONFIG": root / "config", "XDG_CACHE_HOME": root / "cache"}
            with environment({name: str(path) for name, path in folders.items()}):
                self.disk = Disk(root, log_calls(command, logs))
        self.disk.check()
        (path,) = (root / "runs").glob("*.h5")
        ((_, self._journal),) = self.disk.named(r"\.journal$")
        self._journal_named_s = self.disk.named_since_s(self._journal)
        self._needed: dict[int, int] = {}
        self._place = place / "prefix.journal"
        rows, opened = self._decoded(len(self._journal.writes))
        assert opened is not None
        self.start = opened.start_index - rows[0].first_index
        self.received = np.concatenate([block.counts for block in rows]).astype(np.int32)
        """Counts of all samples in the journal, also from before and after the run."""
        self.samples = len(open_run(path))
        self.place_of(open_run(path))

    def _decoded(self, count: int) -> tuple[list[CalibratedBlock], Opened | None]:
        self._place.write_bytes(self._journal.contents(count))
        summary = read_summary(self._place)
        return [read.rows for read in Replay(summary) if read.rows is not None], summary.opened

    def place_of(self, run: Run) -> int:
        """Number of the first sample of a run among those received. Raises ValueError for any other."""
        counts = load_counts(run)
        assert counts is not None
        starts = np.flatnonzero((self.received == counts[0]).all(axis=1)) if len(counts) else [self.start]
        for start in starts:
            if np.array_equal(self.received[start : start + len(counts)], counts):
                return int(start)
        raise ValueError(f"{run.path.name} has samples that were not received")

    def synced_samples(self, at_s: float) -> int:
        """Samples of the run in the part of the journal that was synced before a cut."""
        if at_s < self._journal_named_s:
            return 0
        count = self._journal.synced(at_s)
        if count not in self._needed:
            rows, opened = self._decoded(count)
            samples = sum(map(len, rows)) - self.start if opened else 0
            self._needed[count] = max(0, min(self.samples, samples))
        return self._needed[count]


@contextmanager
def environment(values: dict[str, str]) -> Iterator[None]:
    before = dict(os.environ)
    os.environ.update(values)
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)


def power_loss(count: int, folder: Path, seed: int = 0) -> PowerReport:
    """Record once in an empty folder; cut the power at `count` moments, in all ways in turn."""
    report, chance, log = PowerReport(), random.Random(seed), Log(folder)
    moments = log.disk.moments
    for number in range(count):
        at_s, way = moments[int((number + chance.random()) / count * len(moments))], WAYS[number % len(WAYS)]
        with tempfile.TemporaryDirectory(dir=folder, prefix="state-") as place:
            log.disk.make(Path(place), at_s, way, chance)
            try:
                _check(Path(place), at_s, log, report)
            except (ValueError, OSError, RunError, ConfigError, RecoveryError) as error:
                moment = f"state {number}, {way}, {at_s - moments[0]:.6f} s"
                report.faults.append(f"{moment}, told {log.disk.told_by(at_s)[-1:]}: {error}")
        report.states += 1
    return report


def _check(root: Path, at_s: float, log: Log, report: PowerReport) -> None:
    told = log.disk.told_by(at_s)
    _check_runs(root / "runs", told, log, log.synced_samples(at_s), report)
    with environment({"SLIPSTAND_CONFIG": str(root / "config"), "XDG_CACHE_HOME": str(root / "cache")}):
        _check_settings(root / "config", told)
        if "listed" in told:
            msgspec.msgpack.decode(index_path(Path(log.disk.root) / "runs").read_bytes())
    exports = list((root / "exports").glob("*")) if (root / "exports").is_dir() else []
    if "exported" in told and [path.name for path in exported(exports)] != ["run.csv"]:
        raise ValueError("the export is gone")
    for path in exported(exports):
        if len(path.read_text("utf-8").splitlines()) < log.samples:
            raise ValueError(f"{path.name} is cut off")


def exported(paths: list[Path]) -> list[Path]:
    """Those that are not hidden."""
    return [path for path in paths if not path.name.startswith(".")]


def _check_runs(folder: Path, told: list[str], log: Log, synced: int, report: PowerReport) -> None:
    is_stored = any(line.startswith("recorded") for line in told)
    needed = log.samples if is_stored else synced
    report.samples += needed
    if not folder.is_dir():
        if needed:
            raise ValueError(f"the folder of {needed} samples is gone")
        return
    aside = []
    for recovery in recover_folder(folder):
        if recovery.state is RecoveryState.FAILED:
            if needed:
                raise ValueError(f"not recovered: {recovery.message}")
            aside.append(Path(recovery.journal).name)
        report.recovered += recovery.state is RecoveryState.RECOVERED
        report.whole += recovery.state is RecoveryState.WHOLE
        report.kept_aside += bool(recovery.kept)
        aside += [Path(recovery.kept).name] if recovery.kept else []
    paths = [path for path in folder.rglob("*.*") if not path.name.endswith(_HARMLESS) and path.is_file()]
    names = [path.name for path in paths if path.suffix != ".h5" and path.name not in aside]
    if names:
        raise ValueError(f"left behind: {names}")
    runs = [open_run(path, validator=shared_validator()) for path in paths if path.suffix == ".h5"]
    there = 0
    for run in runs:
        place = log.place_of(run)
        there = max(there, place + len(run) - log.start if place <= log.start else 0)
    if there < needed:
        raise ValueError(f"{there} samples of {needed} came back")
    report.more += there - needed
    _check_changes(folder, runs, told)


def _check_changes(folder: Path, runs: list[Run], told: list[str]) -> None:
    """What was changed after the recording, and where the run lies."""
    if not runs:
        return
    if "edited" in told and any(run.metadata.note != "edited" for run in runs):
        raise ValueError("the edit is gone")
    if "analysed" in told and any(len(run.analyses) != 1 for run in runs):
        raise ValueError("the analysis is gone")
    places = [run.path.parent.name for run in runs]
    if told[-1:] == ["trashed"] and ".trash" not in places:
        raise ValueError("the run is not in the trash")
    if "restored" in told and places != ["runs"]:
        raise ValueError(f"the run is in {places}")


def _check_settings(folder: Path, told: list[str]) -> None:
    operator = files.load_settings().operator
    if (last := [line.split()[1] for line in told if line.startswith("settings")]) and operator < last[-1]:
        raise ValueError(f"settings {last[-1]} are gone")
    checks = len(files.load_checks().check)
    if checks < sum(line.startswith("checked") for line in told):
        raise ValueError(f"only {checks} checks are left")
    for path in folder.glob("gauges*.toml"):
        files.load_gauges(path)
    kept = [line.split()[1] for line in told if line.startswith("calibration")]
    if not all((folder / name).is_file() for name in kept):
        raise ValueError("the calibration is gone")
    if "activated" in told and not (folder / "gauges.toml").is_file():
        raise ValueError("the active calibration is gone")


def main() -> int:
    """Run the drill, or do what it logs, and print what came of it."""
    parser = arguments(__doc__, 2000, 0)
    parser.add_argument("--work", nargs=4, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.work:
        root, told, port, protocol = given.work
        work(Path(root), Path(told), port, protocol)
        return 0
    if not has_strace():
        sys.stdout.write("strace is absent, or may not be used here\n")
        return 1
    with tempfile.TemporaryDirectory(prefix="slipstand-drill-") as folder:
        report = power_loss(given.count, Path(folder), given.seed)
    sys.stdout.write(f"{report}\n")
    return 1 if report.faults else 0


if __name__ == "__main__":
    sys.exit(main())
