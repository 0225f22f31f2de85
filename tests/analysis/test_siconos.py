"""The exact motion, and an identification, against trajectories of Siconos: see data/README.md."""

import numpy as np
import pytest

from analysis.identify import identify
from analysis.record import Record, StandMasses
from analysis.synthetic import TABLE_MASS_KG
from benchmarks.siconos_check import INTERVAL_S, TILTS_RAD, exact_motion, row_of, stored

HOLD_S, NOISE_M, OFFSETS_M = 1.0, 2e-5, (3e-4, 6e-3)


@pytest.mark.parametrize(("series", "tilt"), TILTS_RAD.items())
def test_siconos_converges_to_the_exact_motion(series, tilt):
    time_s, runs = stored(series)
    exact = np.array(exact_motion(series, tilt, time_s))

    errors = np.abs(runs - exact).max(axis=2)
    changes = np.abs(runs[1:] - runs[:-1]).max(axis=2)

    assert (errors[1:] < 0.5 * errors[:-1]).all()  # while the step falls to a fifth and then to a quarter
    assert (errors[1:] < changes).all()  # a scheme of first order is nearer to its limit than its last change
    assert errors[-1] == pytest.approx([0.0, 0.0], abs=3e-6)


@pytest.mark.parametrize(("series", "tilt"), TILTS_RAD.items())
def test_friction_is_recovered_from_a_trajectory_of_siconos(series, tilt):
    row = row_of(series)

    found = identify(_record(series, row["plate_mass_kg"], row["pullback_m"]))

    assert found.model.name == ("coulomb+tilt" if tilt else "coulomb")
    assert found.model.adequate
    low, high = found.results["friction_dynamic"].interval_95
    assert low <= row["friction_dynamic"] <= high
    assert high - low < 0.01 * row["friction_dynamic"]
    if tilt:
        low, high = found.results["tilt_rad"].interval_95
        assert low <= tilt <= high


def _record(series, plate_mass_kg, pullback_m):
    """The finest trajectory after a hold, as two gauges with noise would have read it."""
    _, runs = stored(series)
    held = round(HOLD_S / INTERVAL_S)
    motion = np.hstack((np.tile([[pullback_m], [0.0]], held), runs[-1]))
    rng = np.random.default_rng(5)
    table, relative = motion + np.array(OFFSETS_M)[:, None] + NOISE_M * rng.standard_normal(motion.shape)
    masses = StandMasses(TABLE_MASS_KG, plate_mass_kg)
    return Record(INTERVAL_S * np.arange(motion.shape[1]), table, relative, masses, pullback_m=pullback_m)
