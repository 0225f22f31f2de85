"""The calibrations in use, in words: what they are, whether they hold, how they were last checked."""

import datetime
from collections.abc import Iterator
from typing import Final

from app.presenters.gauges.state import Fact, GaugeCard
from app.presenters.numbers import millimetres, rounded, signed, with_unit
from app.presenters.screen import Chip, Tone
from config.schema import Gauge, GaugeCheck, GaugeChecks, Gauges

NAMES: Final = ("Gauge 1, table", "Gauge 2, relative")
_SOON: Final = datetime.timedelta(days=30)
_NOT_STATED: Final = "not stated"
_CHECK: Final = "Check it before a test: the tab Check, or slipstand calibrate check"


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
            "no last day stated", Tone.PLAIN, "Whoever calibrates next should say until when it holds"
        )
    if gauge.is_expired(today):
        return Chip(f"EXPIRED on {until}", Tone.BAD, "Calibrate the gauge before the next test")
    days = (until - today).days
    if until - today <= _SOON:
        left = "today is its last day" if days == 0 else f"expires in {days} day{'s' if days > 1 else ''}"
        return Chip(left, Tone.WARN, "Calibrate the gauge soon")
    return Chip(f"valid until {until}", Tone.OK)


def last_check(check: GaugeCheck | None) -> Chip:
    """How the calibration in use came out of its last check."""
    if check is None:
        return Chip("not checked yet", Tone.PLAIN, _CHECK)
    off = with_unit(f"{check.deviation_m * 1e6:+.0f}".replace("-", "\u2212"), "µm")
    allowed = with_unit(f"{check.tolerance_m * 1e6:.0f}", "µm")
    tried = "shunt" if check.kind == "shunt" else "displacement"
    words = (
        f"{check.at:%Y-%m-%d %H:%M}: {off} at {millimetres(check.expected_m, 3)}\u202fmm, {allowed} allowed"
    )
    by = f"Known {tried}. {check.reference} {check.checked_by}".strip()
    if check.passed:
        return Chip(f"check passed {words}", Tone.OK, by)
    return Chip(f"check FAILED {words}", Tone.BAD, f"{by}. Check plugs and mounting, then calibrate again")


def _card(name: str, gauge: Gauge, check: GaugeCheck | None, today: datetime.date) -> GaugeCard:
    return GaugeCard(name, standing(gauge, today), tuple(_facts(gauge)), last_check(check))


def _facts(gauge: Gauge) -> Iterator[Fact]:
    gain = with_unit(signed(f"{gauge.gain_m_per_count * 1e6:.6g}"), "µm/count")
    relative = gauge.gain_relative_standard_uncertainty
    yield Fact("gain", gain)
    yield Fact("its uncertainty", _NOT_STATED if relative is None else with_unit(f"{relative:.2%}"[:-1], "%"))
    yield Fact("zero", with_unit(signed(f"{gauge.zero_count:.9g}"), "counts"))
    if gauge.polynomial:
        yield Fact("polynomial", ", ".join(signed(f"{term:.3g}") for term in gauge.polynomial))
    yield Fact("range", _range(gauge.range_m))
    if gauge.nonlinearity_m is not None:
        yield Fact("non-linearity", with_unit(rounded(gauge.nonlinearity_m * 1e6, 1), "µm"))
    yield Fact("calibrated", gauge.date.isoformat() if gauge.date else _NOT_STATED)
    yield Fact("by", gauge.calibrated_by or _NOT_STATED)
    yield Fact("reference", gauge.reference or _NOT_STATED)
    yield Fact("certificate", gauge.certificate or _NOT_STATED)
    yield Fact("serial number", gauge.serial_number or _NOT_STATED)


def _range(range_m: float | None) -> str:
    return _NOT_STATED if range_m is None else with_unit(f"± {range_m * 1e3:g}", "mm")
