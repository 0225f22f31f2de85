"""The pieces of the joint fit: parabolas, objective, least squares, hygiene, covariance."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from synthetic import Truth, simulate_readings, simulate_record

from analysis.fitting.problem import (
    QuadraticModel,
    covariance,
    levenberg_marquardt_step,
    minimise,
    predict_gauge_1,
    predict_gauge_2,
    project_to_bounds,
)
from analysis.fitting.search import build_problem, estimate_from_plate_path, initial_guess
from analysis.laws.catalogue import LAWS, WIDEST_LAW, default_point
from analysis.laws.coulomb import COULOMB
from analysis.laws.parameters import Parameter
from analysis.preparation.channels import Channel, read_channels, remove_invalid_readings
from analysis.preparation.free_decay import prepare
from analysis.record import GaugeUncertainty, Record, StandMasses
from analysis.uncertainty import noise_variance_factor

MASSES = StandMasses(131.6, 22.4)


def true_point(truth, time_s=1.0):
    point = default_point()
    point[:10] = truth.parameters().vector(time_s + truth.release_phase / truth.rate_hz)
    point[Parameter.TABLE_OFFSET], point[Parameter.RELATIVE_OFFSET] = truth.offsets_m
    return point


def problem(truth, **known):
    made = simulate_record(truth, **known)
    return build_problem(made, prepare(made))


@pytest.mark.parametrize(
    ("truth", "within"),
    [
        (Truth(), 5e-4),
        (Truth(tilt_rad=2e-3, friction_static=0.15), 5e-4),
        (Truth(rate_hz=200.0, noise_m=1e-4), 8e-3),
    ],
)
def test_the_plates_parabolas_give_friction_and_tilt_without_a_simulation(truth, within):
    time, table, relative = simulate_readings(truth)
    slip = (time > 1.0) & (time < 4.0)

    path = estimate_from_plate_path(
        Channel(time[slip], table[slip]), Channel(time[slip], relative[slip]), 0.32, 9.81
    )

    assert path.friction == pytest.approx(0.1, abs=within)
    assert path.tilt_rad == pytest.approx(truth.tilt_rad, abs=within)
    errors = np.sqrt(np.diag(path.covariance))
    assert abs(path.friction - 0.1) < 5.0 * errors[0]
    assert abs(path.tilt_rad - truth.tilt_rad) < 5.0 * errors[1]


def test_no_slip_leaves_no_parabola():
    still = Channel(np.arange(2000) / 500.0, 1e-5 * np.random.default_rng(0).standard_normal(2000))

    path = estimate_from_plate_path(still, still, 0.3, 9.81)

    assert path is None


@pytest.mark.parametrize("model", LAWS, ids=lambda model: model.name)
def test_the_quadratic_is_that_of_the_objective(model):
    """Descent against central differences of chi-square, at a point off the minimum."""
    truth = Truth(friction_static=0.13, tilt_rad=1e-3, rate_hz=250.0, duration_s=3.0)
    made = problem(truth, masses=StandMasses(131.6, 22.4, 0.3, 0.02))
    point = project_to_bounds(true_point(truth), model)
    point[Parameter.FRICTION_DYNAMIC] *= 1.002
    free = made.free_parameters(model)

    quadratic = made.quadratic_model(point, model, free)

    for index, place in enumerate(free):
        step = 1e-6 * max(1e-3, abs(point[place]))
        costs = []
        for side in (1.0, -1.0):
            moved = point.copy()
            moved[place] += side * step
            costs.append(made.quadratic_model(project_to_bounds(moved, model), model, free).cost)
        slope = (costs[0] - costs[1]) / (2.0 * step)
        scale = np.sqrt(quadratic.normal[index, index] * quadratic.cost)
        assert -2.0 * quadratic.descent[index] == pytest.approx(slope, abs=2e-2 * scale)


def test_costs_of_many_points_are_those_of_each():
    truth = Truth(rate_hz=250.0, duration_s=3.0)
    made = problem(truth)
    points = np.stack([true_point(truth), true_point(truth)])
    points[1, Parameter.FRICTION_STATIC] = 0.12

    costs = made.chi_squares(points)

    for point, cost in zip(points, costs, strict=True):
        table, relative = made.residuals(point, WIDEST_LAW)
        expected = np.sum(table**2) / made.noise_m[0] ** 2 + np.sum(relative**2) / made.noise_m[1] ** 2
        assert cost == pytest.approx(expected, rel=1e-9)
    assert made.chi_squares(points, fit_zero=True)[0] <= costs[0]


def test_gauges_read_zeros_gains_and_lag():
    truth = Truth(noise_m=0.0, gain_errors=(0.01, -0.02), lag_s=2e-4, hold_s=1.0)
    time, table, relative = simulate_readings(truth)
    point = true_point(truth)
    point[Parameter.TABLE_GAIN], point[Parameter.RELATIVE_GAIN], point[Parameter.LAG] = 0.01, -0.02, 2e-4

    assert predict_gauge_1(point, time, COULOMB) == pytest.approx(table, abs=1e-12)
    assert predict_gauge_2(point, time, COULOMB, False) == pytest.approx(relative, abs=1e-12)


def test_the_first_guess_is_near_without_any_hint():
    made = simulate_record(Truth(tilt_rad=1e-3))
    decay = prepare(made)

    start, guided = initial_guess(build_problem(made, decay), decay)

    assert start[Parameter.FRICTION_DYNAMIC] == pytest.approx(0.1, rel=0.01)
    assert start[Parameter.TILT] == pytest.approx(1e-3, abs=2e-4)
    assert start[Parameter.RELEASE] == pytest.approx(1.0003, abs=3e-3)
    assert guided.prior_deviation[Parameter.STIFFNESS] < 1e-2 * start[Parameter.STIFFNESS]


def rosenbrock(point):
    residual = np.array([10.0 * (point[1] - point[0] ** 2), 1.0 - point[0]])
    columns = np.array([[20.0 * point[0], 1.0], [-10.0, 0.0]])
    return QuadraticModel(float(residual @ residual), columns @ residual, columns @ columns.T)


def test_least_squares_find_the_bottom_of_a_bent_valley():
    found = minimise(rosenbrock, np.copy, np.array([-1.2, 1.0]), np.array([0, 1]), 200)

    assert found.parameters == pytest.approx([1.0, 1.0], abs=1e-2)
    assert found.cost < 1e-4


def test_a_search_for_less_than_a_bound_ends_below_it():
    start, free = np.array([-1.2, 1.0]), np.array([0, 1])
    whole = minimise(rosenbrock, np.copy, start, free, 200)

    found = minimise(rosenbrock, np.copy, start, free, 200, enough=1.0)

    assert whole.cost < found.cost < 1.0
    assert found.steps < whole.steps
    assert not found.converged


def test_a_damped_step_solves_the_normal_equations():
    columns = np.random.default_rng(2).standard_normal((4, 9)) * np.array([[1e-3], [1.0], [50.0], [1e4]])
    normal, descent = columns @ columns.T, columns @ np.ones(9)

    step, promise = levenberg_marquardt_step(normal, descent, 0.3)

    damped = normal + 0.3 * np.diag(np.diag(normal))
    assert step == pytest.approx(np.linalg.solve(damped, descent), rel=1e-9)
    assert promise == pytest.approx(2.0 * descent @ step - step @ normal @ step)


def test_a_direction_without_effect_is_not_stepped_in():
    step, promise = levenberg_marquardt_step(np.diag([4.0, 0.0]), np.array([2.0, 0.0]), 0.0)

    assert step == pytest.approx([0.5, 0.0])
    assert promise == pytest.approx(1.0)


@pytest.mark.parametrize("model", [COULOMB, WIDEST_LAW], ids=lambda model: model.name)
def test_the_minimum_is_that_of_scipy(model):
    truth = Truth(friction_static=0.13, tilt_rad=1e-3, rate_hz=250.0, duration_s=3.0)
    if model is COULOMB:
        truth = truth.replace(friction_static=None, tilt_rad=0.0)
    made = problem(truth)
    start = project_to_bounds(true_point(truth), model)
    free = made.free_parameters(model)

    found = made.minimise(start, model)

    scale = np.sqrt(np.diag(covariance(found.quadratic.normal)[0]))

    def residuals(shift):
        point = start.copy()
        point[free] += shift * scale
        residuals = made.residuals(project_to_bounds(point, model), model)
        return np.concatenate([r / noise for r, noise in zip(residuals, made.noise_m, strict=True)])

    theirs = least_squares(residuals, np.zeros(len(free)), diff_step=1e-3)
    shift = (found.parameters[free] - start[free]) / scale
    assert np.abs(shift).max() > 0.5
    assert shift == pytest.approx(theirs.x, abs=0.05)


def test_no_fit_leaves_what_stands_can_be():
    """Farther out, a motion may have any number of phases, and an evaluation take for ever."""
    made, rng = problem(Truth(rate_hz=250.0, duration_s=3.0)), np.random.default_rng(0)
    for _ in range(40):
        start = true_point(Truth())
        start[:7] *= 10.0 ** rng.uniform(-9.0, 9.0, 7)
        start[:7] *= rng.choice([-1.0, 1.0], 7)

        found = made.minimise(start, WIDEST_LAW, 15).parameters

        joint_kg = found[Parameter.TABLE_MASS] + found[Parameter.PLATE_MASS]
        assert 0.01 <= 2.0 * np.pi * np.sqrt(joint_kg / found[Parameter.STIFFNESS]) * (1.0 + 1e-12) <= 30.1
        assert 0.0 < found[Parameter.FRICTION_DYNAMIC] <= found[Parameter.FRICTION_STATIC] <= 20.0
        assert abs(found[Parameter.PULLBACK]) <= 0.5
        assert abs(found[Parameter.TILT]) <= 1.0
        assert -4.0 < found[Parameter.RELEASE] <= made.table.time_s[-1]


@pytest.mark.parametrize("absolute", [False, True])
@pytest.mark.parametrize("same_times", [False, True])
def test_moments_of_phases_are_sums_over_readings(same_times, absolute):
    truth = Truth(friction_static=0.13, tilt_rad=1e-3, rate_hz=400.0, duration_s=3.0)
    masses = StandMasses(131.6, 22.4, 0.3, 0.02)
    made = problem(truth, masses=masses, relative_gauge=GaugeUncertainty(0.003, delay_s_uncertainty=2e-5))
    relative = made.relative
    if not same_times:  # in one piece, as those of records are: another layout would be compiled apart
        relative = Channel(relative.time_s[::3].copy(), relative.value_m[::3].copy())
    made = replace(made, relative=relative, gauge_2_absolute=absolute)
    point = true_point(truth)
    point[[Parameter.TABLE_GAIN, Parameter.RELATIVE_GAIN, Parameter.LAG]] = 2e-3, -1e-3, 3e-4
    free = made.free_parameters(WIDEST_LAW)

    systems = made.normal_equations(point, WIDEST_LAW, free)

    residuals = made.residuals(point, WIDEST_LAW)
    for gauge, (residual, noise) in enumerate(zip(residuals, made.noise_m, strict=True)):
        rows = [-_slope(made, point, place, gauge) / noise for place in free] + [residual / noise]
        expected = np.array(rows) @ np.array(rows).T
        size = np.sqrt(np.diag(expected))
        np.testing.assert_allclose(systems[gauge], expected, rtol=0, atol=1e-5 * np.outer(size, size).max())
        scaled = np.outer(np.maximum(size, 1e-30), np.maximum(size, 1e-30))
        assert np.abs((systems[gauge] - expected) / scaled).max() < 2e-5


def _slope(made, point, place, gauge):
    """Derivative of a gauge's residual by central differences."""
    step, residuals = 1e-6 * max(1e-3, abs(point[place])), []
    for side in (1.0, -1.0):
        moved = point.copy()
        moved[place] += side * step
        residuals.append(made.residuals(moved, WIDEST_LAW)[gauge])
    return (residuals[0] - residuals[1]) / (2.0 * step)


