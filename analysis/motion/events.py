"""Compiled integration of the two-mass motion from event to event, in closed form.

Inside a phase the table moves as u1 = u_e + e^(-n tau) (a cos w tau + b sin w tau), tau counted from the
start of the phase. The derivative of e^(-n tau) (a cos + b sin) has the same form, so acceleration and
jerk are damped sinusoids too; the zeros of the jerk are pi/w apart and known in closed form. Between two
of them the acceleration is monotone, so it reaches a limit at most once, and the relative velocity is
convex or concave there. Every root is therefore bracketed before it is refined.
"""

import math

import numpy as np

from analysis.arrays import Floats
from analysis.compiled import compiled, compiled_part

# Places in the parameter vector that all kernels take; RELEASE is the time of release in the sampled times.
FRICTION_DYNAMIC, FRICTION_STATIC, STIFFNESS, DAMPING, PULLBACK = range(5)
TILT, RELEASE, TABLE_MASS, PLATE_MASS, GRAVITY = range(5, 10)
PARAMETER_COUNT = 10

# Columns of the phase table: start (s since release), sign of the slip (0 stick), and the state there.
START, SIGN, TABLE, VELOCITY, RELATIVE = range(5)

# A slip lasts at least this much over w. A slip that only grazes its limit is shorter than rounding can
# resolve; this carries it past the turning point of the acceleration, so that integration always advances.
SLIP_PHASE_MIN_RAD = 1e-10

PHASE_LIMIT = 1e5

# Shortest duration of a fitted motion (s): a fit may try a release after the last reading.
DURATION_MIN_S = 1e-3


@compiled_part
def static_limit(parameters: Floats) -> float:
    """Acceleration g f_s; an f_s less than f_d counts as f_d, else a breakaway would lead to no slip."""
    limit: float = parameters[GRAVITY] * max(parameters[FRICTION_STATIC], parameters[FRICTION_DYNAMIC])
    return limit


@compiled_part
def oscillator(parameters: Floats, sign: float) -> tuple[float, float, float, float]:
    """Damping n, damped frequency w, load position u_e and plate acceleration of a phase."""
    mass = parameters[TABLE_MASS]
    if sign == 0.0:
        mass += parameters[PLATE_MASS]
        load = 0.0
    else:
        load = parameters[GRAVITY] * (sign * parameters[FRICTION_DYNAMIC] - parameters[TILT])
    damping = parameters[DAMPING] / (2.0 * mass)
    frequency = math.sqrt(parameters[STIFFNESS] / mass - damping * damping)
    return damping, frequency, parameters[PLATE_MASS] * load / parameters[STIFFNESS], -load


@compiled_part
def oscillation_derivative(
    damping: float, frequency: float, cosine: float, sine: float
) -> tuple[float, float]:
    """Coefficients of the derivative of e^(-n tau) (cosine cos w tau + sine sin w tau)."""
    return frequency * sine - damping * cosine, -frequency * cosine - damping * sine


@compiled_part
def oscillation_amplitudes(
    damping: float, frequency: float, position: float, velocity: float
) -> tuple[float, float, float, float]:
    """Coefficients (cosine, sine) of the displacement from u_e and of the velocity."""
    sine = (velocity + damping * position) / frequency
    velocity_cosine, velocity_sine = oscillation_derivative(damping, frequency, position, sine)
    return position, sine, velocity_cosine, velocity_sine


@compiled_part
def first_zero(frequency: float, cosine: float, sine: float) -> tuple[float, bool]:
    """First tau > 0 at which cosine cos w tau + sine sin w tau changes sign, and whether it falls there."""
    angle = math.atan2(sine, cosine)
    half_turn = 0.5 * math.pi
    if angle > half_turn:
        return (angle - half_turn) / frequency, False
    if angle <= -half_turn:
        return (angle + 3.0 * half_turn) / frequency, False
    return (angle + half_turn) / frequency, True


@compiled_part
def peak_amplitude(damping: float, frequency: float, cosine: float, sine: float, turn: float) -> float:
    """Size of e^(-n tau) (cosine cos + sine sin) where its derivative vanishes, at tau = turn."""
    envelope = math.hypot(cosine, sine) * math.exp(-damping * turn)
    return envelope * frequency / math.hypot(damping, frequency)


