"""Finds and fits the free decay of one mass in readings."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.arrays import Floats
from analysis.formatting import format_number, format_with_unit
from analysis.motion.one_mass import turning_magnitude
from analysis.one_mass.drive import find_drive
from analysis.one_mass.fit import (
    COULOMB,
    LINEAR_COUNT,
    OneMassFit,
    Parameters,
    curve,
    envelope,
    fit,
    fit_with_friction,
    readings_before_amplitude,
    readings_before_stop,
    used_places,
    within_bounds,
)
from analysis.one_mass.halves import halves_agree, spread_of_halves
from analysis.one_mass.parts import add_parts, parts_are_clear
from analysis.one_mass.residuals import (
    COMPUTED,
    ResidualAssessment,
    assess_residuals,
    find_second_mode,
    is_rounding,
    rounding_step,
)
from analysis.one_mass.turning_points import Crossings, find_crossings
from analysis.preparation.channels import Channel
from analysis.preparation.disturbance import find_stopped_table
from analysis.preparation.oscillation import check_gap, median_of_three, white_noise
from analysis.quantities import ResultWarning, result_warning
from analysis.record import RecordError
from analysis.uncertainty import numerical_gradient
from messages.i18n import N_
from messages.message import message

PERIODS_MIN = 2.0
_BEFORE_CROSSING = 0.2  # of a period before it first passes the middle the mass surely moves freely
_SIGNAL_MIN = 20.0  # least ratio of mean squares, oscillation over residual: noise reaches about 5
_EXPLAINED_MIN = 0.75
_PROMISING = 0.5  # share of the motion that a linear fit explains of a decay that parts may explain
_LOSS_SHOWN_MAX = 1.0  # of the amplitude: a swing that doubles, or may, is no decay of some per cent
_LOSS_MIN = 3e-3  # of the amplitude, lost over the record: with less, damping is not determined
_AMPLITUDE = (1, 3, 4)  # places of swing, damping and friction; the frequency is known far better
_SIGMAS = 3.0
_SPIKE_SIGMAS = 6.0
_SPIKES_MAX = 0.02
_PULLS_MAX = 3  # half cycles at the start that a hand may have moved
_PULL_SEEN = 1.5  # residual of the first half cycle over that of all: free ones of other laws reach this too
_PULL_OFF = 0.4  # residual of what a hand moved, over the swing: drag leaves up to 0.26
_PULL_OUTLIES = 5.0  # the same over that of the decay without it: pendulums from up to 2.5 rad leave 4
_UNSEEN_MAX = 0.05  # of the swing: a second mode of this size biases T and n, so it must show
_REST_READINGS_MIN = 8
_STEPS_SEEN = 3.0  # swings under this many rounding steps look as if they stopped
_BETTER = 0.5  # residual over that of the linear model; parts that leave more than noise must halve it
_GAP_PERIODS_MAX = 1000.0  # without a reading for longer than this, it was the clock that jumped


@dataclass(frozen=True, eq=False, slots=True)
class FreeDecayFit:
    """A fitted decay with its assessment and warnings."""

    fit: OneMassFit  # with viscous and Coulomb damping, neither of them negative
    viscous: OneMassFit  # the same readings without Coulomb damping
    verdict: ResidualAssessment
    adequate: bool  # the residuals are noise, and nothing moves after the motion should have ended
    spread: Floats | None
    """Of the parameters (10,) between halves of the record, where no model leaves noise; None elsewhere."""
    holds: bool  # the halves agree, so period and damping hold though the model does not
    unit: str  # of the readings, and of what is left of them
    warnings: list[ResultWarning]
    stopped_s: float | None = None  # when a hand ended the free decay; None where nothing did


def fit_free_decay(readings: Channel, order: int, unit: str) -> FreeDecayFit:
    """Find and fit the free decay in `readings`, which are derivative `order` of the displacement, in `unit`.

    Raises RecordError if nothing swings, or the swing does not die away, lasts under two periods, or is no
    single free decay.
    """
    warnings: list[ResultWarning] = []
    readings = _without_single_spikes(readings, warnings)
    crossings = find_crossings(readings)
    free = readings.between(crossings.first_s, math.inf)
    stopped_s = find_stopped_table(free, crossings.period_s, white_noise(free))
    if stopped_s is not None:
        readings = readings.between(-math.inf, stopped_s)
        crossings = find_crossings(readings)
        warnings.append(_stopped_warning(stopped_s))
    check_gap(readings, _GAP_PERIODS_MAX * crossings.period_s)
    rounding = _Rounding(rounding_step(readings.value_m), unit)
    found = _refined(_fit_stretch(readings, crossings, order), rounding)
    if _loss(found.fit)[0] > 0.0:
        found = _with_parts(readings, found, rounding)
    verdict = _assess(found.bounded, rounding.step)
    warnings += found.warnings
    _refuse_what_is_no_decay(found.fit, verdict)
    viscous = fit(found.bounded.channel, found.bounded.parameters, order, held=(COULOMB,))
    doubts = _doubts(readings, found.bounded, verdict, rounding)
    if not verdict.adequate:
        warnings += _second_mode(found.bounded, rounding)
    adequate = verdict.adequate and not doubts
    spread = None if verdict.adequate else spread_of_halves(found.bounded)
    holds = not doubts and spread is not None and halves_agree(found.bounded, spread)
    warnings += doubts
    return FreeDecayFit(found.bounded, viscous, verdict, adequate, spread, holds, unit, warnings, stopped_s)


def _stopped_warning(stopped_s: float) -> ResultWarning:
    template = N_(
        "the swing was stopped before the record ended: only readings until {stopped_s} s after the first are"
        " used. Leave the table alone until the record has ended."
    )
    return result_warning("moved-again", template, stopped_s=format_number(stopped_s))


@dataclass(frozen=True, slots=True)
class _Rounding:
    step: float  # of the readings; 0 where they are not rounded
    unit: str


@dataclass(frozen=True, eq=False, slots=True)
class _Refined:
    """A fit without spikes and without what rounding hides."""

    fit: OneMassFit  # x_k and n may be negative
    bounded: OneMassFit  # neither is
    warnings: list[ResultWarning]


def _with_parts(readings: Channel, linear: _Refined, rounding: _Rounding) -> _Refined:
    """Fit with parts beyond a linear spring and damping where they explain the readings; else `linear`."""
    found = linear.fit
    explained = 1.0 - found.cost / max(_scatter(found), 1e-300)
    richer = add_parts(found) if _PROMISING < explained < 1.0 - COMPUTED**2 else found
    if richer is found:
        return linear
    whole = readings.between(float(found.channel.time_s[0]), math.inf)
    whole = readings_before_stop(whole, richer.parameters)
    refined = _refined(fit(whole, richer.parameters, found.order), rounding)
    is_noise = _assess(refined.bounded, rounding.step).adequate
    explains = is_noise or refined.bounded.rms < _BETTER * linear.bounded.rms
    return refined if explains and parts_are_clear(refined.bounded) else linear


def _assess(found: OneMassFit, step: float) -> ResidualAssessment:
    interval_s = float(np.median(np.diff(found.channel.time_s)))
    return assess_residuals(found.residual, interval_s, step, float(np.ptp(found.channel.value_m)))


def _doubts(
    readings: Channel, found: OneMassFit, verdict: ResidualAssessment, rounding: _Rounding
) -> list[ResultWarning]:
    """Findings beside which neither a fit that explains the readings holds, nor halves that agree."""
    whole = readings.between(float(found.channel.time_s[0]), math.inf)
    doubts = _unrest(readings, found, rounding)
    if verdict.adequate:
        return doubts + _hidden_modes(found, verdict, rounding)
    return doubts + _drive(whole, found, rounding)


def _hidden_modes(found: OneMassFit, verdict: ResidualAssessment, rounding: _Rounding) -> list[ResultWarning]:
    """Whether the noise would hide what makes a decay no single one."""
    swing = 0.5 * float(np.ptp(found.channel.value_m))
    share = verdict.unseen / max(swing, 1e-300)
    if share < _UNSEEN_MAX:
        return []
    return [
        result_warning(
            "noise-hides-modes",
            "noise of {rms} would hide a second mode of {share:.2g} % of the swing: what fits may be no"
            " single decay. Pull further, choose a finer range, or read more often.",
            rms=format_with_unit(verdict.rms, rounding.unit),
            share=100.0 * share,
        )
    ]


def _drive(readings: Channel, found: OneMassFit, rounding: _Rounding) -> list[ResultWarning]:
    drive = find_drive(readings, found, rounding.step)
    if drive is None:
        return []
    return [
        result_warning(
            "steady-drive",
            "a steady oscillation at {frequency_hz} Hz with {amplitude} goes on beside the decay: T and n of"
            " a free decay cannot be told. Take a record after the release, with the drive off.",
            frequency_hz=format_number(drive.frequency_hz),
            amplitude=format_with_unit(drive.amplitude, rounding.unit),
        )
    ]


def _second_mode(found: OneMassFit, rounding: _Rounding) -> list[ResultWarning]:
    period_s = found.parameters.period_s
    line = find_second_mode(found.channel.time_s, found.residual, period_s, rounding.step)
    if line is None:
        return []
    text = message(
        "the residual oscillates at {frequency_hz} Hz with {amplitude}, beside the decay at {period_s} Hz"
        " ({share:.2g} % of its swing): a second mode, or hum. Tighten what is mounted, ground the cables.",
        frequency_hz=format_number(line.frequency_hz),
        amplitude=format_with_unit(line.amplitude, rounding.unit),
        period_s=format_number(1.0 / period_s),
        share=200.0 * line.amplitude / float(np.ptp(found.channel.value_m)),
    )
    return [ResultWarning("second-mode", text)]


def _fit_stretch(readings: Channel, crossings: Crossings, order: int) -> OneMassFit:
    """Fit from shortly before the first passage, then from the turning point before it, if that was free.

    So neither a hold nor a pull before the release matters, nor a record that begins later.
    """
    start_s = crossings.first_s - _BEFORE_CROSSING * crossings.period_s
    free = readings.between(start_s, math.inf)
    length_s = float(free.time_s[-1]) - crossings.first_s
    if length_s < (PERIODS_MIN - 0.25) * crossings.period_s:
        raise RecordError(
            "the free swing lasts {periods:.1f} periods of {period_s} s, under"
            " {periods_min:g}. Record until rest.",
            periods=length_s / crossings.period_s,
            period_s=format_number(crossings.period_s),
            periods_min=PERIODS_MIN,
        )
    found, start_s = _fit_from_passage(readings, start_s, crossings.period_s, order)
    first_s = found.parameters.from_turning_point_before(start_s).turning_s
    earlier = readings.between(first_s, start_s)
    if len(earlier) < 2:
        return found
    off = earlier.value_m - curve(found.parameters, earlier.time_s, found.order)
    if float(np.mean(off**2)) > found.rms**2 * (1.0 + _SIGMAS * math.sqrt(2.0 / len(earlier))):
        return found  # the earlier readings lie farther from the curve than the others
    longer = readings_before_stop(readings.between(first_s, math.inf), found.parameters)
    return fit(longer, found.parameters, order)


def _fit_from_passage(
    readings: Channel, start_s: float, period_s: float, order: int
) -> tuple[OneMassFit, float]:
    """Fit from `start_s`, or from later half cycles on where the first are not of that decay; and its start.

    A hand that pulls the mass through its middle begins before it swings freely. Raises RecordError where no
    decay begins at any of them.
    """
    found, refusals = None, []
    for number in range(_PULLS_MAX + 1):
        later_s = start_s + 0.5 * period_s * number
        if number and float(readings.time_s[-1]) - later_s < (PERIODS_MIN + 0.25) * period_s:
            break
        try:
            later = fit_with_friction(readings.between(later_s, math.inf), period_s, order)
        except RecordError as error:
            refusals.append(error)
            continue
        if found is not None and not _is_pull(readings.between(found[1], later_s), later):
            break
        found = later, later_s
        first = later.channel.time_s < later_s + 0.5 * period_s
        if not first.any() or _rms(later.residual[first]) < _PULL_SEEN * later.rms:
            break
    if found is None:
        raise refusals[0]
    return found


def _is_pull(before: Channel, found: OneMassFit) -> bool:
    """Tell whether readings before those fitted are far off the same decay, traced back."""
    if not len(before):
        return False
    off = _rms(before.value_m - curve(found.parameters, before.time_s, found.order))
    return off > max(_PULL_OUTLIES * found.rms, _PULL_OFF * 0.5 * float(np.ptp(found.channel.value_m)))


def _rms(values: Floats) -> float:
    return math.sqrt(float(np.mean(values**2)))


def _without_single_spikes(readings: Channel, warnings: list[ResultWarning]) -> Channel:
    """Leave out readings that stand alone, off both neighbours by more than most of the whole swing."""
    value = readings.value_m
    smooth = median_of_three(readings).value_m
    reach = 0.7 * float(np.ptp(smooth))
    off = np.zeros_like(value)
    before, after = np.diff(value)[:-1], -np.diff(value)[1:]
    off[1:-1] = np.where(before * after > 0.0, np.minimum(np.abs(before), np.abs(after)), 0.0)
    return _left_out(readings, off > reach, warnings) if reach > 0.0 else readings


def _refined(found: OneMassFit, rounding: _Rounding) -> _Refined:
    """Fit again without spikes, and without what rounding hides."""
    warnings: list[ResultWarning] = []
    found = _refit_without_spikes(found, warnings)
    if is_rounding(found.rms, rounding.step):
        found = _refit_above_rounding(found, rounding, warnings)
    bounded = within_bounds(found) if _loss(found)[0] > 0.0 else found
    return _Refined(found, bounded, warnings)


def _refit_without_spikes(found: OneMassFit, warnings: list[ResultWarning]) -> OneMassFit:
    """Fit again without the few residuals that no noise of the others' size explains."""
    scatter = 1.4826 * float(np.median(np.abs(found.residual)))
    spikes = np.abs(found.residual) > _SPIKE_SIGMAS * scatter
    if scatter == 0.0 or not spikes.any() or spikes.mean() > _SPIKES_MAX:
        return found
    return fit(_left_out(found.channel, spikes, warnings), found.parameters, found.order)


