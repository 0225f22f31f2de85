"""The rest before a pull: the zeros of both gauges."""

import math
from collections import deque
from dataclasses import dataclass

_KEPT_S = 10.0
_KNOWN_S = 0.15
"""The zero is known when the levels of so long a time agree; each is itself a mean over 0.3 s."""
_BEFORE_S = 1.3
"""The zero is taken so long before the pull is noticed: a smooth pull begins unnoticed."""


@dataclass(frozen=True, slots=True)
class ZeroLevel:
    """A moment of rest: sample at which it began, and what both gauges read (m)."""

    since: float
    table_m: float
    relative_m: float


class ZeroEstimator:
    """Moments of rest, of the last ten seconds at most."""

    def __init__(self, rate_hz: float, tick_s: float) -> None:
        self._rate_hz = rate_hz
        self._zeros: deque[ZeroLevel] = deque(maxlen=round(_KEPT_S / tick_s))

    def add(self, zero: ZeroLevel) -> None:
        """Take the latest moment of rest."""
        self._zeros.append(zero)

    def reset(self) -> None:
        """Begin anew: table or plate were moved."""
        self._zeros.clear()

    @property
    def has_levels(self) -> bool:
        """Tell whether there was any moment of rest."""
        return bool(self._zeros)

    @property
    def is_known(self) -> bool:
        """Tell whether there was rest enough for a zero."""
        return self.has_levels and self._zeros[-1].since - self._zeros[0].since >= _KNOWN_S * self._rate_hz

    @property
    def latest(self) -> ZeroLevel:
        """The last moment of rest. Raises IndexError before any."""
        return self._zeros[-1]

    def pulled_m(self, table_m: float) -> float:
        """How far (m) the table is from where it rested; 0 before any rest.

        From the oldest rest that is remembered, so that a slow pull is noticed as well.
        """
        return abs(table_m - self._zeros[0].table_m) if self._zeros else 0.0

    def level_before(self, index: float, noticed_m: float) -> ZeroLevel:
        """The rest before a pull that was noticed at `index`, at `noticed_m` from it. Raises IndexError."""
        latest = index - _BEFORE_S * self._rate_hz
        chosen = next((zero for zero in reversed(self._zeros) if zero.since <= latest), self._zeros[0])
        is_slow = math.fabs(chosen.table_m - self._zeros[0].table_m) > 0.5 * noticed_m
        return self._zeros[0] if is_slow else chosen
