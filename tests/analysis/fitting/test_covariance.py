"""What a normal matrix does not determine stays out of the covariance, and does not spoil the rest."""

import numpy as np
import pytest
from synthetic import Truth, simulate_record

from analysis.fitting.problem import covariance
from analysis.identify import identify


def test_a_parameter_without_curvature_has_no_variance_and_leaves_the_others_theirs():
    normal = np.array([[4.0e8, 0.0, 1.0e3], [0.0, 0.0, 0.0], [1.0e3, 0.0, 2.0]])

    inverse, loose = covariance(normal)

    assert loose.tolist() == [False, True, False]
    assert inverse[1].tolist() == [0.0, 0.0, 0.0]
    rest = np.ix_([0, 2], [0, 2])
    assert inverse[rest] == pytest.approx(np.linalg.inv(normal[rest]))


def test_bounds_of_a_static_friction_without_value_have_an_uncertainty():
    found = identify(
        simulate_record(Truth(rate_hz=500.0, friction_dynamic=0.21, pullback_m=0.006)), model="static"
    )

    assert "static-not-identified" in [caution.code for caution in found.warnings]
    assert "friction_static" not in found.results
    assert found.results["friction_static_lower"].standard_uncertainty < 1e-3
