"""Search for the lowest minimum of chi-square of each friction law, from a first guess on."""

import math
from collections.abc import Generator
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias, TypeVar

import numpy as np

from analysis.arrays import Floats, Indices
from analysis.fitting.problem import FitProblem, Minimum, covariance, project_to_bounds
from analysis.laws.catalogue import FIRST_SLIP_LAW, WIDEST_LAW, default_point
from analysis.laws.law import IDEAL_STAND, FrictionLaw
from analysis.laws.parameters import SHARED_PARAMETER_COUNT, Parameter
from analysis.preparation.channels import Channel
from analysis.preparation.free_decay import FreeDecay, relative_to_table
from analysis.preparation.oscillation import local_slopes, slope_noise, white_noise
from analysis.record import GaugeUncertainty, Record

_FEW = 500  # readings a channel for searching: the shape of chi-square needs no more, ..
_CLEAR = 0.005
"""... up to this noise, as a share of the swing. Beyond, as many more as keep the mean as well known."""
_MOST = 3000  # readings a channel for telling minima apart
_DOUBT = 100.0  # minima whose chi-square of some readings differs by less are compared with most readings
_TIE = 10.0  # chi-square with most readings may err by this much about which of two minima is lower
_HOPELESS = 1000.0
"""A law whose chi-square exceeds that of its rival by more, with some readings, is fitted roughly only."""
_ROUGH_STEPS, _LAST_STEPS = 15, 15
_COARSE = np.concatenate((np.linspace(1.0, 1.4, 29), np.linspace(1.42, 2.6, 60), np.geomspace(2.65, 6.0, 56)))
"""f_s over f_d; 4.3 on oiled steel in the paper's Table 1."""
_FINE = np.linspace(0.975, 1.025, 51)  # f_s over its last value
_HOPS = 4  # most jumps of chi-square that are crossed one after the other; each costs two refinements
_FIRST_WINDOW_PERIODS = 0.6  # before this time f_s has no effect
_WINDOWS_PERIODS = (1.5, 3.0, 6.0, np.inf)
"""Each about twice as long as the one before: few new minima at a time."""
_KEPT = 4  # minima that are followed from one window to the next
_FALLBACK_KEPT, _FALLBACK_STEPS = 3, 10
"""Start points and steps of an integrated law, whose steps take a hundred times as long as in closed form."""
_FALLBACK_GRID, _FALLBACK_SCANS = np.geomspace(1.0, 2.0, 71), 4
"""f_s over f_d in steps of 1 %, and most scans. Minima of chi-square along f_s are a few per cent wide."""
_EXPLAINED = 1.1
"""Chi-square a reading below which an integrated law needs no scan of f_s: its minimum is the right one."""
_UNEXPLAINED = 2.0  # chi-square a reading above which a law leaves more than noise
_WORTH = 0.5
"""Share of the simpler law's chi-square below which a scan of f_s is worth its second: the law explains the
larger part, and a neighbouring minimum may explain the rest."""
_MISFIT_MAX = 0.1
"""Residual over range of gauge 1 above which it is not friction that is wrong: f_s of three times f_d that
falls with speed leaves 0.014 at most with a law of constant f_d."""


@dataclass(frozen=True, eq=False, slots=True)
class Fit:
    """A friction law fitted to a record."""

    law: FrictionLaw
    parameters: Floats
    """(p,) float64: by `Parameter`."""
    free: Indices  # (k,) int: places that were free
    normal_matrix: Floats
    """(k, k) Gauss-Newton curvature of half of chi-square over the free parameters, priors included."""
    chi_square: float  # of the readings alone
    bic: float
    rms_m: float  # of reading minus curve, both gauges together
    gauge_rms_m: tuple[float, float]  # of each; 0 without gauge 2
    departure: float  # chi-square of the parameters about what is stated of them: gains, lag, masses

    def value(self, parameter: Parameter) -> float:
        return float(self.parameters[parameter])

    def determines(self, parameter: Parameter) -> bool:
        """Whether the record distinguishes this parameter from the others."""
        _, loose = covariance(self.normal_matrix)
        return bool((~loose[self.free == parameter]).all()) and parameter in self.free


