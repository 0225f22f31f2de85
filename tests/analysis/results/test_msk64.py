"""MSK-64 degrees against the published scale (Medvedev, Sponheuer and Karnik 1964)."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.record import AnalysisError
from analysis.results.fitted_quantities import msk64_degree

DEGREES = ["below V", "V", "VI", "VII", "VIII", "IX", "X", "above X"]


@pytest.mark.parametrize(
    ("velocity_cm_per_s", "degree"),
    [
        (0.0, "below V"), (1.0, "below V"), (1.01, "V"), (2.0, "V"), (2.01, "VI"), (4.0, "VI"), (8.0, "VII"),
        (8.01, "VIII"), (16.0, "VIII"), (16.01, "IX"), (32.0, "IX"), (32.01, "X"), (64.0, "X"),
        (64.01, "above X"),
    ],
)  # fmt: skip
def test_bounds_belong_to_the_lower_degree(velocity_cm_per_s, degree):
    assert msk64_degree(velocity_cm_per_s / 100.0) == degree


@pytest.mark.parametrize(("velocity", "degree"), [(0.14, "VIII"), (0.22, "IX"), (0.39, "X")])
def test_velocities_of_the_paper(velocity, degree):
    assert msk64_degree(velocity) == degree


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_faster_is_never_a_lower_degree(one, other):
    low, high = sorted((one, other))
    assert DEGREES.index(msk64_degree(low)) <= DEGREES.index(msk64_degree(high))


@pytest.mark.parametrize("velocity", [-0.1, math.nan, math.inf])
def test_no_degree_without_a_velocity(velocity):
    with pytest.raises(AnalysisError, match="MSK-64"):
        msk64_degree(velocity)
