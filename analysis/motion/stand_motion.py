"""Motion of two masses on a stand that is not ideal, integrated numerically.

Beside the ten parameters of `analysis.motion.events` and those of a friction law a motion takes the
`StandParameter` values, all zero on an ideal stand; those of gauges act in `gauge_readings`. Steps of the
classical Runge-Kutta method are a tenth of 1/w long; phases begin and end at the times at which their
conditions change sign. Against DOP853 displacements agree to 1e-6 m.
"""

import math
from enum import IntEnum
from typing import TypeAlias

import numpy as np

from analysis.arrays import Floats
from analysis.compiled import compile_with, compiled, compiled_part
from analysis.motion.events import (
    DAMPING,
    FRICTION_DYNAMIC,
    FRICTION_STATIC,
    GRAVITY,
    PLATE_MASS,
    PULLBACK,
    RELEASE,
    STIFFNESS,
    TABLE_MASS,
    TILT,
)
from analysis.motion.integration import Friction, friction_coefficient, hermite_cubic, hermite_quintic
from analysis.motion.sampling import MotionKernels


class StandParameter(IntEnum):
    """Places of the deviations from the ideal stand, after the parameters of motion and friction law."""

    RELEASE_RAMP = 0  # time over which the hook lets go (s)
    RELEASE_STEP = 1  # share of its force that the hook loses at once, when it begins to let go
    RELEASE_SHAPE = 2  # the rest falls as 1 - (t / ramp) ** exp(shape): evenly at 0, late at large values
    RELEASE_VELOCITY = 3  # of the table at the release (m/s)
    SPRING_HARDENING = 4  # relative rise of the secant stiffness at the pullback, even in the displacement
    SPRING_ASYMMETRY = 5  # the same, odd in the displacement
    STAND_FRICTION = 6  # Coulomb friction of the stand over its stiffness: x_k (m)
    DRAG = 7  # deceleration over the square of the table's velocity (1/m)
    LOSS_FACTOR = 8  # of the springs: a force against the velocity, proportional to the displacement
    ARC = 9  # curvature of the table's path on its leaf springs (1/m)
    MODE_MASS = 10  # share of the table's mass that hangs on it by a spring
    MODE_FREQUENCY = 11  # its own frequency (Hz)
    MODE_DAMPING = 12  # its damping ratio
    FILM = 13  # relative rise of friction with the sliding velocity (s/m)
    LOGARITHMIC = 14  # relative rise of friction with ln(1 + velocity / 1 mm/s)
    GRADIENT = 15  # relative rise of friction along the track (1/m)
    WEAR = 16  # relative rise of friction with the slid path (1/m)
    ASYMMETRY = 17  # relative rise of friction in forward slip, and fall in backward slip
    DWELL = 18  # relative rise of static friction with ln(1 + time of stick / 0.1 s)
    FILTER = 19  # time constant of a low-pass filter before both gauges, squared; its delay is taken off (s2)
    FILTER_2 = 20  # the same of a filter before gauge 2 alone
    BEND_1 = 21  # relative deviation of gauge 1 from a line at the pullback, odd in the displacement
    BEND_2 = 22  # the same of gauge 2
    CROSS_TALK = 23  # share of u1 in the readings of gauge 2
    FILTER_DAMPING = 24  # damping ratio of the filters less 1
    SQUARE_1 = 25  # relative deviation of gauge 1 from a line at the pullback, even in the displacement
    SQUARE_2 = 26  # the same of gauge 2
    CROSS_TALK_1 = 27  # share of u2 - u1 in the readings of gauge 1
    BASE_COMPLIANCE = 28  # stiffness of the springs over that under the base
    BASE_FREQUENCY = 29  # own frequency of the base (Hz)
    HOLD_CREEP = 30  # velocity of the table before the release and at it (m/s)
    BASE_DAMPING = 31  # damping ratio of the base
    PRESLIDING = 32  # elastic deflection of the contact at which it slides (Dahl; m)
    CREEP_1 = 33  # of the zero of gauge 1 since the release, in the end (m)
    CREEP_1_TIME = 34  # its time constant (s)
    CREEP_2 = 35  # the same of gauge 2
    CREEP_2_TIME = 36


