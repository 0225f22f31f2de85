"""Records that hold less, or more, than one clean pullback: what is determined, and what is refused."""

import numpy as np
import pytest
from synthetic import Truth, simulate_readings, simulate_record

from analysis.classical_estimates import estimate_classically
from analysis.identify import identify
from analysis.record import GaugeUncertainty, Record, RecordError, StandMasses

MASSES = StandMasses(131.6, 22.4)


def stretch(truth, start_s, end_s=np.inf, **known):
    time, table, relative = simulate_readings(truth)
    rows = (time >= start_s) & (time < end_s)
    return Record(time[rows], table[rows], relative[rows], MASSES, **known)


def codes(found):
    return [caution.code for caution in found.warnings]


def off(found, name="friction_dynamic", truth=0.1):
    quantity = found.results[name]
    return abs(quantity.value - truth) / quantity.standard_uncertainty


@pytest.mark.parametrize("start_s", [1.002, 1.1, 1.35, 2.0])
@pytest.mark.parametrize(
    "changes", [{}, {"friction_static": 0.13, "tilt_rad": 1e-3}], ids=["coulomb", "static+tilt"]
)
def test_a_record_that_begins_after_the_release(start_s, changes):
    found = identify(stretch(Truth().replace(**changes), start_s, pullback_m=0.012))

    assert "release-not-recorded" in codes(found)
    assert found.model.adequate
    assert off(found) < 4.0
    assert found.events.release_s == pytest.approx(1.0003, abs=1e-3)


@pytest.mark.parametrize("end_s", [1.8, 2.5, 3.5])
def test_slip_that_lasts_to_the_end_of_the_record(end_s):
    found = identify(stretch(Truth(), 0.0, end_s))

    assert "tail-too-short" in codes(found)
    assert off(found) < 4.0
    assert off(found, "period_s", 0.32) < 4.0
    assert off(found, "damping_n1_per_s", 0.12) < 4.0


@pytest.mark.parametrize("duration_s", [0.9, 1.8, 2.1, 2.7, 3.2], ids="{} s".format)
def test_where_slip_has_not_ended_neither_its_end_nor_the_residual_displacement_is_told(duration_s):
    """At 2.1 s the plate sticks when the record ends, and would slip again."""
    made = simulate_record(Truth(duration_s=duration_s))

    found = identify(made)

    assert "slip-not-ended" in codes(found)
    assert found.events.slip_end_s is None
    assert "residual_displacement_m" not in found.results
    assert estimate_classically(made, found).friction_candidates == ()


@pytest.mark.parametrize("duration_s", [2.4, 2.7, 3.4], ids="{} s".format)
def test_where_slip_has_ended_its_end_and_the_residual_displacement_are_told(duration_s):
    truth = Truth(friction_static=0.13, tilt_rad=1e-3)
    motion = truth.parameters().simulate(30.0)

    found = identify(simulate_record(truth.replace(duration_s=duration_s)))

    assert "slip-not-ended" not in codes(found)
    assert found.events.slip_end_s == pytest.approx(1.0003 + motion.slip_end_s, abs=1e-3)
    assert off(found, "residual_displacement_m", motion.residual_displacement_m) < 4.0


@pytest.mark.parametrize(("friction_static", "needless"), [(None, True), (0.27, False)])
def test_a_static_friction_that_was_asked_for_and_is_not_needed_is_named(friction_static, needless):
    truth = Truth(friction_dynamic=0.25, friction_static=friction_static)

    found = identify(simulate_record(truth), model="static")

    assert ("static-not-needed" in codes(found)) == needless
    assert "static-not-needed" not in codes(identify(simulate_record(truth)))


@pytest.mark.parametrize("gauge_2", ["absent", "dead", "all missing"])
def test_without_gauge_2_the_table_tells_friction_less_well(gauge_2):
    time, table, _ = simulate_readings(Truth(friction_static=0.13))
    dead = 1e-5 * np.random.default_rng(1).standard_normal(len(time))
    relative = {"absent": None, "dead": dead, "all missing": np.full(len(time), np.nan)}[gauge_2]
    both = identify(simulate_record(Truth(friction_static=0.13)))

    found = identify(Record(time, table, relative, MASSES))

    assert found.model.name == "static"
    assert off(found) < 4.0
    assert off(found, "friction_static", 0.13) < 4.0
    assert (
        found.results["friction_dynamic"].standard_uncertainty
        > both.results["friction_dynamic"].standard_uncertainty
    )
    assert {"gauge-2-absent", "gauge-2-dead"} & set(codes(found))


