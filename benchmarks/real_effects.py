"""What may be wrong with a stand: kinds of effects, plausible strengths, random stands that have them."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.real_gauges import RealGauge
from benchmarks.real_record import Scene
from benchmarks.real_stand import RealStand
from config.files import load_stand, published_table

Rng = np.random.Generator


Change = Callable[[Scene, float, Rng], Scene]


@dataclass(frozen=True)
class Effect:
    """One kind of effect."""

    group: str
    name: str
    weak: float
    strong: float
    change: Change
    named: frozenset[str] = frozenset()
    """Parts and laws that name it right: of kinds that look alike in a record, all."""
    signed: bool = False  # the strength has either sign

    def strength(self, rng: Rng, *, mild: bool = False) -> float:
        """Log-uniform between weak and strong; `mild`: in the weakest third of that."""
        share = rng.random() * (1.0 / 3.0 if mild else 1.0)
        size = self.weak * (self.strong / self.weak) ** share
        return float(-size if self.signed and rng.random() < 0.5 else size)


# Changes


def on_stand(name: str, **others: Any) -> Change:
    """Set a field of the stand to the strength; of `others`, pairs are drawn."""
    return lambda scene, x, rng: scene.with_stand(**{name: x}, **_drawn(others, rng))


def on_gauge(which: int, name: str, **others: Any) -> Change:
    """Set a field of gauge 1, gauge 2, or both (0) to the strength."""
    return lambda scene, x, rng: scene.with_gauge(which, **{name: x}, **_drawn(others, rng))


def _drawn(values: dict[str, Any], rng: Rng) -> dict[str, Any]:
    return {
        name: float(value[0] * (value[1] / value[0]) ** rng.random()) if isinstance(value, tuple) else value
        for name, value in values.items()
    }


def film(scene: Scene, x: float, _: Rng) -> Scene:
    """Rise of friction at half the table's peak velocity, about the fastest slip."""
    fastest = 0.5 * scene.stand.pullback_m * 2.0 * math.pi / scene.stand.period_s
    return scene.with_stand(film_s_per_m=x / fastest)


def stribeck(velocity: tuple[float, float]) -> Change:
    def change(scene: Scene, x: float, rng: Rng) -> Scene:
        ratio = _slipping_ratio(scene.stand, x)
        return scene.with_stand(friction_static_ratio=ratio, **_drawn({"stribeck_m_per_s": velocity}, rng))

    return change


def static(scene: Scene, x: float, _: Rng) -> Scene:
    return scene.with_stand(friction_static_ratio=_slipping_ratio(scene.stand, x))


def _slipping_ratio(stand: RealStand, rise: float) -> float:
    """f_s / f_d, but no more than the pullback overcomes by a third."""
    peak = (2.0 * math.pi / stand.period_s) ** 2 * stand.pullback_m / stand.gravity_m_per_s2
    return max(1.0, min(1.0 + rise, 0.75 * peak / stand.friction_dynamic))


def second_mode(ratio: tuple[float, float]) -> Change:
    """Share of the swing, at a frequency of `ratio` times that of the swing."""

    def change(scene: Scene, x: float, rng: Rng) -> Scene:
        drawn = _drawn({"ratio": ratio, "second_mode_damping_ratio": (0.003, 0.03)}, rng)
        frequency_hz = drawn.pop("ratio") / scene.stand.period_s
        return scene.with_stand(second_mode_share=x, second_mode_frequency_hz=frequency_hz, **drawn)

    return change


def yaw(scene: Scene, x: float, rng: Rng) -> Scene:
    frequency_hz = float(rng.uniform(1.3, 4.0)) / scene.stand.period_s
    return replace(scene, yaw_share=x, yaw_hz=frequency_hz)


def soft_base(*, on_floor: bool) -> Change:
    """Stiffness of the springs over that of the base, whose frequency is at least twice that of the swing."""

    def change(scene: Scene, x: float, rng: Rng) -> Scene:
        drawn = _drawn({"base_mass_kg": (200.0, 800.0), "base_damping_ratio": (0.01, 0.1)}, rng)
        return replace(scene.with_stand(base_compliance=x, **drawn), gauge_1_on_floor=on_floor)

    return change


def over_range(name: str, range_m: float) -> Change:
    """A relative change of friction over that displacement or path."""
    return lambda scene, x, _: scene.with_stand(**{name: x / range_m})


def at_pullback(name: str) -> Change:
    """A share at the pullback, of a field for each metre."""
    return lambda scene, x, _: scene.with_stand(**{name: x / scene.stand.pullback_m})


def hold_creep(scene: Scene, x: float, _: Rng) -> Scene:
    return replace(scene.with_stand(release_velocity_m_per_s=x), hold_creep_m_per_s=x)


