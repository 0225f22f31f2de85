"""Clocks of this computer: the one that stamps arrivals, and what can disturb it."""

import sys
import time

from messages.i18n import N_
from messages.message import Message, message

if sys.platform == "win32":

    def _clocks() -> tuple[int, int]:
        now_ns = time.perf_counter_ns()  # `monotonic` has steps of up to 16 ms before Python 3.13
        return now_ns, now_ns

elif sys.platform == "darwin":

    def _clocks() -> tuple[int, int]:
        return time.clock_gettime_ns(time.CLOCK_MONOTONIC), time.clock_gettime_ns(time.CLOCK_UPTIME_RAW)

else:

    def _clocks() -> tuple[int, int]:
        return time.clock_gettime_ns(time.CLOCK_BOOTTIME), time.clock_gettime_ns(time.CLOCK_MONOTONIC)


def host_ns() -> int:
    """Monotonic time (ns) that stamps arrivals; it goes on while this computer is suspended."""
    return _clocks()[0]


def suspended_ns() -> int:
    """How long of `host_ns` this computer was suspended (ns); 0 where the system does not report it."""
    host, awake = _clocks()
    return host - awake


class ActiveTimer:
    """Time during which this process ran; more than `longest_step_s` between two calls does not count."""

    def __init__(self, longest_step_s: float) -> None:
        self._longest_step_ns = longest_step_s * 1e9
        self.restart()

    def restart(self) -> None:
        self._called_ns, self._elapsed_ns = host_ns(), 0

    def elapsed_s(self) -> float:
        """Seconds since the start, time in which the process stood still left out; to be called often."""
        before_ns, self._called_ns = self._called_ns, host_ns()
        step_ns = self._called_ns - before_ns
        if step_ns <= self._longest_step_ns:
            self._elapsed_ns += step_ns
        return self._elapsed_ns * 1e-9


class ArrivalRate:
    """Rate at which samples arrive, in windows of time; in those of a busy computer it differs."""

    _STEADY = 0.05
    _STEADY_SAMPLES = 2.0
    """How far windows of an even stream differ: a read is late by up to 20 ms, and holds whole samples."""

    def __init__(self, window_s: float) -> None:
        self._window_s = window_s
        self._begin: tuple[int, float] | None = None
        self.windows_hz: list[float] = []  # samples a second in each complete window, the latest last

    def add(self, samples: float) -> None:
        """Take the number of samples that have come until now, after a read; the first begins the window."""
        now_ns = host_ns()
        elapsed_s = 0.0 if self._begin is None else (now_ns - self._begin[0]) * 1e-9
        if self._begin is not None and elapsed_s >= self._window_s:
            self.windows_hz.append((samples - self._begin[1]) / elapsed_s)
        if self._begin is None or elapsed_s >= self._window_s:
            self._begin = (now_ns, samples)

    @property
    def steady_hz(self) -> float | None:
        """Mean of the windows; None where there are fewer than two, or they differ."""
        if len(self.windows_hz) < 2:
            return None
        mean_hz = sum(self.windows_hz) / len(self.windows_hz)
        allowed_hz = self._STEADY * mean_hz + self._STEADY_SAMPLES / self._window_s
        return mean_hz if max(self.windows_hz) - min(self.windows_hz) <= allowed_hz else None


class HostMonitor:
    """Detects that this computer was suspended, stood still, or had its clock set; to be checked often."""

    _INTERVAL_NS = 100_000_000
    _SUSPENDED_S = 0.5
    _STALLED_S = 3.0
    """Longer than a busy computer stops any process, shorter than a stall that loses bytes unseen."""
    _CLOCK_STEP_S = 0.5  # more than a time server slews in 0.1 s

    def __init__(self) -> None:
        self._times_ns = host_ns(), suspended_ns(), time.time_ns()

    def check(self) -> list[Message]:
        """What happened since the last call; the clocks are read ten times a second at most."""
        if host_ns() - self._times_ns[0] < self._INTERVAL_NS:
            return []
        before_ns, self._times_ns = self._times_ns, (host_ns(), suspended_ns(), time.time_ns())
        passed_s, suspended_s, wall_s = (
            (now - before) * 1e-9 for now, before in zip(self._times_ns, before_ns, strict=True)
        )
        found, step_s = [], wall_s - passed_s
        if suspended_s > self._SUSPENDED_S:
            found.append(message(_SUSPENDED, duration_s=suspended_s))
        elif passed_s > self._STALLED_S:
            found.append(message(_STALLED, duration_s=passed_s))
        if abs(step_s) > self._CLOCK_STEP_S:
            found.append(message(_SET_FORWARD if step_s > 0 else _SET_BACK, step_s=abs(step_s)))
        return found


_SUSPENDED = N_("this computer slept for {duration_s:.1f} s: switch its energy saving off to record")
_STALLED = N_("this computer or Slipstand stood still for {duration_s:.1f} s: close other programs")
_SET_FORWARD = N_(
    "the clock of this computer was set forward by {step_s:.1f} s:"
    " times of day before and after do not fit together, those within a run do"
)
_SET_BACK = N_(
    "the clock of this computer was set back by {step_s:.1f} s:"
    " times of day before and after do not fit together, those within a run do"
)
