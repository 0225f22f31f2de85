"""Guidance of the operator: one instruction and its detail for each state of a pullback test.

The command line prints both; the window translates them.
"""

import math
from dataclasses import dataclass

from analysis.catalogue import displacement_decimals, displacement_unit
from analysis.formatting import typeset, with_unit
from app.acquisition.messages import PullbackState, StandPosition
from app.acquisition.pullback.plan import AllowedPlateRange
from messages.i18n import N_
from messages.message import Message, joined, message

_TEXTS = {
    PullbackState.CONNECTING: (N_("Waiting for samples"), N_("The port is open; nothing has come yet.")),
    PullbackState.IDLE: (N_("Arm when the stand is at rest"), N_("Nothing is being recorded.")),
    PullbackState.ZERO: (N_("Leave the stand alone"), N_("Its zero is being taken.")),
    PullbackState.RELEASED: (N_("Hands off"), N_("Released.")),
    PullbackState.SLIPPING: (N_("Hands off"), N_("The plate is sliding.")),
    PullbackState.NO_SLIP: (
        N_("Hands off"),
        N_("The plate stays on the table; the recording ends by itself."),
    ),
    PullbackState.TAIL: (N_("Hands off"), N_("Both move together; the recording ends by itself.")),
    PullbackState.RECORDING: (N_("Recording"), N_("Everything is kept, whatever the stand does.")),
    PullbackState.CLOSING: (N_("Storing the run"), N_("It is being completed and checked.")),
}
_SIMULATED_TEXTS = {
    PullbackState.IDLE: (N_("Arm at any time"), N_("The simulated stand pulls and lets go by itself.")),
    PullbackState.RECENTRE: (N_("Wait for the plate"), N_("The stand puts it back by itself.")),
    PullbackState.ZERO: (N_("Wait for the pull"), N_("The zero is being taken; the stand pulls by itself.")),
    PullbackState.HELD: (N_("Wait for the release"), N_("The stand lets go by itself.")),
    PullbackState.ARMED: (N_("Wait for the release"), N_("The stand lets go by itself.")),
    PullbackState.RELEASED: (N_("The plate slides"), N_("Recording.")),
    PullbackState.SLIPPING: (N_("The plate slides"), N_("Recording.")),
    PullbackState.TAIL: (N_("Both move together"), N_("The recording ends by itself.")),
}
_NEEDS_DEVICE = frozenset(PullbackState) - {PullbackState.CLOSING}
_MOVED_BY_HAND = (PullbackState.RECENTRE, PullbackState.PULLING)
"""The operator needs the readings here even if there is a note."""
_UNKNOWN_POSITION = StandPosition()


@dataclass(frozen=True, slots=True)
class PullbackSituation:
    """What the guidance depends on. Readings in m, as the gauges read; NaN where unknown."""

    state: PullbackState
    position: StandPosition = _UNKNOWN_POSITION
    table_m: float = math.nan
    plate_m: float = math.nan  # reading of gauge 2
    plate_range: AllowedPlateRange | None = None
    """Allowed position of the plate before a pull; None where the range of gauge 2 is unknown."""
    simulated: bool = False
    note: Message | str = ""  # what did not go as expected
    loss_reason: Message | str = ""  # why the device is lost; empty while it is there

    @property
    def is_device_lost(self) -> bool:
        return bool(self.loss_reason) and self.state in _NEEDS_DEVICE

    @property
    def pulled_m(self) -> float:
        """Distance of the table from its zero (m), without sign."""
        return abs(self.table_m - (self.position.table_zero_m or 0.0))

    @property
    def is_early_release(self) -> bool:
        return self.position.early_release_m is not None

    @property
    def must_recentre(self) -> bool:
        """Tell whether the operator should push the plate back before arming."""
        allowed = self.plate_range
        is_off = allowed is not None and allowed.exists and not allowed.fits(self.plate_m)
        return self.state is PullbackState.IDLE and is_off and not self.simulated


@dataclass(frozen=True, slots=True)
class Guidance:
    """What the operator does next, and why or how. `is_warning` where something is not as expected."""

    instruction: Message
    detail: Message
    is_warning: bool = False


