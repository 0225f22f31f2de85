import time

import pytest

from drivers import host_time
from drivers.host_time import ActiveTimer, HostMonitor, host_ns, suspended_ns


class Clocks:
    """Host and wall clock (ns) under a test's hand."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.host = self.asleep = 0
        self.wall = 1_800_000_000_000_000_000
        monkeypatch.setattr(host_time, "host_ns", lambda: self.host)
        monkeypatch.setattr(host_time, "suspended_ns", lambda: self.asleep)
        monkeypatch.setattr(host_time.time, "time_ns", lambda: self.wall)

    def go(self, host_s: float, wall_s: float | None = None, asleep_s: float = 0.0) -> None:
        self.host += round(host_s * 1e9)
        self.asleep += round(asleep_s * 1e9)
        self.wall += round((host_s if wall_s is None else wall_s) * 1e9)


@pytest.fixture
def clocks(monkeypatch):
    return Clocks(monkeypatch)


def test_the_host_clock_goes_on():
    before, slept = host_ns(), suspended_ns()
    time.sleep(0.02)
    assert host_ns() - before >= 15_000_000
    assert abs(suspended_ns() - slept) < 10_000_000
    assert HostMonitor().check() == []


def test_a_quiet_host_has_nothing_to_say(clocks):
    watch = HostMonitor()
    for _ in range(1000):
        clocks.go(0.02, wall_s=0.02 * (1 + 5e-4))  # slewed as fast as a time server may
        assert watch.check() == []


def test_a_sleep_is_noticed_and_is_no_leap_of_the_clock(clocks):
    watch = HostMonitor()
    clocks.go(61.0, asleep_s=60.0)
    (note,) = map(str, watch.check())
    assert note.startswith("this computer slept for 60.0 s: ")
    assert watch.check() == []


def test_time_in_which_nobody_could_listen_does_not_count(monkeypatch):
    now_ns = 5_000_000_000
    monkeypatch.setattr("drivers.host_time.host_ns", lambda: now_ns)
    silent = ActiveTimer(2.0)
    for step_s in (0.5, 1.5, 30.0, 0.25):  # while it stood still for 30 s
        now_ns += round(step_s * 1e9)
        passed_s = silent.elapsed_s()
    assert passed_s == 2.25
    silent.restart()
    now_ns += 1_000_000_000
    assert silent.elapsed_s() == 1.0


def test_standing_still_is_noticed(clocks):
    watch = HostMonitor()
    clocks.go(4.0)
    (note,) = map(str, watch.check())
    assert "stood still for 4.0 s" in note


@pytest.mark.parametrize(("wall_s", "said"), [(3600.2, "forward by 3600.0 s"), (-59.8, "back by 60.0 s")])
def test_a_leap_of_the_time_of_day_is_noticed_once(clocks, wall_s, said):
    watch = HostMonitor()
    clocks.go(0.2, wall_s=wall_s)
    (note,) = map(str, watch.check())
    assert said in note
    clocks.go(0.2)
    assert watch.check() == []