STAND_PARAMETER_COUNT = len(StandParameter)
(
    RAMP,
    RELEASE_STEP,
    SHAPE,
    START_VELOCITY,
    HARDENING,
    SPRING_ASYMMETRY,
    STAND_FRICTION,
    DRAG,
    LOSS_FACTOR,
    ARC,
    MODE_MASS,
    MODE_FREQUENCY,
    MODE_DAMPING,
    FILM,
    LOGARITHMIC,
    GRADIENT,
    WEAR,
    ASYMMETRY,
    DWELL,
    FILTER,
    FILTER_2,
    BEND_1,
    BEND_2,
    CROSS_TALK,
    FILTER_DAMPING,
    SQUARE_1,
    SQUARE_2,
    CROSS_TALK_1,
    BASE_COMPLIANCE,
    BASE_FREQUENCY,
    HOLD_CREEP,
    BASE_DAMPING,
    PRESLIDING,
    CREEP_1,
    CREEP_1_TIME,
    CREEP_2,
    CREEP_2_TIME,
) = range(STAND_PARAMETER_COUNT)
"""The same places for compiled functions, which take no enumerations."""

_LOGARITHMIC_VELOCITY_M_PER_S = 1e-3  # unit of the logarithm: slips of the stands reach some 100 mm/s
_HELD_S = 60.0  # before the release: the time in which an operator pulls and waits
_DWELL_S = 0.1  # unit of the logarithm: sticks last some tenths of a second
_STEP_RAD = 0.14  # of the slipping table's motion: local errors of 1e-7 of the swing
_MODE_STEP_RAD = 0.3  # of the second mode's motion, which is some per cent of the swing
_TURN_STEPS = 4  # of the search for the time at which the table turns; its velocity is nearly a line there
INTEGRATION_ERROR_M = 1e-6  # of displacements, against motions in closed form
_PRESLIDING_DAMPING = 0.1  # damping ratio of a plate on its contact; it rings by micrometres
_PRESLIDING_STEP_RAD = 1.0  # of that ringing, which is below the noise of readings
_SATURATED = 0.9999  # share of the friction at which a contact slides
_NODES_MOST = 400_000  # a motion that needs more has parameters that no stand can have
_EVENT_STEPS = 40  # of the search for the time of an event; its bracket is halved at the least every other
_GRAZING_DIVISIONS = 4  # of a first step of a slip that seems to end within it, each to a quarter
_ESCAPE, _ESCAPE_M = 10.0, 0.1
"""A table farther off than this, in pullbacks and metres, does not come back: its springs pull no more."""
TIME, TABLE, VELOCITY, ACCELERATION, RELATIVE, SLIP, SLIP_RATE, BASE_ACCELERATION = range(8)
"""Columns of a node: time since release, u1 with its derivatives, u2 - u1 with its derivatives, and the
acceleration of the base, against which u1 is."""
FIRST_NODE = 5  # column of a phase beside those of `events`: row of its first node
_STATE = 9
"""u1, u1', u2' - u1', u2 - u1, then displacement and velocity of the second mode on the table and of the
base, and the deflection of the contact."""
_PLAIN = 4  # of them without second mode, moving base and presliding


Phase: TypeAlias = tuple[float, float, float]
"""What stays the same over a step: sign of the slip, 0 in a stick; slid path before the phase, less `sign`
times u2 - u1 at its start (m); and sign of u1', 0 at a turning point. numba's cache cannot be loaded where a
named tuple has another name."""


@compiled_part
def state_size(parts: Floats) -> int:
    """How many of the state's values move."""
    is_plain = parts[MODE_MASS] == 0.0 and parts[BASE_COMPLIANCE] == 0.0 and parts[PRESLIDING] == 0.0
    return _PLAIN if is_plain else _STATE


