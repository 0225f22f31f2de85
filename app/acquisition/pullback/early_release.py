"""Release of a table that was not held as wanted: noticed by its free swing, to the other side and back."""

from collections import deque
from dataclasses import dataclass

_PULLED = 0.1  # least pulled distance, as a fraction of the pullback: from less, the plate hardly slides
_CROSSED = 0.01  # fraction of the pullback beyond which the table counts as being on the other side
_LEAVING = 0.9  # part of a turning point below which the table has left it
_SWUNG = 0.25
"""Least part of the pulled distance that a free table reaches on the other side. A sliding plate takes up to
2 m2 / (m1 + m2) of it, half with the heaviest plate of the paper."""
_SWING_S = 1.5  # longest half swing: a release is confirmed within the same time


@dataclass(slots=True)
class _Turn:
    """Turning point: displacement from the zero (m), and the last index at which the table was near it."""

    displacement_m: float
    left_index: float

    @property
    def distance_m(self) -> float:
        return abs(self.displacement_m)


class EarlyReleaseDetector:
    """Notices free swings of a table by their turning points; `nominal_m` is the pullback."""

    def __init__(self, nominal_m: float, rate_hz: float) -> None:
        self._least_m = _PULLED * nominal_m
        self._crossed_m = _CROSSED * nominal_m
        self._longest = _SWING_S * rate_hz
        self._turns: deque[_Turn] = deque(maxlen=3)
        self.reset()

    def reset(self) -> None:
        self._turns.clear()
        self._turns += [_Turn(0.0, 0.0) for _ in range(3)]

    def update(self, index: float, displacement_m: float) -> float | None:
        """Take the table's displacement from its zero (m); NaN is no reading.

        Returns the distance of a release (m) as soon as the table has swung to the other side and back.
        """
        turn, distance_m = self._turns[-1], abs(displacement_m)
        if displacement_m * turn.displacement_m < 0.0 and distance_m > self._crossed_m:
            released_m = self._released_m(index)
            self._turns.append(_Turn(displacement_m, index))
            return released_m
        if distance_m > turn.distance_m:
            turn.displacement_m = displacement_m
        if distance_m >= _LEAVING * turn.distance_m:
            turn.left_index = index
        return None

    def _released_m(self, index: float) -> float | None:
        """Distance of a release, if the half swing that ends at `index` is the first one after it."""
        before, pulled, swung = self._turns
        is_pull = pulled.distance_m >= self._least_m and pulled.distance_m > before.distance_m
        is_decaying = _SWUNG * pulled.distance_m <= swung.distance_m <= pulled.distance_m
        is_fast = max(swung.left_index - pulled.left_index, index - swung.left_index) <= self._longest
        return pulled.distance_m if is_pull and is_decaying and is_fast else None
