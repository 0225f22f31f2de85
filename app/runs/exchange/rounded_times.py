"""Times of a logger that rounds them: rows of an even rate, with stamps that repeat."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
_STEPS_MIN = 4  # stamps that differ: fewer tell no rate
_UNIFORM = 12.0**-0.5
"""Standard deviation of what is equally likely within 1 (JCGM 100, 4.3.7)."""


@dataclass(frozen=True, eq=False, slots=True)
class EvenTimes:
    """Even times that fit rounded stamps."""

    time: Floats
    """(n,), in the unit of the stamps."""
    interval: float
    interval_relative_uncertainty: float
    """Standard uncertainty: where a stamp changes, the time is known to one row."""
    resolution: float


def even_times(stamps: Floats) -> EvenTimes | None:
    """Even times of rows whose stamps (n,) never go back and repeat; None where the rows are not even.

    The line through the rows at which the stamp changes gives the interval. All these lie within one
    resolution and one interval of it, else rows are missing or the rate varies.
    """
    steps = np.diff(stamps)
    changes = np.flatnonzero(steps > 0.0) + 1
    repeated = np.flatnonzero(steps == 0.0) + 1
    if len(changes) < _STEPS_MIN or not len(repeated):
        return None
    after_repeats = changes[np.isin(changes - 1, repeated)]
    resolution = float(np.median(steps[after_repeats - 1])) if len(after_repeats) else float(steps.max())
    # A change is seen in the row after it, so half an interval later in the mean.
    rows = changes - 0.5
    centred = rows - rows.mean()
    spread = float(centred @ centred)
    interval = float(centred @ stamps[changes]) / spread
    begin = float(stamps[changes].mean()) - interval * float(rows.mean())
    if interval <= 0.0 or np.abs(begin + interval * rows - stamps[changes]).max() > resolution + interval:
        return None
    time = np.arange(len(stamps), dtype=np.float64) * interval + begin
    return EvenTimes(time, interval, _UNIFORM / spread**0.5, resolution)
