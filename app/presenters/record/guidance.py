"""The one sentence that tells the operator what to do, for each state of the pullback."""

import math
from dataclasses import dataclass
from enum import StrEnum

from app.acquisition.messages import PullbackState, StandPosition
from app.acquisition.pullback.plan import AllowedPlateRange
from app.presenters import number_text
from app.presenters.base import Tone
from app.presenters.record.state import Cue, Guidance, PullbackTarget, Step, StepStatus
from app.presenters.results import sentence
from messages.i18n import N_, gettext


class ScreenStage(StrEnum):
    """Where the screen is when the engine does not say it: before, after, and beside its states."""

    OFFLINE = "offline"
    FINDING = "finding"
    """The run is stored and being identified."""
    DONE = "done"


PullbackStage = PullbackState | ScreenStage
_NOTHING_KNOWN = StandPosition()


@dataclass(frozen=True, slots=True)
class GuidanceInput:
    """What the sentence depends on. Readings in m, as the gauges give them; NaN where unknown."""

    stage: PullbackStage = ScreenStage.OFFLINE
    standing: StandPosition = _NOTHING_KNOWN
    table_m: float = math.nan
    plate_m: float = math.nan
    """What gauge 2 itself reads."""
    plate_range: AllowedPlateRange | None = None
    """Where the plate may stand before the next pull; None where the range of gauge 2 is not known."""
    simulated: bool = False
    note: str = ""
    """What did not go as it should, in the engine's words."""
    waiting_for: str = ""
    """What is being started before the engine can say anything."""
    loss_reason: str = ""
    """Why the device is away, in a sentence; empty while it is there."""

    @property
    def pulled_m(self) -> float:
        """How far the table is from its zero (m), without sign."""
        return abs(self.table_m - (self.standing.table_zero_m or 0.0))


_STEPS: tuple[tuple[str, frozenset[PullbackStage]], ...] = (
    (N_("Zero"), frozenset({PullbackState.RECENTRE, PullbackState.ZERO})),
    (N_("Pull"), frozenset({PullbackState.PULLING})),
    (N_("Hold"), frozenset({PullbackState.HELD})),
    (N_("Armed"), frozenset({PullbackState.ARMED})),
    (N_("Slip"), frozenset({PullbackState.RELEASED, PullbackState.SLIPPING})),
    (N_("Tail"), frozenset({PullbackState.TAIL, PullbackState.NO_SLIP, PullbackState.RECORDING})),
    (N_("Store"), frozenset({PullbackState.CLOSING})),
    (N_("Result"), frozenset({ScreenStage.FINDING, ScreenStage.DONE})),
)

_TEXTS: dict[PullbackStage, tuple[str, str]] = {
    ScreenStage.OFFLINE: (N_("Connect an amplifier"), N_("Nothing is connected.")),
    ScreenStage.FINDING: (
        N_("Finding friction"),
        N_("The run is stored and is being compared with its simulation."),
    ),
    ScreenStage.DONE: (N_("Done"), ""),
    PullbackState.CONNECTING: (
        N_("Waiting for samples"),
        N_("The port is open; nothing has come yet."),
    ),
    PullbackState.IDLE: (
        N_("Arm when the stand is at rest"),
        N_("Nothing is being recorded."),
    ),
    PullbackState.ZERO: (N_("Leave the stand alone"), N_("Its zero is being taken.")),
    PullbackState.RELEASED: (N_("Hands off"), N_("Released.")),
    PullbackState.SLIPPING: (N_("Hands off"), N_("The plate is sliding.")),
    PullbackState.NO_SLIP: (
        N_("Hands off"),
        N_("The plate stays on the table; the recording ends by itself."),
    ),
    PullbackState.TAIL: (
        N_("Hands off"),
        N_("Both move together; the recording ends by itself."),
    ),
    PullbackState.RECORDING: (
        N_("Recording"),
        N_("Everything is kept, whatever the stand does."),
    ),
    PullbackState.CLOSING: (
        N_("Storing the run"),
        N_("It is being completed and checked."),
    ),
}

_SIMULATED_TEXTS: dict[PullbackStage, tuple[str, str]] = {
    PullbackState.IDLE: (
        N_("Arm at any time"),
        N_("The simulated stand pulls and lets go by itself."),
    ),
    PullbackState.RECENTRE: (
        N_("Wait for the plate"),
        N_("The stand puts it back by itself."),
    ),
    PullbackState.ZERO: (
        N_("Wait for the pull"),
        N_("The zero is being taken; the stand pulls by itself."),
    ),
    PullbackState.HELD: (N_("Wait for the release"), N_("The stand lets go by itself.")),
    PullbackState.ARMED: (N_("Wait for the release"), N_("The stand lets go by itself.")),
    PullbackState.RELEASED: (N_("The plate slides"), N_("Recording.")),
    PullbackState.SLIPPING: (N_("The plate slides"), N_("Recording.")),
    PullbackState.TAIL: (N_("Both move together"), N_("The recording ends by itself.")),
}

_CUES: dict[PullbackStage, Cue] = {
    PullbackState.RECENTRE: Cue.TROUBLE,
    PullbackState.PULLING: Cue.PULL,
    PullbackState.HELD: Cue.HOLD,
    PullbackState.ARMED: Cue.LET_GO,
    PullbackState.RELEASED: Cue.RELEASED,
    ScreenStage.DONE: Cue.RESULT,
}
_TOWARDS = N_("Towards the side to which the table is pulled, until gauge 2 reads {wanted}; now {now}.")
_AWAY = N_("Away from the side to which the table is pulled, until gauge 2 reads {wanted}; now {now}.")
_NEEDS_DEVICE = frozenset(PullbackState) - {PullbackState.CLOSING}
_MOVED_BY_HAND = (PullbackState.RECENTRE, PullbackState.PULLING)
"""The operator needs the figures, whatever else there is to say."""
_HELD_BACK = (PullbackState.PULLING, PullbackState.HELD, PullbackState.ARMED)