@compiled_part
def longest_steps(parameters: Floats, parts: Floats) -> tuple[float, float]:
    """Longest steps of integration in a slip and in a stick (s)."""
    in_slip = _STEP_RAD / math.sqrt(parameters[STIFFNESS] / parameters[TABLE_MASS])
    if parts[BASE_COMPLIANCE] != 0.0:
        in_slip = min(in_slip, _MODE_STEP_RAD / (2.0 * math.pi * parts[BASE_FREQUENCY]))
    if parts[MODE_MASS] != 0.0:
        in_slip = min(in_slip, _MODE_STEP_RAD / (2.0 * math.pi * parts[MODE_FREQUENCY]))
    if parts[PRESLIDING] == 0.0:
        return in_slip, in_slip
    square = parameters[FRICTION_DYNAMIC] * parameters[GRAVITY] / parts[PRESLIDING]
    fastest = math.sqrt(square * (1.0 + parameters[PLATE_MASS] / parameters[TABLE_MASS]))
    return in_slip, min(in_slip, _PRESLIDING_STEP_RAD / fastest)


@compiled_part
def hold_share(parts: Floats, time: float) -> float:
    """Share of the hook's first force that it still has."""
    if time >= parts[RAMP]:
        return 0.0
    share: float = (1.0 - parts[RELEASE_STEP]) * (1.0 - (time / parts[RAMP]) ** math.exp(parts[SHAPE]))
    return share


@compiled_part
def spring_force(parameters: Floats, parts: Floats, displacement: float) -> float:
    """Force that bends the springs by `displacement` (N)."""
    share = displacement / max(abs(parameters[PULLBACK]), 1e-9)
    rise = (parts[SPRING_ASYMMETRY] + parts[HARDENING] * share) * share
    force: float = parameters[STIFFNESS] * displacement * (1.0 + rise)
    return force


@compiled_part
def track_factor(parts: Floats, direction: float, relative: float, path: float) -> float:
    """Friction here and now over that at the start of the track."""
    factor: float = 1.0 + parts[GRADIENT] * relative
    factor *= (1.0 + parts[WEAR] * path) * (1.0 + parts[ASYMMETRY] * direction)
    return factor if factor > 0.0 else 0.0


@compiled_part
def dry_force(parameters: Floats, parts: Floats, displacement: float, heading: float, force: float) -> float:
    """Dry friction of the stand (N), against the table's `heading`, or at rest (0) the other `force`."""
    limit: float = parameters[STIFFNESS] * (parts[STAND_FRICTION] + parts[LOSS_FACTOR] * abs(displacement))
    if heading != 0.0:
        return -heading * limit
    return -force if abs(force) <= limit else -math.copysign(limit, force)


@compiled_part
def table_force(parameters: Floats, parts: Floats, time: float, state: Floats) -> float:
    """Force of springs, damping, hook and second mode on the table (N)."""
    u, v = state[0], state[1]
    mass = parameters[TABLE_MASS] + parameters[PLATE_MASS]
    force: float = -spring_force(parameters, parts, u) - parameters[DAMPING] * v
    force -= mass * parts[DRAG] * abs(v) * v
    if time < parts[RAMP]:
        force += hold_share(parts, time) * spring_force(parameters, parts, parameters[PULLBACK])
    if parts[MODE_MASS] != 0.0:
        w = 2.0 * math.pi * parts[MODE_FREQUENCY]
        mode = w * w * state[4] + 2.0 * parts[MODE_DAMPING] * w * state[5]
        force += parts[MODE_MASS] * parameters[TABLE_MASS] * mode
    return force


@compiled_part
def presliding_friction(
    breakaway: float, parameters: Floats, parts: Floats, slip: float, deflection: float
) -> float:
    """Coefficient of friction of a contact that is deflected but does not slide (Dahl, 1968).

    `breakaway` is that of a slip which begins: from another one the contact would stick again at once.
    """
    share = deflection / parts[PRESLIDING]
    stiffness = breakaway / parts[PRESLIDING]
    damping = 2.0 * _PRESLIDING_DAMPING * math.sqrt(stiffness / parameters[GRAVITY])
    coefficient: float = stiffness * deflection + damping * (slip - abs(slip) * share)
    return coefficient


