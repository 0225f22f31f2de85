"""Motion and signals of the simulated stand against solver, calibration and options."""

import json
from pathlib import Path

import msgspec
import numpy as np
import pytest

from app.simulated_stand.motion import RepeatedPullback, released_motion, stand_truth
from app.simulated_stand.options import SimulatedStandOptions, Timetable
from app.simulated_stand.signal import (
    GaugeFaults,
    SimulatedGauge,
    StandSignal,
    SwappedChannels,
)
from config.files import load_gauges, load_stand
from config.schema import ConfigError, Gauge
from drivers.samples import SampleStatus
from drivers.simulated.protocol import MAX_COUNT

TIMETABLE = Timetable(rest_s=1.0, pull_s=2.0, hold_s=1.5, decay_s=8.0, recentre_s=1.0)
GOLDEN = Path(__file__).parents[2] / "golden" / "two_mass.json"


def stand_motion(**options) -> RepeatedPullback:
    true = stand_truth(SimulatedStandOptions(**options), load_stand())
    return RepeatedPullback(true.pullback_m, released_motion(true, TIMETABLE), TIMETABLE)


def read(gauge: Gauge, faults: GaugeFaults, true_m: np.ndarray, drifting_s: np.ndarray):
    return SimulatedGauge(gauge, faults, np.random.default_rng(3)).read(true_m, drifting_s)


def test_parameters_of_a_series_are_those_of_its_row():
    golden = {case["name"]: case for case in json.loads(GOLDEN.read_text())}["1FFM0"]
    true = msgspec.to_builtins(stand_truth(SimulatedStandOptions(series="1FFM0"), load_stand()))
    for name in ("stiffness_n_per_m", "damping_coefficient_kg_per_s", "friction_dynamic", "plate_mass_kg"):
        assert true[name] == pytest.approx(golden[name], rel=1e-12)
    assert true["friction_static"] == true["friction_dynamic"]


def test_motion_after_release_is_the_golden_one():
    golden = {case["name"]: case for case in json.loads(GOLDEN.read_text())}["1FFM0"]
    times_s = np.array([t for t in golden["sample_times_s"] if t < TIMETABLE.decay_s])
    table, relative = stand_motion(series="1FFM0").displacements(times_s + TIMETABLE.release_s)
    np.testing.assert_allclose(table, golden["table_displacement_m"][: len(times_s)], atol=1e-9)
    np.testing.assert_allclose(relative, golden["relative_displacement_m"][: len(times_s)], atol=1e-9)


@pytest.mark.parametrize("pullback_m", [0.012, -0.006])
def test_a_test_rests_pulls_smoothly_holds_and_begins_again(pullback_m):
    motion = stand_motion(pullback_m=pullback_m)
    step_s = 1e-3
    time_s = np.arange(0.0, 2 * TIMETABLE.cycle_s, step_s)
    table, relative = motion.displacements(time_s)
    assert not table[time_s <= 1.0].any()
    held = (time_s > 3.0) & (time_s <= TIMETABLE.release_s)
    np.testing.assert_allclose(table[held], pullback_m, rtol=1e-15)
    assert not relative[time_s <= TIMETABLE.release_s].any()
    # No jump anywhere: not faster than the free motion, which is under 0.4 m/s for every series.
    assert np.abs(np.diff(table)).max() < 0.4 * step_s
    assert np.abs(np.diff(relative)).max() < 0.4 * step_s
    rest = (time_s >= TIMETABLE.cycle_s + 1e-9) & (time_s <= TIMETABLE.cycle_s + 1.0)
    np.testing.assert_allclose(table[rest], 0.0, atol=1e-12)
    np.testing.assert_allclose(relative[rest], 0.0, atol=1e-12)
    again, _ = motion.displacements(time_s[time_s < TIMETABLE.cycle_s] + TIMETABLE.cycle_s)
    np.testing.assert_allclose(again, table[time_s < TIMETABLE.cycle_s], atol=1e-12)


def offsets_at_rest(**options) -> tuple[np.ndarray, float]:
    """Where the plate stands in the rest before each of four tests, and u_s, with eight seconds of decay."""
    timetable = Timetable(1.0, 2.0, 1.5, 8.0, 1.0, **options)
    true = stand_truth(SimulatedStandOptions(), load_stand())
    motion = RepeatedPullback(true.pullback_m, released_motion(true, timetable), timetable, 0.002)
    starts_s = np.arange(4) * timetable.cycle_s
    table, relative = motion.displacements(starts_s + 0.5)
    np.testing.assert_allclose(table, 0.0, atol=1e-12)
    np.testing.assert_allclose([test.offset_m for test in motion.first_tests(4)], relative, atol=1e-12)
    return relative, motion.released.residual_displacement_m


