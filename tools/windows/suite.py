"""The tests on Windows under Wine, part by part; the counts of each part are kept until it is run again."""

import re
import subprocess
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import msgspec

from tools.windows.environment import PROJECT, WindowsEnvironment

PARTS: Mapping[str, Sequence[str]] = {
    "configuration": ("tests/config", "tests/messages"),
    "simulated stand": ("tests/app/simulated_stand",),
    "drivers": ("tests/drivers",),
    "acquisition, a to k": ("tests/app/acquisition/test_[a-k]*.py",),
    "acquisition, l to q": ("tests/app/acquisition/test_[l-q]*.py",),
    "acquisition, r to z": ("tests/app/acquisition/test_[r-z]*.py",),
    "runs, a to n": ("tests/app/runs/test_[a-n]*.py",),
    "runs, o to z": ("tests/app/runs/test_[o-z]*.py",),
    "exchange": ("tests/app/runs/exchange",),
    "campaigns": ("tests/app/runs/campaign", "tests/analysis/campaign"),
    "processes": ("tests/app/runs/batch", "tests/app/test_*.py"),
    "command line, a to c": ("tests/app/cli/test_[a-c]*.py",),
    "command line, d to h": ("tests/app/cli/test_[d-h]*.py",),
    "command line, i to r": ("tests/app/cli/test_[i-r]*.py",),
    "command line, s to z": ("tests/app/cli/test_[s-z]*.py",),
    "presenters": ("tests/app/presenters",),
    "window, a to h": ("tests/app/qt/test_[a-h]*.py",),
    "window, i": ("tests/app/qt/test_i*.py",),
    "window, j to q": ("tests/app/qt/test_[j-q]*.py",),
    "window, r": ("tests/app/qt/test_r*.py",),
    "window, s to z": ("tests/app/qt/test_[s-z]*.py",),
    "reports": ("tests/app/reports",),
    "analysis, of one mass": ("tests/analysis/one_mass",),
    "analysis, its folders": ("tests/analysis/[!cdo_]*/", "tests/analysis/calibration"),
    "analysis, a to n": ("tests/analysis/test_[a-n]*.py",),
    "analysis, o": ("tests/analysis/test_o*.py",),
    "analysis, p to r": ("tests/analysis/test_[p-r]*.py",),
    "analysis, s to z": ("tests/analysis/test_[s-z]*.py",),
    "drills": ("tests/drills",),
    "package and pages": ("tests/slipstand", "tests/test_*.py"),
    "house": ("tests/house",),
}
"""Files and folders of each part, as patterns. What stands before a comma is one line of the table."""
SUMMARY_NAME = "tests.json"
_TEST_S = 300.0  # Wine opens files slowly, and some tests open thousands
_WORKERS = "3"  # most tests wait for processes
_DASK = "tests/app/runs/batch/test_dask_executor.py"
"""Its cluster does not start under Wine, and the test would wait for it."""
_OUTCOME = "(PASSED|FAILED|ERROR|SKIPPED|XFAIL)"
_ENDED = re.compile(rf"(?m)^\[gw\d+\] \[ *\d+%\] {_OUTCOME} (tests/\S+?::.*?) *$")
_SELECTED = re.compile(r"\[(\d+) items?\]")


@dataclass(frozen=True)
class PartResult:
    """What the tests of a part gave; `not_run` are those after the end of its time, or of its process."""

    part: str
    date: str
    commit: str
    passed: int
    failed: tuple[str, ...]
    skipped: int
    not_run: int
    took_s: float


def run_part(environment: WindowsEnvironment, part: str, folder: Path, limit_s: float) -> PartResult:
    """Run a part of PARTS, or files and folders separated by blanks, and keep its counts and its log.

    After `limit_s` it is ended. Those in real time are left out: most of them need a pseudo-terminal.
    """
    paths = paths_of(part)
    if not paths:
        raise FileNotFoundError(f"no tests: {part}. Name one of {', '.join(PARTS)}, or files")
    began_s, commit = time.perf_counter(), _commit()
    try:
        ended = environment.run_python(
            "-m", "pytest", "-vv", "-m", "not peer and not realtime", "-rfE", "--tb=short",
            "--timeout", f"{_TEST_S:g}", "-n", _WORKERS, "--dist", "loadfile", "--deselect", _DASK,
            *(path.relative_to(PROJECT).as_posix() for path in paths), timeout_s=limit_s,
        )  # fmt: skip
        said = ended.stdout + ended.stderr
    except subprocess.TimeoutExpired as error:
        said = (error.stdout or b"").decode(errors="replace")
    found = read_result(part, said, time.perf_counter() - began_s, commit)
    folder.mkdir(parents=True, exist_ok=True)
    log_path(folder, part).write_text(said, encoding="utf-8")
    (folder / SUMMARY_NAME).write_bytes(msgspec.json.encode(_kept(folder) | {part: found}))
    return found


def paths_of(part: str) -> list[Path]:
    """Files and folders of a part of PARTS, or those that it names itself."""
    patterns = PARTS.get(part) or part.split()
    return sorted({path for pattern in patterns for path in PROJECT.glob(pattern)})


def table(folder: Path) -> str:
    """Table of what was kept of the parts, in Markdown."""
    rows: dict[str, list[PartResult]] = {}
    for part, kept in _kept(folder).items():
        rows.setdefault(part.partition(",")[0], []).append(kept)
    head = "| part | passed | failed | skipped | not run | s | date, commit |"
    return "\n".join([head, "|---|---|---|---|---|---|---|", *map(_row, rows, rows.values()), ""])


def log_path(folder: Path, part: str) -> Path:
    """Path of what pytest wrote of a part."""
    return folder / f"{re.sub(r'[^a-z0-9]+', '-', part.lower())[:100]}.log"


def read_result(part: str, said: str, took_s: float, commit: str) -> PartResult:
    """Counts of what pytest said, also where it was ended before it counted."""
    outcomes = {test: outcome for outcome, test in _ENDED.findall(said)}  # an error of its end comes last
    failed = tuple(test for test, outcome in outcomes.items() if outcome in {"FAILED", "ERROR"})
    passed = sum(outcome in {"PASSED", "XFAIL"} for outcome in outcomes.values())
    counted = _SELECTED.search(said)
    selected = int(counted[1]) if counted else 0
    return PartResult(
        part=part,
        date=f"{datetime.now(UTC):%Y-%m-%d}",
        commit=commit,
        passed=passed,
        failed=failed,
        skipped=len(outcomes) - passed - len(failed),
        not_run=selected - len(outcomes),
        took_s=took_s,
    )


def _row(name: str, parts: Sequence[PartResult]) -> str:
    passed, failed = sum(part.passed for part in parts), sum(len(part.failed) for part in parts)
    skipped, not_run = sum(part.skipped for part in parts), sum(part.not_run for part in parts)
    took_s = sum(part.took_s for part in parts)
    when = ", ".join(dict.fromkeys(f"{part.date} `{part.commit}`" for part in parts))
    return f"| {name} | {passed:,} | {failed} | {skipped} | {not_run} | {took_s:.0f} | {when} |"


def _kept(folder: Path) -> dict[str, PartResult]:
    """Results of parts of PARTS, in their order."""
    path = folder / SUMMARY_NAME
    if not path.exists():
        return {}
    kept = msgspec.json.decode(path.read_bytes(), type=dict[str, PartResult])
    return {part: kept[part] for part in PARTS if part in kept}


def _commit() -> str:
    command = ["git", "describe", "--always", "--dirty"]
    return subprocess.run(command, cwd=PROJECT, check=True, capture_output=True, text=True).stdout.strip()