def slope(parameters: Floats, parts: Floats, phase: Phase, time: float, state: Floats, out: Floats) -> float:
    """Write the derivative of `state` into `out`; return the plate's vertical acceleration."""
    sign, path, heading = phase
    u, v, slip, relative = state[0], state[1], state[2], state[3]
    gravity, plate, arc = parameters[GRAVITY], parameters[PLATE_MASS], parts[ARC]
    table = parameters[TABLE_MASS] * (1.0 - parts[MODE_MASS])
    both = plate + table
    is_dry = parts[STAND_FRICTION] != 0.0 or parts[LOSS_FACTOR] != 0.0
    force = table_force(parameters, parts, time, state) - both * arc * arc * u * v * v
    if sign == 0.0 and parts[PRESLIDING] == 0.0:
        if is_dry:
            force += dry_force(parameters, parts, u, heading, force)
        acceleration = force / (both * (1.0 + arc * arc * u * u))
        rate = 0.0
    else:
        if sign == 0.0:
            side = math.copysign(1.0, state[8])
            breakaway = friction_coefficient(0.0, parameters) * track_factor(parts, side, relative, path)
            friction = presliding_friction(breakaway, parameters, parts, slip, state[8])
        else:
            speed = abs(slip)
            friction = friction_coefficient(speed, parameters) * (1.0 + parts[FILM] * speed)
            if parts[LOGARITHMIC] != 0.0:
                friction *= 1.0 + parts[LOGARITHMIC] * math.log(1.0 + speed / _LOGARITHMIC_VELOCITY_M_PER_S)
            friction *= sign * track_factor(parts, sign, relative, path + sign * relative)
        load = gravity * (friction - parameters[TILT]) + friction * arc * v * v
        if is_dry:
            force += dry_force(parameters, parts, u, heading, force + plate * load)
        inertia = table + both * arc * arc * u * u - plate * friction * arc * u
        acceleration = (force + plate * load) / inertia
        rate = -load - friction * arc * u * acceleration - acceleration
    base = 0.0
    if parts[BASE_COMPLIANCE] != 0.0:
        w = 2.0 * math.pi * parts[BASE_FREQUENCY]
        mass = parameters[STIFFNESS] / (parts[BASE_COMPLIANCE] * w * w)
        base = -force / mass - w * w * state[6] - 2.0 * parts[BASE_DAMPING] * w * state[7]
        out[6] = state[7]
    else:
        out[6] = 0.0
    out[0], out[1], out[2], out[3], out[7] = v, acceleration - base, rate, slip, base
    deflects = sign == 0.0 and parts[PRESLIDING] != 0.0
    out[8] = slip - abs(slip) * state[8] / parts[PRESLIDING] if deflects else 0.0
    if parts[MODE_MASS] != 0.0:
        w = 2.0 * math.pi * parts[MODE_FREQUENCY]
        out[4] = state[5]
        out[5] = -acceleration - w * w * state[4] - 2.0 * parts[MODE_DAMPING] * w * state[5]
    else:
        out[4], out[5] = 0.0, 0.0
    vertical: float = arc * (v * v + u * acceleration)
    return vertical


def _step(
    parameters: Floats,
    parts: Floats,
    phase: Phase,
    time: float,
    state: Floats,
    trial: Floats,
    slopes: Floats,
    step: float,
) -> None:
    """Write the state after `step` into `trial`; `slopes` (5, n) holds the first slope in row 0."""
    size = state_size(parts)
    for i in range(size):
        trial[i] = state[i] + 0.5 * step * slopes[0, i]
    slope(parameters, parts, phase, time + 0.5 * step, trial, slopes[1])
    for i in range(size):
        trial[i] = state[i] + 0.5 * step * slopes[1, i]
    slope(parameters, parts, phase, time + 0.5 * step, trial, slopes[2])
    for i in range(size):
        trial[i] = state[i] + step * slopes[2, i]
    slope(parameters, parts, phase, time + step, trial, slopes[3])
    for i in range(size):
        rise = slopes[0, i] + 2.0 * (slopes[1, i] + slopes[2, i]) + slopes[3, i]
        trial[i] = state[i] + step / 6.0 * rise


def demand(
    parameters: Floats,
    parts: Floats,
    phase: Phase,
    time: float,
    stuck_s: float,
    state: Floats,
    rates: Floats,
) -> tuple[float, float]:
    """By how much the joint acceleration exceeds what static friction holds, and the sign of a slip then.

    `phase` is that of a stick, with all of the slid path. Overwrites `rates`.
    """
    vertical = slope(parameters, parts, phase, time, state, rates)
    wanted = rates[1] + rates[7] - parameters[GRAVITY] * parameters[TILT]
    direction = -1.0 if wanted > 0.0 else 1.0
    static = max(parameters[FRICTION_STATIC], parameters[FRICTION_DYNAMIC])
    if parts[DWELL] != 0.0:
        static *= 1.0 + parts[DWELL] * math.log(1.0 + stuck_s / _DWELL_S)
    static *= track_factor(parts, direction, state[3], phase[1])
    return abs(wanted) - static * (parameters[GRAVITY] + vertical), direction


