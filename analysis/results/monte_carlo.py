"""Uncertainty by the propagation of distributions (JCGM 101), to check the budget by it.

Linearised: every source is drawn from its own distribution and carried through the fit's sensitivities.
Full: whole records are generated with other noise, gains, masses, lag, time base and gravity, and
fitted again without knowledge of them.
"""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from analysis.arrays import Floats
from analysis.fitting.problem import FitProblem, predict_gauge_1, predict_gauge_2
from analysis.identification import MonteCarlo
from analysis.laws.parameters import Parameter
from analysis.preparation.channels import Channel
from analysis.preparation.oscillation import refit_damped_cosine
from analysis.quantities import Quantity
from analysis.record import StandMasses
from analysis.results.joint_fit import FRICTION_PARAMETERS, DecayConstants, JointFit, period_and_damping
from analysis.uncertainty import ParameterUncertainty

LINEAR_DRAWS = 100_000
_STEPS = 6
_SPREAD = float(np.sqrt(3.0))
_PARAMETERS = {
    **{name: place for place, name in FRICTION_PARAMETERS.items()},
    "tilt_rad": Parameter.TILT,
    "pullback_m": Parameter.PULLBACK,
}
_CONSTANTS = ("period_s", "damping_n1_per_s")  # of the tail: they have draws of their own


@dataclass(frozen=True, eq=False, slots=True)
class MonteCarloModel:
    """What is drawn from: the joint fit, and period and damping, which have draws of their own."""

    joint: JointFit
    constants: DecayConstants

    @property
    def values(self) -> Floats:
        """The fitted parameters (p,), then T and n1."""
        return np.concatenate((self.joint.chosen.parameters, self.constants.point[:2]))

    def linear(self, rng: np.random.Generator, draws: int) -> Floats:
        """Drawn values (draws, p + 2), those of T and n1 independent of the others."""
        parameters = _drawn(self.joint.chosen.parameters, self.joint.uncertainty, rng, draws)
        constants = _drawn(self.constants.point, self.constants.uncertainty, rng, draws)
        return np.hstack((parameters, constants[:, :2]))

    def refitted(self, seed: int) -> Floats:
        """Values (p + 2,) as far on the other side of what was found as a refit of a new record errs."""
        rng = np.random.default_rng(seed)
        made, truth = self._made(rng)
        chosen, tail = self.joint.chosen, self.joint.decay.tail
        found = made.minimise(chosen.parameters, chosen.law, _STEPS).parameters
        constants = period_and_damping(found)
        if tail is not None:
            tail = refit_damped_cosine(made.table.between(tail.start_s, np.inf), tail)
            constants = tail.period_s, tail.damping_per_s
        away = np.subtract(constants, period_and_damping(truth))
        return np.asarray(self.values - np.concatenate((found - chosen.parameters, away)))

    def _made(self, rng: np.random.Generator) -> tuple[FitProblem, Floats]:
        """The problem with readings of a test that differs in all that is not known exactly; its truth."""
        truth, problem = self.joint.chosen.parameters.copy(), self.joint.problem
        deviation = problem.prior_deviation
        known = np.flatnonzero((deviation > 0.0) & np.isfinite(deviation))
        truth[known] = problem.prior_mean[known] + deviation[known] * rng.standard_normal(len(known))
        masses: StandMasses = self.joint.record.masses
        truth[Parameter.GRAVITY] += masses.gravity_uncertainty_m_per_s2 * rng.standard_normal()
        stretch = 1.0 + self.joint.record.clock_scale_uncertainty * rng.standard_normal()
        chosen = self.joint.chosen
        table = predict_gauge_1(truth, problem.table.time_s * stretch, chosen.law)
        table = table + chosen.gauge_rms_m[0] * rng.standard_normal(len(table))
        relative = problem.relative
        if relative is not None:
            second = predict_gauge_2(truth, relative.time_s * stretch, chosen.law, problem.gauge_2_absolute)
            second = second + chosen.gauge_rms_m[1] * rng.standard_normal(len(second))
            relative = Channel(relative.time_s, second)
        return replace(problem, table=Channel(problem.table.time_s, table), relative=relative), truth


