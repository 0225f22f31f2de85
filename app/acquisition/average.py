"""Counts of a gauge averaged over a window, and whether it stood still meanwhile."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_STEADY = 6.0


@dataclass(frozen=True, slots=True)
class AveragedCounts:
    """Counts of one gauge over a window.

    Attributes
    ----------
    counts, noise_counts : float
        Mean, and standard deviation of a sample.
    samples : int
    creep_counts : float
        Mean of the second half minus that of the first.
    """

    counts: float
    noise_counts: float
    samples: int
    creep_counts: float

    @property
    def is_steady(self) -> bool:
        """Whether noise alone explains the difference of the halves."""
        return abs(self.creep_counts) <= _STEADY * 2.0 * self.noise_counts / float(np.sqrt(self.samples))


def compute_average(counts: NDArray[np.float64]) -> AveragedCounts:
    """Average of the samples (n,) of a window, n >= 2."""
    half = len(counts) // 2
    creep = float(counts[half:].mean() - counts[:half].mean())
    return AveragedCounts(float(counts.mean()), float(counts.std(ddof=1)), len(counts), creep)
