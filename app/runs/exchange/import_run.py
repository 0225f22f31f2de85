"""Import of foreign files, read in a process with limits, and what each of them holds."""

import datetime
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from analysis.preparation.channels import Channel
from analysis.preparation.oscillation import find_releases
from analysis.record import RecordError
from app.runs.exchange.importing import ForeignRecord, ImportPlan
from app.runs.exchange.reading_process import shared_reading_process
from app.runs.exchange.sizes import check_size
from app.runs.exchange.storing import store_record
from config.schema import Gauges, Stand
from messages.message import Message

_READ_SHARE = 0.7
"""Of the time of an import; the rest is writing."""
_READINGS_MOST = 200_000
"""A release is looked for among so many readings, of a longer record in means of several."""


class ImportedRun(msgspec.Struct, frozen=True):
    """A run made of a foreign file."""

    file: str
    run: str
    samples: int
    duration_s: float
    rate_hz: float | None
    """None of uneven times."""
    start_time: datetime.datetime | None
    ranges: tuple[tuple[float, float], ...]
    """Lowest and highest reading of each gauge."""
    unit: str
    release_s: float | None
    """When the table was let go, since the first row; None without a release after a hold."""
    notes: tuple[Message, ...] = ()
    """What was concluded or left out."""


def import_foreign_file(
    path: Path,
    plan: ImportPlan,
    output: Path,
    stand: Stand,
    *,
    gauges: Gauges | None = None,
    replace: bool = False,
    report: Callable[[float], object] = lambda _: None,
    **metadata: Any,
) -> ImportedRun:
    """Make a run of a foreign file. Raises RunError, ConfigError.

    Displacements are checked against the ranges of `gauges`, those of the stand, if they are given. `report`
    gets the share that is done. `metadata` as for `storing.store_record`.
    """
    with shared_reading_process().read(path, plan, lambda share: report(_READ_SHARE * share)) as record:
        if gauges is not None:
            check_size(path, record, plan, gauges)
        stored, unit = store_record(
            path, record, plan, output, stand, replace=replace,
            report=lambda share: report(_READ_SHARE + (1.0 - _READ_SHARE) * share), **metadata,
        )  # fmt: skip
        return ImportedRun(
            file=str(path),
            run=stored.path,
            samples=stored.samples,
            duration_s=float(record.time_s[-1]),
            rate_hz=record.facts.rate_hz,
            start_time=record.facts.start,
            ranges=tuple(_ranges(record)),
            unit=unit,
            release_s=find_release(record) if plan.quantity == "displacement" else None,
            notes=record.facts.notes,
        )


def free_path(folder: Path, stem: str) -> Path:
    """Path of a run in a folder that no file has: `stem.h5`, `stem-2.h5`, ..."""
    path, number = folder / f"{stem}.h5", 1
    while path.exists():
        number += 1
        path = folder / f"{stem}-{number}.h5"
    return path


def find_release(record: ForeignRecord) -> float | None:
    """Time of the last release that gauge 1 shows (s); None without one that the record begins before."""
    gauge = record.facts.gauges[0]
    cells = record.cells[0]
    per_mean = -(-len(record) // _READINGS_MOST)
    time_s, readings = _means(record.time_s, per_mean), _means(cells, per_mean)
    present = np.isfinite(readings)
    channel = Channel(time_s[present], gauge.gain_m_per_count * (readings[present] - gauge.zero_count))
    try:
        releases = find_releases(channel)
    except RecordError:
        return None
    return next((one.time_s for one in reversed(releases) if one.plateau_start_s is not None), None)


def _ranges(record: ForeignRecord) -> Iterator[tuple[float, float]]:
    """Lowest and highest reading of each gauge; a negative gain turns them."""
    for gauge, cells in zip(record.facts.gauges, record.cells, strict=True):
        ends = (
            gauge.gain_m_per_count * (float(end.reduce(cells)) - gauge.zero_count)
            for end in (np.fmin, np.fmax)
        )
        low, high = sorted(ends)
        yield low, high


def _means(values: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    if count == 1:
        return np.asarray(values)
    whole = len(values) // count * count
    return np.asarray(values[:whole].reshape(-1, count).mean(axis=1), np.float64)
