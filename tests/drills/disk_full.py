"""Drill: the disk fills up during a run; `python -m tests.drills.disk_full --count 100`.

Each run must end with its reason, the file hold what was sent row by row, the journal the rest, and so many
be told as are held. Ways:
`limit` lets the system refuse to let a file grow (RLIMIT_FSIZE, Linux), the run's, the journal's or both;
`filled` fills a small disk (tmpfs, where this user may mount one) at once; `filling` fills it gradually, so
that the run should be ended in good order while there is room.
"""

import contextlib
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from app.acquisition.engine_client import EngineClient
from app.acquisition.journal.records import read_summary
from app.acquisition.journal.recovery import RecoveryState, recover_folder
from app.acquisition.messages import (
    Arm,
    Connected,
    EndReason,
    PortSettings,
    RunEnded,
    RunSettings,
    RunStarted,
    StateChanged,
)
from app.runs.journal import find_journals
from app.runs.reader import load_counts, open_run
from app.simulated_stand.client import SimulatedStand
from app.simulated_stand.options import SimulatedStandOptions
from config.files import settings_file
from tests.drills.report import DrillReport, arguments, run_ways
from tests.drills.sent import Sent, truth_of_now
from tests.drills.starving import Starving
from tests.drills.unplug import wait_for

RATE_HZ = 2000.0
DURATION_S = 20.0
"""Of the runs, if nothing ended them: they fit on the small disk, or they would be refused."""
WITHIN_S = (0.2, 1.5)
DISK_MB = 24
WAYS = ("limit", "filled", "filling")


@dataclass(slots=True)
class DiskReport(DrillReport):
    """What came of it."""

    runs: int = 0
    samples: int = 0
    """That the engine took."""
    in_file: int = 0
    recovered: int = 0
    """In the file, or in what was recovered from the journal where that stayed."""
    whole: int = 0
    """Runs that were closed in time, the received bytes included."""
    moved: int = 0
    """Journals that went on in another place."""
    lost_runs: int = 0
    """Runs that were told to have lost what neither file nor journal took."""

    def figures(self) -> str:
        return (
            f"{self.runs} runs, {self.samples} samples taken, {self.in_file} in the files,"
            f" {self.recovered} with what the journals hold; {self.whole} closed in time,"
            f" {self.moved} journals moved; {self.lost_runs} runs told what neither took"
        )


@dataclass(frozen=True, slots=True)
class Bench:
    """What a run is recorded with."""

    engine: EngineClient
    stand: SimulatedStand
    sent: Sent
    folder: Path
    refuge: Path


def may_mount() -> bool:
    """Tell whether this user may mount a small disk."""
    if sys.platform != "linux" or os.geteuid() != 0:
        return False
    with tempfile.TemporaryDirectory(prefix="slipstand-drill-") as place:
        try:
            with small_disk(Path(place)):
                return True
        except (OSError, subprocess.CalledProcessError):
            return False


def disk_full(
    count: int, folder: Path, way: str, seed: int | None = None, starve: tuple[str, ...] = ()
) -> DiskReport:
    """Let the disk be full once in each of `count` runs in an empty folder, in one of `WAYS`.

    Programs of `starve` (`tests.drills.starving.ROLES`) are stopped now and then meanwhile.
    """
    report, moments = DiskReport(), random.Random(seed)
    with bench_in(folder, way) as bench:
        for number in range(count):
            try:
                with Starving(moments, starve):
                    _one_run(bench, way, moments, report)
            except (ValueError, TimeoutError, OSError) as error:
                report.faults.append(f"run {number}, {way}: {error}")
            for left in (*bench.folder.iterdir(), *bench.refuge.rglob("*.journal")):
                left.unlink()
    return report


def recorded(bench: Bench, folder: Path) -> RunEnded:
    """Record a short run into a folder, with nothing going wrong but that."""
    bench.engine.send(Arm(RunSettings(str(folder), series="1FFM0", trigger="none", duration_s=0.3)))
    ended = wait_for(bench.engine, RunEnded)
    assert isinstance(ended, RunEnded)
    return ended


@contextlib.contextmanager
def bench_in(place: Path, way: str) -> Iterator[Bench]:
    """A stand and an engine; the runs go to a small disk of its own, unless `way` is `limit`."""
    folder, refuge, temporary = place / "runs", place / "refuge", place / "refuge" / "tmp"
    folder.mkdir()
    temporary.mkdir(parents=True)
    disk = contextlib.nullcontext() if way == "limit" else small_disk(folder)
    options = SimulatedStandOptions(rate_hz=RATE_HZ, seed=1, table_drift_m_per_s=1e-3)
    files = (str(settings_file("stand.toml")), str(settings_file("gauges.toml")))
    data_home, temp = environment("XDG_DATA_HOME", str(refuge)), environment("TMPDIR", str(temporary))
    with disk, SimulatedStand.start(options) as stand, data_home, temp:
        port = PortSettings(url=stand.port, protocol=options.protocol)
        with EngineClient.start(port, *files) as engine:
            wait_for(engine, Connected)
            yield Bench(engine, stand, Sent(), folder, refuge)


@contextlib.contextmanager
def small_disk(folder: Path, options: str = f"size={DISK_MB}m") -> Iterator[None]:
    """Mount a disk in memory with such options of tmpfs on a folder."""
    subprocess.run(
        ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(folder)], check=True, capture_output=True
    )
    try:
        yield
    finally:
        subprocess.run(["umount", str(folder)], check=True, capture_output=True)