@dataclass(frozen=True, eq=False, slots=True)
class Search:
    """Where to look for minima."""

    problem: FitProblem  # the whole record
    informed_problem: FitProblem
    """The same with prior knowledge from tail, hold and parabolas, for windows that hold too little."""
    period_s: float
    slip_end_s: float
    """Most readings of a decimated problem lie before it."""

    def window(self, end_s: float) -> FitProblem:
        """Some of the readings until `end_s`, or of the whole record if that is later."""
        whole = end_s >= self.problem.table.time_s[-1]
        problem = self.problem if whole else self.informed_problem.before(end_s)
        return problem.decimated(_reading_count(self.problem), self.slip_end_s)

    def fit_first_slip(self, start: Floats) -> Floats:
        """Refine `start` on the first slip after the release, where chi-square has one minimum."""
        first = self.window(float(start[Parameter.RELEASE]) + _FIRST_WINDOW_PERIODS * self.period_s)
        return first.minimise(start, FIRST_SLIP_LAW, 25).parameters

    def find_minima(self, points: list[Floats]) -> list[Floats]:
        """Find the lowest minima of the widest law (f_s and tilt free) by following the motion in time."""
        return _finish(self.follow_minima(points))

    def follow_minima(self, points: list[Floats]) -> "Steps[list[Floats]]":
        """`find_minima`, with a pause after each window.

        Later slips depend on f_s through every breakaway before them, so that chi-square of a whole
        record has a great many minima; that of the first slips has few. The best few are kept as the
        window grows from where `points` begin.
        """
        begin = max(float(points[0][Parameter.RELEASE]), float(self.problem.table.time_s[0]))
        for periods in _WINDOWS_PERIODS:
            window = self.window(begin + periods * self.period_s)
            lines = [(point, _static_friction_grid(point)) for point in points]
            minima = [
                window.minimise(point, WIDEST_LAW, 12) for point in _scan_static_friction(window, lines)
            ]
            points = [minimum.parameters for minimum in _distinct(minima)]
            yield
        return points

    def fit(self, law: FrictionLaw, starts: list[Floats], rival: Floats | None = None) -> Fit:
        """Fit `model` from the best of several starts.

        Far above the chi-square of a `rival` law's parameters the fit is only rough.
        """
        if not law.has_tilt:
            starts = [*starts, *(_without_tilt(start) for start in starts if start[Parameter.TILT] != 0.0)]
        some = self.window(np.inf)
        points = np.array([project_to_bounds(start, law) for start in starts])
        nearest = points[np.argsort(some.chi_squares(points), kind="stable")[:_KEPT]]
        rough = _distinct([some.minimise(point, law, _ROUGH_STEPS) for point in nearest])
        if rival is not None and rough[0].cost > some.chi_squares(rival[None])[0] + _HOPELESS:
            points = np.array([rough[0].parameters, *points])
            lowest = points[np.argmin(self.problem.chi_squares(points))]
            return fit_at_minimum(self.problem, law, self.problem.minimise(lowest, law, 3))
        close = self._best_minima(
            law, [minimum for minimum in rough if minimum.cost <= rough[0].cost + _DOUBT]
        )
        full = [self.problem.minimise(minimum.parameters, law, _LAST_STEPS) for minimum in close]
        last = min(full, key=lambda minimum: minimum.cost)
        if law.has_static_friction and not last.converged:
            last = _cross_jumps(self.problem, law, last)
        return fit_at_minimum(self.problem, law, last)

    def fit_fallback(self, law: FrictionLaw, simpler: Fit) -> Fit:
        """Fit a law that is too slow for a search, from its start points about the fit of a simpler law."""
        return self._refine_fallback(law, self._rough_fallback(law, simpler))

    def explain_by_fallback(self, law: FrictionLaw, simpler: Fit) -> Fit | None:
        """`fit_fallback`, but None where a shorter window shows that the law does not explain the record."""
        first = self.window(simpler.value(Parameter.RELEASE) + _WINDOWS_PERIODS[1] * self.period_s)
        start = _nearest_starts(first, law, simpler)[0]
        early = first.minimise(start, law, _FALLBACK_STEPS)
        if early.cost > _UNEXPLAINED * first.sample_count:
            return None
        some = self.window(np.inf)
        rough = some.minimise(early.parameters, law, _FALLBACK_STEPS)
        if rough.cost > _EXPLAINED * some.sample_count:
            rough = self._rough_fallback(law, simpler)
        if rough.cost > _UNEXPLAINED * some.sample_count:
            return None
        return self._refine_fallback(law, rough)

    def _refine_fallback(self, law: FrictionLaw, rough: Minimum) -> Fit:
        last = self.problem.minimise(rough.parameters, law, _FALLBACK_STEPS)
        return fit_at_minimum(self.problem, law, last)

    def _rough_fallback(self, law: FrictionLaw, simpler: Fit) -> Minimum:
        """Minimum of a law with some of the readings, from the best of a few start points."""
        some = self.window(np.inf)
        nearest = _nearest_starts(some, law, simpler)[:_FALLBACK_KEPT]
        rough = [some.minimise(point, law, _FALLBACK_STEPS) for point in nearest]
        best = min(rough, key=lambda minimum: minimum.cost)
        worth = _WORTH * some.chi_square(simpler.parameters, simpler.law)
        for _ in range(_FALLBACK_SCANS if best.cost < worth else 0):
            if best.cost < _EXPLAINED * some.sample_count:
                break
            grid = _FALLBACK_GRID * best.parameters[Parameter.FRICTION_DYNAMIC]
            nearby = _scan_static_friction(some, [(best.parameters, grid)], law)[:_FALLBACK_KEPT]
            found = [some.minimise(point, law, _FALLBACK_STEPS) for point in nearby]
            lowest = min(found, key=lambda minimum: minimum.cost)
            if lowest.cost > best.cost - 1.0:
                break
            best = lowest
        return best

    def fit_all(self, laws: tuple[FrictionLaw, ...], starts: list[Floats]) -> list[Fit]:
        """Fit each of `laws` from several starts.

        A single law that is not in closed form is fitted from the fit of the widest that is.
        """
        if not laws[-1].solver.is_closed_form:
            return [self.fit_fallback(laws[-1], self.fit(WIDEST_LAW, starts))]
        return _finish(self.fit_closed_forms(laws, starts))

    def fit_closed_forms(self, laws: tuple[FrictionLaw, ...], starts: list[Floats]) -> "Steps[list[Fit]]":
        """`fit_all` of laws in closed form, with a pause after each law.

        The widest is fitted first, each from all minima known by then. In the end none may lie above a law
        that it holds as a special case.
        """
        fits: dict[FrictionLaw, Fit] = {}
        for model in reversed(laws):
            best = min(fits.values(), key=lambda fit: fit.chi_square, default=None)
            rival = None if best is None else best.parameters
            fits[model] = self.fit(model, [*starts, *(fit.parameters for fit in fits.values())], rival)
            yield
        for model in laws:
            for inside in laws:
                special = set(inside.free_parameters) < set(model.free_parameters)
                if special and fits[inside].chi_square < fits[model].chi_square:
                    refined = self.problem.minimise(fits[inside].parameters, model, _LAST_STEPS)
                    fits[model] = fit_at_minimum(self.problem, model, refined)
        return [fits[model] for model in laws]

    def _best_minima(self, law: FrictionLaw, rough: list[Minimum]) -> list[Minimum]:
        """Minima of nearly the same chi-square, refined with most readings; the best few."""
        most = self.problem.decimated(_MOST, self.slip_end_s)
        fine = [most.minimise(minimum.parameters, law, 12) for minimum in rough]
        if law.has_static_friction:
            fine = [_cross_jumps(most, law, minimum) for minimum in fine]
            best = min(fine, key=lambda minimum: minimum.cost).parameters
            nearby = _scan_static_friction(most, [(best, _FINE * best[Parameter.FRICTION_STATIC])])
            fine += [_cross_jumps(most, law, most.minimise(point, law, 12)) for point in nearby]
        fine = _distinct(fine)
        return [minimum for minimum in fine if minimum.cost <= fine[0].cost + _TIE][:_KEPT]