def test_the_longer_of_two_motions_is_used_and_said():
    time, table, relative = simulate_readings(Truth(duration_s=6.0))
    stop = int(np.searchsorted(time, 2.5))
    ramp = 0.5 - 0.5 * np.cos(np.pi * np.linspace(0.0, 1.0, 1500))
    pulled = table[stop] + (table[0] - table[stop]) * ramp
    table = np.concatenate((table[:stop], pulled, table))
    relative = np.concatenate(
        (relative[:stop], np.full(1500, relative[stop]), relative - relative[0] + relative[stop])
    )

    found = identify(Record(np.arange(len(table)) / 1000.0, table, relative, MASSES))

    assert "released-twice" in codes(found)
    assert found.events.release_s == pytest.approx(5.0, abs=0.01)
    assert off(found) < 4.0


def test_slip_one_way_only_leaves_the_tilt_to_the_level():
    truth = Truth(
        period_s=0.43, plate_mass_kg=22.4, friction_dynamic=0.13, friction_static=0.247, tilt_rad=1e-3
    )

    found = identify(simulate_record(truth))

    assert {"tilt-not-identified", "static-not-identified"} <= set(codes(found))
    assert "tilt_rad" not in found.results
    assert "friction_static" not in found.results
    assert off(found, truth=0.13) < 3.0
    assert found.results["friction_dynamic"].standard_uncertainty > 1e-3
    assert (
        found.results["friction_static_lower"].value
        < 0.247
        < found.results["friction_static_upper"].value + 2e-3
    )


def test_a_law_with_tilt_cannot_be_asked_of_slip_one_way():
    truth = Truth(period_s=0.43, friction_dynamic=0.13, friction_static=0.247)

    with pytest.raises(RecordError, match="tilt_rad and friction_dynamic act alike"):
        identify(simulate_record(truth), model="static+tilt")


def test_a_late_gauge_2_of_known_delay_and_a_fast_clock():
    time, table, relative = simulate_readings(Truth(lag_s=3e-3, clock_error=1e-3))
    made = Record(
        time, table, relative, MASSES, clock_scale=1.001, relative_gauge=GaugeUncertainty(delay_s=3e-3)
    )

    found = identify(made)

    assert found.model.adequate
    assert off(found) < 4.0
    assert off(found, "period_s", 0.32) < 4.0
    curves = found.curves(time)
    assert np.std(relative - curves.relative_displacement_m) == pytest.approx(2e-5, rel=0.05)


def test_rest_is_noted_where_the_swing_sinks_into_the_noise():
    found = identify(
        simulate_record(Truth(damping_n1_per_s=0.6, rate_hz=500.0, noise_m=5e-5, duration_s=12.0))
    )

    assert 3.0 < found.events.rest_s < 13.0


def test_a_stand_with_dry_friction_of_its_own_is_noticed():
    time, table, relative = simulate_readings(Truth(friction_static=0.2))
    tail = time > 3.0
    k1 = 2.0 * np.pi / 0.32
    bent = table.copy()
    bent[tail] -= 1e-4 * (time[tail] - 3.0) * np.cos(k1 * (time[tail] - 3.0))

    found = identify(Record(time, bent, relative, MASSES))

    assert "tail-not-exponential" in codes(found) or not found.model.adequate


@pytest.mark.parametrize("friction", [0.03, 0.1, 0.4], ids=["long slip", "some slip", "hardly any slip"])
def test_whatever_the_friction_the_table_alone_tells_it(friction):
    time, table, _ = simulate_readings(Truth(friction_dynamic=friction))

    found = identify(Record(time, table, None, MASSES))

    assert "gauge-2-absent" in codes(found)
    assert found.model.adequate
    assert off(found, truth=friction) < 4.0
    assert "residual_displacement_m" in found.results


def test_monte_carlo_that_was_asked_for_in_vain_is_said():
    found = identify(simulate_record(Truth(friction_dynamic=0.6)), monte_carlo=100)

    assert found.monte_carlo is None
    assert codes(found) == ["no-slip", "nothing-to-draw"]


