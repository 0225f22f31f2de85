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
from analysis.laws.stand_parts import StandModel
from analysis.plate.friction import PlateFriction
from analysis.quantities import BudgetSource, Quantity, ResultWarning, result_warning
from analysis.results.joint_fit import JointFit
from analysis.results.plausibility import (
    remove_friction_of_tilted_plane,
    remove_undetermined,
    remove_undetermined_period,
    tilt_warnings,
)
from analysis.uncertainty import NEGLIGIBLE, UncertaintyBudget
from messages.i18n import N_

_NAME = "friction_dynamic"
_NAMES = frozenset((_NAME, "friction_path_mean"))
_SIGMAS = 3.0  # estimates that differ by more standard uncertainties of the plate's own contradict each other
_SPREAD_MAX = 0.02  # of f_d: estimates of a failed model that differ by more leave f_d open
_LEFT_MAX = 0.05  # share of what the ideal stand leaves: with more, other effects are as large as those found
_SPREAD_OF_MODEL_MAX = 0.02  # of f_d, see `_spread_of_model`
_UNTRUE = 0.15  # of the shift of f_d: so far each effect of a failed model may be off, by the same study
_SPREAD_OF_MODEL_MIN = 0.003  # of f_d; benchmarks/study_real_stand.py: what is left moves f_d by as much
_DESCRIPTION = 0.02  # of the shift of f_d by effects: so far their description is off, by the same study
_FLOOR = 3e-4  # of f_d: what effects below detection move it by beside those found, by the same study
MISFIT_MAX = 1.5  # of the plate's parabolas: with more the readings in slips are bent themselves
_CLOSE = 0.005  # of f_d: a difference that limits no use of the result, however small the uncertainties are


def judge(
    joint: JointFit,
    plate: PlateFriction | None,
    budget: UncertaintyBudget,
    ideal: Fit,
    spread: float,
    *,
    law_is_given: bool = False,
) -> tuple[JointFit, list[ResultWarning]]:
    """Set the degree of the verdict, and f_d in the budget to the value that the degree stands for.

    `ideal` is the likeliest fit on an ideal stand, `spread` the standard deviation of f_d between models that
    the record leaves possible. A law that was asked for keeps its f_d, whose uncertainty includes the
    difference from that of the plate where both agree. Results that cannot be leave the budget.
    """
    warnings = list(remove_friction_of_tilted_plane(budget))
    joint, found = _compare_estimates(joint, plate, budget, ideal, spread, law_is_given=law_is_given)
    warnings += [*found, *remove_undetermined(budget), *remove_undetermined_period(budget)]
    warnings += tilt_warnings(budget.results)
    return joint if _NAME in budget.results else _with_degree(joint, Degree.NONE), warnings


def _compare_estimates(
    joint: JointFit,
    plate: PlateFriction | None,
    budget: UncertaintyBudget,
    ideal: Fit,
    spread: float,
    *,
    law_is_given: bool,
) -> tuple[JointFit, list[ResultWarning]]:
    selection, results = joint.selection, budget.results
    own = results.get(_NAME)
    if own is None:
        return joint, []
    difference = math.inf if plate is None else abs(plate.friction_dynamic - own.value)
    if selection.adequate:
        if selection.degree is Degree.IDEAL:
            if spread > NEGLIGIBLE * own.standard_uncertainty:
                for name in _NAMES.intersection(results):
                    budget.widen(name, BudgetSource.MODEL, spread)
            return joint, []
        spread = math.hypot(spread, _DESCRIPTION * _shift(joint, ideal), _FLOOR * own.value)
        if plate is None or _agree(own, plate) or _misleads_plate(joint):
            budget.widen(_NAME, BudgetSource.MODEL, spread)
            return joint, []
        budget.widen(_NAME, BudgetSource.MODEL, math.hypot(spread, difference))
        return joint, [_disagreement(own, plate)]
    holds = plate is not None and plate.misfit < MISFIT_MAX and difference < _SPREAD_MAX * own.value
    if law_is_given:
        if holds:
            left = (selection.residual_share or 0.0) * own.value
            for name in _NAMES.intersection(results):
                budget.widen(name, BudgetSource.MODEL, max(difference, left))
        return _with_degree(joint, Degree.FRICTION if holds else Degree.NONE), []
    if plate is not None and holds:
        value, shares = combine_estimates(
            own, budget.results["friction_dynamic_plate"], selection.residual_share or 0.0
        )
        budget.remove(_NAME)
        budget.add(_NAME, value, shares)
        return _with_degree(joint, Degree.FRICTION), []
    spread = _spread_of_model(joint, ideal)
    if spread < _SPREAD_OF_MODEL_MAX * own.value:
        budget.widen(_NAME, BudgetSource.MODEL, max(spread, _SPREAD_OF_MODEL_MIN * own.value))
        return _with_degree(joint, Degree.FRICTION), []
    if plate is not None:
        budget.widen(_NAME, BudgetSource.MODEL, max(difference, _SPREAD_MAX * own.value))
    return _with_degree(joint, Degree.NONE), []


def combine_estimates(own: Quantity, plate: Quantity, left: float) -> tuple[float, dict[BudgetSource, float]]:
    """Mean of both estimates, the failed joint fit uncertain by all of their difference; its contributions.

    However well they agree, half of the plate's variance stays: only the plate checks the failed fit.
    Friction that varies along the track misleads both alike, and shows in what the fit leaves: f_d is as
    uncertain as that, the share `left` of the swing.
    """
    difference = abs(plate.value - own.value)
    plate_variance = plate.standard_uncertainty**2
    own_variance = own.standard_uncertainty**2 + difference**2
    share = own_variance / (own_variance + plate_variance)
    value = own.value + share * (plate.value - own.value)
    noise = math.sqrt(max(share, 0.5)) * plate.standard_uncertainty
    spread = max(max(share, 1.0 - share) * difference, left * value)
    return value, {BudgetSource.NOISE: noise, BudgetSource.MODEL: spread}


def _shift(joint: JointFit, ideal: Fit) -> float:
    """By how much the effects found move f_d."""
    place = Parameter.FRICTION_DYNAMIC
    return abs(joint.chosen.value(place) - ideal.value(place))


def _spread_of_model(joint: JointFit, ideal: Fit) -> float:
    """By how much f_d may still move: as the effects found moved it, in proportion to what is left.

    Each effect of a model that fails is not quite what it seems.
    """
    if joint.chosen is ideal or joint.chosen.law is ideal.law:
        return math.inf
    count = joint.problem.sample_count
    left = (joint.chosen.chi_square - count) / max(ideal.chi_square - count, 1.0)
    if not 0.0 < left < _LEFT_MAX:
        return math.inf
    return _shift(joint, ideal) * (math.sqrt(left) + _UNTRUE * len(joint.selection.parts))


def _misleads_plate(joint: JointFit) -> bool:
    law = joint.chosen.law
    return isinstance(law, StandModel) and any(effect.misleads_plate for effect in law.effects)


def _agree(own: Quantity, plate: PlateFriction) -> bool:
    tolerance = _SIGMAS * math.hypot(own.standard_uncertainty, plate.standard_uncertainty)
    return abs(own.value - plate.friction_dynamic) <= max(tolerance, _CLOSE * own.value)


def _with_degree(joint: JointFit, degree: Degree) -> JointFit:
    return replace(joint, selection=replace(joint.selection, degree=degree))


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
