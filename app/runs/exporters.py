"""Run data for other programs."""

import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from app.runs.disk import storage_error
from app.runs.format import signal_name
from app.runs.reader import Run

_ROWS_AT_ONCE = 10_000


def export_csv(run: Run, path: Path, *, replace: bool = False) -> None:
    """Write the samples of a run as CSV: every number with all its digits, absent readings empty.

    Columns are `time_s`, `table_displacement_m`, `relative_displacement_m` where there is a second gauge
    (`plate_...` where it measures against the base, other quantities and units by their names), `status`.

    Raises
    ------
    RunExistsError, DiskFullError, WriteError
    """
    path = path.absolute()
    made = path.with_name(f".{path.name}.{os.getpid()}.tmp") if replace else path
    try:
        with made.open("x", encoding="utf-8", newline="") as file:
            file.writelines(_lines(run))
        if replace:
            made.replace(path)
    except FileExistsError as error:
        raise storage_error(path, error) from None
    except OSError as error:
        made.unlink(missing_ok=True)
        raise storage_error(path, error) from None


def _lines(run: Run) -> Iterator[str]:
    readings = [run.table_reading]
    if run.relative_reading is not None:
        readings.append(run.relative_reading)
    yield ",".join(["time_s", *(_column_name(run, gauge) for gauge in range(len(readings))), "status"]) + "\n"
    for first in range(0, len(run), _ROWS_AT_ONCE):
        rows = slice(first, first + _ROWS_AT_ONCE)
        numbers = np.column_stack([run.time_s[rows], *(reading[rows] for reading in readings)]).tolist()
        for row, status in zip(numbers, run.status[rows].tolist(), strict=True):
            yield ",".join("" if x != x else repr(x) for x in row) + f",{status}\n"


def _column_name(run: Run, gauge: int) -> str:
    metadata = run.metadata
    path = signal_name(gauge, metadata.quantity, metadata.gauges.relative.measures)
    unit = metadata.unit.replace("/", "_per_").replace("^", "")
    return f"{path.rpartition('/')[2]}_{unit}"