def test_no_slip_is_told_from_the_table_alone_too_and_no_friction_is_invented():
    time, table, _ = simulate_readings(Truth(friction_dynamic=0.6))

    found = identify(Record(time, table, None, MASSES))

    assert {"gauge-2-absent", "no-slip"} == set(codes(found))
    assert "friction_dynamic" not in found.results
    assert off(found, "period_s", 0.32) < 4.0
    assert 0.43 < found.results["friction_static_lower"].value < 0.4715


@pytest.mark.parametrize(
    ("readings_of", "said", "expected"),
    [
        (lambda _table, relative: relative, True, {"gauge-2-relative"}),
        (lambda table, relative: relative + table, False, {"gauge-2-absolute"}),
        (lambda table, relative: -relative - table, True, {"gauge-2-reversed"}),
        (lambda table, relative: -relative - table, False, {"gauge-2-absolute", "gauge-2-reversed"}),
        (lambda _table, relative: -relative, True, {"gauge-2-relative", "gauge-2-reversed"}),
    ],
)
@pytest.mark.parametrize("friction", [0.03, 0.2])
def test_a_gauge_2_mounted_otherwise_than_said(readings_of, said, expected, friction):
    time, table, relative = simulate_readings(
        Truth(friction_dynamic=friction, duration_s=30.0, rate_hz=300.0)
    )

    found = identify(Record(time, table, readings_of(table, relative), MASSES, gauge_2_measures_plate=said))

    assert set(codes(found)) == expected
    assert found.model.adequate
    assert found.results["friction_dynamic"].value == pytest.approx(friction, rel=1e-3)


@pytest.mark.parametrize("friction", [0.02, 0.05])
def test_a_plate_that_slips_to_the_end_is_not_taken_for_a_mirrored_table(friction):
    found = identify(stretch(Truth(friction_dynamic=friction), 0.0, 2.5))

    assert codes(found) == ["tail-too-short", "slip-not-ended"]
    assert off(found, truth=friction) < 4.0


@pytest.mark.parametrize("drift_m_per_s", [2e-6, -2e-5, 2e-4])
def test_a_drift_of_gauge_2_is_named_and_taken_off(drift_m_per_s):
    made = simulate_record(Truth(drift_m_per_s=drift_m_per_s))

    found = identify(made)

    assert codes(found) == ["gauge-2-drifts"]
    assert found.model.name == "coulomb"
    assert found.model.adequate
    assert off(found) < 4.0
    curves = found.curves(made.time_s)
    assert np.std(made.relative_displacement_m - curves.relative_displacement_m) == pytest.approx(
        2e-5, rel=0.05
    )


@pytest.mark.parametrize("drift_m_per_s", [2e-6, -1e-4])
def test_a_drift_of_gauge_1_is_named_and_taken_off(drift_m_per_s):
    made = simulate_record(Truth())
    table = made.table_displacement_m + drift_m_per_s * made.time_s

    found = identify(made.replace(table_displacement_m=table))

    assert codes(found) == ["gauge-1-drifts"]
    assert found.model.name == "coulomb"
    assert found.model.adequate
    assert off(found) < 4.0
    left = table - found.curves(made.time_s).table_displacement_m
    assert np.std(left) == pytest.approx(2e-5, rel=0.05)


def test_a_drift_that_settles_is_named_and_not_taken_for_a_steady_one():
    made = simulate_record(Truth())
    warming = 5e-4 * np.exp(-made.time_s / 2.0)

    found = identify(made.replace(relative_displacement_m=made.relative_displacement_m + warming))

    assert {"gauge-2-drifts", "gauge-2-creep"} <= set(codes(found))
    assert found.results["gauge_2_creep_time_s"].value == pytest.approx(2.0, rel=0.05)
    since_release_m = -5e-4 * np.exp(-found.events.release_s / 2.0)
    assert found.results["gauge_2_creep_m"].value == pytest.approx(since_release_m, rel=0.05)
    assert off(found) < 4.0


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (lambda made: {"time_s": made.time_s * 1e3}, "spans 11000 s"),
        (lambda made: {"time_s": made.time_s * 1e-3}, "period of 0.0003"),
        (lambda made: {"time_s": made.time_s * 100.0}, "period of 32 s"),
        (lambda made: {"table_displacement_m": made.table_displacement_m * 1e3}, "moves over 23"),
        (
            lambda made: {
                "table_displacement_m": made.table_displacement_m * 24.0,
                "relative_displacement_m": made.relative_displacement_m * 24.0,
                "pullback_m": None,
            },
            "moves over 0.55",
        ),
        (
            lambda made: {
                "table_displacement_m": made.table_displacement_m * 21.0,
                "relative_displacement_m": made.relative_displacement_m * 21.0,
            },
            "f_d = 2.1",
        ),
    ],
)
def test_wrong_units_are_refused(changes, words):
    made = simulate_record(Truth(rate_hz=500.0))

    with pytest.raises(RecordError) as caught:
        identify(made.replace(**changes(made)))

    assert words in str(caught.value)
    assert "Check the unit" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("hold_s", [0.5, 1.0, 3.0])
