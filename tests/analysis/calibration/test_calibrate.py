"""Calibration of a gauge, against a worked example, another program's fit, and known truth."""

import numpy as np
import pytest
from scipy.optimize import curve_fit

from analysis.calibration.calibrate import Calibration, DialGauge, calibrate, fit_curve
from analysis.calibration.points import CalibrationError, CalibrationPoints

# JCGM 100:2008, H.3, Table H.6: readings t (degrees C) and corrections b (degrees C) of a thermometer.
H6_T = [21.521, 22.012, 22.512, 23.003, 23.507, 23.999, 24.513, 25.002, 25.503, 26.010, 26.511]
H6_B = [-0.171, -0.169, -0.166, -0.159, -0.164, -0.165, -0.156, -0.157, -0.159, -0.161, -0.160]

GAIN, ZERO = 2.5e-9, 40_000.0
MARKS = 0.002 * np.arange(7)
ONE_ROUND = np.concatenate((MARKS, MARKS[-2::-1]))


def rounds(number: int) -> np.ndarray:
    """Dial readings (m) up and down in 2 mm steps."""
    return np.concatenate((ONE_ROUND, *[ONE_ROUND[1:]] * (number - 1)))


def counts_of(dial_m: np.ndarray, noise_m: float = 0.0, seed: int = 0) -> np.ndarray:
    """Counts of a straight gauge."""
    noise = noise_m * np.random.default_rng(seed).standard_normal(len(dial_m))
    return (dial_m + noise) / GAIN + ZERO


def calibrated(dial_m: np.ndarray, counts: np.ndarray, **options: int) -> Calibration:
    return calibrate(CalibrationPoints.from_readings(counts, dial_m), DialGauge(1e-5, 3e-6), **options)


def test_the_worked_example_of_jcgm_100_h3() -> None:
    curve = fit_curve(np.array(H6_T) - 20.0, np.array(H6_B), 1)
    intercept, slope = curve.polynomial.convert().coef
    zero, thirty = curve.standard_uncertainty(np.array([0.0, 10.0])) * curve.scatter_m
    slope_uncertainty = curve.chord_standard_uncertainty() * curve.scatter_m / np.ptp(curve.ends)

    assert intercept == pytest.approx(-0.1712, abs=5e-5)
    assert zero == pytest.approx(0.0029, abs=5e-5)
    assert slope == pytest.approx(0.00218, abs=5e-6)
    assert slope_uncertainty == pytest.approx(0.00067, abs=5e-6)
    assert curve.scatter_m == pytest.approx(0.0035, abs=5e-5)
    assert curve.degrees_of_freedom == 9
    assert curve.polynomial(10.0) == pytest.approx(-0.1494, abs=5e-5)
    assert thirty == pytest.approx(0.0041, abs=5e-5)


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_curve_and_spread_are_those_of_numpy_and_minpack(degree: int) -> None:
    random = np.random.default_rng(3)
    counts = np.sort(random.uniform(-2.0, 3.0, 12))
    displacement_m = 0.4 + counts + 0.05 * counts**2 + 0.01 * random.standard_normal(12)
    curve = fit_curve(counts, displacement_m, degree)
    at = np.linspace(-2.0, 3.0, 5)

    coefficients, covariance = np.polyfit(counts, displacement_m, degree, cov=True)
    rows = np.vander(at, degree + 1)
    np.testing.assert_allclose(curve.polynomial(at), rows @ coefficients, rtol=1e-9)
    spread = np.sqrt(np.einsum("ij,jk,ik->i", rows, covariance, rows))
    np.testing.assert_allclose(curve.standard_uncertainty(at) * curve.scatter_m, spread, rtol=1e-9)

    def law(count: np.ndarray, *terms: float) -> np.ndarray:
        return np.polynomial.polynomial.polyval(count, terms)

    found, errors = curve_fit(law, counts, displacement_m, p0=np.zeros(degree + 1))  # by MINPACK
    np.testing.assert_allclose(curve.polynomial.convert().coef, found, rtol=1e-5, atol=1e-7)
    zero = curve.standard_uncertainty(np.array([0.0]))[0] * curve.scatter_m
    assert zero == pytest.approx(np.sqrt(errors[0, 0]), rel=1e-5)


def test_a_straight_gauge_is_found_as_it_is() -> None:
    dial_m = rounds(3)
    found = calibrated(dial_m, counts_of(dial_m))

    assert found.gain_m_per_count.value == pytest.approx(GAIN, rel=1e-12)
    assert found.zero_count.value == pytest.approx(ZERO, abs=1e-4)
    assert found.characteristics.nonlinearity_m < 1e-12
    # What a perfect line still leaves open: the dial, read to 0.01 mm and certified to 3 um.
    relative = np.hypot(
        1e-5 / np.sqrt(12.0) / np.sqrt(np.sum((MARKS - 0.006) ** 2)), np.sqrt(2) * 3e-6 / 0.012
    )
    assert found.gain_relative_standard_uncertainty == pytest.approx(relative, rel=1e-9)
    assert found.warnings == ()