@compiled_part
def _zero(
    mode: tuple[float, float],
    amplitudes: tuple[float, float],
    line: tuple[float, float],
    low: float,
    high: float,
    guess: float,
) -> float:
    """Tau in [low, high] where offset + drive tau - e^(-n tau) (cosine cos + sine sin) falls to zero.

    It does so once. Halley's steps from `guess`, kept inside a bracket; they end when what the next one
    would change, to leading order, is below rounding. `mode` is (n, w), `amplitudes` (cosine, sine) and
    `line` (drive, offset).
    """
    (damping, frequency), (cosine, sine), (drive, offset) = mode, amplitudes, line
    rate_cosine, rate_sine = oscillation_derivative(damping, frequency, cosine, sine)
    bend_cosine, bend_sine = oscillation_derivative(damping, frequency, rate_cosine, rate_sine)
    tau = guess
    for _ in range(100):
        if not low < tau < high:
            tau = 0.5 * (low + high)
        decay, cos, sin = math.exp(-damping * tau), math.cos(frequency * tau), math.sin(frequency * tau)
        value = offset + drive * tau - decay * (cosine * cos + sine * sin)
        rate = drive - decay * (rate_cosine * cos + rate_sine * sin)
        if value > 0.0:
            low = tau
        else:
            high = tau
        step = -value / rate
        curl = -step * decay * (bend_cosine * cos + bend_sine * sin) / rate
        if abs(curl) < 1.0:
            step /= 1.0 + 0.5 * curl
        tau += step
        turned = frequency * step
        if abs(turned) * (curl * curl + turned * turned) <= 4e-16 or high - low <= 4e-16 * high:
            break
    return tau if low <= tau <= high else 0.5 * (low + high)


@compiled_part
def _limit_reached(
    damping: float, frequency: float, cosine: float, sine: float, limit: float, low: float, high: float
) -> float:
    """Tau in [low, high] where the monotone e^(-n tau) (cosine cos + sine sin) rises to `limit`."""
    envelope = math.hypot(cosine, sine) * math.exp(-damping * low)
    # What rises to the limit would, undamped, be this angle before its peak.
    angle = math.acos(min(max(limit / envelope, -1.0), 1.0))
    tau = (math.atan2(sine, cosine) - angle) / frequency
    period = 2.0 * math.pi / frequency
    tau += period * math.ceil((low - tau) / period)
    return _zero((damping, frequency), (cosine, sine), (0.0, limit), low, high, tau)


@compiled_part
def stick_end(parameters: Floats, position: float, velocity: float) -> tuple[float, float]:
    """Duration of the stick from this state (inf: without end), and the sign of the slip that follows.

    The extremes of the joint acceleration decay, so the next one of each direction decides.
    """
    damping, frequency, _, _ = oscillator(parameters, 0.0)
    _, _, cosine, sine = oscillation_amplitudes(damping, frequency, position, velocity)
    cosine, sine = oscillation_derivative(damping, frequency, cosine, sine)
    jerk_cosine, jerk_sine = oscillation_derivative(damping, frequency, cosine, sine)
    turn, rising = first_zero(frequency, jerk_cosine, jerk_sine)
    side = 1.0 if rising else -1.0
    static = static_limit(parameters)
    tilt = side * parameters[GRAVITY] * parameters[TILT]
    peak = peak_amplitude(damping, frequency, cosine, sine, turn)
    if peak > static + tilt:
        if side * cosine >= static + tilt:
            return 0.0, -side
        tau = _limit_reached(damping, frequency, side * cosine, side * sine, static + tilt, 0.0, turn)
        return tau, -side
    half_period = math.pi / frequency
    if peak * math.exp(-damping * half_period) > static - tilt:
        end = turn + half_period
        tau = _limit_reached(damping, frequency, -side * cosine, -side * sine, static - tilt, turn, end)
        return tau, side
    return math.inf, 0.0


@compiled_part
def _oscillation(damping: float, frequency: float, cosine: float, sine: float, tau: float) -> float:
    """Value of e^(-n tau) (cosine cos w tau + sine sin w tau)."""
    return math.exp(-damping * tau) * (cosine * math.cos(frequency * tau) + sine * math.sin(frequency * tau))


