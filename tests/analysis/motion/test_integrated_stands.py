"""Motion on stands that are not ideal, against the closed form and against an independent integrator."""

import math

import numpy as np
import pytest

from analysis.laws.catalogue import PARAMETER_COUNT
from analysis.laws.coulomb import COULOMB
from analysis.laws.parameters import MOTION_PARAMETER_COUNT
from analysis.laws.stand_parts import (
    STAND_PLACES,
    StandSolver,
    compose,
    effects_by_name,
    stand_displacements,
)
from analysis.motion.stand_motion import INTEGRATION_ERROR_M, STAND_PARAMETER_COUNT
from analysis.motion.two_mass import TwoMassParameters
from benchmarks.real_stand import REL, RealStand, U

TIMES_S = np.linspace(-0.1, 5.0, 2041)
STANDS = {
    "release ramp": ({"release_ramp_s": 0.011}, {"release_ramp_s": 0.011}),
    "push": ({"release_velocity_m_per_s": 0.01}, {"release_velocity_m_per_s": 0.01}),
    "hardening": ({"spring_hardening": 0.02}, {"spring_hardening": 0.02}),
    "asymmetry of the springs": ({"spring_asymmetry": 0.01}, {"spring_asymmetry": 0.01}),
    "drag": ({"drag_per_m": 0.3}, {"drag_per_m": 0.3}),
    "film": ({"film_s_per_m": 1.0}, {"film_s_per_m": 1.0}),
    "gradient": ({"friction_gradient_per_m": 3.0}, {"friction_gradient_per_m": 3.0}),
    "wear": ({"friction_wear_per_m": -0.5}, {"friction_wear_per_m": -0.5}),
    "asymmetry of friction": ({"friction_asymmetry": 0.03}, {"friction_asymmetry": 0.03}),
    "arc": ({"arc_per_m": 2.0}, {"arc_per_m": -2.0}),
}


def parameters(static: float = 0.13) -> TwoMassParameters:
    return TwoMassParameters.from_free_decay(
        period_s=0.32, damping_n1_per_s=0.12, table_mass_kg=131.6, plate_mass_kg=22.4, friction_dynamic=0.1,
        friction_static=static, pullback_m=0.012,
    )  # fmt: skip


def test_without_effects_it_is_the_motion_in_closed_form():
    exact = parameters().simulate(5.1).sample_displacements(TIMES_S)
    for one, other in zip(stand_displacements(parameters(), {}, 5.1)(TIMES_S), exact, strict=True):
        np.testing.assert_allclose(one, other, atol=INTEGRATION_ERROR_M)


@pytest.mark.parametrize(("effects", "real"), STANDS.values(), ids=STANDS)
def test_it_is_the_motion_of_an_independent_integrator(effects, real):
    moving = TIMES_S >= 0.0
    state = RealStand(friction_static_ratio=1.3, **real).simulate(5.1).sample(TIMES_S[moving])
    table, relative = stand_displacements(parameters(), effects, 5.1)(TIMES_S)
    np.testing.assert_allclose(table[moving], state[U], atol=INTEGRATION_ERROR_M)
    np.testing.assert_allclose(relative[moving], state[REL], atol=INTEGRATION_ERROR_M)


def test_dry_friction_of_the_stand_is_that_of_an_independent_integrator():
    moving = TIMES_S >= 0.0
    state = RealStand(friction_static_ratio=1.3, stand_friction_m=3e-5).simulate(5.1).sample(TIMES_S[moving])
    table, relative = stand_displacements(parameters(), {"stand_friction_m": 3e-5}, 5.1)(TIMES_S)
    np.testing.assert_allclose(table[moving], state[U], atol=INTEGRATION_ERROR_M)
    np.testing.assert_allclose(relative[moving], state[REL], atol=INTEGRATION_ERROR_M)


def test_a_soft_base_moves_as_that_of_an_independent_integrator():
    stand = RealStand(
        friction_static_ratio=1.3, base_compliance=0.02, base_mass_kg=500.0, base_damping_ratio=0.05
    )
    stiffness_n_per_m = parameters().stiffness_n_per_m
    frequency_hz = math.sqrt(stiffness_n_per_m / 0.02 / 500.0) / (2.0 * math.pi)
    effects = {"base_compliance": 0.02, "base_frequency_hz": frequency_hz, "base_damping": 0.05}
    moving = TIMES_S >= 0.0
    state = stand.simulate(5.1).sample(TIMES_S[moving])
    table, relative = stand_displacements(parameters(), effects, 5.1)(TIMES_S)
    np.testing.assert_allclose(table[moving], state[U], atol=2.0 * INTEGRATION_ERROR_M)
    np.testing.assert_allclose(relative[moving], state[REL], atol=2.0 * INTEGRATION_ERROR_M)


