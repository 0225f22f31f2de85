"""Distributions from the shape of chi-square: known shapes, and a record at one of its jumps."""

import numpy as np
import pytest

from analysis.identify import identify
from analysis.quantities import COVERAGE_FACTOR_95
from analysis.results.fitted_quantities import distribution
from analysis.synthetic import Truth, simulate_record
from benchmarks import study_coverage

SIDE = np.array([0.1, 0.25, 0.5, 0.8, 1.2, 1.7, 2.4, 3.2]) * COVERAGE_FACTOR_95
SHIFTS = np.concatenate((-SIDE[::-1], [0.0], SIDE))
WALL = 3000.0


def test_a_parabola_is_a_normal_distribution():
    bent = distribution(SHIFTS, SHIFTS**2)

    assert (bent.below, bent.above) == pytest.approx((COVERAGE_FACTOR_95, COVERAGE_FACTOR_95), rel=0.01)
    assert bent.deviation == pytest.approx(1.0, rel=0.01)


def test_half_a_parabola_beside_a_wall_is_half_a_normal_distribution():
    bent = distribution(SHIFTS, np.where(SHIFTS < 0.0, WALL, SHIFTS**2))

    assert bent.below == pytest.approx(0.0, abs=0.02)
    assert bent.above == pytest.approx(COVERAGE_FACTOR_95, rel=0.01)
    assert bent.deviation == pytest.approx(np.sqrt(1.0 - 2.0 / np.pi), rel=0.02)


def test_a_slope_beside_a_wall_is_an_exponential_distribution():
    bent = distribution(SHIFTS, np.where(SHIFTS < 0.0, WALL, 2.0 * np.abs(SHIFTS)))

    assert bent.below == pytest.approx(0.0, abs=0.02)
    assert bent.above == pytest.approx(3.0, rel=0.03)  # exp(-3) is 5 %
    assert bent.deviation == pytest.approx(1.0, rel=0.06)


def test_a_lower_place_off_the_fit_is_within_the_interval():
    bent = distribution(SHIFTS, (SHIFTS - 1.0) ** 2 - 1.0)

    assert (bent.below, bent.above) == pytest.approx(
        (COVERAGE_FACTOR_95 - 1.0, COVERAGE_FACTOR_95 + 1.0), abs=0.03
    )


def test_intervals_of_a_level_plane_with_one_friction_are_symmetric():
    found = identify(simulate_record(Truth(rate_hz=300.0)))

    friction = found.results["friction_dynamic"]
    assert friction.interval_95 == pytest.approx(
        (
            friction.value - COVERAGE_FACTOR_95 * friction.standard_uncertainty,
            friction.value + COVERAGE_FACTOR_95 * friction.standard_uncertainty,
        )
    )


def test_intervals_at_a_jump_of_chi_square_hold_the_truth():
    """f_s of this test lies beside a jump; by the curvature its interval would be symmetric."""
    truth, law = study_coverage.draw(3229)
    truth = truth.replace(rate_hz=500.0)
    inside, lopsided, count = 0, 0, 30
    for seed in range(count):
        static = identify(simulate_record(truth.replace(seed=seed)), model=law).results["friction_static"]
        low, high = static.interval_95
        inside += low <= truth.friction_static <= high
        middle = 0.5 * (low + high)
        lopsided += abs(static.value - middle) > 0.1 * (high - low)

    assert inside >= 24  # 95 % of 30: fewer come once in 3000
    assert lopsided >= 5
