"""Counts of a gauge averaged over a window, for a calibration or a check."""

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from app.acquisition.errors import AcquisitionError
from app.acquisition.ring import RingRows, timed_rows
from drivers.arrays import Floats
from drivers.samples import ABSENT_BY_GAUGE, SampleStatus
from messages.i18n import N_

if TYPE_CHECKING:  # the window, which shows averages, decodes nothing
    from app.acquisition.stream.live_stream import LiveStream

TIMEOUT_S = 5.0
WINDOW_S = 1.0  # length of an averaging window: 1 s averages whole periods of 50 and 60 Hz hum
MAX_WINDOWS = 5
"""A reading waits at most this many windows until the gauge is at rest, then it is taken with a warning."""
OVERLOAD_FLAGS = (SampleStatus.OVERLOAD_TABLE, SampleStatus.OVERLOAD_RELATIVE)
_STALE_S = 0.1  # samples that were sent before the request may still be under way for so long
_VALID_FRACTION = 0.5  # least fraction of valid samples in a window: below it the gauge is hardly in range
_STEADY = 6.0  # standard errors of the difference of the halves up to which a window counts as steady


@dataclass(frozen=True, slots=True)
class AveragedCounts:
    """Counts of one gauge over a window."""

    counts: float
    noise_counts: float  # standard deviation of a sample
    samples: int
    creep_counts: float  # mean of the second half minus that of the first

    @property
    def is_steady(self) -> bool:
        """Noise alone explains the difference of the halves."""
        return abs(self.creep_counts) <= _STEADY * 2.0 * self.noise_counts / float(np.sqrt(self.samples))


class NoAverageError(AcquisitionError):
    """A window without an average."""


def compute_average(counts: Floats) -> AveragedCounts:
    """Average of the samples (n,) of a window, n >= 2."""
    half = len(counts) // 2
    creep = float(counts[half:].mean() - counts[:half].mean())
    return AveragedCounts(float(counts.mean()), float(counts.std(ddof=1)), len(counts), creep)


def average_counts(rows: RingRows, channel: int) -> AveragedCounts:
    """Average the counts of gauge 1 (channel 0) or gauge 2 (channel 1). Raises NoAverageError."""
    valid = (rows.status & int(ABSENT_BY_GAUGE[channel] | OVERLOAD_FLAGS[channel])) == 0
    counts = rows.counts[valid, channel].astype(np.float64)
    if len(counts) < max(_VALID_FRACTION * len(rows), 2):
        template = N_(
            "gauge {gauge} is overloaded or its samples are damaged: {invalid} of {samples}. Move it"
            " back into its range, or check the cable"
        )
        raise NoAverageError(template, gauge=channel + 1, invalid=len(rows) - len(counts), samples=len(rows))
    return compute_average(counts)


class RecentSamples:
    """The newest rows of a stream, `seconds` long."""

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._parts: deque[RingRows] = deque()

    @property
    def end_s(self) -> float:
        return float(self._parts[-1].time_s[-1]) if self._parts else math.nan

    @property
    def length_s(self) -> float:
        return self.end_s - float(self._parts[0].time_s[0]) if self._parts else 0.0

    def append(self, rows: RingRows) -> None:
        if not len(rows):
            return
        self._parts.append(rows)
        while rows.time_s[-1] - self._parts[0].time_s[-1] > self._seconds:
            self._parts.popleft()

    def clear(self) -> None:
        self._parts.clear()

    def since(self, start_s: float) -> RingRows | None:
        parts = [rows for rows in self._parts if rows.time_s[-1] >= start_s]
        if not parts:
            return None
        names = ("counts", "readings", "relative_m", "status", "time_s")
        columns: dict[str, Any] = {
            name: np.concatenate([getattr(rows, name) for rows in parts]) for name in names
        }
        skipped = int(np.searchsorted(columns["time_s"], start_s))
        return RingRows(
            parts[0].first_index + skipped, **{name: column[skipped:] for name, column in columns.items()}
        )


class ReadingAverager:
    """Averages one reading of recent samples once the gauge is at rest."""

    def __init__(
        self, recent: RecentSamples, window_s: float = WINDOW_S, max_windows: int = MAX_WINDOWS
    ) -> None:
        self._recent = recent
        self._window_s = window_s
        self._max_windows = max_windows
        self._since_s = math.nan
        self._windows = 0

    @property
    def is_active(self) -> bool:
        return self._windows > 0

    def start(self) -> bool:
        """Begin a reading; False without samples."""
        if not math.isfinite(self._recent.end_s):
            return False
        self._windows, self._since_s = 1, self._recent.end_s + _STALE_S
        return True

    def stop(self) -> None:
        self._windows = 0

    def poll(self, gauge: int) -> AveragedCounts | None:
        """Average of a whole window; the reading is taken if it is inactive then. Raises NoAverageError."""
        if not self.is_active or self._recent.end_s < self._since_s + self._window_s:
            return None
        rows = self._recent.since(self._since_s)
        if rows is None or len(rows) < 2:
            return None
        windows, self._windows = self._windows, 0
        average = average_counts(rows, gauge)
        if not average.is_steady and windows < self._max_windows:
            self._windows, self._since_s = windows + 1, self._recent.end_s
        return average


class CountAverager:
    """Averages counts of an open stream, which a thread reads so that none are lost; use it with `with`."""

    def __init__(self, stream: "LiveStream", channel: int) -> None:
        self._stream = stream
        self._channel = channel
        self._changed = threading.Condition()
        self._recent: RecentSamples | None = None
        self._samples = 0
        self._fault: Exception | None = None
        self._leaving = False
        self._thread = threading.Thread(target=self._read, name="averaged counts", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._leaving = True
        self._thread.join()

    def steady_average(
        self,
        window_s: float,
        max_windows: int = MAX_WINDOWS,
        on_unsteady: Callable[[AveragedCounts], None] = lambda _: None,
    ) -> AveragedCounts:
        """Average of a window from now on. Raises NoAverageError, and what ended the stream."""
        recent = RecentSamples(window_s + TIMEOUT_S)
        averager = ReadingAverager(recent, window_s, max_windows)
        with self._changed:
            self._recent, self._samples = recent, 0
            while True:
                average = self._next_window(averager, window_s)
                if not averager.is_active:
                    self._recent = None
                    return average
                on_unsteady(average)

    def _next_window(self, averager: ReadingAverager, window_s: float) -> AveragedCounts:
        until_s = time.perf_counter() + window_s + TIMEOUT_S
        while self._fault is None:
            average = averager.poll(self._channel) if averager.is_active or averager.start() else None
            if average is not None:
                return average
            if not self._changed.wait(max(0.0, until_s - time.perf_counter())):
                template = N_(
                    "only {samples} samples came in {window_s:g} s. Check cable, power and rate of the device"
                )
                raise NoAverageError(template, samples=self._samples, window_s=window_s + TIMEOUT_S)
        raise self._fault

    def _read(self) -> None:
        try:
            while not self._leaving:
                read = self._stream.next_read(0.05)
                with self._changed:
                    if read is None or self._recent is None:
                        continue
                    for rows in read.rows:
                        self._recent.append(timed_rows(rows, self._stream.rate_hz))
                        self._samples += len(rows)
                    self._changed.notify_all()
        except Exception as error:  # raised by the call that waits for an average
            with self._changed:
                self._fault = error
                self._changed.notify_all()
