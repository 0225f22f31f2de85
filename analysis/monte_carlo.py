"""Uncertainty by the propagation of distributions (JCGM 101), to check the budget by it.

Linearised: every source is drawn from its own distribution and carried through the fit's sensitivities.
Full: whole records are made anew, with other noise, gains, masses, lag, time base and gravity, and
fitted again in ignorance of them.
"""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from analysis.channels import Channel, FloatArray
from analysis.friction import Fit
from analysis.identification import MonteCarlo
from analysis.models import PARAMETERS, Place
from analysis.problem import Problem, gauge_1, gauge_2
from analysis.quantities import Quantity
from analysis.record import Record, StandMasses
from analysis.uncertainty import Spread

LINEAR_DRAWS = 100_000
_STEPS = 6
_RECTANGULAR = ("non-linearity", "levelling")
"""Sources whose names hold one of these are drawn from a rectangle; all others are normal."""
_SPREAD = float(np.sqrt(3.0))
NAMES = {
    Place.FRICTION_DYNAMIC: ("friction_dynamic", "1"),
    Place.FRICTION_STATIC: ("friction_static", "1"),
    Place.TILT: ("tilt_rad", "rad"),
    Place.PULLBACK: ("pullback_m", "m"),
}


@dataclass(frozen=True, eq=False, slots=True)
class Drawing:
    """What is drawn from: the record's knowledge, the problem, its fit and the fit's distribution."""

    record: Record
    problem: Problem
    fit: Fit
    fitted: Spread

    def linear(self, rng: np.random.Generator, draws: int) -> FloatArray:
        """Drawn parameters (draws, 16)."""
        scale = np.sqrt(np.maximum(np.diag(self.fitted.noise), 1e-300))
        values, vectors = np.linalg.eigh(self.fitted.noise / np.outer(scale, scale))
        root = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
        result = self.fit.parameters + rng.standard_normal((draws, PARAMETERS)) @ root.T
        for source, column in self.fitted.columns.items():
            if any(word in source for word in _RECTANGULAR):
                result += rng.uniform(-_SPREAD, _SPREAD, (draws, 1)) * column
            else:
                result += rng.standard_normal((draws, 1)) * column
        return np.asarray(result)

    def refitted(self, seed: int) -> FloatArray:
        """Fitted parameters (16,) of a record made anew."""
        rng = np.random.default_rng(seed)
        made = self._made(rng)
        return made.minimise(self.fit.parameters, self.fit.model, _STEPS).parameters

    def _made(self, rng: np.random.Generator) -> Problem:
        """The problem with readings of a test that differs in all that is not known exactly."""
        truth, problem = self.fit.parameters.copy(), self.problem
        deviation = problem.prior_deviation
        known = np.flatnonzero((deviation > 0.0) & np.isfinite(deviation))
        truth[known] = problem.prior_mean[known] + deviation[known] * rng.standard_normal(len(known))
        masses: StandMasses = self.record.masses
        truth[Place.GRAVITY] += masses.gravity_uncertainty_m_per_s2 * rng.standard_normal()
        stretch = 1.0 + self.record.clock_scale_uncertainty * rng.standard_normal()
        table = gauge_1(truth, problem.table.time_s * stretch, self.fit.model)
        table = table + _rms(self.fit.table_residual_m) * rng.standard_normal(len(table))
        relative = problem.relative
        if relative is not None:
            second = gauge_2(truth, relative.time_s * stretch, self.fit.model, problem.absolute)
            second = second + _rms(self.fit.relative_residual_m) * rng.standard_normal(len(second))
            relative = Channel(relative.time_s, second)
        return replace(problem, table=Channel(problem.table.time_s, table), relative=relative)


def run(
    drawing: Drawing,
    results: dict[str, Quantity],
    *,
    refits: int,
    seed: int = 0,
    progress: Callable[[int], None] | None = None,
) -> MonteCarlo:
    """Draw, refit, and compare with the `results` of the budget.

    Parameters
    ----------
    refits : int
        Full fits; 0 for none.
    progress : callable, optional
        Called with the number of refits done.
    """
    values = {name: drawing.fit.value(place) for place, (name, _) in NAMES.items()}
    told = {place: name for place, (name, _) in NAMES.items() if name in results}
    linear = drawing.linear(np.random.default_rng(seed), LINEAR_DRAWS)
    full = _refits(drawing, refits, seed, progress)
    signs = {name: 1.0 if results[name].value * values[name] >= 0.0 else -1.0 for name in told.values()}
    drawn = {name: _quantity(signs[name] * linear[:, place], NAMES[place][1]) for place, name in told.items()}
    refitted = {}
    if len(full) > 1:
        # A refit errs by (found - fitted); the truth lies that far on the other side of what was found.
        mirrored = 2.0 * drawing.fit.parameters - full
        refitted = {
            name: _quantity(signs[name] * mirrored[:, place], NAMES[place][1]) for place, name in told.items()
        }
    compared, count = (refitted, len(full)) if refitted else (drawn, LINEAR_DRAWS)
    agrees = {name: _agree(results[name], quantity, count) for name, quantity in compared.items()}
    return MonteCarlo(LINEAR_DRAWS, len(full), drawn, refitted, agrees)


def _refits(drawing: Drawing, refits: int, seed: int, progress: Callable[[int], None] | None) -> FloatArray:
    found = []
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for count, parameters in enumerate(pool.map(drawing.refitted, range(seed, seed + refits)), start=1):
            found.append(parameters)
            if progress is not None:
                progress(count)
    return np.array(found).reshape(-1, PARAMETERS)


def _rms(residual_m: FloatArray) -> float:
    return float(np.sqrt(np.mean(residual_m**2)))


def _quantity(draws: FloatArray, unit: str) -> Quantity:
    low, high = np.quantile(draws, (0.025, 0.975))
    return Quantity(float(draws.mean()), float(draws.std(ddof=1)), (float(low), float(high)), unit)


def _agree(budget: Quantity, drawn: Quantity, count: int) -> bool:
    """Whether both ends meet within three standard errors of a 2.5 % quantile and the rounding."""
    deviation = max(budget.standard_uncertainty, drawn.standard_uncertainty)
    if deviation == 0.0:
        return True
    rounding = 0.5 * 10.0 ** (np.floor(np.log10(deviation)) - 1.0)
    error = 2.7 * deviation / np.sqrt(count)  # of the quantile of a normal distribution
    reach = max(abs(a - b) for a, b in zip(budget.interval_95, drawn.interval_95, strict=True))
    return bool(reach <= rounding + 3.0 * error)
