"""The calibrations in use, until when they hold, and how the last checks of the gauges came out."""

import datetime
from collections.abc import Iterator
from typing import Literal

from app.cli.checkup.finding import Finding, fail, ok, warn
from config.files import checks_file, load_checks, load_gauges
from config.schema import ConfigError, Gauge, GaugeCheck

_GAUGES: dict[Literal["table", "relative"], str] = {"table": "gauge 1", "relative": "gauge 2"}
_SOON = datetime.timedelta(days=30)
_REMEDY = "Calibrate the gauge: slipstand calibrate"


def check_gauges() -> Iterator[Finding]:
    """Look at calibrations and checks of both gauges; unreadable settings are told with the folders."""
    try:
        gauges = load_gauges()
    except ConfigError:
        return
    today = datetime.datetime.now().astimezone().date()
    for name, said in _GAUGES.items():
        yield calibration(said, getattr(gauges, name), today)
    try:
        last = {check.gauge: check for check in load_checks().last_of(gauges)}
    except ConfigError as error:
        yield fail("gauge checks", str(error), f"Correct {checks_file()}, or put it aside")
        return
    for name, said in _GAUGES.items():
        yield last_check(said, last.get(name))


def calibration(said: str, gauge: Gauge, today: datetime.date) -> Finding:
    """Tell of what day a calibration is, and until when it holds."""
    subject = f"calibration of {said}"
    of_day = f"of {gauge.date}" if gauge.date else "of no stated day"
    if gauge.valid_until is None:
        return ok(subject, f"{of_day}; no last day is stated")
    held = f"{of_day}, valid until {gauge.valid_until}"
    if gauge.is_expired(today):
        return warn(subject, f"{held}, which is past", _REMEDY)
    if gauge.valid_until - today <= _SOON:
        return warn(subject, f"{held}, in {(gauge.valid_until - today).days} days", _REMEDY)
    return ok(subject, held)


def last_check(said: str, check: GaugeCheck | None) -> Finding:
    """Tell how the last check of the calibration in use came out."""
    subject = f"check of {said}"
    if check is None:
        return ok(subject, "this calibration was not checked yet; see: slipstand calibrate check")
    verdict = "passed" if check.passed else "failed"
    message = (
        f"{verdict} on {check.at:%Y-%m-%d %H:%M}: {check.deviation_m * 1e6:+.0f} um at"
        f" {check.expected_m * 1e3:g} mm, {check.tolerance_m * 1e6:.0f} um allowed"
    )
    return ok(subject, message) if check.passed else warn(subject, message, _REMEDY)
