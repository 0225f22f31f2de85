"""The folder for Windows, and the installer that NSIS makes of it; on Linux by Windows' Python under Wine."""

import shutil
import sys
from pathlib import Path

from app.version import __version__
from tools.packages.folder import (
    DIST,
    FREEZER,
    PACKAGING,
    PROJECT,
    locked_requirements,
    make_folder,
    make_wheel,
    run,
    size_mb,
    windows_icon,
)
from tools.windows.__main__ import default_folder
from tools.windows.environment import INSIDE, WindowsEnvironment

INSTALLER_NAME = f"slipstand-{__version__}-windows-x86_64-setup.exe"


def make_windows_installer() -> Path:
    """Build the folder and the installer of it."""
    if shutil.which("makensis") is None:
        raise SystemExit("error: makensis, which packs the installer, is not here. Install NSIS")
    return make_installer(make_windows_folder())


def make_windows_folder(environment: WindowsEnvironment | None = None) -> Path:
    """Build the folder, on Windows by its own Python, elsewhere under Wine."""
    if sys.platform == "win32":
        return make_folder()
    inside = environment or WindowsEnvironment(default_folder().absolute())
    inside.prepare()
    python = inside.prepare_builder(locked_requirements(), make_wheel(), FREEZER)
    place = inside.inside / "build"
    shutil.rmtree(place, ignore_errors=True)
    shutil.copytree(PACKAGING, place / "packaging")
    shutil.copy(windows_icon(), place / "packaging")
    variables = {"SLIPSTAND_ICON": "slipstand.ico"}
    for arguments in (
        ("-m", "PyInstaller", "--noconfirm", "--log-level", "ERROR", "--distpath", "..", "slipstand.spec"),
        (
            "-m",
            "compileall",
            "-q",
            "--invalidation-mode",
            "unchecked-hash",
            "../slipstand/_internal/slipstand",
        ),
    ):
        command = [
            "sh",
            "-c",
            'cd "$0" && exec "$@"',
            f"{INSIDE}/build/packaging",
            "wine",
            python,
            *arguments,
        ]
        ended = inside.run(command, variables=variables)
        if ended.returncode:
            raise SystemExit(f"error: {arguments[1]}: {(ended.stderr or ended.stdout).strip()[-2000:]}")
    return place / "slipstand"


def make_installer(folder: Path) -> Path:
    """Pack the folder into an installer."""
    DIST.mkdir(exist_ok=True)
    target = DIST / INSTALLER_NAME
    defines = {
        "VERSION": __version__, "FOLDER": str(folder), "TARGET": str(target), "ICON": str(windows_icon()),
        "LICENSE": str(PROJECT / "LICENSE"), "KILOBYTES": str(round(size_mb(folder) * 1e6 / 1024)),
    }  # fmt: skip
    run(["makensis", "-V2", *(f"-D{name}={value}" for name, value in defines.items()),
         str(PACKAGING / "windows" / "slipstand.nsi")])  # fmt: skip
    return target
