"""From units (frames or lines) and the gaps before them to rows without a hole.

Every decoder reduces its bytes to units: a run of good samples, and how many samples were lost
before it. What a unit becomes in a `SampleBlock` is the same for all devices and stands here.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from drivers.compiled import compiled
from drivers.samples import Losses, SampleBlock, SampleStatus

MAX_BLOCK_ROWS = 65536
"""A long gap becomes several blocks, so that no single one is large."""

MAX_GAP_S = 600.0
"""A longer gap is not believed: the device began anew."""

UNIT = np.dtype(
    [
        ("damaged", np.int64),  # rows before the unit that came broken
        ("missing", np.int64),  # rows before the unit that never came, proven or estimated
        ("time_s", np.float64),  # device time of the unit's first sample
        ("samples", np.int32),
        ("status", np.int32),
    ],
    align=True,
)

LOSS_FIELDS = [(account.name, np.int64) for account in fields(Losses)]
"""Members that a decoder's memory shares with `Losses`."""

Record: TypeAlias = Any
"""One element of a structured array inside compiled code, its fields as attributes."""

_MISSING = int(SampleStatus.MISSING)
_DAMAGED = int(SampleStatus.DAMAGED)


@dataclass(frozen=True, eq=False, slots=True)
class Units:
    """What one call of a decoder found.

    Attributes
    ----------
    units : (u,) UNIT
        Good units in order of arrival.
    counts : (s, 2) int32 or float64
        Samples of all units, one after the other.
    first_index : int
        Row of the first lost or good sample of the first unit.
    last_time_s : float
        Device time of the row before `first_index`.
    period_s : float
        Nominal time between the samples of a unit.
    timed : bool
        Whether the device sends its time.
    arrival_ns : int
        Host's time of the read that completed the units.
    """

    units: NDArray[np.void]
    counts: NDArray[np.int32] | NDArray[np.float64]
    first_index: int
    last_time_s: float
    period_s: float
    timed: bool
    arrival_ns: int


def losses_in(memory: NDArray[np.void]) -> Losses:
    """The account that a decoder's memory (1,) holds in its `LOSS_FIELDS`."""
    return Losses(**{name: int(memory[0][name]) for name, _ in LOSS_FIELDS})


def blocks(found: Units) -> Iterator[SampleBlock]:
    """Rows of `found`, absent ones included, in blocks of at most `MAX_BLOCK_ROWS`."""
    left = len(found.counts) + int(found.units["damaged"].sum() + found.units["missing"].sum())
    index, unit, lost, sample, last_time_s = found.first_index, 0, 0, 0, found.last_time_s
    while left:
        rows = min(left, MAX_BLOCK_ROWS)
        counts = np.empty((rows, 2), dtype=found.counts.dtype)
        status = np.empty(rows, dtype=np.uint8)
        times_s = np.empty(rows)
        rows, unit, lost, sample, last_time_s = lay_out(
            found.units,
            found.counts,
            found.period_s,
            unit,
            lost,
            sample,
            last_time_s,
            counts,
            status,
            times_s,
        )
        yield SampleBlock(
            first_index=index,
            counts=counts[:rows],
            status=status[:rows],
            arrival_ns=found.arrival_ns,
            device_time_s=times_s[:rows] if found.timed else None,
        )
        index += rows
        left -= rows


@compiled
def lay_out(
    units: NDArray[np.void],
    samples: NDArray[np.int32] | NDArray[np.float64],
    period_s: float,
    unit: int,
    lost: int,
    sample: int,
    last_s: float,
    counts: NDArray[np.int32] | NDArray[np.float64],
    status: NDArray[np.uint8],
    times_s: NDArray[np.float64],
) -> tuple[int, int, int, int, float]:
    """Fill one block from where the one before it ended; returns rows filled and the new place.

    The place is: unit, rows already given for the gap before it, its first sample, and the time
    of the row before. Times of lost rows are spread evenly between their neighbours.
    """
    row = 0
    while unit < len(units):
        damaged = units[unit].damaged
        gap = damaged + units[unit].missing
        start_s = units[unit].time_s
        if gap > lost:
            step_s = (start_s - last_s) / (gap - lost + 1)
            while lost < gap and row < len(status):
                last_s += step_s
                counts[row, 0] = counts[row, 1] = 0
                status[row] = _DAMAGED if lost < damaged else _MISSING
                times_s[row] = last_s
                lost += 1
                row += 1
        size = units[unit].samples
        if lost < gap or row + size > len(status):
            break
        for k in range(size):
            counts[row, 0] = samples[sample, 0]
            counts[row, 1] = samples[sample, 1]
            status[row] = units[unit].status
            last_s = start_s + k * period_s
            times_s[row] = last_s
            row += 1
            sample += 1
        lost = 0
        unit += 1
    return row, unit, lost, sample, last_s
