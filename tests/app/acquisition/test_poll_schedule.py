"""How often the engine takes what was read, and how long bytes gather before."""

import pytest

from app.acquisition.engine import Latency, PollSchedule


class Clock:
    """A clock that goes on by what is slept, and by what is done in between."""

    def __init__(self) -> None:
        self.now_s = 1000.0
        self.slept_s: list[float] = []

    def perf_counter(self) -> float:
        return self.now_s

    def sleep(self, duration_s: float) -> None:
        self.slept_s.append(duration_s)
        self.now_s += duration_s


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    monkeypatch.setattr("app.acquisition.engine.time", clock)
    return clock


def test_while_nobody_waits_it_rests_until_a_tenth_of_a_second_is_over(clock):
    beat = PollSchedule(low_latency=False)
    for worked_s in (0.03, 0.2, 0.05):
        beat.wait(Latency.BATCHED)
        clock.now_s += worked_s
    assert clock.slept_s == pytest.approx([0.0, 0.07, 0.0])


@pytest.mark.parametrize("haste", [Latency.INTERACTIVE, Latency.IMMEDIATE])
def test_who_waits_is_not_kept_waiting(clock, haste):
    beat = PollSchedule(low_latency=False)
    beat.wait(haste)
    beat.wait(haste)
    assert clock.slept_s == []


def test_nor_is_who_looks_on(clock):
    beat = PollSchedule(low_latency=True)
    beat.wait(Latency.BATCHED)
    beat.wait(Latency.BATCHED)
    assert clock.slept_s == []
    assert beat.pause_s(Latency.BATCHED) <= 0.02


def test_the_more_haste_the_less_gathers():
    beat = PollSchedule(low_latency=False)
    calm_s, awake_s, urgent_s = map(beat.pause_s, Latency)
    assert calm_s == awake_s > 10 * urgent_s > 0.0
