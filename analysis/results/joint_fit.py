"""The joint fit of a record: choice of the law, its verdict and uncertainty, curves, and decay constants."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from analysis.arrays import Floats
from analysis.fitting.problem import FitProblem, predict_gauge_1, predict_gauge_2, project_to_bounds
from analysis.fitting.search import Fit, nonlinearity_slope_error, range_m
from analysis.formatting import format_length
from analysis.identification import Curves, Degree, FittedModel, ModelSelection, residual_share
from analysis.laws.catalogue import PARAMETER_COUNT
from analysis.laws.law import FrictionLaw
from analysis.laws.parameters import Parameter
from analysis.laws.stand_parts import SHARED_NAMES, StandModel
from analysis.motion.stand_motion import StandParameter
from analysis.preparation.channels import NOISE_FLOOR_M
from analysis.preparation.free_decay import FreeDecay
from analysis.preparation.oscillation import DampedCosine, check_friction, damped_cosine, envelope_curvature
from analysis.quantities import BudgetSource, ResultWarning, Source, result_warning
from analysis.record import Record, RecordError
from analysis.uncertainty import (
    LinearForm,
    ParameterUncertainty,
    UncertaintyBudget,
    levelling_shift,
    noise_variance_factor,
    numerical_gradient,
    propagate_with_model_choice,
)
from messages.i18n import N_
from messages.message import message

_BAND = 3.2905  # 99.9 % of a normal distribution lie within this many standard deviations
_BEND_SIGMAS = 5.0
_NEGLIGIBLE = 0.25  # of the noise's variance: smaller residuals may have any colour, by rounding


def identifiable_fits(fits: list[Fit]) -> list[Fit]:
    """Fits of those laws whose tilt, if they have one, the record distinguishes from f_d.

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
    residuals = problem.residuals(chosen.parameters, chosen.law)
    channels = (problem.table, problem.relative or problem.table)
    gauges = zip(residuals, channels, problem.noise_m, noise_readings, strict=True)
    for residual, channel, noise, readings in gauges:
        if len(residual):
            white = _white(residual, noise, channel.time_s, period_s)
            adequate &= _small_enough(residual, noise, readings) and white
    tried = tuple(
        FittedModel(f.law.name, f.bic, f.rms_m, float(f.parameters[0]), _parts(f.law)) for f in fits
    )
    count = np.array([len(residual) for residual in residuals])
    noise = float(np.sqrt(count @ np.square(problem.noise_m) / count.sum()))
    share = residual_share(chosen.rms_m, problem.table.value_m)
    parts = _parts(chosen.law)
    degree = (Degree.STAND if parts else Degree.IDEAL) if adequate else Degree.NONE
    return ModelSelection(chosen.law.name, bool(adequate), chosen.rms_m, noise, tried, degree, parts, share)


def _parts(law: FrictionLaw) -> tuple[str, ...]:
    return tuple(effect.name for effect in law.effects) if isinstance(law, StandModel) else ()


def inadequate_warning(judged: ModelSelection) -> ResultWarning:
    """What a law that does not explain the record leaves."""
    return result_warning(
        "model-inadequate",
        "the law {name} leaves {residual_rms_m} of residual for {noise_rms_m} of noise, or a pattern"
        " in it: f_d may be biased.",
        name=judged.name,
        residual_rms_m=format_length(judged.residual_rms_m),
        noise_rms_m=format_length(judged.noise_rms_m),
    )


def identifiability_warnings(
    chosen: Fit, uncertainty: ParameterUncertainty, *, slip_ended: bool
) -> Iterator[ResultWarning]:
    """Warn of what the record does not determine about the chosen law and its motion."""
    if not slip_ended:
        yield result_warning(
            "slip-not-ended",
            "by the fitted motion the plate slips at the end of the record or again after it: u_s"
            " and the end of slip are not known. Record until the plate sticks.",
        )
    if not chosen.determines(Parameter.FRICTION_DYNAMIC):
        yield result_warning(
            "friction-not-identified",
            "f_d does not change the fitted motion, so that it has no value: no slip was fitted.",
        )
    elif BudgetSource.LEVELLING in uncertainty.shifts:
        yield result_warning(
            "tilt-not-identified",
            "the plate slips one way only: tilt and f_d act alike. f_d holds for a plane level to 2"
            " mrad, which its uncertainty includes.",
        )
    if chosen.law.has_static_friction and not chosen.determines(Parameter.FRICTION_STATIC):
        template = N_("no stick ends in a slip: f_s has bounds, but no value.")
        yield result_warning("static-not-identified", template)


