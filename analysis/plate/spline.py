"""Least squares of the plate's displacement: a parabola in each slip, joined at reversals.

At a reversal without a stick u2 is continuous. What happens while friction changes sign (presliding, a peak
of friction at low speed, a filter) is left out with the edges. It leaves an unknown jump of velocity, which
absorbs the unknown time of the reversal too, and a jump of position that is alike at all reversals:
the second moment of the transition.
"""

import math
from dataclasses import dataclass

import numpy as np

from analysis.arrays import Floats, Indices
from analysis.plate.slips import Sliding, Slip, slope_half_window_s
from analysis.preparation.free_decay import FreeDecay
from analysis.preparation.oscillation import local_slopes
from analysis.record import GAIN_NOT_STATED, Record

_LAG_PRIOR_S = 0.02  # standard uncertainty of the gauges' difference in lag where none is stated
_LAG_STATED_MIN_S = 1e-5
_GAIN_STATED_MIN = 1e-6
_MODEL_ERROR_M = 3e-7  # of times of reversals and smoothed readings: what computed records without noise show
_TRANSITION_SHARE = 0.4  # of the edges: standard uncertainty of the time that friction takes at a reversal
_JUMP_SIGMAS = 3.0
"""From which on the plate must have stuck at a reversal, for milliseconds that its velocity does not show."""
_ROUNDING = 1e-12  # share of a diagonal element below which rounding decides
_VARIATION_PRIOR = 1.0  # of friction over the range of a covariate: nothing is known

LAG, GAIN, MOMENT = range(3)
SHARED_COUNT = 3
"""Parameters that all slips share: lag of gauge 2, its relative gain, second moment of transitions."""


@dataclass(frozen=True, eq=False, slots=True)
class Covariate:
    """What friction may vary with: value over its range at all readings, and its two integrals."""

    scaled: Floats
    once: Floats
    twice: Floats

    @classmethod
    def of(cls, time_s: Floats, value: Floats, weight: Floats) -> tuple["Covariate", float]:
        """Covariate without its mean over `weight`; the range comes with it."""
        extent = max(float(np.ptp(value)), 1e-12)
        scaled = (value - float(np.average(value, weights=weight))) / extent
        once = _integral(time_s, scaled)
        return cls(scaled, once, _integral(time_s, once)), extent


def _integral(time_s: Floats, value: Floats) -> Floats:
    return np.concatenate(([0.0], np.cumsum(0.5 * (value[1:] + value[:-1]) * np.diff(time_s))))


@dataclass(frozen=True, eq=False, slots=True)
class Readings:
    """Both gauges at the times of gauge 2."""

    time_s: Floats
    relative_m: Floats
    relative_travel_m: Floats
    """Smoothed, from the first reading on: as a column of the fit, readings would correlate with their own
    noise in u2."""
    nearest_m: Floats  # gauge 1 at its nearest reading, so that noise stays white, ...
    nearest_s: Floats  # ... and when that was
    table_s: Floats
    table_travel_m: Floats  # smoothed, at `table_s`
    table_speed: Floats
    noise_m: float  # of u2
    gravity: float
    lag_prior_s: float
    gain_prior: float
    lag_is_stated: bool
    follows_lag: bool  # False where gauge 2 measures u2 itself

    @classmethod
    def of(cls, record: Record, decay: FreeDecay, sliding: Sliding) -> "Readings":
        table, relative = decay.table, sliding.relative
        speed = local_slopes(table, slope_half_window_s(decay))
        nearest = np.searchsorted(0.5 * (table.time_s[1:] + table.time_s[:-1]), relative.time_s)
        return cls(
            relative.time_s,
            relative.value_m,
            _integral(relative.time_s, sliding.speed_m_per_s),
            table.value_m[nearest],
            table.time_s[nearest],
            table.time_s,
            _integral(table.time_s, speed),
            speed,
            math.hypot(_MODEL_ERROR_M, *(decay.noise_m[1:] if decay.gauge_2_absolute else decay.noise_m)),
            record.masses.gravity_m_per_s2,
            _lag_prior_s(record),
            _gain_prior(record),
            _lag_prior_s(record) != _LAG_PRIOR_S,
            not decay.gauge_2_absolute,
        )

    def table_at(self, readings: Indices, lag_s: float) -> tuple[Floats, Floats]:
        """Displacement and velocity of the table at readings of a gauge 2 that is late by `lag_s`."""
        true_s = self.time_s[readings] - lag_s
        travel = np.interp(true_s, self.table_s, self.table_travel_m)
        travel -= np.interp(self.nearest_s[readings], self.table_s, self.table_travel_m)
        return self.nearest_m[readings] + travel, np.interp(true_s, self.table_s, self.table_speed)


