"""Versions, libraries, the process that examines run files, and where compiled code is kept."""

import datetime
import os
import platform
from collections.abc import Callable, Iterator
from importlib import metadata, util
from itertools import pairwise
from pathlib import Path

import analysis
import app
from app.cli.doctor import Finding, fail, ok, warn
from app.runs.disk import is_writable
from app.runs.errors import RunError
from app.version import version_text
from drivers.host_time import host_ns

_NEEDED = {name: name for name in ("numpy", "scipy", "numba", "h5py", "msgspec", "tomlkit", "matplotlib")}
_NEEDED |= {"rich": "rich", "pyserial": "serial"}
_OF_WINDOW = {"PySide6-Essentials": "PySide6", "pyqtgraph": "pyqtgraph"}
_AGAIN = "Install again: pip install --force-reinstall slipstand"


def check_installation() -> Iterator[Finding]:
    """Look at versions, libraries, the examining process and the cache of compiled code."""
    yield ok("slipstand", f"{version_text()}, Python {platform.python_version()} on {platform.platform()}")
    yield _libraries("libraries", _NEEDED, fail)
    yield _libraries("window", _OF_WINDOW, warn)
    yield _validator()
    yield check_compiled_code(Path(analysis.__file__).parent)


def _libraries(subject: str, wanted: dict[str, str], bad: Callable[[str, str, str], Finding]) -> Finding:
    absent = [name for name, module in wanted.items() if util.find_spec(module) is None]
    if absent:
        return bad(subject, f"{', '.join(absent)} cannot be found", _AGAIN)
    return ok(subject, ", ".join(f"{name} {_version(name)}" for name in wanted))


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "of unknown version"


def _validator() -> Finding:
    try:
        from app.runs.validator import check_validator  # needs h5py, which may be what is missing

        check_validator()
    except (ImportError, RunError, OSError) as error:
        return fail("examining runs", f"the process that examines run files does not work ({error})", _AGAIN)
    return ok("examining runs", "the process that examines run files works")


def check_compiled_code(package: Path) -> Finding:
    """Where numba keeps what it compiled: in a given folder, beside the code, or in the user's cache."""
    subject, given = "compiled code", os.environ.get("NUMBA_CACHE_DIR")
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        fault = "NUMBA_DISABLE_JIT is set: analyses take minutes"
        return warn(subject, fault, "Remove it from the environment")
    if given and _is_writable(Path(given)):
        return ok(subject, f"kept in {given} (NUMBA_CACHE_DIR)")
    if given:
        fault = f"NUMBA_CACHE_DIR {given} cannot be written"
        return warn(subject, fault, "Choose another folder, or unset it")
    if _is_writable(package / "__pycache__"):
        return ok(subject, f"kept beside the code in {package.parent}")
    return ok(subject, "kept in the user's cache, since the folder of the program is read-only")


def _is_writable(folder: Path) -> bool:
    there = next((place for place in (folder, *folder.parents) if place.exists()), folder)
    return is_writable(there)


_READS = 2000
_COARSE_NS = 1_000_000


def check_clocks() -> Iterator[Finding]:
    """Look at resolution and date."""
    yield check_resolution([host_ns() for _ in range(_READS)])
    program = datetime.datetime.fromtimestamp(Path(app.__file__).stat().st_mtime, datetime.UTC)
    yield check_date(datetime.datetime.now().astimezone(), program)


def check_resolution(reads_ns: list[int]) -> Finding:
    """Judge consecutive readings of the clock that stamps arrivals."""
    subject = "clock"
    steps = [after - before for before, after in pairwise(reads_ns)]
    finest_ns = min((step for step in steps if step > 0), default=0)
    if min(steps) < 0 or not finest_ns:
        fault = "goes back" if min(steps) < 0 else "stands still"
        return warn(subject, f"the clock that stamps samples {fault}", "Check the computer's clock source")
    if finest_ns > _COARSE_NS:
        fault = f"the clock that stamps samples goes in steps of {finest_ns / 1e6:.0f} ms"
        return warn(subject, fault, "Use a newer system; until then the time base is less certain")
    return ok(subject, f"steps of {finest_ns} ns or less")


def check_date(now: datetime.datetime, program: datetime.datetime) -> Finding:
    """Judge the date: it cannot be before that of the program's own files."""
    shown = now.isoformat(timespec="seconds")
    if now < program - datetime.timedelta(days=1):
        fault = f"{shown} is before the program was installed"
        return warn("date", fault, "Set the computer's date, or runs are misdated")
    return ok("date", shown)
