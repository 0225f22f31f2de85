"""The pullback state machine on simulated motions, and on pullbacks with mistakes."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pullback_kit import TIMETABLE, TO_RELEASE, follow, hand, notes, recording, states, with_noise

from app.acquisition.messages import EndReason
from app.acquisition.messages import PullbackState as State
from app.acquisition.pullback.notes import (
    ALREADY_PULLED_NOTE,
    LET_DOWN_NOTE,
    NO_READING_NOTE,
    NO_SLIP_NOTE,
    NOT_HELD_NOTE,
    RESTLESS_NOTE,
    SILENT_PLATE_NOTE,
    OperatorNote,
)
from app.acquisition.pullback.plan import PullbackPlan, Transition
from app.simulated_stand.options import Timetable
from config.files import load_stand, published_table
from messages.message import Message, joined


def told(note: OperatorNote) -> Message:
    """A note as an operator at a real stand reads it."""
    return joined(note, ". ")


def pullback_of(series):
    return load_stand().series(series).pullback_m


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("rate_hz", [500.0, 1000.0])
@pytest.mark.parametrize("series", list(published_table())[::5])
def test_every_release_is_found_within_20_ms_and_none_before(series, rate_hz, side):
    table, relative = recording(rate_hz, TIMETABLE.release_s + 1.2, series=series, side=side)
    plan = PullbackPlan(rate_hz, side * pullback_of(series))
    test, turns, known = follow(plan, table, relative, block=1)
    assert states(turns)[:4] == TO_RELEASE
    assert test.measurement.release_confirmed
    noticed = [turn.state for turn in turns].index(State.RELEASED)
    late_s = known[noticed] / rate_hz - TIMETABLE.release_s
    assert 0.0 < late_s <= 0.020
    # It is dated back at once, and to a sample when the table has swung through.
    assert abs(turns[noticed].index / rate_hz - TIMETABLE.release_s) < 0.006
    assert abs(test.measurement.release_index / rate_hz - TIMETABLE.release_s) <= 0.002
    assert notes(turns) == []


@pytest.mark.parametrize("rate_hz", [100.0, 2000.0, 10_000.0, 100_000.0])
def test_works_from_100_hz_to_100_khz(rate_hz):
    table, relative = recording(rate_hz, TIMETABLE.release_s + 0.5, noise_m=10e-6)
    test, turns, _ = follow(PullbackPlan(rate_hz, 0.012), table, relative)
    assert states(turns) == [*TO_RELEASE, State.SLIPPING]
    assert test.measurement.release_confirmed
    assert abs(test.measurement.release_index / rate_hz - TIMETABLE.release_s) <= max(0.001, 1.01 / rate_hz)


@pytest.mark.parametrize("lost", [0.0, 0.1])
@pytest.mark.parametrize("rate_hz", [12.0, 16.0, 20.0, 25.0, 30.0, 34.0, 49.0])
def test_a_device_that_is_read_slowly_needs_a_longer_hold_and_is_armed(rate_hz, lost):
    timetable = replace(TIMETABLE, rest_s=3.0, hold_s=3.0)
    table, relative = recording(rate_hz, timetable.release_s + 1.0, noise_m=10e-6, timetable=timetable)
    gone = np.random.default_rng(1).random(len(table)) < lost
    table[gone] = relative[gone] = np.nan
    test, turns, _ = follow(PullbackPlan(rate_hz, 0.012), table, relative)
    found = states(turns)
    assert found[found.index(State.RELEASED) - 1] is State.ARMED
    assert test.measurement.release_confirmed
    assert abs(test.measurement.release_index / rate_hz - timetable.release_s) <= 2.0 / rate_hz


@given(block=st.integers(1, 400), lost=st.floats(0.0, 0.3), seed=st.integers(0, 50))
@settings(deadline=None, max_examples=25)
def test_blocks_and_missing_samples_change_nothing_that_matters(block, lost, seed):
    rate_hz = 500.0
    table, relative = recording(rate_hz, TIMETABLE.release_s + 0.6, seed=seed)
    gone = np.random.default_rng(seed).random(len(table)) < lost
    table[gone] = relative[gone] = np.nan
    test, turns, _ = follow(PullbackPlan(rate_hz, 0.012), table, relative, block)
    assert states(turns) == [*TO_RELEASE, State.SLIPPING]
    assert test.measurement.release_confirmed
    assert abs(test.measurement.release_index / rate_hz - TIMETABLE.release_s) < 0.006
    whole, same, _ = follow(PullbackPlan(rate_hz, 0.012), table, relative, len(table))
    assert same == turns
    assert whole.measurement == test.measurement


def test_zero_hold_and_plateau_are_measured():
    rate_hz = 1000.0
    timetable = Timetable(2.0, 2.0, 1.0, 3.0, 0.5)
    table, relative = recording(rate_hz, timetable.release_s + 0.5, timetable=timetable)
    test, turns, _ = follow(PullbackPlan(rate_hz, 0.012), table + 0.7e-3, relative - 0.4e-3)
    assert test.measurement.zero_m == pytest.approx(0.7e-3, abs=10e-6)
    assert test.measurement.relative_zero_m == pytest.approx(-0.4e-3, abs=10e-6)
    assert test.measurement.held_m == pytest.approx(12.7e-3, abs=10e-6)
    # Held begins when the pull has come within its last per cent.
    assert 3.5 < test.measurement.held_index / rate_hz < 4.1
    # The operator is asked to pull as soon as the zero is known, long before the pull at 2 s.
    assert turns[0].state is State.PULLING
    assert turns[0].index / rate_hz < 0.8


@pytest.mark.parametrize("speed_mm_per_s", [0.05, 0.1, 0.3, 1.0, 10.0, 100.0])
def test_a_pull_of_any_speed_is_noticed_from_its_zero(speed_mm_per_s):
    pulled_s = 12.0 / speed_mm_per_s
    corners = (0, 0), (11, 0), (11 + pulled_s, 0.012), (13 + pulled_s, 0.012)
    test, turns, _ = follow(PullbackPlan(500.0, 0.012), *hand(*corners))
    assert states(turns)[0] is State.PULLING
    assert (test.state, test.is_at_rest) == (State.ARMED, False)
    assert test.measurement.zero_m == pytest.approx(0.0, abs=120e-6), "a pull is noticed at 240 um"
    assert test.measurement.held_m == pytest.approx(0.012, abs=60e-6)


def test_slip_ends_and_the_plates_swing_together():
    rate_hz = 1000.0
    table, relative = recording(rate_hz, TIMETABLE.release_s + 3.0, series="3SSM3")
    test, turns, _ = follow(PullbackPlan(rate_hz, 0.006), table, relative)
    assert states(turns) == [*TO_RELEASE, State.SLIPPING, State.TAIL]
    _, quiet = recording(rate_hz, TIMETABLE.release_s + 3.0, series="3SSM3", noise_m=0.0)
    end = test.measurement.slip_end_index
    assert np.ptp(quiet[end:]) < 20e-6  # what is left hides in the noise
    assert np.ptp(quiet[end - round(0.2 * rate_hz) : end]) > 20e-6


def test_how_far_the_plate_went_is_known():
    rate_hz = 1000.0
    table, relative = recording(rate_hz, TIMETABLE.release_s + 3.0, noise_m=0.0)
    test, _, _ = follow(PullbackPlan(rate_hz, 0.012), table, relative + 5e-3)
    found = test.measurement.excursion
    assert found.low_m == pytest.approx(relative.min(), abs=20e-6)
    assert found.high_m == pytest.approx(relative.max(), abs=20e-6)


@pytest.mark.parametrize("rate_hz", [500.0, 2000.0])
def test_a_plate_that_stays_on_the_table_is_told_and_the_run_goes_on_to_its_end(rate_hz):
    table, relative = recording(rate_hz, TIMETABLE.release_s + 2.6, friction=0.9)
    assert np.ptp(with_noise(relative, 0.0, 0)) < 250e-6, "the plate slips in this simulation"
    plan = PullbackPlan(rate_hz, 0.012, duration_s=2.5)
    test, turns, _ = follow(plan, table, relative)
    assert states(turns) == [*TO_RELEASE, State.NO_SLIP, State.CLOSING]
    (said,) = (turn for turn in turns if turn.note)
    assert (said.note, said.is_stored) == (told(NO_SLIP_NOTE), True)
    assert test.measurement.slip_end_index is None
    assert abs(test.measurement.release_index / rate_hz - TIMETABLE.release_s) <= 0.002


@pytest.mark.parametrize("slip_m", [60e-6, 200e-6, 1e-3])
def test_a_small_slip_is_a_slip(slip_m):
    rate_hz = 500.0
    table, relative = recording(rate_hz, TIMETABLE.release_s + 2.0, friction=0.9)
    late = round((TIMETABLE.release_s + 0.2) * rate_hz)
    relative[late:] += slip_m
    _, turns, _ = follow(PullbackPlan(rate_hz, 0.012), table, relative)
    assert State.SLIPPING in states(turns)
    assert State.NO_SLIP not in states(turns)


def test_ends_at_rest_when_the_motion_is_lost_in_the_noise():
    rate_hz = 500.0
    long = Timetable(0.6, 0.8, 0.5, 60.0, 0.5)
    table, relative = recording(rate_hz, 22.0, series="3SSM2", timetable=long)
    test, turns, _ = follow(PullbackPlan(rate_hz, 0.006), table, relative)
    assert turns[-1].end_reason is EndReason.REST
    quiet, _ = recording(rate_hz, 22.0, series="3SSM2", timetable=long, noise_m=0.0)
    rest = test.measurement.rest_index
    assert np.abs(quiet[rest : rest + round(rate_hz)]).max() < 30e-6
    assert np.abs(quiet[rest - round(2 * rate_hz) : rest]).max() > 15e-6
    assert turns[-1].index == pytest.approx(rest + rate_hz, abs=2)


def test_ends_20_s_after_release_to_the_sample_when_it_swings_on():
    rate_hz = 200.0
    table, relative = recording(rate_hz, 24.0, timetable=Timetable(0.6, 0.8, 0.5, 60.0, 0.5))
    test, turns, _ = follow(PullbackPlan(rate_hz, 0.012), table, relative, block=7)
    assert turns[-1].end_reason is EndReason.ENOUGH
    assert turns[-1].index == test.measurement.release_index + round(20 * rate_hz)


@pytest.mark.parametrize("duration_s", [0.3, 1.0, 2.345])
def test_a_duration_is_kept_to_the_sample(duration_s):
    rate_hz = 1000.0
    table, relative = recording(rate_hz, TIMETABLE.release_s + 2.6)
    plan = PullbackPlan(rate_hz, 0.012, duration_s=duration_s)
    test, turns, _ = follow(plan, table, relative, block=31)
    end = test.measurement.release_index + round(duration_s * rate_hz)
    assert turns[-1] == Transition(State.CLOSING, end, end_reason=EndReason.DURATION)


# --- what is waited for ---


TIMED_OUT = [
    ([(0, 0), (9, 0)], State.PULLING, "never held"),
    ([(0, 0), (1, 0), (2, 0.009), (9, 0.009)], State.PULLING, "never held"),
    ([(0, 0), (1, 0), (2, 0.011), (9, 0.0125)], State.HELD, "never steadily"),
    ([(0, 0), (1, 0), (2, 0.012), (9, 0.012)], State.ARMED, "never let go"),
    ([(0.1 * i, 0.002 * (i % 2)) for i in range(91)], State.ZERO, "never came to rest"),
]


@pytest.mark.parametrize(("corners", "waiting", "words"), TIMED_OUT)
def test_each_state_that_waits_says_when_it_is_tired_of_it(corners, waiting, words):
    table, relative = hand(*corners)
    plan = PullbackPlan(500.0, 0.012, trigger_timeout_s=8.0, tolerance_m=1e-3)
    test, turns, _ = follow(plan, table, relative)
    assert turns[-1].end_reason is EndReason.TRIGGER_TIMEOUT
    assert turns[-1].index == 4000
    assert words in str(turns[-1].note)
    assert "no release within 8 s" in str(turns[-1].note)
    assert [turn.state for turn in turns][-2] is waiting
    assert any("ends without one in 4 s" in str(note) for note in notes(turns))
    assert not test.measurement.release_confirmed


def test_a_hold_that_drifts_is_not_armed_and_the_drift_is_said():
    table, relative = hand((0, 0), (1, 0), (2, 0.0114), (7, 0.0124), (8, 0.012), (11, 0.012))
    _, turns, _ = follow(PullbackPlan(500.0, 0.012, tolerance_m=1e-3), table, relative)
    armed = next(turn for turn in turns if turn.state is State.ARMED)
    assert armed.index / 500.0 > 7.0
    (said,) = notes(turns)
    assert str(said) == "The table drifts by 0.20 mm/s. Hold it still"


@pytest.mark.parametrize(
    ("held_m", "state"), [(0.0118, State.ARMED), (0.0122, State.ARMED), (0.0115, State.PULLING)]
)
def test_only_a_hold_at_the_wanted_pullback_is_armed(held_m, state):
    test, _, _ = follow(PullbackPlan(500.0, 0.012), *hand((0, 0), (1, 0), (2, held_m), (4, held_m)))
    assert test.state is state


def test_a_release_from_another_pullback_is_taken_and_remarked_upon():
    table, relative = recording(1000.0, TIMETABLE.release_s + 0.5, pullback_m=0.0112)
    test, turns, _ = follow(PullbackPlan(1000.0, 0.012), table, relative)
    assert states(turns) == [State.PULLING, State.RELEASED, State.SLIPPING]
    assert test.measurement.release_confirmed
    (said,) = (turn for turn in turns if turn.note)
    assert said.is_stored
    assert str(said.note) == "Released from 11.20 mm instead of 12 mm"


def test_a_release_right_after_the_pull_is_taken_and_remarked_upon():
    hurried = Timetable(0.6, 0.8, 0.18, 3.0, 0.5)
    table, relative = recording(1000.0, hurried.release_s + 0.5, timetable=hurried)
    test, turns, _ = follow(PullbackPlan(1000.0, 0.012), table, relative)
    assert states(turns) == [State.PULLING, State.HELD, State.RELEASED, State.SLIPPING]
    assert test.measurement.release_confirmed
    (said,) = notes(turns)
    assert "before it was armed, 0.3 s after the pull" in str(said)


def test_nothing_is_armed_before_the_pretrigger_is_there():
    table, relative = hand((0, 0), (1, 0), (2, 0.012), (6, 0.012))
    plan = PullbackPlan(500.0, 0.012, pretrigger_s=5.0)
    _, turns, _ = follow(plan, table, relative)
    armed = next(turn for turn in turns if turn.state is State.ARMED)
    assert armed.index / 500.0 == pytest.approx(5.0, abs=0.03)
    (said,) = notes(turns)
    assert str(said).startswith("The 5 s that are kept from before the release are not there yet")


def test_a_gauge_1_without_a_reading_is_said():
    nothing = np.full(2000, np.nan)
    test, turns, _ = follow(PullbackPlan(1000.0, trigger_timeout_s=math.inf), nothing, nothing)
    assert test.state is State.ZERO
    assert notes(turns) == [told(NO_READING_NOTE)]


def test_a_table_already_pulled_back_when_armed_is_said_and_its_release_still_found():
    rate_hz = 1000.0
    table, relative = recording(rate_hz, TIMETABLE.release_s + 0.5)
    armed = round((TIMETABLE.release_s - 0.55) * rate_hz)
    test, turns, _ = follow(PullbackPlan(rate_hz, 0.012), table[armed:], relative[armed:], first_index=armed)
    assert states(turns)[:2] == [State.PULLING, State.HELD]
    assert turns[0].note == ALREADY_PULLED_NOTE
    assert turns[0].is_stored
    assert test.measurement.zero_m is None
    assert test.measurement.release_confirmed
    assert test.measurement.release_index == pytest.approx(TIMETABLE.release_s * rate_hz, abs=3)


def test_armed_in_the_middle_of_a_decay_it_says_so_and_waits_for_the_next_test():
    rate_hz = 500.0
    first_s = TIMETABLE.release_s + 0.3
    table, relative = recording(rate_hz, TIMETABLE.cycle_s + TIMETABLE.release_s + 0.5)
    armed = round(first_s * rate_hz)
    _, turns, _ = follow(PullbackPlan(rate_hz, 0.012), table[armed:], relative[armed:], first_index=armed)
    assert states(turns)[-5:] == [*TO_RELEASE, State.SLIPPING]
    assert states(turns).count(State.RELEASED) == 1
    assert notes(turns) == [told(RESTLESS_NOTE)]
    released_s = TIMETABLE.cycle_s + TIMETABLE.release_s
    release = next(turn for turn in turns if turn.state is State.RELEASED)
    assert release.index / rate_hz == pytest.approx(released_s, abs=0.004)


@pytest.mark.parametrize("seconds", [1.0, 2.0, 5.0])
def test_a_table_let_down_by_hand_is_no_release(seconds):
    table, relative = hand((0, 0), (1, 0), (2, 0.012), (3, 0.012), (3 + seconds, 0), (7 + seconds, 0))
    test, turns, _ = follow(PullbackPlan(500.0, 0.012), table, relative)
    assert not test.measurement.release_confirmed
    assert test.measurement.release_index is None
    assert test.measurement.excursion is None
    assert turns[-1].state is State.PULLING
    assert test.is_at_rest
    assert set(notes(turns)) & {told(LET_DOWN_NOTE), told(NOT_HELD_NOTE)}


@pytest.mark.parametrize("seconds", [1.2, 1.4, 1.7])
def test_a_table_led_across_by_hand_takes_the_moment_at_which_it_left(seconds):
    """So slow that it is across only after more than a second: nothing that swings on its plates is."""
    across = (3 + seconds, -0.003), (7 + seconds, -0.003)
    table, relative = hand((0, 0), (1, 0), (2, 0.012), (3, 0.012), *across)
    test, _, _ = follow(PullbackPlan(500.0, 0.012), table, relative)
    assert test.measurement.release_confirmed
    assert test.measurement.release_index == pytest.approx(500.0 * 3.0, abs=15)


def test_after_a_table_was_let_down_the_next_release_is_found():
    table, relative = hand((0, 0), (1, 0), (2, 0.012), (3, 0.012), (4, 0), (6, 0))
    again, plate = recording(500.0, TIMETABLE.release_s + 1.0)
    table, relative = np.concatenate([table, again]), np.concatenate([relative, plate])
    test, turns, _ = follow(PullbackPlan(500.0, 0.012), table, relative)
    assert states(turns)[-5:] == [*TO_RELEASE, State.SLIPPING]
    assert test.measurement.release_index == pytest.approx(500.0 * (6 + TIMETABLE.release_s), abs=2)


def test_a_release_without_a_hold_is_said():
    rate_hz = 500.0
    abrupt = Timetable(0.6, 0.8, 0.05, 8.0, 0.5)
    table, relative = recording(rate_hz, 12.0, timetable=abrupt)
    _, turns, _ = follow(PullbackPlan(rate_hz, 0.012), table, relative)
    # Either the hand's last smooth moment counted as a hold and the release was found, or it came too early.
    assert State.SLIPPING in states(turns) or states(turns)[:2] == [State.PULLING, State.ZERO]


def test_a_creeping_hold_is_not_a_release_and_pulling_on_is_noticed():
    table, relative = hand((0, 0), (1, 0), (2, 0.009), (3, 0.009), (13, 0.0085), (14, 0.012), (16, 0.012))
    test, turns, _ = follow(PullbackPlan(500.0, 0.012), table, relative)
    assert State.RELEASED not in states(turns)
    assert states(turns)[-3:] == [State.PULLING, State.HELD, State.ARMED]
    assert test.measurement.held_m == pytest.approx(0.012, abs=20e-6)


def test_noise_of_20_um_sets_nothing_off_in_three_minutes():
    table, relative = hand((0, 0), (1, 0), (2, 0.012), (180, 0.012), noise_m=20e-6)
    _, turns, _ = follow(PullbackPlan(500.0, 0.012), table, relative, block=5000)
    assert [turn.state for turn in turns] == [State.PULLING, State.HELD, State.ARMED]
    table, relative = hand((0, 0), (180, 0), noise_m=20e-6)
    _, turns, _ = follow(PullbackPlan(500.0, 0.012), table, relative, block=5000)
    assert [turn.state for turn in turns] == [State.PULLING]


def test_a_dead_gauge_2_does_not_hinder_and_is_said():
    rate_hz = 1000.0
    table, relative = recording(rate_hz, TIMETABLE.release_s + 2.5)
    plan = PullbackPlan(rate_hz, 0.012, duration_s=2.0, relative_range_m=0.033)
    test, turns, _ = follow(plan, table, np.full_like(relative, np.nan))
    assert states(turns) == [*TO_RELEASE, State.CLOSING]
    assert notes(turns) == [told(SILENT_PLATE_NOTE)]
    assert test.measurement.slip_end_index is None


def test_without_a_known_pullback_about_ten_millimetres_are_expected():
    rate_hz = 1000.0
    for series in ("1FFM0", "3SSM3"):
        table, relative = recording(rate_hz, TIMETABLE.release_s + 0.5, series=series)
        _, turns, _ = follow(PullbackPlan(rate_hz), table, relative)
        assert states(turns) == [*TO_RELEASE, State.SLIPPING]


def test_a_gap_over_the_release_is_survived():
    rate_hz = 1000.0
    table, relative = recording(rate_hz, TIMETABLE.release_s + 1.0)
    released = round(TIMETABLE.release_s * rate_hz)
    table[released - 50 : released + 100] = np.nan
    test, _, _ = follow(PullbackPlan(rate_hz, 0.012), table, relative)
    assert test.measurement.release_confirmed
    assert abs(test.measurement.release_index - released) <= 110


def test_every_state_is_one_that_the_machine_can_come_to():
    told = {State.CONNECTING, State.IDLE, State.RECORDING, *TO_RELEASE}
    after = {State.ZERO, State.SLIPPING, State.NO_SLIP, State.TAIL, State.CLOSING, State.RECENTRE}
    assert told | after == set(State)
