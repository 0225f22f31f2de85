"""Clocks of this computer: the one that stamps what arrives, and what can go wrong with them."""

import sys
import time

if sys.platform == "win32":

    def _clocks() -> tuple[int, int]:
        now_ns = time.perf_counter_ns()  # `monotonic` is as coarse as 16 ms before Python 3.13
        return now_ns, now_ns

elif sys.platform == "darwin":

    def _clocks() -> tuple[int, int]:
        return time.clock_gettime_ns(time.CLOCK_MONOTONIC), time.clock_gettime_ns(time.CLOCK_UPTIME_RAW)

else:

    def _clocks() -> tuple[int, int]:
        return time.clock_gettime_ns(time.CLOCK_BOOTTIME), time.monotonic_ns()


def host_ns() -> int:
    """Nanoseconds that never leap, and go on while this computer sleeps: what stamps arrivals."""
    return _clocks()[0]


def suspended_ns() -> int:
    """Nanoseconds of `host_ns` during which this computer slept; always 0 where it does not tell."""
    host, awake = _clocks()
    return host - awake


class ActiveTimer:
    """Time in which somebody could listen: while this computer stands still nobody does.

    Parameters
    ----------
    stood_s : float
        Who asks again only after so long stood still (s).
    """

    def __init__(self, longest_step_s: float) -> None:
        self._stood_ns = longest_step_s * 1e9
        self.restart()

    def restart(self) -> None:
        """Count from now on."""
        self._asked_ns, self._passed_ns = host_ns(), 0

    def elapsed_s(self) -> float:
        """Seconds since it began, but for those in which nobody listened; ask often."""
        before_ns, self._asked_ns = self._asked_ns, host_ns()
        since_ns = self._asked_ns - before_ns
        if since_ns <= self._stood_ns:
            self._passed_ns += since_ns
        return self._passed_ns * 1e-9


class HostMonitor:
    """Notices when this computer slept, stood still, or had its clock set; `look` often, it costs little."""

    _EVERY_NS = 100_000_000

    _SLEPT_S = 0.5
    _STOOD_S = 3.0
    _LEAP_S = 0.5

    def __init__(self) -> None:
        self._host_ns = host_ns()
        self._asleep_ns = suspended_ns()
        self._wall_ns = time.time_ns()

    def check(self) -> list[str]:
        """What has happened since it was last told, in sentences; looked at ten times a second at most."""
        if host_ns() - self._host_ns < self._EVERY_NS:
            return []
        before_ns = (self._host_ns, self._asleep_ns, self._wall_ns)
        self._host_ns, self._asleep_ns, self._wall_ns = host_ns(), suspended_ns(), time.time_ns()
        passed_s, slept_s, wall_s = (
            (now - before) * 1e-9
            for now, before in zip((self._host_ns, self._asleep_ns, self._wall_ns), before_ns, strict=True)
        )
        notes = []
        if slept_s > self._SLEPT_S:
            notes.append(f"this computer slept for {slept_s:.1f} s: switch its energy saving off to record")
        elif passed_s > self._STOOD_S:
            notes.append(f"this computer or Slipstand stood still for {passed_s:.1f} s: close other programs")
        if abs(wall_s - passed_s) > self._LEAP_S:
            way = "forward" if wall_s > passed_s else "back"
            notes.append(
                f"the clock of this computer was set {way} by {abs(wall_s - passed_s):.1f} s:"
                " times of day before and after do not fit together, those within a run do"
            )
        return notes
