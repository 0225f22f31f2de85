"""Gauges behind filters in the motion of a real stand, against filters of amplifiers."""

import numpy as np
import pytest
from scipy import signal

from analysis.laws.coulomb import COULOMB
from analysis.laws.stand_parts import STAND_PLACES, StandSolver
from analysis.motion.stand_motion import STAND_PARAMETER_COUNT, gauge_readings
from analysis.motion.two_mass import TwoMassParameters
from analysis.record import GaugeFilter

PARAMETERS = TwoMassParameters.from_free_decay(
    period_s=0.32, damping_n1_per_s=0.12, table_mass_kg=131.6, plate_mass_kg=22.4, friction_dynamic=0.1,
    pullback_m=0.012,
)  # fmt: skip
STEP_S = 1e-4
GRID_S = np.arange(-2000, 30_000) * STEP_S
SHOWN = slice(1500, 29_000, 10)


def readings(**values):
    stand = np.zeros(STAND_PARAMETER_COUNT)
    for name, value in values.items():
        stand[STAND_PLACES[name]] = value
    vector = np.concatenate((PARAMETERS.vector(), stand))
    kernels = StandSolver(COULOMB).kernels
    return gauge_readings(kernels, vector, kernels.integrate(vector, 3.2), GRID_S[SHOWN])


def behind(rows, system):
    """The rows behind an analogue filter."""
    numerator, denominator, _ = signal.cont2discrete(system, STEP_S, "foh")
    steady = signal.lfilter_zi(numerator.ravel(), denominator)
    filtered = [signal.lfilter(numerator.ravel(), denominator, row, zi=steady * row[0])[0] for row in rows]
    return np.array(filtered)


@pytest.mark.parametrize("kind", ["rc", "bessel"])
def test_a_critically_damped_filter_describes_those_of_amplifiers(kind):
    stated = GaugeFilter(kind, 1 if kind == "rc" else 4, 20.0)
    w = 2.0 * np.pi * stated.corner_hz
    system = (np.array([w]), np.array([1.0, w]))
    second_moment_s2 = 0.5 * stated.delay_s**2
    if kind == "bessel":
        system = signal.bessel(4, w, analog=True, norm="mag")
        second_moment_s2 = 0.5 * np.sum(1.0 / np.roots(system[1]) ** 2).real
    moved = PARAMETERS.simulate(3.2).sample_displacements(GRID_S)
    late = round(stated.delay_s / STEP_S)
    wanted = behind(moved, system)[:, SHOWN.start + late : SHOWN.stop + late : SHOWN.step]
    found = readings(filter_s2=second_moment_s2)
    after = GRID_S[SHOWN] > 0.1  # the jolt of the release itself is smeared differently
    unfiltered = np.array(moved)[:, SHOWN]
    left, effect = (np.sqrt(np.mean((row - wanted)[:, after] ** 2)) for row in (found, unfiltered))
    assert effect > 2e-5
    assert left < 0.15 * effect


def test_a_damping_ratio_makes_a_butterworth_filter():
    constant_s = 0.016
    system = (np.array([1.0]), np.array([constant_s**2, np.sqrt(2.0) * constant_s, 1.0]))
    late = round(np.sqrt(2.0) * constant_s / STEP_S)
    moved = PARAMETERS.simulate(3.2).sample_displacements(GRID_S)
    wanted = behind(moved, system)[:, SHOWN.start + late : SHOWN.stop + late : SHOWN.step]
    found = readings(filter_s2=constant_s**2, filter_damping=np.sqrt(0.5) - 1.0)
    np.testing.assert_allclose(found, wanted, atol=5e-5)
    plate_alone = readings(gauge_2_filter_s2=constant_s**2, filter_damping=np.sqrt(0.5) - 1.0)
    np.testing.assert_allclose(plate_alone[1], wanted[1], atol=5e-5)
    np.testing.assert_allclose(plate_alone[0], np.array(moved)[0, SHOWN], atol=5e-5)