def test_the_plate_stays_where_it_slid_to_until_it_is_put_back():
    golden = {case["name"]: case for case in json.loads(GOLDEN.read_text())}["1FFM0"]
    never, residual_m = offsets_at_rest(recentre_every=0)
    assert residual_m == pytest.approx(golden["residual_displacement_m"], abs=1e-9)
    np.testing.assert_allclose(never, 0.002 + np.arange(4) * residual_m, atol=1e-12)
    np.testing.assert_allclose(offsets_at_rest()[0], [0.002, 0.0, 0.0, 0.0], atol=1e-12)
    second, _ = offsets_at_rest(recentre_every=2)
    np.testing.assert_allclose(second, [0.002, 0.002 + residual_m, 0.0, residual_m], atol=1e-12)


def test_the_plate_slides_alike_wherever_it_stands():
    timetable = Timetable(1.0, 2.0, 1.5, 8.0, 1.0, recentre_every=0)
    true = stand_truth(SimulatedStandOptions(), load_stand())
    motion = RepeatedPullback(true.pullback_m, released_motion(true, timetable), timetable)
    time_s = np.arange(0.0, timetable.cycle_s, 1e-3)
    first, second = (motion.displacements(time_s + k * timetable.cycle_s) for k in (0, 1))
    np.testing.assert_allclose(second[0], first[0], atol=1e-12)
    np.testing.assert_allclose(second[1] - second[1][0], first[1], atol=1e-12)
    assert np.abs(np.diff(np.concatenate([first[1], second[1]]))).max() < 0.4 * 1e-3


def test_tests_begin_as_often_as_asked_and_end_after_their_count():
    timetable = Timetable(1.0, 2.0, 1.5, 8.0, 1.0, every_s=20.0, count=2, recentre_every=0)
    true = stand_truth(SimulatedStandOptions(), load_stand())
    motion = RepeatedPullback(true.pullback_m, released_motion(true, timetable), timetable)
    time_s = np.arange(0.0, 70.0, 0.01)
    table, relative = motion.displacements(time_s)
    held = np.flatnonzero(np.abs(table - true.pullback_m) < 1e-15) * 0.01
    assert sorted(set(np.floor(held / 20.0))) == [0.0, 1.0]
    np.testing.assert_allclose(table[(time_s > 13.5) & (time_s < 21.0)], 0.0, atol=1e-12)
    assert not table[time_s > 40.0].any()
    np.testing.assert_allclose(
        relative[time_s > 40.0], 2 * motion.released.residual_displacement_m, atol=1e-12
    )


def test_counts_come_back_to_metres_by_the_calibration():
    gauge = Gauge(gain_m_per_count=-2e-9, zero_count=12000.0, range_m=0.015)
    true_m = np.linspace(-0.014, 0.014, 1001)
    counts, overloaded = read(gauge, GaugeFaults(), true_m, 0 * true_m)
    np.testing.assert_allclose((counts - 12000.0) * -2e-9, true_m, atol=1.0001e-9)
    assert not overloaded.any()


@pytest.mark.parametrize(("range_m", "limit_m"), [(0.010, 0.010), (None, (MAX_COUNT - 12000) * 2e-9)])
def test_beyond_the_range_of_gauge_or_converter_readings_are_clipped_and_flagged(range_m, limit_m):
    gauge = Gauge(gain_m_per_count=2e-9, zero_count=12000.0, range_m=range_m)
    true_m = np.linspace(-0.03, 0.03, 2001)
    counts, overloaded = read(gauge, GaugeFaults(), true_m, 0 * true_m)
    np.testing.assert_array_equal(overloaded, np.abs(true_m) > limit_m)
    assert np.abs(counts).max() <= MAX_COUNT
    np.testing.assert_allclose((counts - 12000.0) * 2e-9, np.clip(true_m, -limit_m, limit_m), atol=1.0001e-9)


def test_noise_has_the_chosen_deviation_and_is_white():
    gauge = Gauge(gain_m_per_count=2e-9, zero_count=0.0)
    count = 200_000
    counts, _ = read(gauge, GaugeFaults(noise_m=20e-6), np.zeros(count), np.zeros(count))
    noise_m = counts * 2e-9
    # Five standard errors: of a standard deviation sigma/sqrt(2 n), of a correlation 1/sqrt(n).
    assert abs(noise_m.std() - 20e-6) < 5 * 20e-6 / np.sqrt(2 * count)
    assert abs(noise_m.mean()) < 5 * 20e-6 / np.sqrt(count)
    assert abs(np.corrcoef(noise_m[1:], noise_m[:-1])[0, 1]) < 5 / np.sqrt(count)


