"""Drill: a computer lacks something; `python -m tests.drills.resources`. Linux only, most ways as root.

A run is recorded, an analysis saved, a folder watched, and the window opened and closed, each while there are
20 or 10 open files at most, no room for another file on the disk of the runs, before the run or within it,
no room in /dev/shm or no such memory, no folder of temporary files that can be written, or 1.5 GB of address
space. Each must end well, or with one line that names the remedy. What was recorded must be there, a file
that was to change must be whole, and no process stay.
"""

import argparse
import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from app.acquisition.journal.recovery import RecoveryState, recover_folder
from app.runs.reader import load_counts, open_run
from app.simulated_stand.client import SimulatedStand
from app.simulated_stand.options import SimulatedStandOptions
from config.files import settings_file
from tests.drills.disk_full import may_mount, small_disk
from tests.drills.report import DrillReport, chosen_ways, run_ways
from tests.drills.sent import Sent, truth_of_now

RATE_HZ = 500.0
DURATION_S = 2.0
PATIENCE_S = 120.0
WINDOW_S = 12.0
"""For which a window is open: its processes have started and compiled code is loaded by then."""
_MARK = "SLIPSTAND_DRILL"
_SLIPSTAND = Path(sys.executable).with_name("slipstand")

_LIMIT = 'limit=$1; shift; ulimit {option} "$limit"; exec "$@"'
_PRIVATE = "mount --make-rprivate /; "
_READ_ONLY = "mount --bind /tmp /tmp; mount -o remount,ro,bind /tmp; "
_BUT_FOR = 'mount --bind "$0" "$0"; mount -o remount,rw,bind "$0"; exec "$@"'
_MEMORY_DISK = "mount -t tmpfs -o {options} tmpfs /dev/shm; {then} exec " + '"$@"'


def _limited(option: str, limit: int) -> list[str]:
    return ["sh", "-c", _LIMIT.format(option=option), "sh", str(limit)]


def _mounted(script: str) -> list[str]:
    return ["unshare", "-m", "sh", "-c", _PRIVATE + script]


PREFIXES: dict[str, Callable[[Path], list[str]]] = {
    "20 files": lambda _: _limited("-n", 20),
    "10 files": lambda _: _limited("-n", 10),
    "1.5 GB": lambda _: _limited("-v", 1_500_000),
    "/dev/shm full": lambda _: [
        *_mounted(_MEMORY_DISK.format(options="size=64k", then="head -c 1M /dev/zero >/dev/shm/f 2>&-;")),
        "sh",
    ],
    "/dev/shm read-only": lambda _: [*_mounted(_MEMORY_DISK.format(options="ro", then="")), "sh"],
    "/tmp read-only": lambda place: [*_mounted(_READ_ONLY + _BUT_FOR), str(place)],
}
"""What a command is started with so that it lacks something; its arguments follow."""
LATER = "no files later"
DISKS = {"no files": "size=64m,nr_inodes=3", LATER: "size=64m,nr_inodes=40"}
"""Options of the disk of the runs. Later: as many are left at first, and all are taken within the run."""
WITHOUT_ROOT = ("20 files", "10 files", "1.5 GB")
WAYS = (*PREFIXES, *DISKS)
REMEDIES = {"20 files": "ulimit", "10 files": "ulimit", "no files": "Remove some files"}
REMEDIES[LATER] = REMEDIES["no files"]
"""What the line of a command that could not do it must say."""


@dataclass(slots=True)
class ResourceReport(DrillReport):
    """What came of one program that lacked something."""

    code: int | None = None
    said: str = ""
    took_s: float = 0.0
    samples: int = 0

    def figures(self) -> str:
        return f"exit {self.code} after {self.took_s:.1f} s, {self.samples} samples; {self.said}"


