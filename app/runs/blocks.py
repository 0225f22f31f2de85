"""Blocks of samples: calibrated from counts, and as rows of a run file."""

from dataclasses import dataclass
from typing import Any, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from config.schema import Gauges
from drivers.arrays import Counts, Floats
from drivers.samples import ABSENT_BY_GAUGE, INCOMPLETE, Losses, SampleBlock, SampleStatus

Columns = list[NDArray[Any]]
"""A block's columns in the order of the file: time, readings of each gauge, status, counts of each gauge."""


class BlockLayout(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What the blocks of a run hold."""

    channels: Literal[1, 2] = 2
    counts: Literal["int32", "float64", ""] = "int32"
    """Type of the readings as received; empty where there are none (simulated runs)."""

    @classmethod
    def of(cls, block: "RunBlock") -> "BlockLayout":
        counts = "" if block.counts is None else block.counts.dtype.name
        return msgspec.convert({"channels": block.readings.shape[1], "counts": counts}, cls)


@dataclass(frozen=True, eq=False, slots=True)
class RunBlock:
    """Consecutive rows of a run."""

    time_s: NDArray[np.float64]
    """(n,) float64: since the first stored sample, on the device's or nominal clock."""
    readings: NDArray[np.float64]
    """(n, channels) float64: calibrated readings, displacements (m) as a rule; NaN where absent."""
    status: NDArray[np.uint8]  # (n,) uint8: `drivers.samples.SampleStatus` flags
    counts: NDArray[np.int32] | NDArray[np.float64] | None = None
    """(n, channels) int32 or float64, or None: as received, of the type that the layout says."""

    def __len__(self) -> int:
        return len(self.time_s)

    def columns(self, layout: BlockLayout) -> Columns:
        """Columns in the order of the file, contiguous. Raises ValueError where they do not fit `layout`."""
        n, channels = len(self), layout.channels
        counts = [] if self.counts is None else [self.counts]
        if any(a.shape != (n, channels) for a in (self.readings, *counts)) or self.status.shape != (n,):
            raise ValueError(f"a block of {n} rows and {channels} channels does not have one shape")
        if bool(counts) != bool(layout.counts):
            raise ValueError(f"a block {'with' if counts else 'without'} counts does not fit the run")
        if counts and not np.can_cast(counts[0].dtype, layout.counts, "safe"):
            raise ValueError(f"counts of type {counts[0].dtype} do not fit a run of {layout.counts}")
        columns: Columns = [np.ascontiguousarray(self.time_s, np.float64)]
        columns += [np.ascontiguousarray(self.readings[:, i], np.float64) for i in range(channels)]
        columns.append(np.ascontiguousarray(self.status, np.uint8))
        columns += [np.ascontiguousarray(c[:, i], layout.counts) for c in counts for i in range(channels)]
        return columns


class StoredRun(msgspec.Struct, frozen=True):
    """A run file that is closed, verified and on disk."""

    path: str
    samples: int
    raw_bytes_stored: bool
    """False where the journal's bytes did not fit, or there was no journal: keep the journal then."""


def count_flags(status: NDArray[np.uint8]) -> Losses:
    """Counts of rows by their flags (n,)."""
    if not np.count_nonzero(status):  # takes a third of the time of `any`
        return Losses(samples=len(status))
    overload = SampleStatus.OVERLOAD_TABLE | SampleStatus.OVERLOAD_RELATIVE
    return Losses(
        samples=len(status),
        missing=int(np.count_nonzero(status & INCOMPLETE)),
        damaged=int(np.count_nonzero(status & SampleStatus.DAMAGED)),
        overloaded=int(np.count_nonzero(status & overload)),
    )


@dataclass(frozen=True, eq=False, slots=True)
class CalibratedBlock:
    """Consecutive calibrated samples."""

    first_index: int  # of the first row, counted from the first sample of the stream
    counts: Counts
    readings: Floats
    """(n, 2) float64: displacements that the gauges show, each as it is mounted (m); NaN where absent."""
    relative_m: Floats  # (n,) float64: plate against table (m), also where gauge 2 is mounted on the base
    status: NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.status)

    @property
    def end_index(self) -> int:
        return self.first_index + len(self)

    @property
    def table_m(self) -> Floats:
        return self.readings[:, 0]

    def between(self, first_index: int, end_index: int) -> "CalibratedBlock":
        start = min(max(first_index - self.first_index, 0), len(self))
        part = slice(start, max(start, end_index - self.first_index))
        return CalibratedBlock(
            self.first_index + start,
            self.counts[part],
            self.readings[part],
            self.relative_m[part],
            self.status[part],
        )


def calibrate(block: SampleBlock, gauges: Gauges) -> CalibratedBlock:
    """Samples of a block in metres."""
    readings = np.empty((len(block), 2))
    is_flagged = np.count_nonzero(block.status) > 0
    for channel, gauge in enumerate((gauges.table, gauges.relative)):
        readings[:, channel] = gauge.displacement_m(block.counts[:, channel].astype(np.float64))
        if is_flagged:
            readings[(block.status & ABSENT_BY_GAUGE[channel]) != 0, channel] = np.nan
    seen = readings[:, 1]
    relative_m = seen - readings[:, 0] if gauges.relative.measures == "plate" else seen
    return CalibratedBlock(block.first_index, block.counts, readings, relative_m, block.status)
