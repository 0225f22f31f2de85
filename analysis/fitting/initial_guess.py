"""The fitting problem of a record, and start values from what can be read off it."""

import numpy as np

from analysis.arrays import Floats
from analysis.fitting.plate_path import PlatePathEstimate, estimate_from_plate_path
from analysis.fitting.problem import FitProblem, project_to_bounds
from analysis.laws.catalogue import FIRST_SLIP_LAW, WIDEST_LAW, default_point
from analysis.laws.parameters import SHARED_PARAMETER_COUNT, Parameter
from analysis.laws.stand import IDEAL_STAND
from analysis.preparation.channels import Channel
from analysis.preparation.free_decay import FreeDecay
from analysis.preparation.mounting import relative_to_table
from analysis.record import GaugeUncertainty, Record

_UNKNOWN = (
    Parameter.FRICTION_DYNAMIC,
    Parameter.FRICTION_STATIC,
    Parameter.TILT,
    *(place for part in IDEAL_STAND for place in part.free),
)
_TAIL_TRUST = 5.0
"""First estimates' uncertainties are widened so much when they guide the first steps."""
_FRICTION_GUESS = 0.1
_SHARES = (0.08, 0.15, 0.25, 0.4, 0.6, 0.8, 0.93)
"""f_d over the largest that lets the plate slip at all."""


def build_problem(record: Record, decay: FreeDecay) -> FitProblem:
    """Readings and noise of `decay` with what `record` knows of masses and gauges."""
    return build_problem_from_channels(
        record, (decay.table, decay.relative), decay.noise_m, decay.period_s, absolute=decay.gauge_2_absolute
    )


def build_problem_from_channels(
    record: Record,
    channels: tuple[Channel, Channel | None],
    noise_m: tuple[float, float],
    period_s: float,
    *,
    absolute: bool,
) -> FitProblem:
    """Readings of both gauges, turned so that the pullback is positive, with what `record` knows beside."""
    table, relative = channels
    mean = default_point()
    deviation = np.zeros(len(mean))
    deviation[[*_UNKNOWN, *range(SHARED_PARAMETER_COUNT, len(mean))]] = np.inf
    masses = record.masses
    mean[Parameter.TABLE_MASS], deviation[Parameter.TABLE_MASS] = (
        masses.table_mass_kg,
        masses.table_mass_uncertainty_kg,
    )
    mean[Parameter.PLATE_MASS], deviation[Parameter.PLATE_MASS] = (
        masses.plate_mass_kg,
        masses.plate_mass_uncertainty_kg,
    )
    mean[Parameter.GRAVITY] = masses.gravity_m_per_s2
    deviation[Parameter.TABLE_GAIN] = gain_uncertainty(record.table_gauge, range_m(table.value_m))
    if relative is not None:
        deviation[Parameter.RELATIVE_GAIN] = gain_uncertainty(
            record.relative_gauge, range_m(relative.value_m)
        )
        delays = record.table_gauge.delay_s_uncertainty, record.relative_gauge.delay_s_uncertainty
        deviation[Parameter.LAG] = float(np.hypot(*delays))
    earliest_s = float(table.time_s[0]) - 2.0 * EARLIEST_PERIODS * period_s
    return FitProblem(table, relative, noise_m, mean, deviation, absolute, earliest_s)


def gain_uncertainty(gauge: GaugeUncertainty, span: float) -> float:
    """Relative standard uncertainty of a gauge's slope over `span` (m): gain and non-linearity together."""
    return float(np.hypot(gauge.gain_relative or 0.0, nonlinearity_slope_error(gauge, span)))


def nonlinearity_slope_error(gauge: GaugeUncertainty, span: float) -> float:
    """Relative error of slope over half of `span` (m) that a rectangular non-linearity amounts to."""
    return gauge.nonlinearity_m / float(np.sqrt(3.0)) / max(0.5 * span, 1e-9)


def range_m(value_m: Floats) -> float:
    """Range of readings (m)."""
    return float(np.ptp(value_m))