def _lag_prior_s(record: Record) -> float:
    gauges = record.table_gauge, record.relative_gauge
    if not any(gauge.lateness_s or gauge.lateness_s_uncertainty for gauge in gauges):
        return _LAG_PRIOR_S
    return max(_LAG_STATED_MIN_S, math.hypot(*(gauge.lateness_s_uncertainty for gauge in gauges)))


def _gain_prior(record: Record) -> float:
    stated = [gauge.gain_relative for gauge in (record.table_gauge, record.relative_gauge)]
    return math.hypot(*(GAIN_NOT_STATED if gain is None else max(gain, _GAIN_STATED_MIN) for gain in stated))


@dataclass(frozen=True, eq=False, slots=True)
class NormalEquations:
    """Least squares of friction of slips, times sign, less tilt (k,), shared parameters, and covariates."""

    matrix: Floats
    right: Floats
    squares: float  # chi-square where all of them are zero
    reading_count: int
    eliminated: int  # number of lines and reversals
    sticks: tuple[int, ...]
    """Numbers of slips that join the one before them against the readings, the clearest first."""


def normal_equations(
    readings: Readings, slips: list[Slip], covariates: list[Covariate], lag_s: float, edge_s: float
) -> NormalEquations:
    """Fit -u2''/g of each slip (k,), `SHARED_COUNT` parameters, and the part of each covariate (c,).

    Lines and times of reversals are eliminated. The lag is what is left beyond `lag_s`.
    """
    k, c = len(slips), len(covariates)
    shared_at, covariates_at, lines_at = k, k + SHARED_COUNT, k + SHARED_COUNT + c
    reversals_at = lines_at + 2 * sum(not slip.joins for slip in slips)
    reversal_count = sum(slip.joins for slip in slips)
    jumps_at = reversals_at + reversal_count
    size = jumps_at + reversal_count
    normal, right = np.zeros((size, size)), np.zeros(size)
    parts = [_columns(readings, slip, covariates, lag_s) for slip in slips]
    g = readings.gravity
    rough = [np.linalg.lstsq(columns[:, :3], values, rcond=None)[0][2] / g for columns, values in parts]
    change = 2.0 * g * float(np.median(np.abs(rough)))  # of u2'' at a reversal
    position, velocity, offset = np.zeros(size), np.zeros(size), 0.0
    squares, line, reversal = 0.0, lines_at, reversals_at
    for number, (slip, (columns, values)) in enumerate(zip(slips, parts, strict=True)):
        if slip.joins:
            velocity[reversal] = 1.0
            position[reversal + reversal_count] = 1.0
            position[shared_at + MOMENT] += slip.sign * change
            reversal += 1
        else:
            position, velocity, offset = np.zeros(size), np.zeros(size), float(values.mean())
            position[line], velocity[line + 1] = 1.0, 1.0
            line += 2
        places = np.zeros((5 + c, size))
        places[0], places[1], places[2, number] = position, velocity, 1.0
        places[3, shared_at + LAG] = places[4, shared_at + GAIN] = 1.0
        places[range(5, 5 + c), range(covariates_at, lines_at)] = 1.0
        weighted = columns.T / readings.noise_m**2
        normal += places.T @ (weighted @ columns) @ places
        right += places.T @ (weighted @ (values - offset))
        squares += float((values - offset) @ (values - offset)) / readings.noise_m**2
        length_s = slip.end_s - slip.begin_s
        position, velocity = position + velocity * length_s, velocity.copy()
        position[number] -= 0.5 * g * length_s**2
        velocity[number] -= g * length_s
        for place, covariate in enumerate(covariates, start=covariates_at):
            once, twice = _integrals(readings.time_s, slip, covariate, np.array([slip.end_s]))
            position[place] -= g * slip.sign * float(twice[0])
            velocity[place] -= g * slip.sign * float(once[0])
    prior = np.full(covariates_at + c, np.inf)
    prior[shared_at:covariates_at] = (
        readings.lag_prior_s,
        readings.gain_prior,
        (_TRANSITION_SHARE * edge_s) ** 2,
    )
    prior[covariates_at:] = _VARIATION_PRIOR
    normal[range(lines_at), range(lines_at)] += prior**-2
    kept, lines = slice(0, lines_at), slice(lines_at, jumps_at)
    own = inverse(normal[lines, lines])
    taken = normal[kept, lines] @ own
    joined = [number for number, slip in enumerate(slips) if slip.joins]
    return NormalEquations(
        normal[kept, kept] - taken @ normal[lines, kept],
        right[kept] - taken @ right[lines],
        squares - float(right[lines] @ own @ right[lines]),
        sum(len(values) for _, values in parts),
        jumps_at - lines_at,
        tuple(joined[jump] for jump in _significant_jumps(normal, right, jumps_at)),
    )


