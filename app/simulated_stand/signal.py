"""Signal of the simulated stand: motion, gauges and converter, sample by sample."""

import math
from dataclasses import dataclass

import numpy as np

from app.simulated_stand.effects import gauge_values
from app.simulated_stand.gauge_chain import GaugeChain
from app.simulated_stand.motion import RepeatedPullback
from app.simulated_stand.options import SimulatedStandOptions
from config.schema import Gauge, Gauges
from drivers.arrays import Flags, Floats, Int32s, UInt8s
from drivers.samples import SampleStatus
from drivers.simulated.protocol import MAX_COUNT
from drivers.simulated.stream_sender import Signal

_TABLE = np.uint8(SampleStatus.OVERLOAD_TABLE)
_RELATIVE = np.uint8(SampleStatus.OVERLOAD_RELATIVE)


class SwappedChannels:
    """Counts of a device whose only channel has gauge 2; its second one has gauge 1."""

    def __init__(self, signal: Signal) -> None:
        self._signal = signal

    def take(self, count: int) -> tuple[Int32s, UInt8s]:
        counts, status = self._signal.take(count)
        clipped = [(status & flag) != 0 for flag in (_RELATIVE, _TABLE)]
        turned = np.where(clipped[0], _TABLE, np.uint8(0)) | np.where(clipped[1], _RELATIVE, np.uint8(0))
        return counts[:, ::-1], turned.astype(np.uint8)


class StandSignal:
    """Counts of both gauges of one stream; a `drivers.simulated.stream_sender.Signal`.

    Samples are made a tenth of a second ahead, since short arrays cost as much as long ones; always equally
    many, so that a seed gives the same noise however they are taken. `rate_hz` are samples a second of the
    stand's own time, `started_s` is the time of the first one (s), `max_count` the largest that is sent.
    """

    _AHEAD_S = 0.1
    _AHEAD_LEAST = 256

    def __init__(
        self,
        motion: RepeatedPullback,
        gauges: Gauges,
        options: SimulatedStandOptions,
        rate_hz: float,
        started_s: float = 0.0,
        max_count: float = MAX_COUNT,
    ) -> None:
        random = np.random.Generator(np.random.SFC64(options.seed))
        noise_m, bend_m = options.noise_m, options.nonlinearity_m
        table = GaugeFaults(noise_m, options.table_drift_m_per_s, bend_m, options.table_clip_m)
        relative = GaugeFaults(noise_m, options.relative_drift_m_per_s, bend_m, options.relative_clip_m)
        self._table = SimulatedGauge(gauges.table, table, random, max_count)
        self._relative = SimulatedGauge(gauges.relative, relative, random, max_count)
        self._chain = GaugeChain(
            gauge_values(options.effects), motion.pullback_m, rate_hz,
            is_absolute=gauges.relative.measures == "plate",
        )  # fmt: skip
        self._motion = motion
        self._rate_hz = rate_hz
        self._started_s = started_s
        self._next = 0
        self._counts: Int32s = np.empty((0, 2), dtype=np.int32)
        self._status: UInt8s = np.empty(0, dtype=np.uint8)

    def take(self, count: int) -> tuple[Int32s, UInt8s]:
        while count > len(self._status):
            self._make(max(self._AHEAD_LEAST, int(self._AHEAD_S * self._rate_hz)))
        counts, self._counts = self._counts[:count], self._counts[count:]
        status, self._status = self._status[:count], self._status[count:]
        return counts, status

    def _make(self, count: int) -> None:
        time_s = self._started_s + np.arange(self._next, self._next + count) / self._rate_hz
        self._next += count
        table_m, relative_m = self._chain.read(self._displacements, time_s)
        drifting_s = self._motion.drift_time_s(np.maximum(time_s, 0.0))
        table, table_overload = self._table.read(table_m, drifting_s)
        relative, relative_overload = self._relative.read(relative_m, drifting_s)
        status = np.where(table_overload, _TABLE, np.uint8(0))
        status[relative_overload] |= _RELATIVE
        self._counts = np.concatenate([self._counts, np.column_stack([table, relative])])
        self._status = np.concatenate([self._status, status])

    def _displacements(self, time_s: Floats) -> tuple[Floats, Floats]:
        return self._motion.displacements(np.maximum(time_s, 0.0))  # before a start that lies ahead it rests


@dataclass(frozen=True, slots=True)
class GaugeFaults:
    """What one gauge adds to the true displacement."""

    noise_m: float = 0.0
    drift_m_per_s: float = 0.0
    nonlinearity_m: float = 0.0
    """Largest deviation from the calibration line, at half range (m)."""
    clip_m: float | None = None
    """Readings beyond are clipped, where that comes before the end of its range (m)."""


class SimulatedGauge:
    """One gauge with its converter, of 24 bits unless the device's is narrower."""

    def __init__(
        self, gauge: Gauge, faults: GaugeFaults, random: np.random.Generator, max_count: float = MAX_COUNT
    ) -> None:
        self._gauge = gauge
        self._faults = faults
        self._random = random
        self._max_count = max_count
        ends = (np.array([-MAX_COUNT, MAX_COUNT]) - gauge.zero_count) * gauge.gain_m_per_count
        self._range_m = min(gauge.range_m or math.inf, float(np.abs(ends).min()))
        self._limit_m = min(self._range_m, faults.clip_m or math.inf)

    def read(self, displacement_m: Floats, drifting_s: Floats) -> tuple[Int32s, Flags]:
        """Counts (n,) for displacements (n,) with a zero that creeps for `drifting_s`, and overloads (n,)."""
        faults = self._faults
        shown = displacement_m + faults.drift_m_per_s * drifting_s
        if faults.nonlinearity_m:
            shown += faults.nonlinearity_m * np.sin(np.pi / self._range_m * displacement_m)
        if faults.noise_m:
            shown += faults.noise_m * self._random.standard_normal(len(shown), dtype=np.float32)
        overloaded = np.abs(shown) > self._limit_m
        np.clip(shown, -self._limit_m, self._limit_m, out=shown)
        counts = np.rint(self._gauge.counts(shown))
        overloaded |= np.abs(counts) > self._max_count
        return np.clip(counts, -self._max_count, self._max_count).astype(np.int32), overloaded