def test_covariance_leaves_out_what_is_not_determined():
    columns = np.array([[1.0, 2.0, 3.0, 4.0], [1.0, 2.0, 3.0, 4.0], [1.0, -1.0, 1.0, -1.0]])

    inverse, loose = covariance(columns @ columns.T)

    assert loose.tolist() == [True, True, False]
    summed = np.array([1.0, 1.0, 0.0])
    assert summed @ inverse @ summed == pytest.approx(np.linalg.inv(columns[1:] @ columns[1:].T)[0, 0])


def test_correlated_residuals_count_for_less():
    rng = np.random.default_rng(3)
    time = np.arange(8000) / 1000.0
    white = rng.standard_normal(8000)
    slow = np.convolve(rng.standard_normal(8009), np.ones(10), "valid") / np.sqrt(10.0)

    assert noise_variance_factor(white, time, 0.1) == pytest.approx(1.0, rel=0.05)
    assert noise_variance_factor(slow, time, 0.1) == pytest.approx(10.0, rel=0.4)


def test_spikes_frozen_and_clipped_readings_are_left_out_and_said():
    time, table, _ = simulate_readings(Truth(duration_s=6.0))
    bad = table.copy()
    bad[[300, 2000, 2001, 5000]] += [2e-3, -1e-3, -1e-3, 5e-4]
    bad[3000:3040] = bad[3000]
    bad = np.minimum(bad, 0.8 * table[1200:].max())
    bad[:1100] = table[:1100]
    cautions = []

    kept = remove_invalid_readings(Channel(time, bad), "gauge 1", cautions)

    assert {caution.code for caution in cautions} >= {"spikes", "frozen"}
    assert not np.isin(time[[2000, 5000]], kept.time_s).any()
    assert not np.isin(time[3001:3039], kept.time_s).any()
    rest = np.isin(time, kept.time_s)
    assert rest.mean() > 0.9


@pytest.mark.parametrize("step_m", [0.0, 2e-5])
@pytest.mark.parametrize("noise_m", [0.0, 2e-5])
def test_good_readings_are_all_kept(step_m, noise_m):
    time, table, relative = simulate_readings(Truth(step_m=step_m, noise_m=noise_m))
    cautions = []

    for value in (table, relative):
        assert len(remove_invalid_readings(Channel(time, value), "gauge", cautions)) == len(time)
    assert cautions == []


def test_delay_and_clock_are_taken_out_once():
    time, table, relative = simulate_readings(Truth())
    made = Record(
        time, table, relative, MASSES, clock_scale=1.001, relative_gauge=GaugeUncertainty(delay_s=0.002)
    )

    channels, _ = read_channels(made)

    assert channels.table.time_s[-1] == pytest.approx(time[-1] * 1.001)
    assert channels.relative.time_s[0] == pytest.approx(-0.002)
    assert channels.to_record_time(float(channels.table.time_s[500])) == pytest.approx(time[500])
