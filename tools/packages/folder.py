"""The wheel, and one folder with the program, its Python and its libraries, which PyInstaller makes.

The folder runs on systems with the C library of the one it is made on, or a later one.
"""

import os
import re
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Sequence
from pathlib import Path

from app.version import __version__

PROJECT = Path(__file__).resolve().parents[2]
BUILD, DIST = PROJECT / "build" / "packages", PROJECT / "dist"
PACKAGING = PROJECT / "packaging"
ICON = PROJECT / "app" / "qt" / "slipstand.svg"
EXTRAS = ("exchange", "mdf", "lsl")
"""Of the package: those that a program without pip could not be given later."""
FREEZER = "pyinstaller>=6.16,<7"
ICON_SIZES = (16, 24, 32, 48, 64, 128, 256)


def make_wheel() -> Path:
    """Build the wheel into `dist`."""
    shutil.rmtree(PROJECT / "build" / "lib", ignore_errors=True)  # files of an earlier build would be packed
    shutil.rmtree(PROJECT / "build" / "bdist", ignore_errors=True)
    pip = [sys.executable, "-m", "pip", "wheel", "--quiet", "--disable-pip-version-check", "--no-deps"]
    run([*pip, "--no-build-isolation", "--wheel-dir", str(DIST), str(PROJECT)])
    return DIST / f"slipstand-{__version__}-py3-none-any.whl"


def make_folder() -> Path:
    """Build the folder for the system that this runs on."""
    environment = BUILD / "environment"
    python = environment / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    requirements = locked_requirements()
    wheel = make_wheel()
    run([*uv(), "venv", "--quiet", "--clear", "--python", sys.executable, str(environment)])
    install = [*uv(), "pip", "install", "--quiet", "--python", str(python)]
    run([*install, "--require-hashes", "--requirement", str(requirements)])
    run([*install, "--no-deps", str(wheel)])
    run([*install, FREEZER])
    freeze([str(python)])
    folder = BUILD / "slipstand"
    add_bytecode([str(python)], folder)
    return folder


def freeze(python: Sequence[str], icon: str | None = None, distribution: str | None = None) -> None:
    """Run PyInstaller by a Python that has the program installed."""
    variables = os.environ | {"SLIPSTAND_ICON": icon or str(windows_icon())}
    places = ["--distpath", distribution or str(BUILD), "--workpath", str(BUILD / "work")]
    options = ["--noconfirm", "--log-level", "ERROR", *places, "slipstand.spec"]
    run([*python, "-m", "PyInstaller", *options], cwd=PACKAGING, variables=variables)


def add_bytecode(python: Sequence[str], folder: Path) -> None:
    """Compile our modules, which users who may not write there would compile at each start."""
    modules = folder / "_internal" / "slipstand"
    run([*python, "-m", "compileall", "-q", "--invalidation-mode", "unchecked-hash", str(modules)])


def locked_requirements() -> Path:
    """Requirements of the program and of `EXTRAS` at the versions of requirements.lock, with their hashes."""
    BUILD.mkdir(parents=True, exist_ok=True)
    target = BUILD / "requirements.txt"
    extras = [word for extra in EXTRAS for word in ("--extra", extra)]
    options = ["--quiet", "--universal", "--generate-hashes", "--no-header", "--no-annotate", *extras]
    constraints = ["--constraint", str(PROJECT / "requirements.lock")]
    run([*uv(), "pip", "compile", *options, *constraints, str(PROJECT / "pyproject.toml"), "-o", str(target)])
    if strange := set(_pins(target)) - set(_pins(PROJECT / "requirements.lock")):
        raise SystemExit(f"error: not in requirements.lock: {', '.join(sorted(strange))}. Run: make lock")
    return target


def windows_icon() -> Path:
    """The icon in the sizes that Windows asks for, drawn from the one of the window."""
    from PIL import Image

    target = BUILD / "slipstand.ico"
    images = [Image.open(png_icon(size)) for size in ICON_SIZES]
    images[-1].save(target, append_images=images[:-1], sizes=[(size, size) for size in ICON_SIZES])
    return target


def png_icon(size: int) -> Path:
    """The icon of the window in one size."""
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    from PySide6.QtGui import QGuiApplication, QIcon

    application = QGuiApplication.instance() or QGuiApplication([])
    target = BUILD / f"slipstand-{size}.png"
    target.parent.mkdir(parents=True, exist_ok=True)
    if not QIcon(str(ICON)).pixmap(size, size).save(str(target)):
        raise SystemExit(f"error: {target} cannot be written by {application}")
    return target


def uv() -> list[str]:
    """Command of uv, which `make packages` installs beside this Python."""
    return [str(Path(sysconfig.get_path("scripts")) / "uv")]


def run(command: Sequence[str], *, cwd: Path | None = None, variables: dict[str, str] | None = None) -> str:
    """Run a command; its last lines are the error if it fails."""
    ended = subprocess.run(
        command, cwd=cwd, env=variables, check=False, capture_output=True, text=True, errors="replace"
    )
    if ended.returncode:
        last = (ended.stderr or ended.stdout).strip()[-2000:]
        raise SystemExit(f"error: {' '.join(command[:4])} ended with {ended.returncode}:\n{last}")
    return ended.stdout


def size_mb(path: Path) -> float:
    """Size of a file or of all files in a folder, links not followed."""
    files = [path] if path.is_file() else [file for file in path.rglob("*") if not file.is_symlink()]
    return sum(file.stat().st_size for file in files if file.is_file()) / 1e6


def _pins(requirements: Path) -> list[str]:
    return re.findall(r"(?m)^(\S+==\S+)", requirements.read_text(encoding="utf-8"))
