"""Short averages of a stream, so that what follows it costs the same at 100 Hz and at 100 kHz."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

BIN_S = 0.002


@dataclass(frozen=True, eq=False, slots=True)
class BinAverages:
    """Averages over consecutive bins of equal length; bins without a single reading are left out.

    Attributes
    ----------
    middle : (n,) float64
        Sample index of the middle of each bin.
    table_m, relative_m : (n,) float64
        Mean displacements (m); `relative_m` is NaN where gauge 2 has no reading.
    """

    center: Floats
    table_m: Floats
    relative_m: Floats

    def __len__(self) -> int:
        return len(self.center)

    def __getitem__(self, part: slice) -> "BinAverages":
        return BinAverages(self.center[part], self.table_m[part], self.relative_m[part])


class BinAverager:
    """Averages samples over bins of 2 ms, or of one sample at slow rates, whatever blocks they come in."""

    def __init__(self, rate_hz: float) -> None:
        self.samples_per_bin = max(1, round(rate_hz * BIN_S))
        self._bin: int | None = None
        self._sums = np.zeros((4, 1))

    def add(self, first_index: int, table_m: Floats, relative_m: Floats) -> BinAverages:
        """Bins that these consecutive samples (n,) complete; NaN is no reading.

        Blocks must join: `first_index` is where the block before ended.
        """
        if not len(table_m):
            return _bins(np.zeros((4, 0)), 0, 1)
        n = self.samples_per_bin
        first = first_index // n if self._bin is None else self._bin
        keys = np.arange(first_index, first_index + len(table_m)) // n - first
        end = (first_index + len(table_m)) // n
        sums = np.zeros((4, end - first + 1))
        sums[:, :1] = self._sums
        for row, values in ((0, table_m), (2, relative_m)):
            present = ~np.isnan(values)
            sums[row] += np.bincount(keys[present], values[present], minlength=sums.shape[1])
            sums[row + 1] += np.bincount(keys[present], minlength=sums.shape[1])
        self._bin, self._sums = end, sums[:, -1:]
        return _bins(sums[:, :-1], first, n)


def _bins(sums: Floats, first: int, samples_per_bin: int) -> BinAverages:
    """Means from rows table sum, table count, relative sum, relative count."""
    there = sums[1] > 0
    middle: Floats = (np.flatnonzero(there).astype(np.float64) + first + 0.5) * samples_per_bin - 0.5
    with np.errstate(invalid="ignore"):  # 0 / 0 where gauge 2 has no reading: NaN, as promised
        means: Floats = sums[::2, there] / sums[1::2, there]
    return BinAverages(middle, means[0], means[1])
