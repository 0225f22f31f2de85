"""Which runs are named as too far from the others."""

import numpy as np

from analysis.campaign.scatter import RepeatedValues, find_outliers


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
