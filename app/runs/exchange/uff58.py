"""Universal file format, dataset 58 binary: the exchange format of modal analysis and test benches.

Written here and not by pyuff, which prints the time step with six digits and counts the bytes of uneven
records by half (pyuff 2.5.8); pyuff reads it in the tests. Layout: SDRC, Universal File Datasets Summary, 58.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.runs.exchange.content import ExportedRun, SampleColumn
from app.runs.metadata import RunSource
from app.runs.origin import SIMULATED

_TIME_RESPONSE = 1
_DOUBLE = 4
_LITTLE_ENDIAN, _IEEE = 1, 2
_TIME_AXIS, _GENERAL_AXIS = 17, 1
_DATA_TYPES = {"m": 8, "m/s": 11, "m/s^2": 12}
"""Codes of the format for what an ordinate is: displacement, velocity, acceleration."""


def write_run(exported: ExportedRun, path: Path) -> None:
    """Write a dataset a gauge, in the unit of the run; absent readings are NaN."""
    time, *others = exported.samples
    channels = [column for column in others if column.unit == exported.run.metadata.unit]
    with path.open("xb") as file:
        for number, channel in enumerate(channels, start=1):
            file.writelines(_dataset(exported, number, time.values, channel))


def _dataset(
    exported: ExportedRun, number: int, time_s: NDArray[np.float64], channel: SampleColumn
) -> Iterator[bytes]:
    step_s = _even_step(time_s)
    data = channel.values.astype("<f8") if step_s else np.column_stack([time_s, channel.values]).astype("<f8")
    place = "TABLE" if number == 1 else "PLATE"
    header = [
        f"{-1:6d}",
        f"{58:6d}b{_LITTLE_ENDIAN:6d}{_IEEE:6d}{11:12d}{data.nbytes:12d}{0:6d}{0:6d}{0:12d}{0:12d}",
        *(f"{_line(text):<80.80s}" for text in _identification(exported, channel)),
        f"{_TIME_RESPONSE:5d}{number:10d}{0:5d}{0:10d} {place:<10s}{number:10d}{1:4d}"
        f" {'NONE':<10s}{0:10d}{0:4d}",
        f"{_DOUBLE:10d}{len(time_s):10d}{int(bool(step_s)):10d}{0.0:13.5e}{step_s:13.5e}{0.0:13.5e}",
        _axis(_TIME_AXIS, "Time", "s"),
        _axis(_DATA_TYPES.get(channel.unit, _GENERAL_AXIS), channel.name, channel.unit),
        _axis(0, "NONE", "NONE"),
        _axis(0, "NONE", "NONE"),
    ]
    yield "".join(f"{line}\n" for line in header).encode("ascii", "replace")
    yield data.tobytes()
    yield f"\n{-1:6d}\n".encode()


def _identification(exported: ExportedRun, channel: SampleColumn) -> tuple[str, ...]:
    metadata = exported.run.metadata
    f_d = (exported.analysis or {}).get("results", {}).get("friction_dynamic")
    friction = "NONE"
    if f_d is not None:
        friction = f"f_d = {f_d['value']:.6g}, standard uncertainty {f_d['standard_uncertainty']:.2g}"
    simulated = f"{SIMULATED} " if metadata.source_type is RunSource.SIMULATED else ""
    return (
        simulated + metadata.title,
        channel.name,
        metadata.format_start("%d-%b-%y    %H:%M:%S") or "NONE",
        f"{exported.name} {metadata.series or ''}".strip(),
        friction,
    )


def _even_step(time_s: NDArray[np.float64]) -> float:
    """Step of times that the header's six digits give back to the last bit; 0 where they do not."""
    if len(time_s) < 2:
        return 0.0
    step = float(f"{time_s[1] - time_s[0]:.5e}")
    return step if time_s[0] == 0.0 and np.array_equal(np.arange(len(time_s)) * step, time_s) else 0.0


def _axis(kind: int, label: str, unit: str) -> str:
    return f"{kind:10d}{0:5d}{0:5d}{0:5d} {_line(label):<20.20s} {_line(unit):<20.20s}"


def _line(text: str) -> str:
    """Text in which nothing ends a line, as the format counts lines."""
    return "".join(character if character.isprintable() else " " for character in text)
