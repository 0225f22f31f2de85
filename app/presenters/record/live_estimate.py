"""What is known of a run while it is recorded, in numbers and words for people."""

from analysis.quantities import Quantity
from app.acquisition.messages import LiveResult
from app.presenters import results
from app.presenters.record.state import LiveEstimate
from app.presenters.results import FRICTION, MAIN
from messages.i18n import N_, gettext

_MAY_STOP = N_("Waiting no longer narrows f<sub>d</sub>: you may stop")
_SYMBOLS = {shown.key: shown.symbol for shown in (*MAIN, FRICTION)}


def live_estimate(result: LiveResult) -> LiveEstimate:
    """Put a live result into rows, T, n1 and f_d, as far as they are known."""
    if result.message:
        return LiveEstimate(note=results.sentence(result.message))
    values = (result.period, result.damping_n1, result.friction_dynamic)
    rows = tuple(
        results.make_row(shown, Quantity.normal(value.value, value.standard_uncertainty, value.unit))
        for shown, value in zip((*MAIN, FRICTION), values, strict=True)
        if value is not None and value.is_known
    )
    return LiveEstimate(rows, _note(result) if result.may_stop else "")


def _note(result: LiveResult) -> str:
    narrower = gettext(" and ").join(_SYMBOLS[name] for name in result.narrowing if name in _SYMBOLS)
    if not narrower:
        return gettext(_MAY_STOP)
    return gettext("{may_stop}; it still narrows {what}", may_stop=gettext(_MAY_STOP), what=narrower)
