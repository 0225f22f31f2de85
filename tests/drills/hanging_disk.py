"""Drill: the disk of a run hangs, as a network share does; `python -m tests.drills.hanging_disk --count 10`.

The folder of the runs is mounted through bindfs, a FUSE file system whose process is stopped: every call on
the folder then waits. Or only syncs of its files wait, as a library loaded into the engine has them do
(`preload.c`), while writes go on. The operator must be told within 2 s, the run end within 10 s, and another
run be armed elsewhere at once. On the folder itself arming must be refused, while samples go on. When the
disk is back, all samples that were told must be rebuilt.
"""

import contextlib
import itertools
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

from app.acquisition.engine_client import EngineClient
from app.acquisition.journal.recovery import RecoveryState, recover_folder
from app.acquisition.messages import (
    Arm,
    Connected,
    EndReason,
    Health,
    PortSettings,
    RunEnded,
    RunSettings,
    RunStarted,
    StateChanged,
)
from app.runs.reader import load_counts, open_run
from app.simulated_stand.client import SimulatedStand
from app.simulated_stand.options import SimulatedStandOptions
from config.files import settings_file
from tests.drills.disk_full import environment
from tests.drills.preload import SYNC, build_library, has_compiler
from tests.drills.report import DrillReport, arguments
from tests.drills.sent import Sent, truth_of_now
from tests.drills.unplug import wait_for

RATE_HZ = 500.0
TOLD_S, ENDED_S = 2.0, 10.0
FALLBACK = "fallback"


@dataclass(slots=True)
class HangReport(DrillReport):
    """What came of it."""

    runs: int = 0
    told_s: list[float] = field(default_factory=list)
    ended_s: list[float] = field(default_factory=list)
    refused_s: list[float] = field(default_factory=list)
    samples: int = 0
    """Of the runs, all of which were rebuilt."""

    def figures(self) -> str:
        return (
            f"{self.runs} runs: told after {max(self.told_s, default=0):.1f} s, ended after"
            f" {max(self.ended_s, default=0):.1f} s, arming refused after"
            f" {max(self.refused_s, default=0):.1f} s at most; {self.samples} samples rebuilt"
        )


def has_bindfs() -> bool:
    """Tell whether a folder can be mounted through bindfs here."""
    if sys.platform != "linux" or shutil.which("bindfs") is None or not os.access("/dev/fuse", os.W_OK):
        return False
    with tempfile.TemporaryDirectory(prefix="slipstand-drill-") as place:
        try:
            with HangingDisk(Path(place)):
                return True
        except (OSError, subprocess.CalledProcessError, TimeoutError):
            return False


class HangingDisk:
    """A folder whose file system can be stopped; a context manager."""

    def __init__(self, place: Path) -> None:
        self.folder = place / "share"
        self._behind = place / "behind"
        for folder in (self.folder, self._behind):
            folder.mkdir()

    def __enter__(self) -> "HangingDisk":
        command = ["bindfs", "-f", "--no-allow-other", str(self._behind), str(self.folder)]
        self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        deadline_s = time.monotonic() + 10.0
        while not os.path.ismount(self.folder):
            if time.monotonic() > deadline_s or self._process.poll() is not None:
                raise TimeoutError("bindfs does not start")
            time.sleep(0.02)
        return self

    def __exit__(self, *_: object) -> None:
        self.go_on()
        subprocess.run(["umount", "-l", str(self.folder)], check=False, capture_output=True)
        self._process.terminate()
        self._process.wait(10.0)

    def hang(self) -> None:
        self._process.send_signal(signal.SIGSTOP)

    def go_on(self) -> None:
        self._process.send_signal(signal.SIGCONT)


class HangingSync:
    """A folder whose files take writes and no syncs while it hangs; an engine is to be started within it."""

    def __init__(self, place: Path) -> None:
        self.folder = place / "share"
        self.folder.mkdir()
        self._mark = self.folder / ".hangs"
        self._library = build_library(place)

    def __enter__(self) -> "HangingSync":
        self._environment = contextlib.ExitStack()
        self._environment.enter_context(environment("LD_PRELOAD", str(self._library)))
        self._environment.enter_context(environment(SYNC, str(self._mark)))
        return self

    def __exit__(self, *_: object) -> None:
        self.go_on()
        self._environment.close()

    def hang(self) -> None:
        self._mark.touch()

    def go_on(self) -> None:
        self._mark.unlink(missing_ok=True)


Disk = HangingDisk | HangingSync
KINDS: dict[str, type[HangingDisk] | type[HangingSync]] = {"disk": HangingDisk, "sync": HangingSync}


