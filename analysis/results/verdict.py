"""The verdict in degrees: how far a model explains a record, and whether f_d holds all the same.

The joint fit and the plate's own estimate rest on different readings: the fit on every reading and on a
model of the stand, the plate on its curvature in slips alone. Where they agree, what the model leaves
unexplained does not bear on f_d.
"""

import math
from dataclasses import replace

from analysis.fitting.search import Fit
from analysis.identification import Degree
from analysis.laws.parameters import Parameter
from analysis.plate.friction import PlateFriction
from analysis.quantities import BudgetSource, Quantity, ResultWarning, result_warning
from analysis.results.joint_fit import JointFit
from analysis.results.plausibility import (
    remove_friction_of_tilted_plane,
    remove_undetermined,
    tilt_warnings,
)
from analysis.uncertainty import UncertaintyBudget
from messages.i18n import N_

_NAME = "friction_dynamic"
_SIGMAS = 3.0  # estimates that differ by more standard uncertainties of the plate's own contradict each other
_SPREAD_MAX = 0.02  # of f_d: estimates of a failed model that differ by more leave f_d open
_LEFT_MAX = 0.05  # share of what the ideal stand leaves: with more, other effects are as large as those found
_SPREAD_OF_MODEL_MAX = 0.005  # of f_d, see `_spread_of_model`
_SPREAD_OF_MODEL_MIN = 0.003  # of f_d; benchmarks/study_real_stand.py: what is left moves f_d by as much
_DESCRIPTION = 0.02  # of the shift of f_d by effects: so far their description is off, by the same study
_FLOOR = 3e-4  # of f_d: what effects below detection move it by beside those found, by the same study
_MISFIT_MAX = 1.5  # of the plate's parabolas: with more the readings in slips are bent themselves
_CLOSE = 0.005  # of f_d: a difference that limits no use of the result, however small the uncertainties are


def judge(
    joint: JointFit,
    plate: PlateFriction | None,
    budget: UncertaintyBudget,
    ideal: Fit,
    *,
    law_is_given: bool = False,
) -> tuple[JointFit, list[ResultWarning]]:
    """Set the degree of the verdict, and f_d in the budget to the value that the degree stands for.

    `ideal` is the likeliest fit on an ideal stand. A law that was asked for keeps its f_d. Results that
    cannot be leave the budget.
    """
    warnings = list(remove_friction_of_tilted_plane(budget))
    joint, found = _compare_estimates(joint, plate, budget, ideal, law_is_given=law_is_given)
    warnings += [*found, *remove_undetermined(budget), *tilt_warnings(budget.results)]
    return joint if _NAME in budget.results else _with_degree(joint, Degree.NONE), warnings


def _compare_estimates(
    joint: JointFit, plate: PlateFriction | None, budget: UncertaintyBudget, ideal: Fit, *, law_is_given: bool
) -> tuple[JointFit, list[ResultWarning]]:
    selection, results = joint.selection, budget.results
    own = results.get(_NAME)
    if own is None:
        return joint, []
    difference = math.inf if plate is None else abs(plate.friction_dynamic - own.value)
    if selection.adequate:
        if selection.degree is Degree.IDEAL:
            return joint, []
        spread = math.hypot(_DESCRIPTION * _shift(joint, ideal), _FLOOR * own.value)
        if plate is None or _agree(own, plate):
            _add_model_spread(budget, own, spread)
            return joint, []
        _add_model_spread(budget, own, math.hypot(spread, difference))
        return joint, [_disagreement(own, plate)]
    holds = plate is not None and plate.misfit < _MISFIT_MAX and difference < _SPREAD_MAX * own.value
    if law_is_given:
        return _with_degree(joint, Degree.FRICTION if holds else Degree.NONE), []
    if plate is not None and holds:
        budget.remove(_NAME)
        shares = {BudgetSource.NOISE: plate.standard_uncertainty, BudgetSource.MODEL: difference}
        budget.add(_NAME, plate.friction_dynamic, shares)
        return _with_degree(joint, Degree.FRICTION), []
    spread = _spread_of_model(joint, ideal)
    if spread < _SPREAD_OF_MODEL_MAX * own.value:
        _add_model_spread(budget, own, max(spread, _SPREAD_OF_MODEL_MIN * own.value))
        return _with_degree(joint, Degree.FRICTION), []
    if plate is not None:
        _add_model_spread(budget, own, max(difference, _SPREAD_MAX * own.value))
    return _with_degree(joint, Degree.NONE), []


def _shift(joint: JointFit, ideal: Fit) -> float:
    """By how much the effects found move f_d."""
    place = Parameter.FRICTION_DYNAMIC
    return abs(joint.chosen.value(place) - ideal.value(place))


def _spread_of_model(joint: JointFit, ideal: Fit) -> float:
    """By how much f_d may still move: as the effects found moved it, in proportion to what is left."""
    if joint.chosen is ideal or joint.chosen.law is ideal.law:
        return math.inf
    count = joint.problem.sample_count
    left = (joint.chosen.chi_square - count) / max(ideal.chi_square - count, 1.0)
    if not 0.0 < left < _LEFT_MAX:
        return math.inf
    return _shift(joint, ideal) * math.sqrt(left)


def _agree(own: Quantity, plate: PlateFriction) -> bool:
    tolerance = _SIGMAS * math.hypot(own.standard_uncertainty, plate.standard_uncertainty)
    return abs(own.value - plate.friction_dynamic) <= max(tolerance, _CLOSE * own.value)


def _with_degree(joint: JointFit, degree: Degree) -> JointFit:
    return replace(joint, selection=replace(joint.selection, degree=degree))


def _add_model_spread(budget: UncertaintyBudget, own: Quantity, spread: float) -> None:
    shares = {
        line.source: line.standard_uncertainty for line in budget.lines if line.contribution_to == _NAME
    }
    budget.remove(_NAME)
    budget.add(_NAME, own.value, {**shares, BudgetSource.MODEL: spread})


def _disagreement(own: Quantity, plate: PlateFriction) -> ResultWarning:
    return result_warning(
        "estimates-differ",
        N_(
            "the plate alone gives f_d = {plate:.4f}, the joint fit {joint:.4f}: the difference is part of"
            " the uncertainty."
        ),
        plate=plate.friction_dynamic,
        joint=own.value,
    )
