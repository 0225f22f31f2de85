"""The calibrations in use, in words: what they are, whether they hold, how they were last checked."""

import datetime
from collections.abc import Iterator
from typing import Final

from app.presenters.gauges.state import Fact, GaugeCard
from app.presenters.numbers import millimetres, rounded, signed, with_unit
from app.presenters.screen import Chip, Tone
from app.presenters.words import mark, tr, trn
from config.schema import Gauge, GaugeCheck, GaugeChecks, Gauges

NAMES: Final = (mark("Gauge 1, table"), mark("Gauge 2, relative"))
_SOON: Final = datetime.timedelta(days=30)
_NOT_STATED: Final = mark("not stated")
_CHECK: Final = mark("Check it before a test: the tab Check, or slipstand calibrate check")


def describe_gauges(gauges: Gauges, checks: GaugeChecks, today: datetime.date) -> tuple[GaugeCard, ...]:
    """Both cards, gauge 1 first."""
    last = {check.gauge: check for check in checks.last_of(gauges)}
    return (
        _card(NAMES[0], gauges.table, last.get("table"), today),
        _card(NAMES[1], gauges.relative, last.get("relative"), today),
    )


def standing(gauge: Gauge, today: datetime.date) -> Chip:
    """Whether a calibration holds."""
    until = gauge.valid_until
    if until is None:
        return Chip(
            tr("No expiry date stated"),
            Tone.PLAIN,
            tr("Whoever calibrates next should say until when it holds"),
        )
    if gauge.is_expired(today):
        return Chip(
            tr("EXPIRED on {until}", until=until), Tone.BAD, tr("Calibrate the gauge before the next test")
        )
    days = (until - today).days
    if until - today <= _SOON:
        left = tr("Expires today")
        if days:
            left = trn("Expires in {count} day", "Expires in {count} days", days)
        return Chip(left, Tone.WARN, tr("Calibrate the gauge soon"))
    return Chip(tr("Valid until {until}", until=until), Tone.OK)


def last_check(check: GaugeCheck | None) -> Chip:
    """How the calibration in use came out of its last check."""
    if check is None:
        return Chip(tr("Not checked yet"), Tone.PLAIN, tr(_CHECK))
    off = with_unit(f"{check.deviation_m * 1e6:+.0f}".replace("-", "\u2212"), "µm")
    allowed = with_unit(f"{check.tolerance_m * 1e6:.0f}", "µm")
    tried = tr("Known shunt") if check.kind == "shunt" else tr("Known displacement")
    words = tr(
        "{time}: {off} at {known}, {allowed} allowed",
        time=f"{check.at:%Y-%m-%d %H:%M}",
        off=off,
        known=with_unit(millimetres(check.expected_m, 3), "mm"),
        allowed=allowed,
    )
    by = f"{tried}. {check.reference} {check.checked_by}".strip()
    if check.passed:
        return Chip(tr("Check passed {words}", words=words), Tone.OK, by)
    return Chip(
        tr("Check FAILED {words}", words=words),
        Tone.BAD,
        tr("{by}. Check plugs and mounting, then calibrate again", by=by),
    )


def _card(name: str, gauge: Gauge, check: GaugeCheck | None, today: datetime.date) -> GaugeCard:
    return GaugeCard(tr(name), standing(gauge, today), tuple(_facts(gauge)), last_check(check))


def _facts(gauge: Gauge) -> Iterator[Fact]:
    gain = with_unit(signed(f"{gauge.gain_m_per_count * 1e6:.6g}"), "µm/count")
    relative = gauge.gain_relative_standard_uncertainty
    yield Fact(tr("gain"), gain)
    yield Fact(
        tr("gain uncertainty"),
        tr(_NOT_STATED) if relative is None else with_unit(f"{relative:.2%}"[:-1], "%"),
    )
    yield Fact(tr("zero"), with_unit(signed(f"{gauge.zero_count:.9g}"), "counts"))
    if gauge.polynomial:
        yield Fact(tr("polynomial"), ", ".join(signed(f"{term:.3g}") for term in gauge.polynomial))
    yield Fact(tr("range"), _range(gauge.range_m))
    if gauge.nonlinearity_m is not None:
        yield Fact(tr("non-linearity"), with_unit(rounded(gauge.nonlinearity_m * 1e6, 1), "µm"))
    yield Fact(tr("calibrated"), gauge.date.isoformat() if gauge.date else tr(_NOT_STATED))
    yield Fact(tr("by"), gauge.calibrated_by or tr(_NOT_STATED))
    yield Fact(tr("reference"), gauge.reference or tr(_NOT_STATED))
    yield Fact(tr("certificate"), gauge.certificate or tr(_NOT_STATED))
    yield Fact(tr("serial number"), gauge.serial_number or tr(_NOT_STATED))


def _range(range_m: float | None) -> str:
    return tr(_NOT_STATED) if range_m is None else with_unit(f"± {range_m * 1e3:g}", "mm")