Result = TypeVar("Result")
Steps: TypeAlias = Generator[None, None, Result]
"""Work that pauses between its steps."""


def _finish(steps: Steps[Result]) -> Result:
    while True:
        try:
            next(steps)
        except StopIteration as ended:
            result: Result = ended.value
            return result


def may_be_friction(problem: FitProblem, fits: list[Fit]) -> bool:
    """Whether the best of `fits` is so near the record that another friction law may explain the rest."""
    rms_m = min(fit.rms_m for fit in fits)
    return rms_m < _MISFIT_MAX * float(np.ptp(problem.table.value_m))


def fit_at_minimum(problem: FitProblem, law: FrictionLaw, minimum: Minimum) -> Fit:
    """Describe a minimum."""
    residuals = problem.residuals(minimum.parameters, law)
    squares, counts = [float(each @ each) for each in residuals], [max(1, len(each)) for each in residuals]
    del residuals
    chi_square = squares[0] / problem.noise_m[0] ** 2 + squares[1] / problem.noise_m[1] ** 2
    rms_m = math.sqrt(sum(squares) / problem.sample_count)
    gauge_rms_m = math.sqrt(squares[0] / counts[0]), math.sqrt(squares[1] / counts[1])
    bic = chi_square + len(problem.model_parameters(law)) * float(np.log(problem.sample_count))
    free = problem.free_parameters(law)
    point, departure = minimum.parameters, problem.departure(minimum.parameters)
    normal = minimum.quadratic.normal
    return Fit(law, point, free, normal, chi_square, bic, rms_m, gauge_rms_m, departure)


