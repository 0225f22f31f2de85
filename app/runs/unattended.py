"""Recordings that went on when the program that had begun them was gone, told by the next window.

The engine leaves a note in the user's data folder, which stays until somebody has read it.
"""

import contextlib
import datetime
import uuid
from pathlib import Path

import msgspec

from app.runs.disk import atomic_write, make_folder
from app.runs.errors import RunError
from app.runs.paths import user_data_folder
from messages.message import EMPTY, Message

_SUFFIX = ".json"


class UnattendedRun(msgspec.Struct, frozen=True):
    """How a recording ended that nobody followed."""

    directory: str  # of the runs
    ended: str  # why, as in the run file
    end_time: datetime.datetime
    path: str = ""
    """Of the run; empty where nothing was recorded."""
    series: str = ""
    message: Message = EMPTY


def leave_note(run: UnattendedRun) -> None:
    """Leave a note; where it cannot be written, nobody is told."""
    folder = _notes_folder()
    with contextlib.suppress(RunError):
        make_folder(folder)
        with atomic_write(folder / f"{uuid.uuid4()}{_SUFFIX}") as made:
            made.write_bytes(msgspec.json.encode(run))


def read_notes(directory: Path) -> dict[Path, UnattendedRun]:
    """Notes on recordings in a folder of runs by their files, the earliest first.

    Notes on runs that are gone are removed.
    """
    notes, paths = {}, list[Path]()
    with contextlib.suppress(OSError):
        paths = list(_notes_folder().glob(f"*{_SUFFIX}"))
    for path in paths:
        with contextlib.suppress(OSError, msgspec.MsgspecError):
            run = msgspec.json.decode(path.read_bytes(), type=UnattendedRun)
            if run.path and not Path(run.path).exists():
                remove_note(path)
            elif Path(run.directory) == directory.absolute():
                notes[path] = run
    return dict(sorted(notes.items(), key=lambda note: note[1].end_time))


def remove_note(path: Path) -> None:
    """Remove a note that was read."""
    with contextlib.suppress(OSError):
        path.unlink()


def _notes_folder() -> Path:
    return user_data_folder() / "unattended"