def tail_warnings(decay: FreeDecay) -> Iterator[ResultWarning]:
    """Warn of a stick tail that does not decay exponentially, as dry friction in the stand makes it."""
    tail = decay.tail
    if tail is None or tail.rms_m < 2.0 * NOISE_FLOOR_M:
        return
    bend = envelope_curvature(decay.table.between(tail.start_s, np.inf), tail)
    if abs(bend) >= _BEND_SIGMAS:
        damping = message("damping that grows with the swing")
        yield result_warning(
            "tail-not-exponential",
            "the stick tail does not decay exponentially ({bend:.0f} standard deviations), as from"
            " {cause}: n1 is a mean. Identify a run of the bare table.",
            bend=abs(bend),
            cause=message("dry friction in the stand") if bend < 0.0 else damping,
        )


def _small_enough(residual: Floats, noise_m: float, noise_readings: int) -> bool:
    ratio = float(residual @ residual) / len(residual) / noise_m**2
    spread = np.sqrt(2.0 / len(residual) + 2.0 / max(2, noise_readings))
    return ratio <= float(np.exp(_BAND * spread))


def _white(residual: Floats, noise_m: float, time_s: Floats, period_s: float) -> bool:
    """Tell whether means over eighths of a period scatter like those of white noise of the same size."""
    edges = np.arange(time_s[0], time_s[-1], period_s / 8.0)
    bounds = np.concatenate(([0], np.searchsorted(time_s, edges[1:]), [len(residual)]))
    counts = np.diff(bounds)
    used = counts > 0
    sums = np.add.reduceat(residual, bounds[:-1][used]) / noise_m
    square = max(float(residual @ residual) / len(residual) / noise_m**2, _NEGLIGIBLE)
    scatter = float(np.sum(sums**2 / counts[used])) / square
    # Chi-square stays below this limit in 99.95 % (Wilson and Hilferty).
    freedom = int(used.sum())
    small = 2.0 / (9.0 * freedom)
    return scatter <= float(freedom * (1.0 - small + _BAND * np.sqrt(small)) ** 3)


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
    chosen: Fit  # the likeliest law (lowest BIC) among `candidates`
    candidates: list[Fit]  # fits of the laws whose parameters the record identifies
    uncertainty: ParameterUncertainty
    selection: ModelSelection

    @property
    def end_s(self) -> float:
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


def choose_stand(
    record: Record, decay: FreeDecay, fit: Fit, problem: FitProblem, ideal: list[Fit]
) -> JointFit:
    """Choose a fit with effects of the stand over those of an ideal stand, which are only reported."""
    check_friction(fit.value(Parameter.FRICTION_DYNAMIC))
    uncertainty = joint_fit_uncertainty(record, decay, problem, fit, [fit])
    selection = assess_model(problem, fit, [*ideal, fit], decay.noise_reading_counts, decay.period_s)
    return JointFit(record, decay, problem, fit, [fit], uncertainty, selection)


def joint_fit_uncertainty(
    record: Record, decay: FreeDecay, problem: FitProblem, fit: Fit, candidates: list[Fit]
) -> ParameterUncertainty:
    """Distribution of the joint fit with every source: the fit's own, other laws, time base, gravity."""
    own = propagate_with_model_choice(problem, fit, candidates, decay.period_s / 4.0)
    return add_systematic_uncertainty(record, problem, fit, own)


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
    column = np.zeros(len(parameters))
    for place, power in powers.items():
        column[place] = power * parameters[place]
    return column


FRICTION_PARAMETERS = {
    Parameter.FRICTION_DYNAMIC: "friction_dynamic",
    Parameter.FRICTION_STATIC: "friction_static",
}
"""Chi-square about them may have kinks."""
PARAMETER_NAMES = {
    **FRICTION_PARAMETERS,
    Parameter.STIFFNESS: "stiffness_n_per_m",
    Parameter.DAMPING: "damping_coefficient_kg_per_s",
    Parameter.PULLBACK: "pullback_m",
    Parameter.TILT: "tilt_rad",
    Parameter.TABLE_MASS: "table_mass_kg",
    Parameter.PLATE_MASS: "plate_mass_kg",
    Parameter.GRAVITY: "gravity_m_per_s2",
}
_ODD = (
    StandParameter.RELEASE_VELOCITY,
    StandParameter.SPRING_ASYMMETRY,
    StandParameter.GRADIENT,
    StandParameter.ASYMMETRY,
)
SIGNED_PARAMETERS = (Parameter.PULLBACK, Parameter.TILT, *(PARAMETER_COUNT + place for place in _ODD))
"""Places of what changes its sign with the direction of the pull."""


