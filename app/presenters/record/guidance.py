"""The one sentence that tells the operator what to do, for each state of the pullback."""

import math
from dataclasses import dataclass
from enum import StrEnum

from app.acquisition.messages import PullbackState
from app.presenters import numbers
from app.presenters.record.state import Guidance, Progression, Step, Target
from app.presenters.screen import Tone


class Stage(StrEnum):
    """Where the screen is when the engine does not say it: before, after, and beside its states."""

    OFFLINE = "offline"
    FINDING = "finding"
    """The run is stored and being identified."""
    DONE = "done"


Where = PullbackState | Stage


@dataclass(frozen=True, slots=True)
class Situation:
    """What the sentence depends on. Displacements in m, from the zero; NaN where unknown."""

    where: Where = Stage.OFFLINE
    pullback_m: float | None = None
    table_m: float = math.nan
    plate_offset_m: float = 0.0
    """How far the plate stands from the middle of its gauge."""
    room_needed_m: float | None = None
    """Largest offset at which the next slip still fits the gauge; None where its range is not known."""
    simulated: bool = False
    note: str = ""
    """What did not go as it should, in the engine's words."""
    waiting_for: str = ""
    """What is being started before the engine can say anything."""


_STEPS: tuple[tuple[str, frozenset[Where]], ...] = (
    ("Zero", frozenset({PullbackState.ZERO})),
    ("Pull", frozenset({PullbackState.PULLING})),
    ("Hold", frozenset({PullbackState.HELD})),
    ("Slip", frozenset({PullbackState.SLIPPING})),
    ("Tail", frozenset({PullbackState.TAIL})),
    ("Store", frozenset({PullbackState.CLOSING})),
    ("Result", frozenset({Stage.FINDING, Stage.DONE})),
)

_SAYINGS: dict[Where, tuple[str, str]] = {
    Stage.OFFLINE: ("Connect an amplifier", "Nothing is connected."),
    Stage.FINDING: ("Finding friction", "The run is stored and is being compared with its simulation."),
    Stage.DONE: ("Done", ""),
    PullbackState.CONNECTING: ("Waiting for samples", "The port is open; nothing has come yet."),
    PullbackState.IDLE: ("Arm when the stand is at rest", "Nothing is being recorded."),
    PullbackState.ZERO: ("Leave the stand alone", "Its zero is being taken."),
    PullbackState.PULLING: ("Pull the table back", ""),
    PullbackState.HELD: ("Let go", "In one stroke, without pushing."),
    PullbackState.SLIPPING: ("Hands off", "The plate is sliding."),
    PullbackState.TAIL: ("Hands off", "Both move together; the recording ends by itself."),
    PullbackState.CLOSING: ("Storing the run", "It is being completed and checked."),
}

_SIMULATED: dict[Where, tuple[str, str]] = {
    PullbackState.IDLE: ("Arm at any time", "The simulated stand pulls and lets go by itself."),
    PullbackState.ZERO: ("Wait for the pull", "The zero is being taken; the stand pulls by itself."),
    PullbackState.HELD: ("Wait for the release", "The stand lets go by itself."),
    PullbackState.SLIPPING: ("The plate slides", "Recording."),
    PullbackState.TAIL: ("Both move together", "The recording ends by itself."),
}


def guide(situation: Situation) -> Guidance:
    """Say what to do in this situation."""
    where = situation.where
    instruction, detail = _SAYINGS[where]
    if situation.simulated:
        instruction, detail = _SIMULATED.get(where, (instruction, detail))
    if where is PullbackState.IDLE and _must_recentre(situation):
        return _recentre(situation)
    if where is PullbackState.PULLING:
        instruction, detail = _pull(situation)
    if where is PullbackState.CONNECTING and situation.waiting_for:
        instruction, detail = "One moment", situation.waiting_for
    if situation.note:
        detail = situation.note
    target = _target(situation) if where in (PullbackState.PULLING, PullbackState.HELD) else None
    tone = Tone.WARN if situation.note else Tone.PLAIN
    return Guidance(instruction, detail, tone, target, _steps(where))


def _pull(situation: Situation) -> tuple[str, str]:
    who = "The stand pulls back" if situation.simulated else "Pull the table back"
    now = f"now {numbers.with_unit(numbers.millimetres(abs(situation.table_m)), 'mm')}"
    if situation.pullback_m is None:
        return who, now
    target = numbers.with_unit(numbers.millimetres(situation.pullback_m), "mm")
    return f"{who} to {target}", now


def _target(situation: Situation) -> Target | None:
    if situation.pullback_m is None or not math.isfinite(situation.table_m):
        return None
    return Target(situation.pullback_m * 1e3, abs(situation.table_m) * 1e3)


def _must_recentre(situation: Situation) -> bool:
    room = situation.room_needed_m
    return room is not None and not situation.simulated and abs(situation.plate_offset_m) > room


def _recentre(situation: Situation) -> Guidance:
    off = numbers.with_unit(numbers.millimetres(abs(situation.plate_offset_m)), "mm")
    return Guidance(
        "Re-centre the plate",
        f"It stands {off} off: the next slip might leave the range of gauge 2.",
        Tone.WARN,
        steps=_steps(PullbackState.IDLE),
    )


def _steps(where: Where) -> tuple[Step, ...]:
    names = [name for name, _ in _STEPS]
    now = next((i for i, (_, places) in enumerate(_STEPS) if where in places), None)
    if now is None:
        return tuple(Step(name) for name in names)
    if where is Stage.DONE:
        return tuple(Step(name, Progression.DONE) for name in names)
    return tuple(Step(name, _progression(i, now)) for i, name in enumerate(names))


def _progression(step: int, now: int) -> Progression:
    if step == now:
        return Progression.NOW
    return Progression.DONE if step < now else Progression.AHEAD