def _reading_count(problem: FitProblem) -> int:
    """Readings a channel that show every minimum of chi-square."""
    swing_m = 0.5 * float(np.ptp(problem.table.value_m))
    share = max(problem.noise_m) / (_CLEAR * max(swing_m, 1e-9))
    return round(min(_MOST, _FEW * max(1.0, share) ** 2))


def _nearest_starts(window: FitProblem, law: FrictionLaw, simpler: Fit) -> list[Floats]:
    """Start points of an integrated law about the fit of a simpler one, the nearest to the readings first."""
    starts = [simpler.parameters, *law.start_points(simpler.parameters, law.own_places)]
    return sorted(starts, key=lambda point: window.chi_square(point, law))


def _without_tilt(point: Floats) -> Floats:
    """The same first slip on a level plane: f_d and f_s take the tilt over."""
    moved = point.copy()
    both = [Parameter.FRICTION_DYNAMIC, Parameter.FRICTION_STATIC]
    moved[both] -= np.sign(point[Parameter.PULLBACK]) * point[Parameter.TILT]
    moved[Parameter.TILT] = 0.0
    return moved


def _cross_jumps(problem: FitProblem, model: FrictionLaw, best: Minimum) -> Minimum:
    """Step across the jumps of chi-square, along f_s with the others following, to lower minima nearby.

    Where a stick begins or ends to exist, chi-square jumps, and a search that meets the jump stops there.
    """
    free = problem.free_parameters(model)
    static = int(np.flatnonzero(free == Parameter.FRICTION_STATIC)[0])
    for _ in range(_HOPS):
        column = covariance(best.quadratic.normal)[0][static]
        if column[static] <= 0.0:  # f_s changes nothing
            break
        step = np.zeros(len(best.parameters))
        step[free] = column / float(np.sqrt(column[static]))
        found = [problem.minimise(best.parameters + side * step, model, 12) for side in (-1.0, 1.0)]
        lowest = min(found, key=lambda minimum: minimum.cost)
        if lowest.cost > best.cost - 1.0:
            break
        best = lowest
    return best


def _static_friction_grid(point: Floats) -> Floats:
    """Values of f_s over its whole range, and finer near that of `point`."""
    return np.union1d(_COARSE * point[Parameter.FRICTION_DYNAMIC], _FINE * point[Parameter.FRICTION_STATIC])


def _scan_static_friction(
    window: FitProblem, lines: list[tuple[Floats, Floats]], law: FrictionLaw = WIDEST_LAW
) -> list[Floats]:
    """Lowest few local minima of chi-square along f_s; a line is a point and values of f_s to try there."""
    found: list[tuple[float, Floats]] = []
    for point, values in lines:
        line = np.tile(point, (len(values), 1))
        line[:, Parameter.FRICTION_STATIC] = np.maximum(values, point[Parameter.FRICTION_DYNAMIC])
        if law.solver.is_closed_form:
            costs = window.chi_squares(line)
        else:
            costs = np.array([window.chi_square(point, law) for point in line])
        padded = np.concatenate(([np.inf], costs, [np.inf]))
        lowest = np.flatnonzero((padded[1:-1] < padded[:-2]) & (padded[1:-1] <= padded[2:]))
        found += [(float(costs[index]), line[index]) for index in lowest]
    found.sort(key=lambda pair: pair[0])
    return [point for _, point in found[:_KEPT]]


def _distinct(minima: list[Minimum]) -> list[Minimum]:
    """Minima by rising cost, without those that are another one again."""
    ordered = sorted(minima, key=lambda minimum: minimum.cost)
    kept = ordered[:1]
    for minimum in ordered[1:]:
        if minimum.cost > kept[-1].cost * (1.0 + 1e-6):
            kept.append(minimum)
    return kept


