"""The law that is chosen for a record, and the uncertainty of its parameters with every source."""

from dataclasses import dataclass

import numpy as np

from analysis.arrays import Floats
from analysis.fitting.initial_guess import nonlinearity_slope_error, range_m
from analysis.fitting.problem import FitProblem
from analysis.fitting.search import Fit
from analysis.identification import ModelSelection
from analysis.laws.catalogue import PARAMETER_COUNT
from analysis.laws.parameters import Parameter
from analysis.preparation.free_decay import FreeDecay
from analysis.preparation.plausibility import check_friction
from analysis.quantities import BudgetSource
from analysis.record import Record
from analysis.results.verdict import assess_model, identifiable_fits
from analysis.uncertainty import ParameterUncertainty, levelling_shift, propagate_with_model_choice

_TIME_POWERS = {
    Parameter.FRICTION_DYNAMIC: -2.0,
    Parameter.FRICTION_STATIC: -2.0,
    Parameter.TILT: -2.0,
    Parameter.STIFFNESS: -2.0,
    Parameter.DAMPING: -1.0,
}
"""How a parameter scales when all times are stretched."""
_GRAVITY_POWERS = {Parameter.FRICTION_DYNAMIC: -1.0, Parameter.FRICTION_STATIC: -1.0, Parameter.TILT: -1.0}
_SLOPE_SOURCES = (
    (BudgetSource.GAUGE_1_GAIN, BudgetSource.GAUGE_1_NONLINEARITY),
    (BudgetSource.GAUGE_2_GAIN, BudgetSource.GAUGE_2_NONLINEARITY),
)


@dataclass(frozen=True, eq=False, slots=True)
class JointFit:
    """The chosen law fitted to both gauges, and what results are computed from."""

    record: Record
    decay: FreeDecay
    problem: FitProblem
    chosen: Fit
    """The likeliest law (lowest BIC) among `candidates`."""
    candidates: list[Fit]
    """Fits of the laws whose parameters the record identifies."""
    uncertainty: ParameterUncertainty
    selection: ModelSelection

    @property
    def end_s(self) -> float:
        """Last reading of gauge 1."""
        return float(self.decay.table.time_s[-1])

    @property
    def duration_s(self) -> float:
        """From the fitted release to the last reading."""
        return self.end_s - self.chosen.value(Parameter.RELEASE)


def choose_law(record: Record, decay: FreeDecay, problem: FitProblem, fits: list[Fit]) -> JointFit:
    """Choose the likeliest of the fitted laws and propagate its uncertainty.

    Raises RecordError if the record identifies no law, or f_d exceeds that of any dry plates.
    """
    candidates = identifiable_fits(fits)
    chosen = min(candidates, key=lambda fit: fit.bic)
    check_friction(chosen.value(Parameter.FRICTION_DYNAMIC))
    uncertainty = joint_fit_uncertainty(record, decay, problem, chosen, candidates)
    selection = assess_model(problem, chosen, fits, decay.noise_reading_counts, decay.period_s)
    return JointFit(record, decay, problem, chosen, candidates, uncertainty, selection)


def joint_fit_uncertainty(
    record: Record, decay: FreeDecay, problem: FitProblem, fit: Fit, candidates: list[Fit]
) -> ParameterUncertainty:
    """Distribution of the joint fit with every source: the fit's own, other laws, time base, gravity."""
    return add_systematic_uncertainty(
        record, problem, fit, propagate_with_model_choice(problem, fit, candidates, decay.period_s / 4.0)
    )


def add_systematic_uncertainty(
    record: Record, problem: FitProblem, fit: Fit, own: ParameterUncertainty
) -> ParameterUncertainty:
    """The fit's `own` distribution with what the fit does not know of: time base, gravity, levelling."""
    columns = dict(own.shifts)
    gauges = ((record.table_gauge, problem.table), (record.relative_gauge, problem.relative))
    for (gain_source, nonlinearity_source), (gauge, channel) in zip(_SLOPE_SOURCES, gauges, strict=True):
        column = columns.pop(gain_source, None)  # of the slope: divided between gain and non-linearity
        if column is None or channel is None:
            continue
        gain = gauge.gain_relative or 0.0
        nonlinearity = nonlinearity_slope_error(gauge, range_m(channel.value_m))
        total = float(np.hypot(nonlinearity, gain))
        if total > 0.0:
            columns[gain_source] = column * gain / total
            columns[nonlinearity_source] = column * nonlinearity / total
    columns[BudgetSource.TIME_BASE] = record.clock_scale_uncertainty * _scaled(fit.parameters, _TIME_POWERS)
    gravity = record.masses.gravity_uncertainty_m_per_s2 / record.masses.gravity_m_per_s2
    columns[BudgetSource.GRAVITY] = gravity * _scaled(fit.parameters, _GRAVITY_POWERS)
    tilt = levelling_shift(problem, fit)
    if tilt is not None:
        columns[BudgetSource.LEVELLING] = tilt
    return ParameterUncertainty(columns, own.noise_covariance)


def _scaled(parameters: Floats, powers: dict[Parameter, float]) -> Floats:
    column = np.zeros(PARAMETER_COUNT)
    for place, power in powers.items():
        column[place] = power * parameters[place]
    return column
