"""Whether run files can be kept in a folder, and whether the process that examines them works."""

import tempfile
from pathlib import Path

import h5py
import numpy as np

from app.runs.disk import storage_error
from app.runs.errors import NotARunError, RunError
from app.runs.validator import Validator

_ROWS = 1000


def check_folder(folder: Path) -> None:
    """Write a small HDF5 file as a run is written, read it and remove it. Raises RunError."""
    written = np.arange(_ROWS, dtype=np.float64)
    try:
        with tempfile.TemporaryDirectory(prefix=".slipstand-check-", dir=folder) as place:
            path = Path(place) / "check.h5"
            with h5py.File(path, "w") as file:
                file.create_dataset("data", data=written, maxshape=(None,), chunks=(_ROWS,))
                file.flush()
            path.replace(path.with_name("checked.h5"))
            with h5py.File(path.with_name("checked.h5"), "r") as file:
                read = file["data"][:]
    except OSError as error:
        raise storage_error(folder, error) from None
    if not np.array_equal(written, read):
        raise RunError(f"{folder}: what was written reads back otherwise. Take another disk")


def check_validator() -> None:
    """Have a file examined that is HDF5 but no run. Raises RunError unless it is called that."""
    with tempfile.TemporaryDirectory(prefix="slipstand-check-") as place:
        path = Path(place) / "no-run.h5"
        h5py.File(path, "w").close()
        try:
            with Validator() as validator:
                validator.validate(path)
        except NotARunError:
            return
    raise RunError("a file that is no run was taken for one")
