"""Estimates by the paper's own methods, as checks of the fitted ones.

None is the result of record. Peaks and zero crossings use a fraction of the readings. The residual
displacement alone allows several values of f_d. The paper's procedure compares curves by eye.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from analysis.arrays import Floats
from analysis.identification import Identification
from analysis.motion import paper_method
from analysis.motion.two_mass import TwoMassParameters
from analysis.one_mass.turning_points import classical_log_decrement, find_crossings, find_turning_points
from analysis.preparation.channels import Channel
from analysis.preparation.free_decay import FreeDecay, prepare, relative_to_table
from analysis.record import Record, RecordError

FRICTION_GRID = np.linspace(0.03, 0.3, 541)
"""Values of f_d at which the residual displacement is simulated: the paper's range in steps of 0.0005."""
_COARSE = np.round(np.arange(0.40, 0.02, -0.01), 2)
_FINE = np.round(np.arange(0.010, -0.0105, -0.001), 3)
"""Steps of the paper: by hundredths, then by thousandths about the best."""
_COMPARED = 1500
"""Readings compared with the paper's slow simulation; more change f_d by less than its last digit."""


@dataclass(frozen=True, eq=False, slots=True)
class ClassicalEstimates:
    """Estimates of one record; None where the record does not determine them."""

    period_s: float | None  # from the turning points of the stick tail
    log_decrement: float | None
    log_decrement_uncertainty: float | None
    cycles: int  # full cycles of the tail
    residual_displacement_m: Floats  # simulated u_s at `FRICTION_GRID`, the others as fitted
    friction_candidates: tuple[float, ...]
    """Every f_d of the scanned range whose simulated u_s is the measured one; empty where that is unknown."""
    friction_by_paper_method: float | None
    """f_d is lowered step by step until the motion by the paper's algorithm is nearest to the record."""


def estimate_classically(record: Record, identification: Identification) -> ClassicalEstimates:
    """Estimate a two-mass record that was identified, by the paper's methods.

    Raises RecordError if the identification holds no fitted motion.
    """
    if "friction_dynamic" not in identification.parameters:
        raise RecordError("nothing slipped in this record: there is no friction to check.")
    decay = identification.free_decay or prepare(record)
    duration_s = float(decay.table.time_s[-1] - decay.release.time_s)
    period, decrement, uncertainty, cycles = _turning_points(_with_fitted_tail(decay, identification))
    motions = (_parameters(identification, friction).simulate(duration_s) for friction in FRICTION_GRID)
    residuals = np.array([motion.residual_displacement_m for motion in motions])
    measured = identification.results.get("residual_displacement_m")
    return ClassicalEstimates(
        period,
        decrement,
        uncertainty,
        cycles,
        residuals,
        () if measured is None else zero_crossings(FRICTION_GRID, residuals - measured.value),
        _friction_by_paper_method(decay, identification),
    )


def zero_crossings(x: Floats, y: Floats) -> tuple[float, ...]:
    """Abscissae at which the polygon through the points (x, y), (n,) each, crosses zero."""
    before = np.flatnonzero(y[:-1] * y[1:] <= 0.0)
    steps = y[before] - y[before + 1]
    share = np.divide(y[before], steps, out=np.zeros(len(before)), where=steps != 0.0)
    return tuple(float(value) for value in x[before] + share * (x[before + 1] - x[before]))


def _with_fitted_tail(decay: FreeDecay, identification: Identification) -> FreeDecay:
    end_s = identification.events.slip_end_s
    return decay if end_s is None else decay.with_tail_from(decay.channels.from_record_time(end_s))


def _turning_points(decay: FreeDecay) -> tuple[float | None, float | None, float | None, int]:
    if decay.tail is None:
        return None, None, None, 0
    tail = decay.table.between(decay.tail.start_s, np.inf)
    try:
        first = find_crossings(tail)
    except RecordError:
        return None, None, None, 0
    points = find_turning_points(tail, first.first_s + 0.25 * first.period_s, first.period_s)
    decrement = classical_log_decrement(points, decay.noise_m[0])
    if decrement is None:
        return first.period_s, None, None, len(points.number) // 2
    half_period_s = float(np.polyfit(points.number, points.time_s, 1)[0])
    return 2.0 * half_period_s, *decrement, len(points.number) // 2


def _parameters(identification: Identification, friction: float, *, plain: bool = False) -> TwoMassParameters:
    """Fitted parameters with another f_d and f_s in proportion. `plain`: level plane, f_s = f_d."""
    fitted = identification.parameters
    ratio = 1.0 if plain else fitted["friction_static"] / fitted["friction_dynamic"]
    tilt = 0.0 if plain else fitted["tilt_rad"]
    static = max(ratio * friction, abs(tilt))
    return TwoMassParameters.from_fit(
        fitted, friction_dynamic=friction, friction_static=static, tilt_rad=tilt
    )


def _friction_by_paper_method(decay: FreeDecay, identification: Identification) -> float:
    misfit = _misfit(decay, identification)
    best = min(_COARSE, key=misfit)
    return float(min((best + step for step in _FINE if best + step > 0.0), key=misfit))


def _misfit(decay: FreeDecay, identification: Identification) -> Callable[[float], float]:
    """Mean square deviation of the record of gauge 2 (without it, of gauge 1) from the paper's motion."""
    release_s = decay.channels.from_record_time(identification.parameters["release_s"])
    sign, channel = decay.sign, decay.table
    if decay.relative is not None:
        sign = decay.relative_sign
        channel = relative_to_table(decay.table, decay.relative, decay.gauge_2_absolute)
    moving = channel.between(release_s, np.inf)
    step = max(1, len(moving) // _COMPARED)
    moving = Channel(moving.time_s[::step], moving.value_m[::step])
    since_s = moving.time_s - release_s

    def misfit(friction: float) -> float:
        parameters = _parameters(identification, friction, plain=True)
        motion = paper_method.simulate(parameters, duration_s=float(since_s[-1]) + 1e-3)
        table, relative = motion.sample_displacements(since_s)
        away = sign * moving.value_m - (table if decay.relative is None else relative)
        return float(np.var(away))

    return misfit