def initial_guess(problem: FitProblem, decay: FreeDecay) -> tuple[Floats, FitProblem]:
    """Parameters near the truth without a guess, from tail, hold and the plate's parabolas.

    Returns
    -------
    (16,) float64
    Problem
        `problem` with what those three know as prior knowledge.
    """
    start = problem.prior_mean.copy()
    _set_from_tail(start, decay)
    _set_from_plateau(start, decay)
    path = estimate_plate_path(decay, float(start[Parameter.GRAVITY]))
    start[Parameter.FRICTION_DYNAMIC] = _FRICTION_GUESS if path is None else max(path.friction, 0.01)
    start[Parameter.TILT] = 0.0 if path is None else path.tilt_rad
    start = project_to_bounds(start, FIRST_SLIP_LAW)
    return start, _with_estimates_as_priors(problem, start, decay, path)


def initial_points(start: Floats, decay: FreeDecay) -> list[Floats]:
    """Points to refine on the first slip: `start`, or without gauge 2 every f_d that lets the plate slip."""
    if decay.relative is not None:
        return [start]
    mass = start[Parameter.TABLE_MASS] + start[Parameter.PLATE_MASS]
    demand = start[Parameter.STIFFNESS] / mass * start[Parameter.PULLBACK] / start[Parameter.GRAVITY]
    points = np.tile(start, (len(_SHARES), 1))
    points[:, Parameter.FRICTION_DYNAMIC] = points[:, Parameter.FRICTION_STATIC] = np.array(_SHARES) * demand
    return list(points)


def estimate_plate_path(decay: FreeDecay, gravity_m_per_s2: float) -> PlatePathEstimate | None:
    """Friction and tilt from the plate's parabolas, where gauge 2 shows slip."""
    if decay.relative is None:
        return None
    end = np.inf if decay.slip_end_s is None else decay.slip_end_s
    slip = relative_to_table(decay.table, decay.relative, decay.gauge_2_absolute).between(
        decay.release.time_s, end
    )
    return estimate_from_plate_path(
        decay.table.between(decay.release.time_s, end), slip, decay.period_s, gravity_m_per_s2
    )


def _set_from_tail(start: Floats, decay: FreeDecay) -> None:
    mass = start[Parameter.TABLE_MASS] + start[Parameter.PLATE_MASS]
    n = 0.1 if decay.tail is None else decay.tail.damping_per_s
    start[Parameter.STIFFNESS] = ((2.0 * np.pi / decay.period_s) ** 2 + n * n) * mass
    start[Parameter.DAMPING] = max(2.0 * n * mass, 0.0)
    moving = decay.table.between(decay.release.time_s, np.inf).value_m
    start[Parameter.TABLE_OFFSET] = float(np.median(moving)) if decay.tail is None else decay.tail.offset_m


def _set_from_plateau(start: Floats, decay: FreeDecay) -> None:
    start[Parameter.RELEASE] = decay.release.time_s
    level = decay.release.level_m
    if decay.plateau is not None:
        level = float(decay.table.between(*decay.plateau).value_m.mean())
    start[Parameter.PULLBACK] = level - start[Parameter.TABLE_OFFSET]
    if decay.relative is None:
        return
    until = decay.hold_end_s if decay.plateau is not None else decay.release.time_s + 0.01
    held = decay.relative.between(-np.inf, until).value_m
    zero = float(held.mean()) if len(held) else float(decay.relative.value_m[0])
    start[Parameter.RELATIVE_OFFSET] = zero - (start[Parameter.PULLBACK] if decay.gauge_2_absolute else 0.0)