def none(scene: Scene, _: float, __: Rng) -> Scene:
    return scene


RAMP = frozenset({"release-ramp", "release-shape", "release-step"})
KICK = RAMP | {"release-velocity", "hold-creep"}  # to first order a push back is a slow release
FILTER = frozenset({"filter", "filter-damping"})
LAG = FILTER | {"gauge-lag", "gauge-2-filter"}
MODE = frozenset({"second-mode", "base"})
DAMPING = frozenset({"loss-factor", "drag", "stand-friction"})
TILT = frozenset({"tilt"})
STATIC = frozenset({"static", "static-friction", "stribeck"})
VELOCITY = frozenset({"stribeck", "log-velocity", "film"})
"""Effects of `analysis.laws.stand_parts` and parts of the names of laws; kinds that look alike share one."""


def _effects() -> tuple[Effect, ...]:
    def one(*names: str) -> frozenset[str]:
        return frozenset(names)

    release = [
        ("ramp, 0.3 to 2 ms", 3e-4, 2e-3, on_stand("release_ramp_s"), RAMP),
        ("ramp, 2 to 10 ms", 2e-3, 1e-2, on_stand("release_ramp_s"), RAMP),
        ("ramp, 10 to 30 ms", 1e-2, 3e-2, on_stand("release_ramp_s"), RAMP),
        ("cosine ramp, 1 to 15 ms", 1e-3, 1.5e-2, on_stand("release_ramp_s", release_shape="cosine"), RAMP),
        (
            "quadratic ramp, 1 to 15 ms", 1e-3, 1.5e-2,
            on_stand("release_ramp_s", release_shape="quadratic"), RAMP,
        ),
        (
            "two steps, 2 to 20 ms", 2e-3, 2e-2,
            on_stand("release_ramp_s", release_shape="steps", release_step=(0.1, 0.6)), RAMP,
        ),
        ("push, 1 to 15 mm/s", 1e-3, 1.5e-2, on_stand("release_velocity_m_per_s"), KICK, True),
        ("creeping hold, 20 to 500 um/s", 2e-5, 5e-4, hold_creep, KICK),
    ]  # fmt: skip
    suspension = [
        ("hardening, 0.2 to 1 %", 2e-3, 1e-2, on_stand("spring_hardening"), one("spring-hardening")),
        ("hardening, 1 to 4 %", 1e-2, 4e-2, on_stand("spring_hardening"), one("spring-hardening")),
        (
            "softening, 0.3 to 3 %", 3e-3, 3e-2,
            lambda scene, x, _: scene.with_stand(spring_hardening=-x), one("spring-hardening"),
        ),
        ("asymmetry, 0.3 to 3 %", 3e-3, 3e-2, on_stand("spring_asymmetry"), one("spring-asymmetry"), True),
        ("quadratic drag, 0.1 to 0.5 %", 1e-3, 5e-3, at_pullback("drag_per_m"), one("drag")),
        ("quadratic drag, 0.5 to 2 %", 5e-3, 2e-2, at_pullback("drag_per_m"), one("drag")),
        ("structural damping, 0.1 to 1 %", 1e-3, 1e-2, on_stand("loss_factor"), DAMPING),
        ("x_k, 1 to 8 um", 1e-6, 8e-6, on_stand("stand_friction_m"), one("stand-friction")),
        ("x_k, 8 to 50 um", 8e-6, 5e-5, on_stand("stand_friction_m"), one("stand-friction")),
        ("arc of leaf springs, 0.5 to 4 /m", 0.5, 4.0, on_stand("arc_per_m"), one("arc"), True),
    ]  # fmt: skip
    gauges = [
        ("gauge 2 late, 0.1 to 1 ms", 1e-4, 1e-3, on_gauge(2, "lag_s"), LAG),
        ("gauge 2 late, 1 to 5 ms", 1e-3, 5e-3, on_gauge(2, "lag_s"), LAG),
        ("gauge 1 late, 0.1 to 2 ms", 1e-4, 2e-3, on_gauge(1, "lag_s"), LAG),
        ("gauge 2: RC, 500 to 100 Hz", 500.0, 100.0, on_gauge(2, "corner_hz", filter="rc"), LAG),
        ("gauge 2: RC, 100 to 20 Hz", 100.0, 20.0, on_gauge(2, "corner_hz", filter="rc"), LAG),
        (
            "gauge 2: Butterworth 2, 300 to 20 Hz", 300.0, 20.0,
            on_gauge(2, "corner_hz", filter="butterworth", order=2), LAG,
        ),
        (
            "gauge 2: Bessel 4, 300 to 20 Hz", 300.0, 20.0,
            on_gauge(2, "corner_hz", filter="bessel", order=4), LAG,
        ),
        ("gauge 1: RC, 300 to 30 Hz", 300.0, 30.0, on_gauge(1, "corner_hz", filter="rc"), LAG),
        ("both: RC, 200 to 20 Hz", 200.0, 20.0, on_gauge(0, "corner_hz", filter="rc"), FILTER),
        ("both: RC, 20 to 5 Hz", 20.0, 5.0, on_gauge(0, "corner_hz", filter="rc"), FILTER),
        (
            "both: Butterworth 4, 100 to 10 Hz", 100.0, 10.0,
            on_gauge(0, "corner_hz", filter="butterworth", order=4), FILTER,
        ),
        (
            "both: Bessel 4, 100 to 10 Hz", 100.0, 10.0,
            on_gauge(0, "corner_hz", filter="bessel", order=4), FILTER,
        ),
        ("both: sinc 3, 500 to 50 Hz", 500.0, 50.0, on_gauge(0, "corner_hz", filter="sinc", order=3), FILTER),
        ("gain of gauge 2, 0.3 to 3 %", 3e-3, 3e-2, on_gauge(2, "gain_error"), one("gauge-ratio"), True),
        ("gauge 1: square, 0.1 to 1 %", 1e-3, 1e-2, on_gauge(1, "bend"), one("gauge-1-bend"), True),
        ("gauge 1: cube, 0.1 to 1 %", 1e-3, 1e-2, on_gauge(1, "bend_cubic"), one("gauge-1-bend"), True),
        ("gauge 2: square, 0.1 to 1 %", 1e-3, 1e-2, on_gauge(2, "bend"), one("gauge-2-bend"), True),
        ("gauge 2: cube, 0.1 to 1 %", 1e-3, 1e-2, on_gauge(2, "bend_cubic"), one("gauge-2-bend"), True),
        ("gauge 1 in gauge 2, 0.1 to 2 %", 1e-3, 2e-2, on_gauge(2, "cross_talk"), one("cross-talk"), True),
        ("gauge 2 in gauge 1, 0.1 to 2 %", 1e-3, 2e-2, on_gauge(1, "cross_talk"), one("cross-talk"), True),
        (
            "gauge 1 creeps, 20 to 200 um", 2e-5, 2e-4,
            on_gauge(1, "creep_m", creep_time_s=(2.0, 15.0)), one("gauge-1-creep"), True,
        ),
        (
            "gauge 2 creeps, 20 to 200 um", 2e-5, 2e-4,
            on_gauge(2, "creep_m", creep_time_s=(2.0, 15.0)), one("gauge-2-creep"), True,
        ),
    ]  # fmt: skip
    surroundings = [
        ("soft base, 0.2 to 1 %", 2e-3, 1e-2, soft_base(on_floor=False), MODE),
        ("soft base, 1 to 4 %", 1e-2, 4e-2, soft_base(on_floor=False), MODE),
        ("soft base, gauge on the floor, 0.2 to 4 %", 2e-3, 4e-2, soft_base(on_floor=True), MODE),
        ("second mode near, 0.2 to 3 %", 2e-3, 3e-2, second_mode((1.8, 4.0)), MODE),
        ("second mode far, 0.1 to 0.6 %", 1e-3, 6e-3, second_mode((4.0, 10.0)), MODE),
        ("yaw in gauge 1, 0.2 to 2 %", 2e-3, 2e-2, yaw, MODE),
    ]
    friction = [
        ("f_s over f_d, 5 to 100 %", 0.05, 1.0, static, STATIC),
        ("Stribeck, 1 to 10 mm/s", 0.05, 0.5, stribeck((1e-3, 1e-2)), one("stribeck")),
        ("Stribeck, 10 to 100 mm/s", 0.05, 0.5, stribeck((1e-2, 1e-1)), VELOCITY),
        ("viscous film, 2 to 10 %", 0.02, 0.1, film, one("film")),
        ("viscous film, 10 to 40 %", 0.1, 0.4, film, one("film")),
        (
            "logarithm of velocity, 0.5 to 4 % a decade", 5e-3, 4e-2,
            on_stand("log_per_decade"), VELOCITY, True,
        ),
        (
            "gradient, 1 to 10 % over 10 mm", 0.01, 0.1,
            over_range("friction_gradient_per_m", 0.01), one("gradient"), True,
        ),
        (
            "wave along the track, 1 to 8 %", 0.01, 0.08,
            on_stand("friction_wave", friction_wave_m=(2e-3, 1e-2)), one("gradient"),
        ),
        (
            "wear, 1 to 8 % over 50 mm", 0.01, 0.08,
            over_range("friction_wear_per_m", 0.05), one("wear"),
        ),
        (
            "running in, 1 to 8 % over 50 mm", 0.01, 0.08,
            over_range("friction_wear_per_m", -0.05), one("wear"),
        ),
        ("asymmetry, 0.5 to 5 %", 5e-3, 5e-2, on_stand("friction_asymmetry"), TILT, True),
        ("presliding, 0.5 to 2 um", 5e-7, 2e-6, on_stand("presliding_m"), one("presliding")),
        ("presliding, 2 to 10 um", 2e-6, 1e-5, on_stand("presliding_m"), one("presliding")),
        (
            "f_s grows with contact time, 1 to 10 % a decade", 0.01, 0.1,
            on_stand("dwell_per_decade"), STATIC | {"dwell"},
        ),
        ("tilt, 0.3 to 3 mrad", 3e-4, 3e-3, on_stand("tilt_rad"), TILT, True),
    ]  # fmt: skip
    kinds = {
        "release": release,
        "suspension": suspension,
        "gauges": gauges,
        "surroundings": surroundings,
        "friction": friction,
    }
    return (
        Effect("ideal", "none", 1.0, 1.0, none),
        *(Effect(group, *row) for group, rows in kinds.items() for row in rows),
    )


