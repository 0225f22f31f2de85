"""Least squares of a one-mass decay with viscous and Coulomb damping, in the time domain."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from analysis.arrays import Floats
from analysis.formatting import format_number
from analysis.motion.nonlinear_decay import nonlinear_decay
from analysis.motion.one_mass import free_decay, turning_magnitude
from analysis.one_mass.turning_points import find_turning_points, regress_half_cycles
from analysis.preparation.channels import Channel
from analysis.preparation.oscillation import DampedCosine, fit_damped_cosine
from analysis.quantities import COVERAGE_FACTOR_95
from analysis.record import RecordError
from analysis.uncertainty import noise_variance_factor

_STEP = 1e-30
DAMPING, COULOMB, OFFSET = 3, 4, 5  # places of n, x_k and of the zero among the parameters
LINEAR_COUNT = 6  # parameters of a linear spring with viscous and Coulomb damping
_HALF_CYCLES_MIN = 4
_STOPS_TRIED = 3
_GROWTH = 20.0  # largest natural logarithm by which a trial swing may grow over the record
_FAR = 1e12  # residual, in units of the swing, of impossible trial parameters
_LINEAR_LIMITS = {"max_nfev": 100}
_NUMERICAL_LIMITS = {"max_nfev": 30, "ftol": 1e-6, "xtol": 1e-6}
"""Curves that a fit may compute, each with its derivatives; a numerical motion is some 1e-7 exact."""
_DIFFERENCE = 1e-5  # step of numerical derivatives, in natural sizes of the parameters
_CHANGES_FREQUENCY = (2, 3, 6, 7)  # places of the parameters whose effect grows with the angle swung through


class Parameters(NamedTuple):
    """Parameters of ``offset + d^r/dt^r free_decay``, r = 0, 1, 2 (displacement, velocity, acceleration)."""

    turning_s: float  # time (s) of the last turning point before the fitted stretch
    turning: float
    omega_rad_per_s: float
    damping_n_per_s: float
    coulomb: float  # x_k, in the unit of displacement; below zero where no Coulomb friction is left
    offset: float  # zero of the readings, in their own unit
    cubic: float = 0.0  # restoring force u + cubic u^3, of the stiffness of small swings
    sine: float = 0.0  # restoring force sin(a u) / a, a^2 = sine: a pendulum read in rad has 1
    drag: float = 0.0  # deceleration over the square of the velocity
    rise: float = 0.0  # damping constant n (1 + rise u^2)

    @property
    def motion(self) -> tuple[float, ...]:
        """All but the offset."""
        return self[: LINEAR_COUNT - 1] + self[LINEAR_COUNT:]

    @property
    def is_linear(self) -> bool:
        return not any(self[LINEAR_COUNT:])

    @property
    def period_s(self) -> float:
        return 2.0 * math.pi / self.omega_rad_per_s

    @property
    def half_cycle_decrement(self) -> float:
        return self.damping_n_per_s * math.pi / self.omega_rad_per_s

    def swings_like(self, other: "Parameters", end_s: float) -> bool:
        """Tell whether this swings about like another, and stays finite until `end_s`."""
        ratio, damping = self.omega_rad_per_s / other.omega_rad_per_s, self.damping_n_per_s
        near = 0.5 < ratio < 2.0 and abs(self.turning_s - other.turning_s) < other.period_s
        square = self.turning**2
        near = near and -0.25 < self.cubic * square < 3.0 and 0.0 <= self.sine * square < 8.0
        near = near and -1.0 < self.drag * abs(self.turning) < 3.0 and -0.9 < self.rise * square < 50.0
        return near and damping < self.omega_rad_per_s and -damping * (end_s - self.turning_s) < _GROWTH

    def from_turning_point_before(self, time_s: float) -> "Parameters":
        """Same motion, given by its last turning point at or before `time_s`."""
        half_s = 0.5 * self.period_s
        cycle = math.floor((time_s - self.turning_s) / half_s)
        magnitude = turning_magnitude(
            np.array([float(cycle)]), abs(self.turning), self.half_cycle_decrement, self.coulomb
        )
        side = math.copysign(1.0, self.turning) * (-1.0) ** cycle
        return self._replace(turning_s=self.turning_s + cycle * half_s, turning=side * float(magnitude[0]))


@dataclass(frozen=True, eq=False, slots=True)
class OneMassFit:
    """A fitted decay."""

    parameters: Parameters
    covariance: Floats  # (10, 10) float64: type A, for white residuals; zero in rows of what was held
    channel: Channel  # readings that were fitted
    residual: Floats  # (n,) float64: reading minus curve, in the unit of the readings
    cost: float
    order: int  # derivative of the displacement that the readings are

    @property
    def rms(self) -> float:
        """Root mean square of the residual, per degree of freedom."""
        parts = sum(value != 0.0 for value in self.parameters[LINEAR_COUNT:])
        return math.sqrt(self.cost / max(1, len(self.residual) - LINEAR_COUNT - parts))

    @property
    def noise_factor(self) -> float:
        """How much more a slow average of the residuals varies than if they were white; at least 1."""
        unit = self.residual / max(self.rms, 1e-300)
        return max(1.0, noise_variance_factor(unit, self.channel.time_s, self.parameters.period_s / 4.0))

    def is_negative(self, place: int) -> bool:
        """Tell whether the 95 % interval of a parameter lies below zero."""
        deviation = math.sqrt(self.noise_factor) * self.uncertainty(place)
        return self.parameters[place] < -COVERAGE_FACTOR_95 * deviation

    def uncertainty(self, which: int) -> float:
        return math.sqrt(max(0.0, float(self.covariance[which, which])))


def curve(parameters: Parameters, time_s: Floats, order: int) -> Floats:
    """Readings (n,) that `parameters` predict at `time_s`."""
    if parameters.is_linear:
        return np.asarray(parameters.offset + free_decay(time_s, *parameters[:5], order=order))
    return parameters.offset + nonlinear_decay(time_s, np.array(parameters.motion), order)


def envelope(parameters: Parameters, time_s: Floats) -> Floats:
    """Swing (n,) at `time_s`, ascending, as that of a linear spring without losses in the same state."""
    reach, speed = (nonlinear_decay(time_s, np.array(parameters.motion), order) for order in (0, 1))
    return np.asarray(np.hypot(reach, speed / parameters.omega_rad_per_s))


def fit_with_friction(channel: Channel, period_s: float, order: int) -> OneMassFit:
    """Best fit with viscous and Coulomb damping to the motion before its stop; `period_s` within a tenth.

    Where the mass comes to rest is left out: it folds over with every half cycle that friction adds or takes
    away, so it gives the cost many minima and the interval no shape, and it depends on static friction too.
    Raises RecordError when the channel is shorter than a period, or swings in no such way.
    """
    found = [_fit_before_stop(channel, start, order) for start in _starts(channel, period_s, order)]
    if not found:
        raise _no_decay(period_s)
    return min(found, key=lambda one: one.rms)


def _fit_before_stop(channel: Channel, start: Parameters, order: int) -> OneMassFit:
    """Fit up to the stop predicted by the start, then up to that of the fit, until they agree."""
    part = readings_before_stop(channel, start)
    found = fit(part, start, order)
    for _ in range(_STOPS_TRIED):
        again = readings_before_stop(channel, found.parameters)
        if len(again) == len(part):
            break
        part = again
        found = fit(part, found.parameters, order)
    return found


def fit(
    channel: Channel,
    start: Parameters,
    order: int,
    *,
    held: tuple[int, ...] = (),
    parts: tuple[int, ...] = (),
) -> OneMassFit:
    """Least squares from `start` to a minimum near it; the parameters at the places `held` stay at zero.

    Of the parameters beyond the linear ones those are free that are not zero, or whose places are `parts`.

    Accelerations next to a turning point are left out: friction turns there within no time, and no
    sample or gauge can follow.
    """
    if start.is_linear:
        start = start.from_turning_point_before(float(channel.time_s[0]))
    start = Parameters(*(0.0 if place in held else value for place, value in enumerate(start)))
    free = [place for place in used_places(start, *parts) if place not in held]
    if order < 2:
        return _fit(channel, start, order, free)
    for _ in range(3):
        found = _fit(_away_from_turns(channel, start), start, order, free)
        start = found.parameters
    return found


def fit_places(channel: Channel, found: OneMassFit, places: Sequence[int]) -> OneMassFit:
    """Least squares over the parameters at `places` to other readings, all else as in `found`."""
    start = found.parameters
    if start.is_linear:
        start = start.from_turning_point_before(float(channel.time_s[0]))
    return _fit(channel, start, found.order, sorted(places))


def within_bounds(found: OneMassFit) -> OneMassFit:
    """Fit again with x_k and n held at 0 where they are negative: neither friction nor damping drives.

    The covariance is that of the free fit, for the residuals left: what is held is not known any better.
    """
    held: tuple[int, ...] = ()
    bounded = found
    for place in (COULOMB, DAMPING):
        if bounded.parameters[place] < 0.0:
            held = (*held, place)
            bounded = fit(found.channel, bounded.parameters, found.order, held=held)
    if not held:
        return found
    return replace(bounded, covariance=found.covariance * bounded.cost / max(found.cost, 1e-300))


def readings_before_stop(channel: Channel, parameters: Parameters) -> Channel:
    """Readings up to the first turning point inside 3 x_k: one more half cycle may end the motion."""
    return readings_before_amplitude(3.0 * parameters.coulomb, channel, parameters)


def readings_before_amplitude(limit: float, channel: Channel, parameters: Parameters) -> Channel:
    """Readings up to the first turning point inside `limit`; all if that is under two periods."""
    if not parameters.is_linear:
        below = np.flatnonzero(envelope(parameters, channel.time_s) < limit)
        end_s = float(channel.time_s[below[0]]) if below.size else math.inf
        lasts = end_s - float(channel.time_s[0]) > 0.5 * _HALF_CYCLES_MIN * parameters.period_s
        return channel.between(-math.inf, end_s) if lasts else channel
    half_s = 0.5 * parameters.period_s
    cycles = np.arange(max(0.0, (channel.time_s[-1] - parameters.turning_s) / half_s) + 1.0)
    magnitude = turning_magnitude(
        cycles, abs(parameters.turning), parameters.half_cycle_decrement, parameters.coulomb
    )
    inside = np.flatnonzero(magnitude < limit)
    if not inside.size or inside[0] < _HALF_CYCLES_MIN:
        return channel
    return channel.between(-math.inf, parameters.turning_s + half_s * inside[0])


def _fit(channel: Channel, start: Parameters, order: int, free: list[int]) -> OneMassFit:
    scale = _scales(start, order)
    origin = np.array(start)
    end_s = float(channel.time_s[-1])
    if not start.swings_like(start, end_s) or len(channel) < len(free):
        raise _no_decay(start.period_s)

    def unpack(steps: Floats) -> Parameters:
        values = origin.copy()
        values[free] += steps * scale[free]
        return Parameters(*values.tolist())

    def misfit(steps: Floats) -> Floats:
        trial = unpack(steps)
        if not trial.swings_like(start, end_s):
            return np.full(len(channel), _FAR)
        misfit = (curve(trial, channel.time_s, order) - channel.value_m) / scale[OFFSET]
        return np.asarray(np.nan_to_num(misfit, nan=_FAR, posinf=_FAR, neginf=-_FAR))

    def slopes(steps: Floats) -> Floats:
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is replaced
            columns = gradient(unpack(steps), channel.time_s, order, free)
        columns *= scale[free] / scale[OFFSET]
        return np.asarray(np.nan_to_num(columns, posinf=_FAR, neginf=-_FAR))

    from scipy.optimize import least_squares  # late: a quarter of the time that an analysis takes to start

    found = least_squares(
        misfit,
        np.zeros(len(free)),
        slopes,
        method="lm",
        x_scale="jac",
        **_LINEAR_LIMITS if start.is_linear else _NUMERICAL_LIMITS,
    )
    parameters = unpack(found.x)
    residual = channel.value_m - curve(parameters, channel.time_s, order)
    cost = float(residual @ residual)
    scale = _scales(parameters, order)[free]
    columns = gradient(parameters, channel.time_s, order, free) * scale
    variance = cost / max(1, len(residual) - len(free))
    covariance = np.zeros((len(parameters),) * 2)
    covariance[np.ix_(free, free)] = variance * np.linalg.pinv(columns.T @ columns) * np.outer(scale, scale)
    return OneMassFit(parameters, covariance, channel, residual, cost, order)


def used_places(parameters: Parameters, *parts: int) -> list[int]:
    """Places of the linear parameters, of those beyond that are not zero, and of `parts`."""
    return [k for k, value in enumerate(parameters) if k < LINEAR_COUNT or value or k in parts]


def gradient(parameters: Parameters, time_s: Floats, order: int, places: Sequence[int]) -> Floats:
    """Derivatives (n, k) of the curve by the parameters at k `places`."""
    columns = np.ones((len(time_s), len(places)))
    if parameters.is_linear and max(places) < LINEAR_COUNT:
        for column, place in enumerate(places):
            if place != OFFSET:
                columns[:, column] = _complex_step(parameters, time_s, order, place)
        return columns
    motion = np.array(parameters.motion)
    here = nonlinear_decay(time_s, motion, order)
    steps = _difference_steps(parameters, time_s)
    for column, place in enumerate(places):
        if place != OFFSET:
            stepped = motion.copy()
            stepped[place - (place > OFFSET)] += steps[place]
            columns[:, column] = (nonlinear_decay(time_s, stepped, order) - here) / steps[place]
    return columns


def _complex_step(parameters: Parameters, time_s: Floats, order: int, place: int) -> Floats:
    stepped: list[complex] = list(parameters[:5])
    stepped[place] += _STEP * 1j
    return np.asarray(free_decay(time_s, *stepped, order=order).imag / _STEP)


def _difference_steps(parameters: Parameters, time_s: Floats) -> Floats:
    """Steps (10,) of numerical derivatives: no phase shifts by much over the record."""
    steps = _DIFFERENCE * _scales(parameters, 0)
    angle = parameters.omega_rad_per_s * float(time_s[-1] - time_s[0])
    steps[list(_CHANGES_FREQUENCY)] /= max(1.0, angle)
    return steps


def _scales(start: Parameters, order: int) -> Floats:
    """A natural size of each parameter (10,); that of the offset is that of the readings."""
    omega, reach = start.omega_rad_per_s, max(abs(start.turning), 1e-300)
    linear = [1.0 / omega, reach, omega, omega, reach, reach * omega**order]
    return np.array([*linear, reach**-2, reach**-2, 1.0 / reach, reach**-2])


def parameter_shift(found: OneMassFit, disturbance: Floats) -> Floats:
    """Shift (10,) of the fitted parameters when `disturbance` (n,) is added to the readings.

    x_k and n that are held at 0 stay there.
    """
    used = used_places(found.parameters)
    places = [place for place in used if place not in (DAMPING, COULOMB) or found.parameters[place]]
    scale = _scales(found.parameters, found.order)[places]
    columns = gradient(found.parameters, found.channel.time_s, found.order, places) * scale
    shift = np.zeros(len(found.parameters))
    shift[places] = np.linalg.lstsq(columns, disturbance, rcond=None)[0] * scale
    return shift


def _no_decay(period_s: float) -> RecordError:
    return RecordError(
        "no single free decay of about {period_s} s fits the readings. Take one swing from"
        " release to rest, of one mode.",
        period_s=format_number(period_s),
    )


def _starts(channel: Channel, period_s: float, order: int) -> list[Parameters]:
    """Parameters to start from: a damped cosine, and the half-cycle regression; none where nothing swings."""
    end_s = float(channel.time_s[-1])
    with np.errstate(over="ignore", invalid="ignore"):  # it follows anything, also what grows
        cosine = fit_damped_cosine(channel, period_s)
    n, omega, *amplitudes = cosine.parameters.tolist()
    wanted = Parameters(cosine.start_s, 1.0, 2.0 * math.pi / period_s, 0.0, 0.0, 0.0)
    plain = wanted._replace(omega_rad_per_s=omega, damping_n_per_s=n)
    if not (np.isfinite(amplitudes).all() and plain.swings_like(wanted, end_s)):
        return []
    viscous = _from_cosine(cosine, order)
    quarter_s = 0.25 * viscous.period_s if order == 1 else 0.0
    points = find_turning_points(channel, viscous.turning_s + quarter_s, viscous.period_s)
    line = regress_half_cycles(points)
    if line is None:
        return [viscous]
    to_displacement = viscous.omega_rad_per_s**-order
    reach = float(np.abs(points.value - line.offset).max()) * to_displacement
    halves = viscous._replace(
        turning=math.copysign(reach, viscous.turning),
        damping_n_per_s=-2.0 * math.log(line.ratio) / viscous.period_s,
        coulomb=max(0.0, line.loss / (1.0 + line.ratio) * to_displacement),
        offset=line.offset,
    )
    return [viscous, halves] if halves.swings_like(viscous, end_s) else [viscous]


def _away_from_turns(channel: Channel, parameters: Parameters) -> Channel:
    """Readings further than a sampling interval from a turning point, where at least half are."""
    interval_s = float(np.median(np.diff(channel.time_s)))
    half_s = 0.5 * parameters.period_s
    since = (channel.time_s - parameters.turning_s) / half_s
    away = np.abs(since - np.round(since)) * half_s > interval_s
    if 2 * int(away.sum()) < len(away):
        return channel
    return Channel(channel.time_s[away], channel.value_m[away])


def _from_cosine(decay: DampedCosine, order: int) -> Parameters:
    """Turning point of the displacement whose derivative `order` the damped cosine is, without Coulomb."""
    n, omega, cosine, sine, offset = decay.parameters.tolist()
    phase = math.atan2(sine, cosine) + order * (0.5 * math.pi + math.atan2(n, omega)) - math.atan2(n, omega)
    turning_s = decay.start_s + phase / omega
    turning = math.hypot(cosine, sine) / math.hypot(omega, n) ** order * math.exp(-n * phase / omega)
    return Parameters(turning_s, turning, omega, n, 0.0, offset).from_turning_point_before(decay.start_s)