def _left_out(readings: Channel, spikes: NDArray[np.bool_], warnings: list[ResultWarning]) -> Channel:
    if spikes.any():
        template = N_("{sum} spikes were left out of {count} readings. Check cable and supply.")
        text = message(template, sum=int(spikes.sum()), count=len(spikes))
        warnings.append(ResultWarning("spikes-left-out", text))
    return Channel(readings.time_s[~spikes], readings.value_m[~spikes])


def _refit_above_rounding(
    found: OneMassFit, rounding: _Rounding, warnings: list[ResultWarning]
) -> OneMassFit:
    """Fit again up to where the swing still covers some steps: below, rounding looks like a stop."""
    limit = _STEPS_SEEN * rounding.step / found.parameters.omega_rad_per_s**found.order
    above = readings_before_amplitude(limit, found.channel, found.parameters)
    if len(above) == len(found.channel):
        return found
    text = message(
        "readings come in steps of {step}: what swings under {steps_seen:g} of them was not fitted,"
        " since rounding looks like friction there. Choose a finer range.",
        step=format_with_unit(rounding.step, rounding.unit),
        steps_seen=_STEPS_SEEN,
    )
    warnings.append(ResultWarning("coarse-steps", text))
    return fit(above, found.parameters, found.order)


def _refuse_what_is_no_decay(found: OneMassFit, verdict: ResidualAssessment) -> None:
    """Raise RecordError for noise, for a swing that does not die away, and for what fits no decay at all."""
    total = _scatter(found)
    degrees = max(1, len(found.residual) - LINEAR_COUNT)
    explained = 1.0 - found.cost / max(total, 1e-300)
    signal = explained * total / 5.0 / max(found.cost / degrees, 1e-300)
    if not signal > _SIGNAL_MIN:
        raise RecordError(
            "no free decay: the readings hold noise, and no oscillation that stands out of it."
            " Pull further, or choose a finer range."
        )
    if not verdict.adequate and explained < _EXPLAINED_MIN:
        raise RecordError(
            "no single free decay fits the readings, the best explains {explained:.0f} % of the"
            " motion. Take one swing from release to rest, of one mode.",
            explained=100.0 * explained,
        )
    loss, uncertainty = _loss(found)
    if not (-loss < _LOSS_SHOWN_MAX and uncertainty < _LOSS_SHOWN_MAX):
        raise RecordError(
            "no free decay: the swing grows, or nothing tells whether it dies away. Take a record after the"
            " release, with the drive off."
        )
    if not loss > max(_SIGMAS * uncertainty, _LOSS_MIN):
        raise RecordError(
            "no free decay: the swing changes by {change:+.2f} ± {uncertainty:.2f} % over the"
            " record, it does not die away. Take a record after the release, with the drive"
            " off.",
            change=-100.0 * loss,
            uncertainty=100.0 * uncertainty,
        )