EFFECTS = _effects()
NOISES_AND_RATES = (
    (5e-6, (1000.0, 1000.0, 500.0)),
    (2e-5, (1000.0, 1000.0, 500.0)),
    (5e-5, (1000.0, 500.0, 200.0)),
)
"""White noise (m, standard deviation) and the rates (Hz) that go with it."""


def series_of_study(count: int = 8) -> list[str]:
    """Series drawn once and for all from the 36 of Table 1."""
    return sorted(np.random.default_rng(15).choice(list(published_table()), count, replace=False).tolist())


def draw_scene(effect: Effect, seed: int) -> tuple[Scene, float, list[Effect]]:
    """A random scene under that effect, its strength, and milder effects beside it.

    Half of the records have one or two of the other groups in their weakest strengths. A third of the stands
    is tilted by up to 0.5 mrad; half state the uncertainty of their gains.
    """
    rng = np.random.default_rng((seed, 15))
    name = str(rng.choice(series_of_study()))
    row, pullback_m = published_table()[name], load_stand().series(name).pullback_m
    noise_m, rates = NOISES_AND_RATES[rng.integers(len(NOISES_AND_RATES))]
    stated = rng.random() < 0.5
    stand = RealStand(
        period_s=row.period_s * rng.uniform(0.97, 1.03),
        damping_n1_per_s=row.damping_n1_per_s * rng.uniform(0.8, 1.2),
        plate_mass_kg=row.plate_mass_kg,
        friction_dynamic=row.friction_dynamic * rng.uniform(0.9, 1.1),
        pullback_m=pullback_m * rng.uniform(0.99, 1.01),
        tilt_rad=rng.uniform(-5e-4, 5e-4) if rng.random() < 1.0 / 3.0 else 0.0,
    )
    gains = 1e-3 * rng.standard_normal(2) if stated else np.zeros(2)
    zeros = rng.uniform(-5e-3, 5e-3, 2)
    scene = Scene(
        stand,
        tuple(RealGauge(gain_error=gains[n], zero_m=zeros[n], range_m=stand.pullback_m) for n in (0, 1)),
        series=name,
        rate_hz=float(rng.choice(rates)),
        noise_m=noise_m,
        hold_s=float(rng.uniform(0.6, 1.5)),
        duration_s=float(rng.uniform(9.0, 14.0)),
        gain_uncertainty=1e-3 if stated else None,
        seed=seed,
    )
    strength = effect.strength(rng)
    scene, others = effect.change(scene, strength, rng), []
    groups = {effect.group, "ideal"}
    for _ in range(int(rng.choice([0, 0, 1, 2])) if effect.group != "ideal" else 0):
        other = [each for each in EFFECTS if each.group not in groups and _may_join(each, scene)]
        chosen = other[rng.integers(len(other))]
        scene = chosen.change(scene, chosen.strength(rng, mild=True), rng)
        groups.add(chosen.group)
        others.append(chosen)
    return scene, strength, others


def _may_join(effect: Effect, scene: Scene) -> bool:
    """Dry friction of the stand is not simulated on a moving base or with a loose part."""
    rolling = effect.name.startswith(("x_k", "structural"))
    moving = effect.name.startswith(("soft base", "second mode"))
    p = scene.stand
    return not (
        (rolling and (p.base_compliance or p.second_mode_share))
        or (moving and (p.stand_friction_m or p.loss_factor))
    )
