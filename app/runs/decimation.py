"""A run condensed for drawing, read a piece at a time: an hour of samples at once, and in little memory."""

import bisect
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from app.runs.columns import stored_rows
from app.runs.fields import read_number
from app.runs.metadata_io import read_changes, read_metadata
from app.runs.reader import reading_columns, validate_and_read
from app.runs.saved_analyses import read_analyses
from app.runs.schema import RELEASE, TIME
from app.runs.validator import Validator

Floats = NDArray[np.float64]
_ROWS_AT_ONCE = 1 << 16


@dataclass(frozen=True, eq=False, slots=True)
class DecimatedRun:
    """What a small drawing of a run shows."""

    path: Path
    unit: str
    release_s: float | None
    """As the newest saved analysis found it, else as it was when recorded."""
    time_s: Floats  # (m,) float64: of each span of rows, twice; of each row where the run is short
    readings: tuple[Floats, ...]
    """Lowest and highest reading of each span, of the table gauge and of the other if there is one."""


def open_decimated(
    path: Path | str,
    spans: int,
    *,
    between_s: tuple[float, float] = (-np.inf, np.inf),
    validator: Validator | None = None,
) -> DecimatedRun:
    """Read a run, or a part of it, in about so many spans. Raises RunError.

    `between_s` counts from the release, or in the time of the record where none is known.
    """
    return validate_and_read(path, lambda file: _overview(file, spans, between_s), validator=validator)


def decimate(columns: tuple[Floats, ...], spans: int) -> tuple[Floats, ...]:
    """Times (n,) and readings (n,) as an `Overview` has them, of about so many spans."""
    return _condensed(columns, max(1, len(columns[0]) // spans))


def _overview(file: h5py.File, spans: int, between_s: tuple[float, float]) -> DecimatedRun:
    metadata, time_s = read_metadata(file), file[TIME]
    rows, release_s = stored_rows(file), read_number(file, RELEASE)
    for analysis in read_analyses(file)[-1:]:
        release_s = analysis.document["events"].get("release_s") or release_s
    start_s, end_s = (end + (release_s or 0.0) for end in between_s)
    first = 0 if start_s == -np.inf else bisect.bisect_left(time_s, start_s, hi=rows)
    rows = rows if end_s == np.inf else bisect.bisect_right(time_s, end_s, lo=first, hi=rows)
    per_span = max(1, (rows - first) // spans)
    readings = reading_columns(file, metadata, read_changes(file))
    pieces = [_condensed((time_s[part], *readings(part)), per_span) for part in _parts(first, rows, per_span)]
    columns = [np.concatenate(column) for column in zip(*pieces, strict=True)]
    return DecimatedRun(Path(file.filename), metadata.unit, release_s, columns[0], tuple(columns[1:]))


def _parts(first: int, rows: int, per_span: int) -> Iterator[slice]:
    """Spans of rows from row `first` on, some at a time; one without rows if there are none."""
    step = max(1, _ROWS_AT_ONCE // per_span) * per_span
    for start in range(first, max(rows, first + 1), step):
        yield slice(start, min(start + step, rows))


def _condensed(columns: tuple[Floats, ...], per_span: int) -> tuple[Floats, ...]:
    """The first time of each span twice, and its lowest and highest readings; the last may be shorter."""
    if per_span == 1:
        return columns
    time_s, *readings = columns
    starts = np.arange(0, len(time_s), per_span)
    both = [
        np.column_stack((np.fmin.reduceat(r, starts), np.fmax.reduceat(r, starts))).ravel() for r in readings
    ]
    return (np.repeat(time_s[starts], 2), *both)