def _scatter(found: OneMassFit) -> float:
    """Sum of squares of the fitted readings about their mean."""
    return float(np.sum((found.channel.value_m - found.channel.value_m.mean()) ** 2))


def _loss(found: OneMassFit) -> tuple[float, float]:
    """Share of the amplitude that is lost over the fitted stretch, and its standard uncertainty."""
    if not found.parameters.is_linear:
        return _loss_with_parts(found)
    length_s = float(found.channel.time_s[-1] - found.channel.time_s[0])
    reach, to_decrement = abs(found.parameters.turning), math.pi / found.parameters.omega_rad_per_s
    half_cycles = np.array([math.floor(length_s / to_decrement)])

    def loss(point: Floats) -> float:
        first, decrement, coulomb = map(float, point)
        return 1.0 - float(turning_magnitude(half_cycles, first, decrement, coulomb)[0]) / first

    point = np.array([1.0, found.parameters.half_cycle_decrement, found.parameters.coulomb / reach])
    slopes = numerical_gradient(loss, point) * np.array([1.0 / reach, to_decrement, 1.0 / reach])
    variance = float(slopes @ found.covariance[np.ix_(_AMPLITUDE, _AMPLITUDE)] @ slopes)
    return loss(point), math.sqrt(max(0.0, variance))