def hanging_disk(count: int, folder: Path, kind: str = "disk") -> HangReport:
    """Let the disk hang in each of `count` runs in an empty folder."""
    report = HangReport()
    options = SimulatedStandOptions(rate_hz=RATE_HZ, seed=1)
    files = (str(settings_file("stand.toml")), str(settings_file("gauges.toml")))
    with SimulatedStand.start(options) as stand:
        port = PortSettings(url=stand.port, protocol=options.protocol)
        for number in range(count):
            place = folder / str(number)
            place.mkdir()
            with (
                KINDS[kind](place) as disk,
                environment("XDG_DATA_HOME", str(place / FALLBACK)),
                EngineClient.start(port, *files) as engine,
            ):
                try:
                    _one_run(disk, engine, place, stand, report)
                except (ValueError, TimeoutError, OSError) as error:
                    report.faults.append(f"run {number}: {error}")
                disk.go_on()
    return report


def _one_run(
    disk: Disk, engine: EngineClient, place: Path, stand: SimulatedStand, report: HangReport
) -> None:
    wait_for(engine, Connected)
    run = RunSettings(str(disk.folder), series="1FFM0", trigger="none", duration_s=60.0)
    engine.send(Arm(run))
    wait_for(engine, RunStarted)
    time.sleep(0.5)
    disk.hang()
    began_s = time.monotonic()
    report.told_s.append(_await_note(engine, "takes nothing", began_s))
    ended = wait_for(engine, RunEnded)
    report.ended_s.append(time.monotonic() - began_s)
    assert isinstance(ended, RunEnded)
    if ended.ended is not EndReason.WRITE_ERROR or "recover" not in str(ended.message):
        raise ValueError(f"ended as {ended.ended}: {ended.message}")
    began_s = time.monotonic()
    engine.send(Arm(run))
    samples = _health(engine)
    refused = wait_for(engine, RunEnded)
    report.refused_s.append(time.monotonic() - began_s)
    if refused.path or _health(engine) <= samples:  # type: ignore[attr-defined]
        raise ValueError("arming held up the engine")
    elsewhere = RunSettings(str(place / "elsewhere"), series="1FFM0", trigger="none", duration_s=0.2)
    engine.send(Arm(elsewhere))
    good = wait_for(engine, RunEnded)
    if good.ended is not EndReason.DURATION:  # type: ignore[attr-defined]
        raise ValueError(f"the next run ended as {good.ended}: {good.message}")  # type: ignore[attr-defined]
    disk.go_on()
    folders = (disk.folder, place / FALLBACK / "Slipstand" / "journals")
    _check_rebuilt(folders, stand, ended, report)
    slow = [s for s, limit_s in ((report.told_s[-1], TOLD_S), (report.ended_s[-1], ENDED_S)) if s > limit_s]
    if slow:
        raise ValueError(f"too slow: {slow}")


def _await_note(engine: EngineClient, text: str, began_s: float) -> float:
    while time.monotonic() - began_s < 30.0:
        event = engine.wait(0.05)
        if isinstance(event, StateChanged) and text in str(event.note):
            return time.monotonic() - began_s
        if event is not None and isinstance(event, RunEnded):
            raise ValueError(f"ended without a word before, {event.ended}: {event.message}")
    raise TimeoutError("nothing was told")


def _health(engine: EngineClient) -> int:
    event = wait_for(engine, Health)
    assert isinstance(event, Health)
    return event.samples


def _check_rebuilt(
    folders: tuple[Path, Path], stand: SimulatedStand, ended: RunEnded, report: HangReport
) -> None:
    """Recover both journals; the two runs must hold all samples that were told, without a hole."""
    deadline_s = time.monotonic() + 30.0
    while any(folders[0].glob("*.recording")) and time.monotonic() < deadline_s:
        time.sleep(0.1)  # what was waited for is written, and the locks are released
    parts: list[tuple[int, int]] = []
    for recovery in (found for folder in folders for found in recover_folder(folder)):
        if recovery.state is RecoveryState.EMPTY:  # nothing came after the disk was left
            continue
        if not recovery.run:
            raise ValueError(f"{recovery.journal}: {recovery.state}, {recovery.message}")
        run = open_run(Path(recovery.run))
        counts = load_counts(run)
        assert counts is not None
        end = Sent().check(truth_of_now(stand), counts, run.status)
        parts.append((end - len(run), end))
    report.runs += 1
    holes = [after[0] - before[1] for before, after in itertools.pairwise(parts) if after[0] > before[1]]
    samples = parts[-1][1] - parts[0][0] if parts else 0
    report.samples += samples
    if holes or samples < ended.samples:
        raise ValueError(f"{samples} samples of {ended.samples}, less {holes}, are rebuilt: {ended.message}")


def main() -> int:
    """Run the drill and print what came of it."""
    given = arguments(__doc__, 10).parse_args()
    if not has_bindfs() or not has_compiler():
        sys.stdout.write("bindfs or cc is absent, or bindfs may not mount here\n")
        return 1
    faults = 0
    for kind in KINDS:
        with tempfile.TemporaryDirectory(prefix="slipstand-drill-") as folder:
            report = hanging_disk(given.count, Path(folder), kind)
        sys.stdout.write(f"{kind}: {report}\n")
        faults += len(report.faults)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