def guidance_for(situation: PullbackSituation) -> Guidance:
    """Choose the instruction for a situation."""
    if situation.is_device_lost:
        template = N_("Wait for the device") if situation.simulated else N_("Plug the device in again")
        return Guidance(message(template), _loss_detail(situation), is_warning=True)
    is_plate_off = situation.must_recentre or situation.state is PullbackState.RECENTRE
    instruction, detail = _push_back(situation) if situation.must_recentre else _instruct(situation)
    if situation.note:
        detail = _with_note(situation, detail)
    is_warning = is_plate_off or situation.is_early_release or bool(situation.note)
    return Guidance(instruction, detail, is_warning)


def _loss_detail(situation: PullbackSituation) -> Message:
    if situation.state is PullbackState.CONNECTING:
        return message("{reason}.", reason=situation.loss_reason)
    return message("{reason}. The run goes on when it is back.", reason=situation.loss_reason)


def _with_note(situation: PullbackSituation, detail: Message) -> Message:
    if situation.state not in _MOVED_BY_HAND and not situation.is_early_release:
        return joined([situation.note])
    return joined([detail, situation.note], " " if detail.template.endswith(".") else ". ")


def _instruct(situation: PullbackSituation) -> tuple[Message, Message]:
    state = situation.state
    if situation.is_early_release:
        return _early_release(situation)
    if situation.simulated and state in _SIMULATED_TEXTS:
        instruction, detail = _SIMULATED_TEXTS[state]
        return message(instruction), message(detail)
    match state:
        case PullbackState.RECENTRE:
            return _push_back(situation)
        case PullbackState.PULLING:
            return _pull(situation)
        case PullbackState.HELD:
            detail_of_hold = message(
                "{now}: it arms as soon as the table stands steadily.", now=_now(situation)
            )
            return message("Hold the table still"), detail_of_hold
        case PullbackState.ARMED:
            return message("Let go"), message("In one stroke, without pushing: {now}.", now=_now(situation))
    instruction, detail = _TEXTS[state]
    return message(instruction), message(detail)


def _pull(situation: PullbackSituation) -> tuple[Message, Message]:
    position = situation.position
    if position.pullback_m is None:
        if situation.simulated:
            return message("The stand pulls back"), _now(situation)
        return message("Pull the table back"), _now(situation)
    target, overshoot_m = _length(position.pullback_m), situation.pulled_m - position.pullback_m
    if situation.simulated:
        return message("The stand pulls back to {target}", target=target), _now(situation)
    if overshoot_m > position.tolerance_m:
        detail = message("{now}, {length} too far", now=_now(situation), length=_length(overshoot_m))
        return message("Ease the table back to {target}", target=target), detail
    return message("Pull the table back to {target}", target=target), _now(situation)


def _early_release(situation: PullbackSituation) -> tuple[Message, Message]:
    early = message(
        "Let go too early, at {length}", length=_length(situation.position.early_release_m or 0.0)
    )
    if situation.simulated:
        return early, message("The stand puts the plate back and pulls again by itself.")
    return early, message("Put the plate back and pull again.")


def _push_back(situation: PullbackSituation) -> tuple[Message, Message]:
    wanted_m = situation.position.plate_wanted_m
    if wanted_m is None:
        wanted_m = situation.plate_range.best_m if situation.plate_range else 0.0
    missing_m = wanted_m - situation.plate_m
    side, wanted, now = situation.position.side, _length(wanted_m), _length(situation.plate_m)
    if side == 0:
        template = N_("Until gauge 2 reads {wanted}; now {now}.")
    elif missing_m * side > 0.0:
        template = N_(
            "Towards the side to which the table is pulled, until gauge 2 reads {wanted}; now {now}."
        )
    else:
        template = N_(
            "Away from the side to which the table is pulled, until gauge 2 reads {wanted}; now {now}."
        )
    detail = message(template, wanted=wanted, now=now)
    return message("Push the plate back by {length}", length=_length(abs(missing_m))), detail


def _now(situation: PullbackSituation) -> Message:
    return message("now {length}", length=_length(situation.pulled_m))


def _length(value_m: float) -> str:
    unit = displacement_unit()
    return with_unit(typeset(unit.number(value_m, displacement_decimals(1))), unit.symbol)
