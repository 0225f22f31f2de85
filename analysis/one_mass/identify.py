"""Identification of one mass in free decay: period, viscous damping, and Coulomb friction if there is any."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Final, Literal

import numpy as np

from analysis.arrays import Floats
from analysis.catalogue import Place, definition
from analysis.formatting import format_number, format_with_unit
from analysis.identification import Curves, Degree, Events, Identification, ModelSelection, residual_share
from analysis.motion.one_mass import OneMassDecay, simulate
from analysis.one_mass.fit import COULOMB, OneMassFit, Parameters, curve, parameter_shift
from analysis.one_mass.free_decay import FreeDecayFit, fit_free_decay
from analysis.one_mass.parts import Part, mean_damping, parts_of
from analysis.one_mass.turning_points import classical_log_decrement, find_turning_points
from analysis.preparation.channels import Channel, Channels, read_channels
from analysis.quantities import BudgetSource, Quantity, ResultWarning, Source, result_warning
from analysis.record import AnalysisError, Record, StandMasses
from analysis.uncertainty import (
    LinearForm,
    ParameterUncertainty,
    UncertaintyBudget,
    numerical_gradient,
    unstated_clock,
)
from messages.i18n import N_
from messages.message import message

MeasuredQuantity = Literal["displacement", "velocity", "acceleration"]

_ORDERS: Final[dict[str, int]] = {"displacement": 0, "velocity": 1, "acceleration": 2}
_PER_TIME: Final = ("", "/s", "/s²")
_SIGNIFICANT_SIGMAS: Final = 3.3  # of x_k above zero, to claim friction: 1 in 2000 by chance


def identify_one_mass(
    record: Record,
    *,
    quantity: MeasuredQuantity = "displacement",
    unit: str = "m",
    mass: Quantity | None = None,
) -> Identification:
    """Identify period, viscous and Coulomb damping of one free decay from gauge 1 of `record`.

    The motion m u'' + 2 m n u' + c u + F sign(u') = 0 is fitted in the time domain, from where it surely
    moves freely until shortly before its stop. Where x_k = F / c comes out negative, as where damping rises
    with the swing, x_k is held at 0 and n fitted again; likewise n. Uncertainties are those with both free,
    so the interval of n holds also where friction is too small to be seen; it is then not claimed
    (``labels["coulomb_significant"]`` is False, and x_k is given with an interval from 0). Uneven times,
    gaps, an initial hold, an offset, either sign and coarse steps are taken as they are.

    `quantity` is what gauge 1 reads, `unit` that of the displacement and x_k in any case: "m", "rad", "V".
    With the moving `mass` (kg) come stiffness and damping coefficient. See `single_channel`.

    Raises RecordError for a record without a free decay (noise, a driven or growing swing, a step, under two
    periods, several modes), AnalysisError for an unknown `quantity` or a mass that is not positive.
    """
    if quantity not in _ORDERS:
        raise AnalysisError(
            "quantity {quantity!r} is unknown. Choose one of {orders}.",
            quantity=quantity,
            orders=", ".join(_ORDERS),
        )
    if mass is not None and not 0.0 < mass.value < math.inf:
        raise AnalysisError(
            "mass {mass!r} kg is not a positive number. Give the moving mass.", mass=mass.value
        )
    channels, warnings = read_channels(record.replace(relative_displacement_m=None))
    order = _ORDERS[quantity]
    solution = fit_free_decay(channels.table, order, unit + _PER_TIME[order])
    budget = _uncertainty_budget(solution, record, unit, mass)
    return _identification(record, channels, solution, budget, [*warnings, *solution.warnings])


def single_channel(time_s: Floats, value: Floats) -> Record:
    """Record of one channel (n,) at `time_s` (n,), of a body with unknown masses."""
    return Record(
        np.asarray(time_s, dtype=np.float64), np.asarray(value, dtype=np.float64), None, StandMasses(1.0, 1.0)
    )


def mass_from_added_mass(
    period_alone: Quantity,
    period_loaded: Quantity,
    added: Quantity,
    damping_alone: Quantity | None = None,
    damping_loaded: Quantity | None = None,
) -> Quantity:
    """Mass (kg) from the damped periods (s) without and with a known `added` mass (kg) on the same spring.

    m = added / (k1^2 / k2^2 - 1), k^2 = (2 pi / T)^2 + n^2; without damping constants (1/s), n = 0.
    Errors that both runs share cancel in the ratio: give periods with the uncertainty of each run alone.
    Raises AnalysisError unless the loaded period is the longer one.
    """
    none = Quantity.normal(0.0, 0.0, "1/s")
    given = (period_alone, period_loaded, added, damping_alone or none, damping_loaded or none)

    def mass(point: Floats) -> float:
        alone, loaded, extra, n_alone, n_loaded = point
        ratio = np.hypot(2.0 * np.pi / alone, n_alone) / np.hypot(2.0 * np.pi / loaded, n_loaded)
        return float(extra / (ratio**2 - 1.0))

    point = np.array([quantity.value for quantity in given])
    if not (np.isfinite(point).all() and 0.0 < point[0] < point[1] and point[2] > 0.0 and mass(point) > 0.0):
        raise AnalysisError(
            "periods of {alone_s:.6g} s alone and {loaded_s:.6g} s with {added_kg:.6g} kg give no"
            " mass. The loaded period must be the longer one.",
            alone_s=point[0],
            loaded_s=point[1],
            added_kg=point[2],
        )
    deviations = np.array([quantity.standard_uncertainty for quantity in given])
    combined = float(np.linalg.norm(numerical_gradient(mass, point) * deviations))
    return Quantity.normal(mass(point), combined, "kg")


def _is_significant(solution: FreeDecayFit) -> bool:
    """Tell whether the readings need friction: by the uncertainty of x_k, and by the fit without it."""
    found = solution.fit
    variance = found.uncertainty(COULOMB) ** 2
    factor = found.noise_factor
    better = solution.viscous.cost - found.cost
    limit = _SIGNIFICANT_SIGMAS**2 * factor
    clear = found.parameters.coulomb > 0.0 and found.parameters.coulomb**2 > limit * variance
    return bool(clear and better > limit * found.rms**2)


def _identification(
    record: Record,
    channels: Channels,
    solution: FreeDecayFit,
    budget: UncertaintyBudget,
    warnings: list[ResultWarning],
) -> Identification:
    significant, parameters = _is_significant(solution), solution.fit.parameters
    if not significant:
        _clip_coulomb(budget)
    warnings += _classical_figures(channels.table, solution, budget, significant)
    verdict = solution.verdict
    share = residual_share(verdict.rms, solution.fit.channel.value_m)
    if not solution.adequate:
        template = _HOLDS if solution.holds else _FAILS
        text = message(
            template,
            rms=format_with_unit(verdict.rms, solution.unit),
            noise=format_with_unit(verdict.noise, solution.unit),
            share_percent=format_number(100.0 * share, 2),
        )
        warnings.append(ResultWarning("model-inadequate", text))
    law = "viscous+coulomb" if significant else "viscous"
    parts = parts_of(parameters)
    for part in parts:
        size = definition(part.result).format(budget.results[part.result], Place.WINDOW)
        warnings.append(result_warning(part.name, part.text, size=str(size)))
    degree = Degree.FRICTION if solution.holds else Degree.NONE
    if solution.adequate:
        degree = Degree.STAND if parts else Degree.IDEAL
    return Identification(
        "one-mass",
        budget.results,
        {"coulomb_significant": significant},
        ModelSelection(
            law,
            solution.adequate,
            verdict.rms,
            verdict.noise,
            degree=degree,
            parts=tuple(part.name for part in parts),
            residual_share=share,
        ),
        budget.lines + unstated_clock(record, budget.results),
        _events(channels, solution, significant),
        warnings,
        {
            "turning_s": channels.to_record_time(parameters.turning_s),
            "turning_displacement_m": parameters.turning,
            "period_s": parameters.period_s,
            "damping_n_per_s": parameters.damping_n_per_s,
            _COULOMB: parameters.coulomb,
            "offset": parameters.offset,
        }
        | {part.result: part.size(parameters) for part in parts},
        _curves(channels, solution.fit, record.table_gauge.lateness_s),
        correlation=budget.correlation(),
    )


def _uncertainty_budget(
    solution: FreeDecayFit, record: Record, unit: str, mass: Quantity | None
) -> UncertaintyBudget:
    """All quantities with their uncertainty by source; the point is (the fitted parameters, mass)."""
    found = solution.fit
    value, deviation = (0.0, 0.0) if mass is None else (mass.value, mass.standard_uncertainty)
    point = np.array([*found.parameters, value])
    noise = np.zeros((len(point), len(point)))
    noise[:-1, :-1] = found.noise_factor * found.covariance
    columns = _sources(found, record)
    columns[BudgetSource.MASS] = np.append(np.zeros(len(point) - 1), deviation)
    if solution.spread is not None:
        columns[BudgetSource.MODEL] = np.append(solution.spread, 0.0)
    budget, known = UncertaintyBudget(), ParameterUncertainty(columns, noise)
    for name, function in _functions(found, with_mass=mass is not None).items():
        form = LinearForm(known, numerical_gradient(function, point))
        units = {_COULOMB: unit, "drag_per_m": f"1/{unit}"}
        budget.add(name, function(point), form.contributions(), unit=units.get(name, ""), form=form)
    return budget


def _functions(found: OneMassFit, *, with_mass: bool) -> dict[str, Callable[[Floats], float]]:
    """Results as functions of (the fitted parameters, mass)."""

    def of_part(part: Part) -> Callable[[Floats], float]:
        return lambda point: part.size(Parameters(*point[:-1].tolist()))

    def mean(point: Floats) -> float:
        return mean_damping(Parameters(*point[:-1].tolist()), *found.channel.time_s[[0, -1]].tolist())

    present = parts_of(found.parameters)
    parts = {part.result: of_part(part) for part in present}
    if not all(part.bends_spring for part in present):
        parts["damping_mean_per_s"] = mean
    return _QUANTITIES | parts | (_WITH_MASS if with_mass else {})


def _sources(found: OneMassFit, record: Record) -> dict[Source, Floats]:
    """Shift (11,) of parameters and mass by one standard uncertainty of each stated source."""
    parameters, gauge = found.parameters, record.table_gauge
    order = float(found.order)
    values = np.array([*parameters, 0.0])
    length_powers = np.array([0.0, 1.0, 0.0, 0.0, 1.0, 0.0, -2.0, -2.0, -1.0, -2.0, 0.0])
    time_powers = order * length_powers + np.array([1.0, 0.0, -1.0, -1.0, *[0.0] * 7])
    readings = found.channel.value_m
    reach = float(np.abs(readings - parameters.offset).max())
    bend = gauge.nonlinearity_at(readings, parameters.offset, reach)
    return {
        BudgetSource.TIME_BASE: record.clock_scale_uncertainty / record.clock_scale * time_powers * values,
        BudgetSource.GAUGE_1_GAIN: (gauge.gain_relative or 0.0) * length_powers * values,
        BudgetSource.GAUGE_1_NONLINEARITY: np.append(parameter_shift(found, bend), 0.0),
    }


def _clip_coulomb(budget: UncertaintyBudget) -> None:
    """Without significance, the interval of x_k begins at zero."""
    coulomb = budget.results[_COULOMB]
    budget.results[_COULOMB] = replace(coulomb, interval_95=(0.0, coulomb.interval_95[1]))


def _classical_figures(
    readings: Channel, solution: FreeDecayFit, budget: UncertaintyBudget, significant: bool
) -> list[ResultWarning]:
    """Add the plain log decrement to the budget; warn where friction biases it."""
    found = solution.fit
    parameters = found.parameters
    quarter_s = 0.25 * parameters.period_s if found.order == 1 else 0.0
    first_s = parameters.turning_s + quarter_s
    while first_s - 0.25 * parameters.period_s < found.channel.time_s[0]:
        first_s += 0.5 * parameters.period_s
    turning = find_turning_points(readings, first_s, parameters.period_s)
    classical = classical_log_decrement(turning, found.rms)
    if classical is None:
        return []
    value, deviation = classical
    budget.add("log_decrement_classical", value, {BudgetSource.NOISE: deviation})
    if not significant:
        return []
    displacement = budget.results[_COULOMB].unit
    return [
        result_warning(
            "coulomb-biases-log-decrement",
            "dry friction is significant (x_k = {coulomb}): the plain log decrement {value} is biased,"
            " its viscous part is {results}.",
            coulomb=format_with_unit(parameters.coulomb, displacement),
            value=format_number(value, 4),
            results=format_number(budget.results["log_decrement"].value, 4),
        )
    ]


def _events(channels: Channels, solution: FreeDecayFit, significant: bool) -> Events:
    """When the mass comes to rest, where friction stops it within the record, or a hand ends the decay."""
    parameters, stopped_s = solution.fit.parameters, solution.stopped_s
    if stopped_s is not None:
        return Events(free_decay_end_s=channels.to_record_time(stopped_s))
    if not significant or parameters.damping_n_per_s < 0.0 or not parameters.is_linear:
        return Events()
    start = parameters.turning_s, parameters.turning
    decay = OneMassDecay(parameters.period_s, parameters.damping_n_per_s, parameters.coulomb, *start)
    stop_s = simulate(decay, channels.table.time_s[-1:]).stop_s
    return Events(rest_s=None if stop_s is None else channels.to_record_time(stop_s))


def _curves(channels: Channels, found: OneMassFit, delay_s: float) -> Callable[[Floats], Curves]:
    """Fitted readings at record times; before the fitted stretch they go on as if the mass had swung."""

    def curves(time_s: Floats) -> Curves:
        true_s = channels.from_record_time(np.asarray(time_s, dtype=np.float64)) - delay_s
        return Curves(curve(found.parameters, true_s, found.order), None)

    return curves


def _period(p: Floats) -> float:
    return float(2.0 * np.pi / p[2])


def _k(p: Floats) -> float:
    return float(np.hypot(p[2], p[3]))


_FAILS: Final = N_(
    "one decay with viscous and dry friction leaves {rms} of residual ({share_percent} % of the swing) for"
    " {noise} of noise, or a pattern in it: period and damping may be biased."
)
_HOLDS: Final = N_(
    "one decay with viscous and dry friction leaves {rms} of residual ({share_percent} % of the swing) for"
    " {noise} of noise, or a pattern in it. Halves of the record agree on period and damping: what they"
    " differ by is part of the uncertainty."
)
_COULOMB: Final = "coulomb_displacement_m"
_QUANTITIES: Final[dict[str, Callable[[Floats], float]]] = {
    "period_s": _period,
    "damping_n_per_s": lambda p: float(p[3]),
    "log_decrement": lambda p: float(p[3]) * _period(p),
    "damping_ratio": lambda p: float(p[3]) / _k(p),
    "frequency_k_rad_per_s": _k,
    _COULOMB: lambda p: float(p[4]),
}
"""Functions of (the fitted parameters, mass)."""
_WITH_MASS: Final[dict[str, Callable[[Floats], float]]] = {
    "stiffness_n_per_m": lambda p: _k(p) ** 2 * float(p[-1]),
    "damping_coefficient_kg_per_s": lambda p: 2.0 * float(p[3] * p[-1]),
}
