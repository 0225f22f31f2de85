"""Counts to metres, by the gauges' calibration."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.schema import Gauges
from drivers.samples import ABSENT_BY_GAUGE, SampleBlock

Floats = NDArray[np.float64]
Counts = NDArray[np.int32] | NDArray[np.float64]


@dataclass(frozen=True, eq=False, slots=True)
class CalibratedBlock:
    """Consecutive calibrated samples."""

    first_index: int
    """Of the first row, counted from the first sample of the stream."""
    counts: Counts
    """(n, 2) int32 or float64: as received."""
    readings: Floats
    """(n, 2) float64: displacements that the gauges show, each as it is mounted (m); NaN where absent."""
    relative_m: Floats
    """(n,) float64: plate against table (m), also where gauge 2 is mounted on the base."""
    status: NDArray[np.uint8]
    """(n,) uint8: `drivers.samples.SampleStatus` flags."""

    def __len__(self) -> int:
        return len(self.status)

    @property
    def end_index(self) -> int:
        """Index of the row after the last."""
        return self.first_index + len(self)

    @property
    def table_m(self) -> Floats:
        """Table against base (m), (n,)."""
        return self.readings[:, 0]

    def between(self, first_index: int, end_index: int) -> "CalibratedBlock":
        """The rows with first_index <= index < end_index."""
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
    is_flagged = block.status.any()
    for channel, gauge in enumerate((gauges.table, gauges.relative)):
        readings[:, channel] = gauge.displacement_m(block.counts[:, channel].astype(np.float64))
        if is_flagged:
            readings[(block.status & ABSENT_BY_GAUGE[channel]) != 0, channel] = np.nan
    seen = readings[:, 1]
    relative_m = seen - readings[:, 0] if gauges.relative.measures == "plate" else seen
    return CalibratedBlock(block.first_index, block.counts, readings, relative_m, block.status)