@pytest.mark.parametrize("rate_hz", [15.0, 20.0, 30.0])
def test_a_record_with_few_readings_a_swing_is_refused(rate_hz, hold_s):
    with pytest.raises(RecordError, match=r"times a swing\. Record 10 readings a swing at the least"):
        identify(simulate_record(Truth(rate_hz=rate_hz, hold_s=hold_s)))


def test_a_gap_of_minutes_is_refused():
    made = simulate_record(Truth(rate_hz=500.0))
    time = np.where(made.time_s > 6.0, made.time_s + 300.0, made.time_s)

    with pytest.raises(RecordError, match="no reading for 300 s after 6 s"):
        identify(made.replace(time_s=time))


def test_a_record_that_begins_after_all_slip_says_that_slip_may_have_come_before():
    found = identify(stretch(Truth(), 6.0))

    assert {"release-not-recorded", "no-slip"} == set(codes(found))
    assert "before the record" in str(found.warnings[-1].message)
    assert found.results["friction_static_lower"].value < 0.1


def test_a_pullback_unlike_that_of_the_series_is_said():
    made = simulate_record(Truth(), pullback_m=0.003)

    assert codes(identify(made)) == ["pullback-unlike-series"]


@pytest.mark.parametrize(
    ("start_s", "end_s", "words"),
    [(0.0, 1.05, "too short"), (0.0, 1.3, "0.299 s after the release"), (1.05, 1.12, "too short")],
)
def test_a_record_too_short_to_swing_says_so(start_s, end_s, words):
    with pytest.raises(RecordError, match=words):
        identify(stretch(Truth(), start_s, end_s))


def test_swapped_channels_are_named():
    sound = simulate_record(Truth(duration_s=12.0, rate_hz=250.0))
    table, relative = sound.table_displacement_m, sound.relative_displacement_m
    swapped = sound.replace(table_displacement_m=relative, relative_displacement_m=table)
    with pytest.raises(RecordError, match=r"period of 0\.32 s: their channels look swapped"):
        identify(swapped)


def test_a_record_that_begins_with_the_release_needs_no_caution():
    time, table, relative = simulate_readings(Truth(noise_m=0.0, release_phase=0.0, hold_s=0.0))

    found = identify(Record(time, table, relative, MASSES))

    assert codes(found) == []
    assert found.results["friction_dynamic"].value == pytest.approx(0.1, abs=1e-9)


def test_a_gauge_2_that_is_mostly_clipped_is_left_out():
    time, table, relative = simulate_readings(Truth(offsets_m=(0.0, 0.0)))

    found = identify(Record(time, table, np.clip(relative, -0.002, 0.001), MASSES))

    assert {"clipped", "gauge-2-absent"} == set(codes(found))
    assert off(found) < 4.0


@pytest.mark.parametrize("factor", [1e-3, 1e-2, 10.0, 1e3])
@pytest.mark.parametrize("after_s", [0.5, 1.0, 1.05, 2.0])
def test_times_that_change_their_unit_on_the_way_are_refused_or_inadequate(factor, after_s):
    good = simulate_record(Truth(rate_hz=500.0))
    time_s = good.time_s.copy()
    first = int(np.searchsorted(time_s, time_s[0] + after_s))
    time_s[first:] = time_s[first] + (time_s[first:] - time_s[first]) * factor
    try:
        is_believed = identify(good.replace(time_s=time_s)).model.adequate
    except RecordError:
        is_believed = False
    assert not is_believed
