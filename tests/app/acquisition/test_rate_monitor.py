"""A wrong sampling rate is reported; a busy host causes no false report."""

import numpy as np
import pytest

from app.acquisition.stream.monitors import RateMonitor

RATE_HZ = 1000.0


def notes(scale: float, lateness_s: np.ndarray, seconds: float = 20.0) -> list[str]:
    """What is said of a device that samples at `scale` times its nominal rate, its reads being late."""
    pace = RateMonitor(RATE_HZ, 0)
    indices = np.arange(10, int(seconds * RATE_HZ * scale), 10)
    late_s = np.interp(indices, np.linspace(0, indices[-1], len(lateness_s)), lateness_s)
    arrivals_ns = ((indices / (RATE_HZ * scale) + late_s) * 1e9).astype(np.int64)
    said = [pace.add(int(i), int(t)) for i, t in zip(indices, arrivals_ns, strict=True)]
    return [str(note) for note in said if note]


@pytest.mark.parametrize("scale", [0.5, 0.97, 1.03, 2.0])
def test_a_wrong_rate_is_said_once(scale):
    jitter_s = np.random.default_rng(1).exponential(2e-3, 5000)
    (said,) = notes(scale, jitter_s)
    measured_hz = float(said.split(" samples a second")[0].rpartition(" ")[2])
    assert measured_hz == pytest.approx(RATE_HZ * scale, rel=3e-3)
    assert "check its rate" in said


def test_a_good_rate_is_not_spoken_of():
    assert notes(1.0005, np.random.default_rng(1).exponential(2e-3, 5000)) == []


def test_a_host_that_falls_behind_and_catches_up_is_not_a_wrong_rate():
    rng = np.random.default_rng(2)
    said = 0
    for _ in range(40):
        late_s = np.maximum(0.0, np.cumsum(rng.normal(0.0, 0.1, 60)))  # a second late here and there
        said += bool(notes(1.0, late_s, 30.0))
    assert said <= 2


def follow(delay_s, seconds=40.0, scale=1.0, opened_s=0.0):
    """Notes and estimates of a device at `scale` times its rate, whose samples are `delay_s(t)` late."""
    pace, said, known = RateMonitor(RATE_HZ, round(-opened_s * 1e9)), [], []
    for index in range(10, int(seconds * RATE_HZ * scale), 10):
        taken_s = index / (RATE_HZ * scale)
        note = pace.add(index, round((taken_s + delay_s(taken_s)) * 1e9))
        said += [str(note)] if note else []
        known += [clock] if (clock := pace.recent()) else []
    return said, known


def caught_up(late_s, begins_s):
    """Nothing comes for `late_s`; then the device sends 1.25 times as fast until it is on time."""
    return lambda t: max(0.0, late_s - 0.2 * (t - begins_s)) if t >= begins_s else 0.0


@pytest.mark.parametrize("begins_s", [0.0, 12.0])
@pytest.mark.parametrize("late_s", [0.4, 2.0, 4.0])
def test_a_device_that_catches_up_is_no_quick_device(begins_s, late_s):
    """At the start, where a simulated stand waits for a processor, and behind a gap in the middle."""
    said, known = follow(caught_up(late_s, begins_s))
    assert said == []
    for clock in known:
        assert clock.scale == pytest.approx(1.0, abs=max(2e-3, 3.0 * clock.scale_standard_uncertainty))


def test_an_estimate_outlives_a_minute_of_samples_that_come_late():
    _, known = follow(caught_up(2.0, 20.0), seconds=30.0)
    assert known[-1].scale == pytest.approx(1.0, abs=1e-4)
    assert known[-1].scale_standard_uncertainty < 1e-4


def test_a_device_that_falls_behind_for_a_while_is_no_slow_device():
    """Its buffer fills by 4 % of the time for 10 s, and is emptied again."""
    said, known = follow(lambda t: 0.04 * min(max(t - 5.0, 0.0), max(25.0 - t, 0.0), 10.0), seconds=60.0)
    assert said == []
    for clock in known:
        assert clock.scale == pytest.approx(1.0, abs=max(2e-3, 3.0 * clock.scale_standard_uncertainty))


@pytest.mark.parametrize(("scale", "within_s"), [(1.2, 16.0), (1.03, 80.0), (0.8, 16.0)])
def test_a_wrong_rate_is_told_behind_a_device_that_is_slow_to_start(scale, within_s):
    """Two seconds from the opened port to the first sample, as a board that resets takes."""
    said, known = follow(lambda _: 2.0, seconds=within_s, scale=scale, opened_s=0.0)
    assert len(said) == 1
    assert known[-1].scale == pytest.approx(1 / scale, rel=1e-3)


def test_a_polled_device_has_the_rate_of_its_polls():
    """Its samples are numbered by the clock of the host; polls that are left out leave gaps."""
    pace, rng = RateMonitor(20.0, 0), np.random.default_rng(3)
    for index in np.flatnonzero(rng.uniform(size=2000) < 0.7):
        assert not pace.add(int(index), int((index / 20.0 + rng.exponential(5e-3)) * 1e9))
    assert pace.estimate().scale == pytest.approx(1.0, abs=1e-3)


def test_what_came_while_somebody_stood_still_tells_no_rate():
    """Both sleep for 2 of every 3 s, as on an overloaded computer that simulates its stand."""
    pace, said = RateMonitor(RATE_HZ, 0), []
    indices = np.arange(10, 40_000, 10)
    for index in indices:
        sent_s = index / RATE_HZ * 2.0  # a stand that is stopped as well sends half as fast
        late_s = max(0.0, 2.0 - sent_s % 3.0)
        said.append(pace.add(int(index), int((sent_s + late_s) * 1e9)))
    assert not any(said)


@pytest.mark.parametrize(("every_s", "is_known"), [(3.0, False), (45.0, True)])
def test_a_stream_that_came_late_for_the_most_part_tells_no_clock(every_s, is_known):
    pace = RateMonitor(RATE_HZ, 0)
    for index in np.arange(10, 60_000, 10):
        sent_s = index / RATE_HZ
        late_s = max(0.0, 2.0 - sent_s % every_s)  # nothing is read for 2 s, and then all of it
        pace.add(int(index), int((sent_s + late_s) * 1e9))
    estimate = pace.estimate()
    assert (estimate is not None) == is_known
    if estimate is not None:
        assert estimate.scale == pytest.approx(1.0, abs=1e-4)


def test_a_tenfold_rate_is_said_within_half_a_second_and_known():
    pace, said = RateMonitor(RATE_HZ, 0), []
    for index in range(10, 4000, 10):
        note = pace.add(index, round((0.1 + index / (10 * RATE_HZ)) * 1e9))
        said += [str(note)] if note else []
    assert said == [
        "the device sends 10000 samples a second instead of 1000: check its rate; the analysis allows for it"
    ]
    clock = pace.estimate()
    assert clock.scale == pytest.approx(0.1, abs=2 * clock.scale_standard_uncertainty)


@pytest.mark.parametrize("held_s", [0.5, 5.0])
def test_what_was_held_and_comes_at_once_is_no_higher_rate(held_s):
    pace = RateMonitor(RATE_HZ, 0)
    for index in range(10, 20_000, 10):
        assert not pace.add(index, round(max(0.02 + index * 1e-6, index / RATE_HZ - held_s) * 1e9))
