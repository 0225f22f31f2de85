"""Samples of both gauges over a time, for the judgement of their health."""

import time
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from analysis.gauge_health import GaugeSamples
from app.acquisition.averaged_counts import OVERLOAD_FLAGS, TIMEOUT_S, SampleStream
from app.acquisition.errors import AcquisitionError
from app.acquisition.ring import RingRows
from app.acquisition.stream.calibration import CalibratedBlock
from config.schema import Gauges

GaugePair = tuple[GaugeSamples, GaugeSamples]


class NoSamplesError(AcquisitionError):
    """Samples that stay away."""


def collect_samples(stream: SampleStream, seconds: float, gauges: Gauges) -> GaugePair:
    """Samples of both gauges from now on; all else that the stream brings is left.

    Raises
    ------
    WatchError
        They stay away.
    AcquisitionError, DriverError
        The stream has ended.
    """
    wanted, taken = round(seconds * stream.rate_hz), list[CalibratedBlock]()
    ends_s = time.monotonic() + seconds + TIMEOUT_S
    while sum(map(len, taken)) < wanted:
        if time.monotonic() > ends_s:
            raise NoSamplesError(
                "only {samples} of {wanted} samples came in {seconds:g} s. Check cable, power and rate"
                " of the device",
                samples=sum(map(len, taken)),
                wanted=wanted,
                seconds=seconds + TIMEOUT_S,
            )
        chunk = stream.next_read(0.1)
        taken += chunk.rows if chunk is not None else ()
    status = np.concatenate([rows.status for rows in taken])
    readings = np.concatenate([rows.readings for rows in taken])
    return _pair(readings.T, status, stream.rate_hz, gauges)


def samples_from_ring(rows: RingRows, rate_hz: float, gauges: Gauges) -> GaugePair:
    """Samples of both gauges as they read, from the live ring, whose rows are relative in any case."""
    is_absolute = gauges.relative.measures == "plate"
    seen_m = rows.relative_m + rows.table_m if is_absolute else rows.relative_m
    return _pair((rows.table_m, seen_m), rows.status, rate_hz, gauges)


def _pair(
    readings: Iterable[NDArray[np.float64]], status: NDArray[np.uint8], rate_hz: float, gauges: Gauges
) -> GaugePair:
    table, relative = (
        GaugeSamples(displacement_m, (status & flag) != 0, rate_hz, gauge.range_m)
        for displacement_m, flag, gauge in zip(
            readings, OVERLOAD_FLAGS, (gauges.table, gauges.relative), strict=True
        )
    )
    return table, relative
