"""Checks that readings can be those of a shaking stand, so that wrong units are named first."""

import numpy as np

from analysis.damped_cosine import dominant_period
from analysis.formatting import format_length, format_number
from analysis.laws.parameters import FRICTION_MAX, PERIOD_MAX_S, PERIOD_MIN_S, TRAVEL_MAX_M
from analysis.preparation.channels import Channel
from analysis.preparation.release import Release
from analysis.quantities import ResultWarning
from analysis.record import RecordError
from messages.message import message

_LENGTH_MIN_S = 1e-3
_LENGTH_MAX_S = 7200.0
_GAP_MAX_S = 10.0
_SLOW_S = 0.01
"""Readings closer together than this are enough for any stand with a period of 0.1 s or more."""
_READINGS_A_SWING = 10
"""Fewer hide when the table is let go, and how fast it swings."""
_PULLBACK_FACTOR = 3.0
"""Between pullback and that of the series: beyond it is not the operator who pulled otherwise."""


def check_span(table: Channel) -> None:
    """Raise RecordError for readings that span hours or no swing, have a long gap, or travel too far."""
    length_s = float(table.time_s[-1] - table.time_s[0])
    if length_s < _LENGTH_MIN_S:
        raise RecordError(
            "the record spans {length_s:.1g} s, in which no stand swings. Check the unit of its times.",
            length_s=length_s,
        )
    if length_s > _LENGTH_MAX_S:
        raise RecordError(
            "the record spans {length_s} s, a test takes a minute. Check the unit of its times.",
            length_s=format_number(length_s),
        )
    check_gap(table, _GAP_MAX_S)
    travel_m = float(np.ptp(np.quantile(table.value_m, (0.001, 0.999))))
    if travel_m > TRAVEL_MAX_M:
        raise RecordError(
            "gauge 1 moves over {travel_m}, no stand does. Check the unit: are the readings in millimetres?",
            travel_m=format_length(travel_m),
        )


def check_gap(table: Channel, longest_s: float) -> None:
    """Raise RecordError for readings that stay away for more than `longest_s`."""
    steps_s = np.diff(table.time_s)
    widest = int(np.argmax(steps_s))
    if steps_s[widest] > longest_s:
        raise RecordError(
            "gauge 1 has no reading for {gap_s} s after {start_s} s of the record. Take the"
            " stretch before or after that gap.",
            gap_s=format_number(steps_s[widest]),
            start_s=format_number(table.time_s[widest], 6),
        )


def check_rate(table: Channel) -> None:
    """Raise RecordError where a swing has too few readings to tell its release and slips.

    By the strongest oscillation of the steps between readings: a hold has none, and noise hardly any
    beside those of a swing that is read seldom.
    """
    steps_s = np.diff(table.time_s)
    interval_s = float(np.median(steps_s))
    if interval_s <= _SLOW_S:
        return
    period_s = dominant_period(Channel(table.time_s[1:], np.diff(table.value_m)))
    if period_s < _READINGS_A_SWING * interval_s:
        raise RecordError(
            "gauge 1 is read every {interval_s:.3g} s, {readings:.2g} times a swing. Record"
            " {needed} readings a swing at the least, better 100.",
            interval_s=interval_s,
            readings=period_s / interval_s,
            needed=_READINGS_A_SWING,
        )


def estimate_period(table: Channel, release: Release) -> float:
    """Period of the swing after `release` (s), to some per cent.

    Raises
    ------
    RecordError
        The record ends within one and a quarter swings, or no stand has this period.
    """
    swing = table.between(release.time_s, np.inf)
    try:
        period_s = dominant_period(swing)
    except RecordError:
        raise RecordError(
            "the record ends {length_s} s after the release, before the table has swung once and"
            " a quarter. Record for 20 s after the release, or until rest.",
            length_s=format_number(swing.time_s[-1] - release.time_s),
        ) from None
    if not PERIOD_MIN_S <= period_s <= PERIOD_MAX_S:
        raise RecordError(
            "gauge 1 swings with a period of {period_s} s, no stand does ({shortest_s:g} to"
            " {longest_s:g} s). Check the unit of its times: are they seconds?",
            period_s=format_number(period_s),
            shortest_s=PERIOD_MIN_S,
            longest_s=PERIOD_MAX_S,
        )
    return period_s


def pullback_warnings(pullback_m: float, nominal_m: float | None) -> list[ResultWarning]:
    """Whether the pullback is far from that of the series."""
    if nominal_m is None or nominal_m == 0.0:
        return []
    ratio = abs(pullback_m / nominal_m)
    if 1.0 / _PULLBACK_FACTOR < ratio < _PULLBACK_FACTOR:
        return []
    text = message(
        "the table was pulled back by {pullback_m}, the series by {nominal_m}: check the unit of the"
        " readings, the calibration and the series.",
        pullback_m=format_length(abs(pullback_m)),
        nominal_m=format_length(abs(nominal_m)),
    )
    return [ResultWarning("pullback-unlike-series", text)]


def check_friction(friction_dynamic: float) -> None:
    """Raise RecordError for a coefficient that no dry plates have."""
    if friction_dynamic > FRICTION_MAX:
        raise RecordError(
            "the fit gives f_d = {friction_dynamic}, over {largest:g}, which no dry"
            " plates have. Check the units of times and readings, and whether gauge 1 shows"
            " the swing of the table.",
            friction_dynamic=format_number(friction_dynamic, 4),
            largest=FRICTION_MAX,
        )
