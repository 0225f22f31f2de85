"""A stand that is not ideal, by DOP853: release, springs, surroundings and friction as in laboratories.

Written from the equations of motion and not from `analysis.motion`, so that it checks what is built on those.
The table moves by u1 against a base, the plate by rel against the table, w = rel'; s is the sign of w:

    stick:  M (b'' + u1'') = L,                          slips when |b'' + u1'' - g alpha| > f_s N / m2
    slip:   m (b'' + u1'') = L + m2 (s f N / m2 - g alpha),    b'' + u1'' + rel'' = g alpha - s f N / m2

L is the load of springs, damping, release and loose part on the table, b the motion of the base, N the normal
force, m the table without the loose part, M = m + m2. On leaf springs the table also moves vertically by
-arc u1^2 / 2, which changes N, and its inertia acts along the arc.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DOP853
from scipy.optimize import brentq

Floats = NDArray[np.float64]
State = list[float]
Event = Callable[[float, State], float]

RTOL, ATOL = 1e-10, 1e-13
STANDSTILL_M_PER_S = 1e-12  # a reversal is where the velocity is that far beyond zero
LOG_CUTOFF_M_PER_S, LOG_REFERENCE_M_PER_S = 1e-4, 1e-2
"""Of the logarithmic law: below the first it is constant, at the second friction is f_d."""
DWELL_S = 1e-2  # contact time from which static friction grows by the logarithm (Dieterich)
WAITED_S = 60.0  # contact time before the release
PRESLIDING_DAMPING_RATIO = 0.1  # of the plate on its presliding stiffness
SHORTEST_S = 1e-12  # what is left of a phase is not integrated
SATURATED = 1.0 - 1e-9  # share of the friction from which presliding is sliding
LARGEST_LOOSE_SHARE = 0.6  # of the table's mass
LONGEST_STEP = 1 / 24  # of a period, or 1 / 6 of one of the second mode: for the dense output at events
LOOKED_AT = np.array([0.25, 0.5, 0.75, 1.0])  # where events are looked for in a step

STICK, PRESLIDING = 0, 2
RELEASE_SHAPES: dict[str, Callable[[float, float], float]] = {
    "linear": lambda x, _: 1.0 - x,
    "cosine": lambda x, _: 0.5 * (1.0 + math.cos(math.pi * x)),
    "quadratic": lambda x, _: (1.0 - x) ** 2,
    "steps": lambda _, step: step,
}
"""What is left of the holding force at the share x of the ramp."""

U, V, REL, W, BASE, BASE_V, LOOSE, LOOSE_V, BRISTLE, PATH, WORK = range(11)
"""State: u1, u1', rel, rel', base and its velocity, loose part against the table and its velocity, presliding
deflection, slid path, and the integral of the friction coefficient over it."""


@dataclass(frozen=True)
class RealStand:
    """A stand and one test on it; a value of zero is the ideal. SI."""

    period_s: float = 0.32
    damping_n1_per_s: float = 0.12
    plate_mass_kg: float = 22.4
    table_mass_kg: float = 131.6
    friction_dynamic: float = 0.1
    pullback_m: float = 0.012
    tilt_rad: float = 0.0
    gravity_m_per_s2: float = 9.81

    release_ramp_s: float = 0.0
    release_shape: str = "linear"  # one of RELEASE_SHAPES
    release_step: float = 0.0  # share of the holding force that "steps" keeps until the ramp's end
    release_velocity_m_per_s: float = 0.0

    spring_hardening: float = 0.0  # relative rise of the secant stiffness at the pullback, cubic
    spring_asymmetry: float = 0.0  # the same, quadratic
    drag_per_m: float = 0.0  # force over (m1 + m2) u1' |u1'|
    loss_factor: float = 0.0  # force loss_factor c |u1| against the motion (Reid)
    stand_friction_m: float = 0.0  # x_k: Coulomb friction of the stand over c
    arc_per_m: float = 0.0  # 1 / effective length of the leaf springs; negative where the table hangs on them

    second_mode_frequency_hz: float = 0.0  # with the plate stuck
    second_mode_share: float = 0.0  # of the swing of the table after a sudden release
    second_mode_damping_ratio: float = 0.02
    base_compliance: float = 0.0  # stiffness of the table's springs over that of the base
    base_mass_kg: float = 1000.0
    base_damping_ratio: float = 0.03

    friction_static_ratio: float = 1.0  # f_s / f_d
    stribeck_m_per_s: float = 0.0  # velocity over which f_s fades into f_d; 0: at once
    film_s_per_m: float = 0.0  # f = f_d (1 + film |w|)
    log_per_decade: float = 0.0  # relative change of friction with a decade of velocity
    friction_gradient_per_m: float = 0.0  # relative change with rel
    friction_wave: float = 0.0  # relative amplitude of a sine along rel
    friction_wave_m: float = 5e-3  # its length
    friction_wear_per_m: float = 0.0  # relative change with the slid path
    friction_asymmetry: float = 0.0  # relative difference of each direction from the mean of both
    presliding_m: float = 0.0  # deflection at which friction saturates (Dahl)
    dwell_per_decade: float = 0.0  # relative growth of f_s with a decade of contact time

    def simulate(self, duration_s: float) -> "RealMotion":
        """Motion from the release on."""
        return _Integration(self).run(duration_s)


@dataclass(frozen=True, eq=False)
class RealMotion:
    """Motion of a `RealStand` from t = 0, its release."""

    ends_s: Floats
    """Ends of the steps (n,), increasing."""
    steps: list[Callable[[Floats], Floats]]  # the dense solution of each
    start: Floats  # state at t = 0
    slips_m: Floats  # slid path of each slip
    friction_dynamic: float
    """Mean over the slid path, of both directions where they differ; NaN without slip. Presliding is no
    slip."""

    def sample(self, times_s: Floats) -> Floats:
        """State (11, n) at increasing times (n,); before the release it is that of the start."""
        states = np.empty((len(self.start), len(times_s)))
        last = 0
        for end, step in zip(np.searchsorted(times_s, self.ends_s, side="right"), self.steps, strict=True):
            if end > last:
                states[:, last:end] = step(times_s[last:end])
            last = max(last, end)
        before = times_s < 0.0
        states[:, before] = self.start[:, None]
        return states


class _Loose(NamedTuple):
    """Loose part of the table, and the stiffness of the suspension that keeps the period with it."""

    mass_kg: float = 0.0
    stiffness_n_per_m: float = 0.0
    suspension_n_per_m: float = 0.0
    share: float = 0.0  # of the second mode in the swing

    @classmethod
    def of_mass(cls, mass_kg: float, total_kg: float, squares: tuple[float, float]) -> "_Loose":
        """The part of that mass with which the two bodies have these squared angular frequencies.

        With carrier M, part m, suspension c and spring k: sum of squares (c + k) / M + k / m, product
        c k / (M m). The share follows from the modes: (1, m_i) with m_i = k / (k - m square).
        """
        low, high = squares
        carrier = total_kg - mass_kg
        total, product = low + high, low * high * carrier * mass_kg
        # k (1/M + 1/m) + product / (k M) = total
        a, c = 1.0 / carrier + 1.0 / mass_kg, product / carrier
        spring = (total + math.sqrt(max(total * total - 4.0 * a * c, 0.0))) / (2.0 * a)
        modes = [np.array([1.0, spring / (spring - mass_kg * square)]) for square in squares]
        masses = np.array([carrier, mass_kg])
        first, second = (float(masses @ mode / (masses @ mode**2)) for mode in modes)
        return cls(mass_kg, spring, product / spring, second / (first + second))


class _Integration:
    """Integration from event to event.

    `contact` is STICK, PRESLIDING or the direction of the slip; `rolling` is the direction of a table whose
    stand has dry friction, and 0 where it is at rest.
    """

    def __init__(self, stand: RealStand) -> None:
        p = self.stand = stand
        self.joint_kg = p.table_mass_kg + p.plate_mass_kg
        square = (2.0 * math.pi / p.period_s) ** 2 + p.damping_n1_per_s**2
        self.damping = 2.0 * p.damping_n1_per_s * self.joint_kg
        self.loose = self._loose_part(square)
        self.stiffness = self.loose.suspension_n_per_m if self.loose.mass_kg else square * self.joint_kg
        self.table_kg = p.table_mass_kg - self.loose.mass_kg
        self.loose_damping = (
            2.0 * p.second_mode_damping_ratio * math.sqrt(self.loose.stiffness_n_per_m * self.loose.mass_kg)
        )
        self.base_stiffness = self.stiffness / p.base_compliance if p.base_compliance else 0.0
        self.base_damping = 2.0 * p.base_damping_ratio * math.sqrt(p.base_mass_kg * self.base_stiffness)
        self.has_rolling = p.stand_friction_m > 0.0 or p.loss_factor > 0.0
        if self.has_rolling and (self.loose.mass_kg or p.base_compliance):
            raise ValueError("friction of the stand goes with neither a loose part nor a moving base")
        fast_s = 4.0 / p.second_mode_frequency_hz if self.loose.mass_kg else math.inf
        self.longest_step_s = LONGEST_STEP * min(p.period_s, fast_s)
        self.pull = self._springs(p.pullback_m)
        self.bristle_damping = (
            2.0 * PRESLIDING_DAMPING_RATIO
            * math.sqrt(p.friction_dynamic / p.presliding_m / p.gravity_m_per_s2)
            if p.presliding_m else 0.0
        )  # fmt: skip
        self.rest = PRESLIDING if p.presliding_m else STICK  # contact without sliding
        self.stuck_since_s = -WAITED_S

    def run(self, duration_s: float) -> RealMotion:
        """Integrate from the release to `duration_s`."""
        p = self.stand
        y = np.zeros(11)
        y[U], y[V] = p.pullback_m, p.release_velocity_m_per_s
        y[BRISTLE] = p.tilt_rad * p.presliding_m / p.friction_dynamic
        start = y.copy()
        ends: list[float] = []
        steps: list[Callable[[Floats], Floats]] = []
        slips: list[float] = []
        t, path, contact = 0.0, 0.0, self.rest
        rolling = int(np.sign(y[V])) if self.has_rolling else 0
        for until in (p.release_ramp_s, duration_s):
            contact, rolling = self._settle(t, y, contact, rolling)
            while until - t > SHORTEST_S:
                t, y, event = self._to_event(t, y, until, contact, rolling, ends, steps)
                if event == "stop":
                    slips.append(float(y[PATH]) - path)
                    path = float(y[PATH])
                contact, rolling = self._after(event, t, y, contact, rolling)
        slid = float(y[PATH])
        if slid > path:
            slips.append(slid - path)
        mean = float(y[WORK]) / slid if slid else math.nan
        return RealMotion(np.array(ends), steps, start, np.array(slips), mean)

    def _to_event(
        self, t: float, y: Floats, until: float, contact: int, rolling: int,
        ends: list[float], steps: list[Callable[[Floats], Floats]],
    ) -> tuple[float, Floats, str]:  # fmt: skip
        """Integrate to the first event or `until`; appends the steps."""
        events = self._events(contact, rolling)

        def derivatives(time: float, state: Floats) -> State:
            return self._derivatives(time, state.tolist(), contact, rolling)

        solver = DOP853(derivatives, t, y, until, rtol=RTOL, atol=ATOL, max_step=self.longest_step_s)
        while solver.status == "running":
            if solver.step() is not None:
                raise ArithmeticError(f"the integrator stopped at {solver.t} s")
            dense = solver.dense_output()
            steps.append(dense)
            found = _first_event(events, dense, solver.t_old, solver.t)
            if found is not None:
                ends.append(found[0])
                return found[0], dense(found[0]), found[1]
            ends.append(solver.t)
        return solver.t, solver.y, ""

    def _events(self, contact: int, rolling: int) -> dict[str, Event]:
        """Functions of time and state that rise through zero where a phase ends."""
        events: dict[str, Event] = {}
        if contact == STICK:
            events["break away"] = lambda t, y: self._excess(t, y, rolling)
        elif contact == PRESLIDING:
            events["saturate"] = lambda _, y: abs(y[BRISTLE]) / self.stand.presliding_m - SATURATED
        else:
            events["stop"] = lambda _, y: -contact * y[W] - STANDSTILL_M_PER_S
        if rolling:
            events["halt"] = lambda _, y: -rolling * y[V] - STANDSTILL_M_PER_S
        elif self.has_rolling:
            events["start"] = lambda t, y: abs(self._drive(t, y, contact)) - self._rolling_limit(y[U])
        return events

    def _after(self, event: str, t: float, y: Floats, contact: int, rolling: int) -> tuple[int, int]:
        """Contact and direction of the table after the event; puts the state exactly on it."""
        if event == "stop":
            y[W], y[BRISTLE] = 0.0, contact * SATURATED * (1.0 - 1e-12) * self.stand.presliding_m
            self.stuck_since_s = t
            contact = self.rest
        elif event == "break away":
            return self._breakaway_direction(t, y.tolist(), rolling), rolling
        elif event == "saturate":
            return (1 if y[BRISTLE] > 0.0 else -1), rolling
        elif event == "halt":
            y[V], rolling = 0.0, 0
        elif event == "start":
            rolling = int(math.copysign(1.0, self._drive(t, y.tolist(), contact)))
        return self._settle(t, y, contact, rolling)

    def _settle(self, t: float, y: Floats, contact: int, rolling: int) -> tuple[int, int]:
        """Start at once what the forces do not hold."""
        state = y.tolist()
        if self.has_rolling and not rolling:
            drive = self._drive(t, state, contact)
            if abs(drive) > self._rolling_limit(state[U]):
                rolling = int(math.copysign(1.0, drive))
        if contact == STICK and self._excess(t, state, rolling) > 0.0:
            contact = self._breakaway_direction(t, state, rolling)
        return contact, rolling

    # Forces

    def _springs(self, u: float) -> float:
        p = self.stand
        x = u / p.pullback_m
        return self.stiffness * u * (1.0 + (p.spring_asymmetry + p.spring_hardening * x) * x)

    def _hold(self, t: float) -> float:
        """What is left of the holding force."""
        p = self.stand
        if t >= p.release_ramp_s:
            return 0.0
        return self.pull * RELEASE_SHAPES[p.release_shape](t / p.release_ramp_s, p.release_step)

    def _rolling_limit(self, u: float) -> float:
        p = self.stand
        return self.stiffness * (p.stand_friction_m + p.loss_factor * abs(u))

    def _friction(self, speed: float, rel: float, path: float) -> float:
        """Friction coefficient in slip, the mean of both directions."""
        p = self.stand
        relative = 1.0 + p.film_s_per_m * speed + p.friction_gradient_per_m * rel
        relative += p.friction_wear_per_m * path
        if p.friction_wave:
            relative += p.friction_wave * math.sin(2.0 * math.pi * rel / p.friction_wave_m)
        if p.log_per_decade:
            relative += p.log_per_decade * math.log10((speed + LOG_CUTOFF_M_PER_S) / LOG_REFERENCE_M_PER_S)
        if p.stribeck_m_per_s:
            relative += (p.friction_static_ratio - 1.0) * math.exp(-speed / p.stribeck_m_per_s)
        return p.friction_dynamic * relative

    def _coefficient(self, y: State, contact: int) -> float:
        """Friction force that drives the table, over the normal force; the sign is that of w in slip."""
        p = self.stand
        if contact == PRESLIDING:
            share = y[BRISTLE] / p.presliding_m
            breakaway = self._friction(0.0, y[REL], y[PATH])
            return breakaway * share + self.bristle_damping * (y[W] - abs(y[W]) * share)
        return contact * self._friction(max(contact * y[W], 0.0), y[REL], y[PATH]) + self._asymmetry

    @property
    def _asymmetry(self) -> float:
        return self.stand.friction_dynamic * self.stand.friction_asymmetry

    def _suspension(self, t: float, y: State) -> float:
        """Load of springs, damping and holding force on the table; the base has its opposite."""
        drag = self.stand.drag_per_m * self.joint_kg * abs(y[V])
        return self._hold(t) - self._springs(y[U]) - (self.damping + drag) * y[V]

    def _loose_load(self, y: State) -> float:
        return self.loose.stiffness_n_per_m * y[LOOSE] + self.loose_damping * y[LOOSE_V]

    def _drive(self, t: float, y: State, contact: int) -> float:
        """Load on a table at rest that the friction of the stand has to hold."""
        p = self.stand
        if contact == STICK:
            return self._suspension(t, y)
        plate = p.plate_mass_kg * p.gravity_m_per_s2 * (self._coefficient(y, contact) - p.tilt_rad)
        return self._suspension(t, y) + plate

    def _accelerations(self, t: float, y: State, contact: int, rolling: int) -> tuple[float, float]:
        """Of the table against the base, and of the base."""
        p = self.stand
        u, v, arc, g = y[U], y[V], p.arc_per_m, p.gravity_m_per_s2
        load, base = self._suspension(t, y), 0.0
        if p.base_compliance:
            held = self.base_stiffness * y[BASE] + self.base_damping * y[BASE_V]
            base = -(load + held) / p.base_mass_kg
        load += self._loose_load(y)
        if self.has_rolling:
            if not rolling:
                return 0.0, 0.0
            load -= rolling * self._rolling_limit(u)
        mass, along_arc = self.table_kg, self.joint_kg * arc * arc * u
        if contact == STICK:
            mass += p.plate_mass_kg
            inertia = mass + along_arc * u
        else:
            coefficient = self._coefficient(y, contact)
            load += p.plate_mass_kg * (coefficient * (g - arc * v * v) - g * p.tilt_rad)
            inertia = mass + along_arc * u + p.plate_mass_kg * coefficient * arc * u
        return (load - mass * base - along_arc * v * v) / inertia, base

    def _normal(self, y: State, table: float) -> float:
        """Normal force on the plate over its mass."""
        return self.stand.gravity_m_per_s2 - self.stand.arc_per_m * (y[V] * y[V] + y[U] * table)

    def _demanded(self, t: float, y: State, rolling: int) -> tuple[float, float]:
        """Acceleration by friction that stick demands of the plate, and the normal force over its mass."""
        table, base = self._accelerations(t, y, STICK, rolling)
        p = self.stand
        return table + base - p.gravity_m_per_s2 * p.tilt_rad, self._normal(y, table)

    def _excess(self, t: float, y: State, rolling: int) -> float:
        """Demanded acceleration beyond what static friction gives."""
        p = self.stand
        demanded, normal = self._demanded(t, y, rolling)
        limit = self._friction(0.0, y[REL], y[PATH]) - math.copysign(1.0, demanded) * self._asymmetry
        if not p.stribeck_m_per_s:
            limit *= p.friction_static_ratio
        if p.dwell_per_decade:
            limit *= 1.0 + p.dwell_per_decade * math.log10(1.0 + (t - self.stuck_since_s) / DWELL_S)
        return abs(demanded) - limit * normal

    def _breakaway_direction(self, t: float, y: State, rolling: int) -> int:
        return -1 if self._demanded(t, y, rolling)[0] > 0.0 else 1

    def _derivatives(self, t: float, y: State, contact: int, rolling: int) -> State:
        p = self.stand
        table, base = self._accelerations(t, y, contact, rolling)
        w, slip, bristle, path, work = 0.0, 0.0, 0.0, 0.0, 0.0
        if contact != STICK:
            w = y[W]
            plate = p.gravity_m_per_s2 * p.tilt_rad - self._coefficient(y, contact) * self._normal(y, table)
            slip = plate - table - base
        if contact == PRESLIDING:
            bristle = w - abs(w) * y[BRISTLE] / p.presliding_m
        elif contact != STICK:
            path = abs(w)
            work = path * self._friction(path, y[REL], y[PATH])
        loose = 0.0
        if self.loose.mass_kg:
            loose = -self._loose_load(y) / self.loose.mass_kg - table - base
        return [y[V], table, w, slip, y[BASE_V], base, y[LOOSE_V], loose, bristle, path, work]

    def _loose_part(self, square: float) -> _Loose:
        """The loose part of the table that gives the second mode its share, or the largest that there is."""
        p = self.stand
        if not p.second_mode_share:
            return _Loose()
        squares = square, (2.0 * math.pi * p.second_mode_frequency_hz) ** 2
        largest = LARGEST_LOOSE_SHARE * p.table_mass_kg

        def missing(mass_kg: float) -> float:
            return _Loose.of_mass(mass_kg, self.joint_kg, squares).share - p.second_mode_share

        mass_kg = brentq(missing, 1e-6 * largest, largest) if missing(largest) > 0.0 else largest
        return _Loose.of_mass(mass_kg, self.joint_kg, squares)


def _first_event(
    events: dict[str, Event], dense: Callable[..., Floats], begin: float, end: float
) -> tuple[float, str] | None:
    """Time and name of the first event of a step."""
    times = begin + (end - begin) * LOOKED_AT
    before = begin
    for time, state in zip(times.tolist(), dense(times).T.tolist(), strict=True):
        fired = [name for name, event in events.items() if event(time, state) > 0.0]
        if fired:
            return min((_root(events[name], dense, before, time), name) for name in fired)
        before = time
    return None


def _root(event: Event, dense: Callable[..., Floats], low: float, high: float) -> float:
    def value(time: float) -> float:
        return event(time, dense(time).tolist())

    return low if value(low) >= 0.0 else float(brentq(value, low, high, xtol=1e-15, rtol=1e-15))
