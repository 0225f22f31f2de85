"""Exact derivatives against differences of the motion itself, which other tests hold against DOP853."""

import numpy as np
import pytest
from random_stands import KINDS, heavy, ordinary, slippery

from analysis.laws.parameters import MOTION_PARAMETER_COUNT
from analysis.motion.events import (
    FRICTION_DYNAMIC,
    FRICTION_STATIC,
    PULLBACK,
    RELEASE,
    SIGN,
    TILT,
    integrate_events,
)
from analysis.motion.sampling import sample
from analysis.motion.two_mass import TwoMassParameters
from benchmarks.motion_gradient import sample_with_gradient

STAND = TwoMassParameters(
    table_mass_kg=131.6,
    plate_mass_kg=22.4,
    stiffness_n_per_m=59374.05657530318,
    damping_coefficient_kg_per_s=36.96,
    friction_dynamic=0.1,
    friction_static=0.15,
    tilt_rad=-0.002,
    pullback_m=0.012,
)
ABSOLUTE_STEPS = {FRICTION_DYNAMIC: 1e-6, FRICTION_STATIC: 1e-6, PULLBACK: 1e-6, TILT: 1e-6, RELEASE: 1e-6}
PLACES = np.eye(MOTION_PARAMETER_COUNT)


def motion_at(parameters, times):
    phases = integrate_events(parameters, times[-1] - parameters[RELEASE])
    return sample(parameters, phases, times, 2), phases[:, SIGN]


def gradient_at(parameters, times, directions):
    phases = integrate_events(parameters, times[-1] - parameters[RELEASE])
    return sample_with_gradient(parameters, phases, times, directions)


def differences(parameters, times, direction, step):
    """Central differences with one Richardson step, how far that moved them, and whether phases stayed."""
    signs = [motion_at(parameters, times)[1]]
    slopes = []
    for size in (step, 0.5 * step):
        (up, up_signs), (down, down_signs) = (
            motion_at(parameters + side * size * direction, times) for side in (1.0, -1.0)
        )
        signs += [up_signs, down_signs]
        slopes.append((up - down) / (2.0 * size))
    same = all(np.array_equal(signs[0], other) for other in signs)
    return (4.0 * slopes[1] - slopes[0]) / 3.0, np.abs(slopes[1] - slopes[0]).max(), same


def step_of(place, parameters):
    return ABSOLUTE_STEPS.get(place) or 1e-5 * parameters[place]


@pytest.mark.parametrize(
    "times", [np.linspace(-0.1, 6.0, 3001), np.sort(np.random.default_rng(0).uniform(-0.1, 6.0, 500))]
)
@pytest.mark.parametrize("place", range(MOTION_PARAMETER_COUNT))
def test_derivatives_are_those_of_the_motion(place, times):
    parameters = STAND.vector(release_s=0.003)
    motion, gradient = gradient_at(parameters, times, PLACES)
    numeric, _, same = differences(parameters, times, PLACES[place], step_of(place, parameters))
    assert same
    assert (motion == motion_at(parameters, times)[0]).all()
    np.testing.assert_allclose(gradient[place], numeric, rtol=0, atol=1e-7 * np.abs(numeric).max())


def test_tied_frictions_are_a_direction():
    stand = TwoMassParameters(**{**vars(STAND), "friction_static": None})
    parameters, times = stand.vector(), np.linspace(0.0, 6.0, 3001)
    tied = PLACES[FRICTION_DYNAMIC] + PLACES[FRICTION_STATIC]
    numeric, _, same = differences(parameters, times, tied, 1e-6)
    assert same
    gradient = gradient_at(parameters, times, tied[None, :])[1][0]
    np.testing.assert_allclose(gradient, numeric, rtol=0, atol=1e-7 * np.abs(numeric).max())


def test_directions_add_up():
    parameters, times = STAND.vector(), np.linspace(0.0, 4.0, 801)
    weights = np.random.default_rng(4).normal(size=(3, MOTION_PARAMETER_COUNT))
    single = gradient_at(parameters, times, PLACES)[1]
    together = gradient_at(parameters, times, weights)[1]
    np.testing.assert_allclose(together, np.tensordot(weights, single, 1), rtol=0, atol=1e-12)


def test_random_stands_have_the_derivatives_of_their_motion():
    rng, compared = np.random.default_rng(5), 0
    for number in range(600):
        stand = (ordinary, slippery, heavy)[number % 3](rng)
        parameters, place = stand.vector(0.01), number % MOTION_PARAMETER_COUNT
        table_period = 2 * np.pi * np.sqrt(stand.table_mass_kg / stand.stiffness_n_per_m)
        times = np.sort(rng.uniform(-0.1, 15.0, 100)) * table_period
        step = step_of(place, parameters)
        if place == FRICTION_STATIC and parameters[place] - step < parameters[FRICTION_DYNAMIC]:
            continue  # f_s below f_d is another motion
        motion, gradient = gradient_at(parameters, times, PLACES)
        numeric, spread, same = differences(parameters, times, PLACES[place], step)
        if same:  # else a slip comes or goes, and the differences step over a kink
            rounding = 1e-14 * np.abs(motion).max() / step
            tolerance = 1e-6 * np.abs(gradient[place]).max() + spread + 10.0 * rounding
            np.testing.assert_allclose(gradient[place], numeric, rtol=0, atol=tolerance)
            compared += 1
    assert compared > 400


def test_derivatives_are_always_finite():
    rng = np.random.default_rng(6)
    for number in range(3000):
        parameters = KINDS[number % len(KINDS)](rng).vector(0.1)
        _, gradient = gradient_at(parameters, np.linspace(0.0, 5.0, 60), PLACES)
        assert np.isfinite(gradient).all()


def test_before_release_only_the_pullback_counts():
    motion, gradient = gradient_at(STAND.vector(5.0), np.linspace(0.0, 4.0, 5), PLACES)
    assert (motion == [[STAND.pullback_m] * 5, [0.0] * 5]).all()
    expected = np.zeros((MOTION_PARAMETER_COUNT, 2, 5))
    expected[PULLBACK, 0] = 1.0
    assert (gradient == expected).all()
