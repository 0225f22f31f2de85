"""The clock that stamps what arrives, and the one that dates runs."""

import datetime
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import app
from app.cli.checkup.finding import Finding, ok, warn
from drivers.host_time import host_ns

_READS = 2000
_COARSE_NS = 1_000_000


def check_clocks() -> Iterator[Finding]:
    """Look at resolution and date."""
    yield resolution([host_ns() for _ in range(_READS)])
    program = datetime.datetime.fromtimestamp(Path(app.__file__).stat().st_mtime, datetime.UTC)
    yield date(datetime.datetime.now().astimezone(), program)


def resolution(reads_ns: list[int]) -> Finding:
    """Judge consecutive readings of the clock that stamps arrivals."""
    steps = [after - before for before, after in pairwise(reads_ns)]
    forward = [step for step in steps if step > 0]
    if min(steps) < 0 or not forward:
        fault = "goes back" if min(steps) < 0 else "stands still"
        return warn("clock", f"the clock that stamps samples {fault}", "Check the computer's clock source")
    finest_ns = min(forward)
    if finest_ns > _COARSE_NS:
        return warn(
            "clock",
            f"the clock that stamps samples goes in steps of {finest_ns / 1e6:.0f} ms",
            "Use a newer system; until then the time base is less certain",
        )
    return ok("clock", f"steps of {finest_ns} ns or less")


def date(now: datetime.datetime, program: datetime.datetime) -> Finding:
    """Judge the date: it cannot be before that of the program's own files."""
    said = now.isoformat(timespec="seconds")
    if now < program - datetime.timedelta(days=1):
        return warn(
            "date",
            f"{said} is before the program was installed",
            "Set the computer's date, or runs are misdated",
        )
    return ok("date", said)
