"""Cards of the calibrations in use: values, validity and last check."""

import datetime
from collections.abc import Iterator
from typing import Final

from analysis.catalogue import MICROMETRE, MILLIMETRE
from analysis.formatting import format_signed, typeset, with_unit
from app.presenters.base import Chip, LabelledValue, Tone
from app.presenters.gauges.state import NAMES, GaugeCard
from app.presenters.number_text import format_in
from config.schema import Gauge, GaugeCheck, GaugeChecks, Gauges
from messages.i18n import N_, gettext, ngettext

_SOON: Final = datetime.timedelta(days=30)
"""Time that a laboratory usually needs to arrange a calibration."""
_NOT_STATED: Final = N_("not stated")
_CHECK: Final = N_("Check it before a test: the tab Check, or slipstand calibrate check")


def gauge_cards(gauges: Gauges, checks: GaugeChecks, today: datetime.date) -> tuple[GaugeCard, ...]:
    """Cards of both gauges, gauge 1 first."""
    last = {check.gauge: check for check in checks.latest_checks(gauges)}
    return (
        _card(NAMES[0], gauges.table, last.get("table"), today),
        _card(NAMES[1], gauges.relative, last.get("relative"), today),
    )


def validity(gauge: Gauge, today: datetime.date) -> Chip:
    """Whether a calibration is valid on a day."""
    until = gauge.valid_until
    if until is None:
        return Chip(
            gettext("No expiry date stated"),
            Tone.PLAIN,
            gettext("Whoever calibrates next should say until when it holds"),
        )
    if gauge.is_expired(today):
        return Chip(
            gettext("EXPIRED on {until}", until=until),
            Tone.BAD,
            gettext("Calibrate the gauge before the next test"),
        )
    days = (until - today).days
    if until - today <= _SOON:
        left = gettext("Expires today")
        if days:
            left = ngettext("Expires in {count} day", "Expires in {count} days", days)
        return Chip(left, Tone.WARN, gettext("Calibrate the gauge soon"))
    return Chip(gettext("Valid until {until}", until=until), Tone.OK)


def last_check_chip(check: GaugeCheck | None) -> Chip:
    """Outcome of the last check of the calibration in use."""
    if check is None:
        return Chip(gettext("Not checked yet"), Tone.PLAIN, gettext(_CHECK))
    off = typeset(format_signed(MICROMETRE.scale * check.deviation_m, 0))
    reference_kind = gettext("Known shunt") if check.kind == "shunt" else gettext("Known displacement")
    text = gettext(
        "{time}: {off} at {known}, {allowed} allowed",
        time=f"{check.at:%Y-%m-%d %H:%M}",
        off=with_unit(off, MICROMETRE.symbol),
        known=format_in(MILLIMETRE, check.expected_m, 3),
        allowed=format_in(MICROMETRE, check.tolerance_m, 0),
    )
    by = f"{reference_kind}. {check.reference} {check.checked_by}".strip()
    if check.passed:
        return Chip(gettext("Check passed {words}", words=text), Tone.OK, by)
    return Chip(
        gettext("Check FAILED {words}", words=text),
        Tone.BAD,
        gettext("{by}. Check plugs and mounting, then calibrate again", by=by),
    )


def _card(name: str, gauge: Gauge, check: GaugeCheck | None, today: datetime.date) -> GaugeCard:
    return GaugeCard(gettext(name), validity(gauge, today), tuple(_values(gauge)), last_check_chip(check))


def _values(gauge: Gauge) -> Iterator[LabelledValue]:
    gain = with_unit(
        typeset(f"{MICROMETRE.scale * gauge.gain_m_per_count:.6g}"), f"{MICROMETRE.symbol}/count"
    )
    relative = gauge.gain_relative_standard_uncertainty
    yield LabelledValue(gettext("gain"), gain)
    yield LabelledValue(
        gettext("gain uncertainty"),
        gettext(_NOT_STATED) if relative is None else with_unit(f"{relative:.2%}"[:-1], "%"),
    )
    yield LabelledValue(gettext("zero"), with_unit(typeset(f"{gauge.zero_count:.9g}"), "counts"))
    if gauge.polynomial:
        yield LabelledValue(
            gettext("polynomial"), ", ".join(typeset(f"{term:.3g}") for term in gauge.polynomial)
        )
    yield LabelledValue(gettext("range"), _range(gauge.range_m))
    if gauge.nonlinearity_m is not None:
        yield LabelledValue(gettext("non-linearity"), format_in(MICROMETRE, gauge.nonlinearity_m))
    yield LabelledValue(gettext("calibrated"), gauge.date.isoformat() if gauge.date else gettext(_NOT_STATED))
    yield LabelledValue(gettext("by"), gauge.calibrated_by or gettext(_NOT_STATED))
    yield LabelledValue(gettext("reference"), gauge.reference or gettext(_NOT_STATED))
    yield LabelledValue(gettext("certificate"), gauge.certificate or gettext(_NOT_STATED))
    yield LabelledValue(gettext("serial number"), gauge.serial_number or gettext(_NOT_STATED))


def _range(range_m: float | None) -> str:
    if range_m is None:
        return gettext(_NOT_STATED)
    return with_unit(f"± {MILLIMETRE.scale * range_m:g}", MILLIMETRE.symbol)
