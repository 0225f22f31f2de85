"""Versions, libraries, the process that examines run files, and where compiled code is kept."""

import os
import platform
import sys
from collections.abc import Callable, Iterator
from importlib import metadata, util
from pathlib import Path

import analysis
from app.cli.checkup.finding import Finding, fail, ok, warn
from app.runs.errors import RunError
from app.version import __version__

_NEEDED = {
    "numpy": "numpy",
    "scipy": "scipy",
    "numba": "numba",
    "h5py": "h5py",
    "pyserial": "serial",
    "msgspec": "msgspec",
    "tomlkit": "tomlkit",
    "matplotlib": "matplotlib",
    "rich": "rich",
}
_OF_WINDOW = {"PySide6-Essentials": "PySide6", "pyqtgraph": "pyqtgraph"}
_AGAIN = "Install again: pip install --force-reinstall slipstand"


def check_installation() -> Iterator[Finding]:
    """Look at versions, libraries, the examining process and the cache of compiled code."""
    yield ok("slipstand", f"{__version__}, Python {platform.python_version()} on {platform.platform()}")
    yield _libraries("libraries", _NEEDED, fail)
    yield _libraries("window", _OF_WINDOW, warn)
    yield _examiner()
    yield compiled_code(Path(analysis.__file__).parent)


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


def _examiner() -> Finding:
    try:
        from app.runs.self_check import check_examiner  # needs h5py, which may be what is missing

        check_examiner()
    except (ImportError, RunError, OSError) as error:
        return fail("examining runs", f"the process that examines run files does not work ({error})", _AGAIN)
    return ok("examining runs", "the process that examines run files works")


def compiled_code(package: Path) -> Finding:
    """Where numba keeps what it compiled: in a given folder, beside the code, or in the user's cache."""
    subject = "compiled code"
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        return warn(
            subject, "NUMBA_DISABLE_JIT is set: analyses take minutes", "Remove it from the environment"
        )
    given = os.environ.get("NUMBA_CACHE_DIR")
    if given:
        place = Path(given)
        if _is_writable(place):
            return ok(subject, f"kept in {place} (NUMBA_CACHE_DIR)")
        return warn(
            subject, f"NUMBA_CACHE_DIR {place} cannot be written", "Choose another folder, or unset it"
        )
    if _is_writable(package / "__pycache__"):
        return ok(subject, f"kept beside the code in {package.parent}")
    return ok(subject, "kept in the user's cache, since the folder of the program is read-only")


def _is_writable(folder: Path) -> bool:
    """Tell whether a folder can be written, or made."""
    there = next((place for place in (folder, *folder.parents) if place.exists()), folder)
    return there.is_dir() and os.access(there, os.W_OK | (0 if sys.platform == "win32" else os.X_OK))