def test_drift_and_non_linearity_are_as_large_as_chosen():
    gauge = Gauge(gain_m_per_count=1e-9, zero_count=0.0, range_m=0.008)
    true_m = np.linspace(-0.008, 0.008, 1601)
    bent, _ = read(gauge, GaugeFaults(nonlinearity_m=5e-6), true_m, 0 * true_m)
    deviation_m = bent * 1e-9 - true_m
    assert np.abs(deviation_m).max() == pytest.approx(5e-6, abs=1e-9)
    assert np.abs(deviation_m[[0, 800, -1]]).max() < 1e-9
    still = np.zeros(11)
    crept, _ = read(gauge, GaugeFaults(drift_m_per_s=20e-6), still, np.arange(11.0))
    np.testing.assert_allclose(crept * 1e-9, 20e-6 * np.arange(11), atol=1e-9)


def test_the_signal_is_the_same_however_it_is_taken():
    motion, gauges = stand_motion(), load_gauges()
    options = SimulatedStandOptions(seed=7)
    whole, _ = StandSignal(motion, gauges, options, 1000.0).take(12_000)
    signal = StandSignal(motion, gauges, options, 1000.0)
    np.testing.assert_array_equal(np.concatenate([signal.take(5)[0] for _ in range(2400)]), whole)


def test_the_signal_is_the_motion_with_noise_on_both_gauges():
    motion, gauges = stand_motion(), load_gauges()
    quiet, _ = StandSignal(motion, gauges, SimulatedStandOptions(noise_m=0.0), 1000.0).take(12_000)
    table, relative = motion.displacements(np.arange(12_000) / 1000.0)
    np.testing.assert_allclose((quiet[:, 0] - 12000.0) * 2e-9, table, atol=1.001e-9)
    np.testing.assert_allclose((quiet[:, 1] + 8000.0) * 4e-9, relative, atol=2.001e-9)
    noisy, _ = StandSignal(motion, gauges, SimulatedStandOptions(seed=7), 1000.0).take(12_000)
    noise_m = (noisy - quiet) * [2e-9, 4e-9]
    np.testing.assert_allclose(noise_m.std(axis=0), 20e-6, rtol=5 / np.sqrt(2 * 12_000))
    assert abs(np.corrcoef(noise_m.T)[0, 1]) < 5 / np.sqrt(12_000)


def test_a_gauge_on_the_plate_shows_both_motions():
    motion, gauges = stand_motion(), load_gauges()
    absolute = gauges.replace(relative=gauges.relative.replace(measures="plate", range_m=None))
    counts, _ = StandSignal(motion, absolute, SimulatedStandOptions(noise_m=0.0), 1000.0).take(6000)
    table, relative = motion.displacements(np.arange(6000) / 1000.0)
    np.testing.assert_allclose((counts[:, 1] + 8000.0) * 4e-9, table + relative, atol=2.001e-9)


def test_an_overloaded_gauge_is_flagged_on_its_own_channel():
    gauges = load_gauges()
    narrow = gauges.replace(relative=gauges.relative.replace(range_m=0.005))
    quiet = SimulatedStandOptions(noise_m=0.0)
    _, status = StandSignal(stand_motion(), narrow, quiet, 1000.0).take(9000)
    _, relative = stand_motion().displacements(np.arange(9000) / 1000.0)
    np.testing.assert_array_equal(status == SampleStatus.OVERLOAD_RELATIVE, np.abs(relative) > 0.005)
    assert not (status & SampleStatus.OVERLOAD_TABLE).any()


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("rate_hz", 0.0),
        ("friction", -0.1),
        ("noise_m", float("nan")),
        ("decay_s", 0.0),
        ("drop", 1.5),
        ("tilt_rad", 1),
        ("every_s", 3.0),
        ("count", -1),
    ],
)
def test_an_option_out_of_range_names_itself_and_its_limits(option, value):
    with pytest.raises(ValueError, match=rf"{option} = .* give"):
        SimulatedStandOptions(**{option: value})


def test_a_series_that_the_paper_has_not_is_refused():
    with pytest.raises(ConfigError, match="9FFM0"):
        stand_truth(SimulatedStandOptions(series="9FFM0"), load_stand())


