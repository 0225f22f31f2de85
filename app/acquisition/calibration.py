"""Counts to metres, by the gauges' calibration."""

import numpy as np
from numpy.typing import NDArray

from config.schema import Gauge, Gauges
from drivers.samples import ABSENT, SampleBlock

FloatArray = NDArray[np.float64]


def calibrated(block: SampleBlock, gauges: Gauges) -> FloatArray:
    """Displacements (n, 2) of the table and of gauge 2 as it is mounted (m), NaN without a reading."""
    readings = np.empty((len(block), 2))
    for channel, gauge in enumerate((gauges.table, gauges.relative)):
        readings[:, channel] = _displacement_m(block.counts[:, channel], gauge)
    readings[(block.status & ABSENT) != 0] = np.nan
    return readings


def relative_m(readings: FloatArray, gauges: Gauges) -> FloatArray:
    """Displacement (n,) of the plate against the table (m), however gauge 2 is mounted."""
    seen = readings[:, 1]
    return seen - readings[:, 0] if gauges.relative.measures == "plate" else seen


def _displacement_m(counts: NDArray[np.int32] | NDArray[np.float64], gauge: Gauge) -> FloatArray:
    return (counts.astype(np.float64) - gauge.zero_count) * gauge.gain_m_per_count