def run_monte_carlo(
    drawing: MonteCarloModel,
    results: dict[str, Quantity],
    *,
    refits: int,
    seed: int = 0,
    progress: Callable[[int], None] | None = None,
) -> MonteCarlo:
    """Draw, refit, and compare with the `results` of the budget.

    `refits` is the number of full fits; `progress` is called with the number done.
    """
    constants = {name: len(drawing.joint.chosen.parameters) + place for place, name in enumerate(_CONSTANTS)}
    columns = {name: int(place) for name, place in (_PARAMETERS | constants).items() if name in results}
    linear = drawing.linear(np.random.default_rng(seed), LINEAR_DRAWS)
    full = _refits(drawing, refits, seed, progress)

    def summarise(draws: Floats) -> dict[str, Quantity]:
        summary = {}
        for name, at in columns.items():
            # Results have the sign of the gauge; the fit has a positive pullback.
            side = 1.0 if results[name].value * drawing.values[at] >= 0.0 else -1.0
            summary[name] = _quantity(side * draws[:, at], results[name].unit)
        return summary

    drawn, refitted = summarise(linear), summarise(full) if len(full) > 1 else {}
    compared, count = (refitted, len(full)) if refitted else (drawn, LINEAR_DRAWS)
    tolerances = {name: _tolerance(results[name], quantity, count) for name, quantity in compared.items()}
    agrees = {}
    for name, quantity in compared.items():
        ends = zip(results[name].interval_95, quantity.interval_95, strict=True)
        agrees[name] = max(abs(a - b) for a, b in ends) <= tolerances[name]
    return MonteCarlo(LINEAR_DRAWS, len(full), drawn, refitted, agrees, tolerances)


def _drawn(point: Floats, known: ParameterUncertainty, rng: np.random.Generator, draws: int) -> Floats:
    """Draws (draws, p) about `point` (p,): noise as a whole, every other source from its own distribution."""
    scale = np.sqrt(np.maximum(np.diag(known.noise_covariance), 1e-300))
    values, vectors = np.linalg.eigh(known.noise_covariance / np.outer(scale, scale))
    root = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    result = point + rng.standard_normal((draws, len(point))) @ root.T
    for source, column in known.shifts.items():
        if source.is_rectangular:
            result += rng.uniform(-_SPREAD, _SPREAD, (draws, 1)) * column
        else:
            result += rng.standard_normal((draws, 1)) * column
    return np.asarray(result)


def _refits(
    drawing: MonteCarloModel, refits: int, seed: int, progress: Callable[[int], None] | None
) -> Floats:
    found = []
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for count, values in enumerate(pool.map(drawing.refitted, range(seed, seed + refits)), start=1):
            found.append(values)
            if progress is not None:
                progress(count)
    return np.array(found).reshape(-1, len(drawing.joint.chosen.parameters) + len(_CONSTANTS))


def _quantity(draws: Floats, unit: str) -> Quantity:
    low, high = np.quantile(draws, (0.025, 0.975))
    return Quantity(float(draws.mean()), float(draws.std(ddof=1)), (float(low), float(high)), unit)


def _tolerance(budget: Quantity, drawn: Quantity, count: int) -> float:
    """Half a unit of the second digit of the uncertainty, and three standard errors of a 2.5 % quantile."""
    deviation = max(budget.standard_uncertainty, drawn.standard_uncertainty)
    if deviation == 0.0:
        return 0.0
    rounding = 0.5 * 10.0 ** (np.floor(np.log10(deviation)) - 1.0)
    error = 2.7 * deviation / np.sqrt(count)  # of the quantile of a normal distribution
    return float(rounding + 3.0 * error)
