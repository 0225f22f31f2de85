"""The variance between runs, against published meta-analyses and hand calculations."""

import math

import numpy as np
import pytest

from analysis.campaign.scatter import RepeatedValues, find_outliers

BCG = (
    (4, 119, 11, 128), (6, 300, 29, 274), (3, 228, 11, 209), (62, 13536, 248, 12619), (33, 5036, 47, 5761),
    (180, 1361, 372, 1079), (8, 2537, 10, 619), (505, 87886, 499, 87892), (29, 7470, 45, 7232),
    (17, 1699, 65, 1600), (186, 50448, 141, 27197), (5, 2493, 3, 2338), (27, 16886, 29, 17825),
)  # fmt: skip
"""Trials of a vaccine (Colditz et al., JAMA 271 (1994) 698): ill and well with it, ill and well without."""


def bcg() -> RepeatedValues:
    values = [math.log((a / (a + b)) / (c / (c + d))) for a, b, c, d in BCG]
    variances = [1 / a - 1 / (a + b) + 1 / c - 1 / (c + d) for a, b, c, d in BCG]
    ones = np.ones(len(BCG))
    return RepeatedValues(np.array(values), np.array(variances), ones, np.zeros(len(BCG), dtype=np.intp))


def test_weighted_mean_and_chi_square_are_those_of_the_literature():
    """Viechtbauer, J. Stat. Software 36 (2010) 3: fixed effect -0.4303, Q(12) = 152.2330."""
    assert bcg().means(0.0)[0] == pytest.approx(-0.4303, abs=5e-5)
    assert bcg().chi_squares(0.0)[0] == pytest.approx(152.2330, abs=5e-5)


def test_mandel_and_paule_is_that_of_the_literature():
    """The estimator's variance of these trials is 0.3181 (metafor, method "PM"), their mean then -0.7150."""
    found = bcg().between_run_deviation()

    assert found**2 == pytest.approx(0.3181, abs=5e-5)
    assert bcg().chi_squares(found)[0] == pytest.approx(12.0, rel=1e-6)
    assert bcg().means(found)[0] == pytest.approx(-0.7150, abs=1e-3)


def test_equal_uncertainties_give_the_analysis_of_variance():
    rng = np.random.default_rng(3)
    values = rng.normal(0.0, 3.0, (5, 4)) + np.arange(5)[:, None]
    repeats = RepeatedValues(values.ravel(), np.ones(20), np.ones(20), np.repeat(np.arange(5), 4))
    within = np.mean(values.var(axis=1, ddof=1))

    assert repeats.degrees_of_freedom == 15
    assert repeats.between_run_deviation() ** 2 == pytest.approx(within - 1.0, rel=1e-6)


def test_runs_that_agree_better_than_stated_differ_by_nothing():
    repeats = RepeatedValues(np.array([1.0, 1.1]), np.ones(2), np.ones(2), np.zeros(2, dtype=np.intp))

    assert repeats.between_run_deviation() == 0.0


def test_single_runs_tell_nothing():
    repeats = RepeatedValues(np.array([1.0, 5.0]), np.full(2, 1e-6), np.ones(2), np.arange(2))

    assert repeats.degrees_of_freedom == 0
    assert repeats.between_run_deviation() == 0.0


def repeats(values, own=1e-3):
    values = np.asarray(values, float)
    count, each = values.shape
    return RepeatedValues(
        values.ravel(), np.full(values.size, own**2), np.ones(values.size), np.repeat(np.arange(count), each)
    )


def test_one_run_out_of_place_is_named_alone():
    rng = np.random.default_rng(1)
    values = 1.0 + 1e-3 * rng.standard_normal((12, 3))
    values[4, 1] += 0.02

    assert np.flatnonzero(find_outliers(repeats(values))).tolist() == [13]


def test_two_runs_out_of_place_do_not_hide_each_other():
    rng = np.random.default_rng(2)
    values = 1.0 + 1e-3 * rng.standard_normal((12, 3))
    values[4, 1] += 0.02
    values[7, 0] -= 0.03

    assert np.flatnonzero(find_outliers(repeats(values))).tolist() == [13, 21]


def test_of_two_runs_that_differ_both_are_named():
    rng = np.random.default_rng(3)
    values = 1.0 + 1e-3 * rng.standard_normal((12, 2))
    values[4] = 1.0, 1.05

    assert np.flatnonzero(find_outliers(repeats(values))).tolist() == [8, 9]


def test_series_that_scatter_differently_are_not_taken_for_outliers():
    """Held against one scatter for all, two of three such sets would have one."""
    rng = np.random.default_rng(6)
    named = 0
    for _ in range(40):
        between = 1e-2 * np.exp(1.2 * rng.standard_normal(12))
        values = 1.0 + between[:, None] * rng.standard_normal((12, 3))
        named += int(find_outliers(repeats(values, own=1e-5)).any())

    assert named <= 12


def test_three_runs_alone_name_none():
    """Nothing tells how far these runs may lie apart."""
    assert not find_outliers(repeats([[1.0, 1.001, 1.2]])).any()


def test_runs_in_place_are_rarely_named():
    """One in a hundred sets at most: 300 sets of 12 series x 3."""
    rng = np.random.default_rng(4)
    named = sum(bool(find_outliers(repeats(1e-3 * rng.standard_normal((12, 3)))).any()) for _ in range(300))

    assert named <= 8
