"""What gauge 2 measures and which way round, decided from its readings."""

from dataclasses import dataclass

import numpy as np

from analysis.arrays import Floats
from analysis.preparation.channels import Channel
from analysis.preparation.release import local_slopes, median_of_three, white_noise
from analysis.quantities import ResultWarning
from messages.i18n import N_
from messages.message import message

_SURE = 0.1
"""Slope of gauge 2 against gauge 1, once the plate sticks, is -1, 0 or 1 to within this."""
_UNEXPLAINED = 0.02
"""Swing of gauge 2 beyond that slope, as a share of the table's: the plate still slips where it is more."""
_NOISE_SIGMAS = 3.0
_SWINGS = 0.05
"""The swing is followed until it falls below this share of its first."""
_AGAINST = 0.3
"""Correlation of gauge 2's first slips with the table's velocity from which on it is reversed."""
_LINE_READINGS = 10
_MEANS = 60


@dataclass(frozen=True, slots=True)
class Mounting:
    """How gauge 2 is mounted.

    Attributes
    ----------
    absolute : bool
        It measures the plate against the base.
    sign : int
        What makes its readings positive where the plate lies ahead.
    warnings : tuple of ResultWarning
        Where that is not as the record says.
    """

    measures_plate: bool
    sign: int
    warnings: tuple[ResultWarning, ...] = ()


def relative_to_table(table: Channel, relative: Channel, measures_plate: bool) -> Channel:
    """Displacement of the plate against the table."""
    if not measures_plate:
        return relative
    return Channel(
        relative.time_s, relative.value_m - np.interp(relative.time_s, table.time_s, table.value_m)
    )


def detect_mounting(
    table: Channel, relative: Channel, release_s: float, period_s: float, measures_plate: bool
) -> Mounting:
    """Decide how gauge 2 is mounted; it is said to measure the plate against the base if `absolute`.

    Once the plate sticks, gauge 2 stands still, or follows the table, or mirrors it.
    """
    slope = _slope_on_table(table, relative, release_s, period_s)
    if slope:
        return _against_base(slope, measures_plate)
    if slope is None and measures_plate:
        return Mounting(True, 1)
    warnings = (_warning("gauge-2-relative"),) if measures_plate else ()
    if not _leads(table, relative, release_s, period_s):
        return Mounting(False, 1, warnings)
    return Mounting(False, -1, (*warnings, _warning("gauge-2-reversed")))


def _against_base(sign: int, absolute: bool) -> Mounting:
    warnings = () if absolute else (_warning("gauge-2-absolute"),)
    return Mounting(True, sign, warnings if sign > 0 else (*warnings, _warning("gauge-2-reversed")))


def _slope_on_table(table: Channel, relative: Channel, release_s: float, period_s: float) -> int | None:
    """Slope -1, 0 or 1 of gauge 2 on gauge 1 late in the swing; None where the plate slips until then.

    A plate with very little friction stays where it is while it slips, and gauge 2 mirrors the table
    nearly as well: so the slope must be exact, over a period at least.
    """
    away = np.abs(table.value_m - np.median(table.value_m[-len(table) // 3 :]))
    end_s = float(table.time_s[np.flatnonzero(away >= _SWINGS * away.max())[-1]])
    late = relative.between(end_s - (end_s - release_s) / 3.0, end_s)
    if len(late) < _LINE_READINGS or late.time_s[-1] - late.time_s[0] < period_s:
        return None
    u1 = np.interp(late.time_s, table.time_s, table.value_m)
    t = late.time_s - late.time_s.mean()
    columns = np.column_stack((u1 - u1.mean(), np.ones(len(t)), t))
    found = np.linalg.lstsq(columns, late.value_m, rcond=None)[0]
    count = max(1, len(t) // _MEANS)
    left = _means(late.value_m - columns @ found, count)
    noise = np.hypot(white_noise(table), white_noise(relative)) / np.sqrt(count)
    slope = round(float(found[0]))
    clear = abs(slope) <= 1 and abs(found[0] - slope) < _SURE
    return slope if clear and left.std() < _UNEXPLAINED * u1.std() + _NOISE_SIGMAS * noise else None


def _means(x: Floats, count: int) -> Floats:
    """Means of `count` neighbours each, so that noise does not pass for motion."""
    return np.asarray(x[: len(x) // count * count].reshape(-1, count).mean(axis=1))


def _leads(table: Channel, relative: Channel, release_s: float, period_s: float) -> bool:
    """Whether gauge 2 moves with the table in the first slips, where the plate lags behind it.

    False, too, where it has no readings in them that would tell.
    """
    slip = median_of_three(relative.between(release_s, release_s + 3.0 * period_s))
    if len(slip) < _LINE_READINGS:
        return False
    v1 = np.interp(slip.time_s, table.time_s, local_slopes(table, period_s / 24.0))
    w = local_slopes(slip, period_s / 24.0)
    return float(w @ v1) > _AGAINST * float(np.sqrt((w @ w) * (v1 @ v1)))


def _warning(code: str) -> ResultWarning:
    return ResultWarning(code, message(_MOUNTINGS[code]))


_MOUNTINGS = {
    "gauge-2-absolute": N_(
        "gauge 2 swings with the table after slip: it is taken as measuring the plate against the base."
    ),
    "gauge-2-relative": N_(
        "gauge 2 is said to measure the plate against the base, but does not swing with the table after"
        " slip: it is taken as measuring the plate against the table."
    ),
    "gauge-2-reversed": N_(
        "gauge 2 moves against the plate: it is mounted the other way, and taken as reversed."
    ),
}
