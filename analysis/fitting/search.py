"""Search for the lowest minimum of chi-square, for each friction law."""

from dataclasses import dataclass

import numpy as np

from analysis.arrays import Floats, Indices
from analysis.fitting.least_squares import Minimum, covariance
from analysis.fitting.problem import FitProblem, project_to_bounds
from analysis.laws.catalogue import FIRST_SLIP_LAW, WIDEST_LAW
from analysis.laws.law import FrictionLaw
from analysis.laws.parameters import Parameter

_FEW = 500
"""Readings a channel for searching: the shape of chi-square needs no more, ..."""
_CLEAR = 0.005
"""... up to this noise, as a share of the swing. Beyond, as many more as keep the mean as well known."""
_MOST = 3000
"""Readings a channel for telling minima apart."""
_DOUBT = 100.0
"""Minima whose chi-square of some readings differs by less are compared with most readings."""
_TIE = 10.0
"""Chi-square with most readings may err by this much about which of two minima is lower."""
_HOPELESS = 1000.0
"""A law whose chi-square exceeds that of its rival by more, with some readings, is fitted roughly only."""
_ROUGH_STEPS, _LAST_STEPS = 15, 15
_COARSE = np.concatenate((np.linspace(1.0, 1.4, 29), np.linspace(1.42, 2.6, 60), np.geomspace(2.65, 6.0, 56)))
"""f_s over f_d; 4.3 on oiled steel in the paper's Table 1."""
_FINE = np.linspace(0.975, 1.025, 51)
"""f_s over its last value."""
_HOPS = 4
"""Most jumps of chi-square that are crossed one after the other; each costs two refinements."""
_FIRST_WINDOW_PERIODS = 0.6
"""So early f_s plays no part."""
_WINDOWS_PERIODS = (1.5, 3.0, 6.0, np.inf)
"""Each about twice as long as the one before: few new minima at a time."""
_KEPT = 4
"""Minima that are followed from one window to the next."""
_FALLBACK_KEPT, _FALLBACK_STEPS = 3, 10
"""Start points and steps of an integrated law, whose steps take a hundred times as long as in closed form."""
_FALLBACK_GRID, _FALLBACK_SCANS = np.geomspace(1.0, 2.0, 71), 4
"""f_s over f_d in steps of 1 %, and most scans. Minima of chi-square along f_s are a few per cent wide."""
_EXPLAINED = 1.1
"""Chi-square a reading below which an integrated law needs no scan of f_s: its minimum is the right one."""
_WORTH = 0.5
"""Share of the simpler law's chi-square below which a scan of f_s is worth its second: the law explains the
larger part, and a neighbouring minimum may explain the rest."""
_MISFIT_MAX = 0.1
"""Residual over range of gauge 1 above which it is not friction that is wrong: f_s of three times f_d that
falls with speed leaves 0.014 at most with a law of constant f_d."""


@dataclass(frozen=True, eq=False, slots=True)
class Fit:
    """A friction law fitted to a record.

    Attributes
    ----------
    parameters : (16,) float64
        By `Place`.
    free : (k,) int
        Places that were free.
    normal : (k, k) float64
        Gauss-Newton curvature of half of chi-square over the free parameters, priors included.
    chi_square : float
        Of the readings alone.
    bic : float
    table_residual_m, relative_residual_m : (n,) float64
        Reading minus curve.
    """

    law: FrictionLaw
    parameters: Floats
    free: Indices
    normal_matrix: Floats
    chi_square: float
    bic: float
    table_residual_m: Floats
    relative_residual_m: Floats

    def value(self, parameter: Parameter) -> float:
        """Fitted value of one parameter."""
        return float(self.parameters[parameter])

    def determines(self, parameter: Parameter) -> bool:
        """Whether the record tells this parameter apart from the others."""
        _, loose = covariance(self.normal_matrix)
        return bool((~loose[self.free == parameter]).all()) and parameter in self.free

    @property
    def rms_m(self) -> float:
        """Root mean square of both channels' residuals."""
        both = np.concatenate((self.table_residual_m, self.relative_residual_m))
        return float(np.sqrt(np.mean(both**2)))


