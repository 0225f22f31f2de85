"""The fitting problem of a record, and start values from what can be read off it."""

import numpy as np

from analysis.arrays import Floats
from analysis.fitting.late_start import EARLIEST_PERIODS
from analysis.fitting.models import ALWAYS_FREE, PARAMETERS, STRIBECK_VELOCITY_M_PER_S, Model, Place
from analysis.fitting.parabolas import PlatePath, fit_plate_path
from analysis.fitting.problem import Problem, allowed
from analysis.readings.channels import Channel
from analysis.readings.gauge_2 import against_table
from analysis.readings.preparation import FreeDecay
from analysis.record import GaugeUncertainty, Record

_TAIL_TRUST = 5.0
"""First estimates' uncertainties are widened so much when they guide the first steps."""
_FRICTION_GUESS = 0.1
_SHARES = (0.08, 0.15, 0.25, 0.4, 0.6, 0.8, 0.93)
"""f_d over the largest that lets the plate slip at all."""


def problem_of(record: Record, decay: FreeDecay) -> Problem:
    """Readings and noise of `decay` with what `record` knows of masses and gauges."""
    return problem_with(
        record, (decay.table, decay.relative), decay.noise_m, decay.period_s, absolute=decay.absolute
    )


def problem_with(
    record: Record,
    channels: tuple[Channel, Channel | None],
    noise_m: tuple[float, float],
    period_s: float,
    *,
    absolute: bool,
) -> Problem:
    """Readings of both gauges, turned so that the pullback is positive, with what `record` knows beside."""
    table, relative = channels
    mean, deviation = np.zeros(PARAMETERS), np.zeros(PARAMETERS)
    deviation[[*ALWAYS_FREE, Place.FRICTION_STATIC, Place.TILT, Place.STRIBECK_VELOCITY]] = np.inf
    masses = record.masses
    mean[Place.TABLE_MASS], deviation[Place.TABLE_MASS] = (
        masses.table_mass_kg,
        masses.table_mass_uncertainty_kg,
    )
    mean[Place.PLATE_MASS], deviation[Place.PLATE_MASS] = (
        masses.plate_mass_kg,
        masses.plate_mass_uncertainty_kg,
    )
    mean[Place.GRAVITY] = masses.gravity_m_per_s2
    mean[Place.STRIBECK_VELOCITY] = STRIBECK_VELOCITY_M_PER_S
    deviation[Place.TABLE_GAIN] = gain_deviation(record.table_gauge, span_m(table.value_m))
    if relative is not None:
        deviation[Place.RELATIVE_GAIN] = gain_deviation(record.relative_gauge, span_m(relative.value_m))
        delays = record.table_gauge.delay_s_uncertainty, record.relative_gauge.delay_s_uncertainty
        deviation[Place.LAG] = float(np.hypot(*delays))
    earliest_s = float(table.time_s[0]) - 2.0 * EARLIEST_PERIODS * period_s
    return Problem(table, relative, noise_m, mean, deviation, absolute, earliest_s)


def gain_deviation(gauge: GaugeUncertainty, span: float) -> float:
    """Relative standard uncertainty of a gauge's slope over `span` (m): gain and non-linearity together."""
    return float(np.hypot(gauge.gain_relative or 0.0, nonlinearity_share(gauge, span)))


def nonlinearity_share(gauge: GaugeUncertainty, span: float) -> float:
    """Relative error of slope over half of `span` (m) that a rectangular non-linearity amounts to."""
    return gauge.nonlinearity_m / float(np.sqrt(3.0)) / max(0.5 * span, 1e-9)


def span_m(value_m: Floats) -> float:
    """Range of readings (m)."""
    return float(np.ptp(value_m))


def start_of(problem: Problem, decay: FreeDecay) -> tuple[Floats, Problem]:
    """Parameters near the truth without a guess, from tail, hold and the plate's parabolas.

    Returns
    -------
    (16,) float64
    Problem
        `problem` with what those three know as prior knowledge.
    """
    start = problem.prior_mean.copy()
    _take_tail(start, decay)
    _take_hold(start, decay)
    path = plate_path(decay, float(start[Place.GRAVITY]))
    start[Place.FRICTION_DYNAMIC] = _FRICTION_GUESS if path is None else max(path.friction, 0.01)
    start[Place.TILT] = 0.0 if path is None else path.tilt_rad
    start = allowed(start, Model.COULOMB_TILT)
    return start, _guided(problem, start, decay, path)