def law_places(law: FrictionLaw) -> dict[int, str]:
    """Places and names of a law's own parameters, those of the stand and the gauges among them."""
    names = [own.name for own in law.own]
    shared = {place: name for place, (name, _) in SHARED_NAMES.items() if place in law.extra}
    return dict(zip(law.own_places.tolist(), names, strict=True)) | shared


def named_parameters(fit: Fit, decay: FreeDecay) -> dict[str, float]:
    """Parameters of the motion by name, in the frame of the record; `release_s` in the record's time."""
    named = {
        name: float(fit.parameters[place]) * (decay.sign if place in SIGNED_PARAMETERS else 1)
        for place, name in (PARAMETER_NAMES | law_places(fit.law)).items()
    }
    return {**named, "release_s": decay.channels.to_record_time(fit.value(Parameter.RELEASE))}


def fitted_curves(fit: Fit, decay: FreeDecay, delays_s: tuple[float, float]) -> Callable[[Floats], Curves]:
    """What both gauges should read at record times; `delays_s` are the gauges' known delays."""

    def curves(time_s: Floats) -> Curves:
        true_s = decay.channels.from_record_time(np.array(time_s, dtype=np.float64))
        since_s = true_s - decay.release.time_s
        first = predict_gauge_1(fit.parameters, true_s - delays_s[0], fit.law)
        table = decay.sign * (first + decay.table_drift_m_per_s * (since_s - delays_s[0]))
        if decay.relative is None:
            return Curves(table, None)
        second = predict_gauge_2(fit.parameters, true_s - delays_s[1], fit.law, decay.gauge_2_absolute)
        drifted = second + decay.drift_m_per_s * (since_s - delays_s[1])
        return Curves(table, decay.relative_sign * drifted)

    return curves


def friction_objective(problem: FitProblem, fit: Fit, fitted: float) -> Callable[[Floats], Floats]:
    """Chi-square at values of f_d, f_s in the fitted ratio to it and all else as fitted.

    `fitted` is f_d of the fit, which is a mean where friction varies.
    """

    def objective(friction_dynamic: Floats) -> Floats:
        points = [_with_friction(fit, friction / fitted) for friction in friction_dynamic.tolist()]
        return np.array([problem.chi_square(point, fit.law) for point in points])

    return objective


def friction_curves(
    fit: Fit, fitted: float, decay: FreeDecay, delays_s: tuple[float, float]
) -> Callable[[float, Floats], Curves]:
    """What both gauges would read with another f_d, all else as for `friction_objective`."""

    def curves(friction_dynamic: float, time_s: Floats) -> Curves:
        moved = replace(fit, parameters=_with_friction(fit, friction_dynamic / fitted))
        return fitted_curves(moved, decay, delays_s)(time_s)

    return curves


def _with_friction(fit: Fit, ratio: float) -> Floats:
    both = [Parameter.FRICTION_DYNAMIC, Parameter.FRICTION_STATIC]
    point = fit.parameters.copy()
    point[both] *= ratio
    return project_to_bounds(point, fit.law)


@dataclass(frozen=True, eq=False, slots=True)
class DecayConstants:
    """Period, n1 and masses (T, n1, m1, m2) with their linearised distribution."""

    point: Floats
    uncertainty: ParameterUncertainty


