"""When the readings of one half were taken, by the host's clock."""

from collections import deque
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from drivers.clock import RobustLine, fit_robust_line

_CELL_NS = 150_000_000
_REACH_NS = 6_000_000_000
_MIN_CELLS = 8
_LEAP_NS = 100_000_000
_LEAP = 0.02
"""A clock is ahead of what is known of it by no more than this, and by this part of the time since."""

_Point: TypeAlias = tuple[float, int]
"""Device's own time (s) of the last reading of a read, and host's time (ns) after that."""


class HostTimeFit:
    """Host's time of a device's readings, by the device's own count or clock.

    A read arrives late by what system and wire add, never early. So of each 0.15 s only the most punctual
    read counts, and a line through those of the last 6 s tells host's time from the device's own. It
    forgets what is older, so that a replay that begins amid a stream soon says the same as was said live.
    """

    def __init__(self) -> None:
        self._points: deque[_Point] = deque()
        self._best: _Point | None = None
        self._line: RobustLine | None = None
        self._origin: _Point = (0.0, 0)

    @property
    def scatter_s(self) -> float:
        """How late the punctual reads were, as root mean square about the line (s); 0 while unknown."""
        return 0.0 if self._line is None else self._line.scatter

    def reset(self) -> None:
        """The link was broken, or the device began anew: its own time may mean another from here on."""
        self._points.clear()
        self._best = self._line = None

    def add(self, device_s: float, arrival_ns: int) -> None:
        """Take the last reading of a read: the device's own time (s), and the host's (ns) after the read."""
        point = (device_s, arrival_ns)
        if self._leaps(point):
            self.reset()
        if self._best is None or _cell(point) > _cell(self._best):
            self._close_cell(arrival_ns)
            self._best = point
        elif _late_ns(point) < _late_ns(self._best):
            self._best = point

    def host_ns(self, device_s: NDArray[np.float64]) -> NDArray[np.int64]:
        """Host's time (ns) of readings (n,) at the device's own times (s), as far as is known by now.

        It includes what the most punctual read took to arrive, which nothing here can tell.
        """
        own_origin_s, origin_ns = self._nearest() if self._line is None else self._origin
        since_s = device_s - own_origin_s
        if self._line is not None:
            since_s = since_s + self._line.at(since_s)
        return origin_ns + np.rint(since_s * 1e9).astype(np.int64)

    def _leaps(self, point: _Point) -> bool:
        """Tell whether a reading would have been taken after it came: the device's clock leapt ahead."""
        if self._best is None:
            return False
        own_s, arrival_ns = point
        early_ns = int(self.host_ns(np.array([own_s]))[0]) - arrival_ns
        return early_ns > _LEAP_NS + _LEAP * (arrival_ns - self._best[1])

    def _nearest(self) -> _Point:
        """What to go by while there are too few cells for a line: the latest one that is whole."""
        return self._points[-1] if self._points else self._best or (0.0, 0)

    def _close_cell(self, now_ns: int) -> None:
        if self._best is not None:
            self._points.append(self._best)
        while self._points and self._points[0][1] < now_ns - _REACH_NS:
            self._points.popleft()
        self._line = None
        if len(self._points) >= _MIN_CELLS:
            self._refit()

    def _refit(self) -> None:
        self._origin = own_s, origin_ns = self._points[-1]
        since_s = np.array([cell_s - own_s for cell_s, _ in self._points])
        late_s = np.array([(arrival_ns - origin_ns) * 1e-9 for _, arrival_ns in self._points]) - since_s
        self._line = fit_robust_line(since_s, late_s)


def _cell(point: _Point) -> int:
    return point[1] // _CELL_NS


def _late_ns(point: _Point) -> float:
    return point[1] - point[0] * 1e9