def _with_estimates_as_priors(
    problem: FitProblem, start: Floats, decay: FreeDecay, path: PlatePathEstimate | None
) -> FitProblem:
    """The problem of the first periods, with tail, hold and parabolas as prior knowledge."""
    trusts = []
    if path is not None:
        errors = np.sqrt(np.diag(path.covariance) * max(1.0, path.misfit))
        trusts += [(Parameter.FRICTION_DYNAMIC, errors[0] + 1e-3), (Parameter.TILT, errors[1] + 1e-4)]
    if decay.tail is not None:
        mass = float(start[Parameter.TABLE_MASS] + start[Parameter.PLATE_MASS])
        stiffness = 2.0 * decay.tail.period_uncertainty_s / decay.tail.period_s + 1e-4
        trusts += [
            (Parameter.STIFFNESS, stiffness * float(start[Parameter.STIFFNESS])),
            (
                Parameter.DAMPING,
                2.0 * mass * decay.tail.damping_uncertainty_per_s + 1e-2 * float(start[Parameter.DAMPING]),
            ),
            (Parameter.TABLE_OFFSET, decay.noise_m[0]),
        ]
    if decay.plateau is not None:
        trusts.append((Parameter.RELATIVE_OFFSET, decay.noise_m[1]))
    for place, deviation in trusts:
        problem = problem.with_prior(place, float(start[place]), _TAIL_TRUST * deviation + 1e-9)
    return problem


EARLIEST_PERIODS = 6.0
"""A record that begins later after its release tells too little of it."""
_WINDOW_PERIODS = 1.5
_READINGS = 60
_STEPS_PER_PERIOD = 48
"""Of the times of release that are tried; chi-square of the first readings is smooth over one."""
_STATIC_RATIOS = (1.0, 1.3, 1.7)
_SLIPS_KEPT = 6


def guess_release(
    guided: FitProblem, start: Floats, period_s: float, pullback_m: float | None
) -> list[Floats]:
    """Look back over six periods for releases whose motion fits the first readings; the best few, refined.

    Parameters
    ----------
    guided : Problem
        With prior knowledge of friction, tilt, stiffness and damping.
    start : (16,) float64
        Release and pullback in it are ignored.
    pullback_m : float or None
        Nominal pullback; any up to twice the first swing where None.
    """
    first_s = float(guided.table.time_s[0])
    window = guided.before(first_s + _WINDOW_PERIODS * period_s).decimated(_READINGS, np.inf)
    candidates = _candidates(window, start, period_s, pullback_m)
    best = candidates[np.argsort(window.chi_squares(candidates, fit_zero=True))[: 4 * _SLIPS_KEPT]]
    refined = [window.minimise(_with_fitted_zero(window, point), WIDEST_LAW, 20) for point in best]
    refined.sort(key=lambda minimum: minimum.cost)
    return [minimum.parameters for minimum in refined[:_SLIPS_KEPT]]


def _candidates(window: FitProblem, start: Floats, period_s: float, pullback_m: float | None) -> Floats:
    """Every combination of release time, pullback of either sign, and f_s, (m, 16)."""
    swing = float(np.abs(window.table.value_m - start[Parameter.TABLE_OFFSET]).max())
    pullbacks = swing * np.arange(1.0, 2.0, 0.05)
    if pullback_m is not None:
        pullbacks = abs(pullback_m) * np.array([0.96, 0.98, 1.0, 1.02, 1.04])
    first_s = float(window.table.time_s[0])
    releases = first_s - np.arange(0.0, EARLIEST_PERIODS, 1.0 / _STEPS_PER_PERIOD) * period_s
    statics = np.array(_STATIC_RATIOS) * start[Parameter.FRICTION_DYNAMIC]
    grid = np.meshgrid(statics, np.concatenate((pullbacks, -pullbacks)), releases, indexing="ij")
    found = np.tile(start, (grid[0].size, 1))
    for place, values in zip(
        (Parameter.FRICTION_STATIC, Parameter.PULLBACK, Parameter.RELEASE), grid, strict=True
    ):
        found[:, place] = values.ravel()
    return found


def _with_fitted_zero(window: FitProblem, point: Floats) -> Floats:
    """The point with gauge 2's zero at its best."""
    _, second = window.residuals(point, WIDEST_LAW)
    if not len(second):
        return point
    moved = point.copy()
    moved[Parameter.RELATIVE_OFFSET] += second.mean()
    return moved