@dataclass(frozen=True, eq=False, slots=True)
class PlatePathEstimate:
    """Friction and tilt from the plate's path."""

    friction: float  # estimates; the tilt is zero where all slips go one way
    tilt_rad: float
    covariance: Floats
    """(2, 2) float64: of (friction, tilt), from the noise."""
    misfit: float  # chi-square per degree of freedom of the phases' curvatures about the common two


def estimate_from_plate_path(
    table: Channel, relative: Channel, period_s: float, gravity_m_per_s2: float
) -> PlatePathEstimate | None:
    """Fit parabolas to table + relative, from release to end of slip, in every clear slip phase.

    None where there is no such phase.
    """
    phases = _phases(relative, period_s)
    if not phases:
        return None
    u2 = relative.value_m + np.interp(relative.time_s, table.time_s, table.value_m)
    noise = float(np.hypot(white_noise(table), white_noise(relative))) + 1e-9
    signs, curvatures, weights = (
        np.array(column)
        for column in zip(*(_curvature(relative.time_s, u2, phase) for phase in phases), strict=True)
    )
    return _common(signs, curvatures / gravity_m_per_s2, weights * (gravity_m_per_s2 / noise) ** 2)


def _phases(relative: Channel, period_s: float) -> list[tuple[int, int, int]]:
    """(sign, first, last) of the samples well inside each slip phase."""
    if len(relative) < 12:
        return []
    half_window = period_s / 24.0
    w = local_slopes(relative, half_window)
    noise = slope_noise(relative, half_window, white_noise(relative))
    threshold = max(5.0 * noise, 0.05 * float(np.abs(w).max()), 1e-6)
    side = np.where(w > threshold, 1, np.where(w < -threshold, -1, 0))
    edges = np.concatenate(([0], np.flatnonzero(np.diff(side)) + 1, [len(side)]))
    return [
        (int(side[first]), int(first), int(last))
        for first, last in pairwise(edges)
        if side[first] != 0
        and last - first >= 6
        and relative.time_s[last - 1] - relative.time_s[first] > period_s / 8.0
    ]


def _curvature(time_s: Floats, u2: Floats, phase: tuple[int, int, int]) -> tuple[float, float, float]:
    """Sign, second derivative of u2 (m/s2) and its weight for noise of one metre."""
    sign, first, last = phase
    tau = time_s[first:last] - time_s[first:last].mean()
    columns = np.stack((np.ones_like(tau), tau))
    parabola = 0.5 * tau**2
    parabola = parabola - columns.T @ np.linalg.lstsq(columns.T, parabola, rcond=None)[0]
    weight = float(parabola @ parabola)
    return float(sign), float(parabola @ u2[first:last]) / weight, weight


def _common(signs: Floats, curvatures: Floats, weights: Floats) -> PlatePathEstimate:
    """Weighted least squares of curvature/g = -s f + tilt."""
    both_ways = len(np.unique(signs)) > 1
    columns = np.stack((-signs, np.ones_like(signs) if both_ways else np.zeros_like(signs)))
    covariance = np.asarray(np.linalg.pinv(columns * weights @ columns.T), dtype=np.float64)
    friction, tilt = covariance @ (columns * weights @ curvatures)
    residual = curvatures + signs * friction - tilt
    freedom = max(1, len(signs) - 1 - int(both_ways))
    misfit = float(residual**2 @ weights) / freedom
    return PlatePathEstimate(float(friction), float(tilt), covariance, misfit)


_UNKNOWN = (
    Parameter.FRICTION_DYNAMIC,
    Parameter.FRICTION_STATIC,
    Parameter.TILT,
    *(place for part in IDEAL_STAND for place in part.free),
)
_TAIL_TRUST = 5.0
"""Factor that widens the uncertainties of first estimates when they guide the first steps."""
_FRICTION_GUESS = 0.1
_SHARES = (0.08, 0.15, 0.25, 0.4, 0.6, 0.8, 0.93)
"""f_d over the largest that lets the plate slip at all."""