@dataclass(frozen=True, slots=True)
class Trial:
    """A program and the folders that it works in."""

    way: str
    place: Path
    """Everything else lies in it."""
    report: ResourceReport

    @property
    def runs(self) -> Path:
        return self.place / "runs"

    def run(self, *arguments: str, ends_s: float | None = None) -> subprocess.CompletedProcess[str]:
        """Run a command without its resource, and check how it ended.

        `ends_s` is when it is asked to end, where it does not by itself. Raises ValueError.
        """
        prefix = PREFIXES[self.way](self.place) if self.way in PREFIXES else []
        with self._environment() as (environment, mark):
            start_s = time.monotonic()
            process = subprocess.Popen(
                [*prefix, str(_SLIPSTAND), *arguments],
                stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                env=environment, cwd=self.place,
            )  # fmt: skip
            if ends_s is not None:
                threading.Timer(ends_s, process.send_signal, (signal.SIGTERM,)).start()
            try:
                output, errors = process.communicate(timeout=PATIENCE_S)
            except subprocess.TimeoutExpired:
                process.kill()
                raise ValueError(f"no end within {PATIENCE_S:g} s") from None
            self.report.code, self.report.took_s = process.returncode, time.monotonic() - start_s
            self._check_ended(errors, mark, good=(0,) if ends_s is None else (130,))
        return subprocess.CompletedProcess(arguments, process.returncode, output, errors)

    @contextlib.contextmanager
    def _environment(self) -> Iterator[tuple[dict[str, str], str]]:
        mark = uuid.uuid4().hex
        homes = ("XDG_DATA_HOME", "XDG_STATE_HOME", "XDG_CACHE_HOME", "SLIPSTAND_CONFIG")
        yield (
            os.environ
            | {name: str(self.place / name.lower()) for name in homes}
            | {_MARK: mark, "QT_QPA_PLATFORM": "offscreen"},
            mark,
        )

    def _check_ended(self, errors: str, mark: str, good: tuple[int, ...]) -> None:
        lines = [line for line in errors.replace("\r", "\n").splitlines() if line.startswith("error: ")]
        self.report.said = " | ".join(lines)
        if "Traceback" in errors or "Fatal" in errors or "Errno" in errors:
            raise ValueError(f"said {errors[-1000:]!r}")
        if self.report.code not in (*good, 1):
            raise ValueError(f"ended with {self.report.code}: {errors[-1000:]!r}")
        if self.report.code == 1 and (len(lines) != 1 or REMEDIES.get(self.way, "none") not in lines[0]):
            raise ValueError(f"no line with a remedy: {errors[-1000:]!r}")
        deadline_s = time.monotonic() + 10.0
        while left := _marked_processes(mark):
            if time.monotonic() > deadline_s:
                raise ValueError(f"processes stay: {left}")
            time.sleep(0.05)


def _marked_processes(mark: str) -> list[int]:
    """Processes with a value in their environment, and so those that one of them started."""
    found = []
    for listed in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if f"{_MARK}={mark}".encode() in (listed / "environ").read_bytes().split(b"\0"):
                found.append(int(listed.name))
    return found


def _record(trial: Trial) -> None:
    options = SimulatedStandOptions(rate_hz=RATE_HZ, seed=1, tcp_port=0, table_drift_m_per_s=1e-3)
    with SimulatedStand.start(options) as stand:
        taking = _TakeFiles(trial.runs) if trial.way == LATER else contextlib.nullcontext()
        with taking:
            done = trial.run(
                *("record", "--port", stand.port, "--protocol", options.protocol, "--trigger", "none"),
                *("--duration", str(DURATION_S), "--directory", str(trial.runs), "--json"),
            )
        for folder in (trial.runs, trial.place / "xdg_data_home" / "Slipstand" / "journals"):
            if folder.is_dir():
                for recovery in recover_folder(folder):
                    if recovery.state is not RecoveryState.RECOVERED:
                        raise ValueError(f"{recovery.journal} is {recovery.state}: {recovery.message}")
        sent = Sent()
        for path in trial.place.rglob("*.h5"):
            run = open_run(path)
            sent.check(truth_of_now(stand), load_counts(run), run.status)  # type: ignore[arg-type]
            trial.report.samples += len(run)
    told = json.loads(done.stdout)["samples"] if done.stdout else 0
    is_begun = "Recording:" in done.stderr
    if trial.report.samples < max(told, DURATION_S * RATE_HZ if is_begun else 0):
        raise ValueError(f"{trial.report.samples} samples are there: {done.stderr[-1000:]!r}")