def test_mean_friction_on_a_moving_base_is_that_over_the_slid_path():
    stand = RealStand(film_s_per_m=1.5, base_compliance=0.03, base_mass_kg=500.0, base_damping_ratio=0.05)
    frequency_hz = math.sqrt(parameters(0.1).stiffness_n_per_m / 0.03 / 500.0) / (2.0 * math.pi)
    effects = effects_by_name(("film", "base"))
    values = {
        "film_s_per_m": 1.5,
        "base_compliance": 0.03,
        "base_frequency_hz": frequency_hz,
        "base_damping": 0.05,
    }
    point = np.zeros(PARAMETER_COUNT + STAND_PARAMETER_COUNT)
    point[:MOTION_PARAMETER_COUNT] = parameters(0.1).vector()
    for name, value in values.items():
        point[PARAMETER_COUNT + STAND_PLACES[name]] = value
    found = compose(COULOMB, effects).mean_friction(point, 5.1)
    assert found == pytest.approx(stand.simulate(5.1).friction_dynamic, rel=2e-4)


def test_a_table_that_creeps_in_its_hold_leaves_it_with_that_velocity():
    state = (
        RealStand(friction_static_ratio=1.3, release_velocity_m_per_s=1e-3).simulate(5.1).sample(TIMES_S[41:])
    )
    table, _ = stand_displacements(parameters(), {"hold_creep_m_per_s": 1e-3}, 5.1)(TIMES_S)
    held = TIMES_S < 0.0
    np.testing.assert_allclose(table[held], 0.012 + 1e-3 * TIMES_S[held], atol=1e-12)
    np.testing.assert_allclose(table[41:], state[U], atol=INTEGRATION_ERROR_M)


@pytest.mark.parametrize("presliding_m", [1e-6, 5e-6])
def test_presliding_is_that_of_an_independent_integrator(presliding_m):
    moving = TIMES_S >= 0.0
    state = RealStand(presliding_m=presliding_m).simulate(5.1).sample(TIMES_S[moving])
    table, relative = stand_displacements(parameters(0.1), {"presliding_m": presliding_m}, 5.1)(TIMES_S)
    ideal, _ = stand_displacements(parameters(0.1), {}, 5.1)(TIMES_S)
    # Contacts slide here at 0.9999 of their friction: what is left of the deflection is a part of it.
    np.testing.assert_allclose(table[moving], state[U], atol=INTEGRATION_ERROR_M)
    np.testing.assert_allclose(relative[moving], state[REL], atol=INTEGRATION_ERROR_M + 0.5 * presliding_m)
    assert np.abs(ideal[moving] - state[U]).max() > 20.0 * INTEGRATION_ERROR_M


def test_a_contact_that_gives_way_breaks_away_at_the_friction_of_the_slip_that_begins():
    """With that at the start of the track each slip ended at once, ten thousand times a second."""
    values = {"presliding_m": 1e-6, "friction_gradient_per_m": 3.0}
    vector = np.concatenate((parameters(0.1).vector(), np.zeros(STAND_PARAMETER_COUNT)))
    for name, value in values.items():
        vector[MOTION_PARAMETER_COUNT + STAND_PLACES[name]] = value
    assert len(StandSolver(COULOMB).phases(vector, 5.1)) < 200
    moving = TIMES_S >= 0.0
    motion = RealStand(**values).simulate(5.1)
    state = motion.sample(TIMES_S[moving])
    table, relative = stand_displacements(parameters(0.1), values, 5.1)(TIMES_S)
    np.testing.assert_allclose(table[moving], state[U], atol=INTEGRATION_ERROR_M)
    # Each slip ends within a deflection; where friction varies, these add up.
    np.testing.assert_allclose(relative[moving], state[REL], atol=1e-6 * len(motion.slips_m))


def test_creep_of_a_gauge_begins_at_the_release_and_leaves_the_motion():
    crept = {"gauge_1_creep_m": 1e-4, "gauge_1_creep_time_s": 5.0}
    ideal = stand_displacements(parameters(), {}, 5.1)(TIMES_S)
    table, relative = stand_displacements(parameters(), crept, 5.1)(TIMES_S)
    np.testing.assert_allclose(table - ideal[0], -1e-4 * np.expm1(-TIMES_S / 5.0), atol=1e-12)
    np.testing.assert_array_equal(relative, ideal[1])