@compiled_part
def slip_end(parameters: Floats, sign: float, position: float, velocity: float, longest: float) -> float:
    """How long a slip from this state lasts; inf when over `longest` or `PHASE_LIMIT` half periods.

    Follows the speed of the slip, sign (u2' - u1'), which is zero at first and grows. It is concave
    while u1'' (mirrored likewise) rises and convex while u1'' falls.
    """
    damping, frequency, load, drive = oscillator(parameters, sign)
    _, _, cosine, sine = oscillation_amplitudes(damping, frequency, position - load, velocity)
    cosine, sine, velocity, drive = sign * cosine, sign * sine, sign * velocity, sign * drive
    rate_cosine, rate_sine = oscillation_derivative(damping, frequency, cosine, sine)
    jerk_cosine, jerk_sine = oscillation_derivative(damping, frequency, rate_cosine, rate_sine)
    turn, concave = first_zero(frequency, jerk_cosine, jerk_sine)
    half_period = math.pi / frequency
    decay = math.exp(-damping * half_period)
    peak = peak_amplitude(damping, frequency, rate_cosine, rate_sine, turn)
    shortest, longest = SLIP_PHASE_MIN_RAD / frequency, min(longest, PHASE_LIMIT * half_period)
    low = 0.0
    if concave and drive - rate_cosine <= 0.0:
        return shortest
    if not concave:
        if drive + peak <= 0.0:
            return max(3.0 * turn, shortest)  # grazes: to leading order the speed is tau^2 (3 turn - tau)
        low, turn, peak = turn, turn + half_period, decay * peak
    lag = 2.0 * damping / (damping * damping + frequency * frequency)  # u1' = -lag u1'' where u1'' turns
    while True:
        speed = velocity + drive * turn + lag * peak
        if speed <= 0.0:
            guess = turn - speed / (drive - peak)
            tau = _zero((damping, frequency), (cosine, sine), (drive, velocity), low, turn, guess)
            return max(tau, shortest)
        if not turn <= longest:
            return math.inf
        low, turn = turn, turn + half_period
        if drive < peak:
            bottom = turn
            if drive + decay * peak > 0.0:
                bottom = _limit_reached(damping, frequency, -rate_cosine, -rate_sine, -drive, low, turn)
            if velocity + drive * bottom <= _oscillation(damping, frequency, cosine, sine, bottom):
                return _zero((damping, frequency), (cosine, sine), (drive, velocity), low, bottom, low)
        low, turn, peak = turn, turn + half_period, decay * decay * peak


@compiled_part
def after_slip(parameters: Floats, sign: float, position: float, velocity: float) -> float:
    """Sign of the phase after a slip with `sign`: 0, or -sign when static friction cannot hold the plate.

    A slip never goes on in its own direction: u2'' - u1'' has turned against it.
    """
    mass = parameters[TABLE_MASS] + parameters[PLATE_MASS]
    joint = -(parameters[DAMPING] * velocity + parameters[STIFFNESS] * position) / mass
    excess = joint - parameters[GRAVITY] * parameters[TILT]
    return -sign if sign * excess > static_limit(parameters) else 0.0


@compiled_part
def first_sign(parameters: Floats) -> float:
    """Sign of the phase that follows the release."""
    position = parameters[PULLBACK]
    forward = after_slip(parameters, -1.0, position, 0.0)
    return forward if forward != 0.0 else after_slip(parameters, 1.0, position, 0.0)


@compiled_part
def advance(
    parameters: Floats, sign: float, position: float, velocity: float, tau: float
) -> tuple[float, float, float]:
    """Table displacement and velocity after `tau`, and how far the plate has slipped since."""
    damping, frequency, load, drive = oscillator(parameters, sign)
    cosine, sine, rate_cosine, rate_sine = oscillation_amplitudes(
        damping, frequency, position - load, velocity
    )
    decay, cos, sin = math.exp(-damping * tau), math.cos(frequency * tau), math.sin(frequency * tau)
    table = load + decay * (cosine * cos + sine * sin)
    slipped = (velocity + 0.5 * drive * tau) * tau - (table - position) if sign != 0.0 else 0.0
    return table, decay * (rate_cosine * cos + rate_sine * sin), slipped


@compiled
def doubled(rows: Floats) -> Floats:
    """Return the rows with as many empty ones after them."""
    larger = np.empty((2 * len(rows), rows.shape[1]))
    for k in range(len(rows)):
        for column in range(rows.shape[1]):
            larger[k, column] = rows[k, column]
    return larger


@compiled_part
def phase_limit(parameters: Floats, duration_s: float) -> float:
    """Four times as many phases as a motion can have, two in each half period; one without a frequency.

    And no more than a stand could have in hours: a fit to a record with wrong times may ask for more.
    """
    _, frequency, _, _ = oscillator(parameters, 1.0)
    return min(64.0 + 8.0 * duration_s * frequency / math.pi, PHASE_LIMIT) if frequency < math.inf else 1.0