class _TakeFiles:
    """Takes all room for files in a folder as soon as a run is in it, while it is used with `with`."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._take, name="files", daemon=True)

    def __enter__(self) -> None:
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        self._is_over.set()
        self._thread.join()
        for path in self._folder.glob("taken-*"):
            path.unlink()

    def _take(self) -> None:
        while not any(self._folder.glob("*.h5")) and not self._is_over.wait(0.02):
            pass
        with contextlib.suppress(OSError):
            for number in range(1000):
                (self._folder / f"taken-{number}").touch()


def _simulated(folder: Path, name: str) -> Path:
    """A simulated record, made with all that there is."""
    path = folder / name
    command = [str(_SLIPSTAND), "simulate", "--series", "1FFM0", "--friction", "0.1", "-o", str(path)]
    subprocess.run(command, check=True, capture_output=True)
    return path


def _save(trial: Trial) -> None:
    path = trial.runs / "run.h5"
    shutil.copy(_simulated(trial.place, "run.h5"), path)
    done = trial.run("analyze", "--save", str(path))
    run = open_run(path)
    trial.report.samples = len(run)
    if len(run.analyses) != (done.returncode == 0):
        raise ValueError(f"{len(run.analyses)} analyses are in a run after exit {done.returncode}")
    _check_left(trial.runs, {"run.h5"})


def _watch(trial: Trial) -> None:
    path = trial.runs / "run.csv"
    shutil.copy(_simulated(trial.place, "run.csv"), path)
    columns = ("--time", "time_s", "--table", "table_displacement_m")
    done = trial.run("watch", str(trial.runs), *columns, "--relative", "relative_displacement_m", "--once")
    made = [open_run(one) for one in (trial.runs / "runs").glob("*.h5")]
    trial.report.samples = sum(map(len, made))
    is_refused = "error: " in done.stderr
    if is_refused and trial.report.code == 0 and REMEDIES.get(trial.way, "none") not in done.stderr:
        raise ValueError(f"no line with a remedy: {done.stderr[-1000:]!r}")
    if len(made) != (not is_refused):
        raise ValueError(f"{len(made)} runs are there: {done.stderr[-1000:]!r}")
    _check_left(trial.runs, {"run.csv", "runs", "run.h5"})


def _window(trial: Trial) -> None:
    trial.run("--simulated", ends_s=WINDOW_S)


def _check_left(folder: Path, names: set[str]) -> None:
    if more := {path.name for path in folder.rglob("*")} - names:
        raise ValueError(f"left behind: {more}")


PROGRAMS: dict[str, Callable[[Trial], None]] = {
    "record": _record,
    "save": _save,
    "watch": _watch,
    "window": _window,
}


def lacking(program: str, way: str, place: Path) -> ResourceReport:
    """Let a program of `PROGRAMS` lack something of `WAYS`, in an empty folder."""
    report = ResourceReport()
    trial = Trial(way, place, report)
    trial.runs.mkdir()
    shutil.copytree(settings_file("stand.toml").parent, place / "slipstand_config")
    try:
        with small_disk(trial.runs, DISKS[way]) if way in DISKS else contextlib.nullcontext():
            PROGRAMS[program](trial)
    except (ValueError, TimeoutError, OSError) as error:
        report.faults.append(f"{program}, {way}: {error}")
    return report


def possible_ways() -> list[str]:
    """Ways that this user may try here."""
    if sys.platform != "linux":
        return []
    return [way for way in WAYS if way in WITHOUT_ROOT or may_mount()]


def main() -> int:
    """Run the drill with each program in all ways that are possible here, and print what came of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--programs", default=",".join(PROGRAMS), help="separated by commas")
    parser.add_argument("--ways", default=",".join(possible_ways()), help="separated by commas")
    given = parser.parse_args()
    cases = [
        (program, way)
        for program in given.programs.split(",")
        for way in chosen_ways(parser, given.ways, WAYS)
        if not ((way == LATER and program != "record") or (program == "window" and way in DISKS))
    ]
    return run_ways(
        len(cases),
        {
            f"{program}, {way}": lambda _, folder, program=program, way=way: lacking(program, way, folder)
            for program, way in cases
        },
    )


if __name__ == "__main__":
    sys.exit(main())