def integrate(parameters: Floats, duration_s: float) -> tuple[Floats, Floats]:
    """Phases (m, 6) and nodes (k, 8) from the release to `duration_s`.

    Phases are as `integrate_events` gives them, with the row of their first node.
    """
    parts = parameters[len(parameters) - STAND_PARAMETER_COUNT :]
    longest, longest_at_rest = longest_steps(parameters, parts)
    size, pull, deflected = state_size(parts), abs(parameters[PULLBACK]), parts[PRESLIDING]
    is_dry = parts[STAND_FRICTION] != 0.0 or parts[LOSS_FACTOR] != 0.0
    phases, nodes = np.empty((64, 6)), np.empty((256 + int(min(2.0 * duration_s / longest, _NODES_MOST)), 8))
    state, trial, slopes = np.zeros(_STATE), np.zeros(_STATE), np.zeros((5, _STATE))
    state[0], state[1] = parameters[PULLBACK], parts[START_VELOCITY] + parts[HOLD_CREEP]
    time, path, began, count, node = 0.0, 0.0, 0.0, 0, 0
    heading = math.copysign(1.0, state[1]) if state[1] != 0.0 else 0.0
    sign = 0.0
    if deflected != 0.0:
        share = parameters[TILT] / parameters[FRICTION_DYNAMIC]
        state[8] = deflected * min(max(share, -_SATURATED), _SATURATED)
    else:
        excess, direction = demand(parameters, parts, (0.0, 0.0, heading), 0.0, _HELD_S, state, slopes[4])
        sign = direction if excess > 0.0 else 0.0
    new_phase, unchecked = True, False
    while time < duration_s and node < _NODES_MOST and abs(state[0]) < _ESCAPE * pull + _ESCAPE_M:
        phase = (sign, path - sign * state[3], heading)
        if new_phase:
            if count == len(phases):
                phases = _doubled(phases)
            row = phases[count]
            row[0], row[1], row[2], row[3], row[4], row[5] = time, sign, state[0], state[1], state[3], node
            slope(parameters, parts, phase, time, state, slopes[0])
            nodes = _append_node(nodes, node, time, state, slopes[0])
            count, node, new_phase, began = count + 1, node + 1, False, time
        step = min(longest if sign != 0.0 else longest_at_rest, duration_s - time)
        if sign == 0.0 and deflected != 0.0:  # no farther than half of a deflection
            speed = abs(state[2])
            step = min(
                step, deflected / (speed + math.sqrt(speed**2 + deflected * abs(slopes[0, 2])) + 1e-12)
            )
        if time < parts[RAMP]:
            step = min(step, max(parts[RAMP] - time, 1e-9))
        _step(parameters, parts, phase, time, state, trial, slopes, step)
        last = _event(parameters, parts, phase, time + step, time + step - began, trial, slopes[4])
        if last > 0.0 and not unchecked:
            if sign != 0.0 and state[2] * sign <= 0.0:
                for _ in range(_GRAZING_DIVISIONS):
                    step *= 0.25
                    _step(parameters, parts, phase, time, state, trial, slopes, step)
                    last = -sign * trial[2]
                    if last < 0.0:
                        break
                if last >= 0.0:  # the joint acceleration only grazes its limit
                    sign, new_phase, unchecked = 0.0, True, True
                    state[2] = 0.0
                    continue
            else:
                step = _step_to_event(parameters, phase, time, began, state, trial, slopes, step)
                new_phase = True
        if is_dry and heading * trial[1] < 0.0:  # the table turns within the step
            step = _step_to_turn(parameters, parts, phase, time, state, trial, slopes, step)
            trial[1], new_phase = 0.0, False
        unchecked = False
        time += step
        if sign != 0.0:
            path += sign * (trial[3] - state[3])
        for i in range(size):
            state[i] = trial[i]
        heading = math.copysign(1.0, state[1]) if state[1] != 0.0 else 0.0
        phase = (sign, path - sign * state[3], heading)
        slope(parameters, parts, phase, time, state, slopes[0])
        nodes = _append_node(nodes, node, time, state, slopes[0])
        node += 1
        if new_phase:
            stuck_s = time - began if sign == 0.0 else 0.0
            if deflected != 0.0:
                if sign != 0.0:
                    state[2], state[8], sign = 0.0, sign * _SATURATED * deflected, 0.0
                else:
                    sign = math.copysign(1.0, state[8])
                continue
            phase = (0.0, path, heading)
            excess, direction = demand(parameters, parts, phase, time, stuck_s, state, slopes[4])
            if sign != 0.0:
                state[2] = 0.0
                sign = direction if excess > 0.0 else 0.0
            else:
                sign = direction
    return phases[:count], nodes[:node]