@compiled
def integrate_events(parameters: Floats, duration_s: float) -> Floats:
    """Phases of the motion until `duration_s` after release, (m, 5) with m >= 1.

    Columns are START, SIGN, TABLE, VELOCITY, RELATIVE. With parameters that `two_mass.TwoMassParameters`
    does not allow the integration may end early, at `phase_limit`.
    """
    phases = np.empty((64, 5))
    count = 0
    time, sign = 0.0, first_sign(parameters)
    table, velocity, relative = parameters[PULLBACK], 0.0, 0.0
    most = phase_limit(parameters, duration_s)
    while time < duration_s and not count >= most:
        if count == len(phases):
            phases = doubled(phases)
        row = phases[count]
        row[START], row[SIGN] = time, sign
        row[TABLE], row[VELOCITY], row[RELATIVE] = table, velocity, relative
        if sign == 0.0:
            tau, following = stick_end(parameters, table, velocity)
        else:
            tau, following = slip_end(parameters, sign, table, velocity, duration_s - time), 0.0
        if tau != 0.0:  # a stick without length is no phase
            count += 1
        time += tau
        if time < duration_s:
            table, velocity, slipped = advance(parameters, sign, table, velocity, tau)
            relative += slipped
            sign = following if sign == 0.0 else after_slip(parameters, sign, table, velocity)
    return phases[:count]


@compiled_part
def _largest(damping: float, frequency: float, cosine: float, sine: float, span: float) -> float:
    """Largest |e^(-n tau) (cosine cos w tau + sine sin w tau)| for tau in [0, span]."""
    ends = max(abs(cosine), abs(_oscillation(damping, frequency, cosine, sine, span)))
    slope_cosine, slope_sine = oscillation_derivative(damping, frequency, cosine, sine)
    turn, _ = first_zero(frequency, slope_cosine, slope_sine)
    return max(ends, peak_amplitude(damping, frequency, cosine, sine, turn)) if turn < span else ends


@compiled_part
def table_peak_rates(
    parameters: Floats, sign: float, position: float, velocity: float, span: float
) -> tuple[float, float]:
    """Largest |u1'| and |u1''| within `span` of a phase with `sign` from this state."""
    damping, frequency, load, _ = oscillator(parameters, sign)
    _, _, cosine, sine = oscillation_amplitudes(damping, frequency, position - load, velocity)
    second_cosine, second_sine = oscillation_derivative(damping, frequency, cosine, sine)
    speed = _largest(damping, frequency, cosine, sine, span)
    return speed, _largest(damping, frequency, second_cosine, second_sine, span)


@compiled_part
def raise_largest(largest: Floats, table: float, plate: float, table_rate: float, plate_rate: float) -> None:
    """Raise each of `largest` (4,) to the absolute value of a rate, where that is larger."""
    largest[0] = max(largest[0], abs(table))
    largest[1] = max(largest[1], abs(plate))
    largest[2] = max(largest[2], abs(table_rate))
    largest[3] = max(largest[3], abs(plate_rate))


@compiled_part
def peak_rates(parameters: Floats, phases: Floats, duration_s: float) -> tuple[float, float, float, float]:
    """Largest |u1'|, |u2'|, |u1''|, |u2''| until `duration_s`."""
    table_speed, plate_speed, table_acceleration, plate_acceleration = 0.0, 0.0, 0.0, 0.0
    for k in range(len(phases)):
        row = phases[k]
        start, sign, position, velocity = row[START], row[SIGN], row[TABLE], row[VELOCITY]
        span = (phases[k + 1, START] if k + 1 < len(phases) else duration_s) - start
        drive = oscillator(parameters, sign)[3]
        speed, acceleration = table_peak_rates(parameters, sign, position, velocity, span)
        table_speed, table_acceleration = max(table_speed, speed), max(table_acceleration, acceleration)
        if sign == 0.0:
            plate_speed, plate_acceleration = max(plate_speed, speed), max(plate_acceleration, acceleration)
        else:
            plate_speed = max(plate_speed, abs(velocity), abs(velocity + drive * span))
            plate_acceleration = max(plate_acceleration, abs(drive))
    return table_speed, plate_speed, table_acceleration, plate_acceleration