@dataclass(frozen=True, eq=False, slots=True)
class Search:
    """Where to look for minima.

    Attributes
    ----------
    problem : Problem
        The whole record.
    guided : Problem
        The same with prior knowledge from tail, hold and parabolas, for windows that hold too little.
    period_s : float
    slip_end_s : float
        Most readings of a decimated problem lie before it.
    """

    problem: FitProblem
    informed_problem: FitProblem
    period_s: float
    slip_end_s: float

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
        """Find the lowest minima of the widest law (f_s and tilt free) by following the motion in time.

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
        return points

    def fit(self, law: FrictionLaw, starts: list[Floats], rival: Floats | None = None) -> Fit:
        """Fit `model` from the best of several starts.

        Far above the chi-square of a `rival` law's parameters nothing can be won: a rough fit will do.
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
        some = self.window(np.inf)
        starts = [simpler.parameters, *law.start_points(simpler.parameters, law.own_places)]
        starts.sort(key=lambda point: some.chi_square(point, law))
        rough = [some.minimise(point, law, _FALLBACK_STEPS) for point in starts[:_FALLBACK_KEPT]]
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
        last = self.problem.minimise(best.parameters, law, _FALLBACK_STEPS)
        return fit_at_minimum(self.problem, law, last)

    def fit_all(self, laws: tuple[FrictionLaw, ...], starts: list[Floats]) -> list[Fit]:
        """Fit each model, the widest first, each from all minima known by then.

        In the end none may lie above a law that it holds as a special case. A single law that is not in
        closed form is fitted from the fit of the widest that is.
        """
        if not laws[-1].solver.is_closed_form:
            return [self.fit_fallback(laws[-1], self.fit(WIDEST_LAW, starts))]
        fits: dict[FrictionLaw, Fit] = {}
        for model in reversed(laws):
            best = min(fits.values(), key=lambda fit: fit.chi_square, default=None)
            rival = None if best is None else best.parameters
            fits[model] = self.fit(model, [*starts, *(fit.parameters for fit in fits.values())], rival)
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


def may_be_friction(problem: FitProblem, fits: list[Fit]) -> bool:
    """Whether the best of `fits` is so near the record that another friction law may explain the rest."""
    rms_m = min(fit.rms_m for fit in fits)
    return rms_m < _MISFIT_MAX * float(np.ptp(problem.table.value_m))


def fit_at_minimum(problem: FitProblem, law: FrictionLaw, minimum: Minimum) -> Fit:
    """Describe a minimum."""
    table, relative = problem.residuals(minimum.parameters, law)
    weights = np.square(problem.noise_m)
    chi_square = float(table @ table / weights[0] + relative @ relative / weights[1])
    bic = chi_square + len(problem.model_parameters(law)) * float(np.log(problem.sample_count))
    free = problem.free_parameters(law)
    return Fit(law, minimum.parameters, free, minimum.quadratic.normal, chi_square, bic, table, relative)


def _reading_count(problem: FitProblem) -> int:
    """Readings a channel that show every minimum of chi-square."""
    swing_m = 0.5 * float(np.ptp(problem.table.value_m))
    share = max(problem.noise_m) / (_CLEAR * max(swing_m, 1e-9))
    return round(min(_MOST, _FEW * max(1.0, share) ** 2))


def _without_tilt(point: Floats) -> Floats:
    """The same first slip on a level plane: f_d and f_s take the tilt over."""
    moved = point.copy()
    both = [Parameter.FRICTION_DYNAMIC, Parameter.FRICTION_STATIC]
    moved[both] -= np.sign(point[Parameter.PULLBACK]) * point[Parameter.TILT]
    moved[Parameter.TILT] = 0.0
    return moved


def _cross_jumps(problem: FitProblem, model: FrictionLaw, best: Minimum) -> Minimum:
    """Step off the cliffs of chi-square, along f_s with the others following, to lower minima nearby.

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