def test_a_gauge_mounted_the_other_way_has_a_negative_gain() -> None:
    dial_m = rounds(2)
    found = calibrated(dial_m, -counts_of(dial_m))

    assert found.gain_m_per_count.value == pytest.approx(-GAIN, rel=1e-12)
    assert found.zero_count.value == pytest.approx(-ZERO, abs=1e-4)
    assert found.gain_m_per_count.standard_uncertainty > 0.0


def test_hysteresis_repeatability_and_drift_are_told_apart() -> None:
    dial_m = rounds(3)
    way = np.sign(np.diff(dial_m, prepend=-1.0))
    loop_m = 10e-6 * way * np.sin(np.pi * dial_m / 0.012)
    drift_m = np.linspace(0.0, 8e-6, len(dial_m))
    only_loop = calibrated(dial_m, counts_of(dial_m + loop_m))
    only_drift = calibrated(dial_m, counts_of(dial_m + drift_m))
    only_noise = calibrated(dial_m, counts_of(dial_m, noise_m=5e-6, seed=2))

    assert only_loop.characteristics.hysteresis_m == pytest.approx(20e-6, rel=0.02)
    assert only_loop.characteristics.nonlinearity_m == pytest.approx(10e-6, rel=0.1)
    assert only_loop.characteristics.repeatability_m == pytest.approx(0.0, abs=1e-9)
    assert only_drift.characteristics.zero_drift_m == pytest.approx(8e-6, rel=0.02)
    assert only_noise.characteristics.repeatability_m == pytest.approx(5e-6, rel=0.3)


def test_a_bent_gauge_wants_a_polynomial() -> None:
    dial_m = rounds(2)
    linear_m = dial_m - 2.0 * dial_m**2 + 30.0 * dial_m**3
    counts = linear_m / GAIN + ZERO
    line, cubic = calibrated(dial_m, counts), calibrated(dial_m, counts, degree=3)

    assert line.characteristics.nonlinearity_m > 30e-6
    assert cubic.characteristics.nonlinearity_m < 1e-6
    assert cubic.gain_m_per_count.value == pytest.approx(GAIN, rel=1e-3)
    np.testing.assert_allclose(cubic.displacement_m(counts), dial_m, atol=1e-6)
    np.testing.assert_allclose(dial_m - cubic.displacement_m(counts), cubic.residual_m, atol=1e-12)


def test_intervals_hold_the_true_gain_in_95_of_100() -> None:
    random = np.random.default_rng(11)
    dial_m, tries, held = rounds(2), 1500, 0
    steps = np.searchsorted(MARKS, dial_m - 1e-6)
    for _ in range(tries):
        gauge_m = 6e-6 * random.standard_normal(len(MARKS))[steps]
        noise_m = 4e-6 * random.standard_normal(len(dial_m))
        ends_m = 4e-6 * random.standard_normal(2)
        dial_off_m = ends_m[0] + (ends_m[1] - ends_m[0]) * dial_m / 0.012
        counts = (dial_m + gauge_m + noise_m) / GAIN + ZERO
        found = calibrate(CalibrationPoints.from_readings(counts, dial_m + dial_off_m), DialGauge(1e-6, 4e-6))
        low, high = found.gain_m_per_count.interval_95
        held += low <= GAIN <= high
    assert 0.93 <= held / tries <= 0.975


def test_few_steps_widen_the_interval_by_students_factor() -> None:
    found = calibrate(
        CalibrationPoints.from_readings(counts_of(MARKS, noise_m=50e-6), MARKS), DialGauge(0.0, 0.0)
    )
    gain = found.gain_m_per_count
    # Table G.2 of JCGM 100: 2.57 for five degrees of freedom (seven steps, two coefficients).
    assert (gain.interval_95[1] - gain.value) / gain.standard_uncertainty == pytest.approx(2.57, abs=0.005)
    widened = found.gain_relative_normal_uncertainty / found.gain_relative_standard_uncertainty
    assert widened == pytest.approx(2.5706 / 1.95996, rel=1e-4)


def test_directions_and_rounds_are_seen_from_the_dial() -> None:
    dial_m = rounds(2)
    seen = CalibrationPoints.from_readings(counts_of(dial_m), dial_m)

    assert seen.direction.tolist() == [1] * 7 + [-1] * 6 + [1] * 6 + [-1] * 6
    assert seen.round_number.tolist() == [1] * 13 + [2] * 12
    np.testing.assert_array_equal(seen.steps(), np.rint(dial_m / 0.002))


