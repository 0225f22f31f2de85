"""What gauges that are not ideal make of a motion: lag, filter, bend, creep, cross-talk and gain."""

import math
from collections.abc import Callable, Mapping

import numpy as np

from analysis.arrays import Floats

_CREEP_TIME_S = 10.0  # a bridge that is switched on warms up in some tens of seconds
Displacements = Callable[[Floats], tuple[Floats, Floats]]
"""u1 and u2 - u1 (n,) at times (n,)."""


class GaugeChain:
    """Both gauges behind their amplifiers, sample by sample at an even rate.

    `values` are those of `effects.gauge_values`. With `is_absolute` gauge 2 measures the plate against the
    base.
    """

    def __init__(
        self, values: Mapping[str, float], pullback_m: float, rate_hz: float, *, is_absolute: bool = False
    ) -> None:
        self._lag_s = values.get("gauge_2_lag_s", 0.0)
        self._cross_talk = values.get("cross_talk", 0.0)
        self._cross_talk_1 = values.get("cross_talk_1", 0.0)
        self._gain = 1.0 + values.get("relative_gain", 0.0)
        square = max(abs(pullback_m), 1e-9) ** 2
        self._bends = [values.get(f"gauge_{number}_bend", 0.0) / square for number in (1, 2)]
        corners = [values.get(f"gauge_{number}_filter_hz") for number in (1, 2)]
        self._filters = [None if corner is None else RcFilter(corner, rate_hz) for corner in corners]
        self._creeps_m = [values.get(f"gauge_{number}_creep_m", 0.0) for number in (1, 2)]
        self._first_s: float | None = None
        self._is_absolute = is_absolute

    def read(self, displacements: Displacements, time_s: Floats) -> tuple[Floats, Floats]:
        """Readings (m), (n,), at even times (n,) that follow those of the last call."""
        table, relative = moved = displacements(time_s)
        if self._lag_s:
            moved = displacements(time_s - self._lag_s)
            relative = moved[1]
        if self._is_absolute:
            relative = relative + moved[0]
        table = table + self._cross_talk_1 * relative
        relative = self._gain * (relative + self._cross_talk * moved[0])
        if self._first_s is None:
            self._first_s = float(time_s[0])
        warm = -np.expm1((self._first_s - time_s) / _CREEP_TIME_S)
        shown = []
        chains = zip((table, relative), self._bends, self._creeps_m, self._filters, strict=True)
        for row, bend, creep_m, low_pass in chains:
            bent = row + bend * row**3 + creep_m * warm
            shown.append(bent if low_pass is None else low_pass.filter(bent))
        return shown[0], shown[1]


class RcFilter:
    """Analogue low-pass filter of one stage, of a signal that is straight between its samples."""

    def __init__(self, corner_hz: float, rate_hz: float) -> None:
        from scipy.signal import lfilter  # takes a third of a second

        samples = rate_hz / (2.0 * math.pi * corner_hz)  # in a time constant
        self._kept = math.exp(-1.0 / samples)
        late = samples * (1.0 - self._kept)
        self._weights = np.array([1.0 - late, late - self._kept])
        self._lfilter = lfilter
        self._state: Floats | None = None

    def filter(self, values: Floats) -> Floats:
        """Filtered values (n,) that follow those of the last call; before, the first one held for ever."""
        if self._state is None:
            self._state = (1.0 - self._weights[:1]) * values[0]
        filtered: Floats
        filtered, self._state = self._lfilter(self._weights, [1.0, -self._kept], values, zi=self._state)
        return filtered