@contextlib.contextmanager
def environment(name: str, value: str) -> Iterator[None]:
    before = os.environ.get(name)
    os.environ[name] = value
    try:
        yield
    finally:
        if before is None:
            del os.environ[name]
        else:
            os.environ[name] = before


def _one_run(bench: Bench, way: str, moments: random.Random, report: DiskReport) -> None:
    run = RunSettings(str(bench.folder), series="1FFM0", trigger="none", duration_s=DURATION_S)
    bench.engine.send(Arm(run))
    started = wait_for(bench.engine, RunStarted)
    assert isinstance(started, RunStarted)
    time.sleep(moments.uniform(*WITHIN_S))
    with _WAYS[way](bench, Path(started.path), moments):
        ended = wait_for(bench.engine, RunEnded)
    wait_for(bench.engine, StateChanged)
    assert isinstance(ended, RunEnded)
    _check(bench, ended, report)


@contextlib.contextmanager
def _limited(bench: Bench, run: Path, moments: random.Random) -> Iterator[None]:
    """Let the run, its journal, or both grow by a little and no more."""
    import resource

    (journal,) = find_journals(bench.folder)
    engine = bench.engine.process_id
    chosen = moments.choice(("run", "journal", "both"))
    no_limit = resource.RLIM_INFINITY

    def limit(process: int, size: int) -> None:
        _, hard = resource.prlimit(process, resource.RLIMIT_FSIZE)
        resource.prlimit(process, resource.RLIMIT_FSIZE, (size, hard))

    writers = [child for child in _children(engine) if _is_writer(child)]
    if chosen in ("run", "both"):
        for writer in writers:
            limit(writer, run.stat().st_size + moments.randrange(200_000))
    if chosen in ("journal", "both"):
        limit(engine, journal.stat().st_size + moments.randrange(20_000))
    try:
        yield
    finally:
        limit(engine, no_limit)


def _children(process: int) -> list[int]:
    tasks = Path(f"/proc/{process}/task")
    return [int(child) for task in tasks.iterdir() for child in (task / "children").read_text().split()]


def _is_writer(process: int) -> bool:
    return b"app.runs.writer" in Path(f"/proc/{process}/cmdline").read_bytes()


@contextlib.contextmanager
def _filled(bench: Bench, run: Path, moments: random.Random) -> Iterator[None]:
    """Fill the disk at once, up to a little."""
    left = moments.randrange(600_000)
    with _filler(bench) as filler:
        filler.write(bytes(max(0, shutil.disk_usage(bench.folder).free - left)))
        yield


@contextlib.contextmanager
def _filling(bench: Bench, run: Path, moments: random.Random) -> Iterator[None]:
    """Fill the disk by 4 MB a second, to what a run needs to be closed."""
    with _filler(bench) as filler:
        while shutil.disk_usage(bench.folder).free > 6_000_000:
            filler.write(bytes(400_000))
            time.sleep(0.1)
        yield


@contextlib.contextmanager
def _filler(bench: Bench) -> Iterator[object]:
    path = bench.folder / "filler"
    with path.open("wb", buffering=0) as file:
        yield file
    path.unlink()


_WAYS: dict[str, Callable[..., contextlib.AbstractContextManager[None]]] = {
    "limit": _limited,
    "filled": _filled,
    "filling": _filling,
}


def _check(bench: Bench, ended: RunEnded, report: DiskReport) -> None:
    """Hold the run, and what its journal gives, against what was sent."""
    report.runs += 1
    report.samples += ended.samples
    if ended.ended is not EndReason.DISK_FULL:
        raise ValueError(f"ended {ended.ended}: {ended.message}")
    in_file = _checked_rows(bench, Path(ended.path))
    report.in_file += in_file
    places = [*find_journals(bench.folder)]
    if bench.refuge.is_dir():
        places += find_journals(bench.refuge)
    if not places:
        report.whole += 1
        report.recovered += in_file
        if in_file != ended.samples:
            raise ValueError(f"{ended.samples - in_file} samples are gone with their journal")
        return
    (journal,) = places
    report.moved += bench.refuge in journal.parents
    if str(journal) not in str(ended.message) and ended.samples != in_file:
        raise ValueError(f"nobody is told of {journal.name}: {ended.message}")
    held = max(_recovered_rows(bench, journal), in_file)
    report.recovered += held
    # A journal too full for the note of the end may have reads that were decoded no more.
    is_more = held > ended.samples and read_summary(journal).ended is not None
    if held < ended.samples or is_more:
        raise ValueError(f"{ended.samples} samples were told, {held} are held: {ended.message}")
    report.lost_runs += "are lost" in str(ended.message)


def _checked_rows(bench: Bench, path: Path) -> int:
    run = open_run(path)
    if len(run):
        bench.sent.check(truth_of_now(bench.stand), load_counts(run), run.status)
    return len(run)


def _recovered_rows(bench: Bench, journal: Path) -> int:
    """Rows of the run that the journal alone gives."""
    with tempfile.TemporaryDirectory(prefix="slipstand-drill-") as place:
        shutil.copy(journal, place)
        (recovery,) = recover_folder(Path(place))
        if recovery.state is not RecoveryState.RECOVERED:
            raise ValueError(f"{journal.name} is {recovery.state}: {recovery.message}")
        return _checked_rows(bench, Path(recovery.run))


def main() -> int:
    """Run the drill in all ways that are possible here, and print what came of it."""
    given = arguments(__doc__, 100).parse_args()
    ways = [way for way in WAYS if sys.platform == "linux" and (way == "limit" or may_mount())]
    return run_ways(given.count, {way: partial(disk_full, way=way, seed=given.seed) for way in ways})


if __name__ == "__main__":
    sys.exit(main())
