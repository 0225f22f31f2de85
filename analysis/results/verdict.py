"""Which friction law is chosen, and whether it explains the record."""

import numpy as np

from analysis.arrays import Floats
from analysis.damped_cosine import envelope_curvature
from analysis.fitting.problem import FitProblem
from analysis.fitting.search import Fit
from analysis.formatting import format_length
from analysis.identification import FittedModel, ModelSelection
from analysis.laws.parameters import Parameter
from analysis.preparation.free_decay import FreeDecay
from analysis.preparation.noise import NOISE_FLOOR_M
from analysis.quantities import BudgetSource, ResultWarning
from analysis.record import RecordError
from analysis.uncertainty import ParameterUncertainty
from messages.message import message

_BAND = 3.2905
"""99.9 % of a normal distribution lie within this many standard deviations."""
_BEND_SIGMAS = 5.0
_NEGLIGIBLE = 0.25
"""Residuals of a smaller share of the noise's variance may have any colour: rounding and converters do."""


def identifiable_fits(fits: list[Fit]) -> list[Fit]:
    """Fits of those laws whose tilt, if they have one, the record tells from f_d.

    Raises RecordError if there is none.
    """
    candidates = [fit for fit in fits if not fit.law.has_tilt or fit.determines(Parameter.TILT)]
    if not candidates:
        raise RecordError(
            "{law} cannot be identified: the plate slips one way only, so that tilt_rad and"
            " friction_dynamic act alike. Choose a model without tilt.",
            law=fits[0].law.name,
        )
    return candidates


def assess_model(
    problem: FitProblem, chosen: Fit, fits: list[Fit], noise_readings: tuple[int, int], period_s: float
) -> ModelSelection:
    """Judge the chosen law by size and colour of its residuals.

    `noise_readings` is the number of readings from which the noise of each gauge was measured.
    """
    adequate = True
    residuals = (chosen.table_residual_m, chosen.relative_residual_m)
    times = (
        problem.table.time_s,
        problem.table.time_s if problem.relative is None else problem.relative.time_s,
    )
    for residual, time, noise, readings in zip(
        residuals, times, problem.noise_m, noise_readings, strict=True
    ):
        if len(residual):
            adequate &= _small_enough(residual, noise, readings) and _white(residual / noise, time, period_s)
    tried = tuple(FittedModel(f.law.name, f.bic, f.rms_m, float(f.parameters[0])) for f in fits)
    count = np.array([len(residual) for residual in residuals])
    noise = float(np.sqrt(count @ np.square(problem.noise_m) / count.sum()))
    return ModelSelection(chosen.law.name, bool(adequate), chosen.rms_m, noise, tried)


def inadequate_warning(judged: ModelSelection) -> ResultWarning:
    """What a law that does not explain the record leaves."""
    text = message(
        "the law {name} leaves {residual_rms_m} of residual for {noise_rms_m} of noise, or a pattern"
        " in it: f_d may be biased.",
        name=judged.name,
        residual_rms_m=format_length(judged.residual_rms_m),
        noise_rms_m=format_length(judged.noise_rms_m),
    )
    return ResultWarning("model-inadequate", text)


def identifiability_warnings(
    chosen: Fit, uncertainty: ParameterUncertainty, *, slip_ended: bool
) -> list[ResultWarning]:
    """Warn of what the record does not determine about the chosen law and its motion."""
    warnings = []
    if not slip_ended:
        text = message(
            "by the fitted motion the plate slips at the end of the record or again after it: u_s"
            " and the end of slip are not known. Record until the plate sticks."
        )
        warnings.append(ResultWarning("slip-not-ended", text))
    if not chosen.determines(Parameter.FRICTION_DYNAMIC):
        text = message("f_d does not change the fitted motion, so that it has no value: no slip was fitted.")
        warnings.append(ResultWarning("friction-not-identified", text))
    if BudgetSource.LEVELLING in uncertainty.shifts:
        text = message(
            "the plate slips one way only: tilt and f_d act alike. f_d holds for a plane level to 2"
            " mrad, which its uncertainty includes."
        )
        warnings.append(ResultWarning("tilt-not-identified", text))
    if chosen.law.has_static_friction and not chosen.determines(Parameter.FRICTION_STATIC):
        text = message("no stick ends in a slip: f_s has bounds, but no value.")
        warnings.append(ResultWarning("static-not-identified", text))
    return warnings


def tail_warnings(decay: FreeDecay) -> list[ResultWarning]:
    """Whether the stick tail decays otherwise than exponentially, as dry friction in the stand makes it."""
    tail = decay.tail
    if tail is None or tail.rms_m < 2.0 * NOISE_FLOOR_M:
        return []
    bend = envelope_curvature(decay.table.between(tail.start_s, np.inf), tail)
    if abs(bend) < _BEND_SIGMAS:
        return []
    cause = (
        message("dry friction in the stand") if bend < 0.0 else message("damping that grows with the swing")
    )
    text = message(
        "the stick tail does not decay exponentially ({bend:.0f} standard deviations), as from"
        " {cause}: n1 is a mean. Identify a run of the bare table.",
        bend=abs(bend),
        cause=cause,
    )
    return [ResultWarning("tail-not-exponential", text)]


def _small_enough(residual: Floats, noise_m: float, noise_readings: int) -> bool:
    """Tell whether the mean square is within the band that both samples' sizes allow."""
    ratio = float(np.mean(residual**2)) / noise_m**2
    spread = np.sqrt(2.0 / len(residual) + 2.0 / max(2, noise_readings))
    return ratio <= float(np.exp(_BAND * spread))


def _white(residual: Floats, time_s: Floats, period_s: float) -> bool:
    """Tell whether means over eighths of a period scatter like those of white noise of the same size."""
    edges = np.arange(time_s[0], time_s[-1], period_s / 8.0)
    bounds = np.concatenate(([0], np.searchsorted(time_s, edges[1:]), [len(residual)]))
    counts = np.diff(bounds)
    sums = np.diff(np.concatenate(([0.0], np.cumsum(residual)))[bounds])
    used = counts > 0
    square = max(float(np.mean(residual**2)), _NEGLIGIBLE)
    scatter = float(np.sum(sums[used] ** 2 / counts[used])) / square
    # Chi-square stays below this limit in 99.95 % (Wilson and Hilferty).
    freedom = int(used.sum())
    small = 2.0 / (9.0 * freedom)
    return scatter <= float(freedom * (1.0 - small + _BAND * np.sqrt(small)) ** 3)
