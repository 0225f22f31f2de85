"""One-mass identification of decays whose stiffness or damping depends on the swing, integrated by DOP853."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import curve_fit

from analysis.identification import Degree, Identification
from analysis.one_mass.identify import MeasuredQuantity, identify_one_mass, single_channel
from analysis.quantities import BudgetSource

PERIOD_S, DAMPING_PER_S, SWING_M, NOISE = 0.5, 0.1, 0.01, 1e-3


def identified(
    *,
    drag_per_m: float = 0.0,
    cubic_per_m2: float = 0.0,
    rise_per_m2: float = 0.0,
    coulomb_m: float = 0.0,
    reads: MeasuredQuantity = "displacement",
    seed: int = 1,
    damping_per_s: float = DAMPING_PER_S,
    noise: float = NOISE,
) -> Identification:
    omega = 2.0 * math.pi / PERIOD_S
    stiffness = omega**2 + damping_per_s**2

    def motion(_: float, state: np.ndarray) -> list[float]:
        u, v = state
        loss = 2.0 * damping_per_s * (1.0 + rise_per_m2 * u**2) * v + drag_per_m * abs(v) * v
        friction = coulomb_m * math.tanh(v / (1e-4 * omega * SWING_M)) if coulomb_m else 0.0
        return [v, -stiffness * (u + cubic_per_m2 * u**3 + friction) - loss]

    return fitted(motion, SWING_M, 5.0, omega, reads, seed, noise)


def fitted(
    motion, swing, duration_s, omega, reads: MeasuredQuantity, seed: int, noise: float = NOISE
) -> Identification:
    time_s = np.arange(0.0, duration_s, 0.005)
    solution = solve_ivp(motion, (0.0, duration_s), [swing, 0.0], "DOP853", time_s, rtol=1e-9, atol=1e-13)
    order = ("displacement", "velocity").index(reads)
    white = swing * omega**order * np.random.default_rng(seed).standard_normal(len(time_s))
    return identify_one_mass(single_channel(time_s, solution.y[order] + noise * white), quantity=reads)


def assert_holds(found: Identification, name: str, true: float) -> None:
    assert abs(found.results[name].value - true) < 4.0 * found.results[name].standard_uncertainty, name


@pytest.mark.parametrize("drag_per_m", [0.8, 2.5, 20.0])
@pytest.mark.parametrize("reads", ["displacement", "velocity"])
def test_quadratic_drag_is_found_beside_linear_damping(drag_per_m, reads):
    found = identified(drag_per_m=drag_per_m, reads=reads)

    assert found.model.degree is Degree.STAND
    assert found.model.adequate
    assert found.model.parts == ("drag",)
    assert "drag" in [warning.code for warning in found.warnings]
    assert found.labels["coulomb_significant"] is False
    for name, true in (
        ("drag_per_m", drag_per_m),
        ("damping_n_per_s", DAMPING_PER_S),
        ("period_s", PERIOD_S),
    ):
        assert_holds(found, name, true)


def test_drag_is_told_from_dry_friction():
    found = identified(drag_per_m=4.0, coulomb_m=1e-4)

    assert found.model.parts == ("drag",)
    assert found.labels["coulomb_significant"] is True
    for name, true in (("drag_per_m", 4.0), ("coulomb_displacement_m", 1e-4)):
        assert_holds(found, name, true)


@pytest.mark.parametrize("hardening", [0.05, -0.02])
def test_springs_that_harden_or_soften_give_the_period_of_small_swings(hardening):
    found = identified(cubic_per_m2=hardening / SWING_M**2)

    assert found.model.parts == ("spring-hardening",)
    assert "damping_mean_per_s" not in found.results
    for name, true in (("spring_hardening", hardening), ("period_s", PERIOD_S)):
        assert_holds(found, name, true)


def test_damping_that_rises_with_the_square_of_the_swing():
    found = identified(rise_per_m2=2.0 / SWING_M**2)

    assert found.model.degree is Degree.STAND
    assert_holds(found, "damping_rise", 0.5)
    assert_holds(found, "damping_n_per_s", DAMPING_PER_S)


@pytest.mark.parametrize("swing_rad", [0.5, 0.8, 1.5, 2.2])
def test_a_pendulum_is_identified_beyond_small_angles(swing_rad):
    omega = 2.0 * math.pi

    def motion(_: float, state: np.ndarray) -> list[float]:
        return [state[1], -(omega**2 + 0.05**2) * math.sin(state[0]) - 0.1 * state[1]]

    found = fitted(motion, swing_rad, 20.0, omega, "displacement", seed=2)

    assert found.model.degree is Degree.STAND
    assert found.model.parts == ("pendulum",)
    assert_holds(found, "period_s", 1.0)
    assert_holds(found, "damping_n_per_s", 0.05)
    assert found.results["spring_hardening"].value == pytest.approx(
        np.sinc(swing_rad / math.pi) - 1.0, rel=0.1
    )


def test_pure_drag_is_a_decay():
    found = identified(drag_per_m=4.0, damping_per_s=0.0)

    assert found.model.parts == ("drag",)
    assert_holds(found, "drag_per_m", 4.0)
    assert_holds(found, "damping_n_per_s", 0.0)


@pytest.mark.parametrize("loss", [{"drag_per_m": 8.0}, {"rise_per_m2": 2.0 / SWING_M**2}])
def test_mean_damping_is_that_of_the_nearest_exponential(loss):
    """n is that of small swings, far below the damping that a reader of such a record would give."""
    found = identified(**loss, noise=1e-4)
    time_s = np.arange(0.0, 5.0, 0.005)
    damping = found.results["damping_mean_per_s"]

    def decay(t, swing, n, omega, phase):
        return swing * np.exp(-n * t) * np.cos(omega * t + phase)

    start = (SWING_M, 2.0 * DAMPING_PER_S, 2.0 * math.pi / PERIOD_S, 0.0)
    nearest, _ = curve_fit(decay, time_s, found.curves(time_s).table_displacement_m, start)
    assert damping.value == pytest.approx(nearest[1], rel=0.02)
    assert damping.value > 1.2 * found.results["damping_n_per_s"].value
    assert damping.standard_uncertainty < found.results["damping_n_per_s"].standard_uncertainty


@pytest.mark.parametrize("seed", range(6))
def test_a_rise_of_damping_below_detection_leaves_n_between_its_ends(seed):
    """x_k is negative then, and n of the fit with x_k free up to 40 % too large."""
    rise = 0.5
    found = identified(rise_per_m2=rise / SWING_M**2, noise=0.02, seed=seed)
    damping = found.results["damping_n_per_s"]

    assert found.model.parts == ()
    assert found.results["coulomb_displacement_m"].value == 0.0
    assert DAMPING_PER_S < damping.value < DAMPING_PER_S * (1.0 + 0.25 * rise)
    assert damping.standard_uncertainty < 0.2 * DAMPING_PER_S


def test_n_is_that_of_viscous_damping_alone_where_friction_came_out_negative():
    time_s = np.arange(0.0, 6.0, 0.01)

    def decay(t, swing, n, omega, phase, zero):
        return zero + swing * np.exp(-n * t) * np.cos(omega * t + phase)

    truth = (1.0, 0.3, 12.0, 0.4, 0.1)
    at_bound = 0
    for seed in range(10):
        value = decay(time_s, *truth) + 0.01 * np.random.default_rng(seed).standard_normal(len(time_s))
        found = identify_one_mass(single_channel(time_s, value))
        if found.results["coulomb_displacement_m"].value == 0.0:
            at_bound += 1
            best, _ = curve_fit(decay, time_s, value, truth)
            assert found.results["damping_n_per_s"].value == pytest.approx(best[1], rel=1e-4)
    assert at_bound >= 2


def test_linear_damping_keeps_its_free_fit():
    found = identified()
    damping = found.results["damping_n_per_s"]

    assert abs(damping.value - DAMPING_PER_S) < 3.0 * damping.standard_uncertainty
    assert damping.standard_uncertainty < 0.02 * DAMPING_PER_S
    assert found.model.degree is Degree.IDEAL
    assert found.model.parts == ()
    assert all(line.source is not BudgetSource.MODEL for line in found.budget)
