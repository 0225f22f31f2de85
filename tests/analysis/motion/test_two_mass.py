"""The exact solver against numbers and solvers that are not ours."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.motion.two_mass import simulate

# Made independently of this project and handed over with the task; times and displacements to 1e-12.
GOLDEN = json.loads((Path(__file__).parents[2] / "golden" / "two_mass.json").read_text())
ARGUMENTS = (
    "table_mass_kg",
    "plate_mass_kg",
    "stiffness_n_per_m",
    "damping_coefficient_kg_per_s",
    "friction_dynamic",
    "friction_static",
    "tilt_rad",
    "pullback_m",
    "duration_s",
    "gravity_m_per_s2",
)


@pytest.fixture(params=GOLDEN, ids=lambda case: case["name"])
def case(request: pytest.FixtureRequest) -> dict[str, Any]:
    return request.param


def test_phases_are_the_golden_ones(case):
    motion = simulate(**{name: case[name] for name in ARGUMENTS})
    assert motion.phase_signs.tolist() == case["phase_signs"]
    np.testing.assert_allclose(motion.phase_starts_s, case["phase_starts_s"], rtol=0, atol=1e-12)
    assert motion.slip_end_s == pytest.approx(case["slip_end_s"], abs=1e-12)


def test_displacements_are_the_golden_ones(case):
    motion = simulate(**{name: case[name] for name in ARGUMENTS})
    samples = motion.sample(case["sample_times_s"])
    for name in ("table_displacement_m", "relative_displacement_m"):
        np.testing.assert_allclose(getattr(samples, name), case[name], rtol=0, atol=1e-12)
    np.testing.assert_allclose(
        samples.table_velocity_m_per_s, case["table_velocity_m_per_s"], rtol=0, atol=1e-11
    )
    assert motion.residual_displacement_m == pytest.approx(case["residual_displacement_m"], abs=1e-12)


def test_largest_rates_are_the_golden_ones(case):
    motion = simulate(**{name: case[name] for name in ARGUMENTS})
    for name in (
        "table_velocity_max_m_per_s",
        "plate_velocity_max_m_per_s",
        "table_acceleration_max_m_per_s2",
    ):
        # The golden ones are the largest of samples, so they may miss a peak by a little.
        assert case[name] * (1 - 1e-12) <= getattr(motion, name) <= case[name] * (1 + 1e-4)