def build_problem(record: Record, decay: FreeDecay) -> FitProblem:
    """Readings and noise of `decay` with what `record` states of masses and gauges."""
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
    """Readings of both gauges, turned so that the pullback is positive, with what `record` states."""
    table, relative = channels
    mean = default_point()
    deviation = np.zeros(len(mean))
    deviation[[*_UNKNOWN, *range(SHARED_PARAMETER_COUNT, len(mean))]] = np.inf
    masses = record.masses
    both = [Parameter.TABLE_MASS, Parameter.PLATE_MASS]
    mean[both] = masses.table_mass_kg, masses.plate_mass_kg
    deviation[both] = masses.table_mass_uncertainty_kg, masses.plate_mass_uncertainty_kg
    mean[Parameter.GRAVITY] = masses.gravity_m_per_s2
    deviation[Parameter.TABLE_GAIN] = gain_uncertainty(record.table_gauge, range_m(table.value_m))
    if relative is not None:
        deviation[Parameter.RELATIVE_GAIN] = gain_uncertainty(
            record.relative_gauge, range_m(relative.value_m)
        )
        late_u_s = record.table_gauge.lateness_s_uncertainty, record.relative_gauge.lateness_s_uncertainty
        deviation[Parameter.LAG] = float(np.hypot(*late_u_s))
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
    """Parameters (p,) near the truth without a guess, from tail, hold and the plate's parabolas.

    With them comes `problem` with what those three know as prior knowledge.
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
        damping = 2.0 * mass * decay.tail.damping_uncertainty_per_s
        trusts += [
            (Parameter.STIFFNESS, stiffness * float(start[Parameter.STIFFNESS])),
            (Parameter.DAMPING, damping + 1e-2 * float(start[Parameter.DAMPING])),
            (Parameter.TABLE_OFFSET, decay.noise_m[0]),
        ]
    if decay.plateau is not None:
        trusts.append((Parameter.RELATIVE_OFFSET, decay.noise_m[1]))
    for place, deviation in trusts:
        problem = problem.with_prior(place, float(start[place]), _TAIL_TRUST * deviation + 1e-9)
    return problem


EARLIEST_PERIODS = 6.0  # a record that begins later after its release does not determine the release
_WINDOW_PERIODS = 1.5
_READINGS = 60
_STEPS_PER_PERIOD = 48
"""Of the times of release that are tried; chi-square of the first readings is smooth over one."""
_STATIC_RATIOS = (1.0, 1.3, 1.7)
_RELEASES_KEPT = 6


def guess_release(
    guided: FitProblem, start: Floats, period_s: float, pullback_m: float | None
) -> list[Floats]:
    """Look back over six periods for releases whose motion fits the first readings; the best few, refined.

    `guided` has prior knowledge of friction, tilt, stiffness and damping. Release and pullback in `start` are
    ignored. The nominal pullback may be None: any up to twice the first swing is tried then.
    """
    first_s = float(guided.table.time_s[0])
    window = guided.before(first_s + _WINDOW_PERIODS * period_s).decimated(_READINGS, np.inf)
    candidates = _candidates(window, start, period_s, pullback_m)
    best = candidates[np.argsort(window.chi_squares(candidates, fit_zero=True))[: 4 * _RELEASES_KEPT]]
    refined = [window.minimise(_with_fitted_zero(window, point), WIDEST_LAW, 20) for point in best]
    refined.sort(key=lambda minimum: minimum.cost)
    return [minimum.parameters for minimum in refined[:_RELEASES_KEPT]]


def _candidates(window: FitProblem, start: Floats, period_s: float, pullback_m: float | None) -> Floats:
    """Every combination of release time, pullback of either sign, and f_s, (m, p)."""
    swing = float(np.abs(window.table.value_m - start[Parameter.TABLE_OFFSET]).max())
    pullbacks = swing * np.arange(1.0, 2.0, 0.05)
    if pullback_m is not None:
        pullbacks = abs(pullback_m) * np.array([0.96, 0.98, 1.0, 1.02, 1.04])
    first_s = float(window.table.time_s[0])
    releases = first_s - np.arange(0.0, EARLIEST_PERIODS, 1.0 / _STEPS_PER_PERIOD) * period_s
    statics = np.array(_STATIC_RATIOS) * start[Parameter.FRICTION_DYNAMIC]
    grid = np.meshgrid(statics, np.concatenate((pullbacks, -pullbacks)), releases, indexing="ij")
    found = np.tile(start, (grid[0].size, 1))
    places = Parameter.FRICTION_STATIC, Parameter.PULLBACK, Parameter.RELEASE
    found[:, places] = np.stack([values.ravel() for values in grid], axis=1)
    return found


def _with_fitted_zero(window: FitProblem, point: Floats) -> Floats:
    """The point with gauge 2's zero at its best."""
    _, second = window.residuals(point, WIDEST_LAW)
    if not len(second):
        return point
    moved = point.copy()
    moved[Parameter.RELATIVE_OFFSET] += second.mean()
    return moved