def inverse(matrix: Floats) -> Floats:
    """Inverse of positive matrices (..., n, n) whose rows differ in unit."""
    size = 1.0 / np.sqrt(np.diagonal(matrix, axis1=-2, axis2=-1))
    scale = size[..., None] * size[..., None, :]
    return np.asarray(np.linalg.inv(matrix * scale) * scale)


def _significant_jumps(normal: Floats, right: Floats, jumps_at: int) -> list[int]:
    """Jumps of position, the parameters from `jumps_at` on, without which the readings contradict."""
    used, others = np.arange(jumps_at), np.arange(jumps_at, len(right))
    while len(others):
        cross = normal[np.ix_(others, used)]
        taken = cross @ inverse(normal[np.ix_(used, used)])
        diagonal = np.diag(normal)[others]
        left = np.maximum(diagonal - np.einsum("ij,ij->i", taken, cross), _ROUNDING * diagonal)
        score = np.abs(right[others] - taken @ right[used]) / np.sqrt(left)
        worst = int(np.argmax(score))
        if score[worst] < _JUMP_SIGMAS:
            break
        used, others = np.append(used, others[worst]), np.delete(others, worst)
    return [int(place) - jumps_at for place in used[jumps_at:]]


def _columns(
    readings: Readings, slip: Slip, covariates: list[Covariate], lag_s: float
) -> tuple[Floats, Floats]:
    """Columns of position, velocity, friction, lag, gain and covariates within a slip, and u2 there."""
    time_s, relative = readings.time_s[slip.readings], readings.relative_m[slip.readings]
    tau = time_s - slip.begin_s
    u1, v1 = readings.table_at(slip.readings, lag_s)
    g = readings.gravity
    varying = [
        -g * slip.sign * _integrals(readings.time_s, slip, covariate, time_s)[1] for covariate in covariates
    ]
    lag = v1 if readings.follows_lag else np.zeros(len(tau))
    u1 = u1 if readings.follows_lag else readings.table_at(slip.readings, 0.0)[0]
    gain = readings.relative_travel_m[slip.readings]
    columns = (np.ones(len(tau)), tau, -0.5 * g * tau**2, lag, gain, *varying)
    return np.column_stack(columns), u1 + relative


def _integrals(time_s: Floats, slip: Slip, covariate: Covariate, at_s: Floats) -> tuple[Floats, Floats]:
    """First and second integral of a covariate from the begin of a slip."""
    first = float(np.interp(slip.begin_s, time_s, covariate.once))
    second = float(np.interp(slip.begin_s, time_s, covariate.twice))
    once = np.interp(at_s, time_s, covariate.once) - first
    return once, np.interp(at_s, time_s, covariate.twice) - second - first * (at_s - slip.begin_s)
