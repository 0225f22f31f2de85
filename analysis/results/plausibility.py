"""Results that no stand can have, and those that a record leaves open: they are left out, with a warning."""

from collections.abc import Iterator

from analysis.catalogue import Place, definition
from analysis.laws.parameters import FRICTION_MAX, PERIOD_MAX_S, PERIOD_MIN_S, TILT_MAX_RAD
from analysis.quantities import Quantity, ResultWarning, result_warning
from analysis.record import RecordError
from analysis.results.joint_fit import DECAY_QUANTITIES
from analysis.uncertainty import LEVEL_RAD, UncertaintyBudget
from messages.i18n import N_
from messages.message import Message, joined, message

_UPPER_BOUND = "friction_static_upper"
_FRICTION = (
    "friction_dynamic",
    "friction_dynamic_plate",
    "friction_path_mean",
    "friction_static",
    "friction_static_lower",
    _UPPER_BOUND,
)
_POSITIVE = (*_FRICTION, "pullback_m")
"""Zero is no value of these, or no finding."""


def check_period(period: Quantity) -> None:
    """Raise RecordError for a fitted period that no stand has; one less certain than long is no finding."""
    if PERIOD_MIN_S <= period.value <= PERIOD_MAX_S or _is_undetermined("period_s", period):
        return
    template = N_(
        "the fitted motion swings with a period of {period}, no stand does so ({shortest_s:g} to"
        " {longest_s:g} s). Check whether gauge 1 shows the free decay of a table."
    )
    raise RecordError(
        template, period=_shown("period_s", period), shortest_s=PERIOD_MIN_S, longest_s=PERIOD_MAX_S
    )


def remove_friction_of_tilted_plane(budget: UncertaintyBudget) -> Iterator[ResultWarning]:
    """Remove tilt and friction where the fitted tilt is one that no levelled plane has."""
    results = budget.results
    tilt = results.get("tilt_rad")
    if tilt is None or abs(tilt.value) <= TILT_MAX_RAD:
        return
    for name in ("tilt_rad", *_FRICTION):
        if name in results:
            budget.remove(name)
    template = N_(
        "the fitted motion needs a plane that leans by {tilt}, but no levelled one leans by more than"
        " {largest_mrad:g} mrad: it is not that of a plate on a table, and gives no friction. Level the"
        " plane, or check what gauge 2 shows."
    )
    shown = _shown("tilt_rad", tilt)
    yield result_warning("implausible-result", template, tilt=shown, largest_mrad=1e3 * TILT_MAX_RAD)


def tilt_warnings(results: dict[str, Quantity]) -> Iterator[ResultWarning]:
    """Warn of a tilt that a level would have shown."""
    tilt = results.get("tilt_rad")
    if tilt is None:
        return
    low, high = tilt.interval_95
    if max(low, -high) <= LEVEL_RAD:
        return
    template = N_(
        "the fitted tilt is {tilt}, more than a level leaves: the plane leans, or friction differs by"
        " direction, which looks like tilt (5 % like 5 mrad where f_d is 0.1). Check the level of the plane."
    )
    yield result_warning("tilt-beyond-level", template, tilt=_shown("tilt_rad", tilt))


def remove_undetermined(budget: UncertaintyBudget) -> Iterator[ResultWarning]:
    """Remove friction and pullback that are less certain than large."""
    results = budget.results
    names = [name for name in _POSITIVE if name in results and _is_undetermined(name, results[name])]
    if not names:
        return
    shown = joined([_with_symbol(name, results[name]) for name in names], ", ")
    for name in names:
        budget.remove(name)
    template = N_("the record does not tell {quantities}: less certain than large, and left out.")
    yield result_warning("implausible-result", template, quantities=shown)


def remove_undetermined_period(budget: UncertaintyBudget) -> Iterator[ResultWarning]:
    """Remove period, damping and stiffness where the period is less certain than long."""
    results = budget.results
    if "period_s" not in results or not _is_undetermined("period_s", results["period_s"]):
        return
    for name in DECAY_QUANTITIES:
        if name in results:
            budget.remove(name)
    template = N_(
        "the fitted motion has no certain period: T, damping and stiffness are left out. Check whether gauge"
        " 1 shows the free decay of a table."
    )
    yield result_warning("implausible-result", template)


def _is_undetermined(name: str, quantity: Quantity) -> bool:
    """Whether zero may be the value; of an upper bound, whether it excludes no plates at all."""
    largest = FRICTION_MAX if name == _UPPER_BOUND else abs(quantity.value)
    return not quantity.standard_uncertainty <= largest


def _with_symbol(name: str, quantity: Quantity) -> Message:
    symbol = definition(name).symbol
    return message(
        "{symbol} {relation} {shown}",
        symbol=symbol.text,
        relation=symbol.relation or "=",
        shown=_shown(name, quantity),
    )


def _shown(name: str, quantity: Quantity) -> str:
    return str(definition(name).format(quantity, Place.TERMINAL))
