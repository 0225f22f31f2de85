"""Effects of plate mass, pullback, velocity and contact on f_d, with the detectable size of each."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import combinations
from typing import Final

import numpy as np

from analysis.arrays import Floats
from analysis.campaign import linear_model
from analysis.campaign.linear_model import DesignMatrix, LinearFit
from analysis.campaign.rows import SeriesRow
from analysis.catalogue import MILLIMETRE
from analysis.formatting import format_signed, uncertainty_decimals
from analysis.quantities import Quantity
from messages.i18n import N_
from messages.message import Message, joined, message

_MASS_STEP_KG: Final = 10.0
_VELOCITY_STEP_M_PER_S: Final = 0.1
_NAMED: Final = 3  # sizes of an effect that its sentence names
_LARGEST: Final = 700.0  # difference of logarithms above which a ratio overflows


class Cause(StrEnum):
    """A possible cause of a change of f_d."""

    MASS = N_("plate mass")
    PULLBACK = N_("pullback")
    VELOCITY = N_("velocity")
    CONTACT = N_("contact")


@dataclass(frozen=True, slots=True)
class EffectSize:
    """Relative change of f_d (0.02: by 2 %) for a step of one cause, all other causes equal.

    The step is, for example, "per 10 kg more".
    """

    step: Message
    change: Quantity


@dataclass(frozen=True, slots=True)
class Effect:
    """One cause, tested with all others in the model."""

    cause: Cause
    found: bool | None  # whether f_d depends on it, at the 5 % level; None where the campaign cannot tell
    sentence: Message
    statistic: float | None = None
    p_value: float | None = None
    degrees_of_freedom: tuple[int, int] | None = None
    sizes: tuple[EffectSize, ...] = ()  # the sentence names the first
    size_seen: float | None = None  # change of f_d, per first step, found with a chance of 80 %


@dataclass(frozen=True, slots=True)
class Effects:
    """All causes in the order of `Cause`."""

    effects: tuple[Effect, ...]
    scatter: float | None
    """Relative standard deviation of the series about the model beyond their uncertainties; None where
    undetermined."""
    series: int


@dataclass(frozen=True, eq=False, slots=True)
class _Hypothesis:
    """Null hypothesis: combinations (k, p) of the coefficients are zero without the effect.

    `patterns` (m, k) are the combinations for an effect of size 1 of the first of `steps`.
    """

    combinations: Floats
    patterns: Floats
    steps: tuple[tuple[Message, Floats], ...]


def find_effects(rows: Sequence[SeriesRow]) -> Effects:
    """Test the causes of changes of f_d, by one weighted linear model of ln f_d of the series.

    Contact and pullback are categorical, with a coefficient for each combination. Plate mass and largest
    table velocity are linear. Each cause is tested with the others in the model, so a confounded cause is
    not named. The covariance holds errors that series share, and the scatter of the series about the model.
    """
    taken = [row for row in rows if linear_model.is_usable(row)]
    if not taken:
        reason = message("no series has f_d, v_max and a pullback")
        return Effects(tuple(_undetermined(cause, reason) for cause in Cause), None, 0)
    laid = linear_model.build_design(taken)
    fitted = linear_model.fit_linear_model(laid.matrix, linear_model.observations(taken))
    effects = tuple(_effect(cause, laid, fitted) for cause in Cause)
    return Effects(effects, None if fitted is None else fitted.excess_deviation, len(taken))


def _effect(cause: Cause, laid: DesignMatrix, fitted: LinearFit | None) -> Effect:
    question = _QUESTIONS[cause](laid)
    if isinstance(question, Message):
        return _undetermined(cause, question)
    if fitted is None:
        return _undetermined(cause, message("there are no repeats and too few series. Repeat the tests"))
    tested = linear_model.f_test(fitted, question.combinations, question.patterns)
    sizes = tuple(EffectSize(step, _change_quantity(fitted, weights)) for step, weights in question.steps)
    found, seen = tested.p_value < linear_model.LEVEL, _relative_change(tested.detectable_size)
    named: Sequence[EffectSize] = sizes[:1]
    if found:
        significance = [abs(size.change.value) / size.change.standard_uncertainty for size in sizes]
        named = [sizes[place] for place in np.argsort(-np.array(significance), kind="stable")[:_NAMED]]
    sentence = _sentence(cause, found, tested.p_value, named, sizes[0], seen)
    return Effect(
        cause, found, sentence, tested.statistic, tested.p_value, tested.degrees_of_freedom, sizes, seen
    )


def _undetermined(cause: Cause, reason: Message) -> Effect:
    text = message(
        "Whether f_d depends on the {cause} cannot be told: {reason}.",
        cause=message(cause.value),
        reason=reason,
    )
    return Effect(cause, None, text)


def _change_quantity(fitted: LinearFit, weights: Floats) -> Quantity:
    value, deviation, half = linear_model.estimate_linear_form(fitted, weights)
    ends = _relative_change(value - half), _relative_change(value + half)
    return Quantity(_relative_change(value), (1.0 + _relative_change(value)) * deviation, ends, "1")


def _relative_change(difference: float) -> float:
    return math.expm1(difference) if difference < _LARGEST else math.inf


def _sentence(
    cause: Cause, found: bool, p_value: float, named: Sequence[EffectSize], first: EffectSize, seen: float
) -> Message:
    chance = "p < 0.001" if p_value < 0.001 else f"p = {p_value:.2g}"
    numbers = joined([*map(_size, named), chance], "; ")
    template, power = (
        N_("f_d depends on the {cause}: {numbers}. {power}."),
        message("Even twice f_d might not be found"),
    )
    if not found:
        template = N_("No effect of the {cause} on f_d is found: {numbers}. {power}.")
    if seen < 1.0:
        change = message("{change:.2g} %", change=100.0 * seen)
        if len(named) > 1:
            change = joined([change, first.step])
        power = message("A change of {power} would be found with a chance of 80 %", power=change)
        if not found:
            template = N_(
                "No effect of the {cause} on f_d is found: {numbers}. {power}, a smaller one may be there."
            )
    return message(template, cause=message(cause.value), numbers=numbers, power=power)


def _size(size: EffectSize) -> Message:
    """Value and interval in percent, to two digits of its half width."""
    low, high = size.change.interval_95
    half = 50.0 * (high - low)
    decimals = max(0, uncertainty_decimals(half)) if 0.0 < half < math.inf else 0
    shares = {"value": size.change.value, "low": low, "high": high}
    percents = {name: format_signed(100.0 * share, decimals) for name, share in shares.items()}
    return message("{value} % {step} (95 %: {low} % to {high} %)", step=size.step, **percents)


def _mass(laid: DesignMatrix) -> _Hypothesis | Message:
    if laid.mass is None:
        return message("it is the same in all series of a contact and pullback. Add tests with other masses")
    weights = laid.form(laid.mass, _MASS_STEP_KG)
    step = message("per {step_kg:g} kg more", step_kg=_MASS_STEP_KG)
    return _Hypothesis(weights[None], np.ones((1, 1)), ((step, weights),))


def _velocity(laid: DesignMatrix) -> _Hypothesis | Message:
    if laid.velocity is None and laid.velocity_follows:
        return message(
            "it changes only as pullback and plate mass do, so it cannot be told from them. Change the"
            " stiffness of the stand at the same pullback and mass"
        )
    if laid.velocity is None:
        return message("it is the same in all series. Add tests with other pullbacks")
    weights = laid.form(laid.velocity, _VELOCITY_STEP_M_PER_S)
    low, high = laid.velocities
    step = message(
        "per {step:g} m/s more, over {low:.2f} to {high:.2f} m/s",
        step=_VELOCITY_STEP_M_PER_S,
        low=low,
        high=high,
    )
    return _Hypothesis(weights[None], np.ones((1, 1)), ((step, weights),))


def _pullback(laid: DesignMatrix) -> _Hypothesis | Message:
    of_contact = {
        contact: [u0 for kind, u0 in sorted(laid.cells) if kind == contact] for contact in laid.contacts
    }
    several = {contact: pullbacks for contact, pullbacks in of_contact.items() if len(pullbacks) > 1}
    if not several:
        return message("there is one pullback only of each contact. Add tests with another one")
    tested, shares, steps = [], [], []
    for contact, (least, *others) in several.items():
        for pullback in others:
            tested.append(laid.difference((contact, pullback), (contact, least)))
            shares.append((pullback - least) / (others[-1] - least))
        step = message(
            "from {least} to {most} with {contact}", least=_mm(least), most=_mm(others[-1]), contact=contact
        )
        steps.append((step, tested[-1]))
    mean = np.mean([weights for _, weights in steps], axis=0)
    least, *_, most = laid.pullbacks_m
    step = message("from {least} to {most}, on average over the contacts", least=_mm(least), most=_mm(most))
    every = ((step, mean), *steps) if len(steps) > 1 else tuple(steps)
    return _Hypothesis(np.array(tested), np.array([shares]), every)


def _contact(laid: DesignMatrix) -> _Hypothesis | Message:
    if len(laid.contacts) < 2:
        return message("there is one contact only. Add tests with another one")
    tested, marks, steps = [], [], []
    for pullback in laid.pullbacks_m:
        base, *others = [contact for contact, u0 in laid.cells if u0 == pullback]
        tested += [laid.difference((contact, pullback), (base, pullback)) for contact in others]
        marks += [(contact, base) for contact in others]
    for one, other in combinations(laid.contacts, 2):
        common = [u0 for u0 in laid.pullbacks_m if (one, u0) in laid.cells and (other, u0) in laid.cells]
        if common:
            mean = np.mean([laid.difference((other, u0), (one, u0)) for u0 in common], axis=0)
            steps.append((message("from {one} to {other}", one=one, other=other), mean))
    if not steps:
        return message("no two contacts were tested with the same pullback. Add such tests")
    patterns = np.array(
        [[float(mark[0] == odd) - float(mark[1] == odd) for mark in marks] for odd in laid.contacts]
    )
    return _Hypothesis(np.array(tested), patterns[np.any(patterns != 0.0, axis=1)], tuple(steps))


def _mm(length_m: float) -> str:
    return f"{MILLIMETRE.scale * length_m:g} {MILLIMETRE.symbol}"


_QUESTIONS: Final = {
    Cause.MASS: _mass,
    Cause.PULLBACK: _pullback,
    Cause.VELOCITY: _velocity,
    Cause.CONTACT: _contact,
}