def _event(
    parameters: Floats,
    parts: Floats,
    phase: Phase,
    time: float,
    since_s: float,
    state: Floats,
    rates: Floats,
) -> float:
    """Positive where a phase has ended: a slip has stopped, or a stick cannot hold."""
    if phase[0] != 0.0:
        overrun: float = -phase[0] * state[2]
        return overrun
    if parts[PRESLIDING] != 0.0:
        beyond: float = abs(state[8]) / parts[PRESLIDING] - _SATURATED
        return beyond
    excess, _ = demand(parameters, parts, phase, time, since_s, state, rates)
    return excess


def _step_to_event(
    parameters: Floats,
    phase: Phase,
    time: float,
    began: float,
    state: Floats,
    trial: Floats,
    slopes: Floats,
    step: float,
) -> float:
    """Shorten `step`, after which `trial` is, to the time at which the phase that `began` ends.

    Writes the state there into `trial`. False position, the value of a bound that stays halved (Illinois).
    """
    parts = parameters[len(parameters) - STAND_PARAMETER_COUNT :]
    last = _event(parameters, parts, phase, time + step, time + step - began, trial, slopes[4])
    first = _event(parameters, parts, phase, time, time - began, state, slopes[4])
    low, high, low_value, high_value = 0.0, step, min(first, 0.0), last
    for _ in range(_EVENT_STEPS):
        step = high - (high - low) * high_value / (high_value - low_value)
        if not low < step < high:
            step = 0.5 * (low + high)
        _step(parameters, parts, phase, time, state, trial, slopes, step)
        value = _event(parameters, parts, phase, time + step, time + step - began, trial, slopes[4])
        if value > 0.0:
            high, high_value, low_value = step, value, 0.5 * low_value
        else:
            low, low_value, high_value = step, value, 0.5 * high_value
        if high - low <= 1e-14 or abs(value) <= 1e-15:
            break
    if high - step > 0.0 and step == low:
        step = high
        _step(parameters, parts, phase, time, state, trial, slopes, step)
    return step


def _step_to_turn(
    parameters: Floats,
    parts: Floats,
    phase: Phase,
    time: float,
    state: Floats,
    trial: Floats,
    slopes: Floats,
    step: float,
) -> float:
    """Shorten `step` to the time at which the table turns, and write the state there into `trial`."""
    heading = phase[2]
    low, high, low_value, high_value = 0.0, step, heading * state[1], heading * trial[1]
    for _ in range(_TURN_STEPS):
        step = low + (high - low) * low_value / (low_value - high_value)
        _step(parameters, parts, phase, time, state, trial, slopes, step)
        if heading * trial[1] > 0.0:
            low, low_value = step, heading * trial[1]
        else:
            high, high_value = step, heading * trial[1]
    return step


@compiled
def _doubled(rows: Floats) -> Floats:
    larger = np.empty((2 * len(rows), rows.shape[1]))
    for k in range(len(rows)):
        for column in range(rows.shape[1]):
            larger[k, column] = rows[k, column]
    return larger