def test_readings_near_the_marks_are_of_one_step() -> None:
    dial_m = rounds(3) + np.random.default_rng(5).uniform(-3e-4, 3e-4, 37)
    seen = CalibrationPoints.from_readings(counts_of(dial_m), dial_m)
    np.testing.assert_array_equal(seen.steps(), np.rint(dial_m / 0.002))


def test_a_misread_turn_of_the_dial_is_doubted() -> None:
    dial_m = rounds(2)
    counts = counts_of(dial_m, noise_m=2e-6)
    dial_m[9] += 0.001
    found = calibrated(dial_m, counts)
    assert [str(caution.message)[:10] for caution in found.warnings] == ["reading 10"]


def test_what_one_way_and_an_unknown_dial_cannot_tell_is_said() -> None:
    found = calibrate(CalibrationPoints.from_readings(counts_of(MARKS), MARKS))
    codes = [caution.code for caution in found.warnings]
    assert codes == ["dial-uncertainty-not-stated", "one-way-only", "one-round-only"]
    assert found.characteristics.hysteresis_m is None
    unstated = [line for line in found.budget if np.isnan(line.standard_uncertainty)]
    assert {str(line.source) for line in unstated} == {"dial gauge"}


GOOD = [100.0, 200.0, 300.0, 400.0]


@pytest.mark.parametrize(
    ("counts", "dial_mm", "said"),
    [
        ([100.0, 200.0], [0.0, 1.0], "2 steps are too few for degree 1. Take at least 3"),
        ([100.0], [0.0], "1 readings of the dial gauge show one position"),
        ([], [], "0 readings"),
        (GOOD, [2.0] * 4, "the dial stays at 2 mm"),
        ([7.0] * 4, [0.0, 1.0, 2.0, 3.0], "all 4 counts are 7"),
        ([100.0, 200.0, 150.0, 400.0], [0.0, 1.0, 2.0, 3.0], "reading 3: counts go from 200 to 150"),
        ([100.0, 200.0, 200.0, 400.0], [0.0, 1.0, 2.0, 3.0], "reading 3: counts go from 200 to 200"),
        (GOOD, [0.0, 1.0, 1.0, 2.0], "reading 3: the dial stays at 1 mm"),
        (GOOD, [0.0, 1.0, float("nan"), 2.0], "reading 3: the dial reading nan is not a finite number"),
        ([*GOOD[:3], float("inf")], [0.0, 1.0, 2.0, 3.0], "reading 4: the count inf"),
        (GOOD, [0.0, 1.0, 2.0], "4 counts, 3 dial readings"),
    ],
)
def test_readings_that_make_no_calibration(counts: list[float], dial_mm: list[float], said: str) -> None:
    with pytest.raises(CalibrationError) as refused:
        calibrate(CalibrationPoints.from_readings(counts, np.array(dial_mm) * 1e-3))
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_direction_that_the_dial_does_not_go_is_named() -> None:
    with pytest.raises(CalibrationError, match="reading 2: the dial goes from 0 to 1 mm on the way down"):
        CalibrationPoints.from_readings(GOOD, [0.0, 1e-3, 2e-3, 3e-3], [-1] * 4, [1] * 4)


def test_a_polynomial_that_turns_back_is_refused() -> None:
    dial_m = np.array([0.0, 0.001, 0.002, 0.003, 0.0301, 0.0302])
    counts = np.array([0.0, 10.0, 20.0, 30.0, 31.0, 61.0])
    with pytest.raises(CalibrationError, match="turns back"):
        calibrate(CalibrationPoints.from_readings(counts, dial_m), degree=3)


def test_a_polynomial_far_from_the_dials_zero_is_refused() -> None:
    dial_m = 0.05 + rounds(1)
    counts = counts_of(dial_m - 3.0 * (dial_m - 0.05) ** 2)
    with pytest.raises(CalibrationError, match="too far from its readings"):
        calibrate(CalibrationPoints.from_readings(counts, dial_m), degree=2)
    line = calibrate(CalibrationPoints.from_readings(counts, dial_m))
    assert line.zero_count.value < counts.min()


def test_degrees_and_dials_that_cannot_be() -> None:
    readings = CalibrationPoints.from_readings(counts_of(MARKS), MARKS)
    with pytest.raises(CalibrationError, match="degree 4 is not offered"):
        calibrate(readings, degree=4)
    with pytest.raises(CalibrationError, match="dial resolution -1 m"):
        DialGauge(-1.0)
