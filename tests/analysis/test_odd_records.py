"""Records of faulty devices: each gives a result or one clear line."""

import numpy as np
import pytest

from analysis.identify import identify
from analysis.live import LiveIdentification
from analysis.record import AnalysisError, Record
from analysis.synthetic import Truth, simulate_record

STUCK_AT = [np.nan, 0.0, 0.012, 1.0]


def odd_record(seed: int) -> Record:
    """A pullback with stretches of both gauges absent or stuck, and now and then rows left out."""
    random = np.random.default_rng(seed)
    sound = simulate_record(
        Truth(
            rate_hz=random.choice([200.0, 500.0]),
            duration_s=random.uniform(1.0, 6.0),
            friction_static=random.choice([0.1, 0.13, 0.4]),
            tilt_rad=random.choice([0.0, 1e-3]),
        )
    )
    count = len(sound.time_s)
    gauges = [sound.table_displacement_m.copy(), sound.relative_displacement_m.copy()]
    for gauge in gauges:
        for _ in range(random.integers(4)):
            gauge[_stretch(random, count)] = random.choice(STUCK_AT)
    kept = np.ones(count, bool)
    if random.random() < 0.3:
        kept[_stretch(random, count)] = False
    table, relative = (gauge[kept] for gauge in gauges)
    return sound.replace(
        time_s=sound.time_s[kept], table_displacement_m=table, relative_displacement_m=relative
    )


def until(whole: Record, end: int) -> Record:
    """The first rows of a record."""
    return whole.replace(
        time_s=whole.time_s[:end],
        table_displacement_m=whole.table_displacement_m[:end],
        relative_displacement_m=whole.relative_displacement_m[:end],
    )


def _stretch(random: np.random.Generator, count: int) -> slice:
    first = random.integers(count)
    return slice(first, first + random.integers(1, count))


@pytest.mark.parametrize("seed", range(60))
def test_an_odd_record_gives_a_result_or_one_line(seed: int) -> None:
    refusal = ""
    try:
        identify(odd_record(seed))
    except AnalysisError as error:
        refusal = str(error)
    assert "\n" not in refusal


@pytest.mark.parametrize("seed", range(100, 140))
def test_an_odd_record_is_followed_live_to_its_end(seed: int) -> None:
    odd, live = odd_record(seed), LiveIdentification()
    for end in np.linspace(0, len(odd.time_s), 5, dtype=int):
        live.update(until(odd, end))


def test_times_in_a_unit_far_too_large_are_refused() -> None:
    sound = simulate_record(Truth(rate_hz=200.0, duration_s=3.0))
    with pytest.raises(AnalysisError, match="in which no stand swings"):
        identify(sound.replace(time_s=1e-9 * sound.time_s))
