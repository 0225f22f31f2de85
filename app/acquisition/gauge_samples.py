"""Samples of both gauges at rest, for the judgement of their health."""

import time
from collections.abc import Sequence

import numpy as np

from analysis.gauge_health import GaugeSamples
from app.acquisition.averaged_counts import OVERLOAD_FLAGS, TIMEOUT_S
from app.acquisition.errors import AcquisitionError
from app.acquisition.stream.live_stream import LiveStream
from app.runs.blocks import CalibratedBlock
from config.schema import Gauges


class NoSamplesError(AcquisitionError):
    """Too few samples came in time."""


def collect_samples(stream: LiveStream, seconds: float, gauges: Gauges) -> tuple[GaugeSamples, GaugeSamples]:
    """Collect samples of both gauges from now on. Raises NoSamplesError, AcquisitionError, DriverError."""
    wanted, taken = round(seconds * stream.rate_hz), list[CalibratedBlock]()
    ends_s = time.perf_counter() + seconds + TIMEOUT_S
    while sum(map(len, taken)) < wanted:
        if time.perf_counter() > ends_s:
            raise NoSamplesError(
                "only {samples} of {wanted} samples came in {seconds:g} s. Check cable, power and rate"
                " of the device",
                samples=sum(map(len, taken)),
                wanted=wanted,
                seconds=seconds + TIMEOUT_S,
            )
        chunk = stream.next_read(0.1)
        taken += chunk.rows if chunk is not None else ()
    return gauge_samples(taken, stream.rate_hz, gauges)


def gauge_samples(
    rows: Sequence[CalibratedBlock], rate_hz: float, gauges: Gauges
) -> tuple[GaugeSamples, GaugeSamples]:
    """Samples of both gauges, each as it is mounted, from consecutive blocks."""
    readings = np.concatenate([block.readings for block in rows])
    status = np.concatenate([block.status for block in rows])
    table, relative = (
        GaugeSamples(readings[:, channel], (status & flag) != 0, rate_hz, gauge.range_m)
        for channel, (flag, gauge) in enumerate(
            zip(OVERLOAD_FLAGS, (gauges.table, gauges.relative), strict=True)
        )
    )
    return table, relative
