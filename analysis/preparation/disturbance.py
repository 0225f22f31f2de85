"""End of a free decay before that of the record: a hand that moves the plate or stops the table."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from analysis.arrays import Floats
from analysis.identification import Curves, Identification
from analysis.preparation.channels import Channel
from analysis.preparation.oscillation import quarter_steps
from analysis.record import Record

_REST_PERIODS = 2.0
"""A plate at rest for so long never slips again: it would have done so in one of these swings."""
_MOVED = 0.05  # share of the travel of gauge 2 that a plate put back moves by at the least
_MOVED_SIGMAS = 10.0
_LOSS_FACTOR = 3.0  # no damping makes a swing lose more as it becomes smaller
_LOSS_SIGMAS = 12.0  # the range of a period's readings scatters by some standard deviations of the noise
_ONSET = 2  # periods over which a hand takes hold
_SWINGS_MIN = 4


def find_moved_plate(relative: Channel, release_s: float, period_s: float, noise_m: float) -> float | None:
    """Time before which a plate at rest was not yet moved again, or None.

    `relative` is the plate against the table.
    """
    quarters = quarter_steps(relative, release_s, period_s, noise_m)
    if quarters is None:
        return None
    ends, moved = quarters
    places = np.concatenate(([0], np.flatnonzero(moved) + 1))
    for before, after in pairwise(places.tolist()):
        rest_s = float(ends[after - 1] - ends[before])
        if rest_s < (_REST_PERIODS + 1.0) * period_s:
            continue
        end_s = float(ends[after]) - period_s  # a hand begins slowly
        rest = relative.between(float(ends[before]), end_s)
        later = relative.between(float(ends[after]), np.inf)
        shift_m = abs(float(np.median(later.value_m)) - float(np.median(rest.value_m)))
        if shift_m > max(_MOVED * float(np.ptp(relative.value_m)), _MOVED_SIGMAS * noise_m):
            return end_s
    return None


def find_stopped_table(tail: Channel, period_s: float, noise_m: float) -> float | None:
    """Time before which a table that swings freely was not yet stopped, or None.

    `tail` is gauge 1 without slip. A swing that decays freely loses less and less from period to period.
    """
    if not len(tail) or tail.time_s[-1] - tail.time_s[0] > len(tail) * period_s:
        return None  # less than one reading a period: the clock jumped
    edges = np.arange(tail.time_s[0], tail.time_s[-1], period_s)
    periods = [tail.between(first, first + period_s).value_m for first in edges[:-1]]
    if len(periods) < _SWINGS_MIN or min(len(values) for values in periods) < _SWINGS_MIN:
        return None
    swings = np.array([np.ptp(values) for values in periods])
    losses = -np.diff(swings)
    for place in range(_SWINGS_MIN, len(losses)):
        usual = float(np.abs(losses[: place - _ONSET]).max())
        stays_small = swings[place + 1 :].max() < swings[place] - 0.5 * losses[place]
        if losses[place] > _LOSS_FACTOR * usual + _LOSS_SIGMAS * noise_m and stays_small:
            return float(edges[place - _ONSET])
    return None


_DEPARTS = 6.0
"""Median residual in a quarter period, over those before, of a motion that is not the one foreseen."""
_FORESEEN_PERIODS = 2.0
"""So long a law foresees the motion that is right about it; a wrong one fails where its fit ends."""
_SUDDEN_PERIODS, _SUDDEN = 2.0, 0.05
"""Within so many periods a hand moves table or plate by this share of all that their gauge reads."""
_STEP_RATIO = 2.0  # between the sampling intervals before and after: a clock that changes is no hand


@dataclass(frozen=True, slots=True)
class Departure:
    """Where a motion departs from the one that a fit to its beginning foresees."""

    time_s: float  # record time, half a period early: a hand begins slowly
    is_foreseen_before: bool
    is_sudden: bool


def find_departure(record: Record, explained: Identification, until_s: float) -> Departure | None:
    """First departure from what a fit to all readings until `until_s` foresees; None where there is none."""
    model, period, foreseen = explained.model, explained.results.get("period_s"), explained.curves
    if model is None or period is None or foreseen is None:
        return None
    time_s, period_s = record.time_s, period.value
    curves = foreseen(time_s)
    pairs = _both(record, curves)
    residuals = [readings - curve for readings, curve in pairs]
    bounds = np.searchsorted(time_s, np.arange(until_s, float(time_s[-1]), 0.25 * period_s))
    limit_m = _DEPARTS * model.residual_rms_m
    for first, last in pairwise(bounds.tolist()):
        if any(_size(residual[first:last], 0.5) > limit_m for residual in residuals):
            break
    else:
        return None
    departs_s = float(time_s[first])
    soon = slice(first, int(np.searchsorted(time_s, departs_s + _SUDDEN_PERIODS * period_s)))
    moved = [
        _size(residual[soon], 0.9) / max(float(np.nanmax(readings) - np.nanmin(readings)), 1e-300)
        for residual, (readings, _) in zip(residuals, pairs, strict=True)
    ]
    steps_s = np.diff(time_s)
    step_ratio = float(np.median(steps_s[first:]) / np.median(steps_s[:first]))
    is_steady = 1.0 / _STEP_RATIO < step_ratio < _STEP_RATIO
    return Departure(
        max(until_s, departs_s - 0.5 * period_s),
        departs_s > until_s + _FORESEEN_PERIODS * period_s,
        is_steady and max(moved) > _SUDDEN,
    )


def _both(record: Record, curves: Curves) -> list[tuple[Floats, Floats]]:
    """Readings of both gauges with what they are foreseen to read; without a gauge 2 of gauge 1."""
    pairs = [(record.table_displacement_m, curves.table_displacement_m)]
    if record.relative_displacement_m is None or curves.relative_displacement_m is None:
        return pairs
    return [*pairs, (record.relative_displacement_m, curves.relative_displacement_m)]


def _size(residual_m: Floats, share: float) -> float:
    """Size that this share of the residuals stays below; 0 where there are no readings."""
    present = np.abs(residual_m[np.isfinite(residual_m)])
    return float(np.quantile(present, share)) if len(present) else 0.0
