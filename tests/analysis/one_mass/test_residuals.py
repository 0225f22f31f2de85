"""Noise passes, patterns do not: error rates as statistics, patterns one by one."""

import numpy as np
import pytest
from scipy.special import kolmogorov

from analysis.one_mass.residuals import KOLMOGOROV_RARE, RARE, assess_residuals, rounding_step


def white(count, seed):
    return np.random.default_rng(seed).standard_normal(count)


@pytest.mark.parametrize("count", [150, 2000])
def test_white_noise_is_rarely_called_a_pattern(count):
    wrong = sum(not assess_residuals(white(count, seed), 0.01, 0.0, 100.0).adequate for seed in range(1000))
    assert wrong <= 12  # expected about four; a Poisson count above 12 comes once in 3000


@pytest.mark.parametrize(
    "pattern",
    [
        lambda t: 0.3 * np.sin(2 * np.pi * 7.3 * t),
        lambda t: 0.3 * np.sin(2 * np.pi * 45.0 * t),
        lambda t: 0.1 * t,
        lambda t: 5.0 * np.exp(-3.0 * t),
        lambda t: 0.6 * (t > 15.0),
    ],
    ids=["line", "fast line", "drift", "transient", "step"],
)
def test_patterns_are_found(pattern):
    time_s = np.arange(2000) / 100.0
    assert not assess_residuals(white(2000, 1) + pattern(time_s), 0.01, 0.0, 100.0).adequate


def test_correlated_noise_is_not_white():
    noise = np.convolve(white(2100, 2), np.ones(4) / 2.0, "valid")
    assert not assess_residuals(noise, 0.01, 0.0, 100.0).adequate


def test_a_noisier_begin_is_found():
    noise = white(2000, 3)
    noise[:250] *= 1.5
    assert not assess_residuals(noise, 0.01, 0.0, 100.0).adequate


def test_the_line_is_named():
    time_s = np.arange(3000) / 100.0
    line = assess_residuals(white(3000, 4) + 0.5 * np.sin(2 * np.pi * 12.5 * time_s), 0.01, 0.0, 100.0).line
    assert line is not None
    assert line.frequency_hz == pytest.approx(12.5, abs=0.05)
    assert line.amplitude == pytest.approx(0.5, rel=0.15)


def test_rounding_may_have_any_colour_but_no_line_beyond_it():
    time_s = np.arange(3000) / 100.0
    swing = 20.0 * np.sin(2 * np.pi * 1.3 * time_s)
    assert assess_residuals(np.round(swing) - swing, 0.01, 1.0, 40.0).adequate
    assert not assess_residuals(
        np.round(swing) - swing + 0.6 * np.sin(20.0 * time_s), 0.01, 1.0, 40.0
    ).adequate


def test_computed_residuals_are_good_enough():
    time_s = np.arange(300) / 100.0
    assert assess_residuals(1e-15 * np.sin(20.0 * time_s), 0.01, 0.0, 0.02).adequate


def test_rounding_step():
    value = 3.0 * np.sin(np.arange(3000) / 50.0)
    assert rounding_step(np.round(value / 0.02) * 0.02 + 0.137) == pytest.approx(0.02)
    assert rounding_step(np.round(np.round(value / 0.0234) * 0.0234, 3)) == pytest.approx(0.0234, abs=0.001)
    assert rounding_step(value + 1e-3 * white(3000, 5)) == 0.0
    assert rounding_step(np.zeros(100)) == 0.0


def test_flatness_is_refused_by_the_quantile_of_kolmogorov():
    assert kolmogorov(KOLMOGOROV_RARE) == pytest.approx(RARE, rel=1e-12)