def first_points(start: Floats, decay: FreeDecay) -> list[Floats]:
    """Points to refine on the first slip: `start`, or without gauge 2 every f_d that lets the plate slip."""
    if decay.relative is not None:
        return [start]
    mass = start[Place.TABLE_MASS] + start[Place.PLATE_MASS]
    demand = start[Place.STIFFNESS] / mass * start[Place.PULLBACK] / start[Place.GRAVITY]
    points = np.tile(start, (len(_SHARES), 1))
    points[:, Place.FRICTION_DYNAMIC] = points[:, Place.FRICTION_STATIC] = np.array(_SHARES) * demand
    return list(points)


def plate_path(decay: FreeDecay, gravity_m_per_s2: float) -> PlatePath | None:
    """Friction and tilt from the plate's parabolas, where gauge 2 shows slip."""
    if decay.relative is None:
        return None
    end = np.inf if decay.slip_end_s is None else decay.slip_end_s
    slip = against_table(decay.table, decay.relative, decay.absolute).between(decay.release.time_s, end)
    return fit_plate_path(
        decay.table.between(decay.release.time_s, end), slip, decay.period_s, gravity_m_per_s2
    )


def _take_tail(start: Floats, decay: FreeDecay) -> None:
    mass = start[Place.TABLE_MASS] + start[Place.PLATE_MASS]
    n = 0.1 if decay.tail is None else decay.tail.damping_per_s
    start[Place.STIFFNESS] = ((2.0 * np.pi / decay.period_s) ** 2 + n * n) * mass
    start[Place.DAMPING] = max(2.0 * n * mass, 0.0)
    moving = decay.table.between(decay.release.time_s, np.inf).value_m
    start[Place.TABLE_OFFSET] = float(np.median(moving)) if decay.tail is None else decay.tail.offset_m


def _take_hold(start: Floats, decay: FreeDecay) -> None:
    start[Place.RELEASE] = decay.release.time_s
    level = decay.release.level_m
    if decay.plateau is not None:
        level = float(decay.table.between(*decay.plateau).value_m.mean())
    start[Place.PULLBACK] = level - start[Place.TABLE_OFFSET]
    if decay.relative is None:
        return
    until = decay.hold_end_s if decay.plateau is not None else decay.release.time_s + 0.01
    held = decay.relative.between(-np.inf, until).value_m
    zero = float(held.mean()) if len(held) else float(decay.relative.value_m[0])
    start[Place.RELATIVE_OFFSET] = zero - (start[Place.PULLBACK] if decay.absolute else 0.0)


def _guided(problem: Problem, start: Floats, decay: FreeDecay, path: PlatePath | None) -> Problem:
    """The problem of the first periods, with tail, hold and parabolas as prior knowledge."""
    trusts = []
    if path is not None:
        errors = np.sqrt(np.diag(path.covariance) * max(1.0, path.misfit))
        trusts += [(Place.FRICTION_DYNAMIC, errors[0] + 1e-3), (Place.TILT, errors[1] + 1e-4)]
    if decay.tail is not None:
        mass = float(start[Place.TABLE_MASS] + start[Place.PLATE_MASS])
        stiffness = 2.0 * decay.tail.period_uncertainty_s / decay.tail.period_s + 1e-4
        trusts += [
            (Place.STIFFNESS, stiffness * float(start[Place.STIFFNESS])),
            (
                Place.DAMPING,
                2.0 * mass * decay.tail.damping_uncertainty_per_s + 1e-2 * float(start[Place.DAMPING]),
            ),
            (Place.TABLE_OFFSET, decay.noise_m[0]),
        ]
    if decay.plateau is not None:
        trusts.append((Place.RELATIVE_OFFSET, decay.noise_m[1]))
    for place, deviation in trusts:
        problem = problem.knowing(place, float(start[place]), _TAIL_TRUST * deviation + 1e-9)
    return problem
