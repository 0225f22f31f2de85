"""One-mass identification of decays with linear damping and quadratic drag, integrated by DOP853."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from analysis.identification import Identification
from analysis.one_mass.identify import identify_one_mass, single_channel
from analysis.quantities import BudgetSource

PERIOD_S, DAMPING_PER_S, SWING_M, NOISE_M = 0.5, 0.1, 0.01, 1e-5
OMEGA = 2.0 * math.pi / PERIOD_S


def identified(drag_per_s: float, seed: int) -> Identification:
    """`drag_per_s` is the damping constant that quadratic drag adds at the first swing, 4/(3 pi) q w A."""
    drag_per_m = drag_per_s * 3.0 * math.pi / (4.0 * OMEGA * SWING_M)

    def motion(_: float, state: np.ndarray) -> list[float]:
        u, v = state
        return [v, -(OMEGA**2) * u - 2.0 * DAMPING_PER_S * v - drag_per_m * abs(v) * v]

    time_s = np.arange(0.0, 5.0, 0.005)
    solution = solve_ivp(motion, (0.0, 5.0), [SWING_M, 0.0], "DOP853", time_s, rtol=1e-10, atol=1e-14)
    noise = NOISE_M * np.random.default_rng(seed).standard_normal(len(time_s))
    return identify_one_mass(single_channel(time_s, solution.y[0] + noise))


@pytest.mark.parametrize("drag_per_s", [0.03, 0.1, 0.3])
def test_damping_that_rises_with_the_swing_stays_within_what_acted(drag_per_s):
    found = identified(drag_per_s, seed=1)
    damping, coulomb = found.results["damping_n_per_s"], found.results["coulomb_displacement_m"]

    assert DAMPING_PER_S <= damping.value <= DAMPING_PER_S + drag_per_s
    assert damping.interval_95[0] <= DAMPING_PER_S
    assert damping.interval_95[1] >= DAMPING_PER_S + 0.9 * drag_per_s
    assert coulomb.value == found.parameters["coulomb_displacement_m"] == 0.0
    assert coulomb.interval_95[0] == 0.0
    assert coulomb.interval_95[1] == pytest.approx(1.96 * coulomb.standard_uncertainty, rel=1e-3)
    assert coulomb.standard_uncertainty > 0.1 * NOISE_M
    assert found.labels["coulomb_significant"] is False
    assert found.model.adequate is False


def test_linear_damping_keeps_its_free_fit():
    found = identified(0.0, seed=1)
    damping = found.results["damping_n_per_s"]

    assert abs(damping.value - DAMPING_PER_S) < 3.0 * damping.standard_uncertainty
    assert damping.standard_uncertainty < 0.02 * DAMPING_PER_S
    assert found.model.adequate
    assert all(line.source is not BudgetSource.MODEL for line in found.budget)
