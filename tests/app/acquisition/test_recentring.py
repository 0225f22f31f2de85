"""Where the plate must stand before the pull, and how the operator is guided there."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from pullback_kit import TIMETABLE, TO_RELEASE, follow, hand, notes, recording, states, with_noise

from analysis.motion.two_mass import TwoMassParameters
from app.acquisition.messages import EndReason, RunSettings
from app.acquisition.messages import PullbackState as State
from app.acquisition.pullback.notes import NOT_RECENTRED_NOTE
from app.acquisition.pullback.plan import (
    Excursion,
    ObservedSlip,
    PullbackPlan,
    allowed_plate_range,
    default_excursion,
)
from app.acquisition.pullback.trigger import Trigger
from app.acquisition.stream.live_stream import ReadHistory
from app.simulated_stand.motion import stand_truth
from app.simulated_stand.options import SimulatedStandOptions
from config.files import load_stand, published_table
from messages.message import EMPTY

RATE_HZ = 500.0
PLAN = PullbackPlan(RATE_HZ, 0.012, relative_range_m=0.033)


def plate_moved(*corners, seconds):
    """A table at rest for some seconds, and a plate that is pushed through corners (time s, mm)."""
    _, relative = hand(*((time_s, mm * 1e-3) for time_s, mm in corners), (seconds, corners[-1][1] * 1e-3))
    table, _ = hand((0, 0), (seconds, 0))
    time_s = np.arange(len(table)) / RATE_HZ
    times, mm = zip(*corners, strict=True)
    return table, relative + 1e-3 * np.interp(time_s, times, mm)


@pytest.mark.parametrize("series", list(published_table()))
def test_the_usual_excursion_holds_every_row_of_table_1_on_a_level_stand(series):
    stand = load_stand()
    true = stand_truth(SimulatedStandOptions(series=series), stand)
    motion = TwoMassParameters(
        table_mass_kg=true.table_mass_kg,
        plate_mass_kg=true.plate_mass_kg,
        stiffness_n_per_m=true.stiffness_n_per_m,
        damping_coefficient_kg_per_s=true.damping_coefficient_kg_per_s,
        friction_dynamic=true.friction_dynamic,
        friction_static=true.friction_static,
        pullback_m=true.pullback_m,
        gravity_m_per_s2=true.gravity_m_per_s2,
    ).simulate(10.0)
    table, relative = motion.sample_displacements(np.arange(20_000) / 2000.0)
    expected = default_excursion(true.pullback_m)
    for seen in (relative, relative + table):  # gauge 2 against the table, or against the base
        assert expected.low_m < seen.min()
        assert seen.max() < expected.high_m


lengths_m = st.floats(1e-4, 0.05)


@given(range_m=lengths_m, low_m=lengths_m, high_m=lengths_m, plate_m=st.floats(-0.1, 0.1))
def test_a_plate_that_fits_stays_in_the_range_and_the_best_place_fits(range_m, low_m, high_m, plate_m):
    room = allowed_plate_range(range_m, Excursion(-low_m, high_m))
    assert room.exists == (low_m + high_m <= 2 * 0.98 * range_m) or low_m + high_m == pytest.approx(
        2 * 0.98 * range_m
    )
    left_m = min(plate_m - low_m + 0.98 * range_m, 0.98 * range_m - (plate_m + high_m))
    assume(abs(left_m) > 1e-9)
    assert room.fits(plate_m) == (left_m > 0.0)
    if room.exists:
        assert room.fits(room.best_m)
    if room.exists and low_m == high_m:
        assert room.best_m == pytest.approx(0.0, abs=1e-12)


def test_the_next_slip_is_expected_like_the_last_and_a_fifth_more():
    seen = ObservedSlip("1FFM0", 0.012, Excursion(-0.02, 0.01))
    assert seen.expected_excursion("1FFM0", 0.006) == Excursion(pytest.approx(-0.012), pytest.approx(0.006))
    other_side = ObservedSlip("1FFM0", -0.012, Excursion(-0.02, 0.01))
    assert other_side.expected_excursion("1FFM0", 0.012) == seen.expected_excursion("1FFM0", 0.012)
    assert seen.expected_excursion("1FFM0", None) == Excursion(pytest.approx(-0.024), pytest.approx(0.012))
    assert seen.expected_excursion("1SSM0", 0.012) is None, "another friction"


def test_a_plate_that_fits_where_it_stands_is_left_there():
    table, relative = plate_moved((0, -10.0), seconds=3)
    test, turns, _ = follow(PLAN, table, relative)
    assert states(turns) == [State.PULLING]
    assert test.measurement.plate_m == pytest.approx(-10e-3, abs=20e-6)


@pytest.mark.parametrize("side", [1, -1])
def test_a_plate_too_far_off_is_to_be_put_back_and_then_the_zero_is_taken_anew(side):
    table, relative = plate_moved((0, 16.0 * side), (3, 16.0 * side), (5, 2.0 * side), seconds=8)
    test, turns, _ = follow(PLAN, table, relative)
    assert states(turns) == [State.RECENTRE, State.ZERO, State.PULLING]
    assert test.measurement.relative_zero_m == pytest.approx(2e-3 * side, abs=20e-6)
    assert test.position.plate_wanted_m is None


def test_while_the_plate_is_off_it_is_known_where_it_belongs():
    table, relative = plate_moved((0, 16.0), seconds=2)
    test, _, _ = follow(PLAN, table, relative)
    standing = test.position
    assert standing.plate_m == pytest.approx(16e-3, abs=20e-6)
    assert standing.plate_wanted_m == pytest.approx(0.0, abs=1e-9)


def test_a_slip_to_one_side_wants_the_plate_on_the_other():
    plan = PullbackPlan(RATE_HZ, 0.012, relative_range_m=0.015, expected_excursion=Excursion(-0.022, 0.004))
    table, relative = plate_moved((0, 0.0), seconds=2)
    test, turns, _ = follow(plan, table, relative)
    assert states(turns) == [State.RECENTRE]
    wanted_m = test.position.plate_wanted_m
    assert wanted_m - 0.022 >= -0.0147
    assert wanted_m + 0.004 <= 0.0147


def test_a_plate_shoved_out_of_its_room_while_resting_is_noticed():
    table, relative = plate_moved((0, 0.0), (2, 0.0), (2.5, 16.0), seconds=5)
    _, turns, _ = follow(PLAN, table, relative)
    assert states(turns) == [State.PULLING, State.RECENTRE]


def test_the_hand_on_the_plate_is_not_taken_for_a_pull():
    table, relative = plate_moved((0, 16.0), (2, 16.0), (4, 0.0), seconds=7)
    table[1000:2000] += 0.4e-3  # friction takes the table along
    test, turns, _ = follow(PLAN, table, relative)
    assert states(turns) == [State.RECENTRE, State.ZERO, State.PULLING]
    assert test.measurement.zero_m == pytest.approx(0.0, abs=20e-6)


def test_a_pull_with_the_plate_still_off_is_remarked_upon_and_recorded():
    table, relative = recording(RATE_HZ, TIMETABLE.release_s + 1.0)
    test, turns, _ = follow(PLAN, table, relative + 16e-3)
    assert states(turns) == [State.RECENTRE, *TO_RELEASE, State.SLIPPING]
    (said,) = (turn for turn in turns if turn.note)
    assert (said.note, said.is_stored) == (NOT_RECENTRED_NOTE, True)
    assert test.measurement.release_confirmed


def test_a_plate_that_is_never_put_back_ends_the_wait():
    table, relative = plate_moved((0, 16.0), seconds=5)
    plan = PullbackPlan(RATE_HZ, 0.012, relative_range_m=0.033, trigger_timeout_s=4.0)
    _, turns, _ = follow(plan, table, relative)
    assert turns[-1].end_reason is EndReason.TRIGGER_TIMEOUT
    assert "the plate was not pushed back" in str(turns[-1].note)


def test_a_gauge_too_short_for_any_slip_is_said_beforehand_and_does_not_hinder():
    table, relative = recording(RATE_HZ, TIMETABLE.release_s + 1.0)
    plan = PullbackPlan(RATE_HZ, 0.012, relative_range_m=0.010)
    _, turns, _ = follow(plan, table, relative)
    assert states(turns) == [*TO_RELEASE, State.SLIPPING]
    assert notes(turns) == []
    trigger = Trigger(RunSettings("/runs"), plan, 0, ReadHistory(1000))
    assert str(trigger.note) == "The slip may leave the range of gauge 2 (±10 mm) wherever the plate stands"
    assert Trigger(RunSettings("/runs"), PLAN, 0, ReadHistory(1000)).note == EMPTY


def test_a_gauge_on_the_base_is_asked_where_it_stands_itself():
    table, relative = recording(RATE_HZ, TIMETABLE.release_s + 2.0, noise_m=0.0)
    offset_m = 16e-3  # gauge 2 reads this more; the table itself rests 1 mm off
    plan = PullbackPlan(RATE_HZ, 0.012, relative_range_m=0.033, gauge_2_on_base=True)
    test, turns, _ = follow(plan, table + 1e-3, with_noise(relative + offset_m - 1e-3, 1e-6, 3))
    assert states(turns)[0] is State.RECENTRE
    assert test.measurement.plate_m == pytest.approx(offset_m, abs=5e-6)
    assert test.measurement.excursion.high_m == pytest.approx((relative + table).max(), abs=100e-6)


def test_run_after_run_without_putting_back_asks_in_time():
    """The plate creeps by 10.3 mm a run: it never leaves the range of gauge 2, and is asked for only then."""
    table, relative = recording(RATE_HZ, TIMETABLE.release_s + 2.0, timetable=TIMETABLE)
    plate_m, expected, asked = 0.0, None, []
    for _ in range(6):
        plan = PullbackPlan(RATE_HZ, 0.012, relative_range_m=0.033, expected_excursion=expected)
        test, turns, _ = follow(plan, table, relative + plate_m)
        asked.append(turns[0].state is State.RECENTRE)
        if asked[-1]:
            plate_m = test.position.plate_wanted_m or plan.plate_range.best_m
            continue
        assert np.abs(relative + plate_m).max() <= 0.033
        seen = ObservedSlip("1FFM0", abs(test.measurement.pulled_m), test.measurement.excursion)
        expected = seen.expected_excursion("1FFM0", 0.012)
        plate_m += float(relative[-100:].mean())
    assert asked == [False, False, True, False, False, True]
    assert {State.HELD, State.ARMED, State.RELEASED} <= set(states(turns))
