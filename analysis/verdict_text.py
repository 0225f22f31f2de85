"""Verdict and effects of a stand in words; loads nothing that computes."""

from analysis.identification import Degree, ModelSelection
from messages.i18n import N_
from messages.message import Message, joined, message

EFFECT_TITLES = {
    "static-friction": N_("static friction"),
    "release-ramp": N_("a slow release"),
    "release-shape": N_("an uneven release"),
    "release-step": N_("a release in two steps"),
    "release-velocity": N_("a table that moved at the release"),
    "hold-creep": N_("a pull that went on until the release"),
    "gauge-lag": N_("a lag of gauge 2"),
    "gauge-ratio": N_("gauges of different gain"),
    "stand-friction": N_("dry friction of its own"),
    "film": N_("a viscous film"),
    "spring-hardening": N_("hardening springs"),
    "spring-asymmetry": N_("springs stiffer on one side"),
    "drag": N_("quadratic damping"),
    "loss-factor": N_("springs that lose energy"),
    "arc": N_("a table on an arc"),
    "second-mode": N_("a second mode"),
    "dwell": N_("static friction that grows with the time of a stick"),
    "presliding": N_("a contact that gives way before it slides"),
    "gauge-1-creep": N_("a zero of gauge 1 that creeps"),
    "gauge-2-creep": N_("a zero of gauge 2 that creeps"),
    "log-velocity": N_("friction that changes with velocity"),
    "gradient": N_("friction that changes along the track"),
    "wear": N_("friction that changes with the slid path"),
    "filter": N_("a filter before both gauges"),
    "filter-damping": N_("a filter of another kind"),
    "gauge-2-filter": N_("a filter before gauge 2"),
    "gauge-1-bend": N_("a bend of gauge 1"),
    "gauge-2-bend": N_("a bend of gauge 2"),
    "cross-talk": N_("cross-talk between the gauges"),
    "base": N_("a base that gives way"),
    "pendulum": N_("the spring of a pendulum"),
    "damping-rise": N_("damping that grows with the swing"),
}
"""By name of the effect, which is also the code of the warning that gives its size and a remedy."""


def effect_title(name: str) -> Message:
    """Name of an effect for people; that of another version is named as it is."""
    return Message(EFFECT_TITLES.get(name, name))


def model_title(name: str, effects: tuple[str, ...]) -> Message:
    """A friction law and the effects of the stand beside it."""
    if not effects:
        return Message(name)
    titles = joined([effect_title(effect) for effect in effects], ", ")
    return message("{law} with {effects}", law=name, effects=titles)


def describe_verdict(model: ModelSelection, kind: str = "two-mass") -> Message:
    """What a model explains of a record, and whether f_d holds."""
    if model.adequate and not model.parts:
        return message("{law} explains the record", law=model.name)
    if model.adequate:
        effects = joined([effect_title(name) for name in model.parts], " + ")
        return message("{law} on a stand with {effects} explains the record", law=model.name, effects=effects)
    left = message("the residual exceeds the noise")
    if model.residual_share is not None:
        left = message("{percent:.2g} % of the swing is left", percent=100.0 * model.residual_share)
    holds = model.degree is Degree.FRICTION
    if holds and kind == "one-mass":
        template = N_("no model explains the record ({left}), but T and n hold: halves of the record agree")
    elif holds:
        template = N_(
            "no model explains the record ({left}), but f_d holds: joint fit and friction of the plate agree"
        )
    elif kind == "two-mass":
        template = N_("no model explains the record ({left}): f_d cannot be told")
    else:
        template = N_("no model explains the record ({left}): T and n cannot be told")
    return message(template, left=left)