@compiled
def _append_node(nodes: Floats, count: int, time: float, state: Floats, rates: Floats) -> Floats:
    """Write a node into row `count`; the array is doubled when full."""
    if count == len(nodes):
        nodes = _doubled(nodes)
    row = nodes[count]
    row[TIME], row[TABLE], row[VELOCITY], row[ACCELERATION] = time, state[0], state[1], rates[1]
    row[RELATIVE], row[SLIP], row[SLIP_RATE] = state[3], state[2], rates[2]
    row[BASE_ACCELERATION] = rates[7]
    return nodes


@compiled_part
def _between(nodes: Floats, k: int, time: float, out: Floats) -> None:
    """Write u1, u2 - u1, u1', u2' and both accelerations at `time` between the nodes k and k + 1."""
    a, b = nodes[k], nodes[k + 1]
    h = b[TIME] - a[TIME]
    x = (time - a[TIME]) / h if h > 0.0 else 0.0
    table = a[TABLE], a[VELOCITY], a[ACCELERATION], b[TABLE], b[VELOCITY], b[ACCELERATION]
    out[0] = hermite_quintic(x, h, table)
    relative = a[RELATIVE], a[SLIP], a[SLIP_RATE], b[RELATIVE], b[SLIP], b[SLIP_RATE]
    out[1] = hermite_quintic(x, h, relative)
    if len(out) == 6:
        out[2] = hermite_cubic(x, h, a[VELOCITY], a[ACCELERATION], b[VELOCITY], b[ACCELERATION])
        out[3] = out[2] + hermite_cubic(x, h, a[SLIP], a[SLIP_RATE], b[SLIP], b[SLIP_RATE])
        out[4] = (1.0 - x) * a[ACCELERATION] + x * b[ACCELERATION]
        out[5] = out[4] + (1.0 - x) * a[SLIP_RATE] + x * b[SLIP_RATE]


@compiled
def sample(parameters: Floats, _phases: Floats, nodes: Floats, times: Floats, channels: int) -> Floats:
    """Channels at sorted `times`, as `sampling.sample` gives them."""
    out, row, k = np.zeros((channels, len(times))), np.empty(channels), 0
    creep = parameters[len(parameters) - STAND_PARAMETER_COUNT + HOLD_CREEP]
    for j in range(len(times)):
        since = times[j] - parameters[RELEASE]
        if since < 0.0:
            out[0, j] = parameters[PULLBACK] + creep * since
            continue
        while k + 2 < len(nodes) and nodes[k + 1, TIME] <= since:
            k += 1
        _between(nodes, k, min(since, nodes[k + 1, TIME]), row)
        for i in range(channels):
            out[i, j] = row[i]
    return out


@compiled
def peak_rates(
    _parameters: Floats, _phases: Floats, nodes: Floats, _duration_s: float
) -> tuple[float, float, float, float]:
    """Largest |u1'|, |u2'|, |u1''|, |u2''|, from four points in each step."""
    largest, row = np.zeros(4), np.empty(6)
    for k in range(len(nodes) - 1):
        for point in range(4):
            _between(nodes, k, nodes[k, TIME] + 0.25 * point * (nodes[k + 1, TIME] - nodes[k, TIME]), row)
            for i in range(4):
                largest[i] = max(largest[i], abs(row[2 + i]))
    return largest[0], largest[1], largest[2], largest[3]


_TEMPLATES = (
    (compiled_part, slope),
    (compiled_part, _step),
    (compiled_part, demand),
    (compiled_part, _event),
    (compiled_part, _step_to_event),
    (compiled_part, _step_to_turn),
    (compiled, integrate),
)
"""Functions that depend on friction, each before its callers."""


def stand_kernels(friction: Friction, name: str) -> MotionKernels:
    """Kernels of a compiled `friction`; `name` is an identifier that no other law has.

    Their parameters are the ten of `analysis.motion.events`, the law's own, and the `StandParameter` values.
    """
    functions = compile_with(_TEMPLATES, f"stand_{name}", friction_coefficient=friction)
    return MotionKernels(functions["integrate"], sample, peak_rates)


_FILTER_STEPS = 4.0  # of the filtered motion in one time constant
_FILTER_STEP_MIN_S, _FILTER_STEP_MAX_S = 2e-4, 2e-3
_NEGLIGIBLE_S = 1e-5  # a filter of 16 kHz


