"""Period, damping and stiffness of the stand, from the stick tail or from the joint fit."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from analysis.arrays import Floats
from analysis.damped_cosine import DampedCosine, damped_cosine
from analysis.fitting.search import Fit
from analysis.laws.parameters import Parameter
from analysis.preparation.free_decay import FreeDecay
from analysis.quantities import BudgetSource, Source
from analysis.record import Record
from analysis.uncertainty import (
    ParameterUncertainty,
    UncertaintyBudget,
    noise_variance_factor,
    numerical_gradient,
)


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
    noise = np.zeros((4, 4))
    noise[:2, :2] = (
        noise_variance_factor(unit, times, decay.period_s / 4.0)
        * by_shape
        @ tail.covariance[:2, :2]
        @ by_shape.T
    )
    columns: dict[Source, Floats] = {
        BudgetSource.TABLE_MASS: np.array([0.0, 0.0, record.masses.table_mass_uncertainty_kg, 0.0]),
        BudgetSource.PLATE_MASS: np.array([0.0, 0.0, 0.0, record.masses.plate_mass_uncertainty_kg]),
        BudgetSource.TIME_BASE: record.clock_scale_uncertainty * point * np.array([1.0, -1.0, 0.0, 0.0]),
        BudgetSource.GAUGE_1_NONLINEARITY: np.append(
            by_shape @ _shift_by_bend(record, decay, tail), (0.0, 0.0)
        ),
    }
    return DecayConstants(point, ParameterUncertainty(columns, noise))


def _shift_by_bend(record: Record, decay: FreeDecay, tail: DampedCosine) -> Floats:
    """Shift (2,) of n1 and w by one standard uncertainty of a bent gauge: large swings read other than small.

    As for one mass, the deviation from the calibration line is odd and vanishes at both ends of the range in
    use (T3 of Chebyshev).
    """
    tau_s = np.linspace(0.0, tail.end_s - tail.start_s, len(tail.residual_m))
    curve, slopes = damped_cosine(tail.parameters, tau_s)
    share = (curve - tail.offset_m) / max(0.5 * float(np.ptp(decay.table.value_m)), 1e-300)
    bend = record.table_gauge.nonlinearity_m / np.sqrt(3.0) * (4.0 * share**3 - 3.0 * share)
    return np.asarray(np.linalg.solve(slopes @ slopes.T, slopes @ bend)[:2])


def constants_from_joint_fit(fit: Fit, fitted: ParameterUncertainty) -> DecayConstants:
    """Period and n1 from the joint fit."""
    slopes = np.stack([numerical_gradient(part, fit.parameters) for part in _CONSTANTS])
    columns = {source: slopes @ column for source, column in fitted.shifts.items()}
    point = np.array([part(fit.parameters) for part in _CONSTANTS])
    return DecayConstants(point, ParameterUncertainty(columns, slopes @ fitted.noise_covariance @ slopes.T))


def period_and_damping(parameters: Floats) -> tuple[float, float]:
    """Period (s) and n1 (1/s) of fitted parameters (16,)."""
    return _period(parameters), _n1(parameters)


def add_constants(constants: DecayConstants, budget: UncertaintyBudget) -> None:
    """Add period, damping and stiffness to the budget."""
    for name, unit, function in _DECAY_QUANTITIES:
        weights = numerical_gradient(function, constants.point)
        budget.add(name, function(constants.point), unit, constants.uncertainty.contributions(weights))


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


_DECAY_QUANTITIES: tuple[tuple[str, str, Callable[[Floats], float]], ...] = (
    ("period_s", "s", lambda p: float(p[0])),
    ("log_decrement", "1", lambda p: float(p[0] * p[1])),
    ("damping_n1_per_s", "1/s", lambda p: float(p[1])),
    ("damping_n2_per_s", "1/s", lambda p: float(p[1] * (p[2] + p[3]) / p[2])),
    ("damping_coefficient_kg_per_s", "kg/s", lambda p: float(2.0 * p[1] * (p[2] + p[3]))),
    ("frequency_k1_rad_per_s", "rad/s", _k1),
    ("frequency_k2_rad_per_s", "rad/s", lambda p: _k1(p) * float(np.sqrt((p[2] + p[3]) / p[2]))),
    ("stiffness_n_per_m", "N/m", lambda p: _k1(p) ** 2 * float(p[2] + p[3])),
)
