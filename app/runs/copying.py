"""Run files brought into a library from elsewhere, never over one that is there."""

import shutil
from pathlib import Path

from app.runs.disk import atomic_write, storage_error
from app.runs.errors import RunExistsError
from app.runs.reader import check_openable
from app.runs.validator import Validator

_TRIES = 1000


def copy_run_into(path: Path, folder: Path) -> Path:
    """Copy a run into a folder under its own name, or the next that is free; returns where it lies.

    Raises
    ------
    RunError
        It is no readable run, lies in that folder already, or cannot be written there.
    """
    path = path.absolute()
    check_openable(path)
    if path.parent == folder.absolute():
        raise RunExistsError(f"{path} lies in this folder already. Nothing was copied")
    with Validator.start() as validator:
        validator.validate(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise storage_error(folder, error) from None
    for number in range(1, _TRIES):
        target = folder / (path.name if number == 1 else f"{path.stem}-{number}{path.suffix}")
        try:
            with atomic_write(target) as made:
                shutil.copyfile(path, made)
        except RunExistsError:
            continue
        return target
    raise RunExistsError(f"{folder}: all names {path.stem}-N are taken. Move some runs elsewhere")