def gauge_readings(
    kernels: MotionKernels, vector: Floats, state: tuple[Floats, ...], times_s: Floats
) -> Floats:
    """u1 and u2 - u1 (2, n) as gauges with these filters, bends and cross-talk show them; times rise."""
    parts, pull = vector[-STAND_PARAMETER_COUNT:], max(abs(float(vector[PULLBACK])), 1e-9)
    constants = np.sqrt(parts[FILTER : FILTER_2 + 1])
    constants[constants < _NEGLIGIBLE_S] = 0.0
    damping = 1.0 + parts[FILTER_DAMPING]
    if not constants.any():
        read = kernels.sample(vector, *state, times_s, 2)
    else:
        step_s = filter_step_s(float(constants[constants > 0.0].min()))
        begin_s = min(float(times_s[0]), float(vector[RELEASE]))
        delays_s = 2.0 * damping * np.cumsum(constants)
        end_s = float(times_s[-1] + delays_s[-1])
        grid = begin_s + step_s * np.arange(int((end_s - begin_s) / step_s) + 3)
        duration_s = float(state[1][-1, TIME])
        moved = kernels.sample(vector, *state, np.minimum(grid, vector[RELEASE] + duration_s), 2)
        read = np.stack([_low_pass(row, constants[0], damping, step_s) for row in moved])
        read[1] = _low_pass(read[1], constants[1], damping, step_s)
        read = _at_times(read, times_s - begin_s, delays_s, step_s)
    if parts[CROSS_TALK] != 0.0 or parts[CROSS_TALK_1] != 0.0:
        mixing = np.array([[1.0, parts[CROSS_TALK_1]], [parts[CROSS_TALK], 1.0]])
        read = mixing @ read
        read[1] -= parts[CROSS_TALK] * vector[PULLBACK]
    bends, squares = parts[BEND_1 : BEND_2 + 1, None], parts[SQUARE_1 : SQUARE_2 + 1, None]
    if bends.any() or squares.any():
        share = read / pull
        read = read * (1.0 + (squares + bends * share) * share)
    for row, size, time in ((0, CREEP_1, CREEP_1_TIME), (1, CREEP_2, CREEP_2_TIME)):
        if parts[size] != 0.0:
            read[row] -= parts[size] * np.expm1((vector[RELEASE] - times_s) / parts[time])
    return read


def filter_step_s(constant_s: float) -> float:
    """Step of the grid (s) on which a motion is filtered with that time constant."""
    return min(max(constant_s / _FILTER_STEPS, _FILTER_STEP_MIN_S), _FILTER_STEP_MAX_S)


@compiled
def _low_pass(row: Floats, constant_s: float, damping: float, step_s: float) -> Floats:
    """The row (n,) behind T^2 y'' + 2 damping T y' + y = x, late by 2 damping T at low frequency.

    With a damping ratio of 1 it describes RC and Bessel filters of the same second moment.
    """
    if constant_s == 0.0:
        return row
    k = 0.5 * step_s / constant_s  # bilinear transform, whose delay at low frequency is exact
    norm = 1.0 / (1.0 + 2.0 * damping * k + k * k)
    gain, a1, a2 = k * k * norm, 2.0 * (k * k - 1.0) * norm, (1.0 - 2.0 * damping * k + k * k) * norm
    filtered, x1, x2, y1, y2 = np.empty(len(row)), row[0], row[0], row[0], row[0]
    for j in range(len(row)):
        y = gain * (row[j] + 2.0 * x1 + x2) - a1 * y1 - a2 * y2
        x2, x1, y2, y1 = x1, row[j], y1, y
        filtered[j] = y
    return filtered


@compiled
def _at_times(rows: Floats, times_s: Floats, delays_s: Floats, step_s: float) -> Floats:
    """Rows (c, n) on a grid of `step_s` from 0, each taken back by its delay, at rising `times_s` (m,)."""
    out = np.empty((len(rows), len(times_s)))
    for i in range(len(rows)):
        for j in range(len(times_s)):
            place = min(max((times_s[j] + delays_s[i]) / step_s, 0.0), rows.shape[1] - 1.000001)
            k = int(place)
            share = place - k
            out[i, j] = (1.0 - share) * rows[i, k] + share * rows[i, k + 1]
    return out
