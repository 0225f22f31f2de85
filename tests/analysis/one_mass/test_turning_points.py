"""Turning points of decays whose answers are known from the half-cycle rule alone."""

import math

import numpy as np
import pytest

from analysis.motion.one_mass import OneMassDecay, simulate
from analysis.one_mass.turning_points import (
    classical_log_decrement,
    find_crossings,
    find_turning_points,
    regress_half_cycles,
)
from analysis.preparation.channels import Channel
from analysis.record import RecordError

PERIOD_S, DAMPING, COULOMB_M = 0.4, 0.15, 1e-4


def decay(rate_hz=500.0, duration_s=6.0, coulomb_m=COULOMB_M, noise_m=0.0, offset_m=0.002, gap=None):
    time_s = np.arange(0.0, duration_s, 1.0 / rate_hz)
    if gap is not None:
        time_s = time_s[(time_s < gap[0]) | (time_s > gap[1])]
    motion = simulate(OneMassDecay(PERIOD_S, DAMPING, coulomb_m, 0.0, 0.01), time_s)
    noise = noise_m * np.random.default_rng(3).standard_normal(len(time_s))
    return Channel(time_s, motion.displacement_m + offset_m + noise)


def test_crossings_tell_the_period_to_a_per_cent():
    crossings = find_crossings(decay(noise_m=5e-5))
    assert crossings.period_s == pytest.approx(PERIOD_S, rel=0.01)
    assert crossings.first_s == pytest.approx(PERIOD_S / 4, rel=0.05)


@pytest.mark.parametrize("value", [np.zeros(200), np.linspace(0.0, 1.0, 200), (np.arange(200) > 90) * 1.0])
def test_what_does_not_swing_has_no_crossings(value):
    with pytest.raises(RecordError, match="pass their middle"):
        find_crossings(Channel(np.arange(200) / 100.0, value))


@pytest.mark.parametrize(("rate_hz", "tolerance_m"), [(500.0, 2e-5), (30.0, 6e-5)])
def test_turning_points_are_those_of_the_motion(rate_hz, tolerance_m):
    points = find_turning_points(decay(rate_hz), 0.0, PERIOD_S)
    exact = simulate(OneMassDecay(PERIOD_S, DAMPING, COULOMB_M, 0.0, 0.01), np.array([6.0])).turning_m
    inner = points.number[points.number > 0]
    assert len(inner) > 15
    np.testing.assert_allclose(points.value[points.number > 0] - 0.002, exact[inner], atol=tolerance_m)
    np.testing.assert_array_equal(np.sign(exact[points.number]), points.side)


def test_turning_points_in_a_gap_are_left_out_and_the_others_keep_their_number():
    points = find_turning_points(decay(gap=(1.05, 2.31)), 0.0, PERIOD_S)
    missing = set(range(1, points.number[-1])) - set(points.number.tolist())  # 0 is the release itself
    assert missing == {6, 7, 8, 9, 10, 11}
    np.testing.assert_allclose(points.time_s, points.number * PERIOD_S / 2, atol=0.02)


@pytest.mark.parametrize("coulomb_m", [0.0, COULOMB_M])
def test_regression_separates_viscous_from_coulomb(coulomb_m):
    line = regress_half_cycles(find_turning_points(decay(coulomb_m=coulomb_m, noise_m=1e-5), 0.0, PERIOD_S))
    assert line is not None
    assert -math.log(line.ratio) * 2 / PERIOD_S == pytest.approx(DAMPING, rel=0.05)
    assert line.loss / (1 + line.ratio) == pytest.approx(coulomb_m, abs=5e-6)
    assert line.offset == pytest.approx(0.002, abs=1e-5)


def test_plain_log_decrement_is_right_for_viscous_damping_only():
    true = DAMPING * PERIOD_S
    viscous = classical_log_decrement(find_turning_points(decay(coulomb_m=0.0), 0.0, PERIOD_S), 0.0)
    assert viscous is not None
    assert viscous[0] == pytest.approx(true, rel=0.01)
    rubbing = classical_log_decrement(find_turning_points(decay(), 0.0, PERIOD_S), 0.0)
    assert rubbing is not None
    assert rubbing[0] > 1.5 * true


def test_the_papers_warning_about_the_plain_log_decrement():
    # x_k = 1 % of x0 reads as a damping ratio of 0.042 for a true 0.020.
    omega = 2 * math.pi
    n = 0.02 * omega / math.sqrt(1 - 0.02**2)
    time_s = np.arange(0.0, 12.0, 0.002)
    motion = simulate(OneMassDecay(1.0, n, 0.01, 0.0, 1.0), time_s)
    plain = classical_log_decrement(
        find_turning_points(Channel(time_s, motion.displacement_m), 0.0, 1.0), 0.0
    )
    assert plain is not None
    assert plain[0] / math.hypot(plain[0], omega) == pytest.approx(0.042, abs=0.008)


def test_uncertainty_of_the_plain_log_decrement_is_its_scatter():
    found = []
    for seed in range(60):
        clean = decay(rate_hz=60.0, coulomb_m=0.0)
        noise = 5e-5 * np.random.default_rng(seed).standard_normal(len(clean))
        points = find_turning_points(Channel(clean.time_s, clean.value_m + noise), 0.0, PERIOD_S)
        found.append(classical_log_decrement(points, 5e-5))
    values, deviations = np.array([plain for plain in found if plain is not None]).T
    assert len(values) == 60
    assert 0.6 < values.std(ddof=1) / deviations.mean() < 1.4


def test_too_few_turning_points_say_nothing():
    points = find_turning_points(decay(duration_s=0.5), 0.0, PERIOD_S)
    assert regress_half_cycles(points) is None
    assert classical_log_decrement(points, 0.0) is None
