"""Deviations from the ideal stand that a simulated one can have: names, units and ranges.

docs/how-to/simulate-a-real-stand.md says what each of them is.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from messages.i18n import N_
from messages.message import MessageError


class EffectError(MessageError, ValueError):
    """An effect that no simulated stand can have; the message names what is allowed."""


@dataclass(frozen=True, slots=True)
class Effect:
    """One deviation; a stand without it is ideal in this."""

    parameter: str  # as in the results of an analysis, where it is found
    unit: str
    low: float
    high: float


STRIBECK = "stribeck_velocity_m_per_s"
"""Its effect changes the friction law; those of the stand are beside it."""
MOTION_EFFECTS = {
    "release-ramp": Effect("release_ramp_s", "s", 0.0, 0.06),
    "release-step": Effect("release_step", "1", 0.0, 0.95),
    "release-shape": Effect("release_shape", "1", -1.5, 3.0),
    "release-velocity": Effect("release_velocity_m_per_s", "m/s", -0.3, 0.3),
    "hold-creep": Effect("hold_creep_m_per_s", "m/s", -0.01, 0.01),
    "spring-hardening": Effect("spring_hardening", "1", -0.3, 0.5),
    "spring-asymmetry": Effect("spring_asymmetry", "1", -0.3, 0.3),
    "stand-friction": Effect("stand_friction_m", "m", 0.0, 2e-3),
    "drag": Effect("drag_per_m", "1/m", 0.0, 10.0),
    "loss-factor": Effect("loss_factor", "1", 0.0, 0.2),
    "arc": Effect("arc_per_m", "1/m", -10.0, 10.0),
    "second-mode": Effect("second_mode_mass_share", "1", 0.0, 0.3),
    "second-mode-frequency": Effect("second_mode_frequency_hz", "Hz", 0.5, 100.0),
    "second-mode-damping": Effect("second_mode_damping", "1", 0.0, 0.3),
    "base": Effect("base_compliance", "1", 0.0, 0.3),
    "base-frequency": Effect("base_frequency_hz", "Hz", 2.0, 100.0),
    "base-damping": Effect("base_damping", "1", 0.0, 0.3),
    "stribeck": Effect(STRIBECK, "m/s", 1e-4, 1.0),
    "film": Effect("film_s_per_m", "s/m", -5.0, 20.0),
    "log-velocity": Effect("friction_per_log_velocity", "1", -0.2, 0.3),
    "gradient": Effect("friction_gradient_per_m", "1/m", -40.0, 40.0),
    "wear": Effect("friction_wear_per_m", "1/m", -5.0, 5.0),
    "asymmetry": Effect("friction_asymmetry", "1", -0.5, 0.5),
    "dwell": Effect("friction_per_log_dwell", "1", 0.0, 0.5),
    "presliding": Effect("presliding_m", "m", 1e-7, 5e-5),
}
GAUGE_EFFECTS = {
    "gauge-2-lag": Effect("gauge_2_lag_s", "s", 0.0, 0.1),
    "gauge-1-filter": Effect("gauge_1_filter_hz", "Hz", 0.5, 1e5),
    "gauge-2-filter": Effect("gauge_2_filter_hz", "Hz", 0.5, 1e5),
    "gauge-1-bend": Effect("gauge_1_bend", "1", -0.2, 0.2),
    "gauge-2-bend": Effect("gauge_2_bend", "1", -0.2, 0.2),
    "gauge-1-creep": Effect("gauge_1_creep_m", "m", -0.01, 0.01),
    "gauge-2-creep": Effect("gauge_2_creep_m", "m", -0.01, 0.01),
    "cross-talk": Effect("cross_talk", "1", -0.2, 0.2),
    "cross-talk-1": Effect("cross_talk_1", "1", -0.2, 0.2),
    "gauge-ratio": Effect("relative_gain", "1", -0.3, 0.3),
}
"""They change readings, not the motion."""
EFFECTS = MOTION_EFFECTS | GAUGE_EFFECTS
LISTED = [name if effect.unit == "1" else f"{name} ({effect.unit})" for name, effect in EFFECTS.items()]
"""Names with their units, for help texts."""
_COMPLETED_BY = {
    "second-mode": {"second-mode-frequency": 8.0, "second-mode-damping": 0.01},
    "base": {"base-frequency": 12.0, "base-damping": 0.03},
}


def parse_effects(texts: Mapping[str, str]) -> dict[str, float]:
    """Effects as typed, name to value. Raises EffectError."""
    values = {}
    for name, text in texts.items():
        try:
            values[name] = float(text)
        except ValueError:
            template = N_("effect {name} {text!r} is not a number. Give one in the unit {unit}")
            unit = EFFECTS[name].unit if name in EFFECTS else ""
            raise EffectError(template, name=name, text=text, unit=unit) from None
    check_effects(values)
    return values


def check_effects(values: Mapping[str, float]) -> None:
    """Raise EffectError for a name that is not known or a value out of its range."""
    for name, value in values.items():
        if name not in EFFECTS:
            template = N_("effect {name!r} is not known: choose from {effects}")
            raise EffectError(template, name=name, effects=list(EFFECTS))
        effect = EFFECTS[name]
        if not effect.low <= value <= effect.high:
            template = N_("effect {name} = {value:g} {unit} is out of range: give {low:g} to {high:g}")
            low, high, unit = effect.low, effect.high, effect.unit
            raise EffectError(template, name=name, value=value, unit=unit, low=low, high=high)


def motion_values(values: Mapping[str, float]) -> dict[str, float]:
    """Values of the effects on the motion, by their parameters."""
    complete = dict(values)
    for name, others in _COMPLETED_BY.items():
        if name in values:
            complete = others | complete
    return {MOTION_EFFECTS[name].parameter: complete[name] for name in complete if name in MOTION_EFFECTS}


def gauge_values(values: Mapping[str, float]) -> dict[str, float]:
    """Values of the effects on the gauges, by their parameters."""
    return {GAUGE_EFFECTS[name].parameter: values[name] for name in values if name in GAUGE_EFFECTS}
