"""Counts of a gauge averaged over a window, for a calibration or a check."""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from app.acquisition.errors import AcquisitionError
from drivers.arrays import Floats
from drivers.samples import ABSENT_BY_GAUGE, SampleStatus

if TYPE_CHECKING:  # the window, which shows averages, decodes nothing
    from app.acquisition.stream.live_stream import DecodedRead, LiveStream

TIMEOUT_S = 5.0
_STALE_S = 0.1
"""Samples that were sent before the request may still be under way for so long."""
OVERLOAD_FLAGS = (SampleStatus.OVERLOAD_TABLE, SampleStatus.OVERLOAD_RELATIVE)
_VALID_FRACTION = 0.5
"""Least fraction of valid samples in a window: below it the gauge is hardly in range."""
_STEADY = 6.0
"""Standard errors of the difference of the halves up to which a window counts as steady."""


@dataclass(frozen=True, slots=True)
class AveragedCounts:
    """Counts of one gauge over a window."""

    counts: float
    """Mean."""
    noise_counts: float
    """Standard deviation of a sample."""
    samples: int
    creep_counts: float
    """Mean of the second half minus that of the first."""

    @property
    def is_steady(self) -> bool:
        """Whether noise alone explains the difference of the halves."""
        return abs(self.creep_counts) <= _STEADY * 2.0 * self.noise_counts / float(np.sqrt(self.samples))


def compute_average(counts: Floats) -> AveragedCounts:
    """Average of the samples (n,) of a window, n >= 2."""
    half = len(counts) // 2
    creep = float(counts[half:].mean() - counts[:half].mean())
    return AveragedCounts(float(counts.mean()), float(counts.std(ddof=1)), len(counts), creep)


class NoAverageError(AcquisitionError):
    """A window without an average."""


class CountAverager:
    """Averages counts of a stream, which a thread reads so that none are lost; use it with `with`.

    The stream is open and is not closed here. Channel 0 is gauge 1, channel 1 is gauge 2.
    """

    def __init__(self, stream: "LiveStream", channel: int) -> None:
        self._stream = stream
        self._channel = channel
        self._flag = int(ABSENT_BY_GAUGE[channel] | OVERLOAD_FLAGS[channel])
        self._changed = threading.Condition()
        self._taken: list[Floats] | None = None
        self._invalid = 0
        self._fault: Exception | None = None
        self._leaving = False
        self._thread = threading.Thread(target=self._read, name="settled counts", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._leaving = True
        self._thread.join()

    def average(self, window_s: float) -> AveragedCounts:
        """Average of the samples from now on.

        Raises NoAverageError if too few samples come or are valid. Raises AcquisitionError or DriverError if
        the stream has ended.
        """
        stale, wanted = (round(span_s * self._stream.rate_hz) for span_s in (_STALE_S, window_s))
        enough = stale + max(wanted, 2)
        with self._changed:
            self._taken, self._invalid = [], 0
            came = self._changed.wait_for(
                lambda: self._fault is not None or self._seen() >= enough, window_s + TIMEOUT_S
            )
            taken, self._taken = self._taken, None
        if self._fault is not None:
            raise self._fault
        if not came:
            raise NoAverageError(
                "only {samples} samples came in {window_s:g} s. Check cable, power and rate of the device",
                samples=sum(map(len, taken)),
                window_s=window_s + TIMEOUT_S,
            )
        valid = np.concatenate(taken)[stale:]
        if len(valid) < max(_VALID_FRACTION * wanted, 2):
            raise NoAverageError(
                "gauge {gauge} is overloaded or its samples are damaged: {invalid} of {samples}. Move it"
                " back into its range, or check the cable",
                gauge=self._channel + 1,
                invalid=self._invalid,
                samples=self._invalid + sum(map(len, taken)),
            )
        return compute_average(valid)

    def steady_average(
        self, window_s: float, windows: int, on_unsteady: Callable[[AveragedCounts], None]
    ) -> AveragedCounts:
        """First steady average of up to so many windows, else the last; `on_unsteady` receives the others."""
        for _ in range(windows - 1):
            average = self.average(window_s)
            if average.is_steady:
                return average
            on_unsteady(average)
        return self.average(window_s)

    def _seen(self) -> int:
        return self._invalid + sum(map(len, self._taken or []))

    def _read(self) -> None:
        try:
            while not self._leaving:
                chunk = self._stream.next_read(0.05)
                if chunk is not None:
                    self._take(chunk)
        except Exception as error:  # raised by the call that waits for an average
            with self._changed:
                self._fault = error
                self._changed.notify_all()

    def _take(self, chunk: "DecodedRead") -> None:
        with self._changed:
            if self._taken is None:
                return
            for rows in chunk.rows:
                valid = (rows.status & self._flag) == 0
                self._taken.append(rows.counts[valid, self._channel].astype(np.float64))
                self._invalid += int(np.count_nonzero(~valid))
            self._changed.notify_all()