def guidance_for(situation: GuidanceInput) -> Guidance:
    """Say what to do in this situation."""
    where = situation.stage
    if situation.loss_reason and where in _NEEDS_DEVICE:
        return Guidance(gettext("Plug the device in again"), _lost(situation), Tone.BAD, None, _steps(where))
    must_recentre = where is PullbackState.IDLE and _must_recentre(situation)
    instruction, detail = _push(situation) if must_recentre else _say(situation)
    target = _target(situation) if where in _HELD_BACK else None
    warns = bool(situation.note) or must_recentre or where is PullbackState.RECENTRE
    if situation.note:
        figures = detail.rstrip(".") + ". " if where in _MOVED_BY_HAND else ""
        detail = figures + situation.note
    return Guidance(instruction, sentence(detail), Tone.WARN if warns else Tone.PLAIN, target, _steps(where))


def cue_for(situation: GuidanceInput) -> Cue | None:
    """What is to be heard in this situation, if somebody wants to hear it."""
    if situation.loss_reason and situation.stage in _NEEDS_DEVICE:
        return Cue.TROUBLE
    return _CUES.get(situation.stage)


def _lost(situation: GuidanceInput) -> str:
    goes_on = (
        ""
        if situation.stage is PullbackState.CONNECTING
        else " " + gettext("The run goes on when it is back.")
    )
    return situation.loss_reason.rstrip(".") + "." + goes_on


def _say(situation: GuidanceInput) -> tuple[str, str]:
    """What to do, and what else there is to know."""
    where = situation.stage
    if where is PullbackState.CONNECTING and situation.waiting_for:
        return gettext("One moment"), situation.waiting_for
    if situation.simulated and where in _SIMULATED_TEXTS:
        return _translated(_SIMULATED_TEXTS[where])
    match where:
        case PullbackState.RECENTRE:
            return _push(situation)
        case PullbackState.PULLING:
            return _pull(situation)
        case PullbackState.HELD:
            detail = gettext("{now}: it arms as soon as the table stands steadily.", now=_now(situation))
            return gettext("Hold the table still"), detail
        case PullbackState.ARMED:
            return gettext("Let go"), gettext("In one stroke, without pushing: {now}.", now=_now(situation))
    return _translated(_TEXTS[where])


def _translated(said: tuple[str, str]) -> tuple[str, str]:
    return gettext(said[0]), gettext(said[1])


def _pull(situation: GuidanceInput) -> tuple[str, str]:
    standing = situation.standing
    if standing.pullback_m is None:
        who = gettext("The stand pulls back") if situation.simulated else gettext("Pull the table back")
        return who, _now(situation)
    target, too_far_m = _mm(standing.pullback_m), situation.pulled_m - standing.pullback_m
    if situation.simulated:
        return gettext("The stand pulls back to {target}", target=target), _now(situation)
    if too_far_m > standing.tolerance_m:
        detail = gettext("{now}, {length} too far", now=_now(situation), length=_mm(too_far_m))
        return gettext("Ease the table back to {target}", target=target), detail
    return gettext("Pull the table back to {target}", target=target), _now(situation)


def _now(situation: GuidanceInput) -> str:
    return gettext("now {length}", length=_mm(situation.pulled_m))


def _target(situation: GuidanceInput) -> PullbackTarget | None:
    if situation.standing.pullback_m is None or not math.isfinite(situation.table_m):
        return None
    standing = situation.standing
    return PullbackTarget(
        1e3 * situation.standing.pullback_m, 1e3 * situation.pulled_m, 1e3 * standing.tolerance_m
    )


def _must_recentre(situation: GuidanceInput) -> bool:
    room = situation.plate_range
    is_off = room is not None and room.exists and not room.fits(situation.plate_m)
    return is_off and not situation.simulated


def _push(situation: GuidanceInput) -> tuple[str, str]:
    """How far to push the plate, and to which side."""
    wanted_m = situation.standing.plate_wanted_m
    if wanted_m is None:
        wanted_m = situation.plate_range.best_m if situation.plate_range else 0.0
    missing_m = wanted_m - situation.plate_m
    side, figures = situation.standing.side, {"wanted": _mm(wanted_m), "now": _mm(situation.plate_m)}
    if side == 0:
        how = gettext("Until gauge 2 reads {wanted}; now {now}.", **figures)
    elif missing_m * side > 0.0:
        how = gettext(_TOWARDS, **figures)
    else:
        how = gettext(_AWAY, **figures)
    return gettext("Push the plate back by {length}", length=_mm(abs(missing_m))), how


def _mm(value_m: float) -> str:
    return number_text.with_unit(number_text.format_millimetres(value_m), "mm")


def _steps(where: PullbackStage) -> tuple[Step, ...]:
    names = [gettext(name) for name, _ in _STEPS]
    now = next((i for i, (_, places) in enumerate(_STEPS) if where in places), None)
    if now is None:
        return tuple(Step(name) for name in names)
    if where is ScreenStage.DONE:
        return tuple(Step(name, StepStatus.DONE) for name in names)
    return tuple(Step(name, _progression(i, now)) for i, name in enumerate(names))


def _progression(step: int, now: int) -> StepStatus:
    if step == now:
        return StepStatus.NOW
    return StepStatus.DONE if step < now else StepStatus.AHEAD
