"""What the rate of a stream is: by the device's own times, and by the host's clock."""

import numpy as np
from numpy.typing import NDArray

MIN_STEPS = 5
MIN_SPAN_S = 0.5
"""Fewer steps, or less time, do not tell a rate."""
_COARSE = 4.0


def rate_of_steps(steps_s: NDArray[np.float64], resolution_s: float = 0.0) -> float | None:
    """Samples a second from the device-time steps between samples, some of which may be missing.

    The median step tells how many periods each step spans; the rate is all periods over all time.
    Where the clock is too coarse for that, steps count as one period each.

    Parameters
    ----------
    steps_s : (n,) float64
        Differences of consecutive device times (s), none negative.
    resolution_s : float
        Step of the device's clock (s).

    Returns
    -------
    float or None
        None while there are fewer than 5 steps or 0.5 s of them.
    """
    span_s = float(steps_s.sum())
    if len(steps_s) < MIN_STEPS or span_s < MIN_SPAN_S:
        return None
    median_s = float(np.median(steps_s))
    if median_s < _COARSE * resolution_s or median_s == 0:
        return len(steps_s) / span_s
    return float(np.rint(steps_s / median_s).sum()) / span_s
