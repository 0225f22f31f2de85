"""Where runs are kept."""

import contextlib
import datetime
import errno
import getpass
import os
import re
import sys
import tempfile
from pathlib import Path

import platformdirs

import config
from config.durable_files import make_folders
from config.files import is_checkout, load_settings
from config.schema import Settings

TRASH = ".trash"  # folder beside runs that holds those moved to the trash
RECORDINGS = "SLIPSTAND_RECORDINGS"  # variable that says where runs are kept, before all settings


def run_stem(start_time: datetime.datetime | None, series: str | None) -> str:
    """What stands before the number in the name of a run: `20261121T143205_1FFM0`."""
    start = "" if start_time is None else start_time.strftime("%Y%m%dT%H%M%S")
    return f"{start}_{series}" if series else start


def next_run_number(folder: Path, series: str | None) -> int:
    """Number after that of the last run of a series in a folder, or of the last run without a series.

    A folder that cannot be listed has no runs.
    """
    of_series = f"_{re.escape(series)}" if series else ""
    name = re.compile(rf"\d{{8}}T\d{{6}}{of_series}_(\d{{3,5}})\.h5")
    with contextlib.suppress(OSError):
        found = [name.fullmatch(entry.name) for entry in folder.iterdir()]
        return max((int(match[1]) for match in found if match), default=0) + 1
    return 1


def user_data_folder() -> Path:
    """Folder of what the program keeps for a user beside runs and settings; it need not exist."""
    return platformdirs.user_data_path("Slipstand", appauthor=False)


def journal_fallback_folders() -> list[Path]:
    """Folders that a journal moves to when the folder of its run fails: data folder, then temporary files."""
    return [
        user_data_folder() / "journals",
        Path(tempfile.gettempdir()) / f"slipstand-journals-{getpass.getuser()}",
    ]


def make_private_folder(folder: Path) -> None:
    """Make a folder that only this user may enter. Raises OSError where it is another user's, or a link."""
    make_folders(folder.parent)
    with contextlib.suppress(FileExistsError):
        folder.mkdir(0o700)
    if not is_own_folder(folder):
        raise PermissionError(errno.EPERM, os.strerror(errno.EPERM), str(folder))


def is_own_folder(folder: Path) -> bool:
    """Tell whether a folder is there and this user's: among temporary files anybody makes names."""
    if folder.is_symlink() or not folder.is_dir():
        return False
    return sys.platform == "win32" or folder.stat().st_uid == os.geteuid()


def journal_folders(runs: Path) -> list[Path]:
    """Folders that exist where journals of runs in one folder may lie: itself, and where they move to."""
    fallbacks = [folder for folder in journal_fallback_folders() if is_own_folder(folder)]
    return [folder for folder in (runs, *fallbacks) if folder.is_dir()]


def recordings_directory(settings: Settings | None = None) -> Path:
    """Folder of the runs, which need not exist yet. Raises ConfigError.

    `SLIPSTAND_RECORDINGS`, else the folder of the settings, else `recordings/` when run from a checkout, else
    `Slipstand/recordings` in the user's documents.
    """
    override = os.environ.get(RECORDINGS)
    if override:
        return Path(override).expanduser().resolve()
    chosen = (settings or load_settings()).recordings
    if chosen:
        return Path(chosen).expanduser().resolve()
    if is_checkout():
        return Path(config.__file__).resolve().parent.parent / "recordings"
    return Path(platformdirs.user_documents_dir()) / "Slipstand" / "recordings"
