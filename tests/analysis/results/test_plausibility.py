"""Results that no stand can have, or that a record leaves open."""

import pytest

from analysis.quantities import BudgetSource, Quantity
from analysis.record import RecordError
from analysis.results.plausibility import (
    check_period,
    remove_friction_of_tilted_plane,
    remove_undetermined,
    remove_undetermined_period,
    tilt_warnings,
)
from analysis.uncertainty import UncertaintyBudget


def budget_of(**values):
    """Budget of quantities, each with its standard uncertainty."""
    budget = UncertaintyBudget()
    for name, (value, uncertainty) in values.items():
        budget.add(name, value, {BudgetSource.NOISE: uncertainty})
    return budget


def test_a_tilt_that_no_levelled_plane_has_leaves_no_friction():
    budget = budget_of(
        friction_dynamic=(0.864, 0.024), friction_dynamic_plate=(0.8, 0.1), tilt_rad=(-0.136, 0.01),
        period_s=(0.5, 1e-3),
    )  # fmt: skip
    (warning,) = remove_friction_of_tilted_plane(budget)
    assert list(budget.results) == ["period_s"]
    assert {line.contribution_to for line in budget.lines} == {"period_s"}
    assert "-136 ± 10 mrad" in str(warning.message)


def test_what_is_less_certain_than_large_is_left_out_and_told():
    budget = budget_of(
        friction_dynamic=(0.1, 1e-3), friction_static=(1.0, 54.0), friction_static_upper=(0.03, 930.0),
        tilt_rad=(1e-4, 2e-3), damping_n1_per_s=(0.01, 0.02),
    )  # fmt: skip
    (warning,) = remove_undetermined(budget)
    assert list(budget.results) == ["friction_dynamic", "tilt_rad", "damping_n1_per_s"]
    assert "f_s = 1 ± 54, f_s ≤ 0 ± 930" in str(warning.message)


def test_a_sound_budget_is_kept():
    budget = budget_of(friction_dynamic=(0.1, 1e-3), friction_static_upper=(0.1, 0.2), tilt_rad=(0.019, 1e-3))
    assert not [*remove_friction_of_tilted_plane(budget), *remove_undetermined(budget)]
    assert len(budget.results) == 3


@pytest.mark.parametrize(("period_s", "uncertainty_s"), [(279.0, 1.0), (0.01, 1e-4)])
def test_a_period_that_no_stand_has_is_refused(period_s, uncertainty_s):
    with pytest.raises(RecordError, match="no stand does so"):
        check_period(Quantity.normal(period_s, uncertainty_s, "s"))


@pytest.mark.parametrize(("period_s", "uncertainty_s"), [(3.3, 4.2), (1e-7, 1600.0)])
def test_a_period_less_certain_than_long_is_left_out_with_what_follows_from_it(period_s, uncertainty_s):
    """It was refused as "a period of 170 ± 590 ms, no stand does so (0.03 to 10 s)", or as one of 0 ms."""
    budget = budget_of(
        period_s=(period_s, uncertainty_s), stiffness_n_per_m=(2e5, 1e6), friction_dynamic=(0.1, 1e-3)
    )
    check_period(budget.results["period_s"])
    (warning,) = remove_undetermined_period(budget)
    assert list(budget.results) == ["friction_dynamic"]
    assert warning.code == "implausible-result"
    assert "no certain period" in str(warning.message)


@pytest.mark.parametrize(
    ("tilt_rad", "uncertainty_rad", "warned"),
    [(-3e-3, 1e-4, True), (3e-3, 1e-3, False), (1e-3, 1e-5, False), (-1e-3, 3e-3, False)],
)
def test_a_tilt_that_a_level_would_show_is_told(tilt_rad, uncertainty_rad, warned):
    found = list(tilt_warnings(budget_of(tilt_rad=(tilt_rad, uncertainty_rad)).results))
    assert [warning.code for warning in found] == ["tilt-beyond-level"] * warned