def _loss_with_parts(found: OneMassFit) -> tuple[float, float]:
    """The same of a spring or damping that depends on the swing."""
    places = used_places(found.parameters)
    deviations = np.sqrt(np.diag(found.covariance))
    ends_s = found.channel.time_s[[0, -1]]

    def loss(place: int = 0, deviation: float = 0.0) -> float:
        values = np.array(found.parameters)
        values[place] += deviation
        first, last = envelope(Parameters(*values.tolist()), ends_s).tolist()
        return 1.0 - float(last / max(first, 1e-300))

    slopes = np.zeros(len(deviations))
    for place in places:
        step = max(float(deviations[place]), 1e-300)
        slopes[place] = (loss(place, step) - loss(place, -step)) / (2.0 * step)
    return loss(), math.sqrt(max(0.0, float(slopes @ found.covariance @ slopes)))


def _unrest(readings: Channel, found: OneMassFit, rounding: _Rounding) -> list[ResultWarning]:
    """Whether, a period after the fitted stretch, the mass does not rest near its middle.

    Static friction may hold it anywhere inside 3 x_k, where the fitted stretch ends; below a few rounding
    steps it may still swing.
    """
    after = readings.between(float(found.channel.time_s[-1]) + found.parameters.period_s, math.inf)
    if len(after) < _REST_READINGS_MIN:
        return []
    level = float(np.median(after.value_m))
    spread = 1.4826 * float(np.median(np.abs(after.value_m - level)))
    reach = max(found.parameters.coulomb, 0.0) * found.parameters.omega_rad_per_s**found.order
    unseen = _STEPS_SEEN * rounding.step
    quiet = spread <= math.hypot((1.0 + _SIGMAS / math.sqrt(len(after))) * found.rms, 0.25 * reach) + unseen
    centred = abs(level - found.parameters.offset) <= 3.0 * (reach + found.rms) + unseen
    if quiet and centred:
        return []
    text = message(
        "after its decay the mass is {level} off and moves by {spread}: it was touched, or released"
        " twice. Take one release only.",
        level=format_with_unit(level - found.parameters.offset, rounding.unit),
        spread=format_with_unit(spread, rounding.unit),
    )
    return [ResultWarning("moves-again", text)]
