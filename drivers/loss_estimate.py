"""How many samples the host's clock says are lost, where nothing in the stream tells it."""

_WINDOW_NS = 1_000_000_000
_JITTER_S = 0.1
"""A count that lags behind the host's clock by less proves nothing."""
_CAME_BACK = 1.5
"""Nor does one by so many times what came after all, earlier in the stream: this computer is that busy."""
_CLOCK = 5e-4
"""Nor does what a device's clock, or the rate that it rounded, may be wrong by."""


class LossEstimator:
    """Compares the samples that came with the time that has passed.

    A busy computer takes samples late and catches up; what is lost stays lost. So the lag is the least of
    the last one to two seconds, against the least that there ever was.

    Parameters
    ----------
    rate_hz : float
        Nominal rate, > 0.
    """

    def __init__(self, rate_hz: float) -> None:
        self._rate_hz = rate_hz
        self._first: tuple[int, int] | None = None
        self._window = 0
        self._elapsed_s = 0.0
        self._least = self._before = self._now = 0.0
        self._worst = self._came_back = 0.0

    @property
    def lost(self) -> int:
        """Samples that should have come and did not."""
        jitter = max(_JITTER_S * self._rate_hz, _CAME_BACK * self._came_back)
        proves_nothing = jitter + _CLOCK * self._elapsed_s * self._rate_hz
        return int(self._lag) if self._lag > max(1.0, proves_nothing) else 0

    @property
    def _lag(self) -> float:
        return min(self._before, self._now) - self._least

    def add(self, samples: int, arrival_ns: int) -> None:
        """Take notice of a read: samples until then, absent rows included, and when it came (ns)."""
        if self._first is None:
            self._first = (samples, arrival_ns)
        passed_ns = arrival_ns - self._first[1]
        self._elapsed_s = passed_ns * 1e-9
        lag = self._elapsed_s * self._rate_hz - (samples - self._first[0])
        self._least = min(self._least, lag)
        if passed_ns // _WINDOW_NS == self._window:
            self._now = min(self._now, lag)
        else:
            self._window = passed_ns // _WINDOW_NS
            self._before, self._now = self._now, lag
            self._worst = max(self._worst, self._lag)
            self._came_back = max(self._came_back, self._worst - self._lag)
