"""Stribeck friction against DOP853, and against the exact motion where both are the same."""

import math

import numpy as np
import pytest
from random_stands import KINDS, ordinary

from analysis.laws.parameters import MOTION_PARAMETER_COUNT
from analysis.laws.stribeck import STRIBECK_TILT
from analysis.motion.events import FRICTION_STATIC, integrate_events
from analysis.motion.two_mass import MotionError, TwoMassParameters
from benchmarks.motion_gradient import sample_with_gradient
from benchmarks.reference_solvers import integrate_with_events

KERNELS = STRIBECK_TILT.solver.kernels
COULOMB = TwoMassParameters.from_free_decay(
    period_s=0.32,
    damping_n1_per_s=0.12,
    table_mass_kg=131.6,
    plate_mass_kg=22.4,
    friction_dynamic=0.1,
    pullback_m=0.012,
)
STRIBECK_STAND = TwoMassParameters(**{**vars(COULOMB), "friction_static": 0.13, "tilt_rad": -0.002})


def simulate(parameters, velocity, duration_s=10.0):
    return STRIBECK_TILT.solver.simulate(parameters, [velocity], duration_s)


def assert_agrees_with_dop853(parameters, velocity, duration_s, max_step):
    other = integrate_with_events(
        parameters, duration_s, max_step=max_step, stribeck_velocity_m_per_s=velocity
    )
    motion = simulate(parameters, velocity, duration_s)
    assert motion.phase_signs.tolist() == other.signs
    np.testing.assert_allclose(motion.phase_starts_s, other.starts, rtol=0, atol=1e-8)
    times = np.sort(np.random.default_rng(1).uniform(0.0, duration_s, 200))
    samples, (table, table_rate, plate, plate_rate) = motion.sample(times), other.sample(times)
    np.testing.assert_allclose(samples.table_displacement_m, table, rtol=0, atol=1e-11)
    np.testing.assert_allclose(samples.relative_displacement_m, plate - table, rtol=0, atol=1e-11)
    np.testing.assert_allclose(samples.table_velocity_m_per_s, table_rate, rtol=0, atol=1e-8)
    np.testing.assert_allclose(samples.plate_velocity_m_per_s, plate_rate, rtol=0, atol=1e-8)


@pytest.mark.parametrize("velocity", [0.001, 0.005, 0.05, 0.5])
def test_the_stand_agrees_with_dop853(velocity):
    assert_agrees_with_dop853(STRIBECK_STAND, velocity, duration_s=2.5, max_step=1e-3)


@pytest.mark.parametrize("seed", range(5))
def test_random_stands_agree_with_dop853(seed):
    rng = np.random.default_rng(seed)
    parameters, velocity = ordinary(rng), 10 ** rng.uniform(-3.0, -0.5)
    table_period = 2 * math.pi * math.sqrt(parameters.table_mass_kg / parameters.stiffness_n_per_m)
    assert_agrees_with_dop853(parameters, velocity, 5 * table_period, table_period / 300)


def test_with_equal_frictions_the_motion_is_the_exact_one():
    times = np.linspace(-0.1, 10.0, 5051)
    exact = COULOMB.simulate()
    motion = simulate(COULOMB, 0.005)
    assert motion.phase_signs.tolist() == exact.phase_signs.tolist()
    np.testing.assert_allclose(motion.phase_starts_s, exact.phase_starts_s, rtol=0, atol=1e-9)
    assert motion.residual_displacement_m == pytest.approx(exact.residual_displacement_m, abs=1e-11)
    for name, column in motion.sample(times).columns().items():
        np.testing.assert_allclose(column, exact.sample(times).columns()[name], rtol=0, atol=1e-8)
    for name in (
        "table_velocity_max_m_per_s",
        "plate_velocity_max_m_per_s",
        "table_acceleration_max_m_per_s2",
        "plate_acceleration_max_m_per_s2",
    ):
        assert getattr(motion, name) == pytest.approx(getattr(exact, name), rel=1e-4)


def test_friction_that_falls_at_once_is_static_friction():
    """With v_s -> 0 the law tends to f_s at standstill and f_d in motion."""
    static = TwoMassParameters(**{**vars(COULOMB), "friction_static": 0.13})
    velocities = (1e-3, 1e-4, 1e-5, 1e-6)
    ends = [simulate(static, velocity).residual_displacement_m for velocity in velocities]
    errors = np.abs(np.array(ends) - static.simulate().residual_displacement_m)
    assert errors[-1] < 1e-6
    assert (np.diff(errors) < 0).all()


def test_random_stands_end_and_friction_opposes_their_slip():
    rng = np.random.default_rng(7)
    for number in range(600):
        parameters, velocity = KINDS[number % len(KINDS)](rng), 10 ** rng.uniform(-5.0, 0.5)
        motion = simulate(parameters, velocity, 2.0)
        assert (np.diff(motion.phase_starts_s) > 0).all()
        samples = motion.sample(np.sort(rng.uniform(0.0, 2.0, 100)))
        slip = samples.plate_velocity_m_per_s - samples.table_velocity_m_per_s
        scale = motion.table_velocity_max_m_per_s + motion.plate_velocity_max_m_per_s
        assert (samples.phase * slip >= -1e-8 * scale).all()


def test_differences_are_the_exact_derivatives_where_both_exist():
    times = np.linspace(-0.1, 4.0, 411)
    exact_places = np.eye(MOTION_PARAMETER_COUNT)
    vector = COULOMB.vector(0.01)
    _, exact = sample_with_gradient(vector, integrate_events(vector, 4.0), times, exact_places)
    places = np.eye(MOTION_PARAMETER_COUNT + 1)[:MOTION_PARAMETER_COUNT].copy()
    # f_s is held to f_d, for the Stribeck surplus would otherwise change with f_d.
    places[0, FRICTION_STATIC] = 1.0
    motion, gradient = KERNELS.sample_with_gradient(np.append(vector, 0.005), times, places)
    for place in range(MOTION_PARAMETER_COUNT):
        if place != FRICTION_STATIC:
            size = np.abs(exact[place]).max()
            np.testing.assert_allclose(gradient[place], exact[place], rtol=0, atol=1e-4 * size)
    np.testing.assert_allclose(motion[0, :10], COULOMB.pullback_m, rtol=0, atol=0)


def test_differences_along_the_stribeck_velocity():
    times, step = np.linspace(0.0, 2.0, 201), 2e-6
    direction = np.zeros((1, MOTION_PARAMETER_COUNT + 1))
    direction[0, MOTION_PARAMETER_COUNT] = 1.0
    vector = np.append(STRIBECK_STAND.vector(), 0.005)
    _, gradient = KERNELS.sample_with_gradient(vector, times, direction)
    sides = [simulate(STRIBECK_STAND, 0.005 + side * step, 2.0) for side in (1.0, -1.0)]
    up, down = (side.sample_displacements(times)[1] for side in sides)
    expected = (up - down) / (2.0 * step)
    np.testing.assert_allclose(gradient[0, 1], expected, rtol=0, atol=1e-4 * np.abs(expected).max())


def test_an_impossible_duration_is_named():
    with pytest.raises(MotionError, match="duration_s is -1"):
        simulate(COULOMB, 0.005, -1.0)
