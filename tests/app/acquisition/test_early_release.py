"""A table that is let go before it was held at its pullback: noticed at once, and pulled again."""

import numpy as np
import pytest
from pullback_kit import TIMETABLE, TO_RELEASE, follow, hand, notes, recording, states

from app.acquisition.messages import PullbackState as State
from app.acquisition.pullback.early_release import EarlyReleaseDetector
from app.acquisition.pullback.plan import PullbackPlan
from app.simulated_stand.options import Timetable
from config.files import load_stand, published_table

RATE_HZ = 500.0
PLAN = PullbackPlan(RATE_HZ, 0.012)
HURRIED = Timetable(rest_s=0.6, pull_s=0.8, hold_s=0.05, decay_s=12.0, recentre_s=0.5)
HELD = Timetable(rest_s=0.6, pull_s=0.8, hold_s=0.8, decay_s=12.0, recentre_s=0.5)


def noticed(turns, known):
    """Sample at which the first early release was known, and the sample of its transition."""
    number = next(i for i, turn in enumerate(turns) if i and turn.state is State.ZERO)
    return known[number], turns[number]


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("rate_hz", [100.0, 500.0, 2000.0])
@pytest.mark.parametrize(("pulled_mm", "timetable"), [(4.0, HELD), (4.0, HURRIED), (9.0, HURRIED)])
def test_a_release_before_the_hold_is_noticed_within_half_a_second(pulled_mm, timetable, rate_hz, side):
    plan = PullbackPlan(rate_hz, side * 0.012)
    seconds = timetable.release_s + 0.6
    made = recording(rate_hz, seconds, pullback_m=pulled_mm * 1e-3, side=side, timetable=timetable)
    test, turns, known = follow(plan, *made)
    assert states(turns)[-1] is State.ZERO
    known_at, _ = noticed(turns, known)
    assert 0.0 < known_at / rate_hz - timetable.release_s < 0.5
    assert test.position.early_release_m == pytest.approx(pulled_mm * 1e-3, abs=60e-6)
    assert test.position.keeps_run, "the table moves still"


@pytest.mark.parametrize("series", list(published_table())[::4])
def test_whatever_the_friction_is(series):
    pullback_m = load_stand().series(series).pullback_m
    made = recording(
        RATE_HZ, HURRIED.release_s + 0.7, series=series, pullback_m=0.7 * pullback_m, timetable=HURRIED
    )
    test, _, _ = follow(PullbackPlan(RATE_HZ, pullback_m), *made)
    assert test.position.early_release_m == pytest.approx(0.7 * pullback_m, rel=0.02)


def test_it_is_said_until_the_zero_is_known_again_and_the_next_release_is_found():
    first = recording(RATE_HZ, HELD.cycle_s, pullback_m=0.004, timetable=HELD)
    second = recording(RATE_HZ, TIMETABLE.release_s + 1.0)
    table, relative = (np.concatenate(pair) for pair in zip(first, second, strict=True))
    test, turns, _ = follow(PLAN, table, relative)
    assert states(turns) == [State.PULLING, State.ZERO, *TO_RELEASE, State.SLIPPING]
    assert test.position.early_release_m is None
    assert test.measurement.release_confirmed
    released_s = HELD.cycle_s + TIMETABLE.release_s
    assert test.measurement.release_index / RATE_HZ == pytest.approx(released_s, abs=0.004)
    assert test.measurement.relative_zero_m == pytest.approx(
        relative[round(HELD.cycle_s * RATE_HZ)], abs=60e-6
    )


def test_a_table_that_has_come_to_rest_again_is_as_before_the_pull():
    made = recording(RATE_HZ, HELD.cycle_s + 0.6, pullback_m=0.004, timetable=HELD)
    test, _, _ = follow(PLAN, *made)
    assert test.is_at_rest
    assert not test.position.keeps_run


def test_a_hand_that_does_not_wait_for_rest_is_followed_to_its_release():
    """The zero from before the early release holds; the held table is not taken for a new zero."""
    first = recording(RATE_HZ, HURRIED.release_s + 0.9, pullback_m=0.005, timetable=HURRIED)
    again = hand((0, first[0][-1]), (1, 0.012), (2.5, 0.012), rate_hz=RATE_HZ)
    table, relative = (np.concatenate(pair) for pair in zip(first, again, strict=True))
    test, turns, _ = follow(PLAN, table, relative)
    assert states(turns) == [State.PULLING, State.ZERO, State.HELD, State.ARMED]
    assert test.measurement.zero_m == pytest.approx(0.0, abs=20e-6)
    assert test.measurement.held_m == pytest.approx(0.012, abs=20e-6)


def test_a_second_early_release_is_said_with_its_own_distance():
    first = recording(RATE_HZ, HURRIED.release_s + 0.9, pullback_m=0.003, timetable=HURRIED)
    again = recording(RATE_HZ, HURRIED.release_s + 0.9, pullback_m=0.005, timetable=HURRIED)
    pulled = round(HURRIED.rest_s * RATE_HZ)  # at once, while the table swings
    table, relative = (np.concatenate((one, two[pulled:])) for one, two in zip(first, again, strict=True))
    test, turns, _ = follow(PLAN, table, relative)
    assert states(turns) == [State.PULLING, State.ZERO]
    assert test.position.early_release_m == pytest.approx(0.005, abs=60e-6)


@pytest.mark.parametrize(
    "corners",
    [
        [(0, 0), (1, 0), (2, 0.004), (3, 0.004), (3.2, 0), (6, 0)],  # let down quickly by hand
        [(0, 0), (1, 0), (1.5, -0.001), (2.5, 0.012), (5, 0.012)],  # first to the wrong side
        [(0, 0), (1, 0), (2, 0.006), (2.5, 0.004), (3.5, 0.012), (5, 0.012)],
        [(0, 0), (1, 0), (1.05, 0.0005), (1.15, -0.0004), (1.25, 0.0003), (1.3, 0), (4, 0)],  # a knock
        [(0, 0), (1, 0), (3, 0.006), (6, -0.005), (9, 0.004), (12, 0)],  # pushed to and fro slowly
    ],
)
def test_a_hand_on_the_table_is_no_release(corners):
    _, turns, _ = follow(PLAN, *hand(*corners))
    assert State.ZERO not in states(turns)


def test_without_readings_nothing_is_noticed():
    detector = EarlyReleaseDetector(0.012, RATE_HZ)
    swing = 0.004 * np.cos(2.0 * np.pi * np.arange(0.0, 1.0, 0.02) / 0.32)
    assert [released for i, x in enumerate(swing) if (released := detector.update(10.0 * i, x))]
    detector.reset()
    assert not any(detector.update(10.0 * i, np.nan) for i in range(50))


def test_no_note_is_about_a_hand_where_the_stand_is_simulated():
    made = recording(RATE_HZ, TIMETABLE.release_s + 1.5)
    armed = round((TIMETABLE.release_s + 0.3) * RATE_HZ)
    plan = PullbackPlan(RATE_HZ, 0.012, is_simulated=True, trigger_timeout_s=TIMETABLE.release_s + 3.0)
    long = Timetable(0.6, 0.8, 0.6, 20.0, 0.5)
    made = recording(RATE_HZ, 12.0, timetable=long)
    _, turns, _ = follow(plan, *(row[armed:] for row in made), first_index=armed)
    said = [str(note) for note in notes(turns)]
    assert said[0] == "The table has not come to rest yet, so its zero cannot be taken"
    assert said[-1].endswith("the table never came to rest, or gauge 1 gave no reading")
