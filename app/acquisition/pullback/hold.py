"""The table held back: since when, and when it leaves."""

from collections import deque
from dataclasses import dataclass

from app.acquisition.pullback.stationarity import StationaryLevel

_NOISES = 6.0
_CREEP = 0.01
"""Part of the pullback that a release must exceed, and a hold may move: less is creep."""


@dataclass(frozen=True, slots=True)
class HoldReference:
    """What both gauges read in the last few hundredths of a second (m); NaN without gauge 2."""

    table_m: float
    relative_m: float
    relative_noise_m: float
    """Of one short average."""
    relative_error_m: float
    """Of `relative_m`."""


class Hold:
    """A hold, from when the table stood still; `leaves` sees its end.

    `began` is the sample at which it began, `since` that from which on it has not crept to speak of.

    Parameters
    ----------
    level : Level
        Of the table when it was found still.
    side : float
        1 or -1: to which side it is pulled.
    pulled_m : float
        How far, without sign (m).
    bins_to_release : int
        So many short averages in a row must be beyond the limit.
    """

    def __init__(self, level: StationaryLevel, side: float, pulled_m: float, bins_to_release: int) -> None:
        self.start = self.since = level.since
        self._level_m = level.mean_m
        self._side = side
        self._pulled_m = pulled_m
        self._bins_to_release = bins_to_release
        self._noise_m = level.noise_m
        self._references: deque[HoldReference] = deque(maxlen=2)
        self._beyond = 0

    @property
    def reference(self) -> HoldReference:
        """Where table and plate stood a moment ago: before the release has begun, if it has."""
        return self._references[0]

    @property
    def is_leaving(self) -> bool:
        """Tell whether the latest average was beyond the limit."""
        return self._beyond > 0

    def update(self, level: StationaryLevel, reference: HoldReference) -> None:
        """The table still stands; one that has crept too far since is held anew."""
        if abs(level.mean_m - self._level_m) > _CREEP * self._pulled_m:
            self.since, self._level_m = level.since, level.mean_m
        self._noise_m = level.noise_m
        self._references.append(reference)

    def detect_release(self, table_m: float) -> bool:
        """Take the next average; tell whether the table leaves its hold towards its zero."""
        if self._references:
            gone_m = self._side * (self.reference.table_m - table_m)
            limit_m = max(_NOISES * self._noise_m, _CREEP * self._pulled_m)
            self._beyond = self._beyond + 1 if gone_m > limit_m else 0
        return self._beyond >= self._bins_to_release
