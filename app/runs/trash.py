"""Runs are never deleted: they are moved to the folder `.trash` beside them, and can come back."""

import contextlib
from pathlib import Path

from app.runs.disk import storage_error, sync_folder
from app.runs.errors import BeingRecordedError, RunNotFoundError, UnsuitableRunError, WriteError
from app.runs.lock import is_being_recorded
from app.runs.schema import SUFFIX

TRASH = ".trash"
_NAMES_MAX = 1000


def move_to_trash(path: Path) -> Path:
    """Move a run to the trash of its folder, and return where it lies now.

    Raises
    ------
    RunNotFoundError, BeingRecordedError, WriteError
    UnsuitableRunError
        It is in the trash already, is a link, or is not named like a run.
    """
    path = path.absolute()
    if path.parent.name == TRASH:
        raise UnsuitableRunError(f"{path} is in the trash already. Nothing is ever deleted by Slipstand")
    _check(path)
    if path.is_symlink():
        raise UnsuitableRunError(f"{path} is a link to {path.resolve()}. Give that file")
    if path.suffix != SUFFIX:
        raise UnsuitableRunError(f"{path} is not named like a run. Give a file that ends in {SUFFIX}")
    folder = path.parent / TRASH
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise storage_error(folder, error) from None
    return _move(path, folder)


def restore_from_trash(path: Path) -> Path:
    """Bring a run back from the trash, and return where it lies now.

    Raises
    ------
    RunNotFoundError, WriteError
    UnsuitableRunError
        It is not in a trash folder.
    """
    path = path.absolute()
    if path.parent.name != TRASH:
        raise UnsuitableRunError(f"{path} is not in a trash folder. Give a run in a folder named {TRASH}")
    _check(path)
    return _move(path, path.parent.parent)


def list_trash(folder: Path) -> list[Path]:
    """Runs in the trash of a folder and of those below it, the last one moved there first.

    Raises
    ------
    RunNotFoundError
        There is no such folder.
    """
    if not folder.is_dir():
        raise RunNotFoundError(f"{folder}: there is no such folder. Give a folder with runs")
    found = [path.absolute() for path in folder.rglob(f"{TRASH}/*{SUFFIX}")]
    return sorted(found, key=lambda path: path.stat().st_ctime, reverse=True)


def _check(path: Path) -> None:
    if not path.is_file():
        raise RunNotFoundError(f"{path}: there is no such file. Give the path of a run")
    if is_being_recorded(path):
        raise BeingRecordedError(f"{path} is being recorded. Wait until the run has ended")


def _move(path: Path, folder: Path) -> Path:
    """Take a free name, then move: nothing is overwritten, whoever else moves at the same time."""
    target = _claim(path, folder)
    try:
        path.replace(target)
    except OSError as error:
        target.unlink(missing_ok=True)
        raise storage_error(path, error) from None
    for changed in (folder, path.parent):
        with contextlib.suppress(OSError):  # it is moved; only a power cut may yet undo that
            sync_folder(changed)
    return target


def _claim(path: Path, folder: Path) -> Path:
    names = (path.name, *(f"{path.stem}-{number}{path.suffix}" for number in range(2, _NAMES_MAX)))
    for name in names:
        try:
            (folder / name).open("x").close()
        except FileExistsError:
            continue
        except OSError as error:
            raise storage_error(folder, error) from None
        return folder / name
    raise WriteError(f"{folder}: no free name is left for {path.name}. Rename one there")
