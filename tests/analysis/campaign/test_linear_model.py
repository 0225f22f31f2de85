"""The linear model, its tests and its power, against scipy and published tables."""

import numpy as np
import pytest
from scipy import stats

from analysis.campaign.linear_model import (
    LinearFit,
    Observations,
    estimate_linear_form,
    f_test,
    fit_linear_model,
)


def measured(values, own=1e-9, shared=None, degrees=0):
    count = len(values)
    nothing = np.zeros((count, count))
    return Observations(
        np.asarray(values), np.full(count, own**2), nothing if shared is None else shared, degrees
    )


def test_slope_is_that_of_a_regression():
    rng = np.random.default_rng(1)
    x = np.arange(12.0)
    y = 0.3 * x + rng.standard_normal(12)
    found = fit_linear_model(np.column_stack([np.ones(12), x]), measured(y))
    tested = f_test(found, np.array([[0.0, 1.0]]), np.ones((1, 1)))
    expected = stats.linregress(x, y)

    assert found.coefficients == pytest.approx([expected.intercept, expected.slope], rel=1e-6)
    assert estimate_linear_form(found, np.array([0.0, 1.0]))[1] == pytest.approx(expected.stderr, rel=1e-6)
    assert tested.p_value == pytest.approx(expected.pvalue, rel=1e-5)
    assert tested.degrees_of_freedom == (1, 10)
    assert found.excess_deviation == pytest.approx(
        np.sqrt(np.sum((y - found.coefficients @ [np.ones(12), x]) ** 2) / 10)
    )


def test_classes_are_those_of_an_analysis_of_variance():
    rng = np.random.default_rng(2)
    groups = [rng.normal(mean, 1.0, 6) for mean in (0.0, 0.5, 2.0)]
    design = np.kron(np.eye(3), np.ones((6, 1)))
    found = fit_linear_model(design, measured(np.concatenate(groups)))
    tested = f_test(found, np.array([[-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]]), np.ones((1, 2)))
    expected = stats.f_oneway(*groups)

    assert tested.statistic == pytest.approx(expected.statistic, rel=1e-6)
    assert tested.p_value == pytest.approx(expected.pvalue, rel=1e-5)


def test_known_uncertainties_count_where_residuals_are_smaller():
    found = fit_linear_model(np.ones((4, 1)), measured([1.0, 1.0, 1.0, 1.0], own=0.2))

    assert found.excess_deviation == 0.0
    assert found.covariance[0, 0] == pytest.approx(0.01)


def test_shared_errors_do_not_average_out_but_cancel_in_differences():
    shared = np.full((4, 4), 0.3**2)
    design = np.column_stack([np.ones(4), [0.0, 0.0, 1.0, 1.0]])
    found = fit_linear_model(design, measured([1.0, 1.0, 2.0, 2.0], own=0.01, shared=shared))

    assert found.covariance[0, 0] == pytest.approx(0.3**2 + 0.01**2 / 2.0)
    assert found.covariance[1, 1] == pytest.approx(0.01**2)


def test_as_many_coefficients_as_values_leave_the_repeats_to_tell():
    assert fit_linear_model(np.eye(2), measured([1.0, 2.0], own=0.1)) is None
    assert fit_linear_model(np.eye(2), measured([1.0, 2.0], own=0.1, degrees=4)).degrees_of_freedom == 4


def test_power_of_an_analysis_of_variance_is_that_of_cohen():
    """Cohen (1988), table 8.4.4: 3 groups, effect f = 0.25, 80 % at 5 % need 52 a group (53 by G*Power)."""
    count = 53
    fitted = LinearFit(np.zeros(3), np.eye(3) / count, 3 * count - 3, 0.0)
    combinations = np.array([[-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]])
    extremes = 0.25 * np.sqrt(1.5)  # means at -e, 0 and e have a standard deviation of e sqrt(2/3)
    seen = f_test(fitted, combinations, np.array([[1.0, 2.0]])).detectable_size

    assert seen == pytest.approx(extremes, rel=0.01)


def test_power_of_a_slope_is_that_of_student():
    fitted = LinearFit(np.zeros(1), np.array([[0.04]]), 10, 0.0)
    seen = f_test(fitted, np.eye(1), np.ones((1, 1))).detectable_size
    critical = stats.t.ppf(0.975, 10)

    both = stats.nct.sf(critical, 10, seen / 0.2) + stats.nct.cdf(-critical, 10, seen / 0.2)
    assert both == pytest.approx(0.8, abs=1e-6)


def test_effect_of_nothing_is_certain_to_be_chance():
    """Rounding may leave the quadratic form below 0."""
    fitted = LinearFit(np.zeros(1), np.eye(1), 5, 0.0)

    assert f_test(fitted, np.eye(1), np.ones((1, 1))).p_value == 1.0
