"""How often the engine takes what was read, and how long bytes gather before."""

import os

import pytest

from app.acquisition.engine import Latency, PollSchedule
from app.child_process import CommandReader


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


@pytest.mark.parametrize(
    ("latency", "slept_s"), [(Latency.IDENTIFIED, [0.0, 0.07, 0.0]), (Latency.BATCHED, [0.0, 0.77, 0.6])]
)
def test_while_nobody_waits_it_rests_until_the_next_step_is_due(clock, latency, slept_s):
    beat = PollSchedule(low_latency=False)
    for worked_s in (0.03, 0.2, 0.05):
        beat.wait(latency, clock.sleep)
        clock.now_s += worked_s
    assert clock.slept_s == pytest.approx(slept_s)


def test_it_does_not_rest_beyond_the_end_of_a_run(clock):
    beat = PollSchedule(low_latency=False)
    for ends_s in (5.0, 0.3, -0.1):
        beat.wait(Latency.BATCHED, clock.sleep, ends_s)
    assert clock.slept_s == pytest.approx([0.0, 0.3, 0.0])


def test_a_command_ends_the_rest():
    """A command must not wait for the next step."""
    read_end, write_end = os.pipe()
    commands = CommandReader(read_end, lambda data: [data])
    os.write(write_end, b"stop")
    commands.wait(60.0)
    assert commands.take() == b"stop"
    assert commands.take() is None
    os.close(write_end)
    commands.wait(60.0)
    assert commands.take() is None
    assert commands.is_closed


@pytest.mark.parametrize("haste", [Latency.INTERACTIVE, Latency.IMMEDIATE])
def test_who_waits_is_not_kept_waiting(clock, haste):
    beat = PollSchedule(low_latency=False)
    beat.wait(haste, clock.sleep)
    beat.wait(haste, clock.sleep)
    assert clock.slept_s == []


def test_nor_is_who_looks_on(clock):
    beat = PollSchedule(low_latency=True)
    beat.wait(Latency.BATCHED, clock.sleep)
    beat.wait(Latency.BATCHED, clock.sleep)
    assert clock.slept_s == []
    assert beat.pause_s(Latency.BATCHED) <= 0.02


def test_the_more_haste_the_less_gathers():
    beat = PollSchedule(low_latency=False)
    *calm_s, urgent_s = map(beat.pause_s, Latency)
    assert len(set(calm_s)) == 1
    assert calm_s[0] > 10 * urgent_s > 0.0
