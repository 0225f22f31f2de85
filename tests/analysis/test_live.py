"""Live identification: what it says while the motion dies away, and where it ends."""

import numpy as np
import pytest
from synthetic import CALIBRATED, Truth, record

from analysis.identify import identify
from analysis.live import LiveIdentification, averaged
from analysis.record import Record, StandMasses


def until(whole, time_s):
    rows = whole.time_s <= time_s
    return whole.replace(
        time_s=whole.time_s[rows],
        table_displacement_m=whole.table_displacement_m[rows],
        relative_displacement_m=whole.relative_displacement_m[rows],
    )


def followed(whole, *times_s):
    live = LiveIdentification()
    return [live.update(until(whole, time_s)) for time_s in times_s]


def test_nothing_is_said_before_there_is_anything_to_say():
    states = followed(record(Truth()), 0.0, 0.02, 0.5, 1.0)

    assert all(state.friction_dynamic is None for state in states)
    assert not any(state.may_stop for state in states)


def test_friction_narrows_and_ends_where_the_whole_record_does():
    whole = record(Truth(friction_static=0.13, tilt_rad=1e-3))

    states = followed(whole, *np.arange(1.6, 11.0, 0.4))
    found = identify(whole).results["friction_dynamic"]

    deviations = [state.friction_dynamic.standard_uncertainty for state in states]
    assert deviations[-1] < 0.5 * deviations[0]
    assert all(
        abs(state.friction_dynamic.value - 0.1) < 6.0 * u for state, u in zip(states, deviations, strict=True)
    )
    assert states[-1].friction_dynamic.value == pytest.approx(found.value, abs=found.standard_uncertainty)
    assert states[-1].period_s.value == pytest.approx(0.32, abs=2e-5)
    assert states[-1].law == "static+tilt"
    assert states[-1].slip_end_s == pytest.approx(3.2048, abs=1e-3)


def test_waiting_ends_when_the_calibration_is_all_that_is_left():
    whole = record(Truth(), table_gauge=CALIBRATED, relative_gauge=CALIBRATED)

    states = followed(whole, *np.arange(2.0, 8.0, 0.5))

    stops = [state.time_s for state in states if state.may_stop]
    assert stops
    assert stops[0] > states[-1].slip_end_s


def test_a_motion_that_branches_late_is_searched_again():
    whole = record(Truth(rate_hz=500.0, noise_m=1e-4, friction_static=0.15))

    states = followed(whole, 1.6, 2.0, 2.5, 3.0, 4.0, 6.0)

    last = states[-1].friction_dynamic
    assert states[-1].law == "static"
    assert abs(last.value - 0.1) < 4.0 * last.standard_uncertainty


def test_without_slip_period_and_damping_are_given():
    (state,) = followed(record(Truth(friction_dynamic=0.6)), 6.0)

    assert state.friction_dynamic is None
    assert state.period_s.value == pytest.approx(0.32, abs=1e-5)


def test_averaging_keeps_even_steps_and_marks_gaps():
    time = np.arange(4000) / 2000.0
    table = np.sin(time)
    table[100] = np.nan
    overload = np.zeros(4000, dtype=bool)
    overload[200] = True

    mean = averaged(Record(time, table, table.copy(), StandMasses(131.6, 22.4), table_overload=overload))

    assert len(mean.time_s) == 1000
    assert np.flatnonzero(np.isnan(mean.table_displacement_m)).tolist() == [25, 50]
    assert np.flatnonzero(np.isnan(mean.relative_displacement_m)).tolist() == [25]
    assert np.diff(mean.time_s) == pytest.approx(0.002)
