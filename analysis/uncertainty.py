"""Standard uncertainties by the law of propagation (JCGM 100, 5.1.2), with contributions by source."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Self, TypeVar

import numpy as np

from analysis.arrays import Floats, Indices
from analysis.catalogue import CATALOGUE
from analysis.fitting.problem import FitProblem, covariance
from analysis.fitting.search import Fit
from analysis.identification import Correlation
from analysis.laws.parameters import Parameter
from analysis.quantities import (
    BudgetLine,
    BudgetSource,
    OtherLaw,
    Quantity,
    Source,
)
from analysis.record import Record

Values = TypeVar("Values", float, Floats)

_SOURCES = {
    Parameter.TABLE_MASS: BudgetSource.TABLE_MASS,
    Parameter.PLATE_MASS: BudgetSource.PLATE_MASS,
    Parameter.TABLE_GAIN: BudgetSource.GAUGE_1_GAIN,
    Parameter.RELATIVE_GAIN: BudgetSource.GAUGE_2_GAIN,
    Parameter.LAG: BudgetSource.GAUGE_2_LAG,
}
_UNITS = {row.name: row.unit for row in CATALOGUE}
_FRICTION = ("friction_dynamic", "friction_dynamic_plate")
_UNITS_WITH_TIME = frozenset(("s", "1/s", "rad/s", "Hz", "m/s", "m/s2", "s/m", "kg/s", "N/m"))
NEGLIGIBLE = 0.3
"""Share of a standard uncertainty: a part that is smaller widens it by 5 % at most, less than its two digits
tell."""
LEVEL_RAD = 2e-3  # tilt within which a hydraulic level sets a plane
LEVELLING_UNCERTAINTY_RAD = LEVEL_RAD / 3.0**0.5  # rectangular (JCGM 100, 4.3.7)
_SHARE_MIN = 1e-3  # a law less likely than this adds less than its last digit to a standard uncertainty
_CORRELATED = 3.5  # excess scatter of block means, in sigmas of white noise, of correlated noise


@dataclass(frozen=True, eq=False, slots=True)
class ParameterUncertainty:
    """Linearised distribution of the parameters about a fit."""

    shifts: dict[Source, Floats]  # (p,) by source: shift by one standard uncertainty of it
    noise_covariance: Floats  # (p, p) float64: covariance from the noise of the readings

    def standard_uncertainty(self, weights: Floats) -> float:
        return float(np.sqrt(sum(share**2 for share in self.contributions(weights).values())))

    def contributions(self, weights: Floats) -> dict[Source, float]:
        """Standard uncertainty of a linear form by source; noise is of type A."""
        shares: dict[Source, float] = {
            BudgetSource.NOISE: float(np.sqrt(max(0.0, float(weights @ self.noise_covariance @ weights))))
        }
        shares.update({source: abs(float(column @ weights)) for source, column in self.shifts.items()})
        return shares


def propagate(problem: FitProblem, fit: Fit, block_s: float) -> ParameterUncertainty:
    """Distribution of the fitted parameters: noise as the residuals show it, and every stated source."""
    residuals = problem.residuals(fit.parameters, fit.law)
    shown = zip(residuals, problem.noise_m, _times(problem), strict=False)
    factors = [noise_variance_factor(residual / stated, times, block_s) for residual, stated, times in shown]
    return _propagate(problem, fit, factors)


def propagate_expected(problem: FitProblem, fit: Fit) -> ParameterUncertainty:
    """Expected distribution of a fit to readings with white noise of the stated size."""
    return _propagate(problem, fit, [1.0] * len(_times(problem)))


def white_noise_variance(problem: FitProblem, fit: Fit, place: int) -> float:
    """Variance of one fitted parameter by white noise of the stated size alone."""
    inverse, _ = covariance(fit.normal_matrix)
    known = problem.prior_deviation[fit.free]
    informed = np.where(known > 0.0, known, np.inf)
    from_readings = fit.normal_matrix - np.diag(1.0 / informed**2)
    row = inverse[np.flatnonzero(fit.free == place)[0]]
    return float(row @ from_readings @ row)


def propagate_with_model_choice(
    problem: FitProblem, chosen: Fit, candidates: list[Fit], block_s: float
) -> ParameterUncertainty:
    """Distribution about the chosen law with the probability that another of `candidates` is the true one.

    Each law counts with its share exp(-BIC/2); its own noise and its distance from the chosen law enter
    (law of total variance). Where one law is far more likely than the others this is `propagate`.
    """
    own = propagate(problem, chosen, block_s)
    shares = np.array([np.exp(-0.5 * min(fit.bic - chosen.bic, 1400.0)) for fit in candidates])
    shares /= shares.sum()
    columns, noise = dict(own.shifts), own.noise_covariance
    for fit, share in zip(candidates, shares, strict=True):
        if fit is not chosen and share > _SHARE_MIN:
            noise = noise + share * (propagate(problem, fit, block_s).noise_covariance - own.noise_covariance)
            columns[OtherLaw(fit.law.name)] = np.sqrt(share) * (fit.parameters - chosen.parameters)
    return ParameterUncertainty(columns, noise)


def unstated_gains(record: Record, results: Iterable[str]) -> list[BudgetLine]:
    """Budget lines (NaN) for values of f_d in `results`, of gauges whose gain has no stated uncertainty."""
    names = [name for name in _FRICTION if name in results]
    gauges = {BudgetSource.GAUGE_1_GAIN_NOT_STATED: record.table_gauge}
    if record.relative_displacement_m is not None:
        gauges[BudgetSource.GAUGE_2_GAIN_NOT_STATED] = record.relative_gauge
    return [
        BudgetLine(source, name, float("nan"))
        for name in names
        for source, gauge in gauges.items()
        if gauge.gain_relative is None
    ]


def unstated_clock(record: Record, results: Mapping[str, Quantity]) -> list[BudgetLine]:
    """Budget lines (NaN) of a clock that was not timed, for `results` that scale with time: f_d is one."""
    if record.clock_is_timed:
        return []
    return [
        BudgetLine(BudgetSource.TIME_BASE_NOT_STATED, name, float("nan"))
        for name, quantity in results.items()
        if name in _FRICTION or quantity.unit in _UNITS_WITH_TIME
    ]


def levelling_shift(problem: FitProblem, fit: Fit) -> Floats | None:
    """Shift of every parameter by one standard uncertainty of the plane's tilt.

    Slips in one direction alone determine only f_d minus or plus the tilt. None where the record determines
    the tilt better than a hydraulic level, or the law has a tilt of its own.
    """
    if fit.law.has_tilt:
        return None
    free = np.union1d(fit.free, Parameter.TILT)
    normal = problem.quadratic_model(fit.parameters, fit.law, free).normal
    inverse, loose = covariance(normal)
    tilt = int(np.flatnonzero(free == Parameter.TILT)[0])
    if not loose[tilt] and inverse[tilt, tilt] < LEVELLING_UNCERTAINTY_RAD**2:
        return None
    rest = free != Parameter.TILT
    own, _ = covariance(normal[np.ix_(rest, rest)])
    return _expand(-LEVELLING_UNCERTAINTY_RAD * own @ normal[rest, tilt], fit)


def noise_variance_factor(residual: Floats, time_s: Floats, block_s: float) -> float:
    """Variance of slow averages of `residual` (in units of its stated noise) over that of white unit noise.

    White residuals give their mean square. Where block means scatter significantly more, their scatter
    counts instead.
    """
    square = float(np.mean(residual**2))
    edges = np.arange(time_s[0], time_s[-1], block_s)[1:]
    bounds = np.concatenate(([0], np.searchsorted(time_s, edges), [len(residual)]))
    counts = np.diff(bounds)
    sums = np.zeros(len(counts))
    sums[counts > 0] = np.add.reduceat(residual, bounds[:-1][counts > 0])
    full = counts > 0.5 * np.median(counts)
    blocks = int(full.sum())
    if blocks < 4 or square == 0.0:
        return max(square, 1e-300)
    ratio = float(np.mean(sums[full] ** 2 / counts[full])) / square
    return square * (ratio if ratio > 1.0 + _CORRELATED * np.sqrt(2.0 / blocks) else 1.0)


_STEP, _SCALE_MIN = 1e-4, 1e-3  # of a derivative, relative to a parameter; the least that it counts as


def numerical_gradient(
    function: Callable[[Floats], Values], point: Floats, free: Indices | None = None
) -> Floats:
    """Derivatives of one or (m,) values by every parameter, by five points: (p,) or (m, p).

    Those by parameters that are not `free` are zero. Rounding makes about 1e-12 of value over parameter.
    """
    columns: list[Any] = []
    for index, value in enumerate(point):
        if free is not None and index not in free:
            columns.append(np.zeros_like(columns[0]) if columns else np.zeros_like(function(point)))
            continue
        step = _STEP * max(abs(float(value)), _SCALE_MIN)
        shift = np.zeros_like(point)
        shift[index] = step
        around = [np.asarray(function(point + steps * shift)) for steps in (-2.0, -1.0, 1.0, 2.0)]
        with np.errstate(invalid="ignore"):  # values that do not exist, or are not finite, have no slope
            columns.append((8.0 * (around[2] - around[1]) - (around[3] - around[0])) / (12.0 * step))
    return np.stack(columns, axis=-1)


@dataclass(frozen=True, eq=False, slots=True)
class LinearForm:
    """The error of a quantity as a linear form of those of parameters."""

    uncertainty: ParameterUncertainty
    weights: Floats  # (p,): derivatives of the quantity by the parameters

    @classmethod
    def of_parameter(cls, uncertainty: ParameterUncertainty, place: int, sign: int = 1) -> Self:
        weights = np.zeros(len(uncertainty.noise_covariance))
        weights[place] = sign
        return cls(uncertainty, weights)

    def contributions(self) -> dict[Source, float]:
        """Standard uncertainty by source."""
        return self.uncertainty.contributions(self.weights)

    def covariance(self, other: "LinearForm") -> float:
        """Covariance with another quantity; noise is shared by forms of the same fit alone."""
        mine, theirs = self.uncertainty, other.uncertainty
        sources = mine.shifts.keys() & theirs.shifts.keys()
        shared = sum(
            float(mine.shifts[source] @ self.weights) * float(theirs.shifts[source] @ other.weights)
            for source in sources
        )
        noise = self.weights @ mine.noise_covariance @ other.weights if mine is theirs else 0.0
        return float(noise + shared)


class UncertaintyBudget:
    """Collects quantities and their budget lines."""

    def __init__(self) -> None:
        self.results: dict[str, Quantity] = {}
        self.lines: list[BudgetLine] = []
        self._forms: dict[str, LinearForm] = {}

    def form(self, name: str) -> LinearForm | None:
        """The linear form of a quantity; None where none is known."""
        return self._forms.get(name)

    def remove(self, name: str) -> None:
        """Remove a quantity with its lines."""
        del self.results[name]
        self._forms.pop(name, None)
        self.lines = [line for line in self.lines if line.contribution_to != name]

    def widen(self, name: str, source: Source, deviation: float) -> None:
        """Add a standard uncertainty from a source to those of a quantity."""
        value, shares, form = self.results[name].value, self.shares(name), self.form(name)
        self.remove(name)
        widened = {**shares, source: math.hypot(shares.get(source, 0.0), deviation)}
        self.add(name, value, widened, form=form)

    def shares(self, name: str) -> dict[Source, float]:
        """Standard uncertainty of a quantity by source."""
        return {line.source: line.standard_uncertainty for line in self.lines if line.contribution_to == name}

    def add(
        self,
        name: str,
        value: float,
        contributions: Mapping[Any, float],
        *,
        unit: str = "",
        half_widths: tuple[float, float] | None = None,
        form: LinearForm | None = None,
    ) -> None:
        """Add a quantity with its standard uncertainty from each source; zero contributions are left out.

        `unit` is that of the catalogue where none is given. `half_widths` of the 95 % interval, below and
        above the value, replace 1.96 standard uncertainties. `form` tells how its error goes with those of
        other quantities.
        """
        deviation = float(np.sqrt(sum(share**2 for share in contributions.values())))
        quantity = Quantity.normal(value, deviation, unit or _UNITS[name])
        if half_widths is not None:
            quantity = replace(quantity, interval_95=(value - half_widths[0], value + half_widths[1]))
        self.results[name] = quantity
        self.lines += [BudgetLine(source, name, abs(s)) for source, s in contributions.items() if s != 0.0]
        if form is not None:
            self._forms[name] = form

    def correlation(self) -> Correlation:
        """Correlation of the quantities whose linear forms are known and that are uncertain."""
        known = {
            name: form for name, form in self._forms.items() if self.results[name].standard_uncertainty > 0.0
        }
        matrix = np.array([[one.covariance(other) for other in known.values()] for one in known.values()])
        # Where the uncertainty holds more than the form does (a spread of models), the rest is its own.
        stated = [self.results[name].standard_uncertainty for name in known]
        deviations = np.maximum(stated, np.sqrt(np.diag(matrix))) if known else np.zeros(0)
        matrix = matrix.reshape(len(known), len(known)) / np.outer(deviations, deviations)
        matrix = np.clip(matrix, -1.0, 1.0)  # beyond by rounding
        np.fill_diagonal(matrix, 1.0)
        return Correlation(tuple(known), matrix)


def _propagate(problem: FitProblem, fit: Fit, noise_factors: list[float]) -> ParameterUncertainty:
    inverse, _ = covariance(fit.normal_matrix)
    noise = np.zeros_like(inverse)
    systems = problem.normal_equations(fit.parameters, fit.law, fit.free)
    for system, factor in zip(systems, noise_factors, strict=False):
        noise += factor * inverse @ system[:-1, :-1] @ inverse
    sources: dict[Source, Floats] = {}
    for index, place in enumerate(fit.free):
        deviation = float(problem.prior_deviation[place])
        if 0.0 < deviation < np.inf:
            sources[_SOURCES[Parameter(int(place))]] = _expand(inverse[:, index] / deviation, fit)
    full = np.zeros((len(fit.parameters), len(fit.parameters)))
    full[fit.free[:, None], fit.free] = noise
    return ParameterUncertainty(sources, full)


def _times(problem: FitProblem) -> list[Floats]:
    times = [problem.table.time_s]
    return times if problem.relative is None else [*times, problem.relative.time_s]


def _expand(column: Floats, fit: Fit) -> Floats:
    wide = np.zeros(len(fit.parameters))
    wide[fit.free] = column
    return wide