def constants_from_tail(record: Record, decay: FreeDecay) -> DecayConstants:
    """Period and n1 of the stick tail. The decay must have one."""
    tail = decay.tail
    if tail is None:
        raise ValueError("no stick tail was fitted: take joint_constants")
    point = np.array(
        [tail.period_s, tail.damping_per_s, record.masses.table_mass_kg, record.masses.plate_mass_kg]
    )
    times = np.linspace(tail.start_s, tail.end_s, len(tail.residual_m))
    unit = tail.residual_m / max(tail.rms_m, 1e-300)
    by_shape = np.array([[0.0, -(tail.period_s**2) / (2.0 * np.pi)], [1.0, 0.0]])
    factor = noise_variance_factor(unit, times, decay.period_s / 4.0)
    noise = np.zeros((4, 4))
    noise[:2, :2] = factor * by_shape @ tail.covariance[:2, :2] @ by_shape.T
    bend = np.append(by_shape @ _shift_by_bend(record, decay, tail), (0.0, 0.0))
    columns: dict[Source, Floats] = {
        BudgetSource.TABLE_MASS: np.array([0.0, 0.0, record.masses.table_mass_uncertainty_kg, 0.0]),
        BudgetSource.PLATE_MASS: np.array([0.0, 0.0, 0.0, record.masses.plate_mass_uncertainty_kg]),
        BudgetSource.TIME_BASE: record.clock_scale_uncertainty * point * np.array([1.0, -1.0, 0.0, 0.0]),
        BudgetSource.GAUGE_1_NONLINEARITY: bend,
    }
    return DecayConstants(point, ParameterUncertainty(columns, noise))


def _shift_by_bend(record: Record, decay: FreeDecay, tail: DampedCosine) -> Floats:
    """Shift (2,) of n1 and w by one standard uncertainty of the non-linearity of a gauge."""
    if record.table_gauge.nonlinearity_m == 0.0:
        return np.zeros(2)
    tau_s = np.linspace(0.0, tail.end_s - tail.start_s, len(tail.residual_m))
    curve, slopes = damped_cosine(tail.parameters, tau_s)
    bend = record.table_gauge.nonlinearity_at(curve, tail.offset_m, 0.5 * range_m(decay.table.value_m))
    return np.asarray(np.linalg.solve(slopes @ slopes.T, slopes @ bend)[:2])


def constants_from_joint_fit(fit: Fit, fitted: ParameterUncertainty) -> DecayConstants:
    """Period and n1 from the joint fit."""
    slopes = np.stack([numerical_gradient(part, fit.parameters) for part in _CONSTANTS])
    columns = {source: slopes @ column for source, column in fitted.shifts.items()}
    point = np.array([part(fit.parameters) for part in _CONSTANTS])
    return DecayConstants(point, ParameterUncertainty(columns, slopes @ fitted.noise_covariance @ slopes.T))


def period_and_damping(parameters: Floats) -> tuple[float, float]:
    """Period (s) and n1 (1/s) of fitted parameters (p,)."""
    return _period(parameters), _n1(parameters)


def add_constants(constants: DecayConstants, budget: UncertaintyBudget) -> None:
    """Add period, damping and stiffness to the budget."""
    for name, function in DECAY_QUANTITIES.items():
        weights = numerical_gradient(function, constants.point)
        form = LinearForm(constants.uncertainty, weights)
        budget.add(name, function(constants.point), form.contributions(), form=form)


def _mass(p: Floats) -> float:
    return float(p[Parameter.TABLE_MASS] + p[Parameter.PLATE_MASS])


def _n1(p: Floats) -> float:
    return float(p[Parameter.DAMPING]) / (2.0 * _mass(p))


def _period(p: Floats) -> float:
    return float(2.0 * np.pi / np.sqrt(p[Parameter.STIFFNESS] / _mass(p) - _n1(p) ** 2))


_CONSTANTS: tuple[Callable[[Floats], float], ...] = (
    _period,
    _n1,
    lambda p: float(p[Parameter.TABLE_MASS]),
    lambda p: float(p[Parameter.PLATE_MASS]),
)


def _k1(p: Floats) -> float:
    return float(np.hypot(2.0 * np.pi / p[0], p[1]))


DECAY_QUANTITIES: dict[str, Callable[[Floats], float]] = {
    "period_s": lambda p: float(p[0]),
    "log_decrement": lambda p: float(p[0] * p[1]),
    "damping_n1_per_s": lambda p: float(p[1]),
    "damping_n2_per_s": lambda p: float(p[1] * (p[2] + p[3]) / p[2]),
    "damping_coefficient_kg_per_s": lambda p: float(2.0 * p[1] * (p[2] + p[3])),
    "frequency_k1_rad_per_s": _k1,
    "frequency_k2_rad_per_s": lambda p: _k1(p) * float(np.sqrt((p[2] + p[3]) / p[2])),
    "stiffness_n_per_m": lambda p: _k1(p) ** 2 * float(p[2] + p[3]),
}