def test_a_device_of_one_gauge_has_it_on_its_first_channel():
    table, relative = (SimulatedStandOptions(protocol="csv", gauge=gauge) for gauge in ("table", "relative"))
    assert table.device_settings() == ({"columns": "time_us,value"}, False)
    assert relative.device_settings() == ({"columns": "time_us,value"}, True)
    polled = SimulatedStandOptions(protocol="modbus", gauge="relative", device={"unit": "2"})
    assert polled.device_settings() == ({"channel": "relative", "unit": "2"}, False)
    assert SimulatedStandOptions(protocol="modbus").device_settings() == ({}, False)

    options = SimulatedStandOptions(seed=1, relative_clip_m=1e-5)
    both, turned = (StandSignal(stand_motion(), load_gauges(), options, 500.0) for _ in range(2))
    counts, status = both.take(500)
    seen, flags = SwappedChannels(turned).take(500)
    np.testing.assert_array_equal(seen, counts[:, ::-1])
    np.testing.assert_array_equal(
        status == SampleStatus.OVERLOAD_RELATIVE, flags == SampleStatus.OVERLOAD_TABLE
    )
    assert flags.any()


def on_demand(**options) -> RepeatedPullback:
    """A motion whose tests begin when they are asked for, and which may be let go early."""
    true = stand_truth(SimulatedStandOptions(), load_stand())

    def release_from(pullback_m: float):
        return released_motion(msgspec.structs.replace(true, pullback_m=pullback_m), TIMETABLE)

    released = released_motion(true, TIMETABLE)
    return RepeatedPullback(0.012, released, TIMETABLE, release_from=release_from, **options)


def test_a_test_on_demand_begins_when_it_is_asked_for_and_is_as_any_other():
    motion, usual = on_demand(on_demand=True), stand_motion()
    time_s = np.arange(0.0, 30.0, 0.01)
    assert not np.any(motion.displacements(time_s))
    motion.request(3.0)  # what was sent until 30 s is sent
    within_s = np.arange(0.0, TIMETABLE.cycle_s, 0.01)
    shown = motion.displacements(time_s[-1] + within_s)
    np.testing.assert_allclose(shown, usual.displacements(within_s), atol=1e-12)
    assert not np.any(motion.displacements(time_s + 60.0)), "it rests until it is asked again"
    assert motion.count_releases(100.0) == 1


def test_a_request_before_the_release_changes_nothing_and_one_after_it_stills_the_table():
    motion = on_demand(on_demand=True)
    motion.request(0.0)
    motion.displacements(np.array([2.0]))
    motion.request(2.0)
    assert motion.count_releases(100.0) == 1
    asked_s = TIMETABLE.release_s + 2.0
    before = motion.displacements(np.array([asked_s]))
    motion.request(asked_s)
    np.testing.assert_array_equal(motion.displacements(np.array([asked_s])), before)
    time_s = np.arange(asked_s, asked_s + 30.0, 1e-3)
    table, relative = motion.displacements(time_s)
    assert np.abs(np.diff(table)).max() < 0.4e-3
    assert np.abs(np.diff(relative)).max() < 0.4e-3
    stilled_s = asked_s + TIMETABLE.recentre_s
    resting = (time_s > stilled_s + 1e-6) & (time_s < stilled_s + TIMETABLE.rest_s)
    np.testing.assert_allclose(table[resting], 0.0, atol=1e-12)
    second = motion.first_tests(2)[1]
    assert second.release_s == pytest.approx(stilled_s + TIMETABLE.release_s)


@pytest.mark.parametrize("asks", [True, False])
def test_a_test_that_is_let_go_too_early_is_followed_by_a_full_one(asks):
    motion = on_demand(on_demand=asks)
    motion.let_go_early(0.004)
    motion.request(0.0)
    time_s = np.arange(0.0, 20.0, 1e-3)
    table, _ = motion.displacements(time_s)
    early, full = motion.first_tests(2)
    assert early.release_s == pytest.approx(TIMETABLE.rest_s + TIMETABLE.pull_s + 0.1)
    assert table[time_s <= early.release_s].max() == pytest.approx(0.004)
    swinging = (time_s > early.release_s) & (time_s < early.release_s + 0.3)
    assert table[swinging].min() < -0.002
    assert table[time_s >= full.release_s - 0.5][0] == pytest.approx(0.012)
    assert np.abs(np.diff(table)).max() < 0.4e-3
    assert full.offset_m == 0.0, "the plate was put back"
    motion.restart()
    motion.request(0.0)
    table, _ = motion.displacements(time_s[time_s < TIMETABLE.release_s])
    assert table.max() == pytest.approx(0.012)
