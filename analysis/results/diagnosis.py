"""Warnings that name what is wrong with a stand, with its size and a remedy."""

from collections.abc import Mapping
from typing import Any

from analysis.catalogue import Place, definition
from analysis.laws.stand_parts import CORNER_NAMES, SHARED_NAMES, STAND_PARAMETERS, StandEffect
from analysis.quantities import Quantity, ResultWarning
from messages.i18n import N_
from messages.message import Message, message

SENTENCES = {
    "release-ramp": N_("the release took {size}: use a sharper hook."),
    "release-shape": N_("the hook let go unevenly (shape {size}): use a sharper hook."),
    "release-step": N_("the hook lost {size} of its force at once and the rest later: use a sharper hook."),
    "release-velocity": N_("the table moved at {size} when it was released: wait until it hangs still."),
    "hold-creep": N_("the pull went on at {size} until the release: hold the table still, then let go."),
    "gauge-lag": N_(
        "gauge 2 lags gauge 1 by {size}: give both amplifiers the same filter, or state the filters in"
        " gauges.toml."
    ),
    "gauge-ratio": N_(
        "gauge 2 reads {size} more than gauge 1 lets expect: calibrate both gauges, and check that the base"
        " of the stand does not give way."
    ),
    "stand-friction": N_(
        "the stand itself has dry friction, x_k = {size}: clean its bearings and cables, and identify a run"
        " of the bare table."
    ),
    "film": N_("friction rises with the sliding velocity, by {size}: the contact is lubricated; clean it."),
    "log-velocity": N_(
        "friction changes by {size} of itself as the sliding velocity changes by a factor of e: f_d is a"
        " mean over the slid path."
    ),
    "gradient": N_("friction changes along the track by {size}: f_d is a mean over the slid path."),
    "dwell": N_(
        "static friction grows by {size} of itself as a stick lasts longer by a factor of e: wait as long"
        " before each release."
    ),
    "presliding": N_("the contact gives way by {size} before it slides: look for dust or a film between."),
    "wear": N_("friction changes with the slid path by {size}: f_d is a mean over the slid path."),
    "spring-hardening": N_("the springs harden by {size} at the pullback: pull back less."),
    "spring-asymmetry": N_(
        "the springs are stiffer on one side, by {size} at the pullback: check their clamps."
    ),
    "drag": N_("damping grows with the square of the velocity, by {size}: look for plates that move air."),
    "loss-factor": N_("the springs lose energy at every speed, loss factor {size}: check their clamps."),
    "arc": N_("the table moves on an arc of curvature {size}: use longer leaf springs, or pull back less."),
    "second-mode": N_(
        "a second mode at {frequency}, of {size} of the table's mass: tighten what is mounted."
    ),
    "gauge-1-creep": N_(
        "the zero of gauge 1 creeps by {size}: let the amplifier warm up, and hold the table for a shorter"
        " time."
    ),
    "gauge-2-creep": N_("the zero of gauge 2 creeps by {size}: let the amplifier warm up."),
    "filter": N_("a filter of {size} before both gauges rounds their readings: raise its corner."),
    "gauge-2-filter": N_("a filter of {size} before gauge 2 rounds its readings: raise its corner."),
    "gauge-1-bend": N_("gauge 1 is bent by {size} at the pullback: calibrate it over its whole range."),
    "gauge-2-bend": N_("gauge 2 is bent by {size} at the pullback: calibrate it over its whole range."),
    "cross-talk": N_(
        "a gauge shows {size} of the other one: separate their cables, and check their mounting."
    ),
    "base": N_("the base gives way by {size} of what the springs do: fix it to the ground."),
    "filter-damping": "",
    "static-friction": "",
}
"""By name of the effect, which is the code of the warning; those without one are told by other results."""

_SAME_KIND = ("gauge-1-bend", "gauge-2-bend", "cross-talk")  # the larger of their two parameters is told


def diagnose(effects: tuple[StandEffect, ...], results: dict[str, Quantity]) -> list[ResultWarning]:
    """One warning for each effect that the model holds."""
    warnings = []
    for effect in effects:
        names = result_names(effect)
        if SENTENCES[effect.name] and all(name in results for name in names):
            texts = {name: str(definition(name).format(results[name], Place.WINDOW)) for name in names}
            told = main_result(effect, {name: results[name].value for name in names})
            warnings.append(ResultWarning(effect.name, diagnosis(effect, texts, told)))
    return warnings


def result_names(effect: StandEffect) -> list[str]:
    """Names of the results that hold the sizes of an effect, the one that its sentence tells first."""
    names = [STAND_PARAMETERS[place].name for place in effect.own]
    names += [SHARED_NAMES[place][0] for place in effect.shared if place in SHARED_NAMES]
    return [CORNER_NAMES.get(name, name) for name in names]


def main_result(effect: StandEffect, values: Mapping[str, float]) -> str:
    """Name of the result that the sentence of an effect tells, of the sizes `values` by name."""
    names = result_names(effect)
    return max(names, key=lambda name: abs(values[name])) if effect.name in _SAME_KIND else names[0]


def diagnosis(effect: StandEffect, texts: Mapping[str, str | Message], told: str) -> Message:
    """Sentence on an effect with its remedy; `texts` are its sizes by name, `told` the main one."""
    values: dict[str, Any] = {"size": texts[told]}
    if "second_mode_frequency_hz" in texts:
        values["frequency"] = texts["second_mode_frequency_hz"]
    return message(SENTENCES[effect.name], **values)
