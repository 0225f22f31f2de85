"""Guidance: instruction and detail of each state, with its figures, for every situation."""

import math

import pytest

from app.acquisition.guidance import PullbackSituation, guidance_for
from app.acquisition.messages import PullbackState, StandPosition
from app.acquisition.pullback.plan import AllowedPlateRange

MM = "\u202fmm"
AT_REST = StandPosition(0.012, 0.24e-3, 0.2e-3, 0.0)


def said(state, table_mm=0.0, plate_mm=0.0, position=AT_REST, **more):
    guidance = guidance_for(PullbackSituation(state, position, table_mm * 1e-3, plate_mm * 1e-3, **more))
    return f"{guidance.instruction}: {guidance.detail}"


@pytest.mark.parametrize("state", [*PullbackState])
@pytest.mark.parametrize("simulated", [False, True])
def test_every_state_has_an_instruction(state, simulated):
    guidance = guidance_for(PullbackSituation(state, AT_REST, 0.0, 0.0, simulated=simulated))
    assert str(guidance.instruction)
    assert "nan" not in str(guidance.detail)


@pytest.mark.parametrize(
    ("table_mm", "sentence"),
    [
        (0.2, f"Pull the table back to 12.0{MM}: now 0.0{MM}"),
        (11.8, f"Pull the table back to 12.0{MM}: now 11.6{MM}"),
        (-11.4, f"Pull the table back to 12.0{MM}: now 11.6{MM}"),
        (12.3, f"Pull the table back to 12.0{MM}: now 12.1{MM}"),
        (12.8, f"Ease the table back to 12.0{MM}: now 12.6{MM}, 0.6{MM} too far"),
        (math.nan, f"Pull the table back to 12.0{MM}: now –{MM}"),
    ],
)
def test_how_far_to_pull_and_how_far_it_is(table_mm, sentence):
    assert said(PullbackState.PULLING, table_mm) == sentence


def test_without_a_wanted_pullback_only_what_is():
    assert said(PullbackState.PULLING, 5.2, position=StandPosition(None, 0.0, 0.2e-3)) == (
        f"Pull the table back: now 5.0{MM}"
    )


def test_hold_and_let_go():
    assert said(PullbackState.HELD, 12.2).startswith(f"Hold the table still: now 12.0{MM}: it arms")
    assert said(PullbackState.ARMED, 12.2) == f"Let go: In one stroke, without pushing: now 12.0{MM}."


@pytest.mark.parametrize(
    ("side", "plate_mm", "how"),
    [
        (0, -16.0, f"Until gauge 2 reads 0.0{MM}; now −16.0{MM}."),
        (
            1,
            -16.0,
            f"Towards the side to which the table is pulled, until gauge 2 reads 0.0{MM}; now −16.0{MM}.",
        ),
        (
            1,
            16.0,
            f"Away from the side to which the table is pulled, until gauge 2 reads 0.0{MM}; now 16.0{MM}.",
        ),
        (
            -1,
            16.0,
            f"Towards the side to which the table is pulled, until gauge 2 reads 0.0{MM}; now 16.0{MM}.",
        ),
    ],
)
def test_how_far_and_to_which_side_the_plate_goes(side, plate_mm, how):
    position = StandPosition(0.012, side=side, plate_m=-0.016, plate_wanted_m=0.0)
    sentence = said(PullbackState.RECENTRE, 0.0, plate_mm, position)
    assert sentence == f"Push the plate back by 16.0{MM}: {how}"


def test_before_arming_a_plate_that_does_not_fit_is_said_too():
    room = AllowedPlateRange(-0.0146, 0.0146)
    assert said(PullbackState.IDLE, 0.0, 14.0, plate_range=room).startswith("Arm when the stand is at rest")
    assert said(PullbackState.IDLE, 0.0, 15.0, plate_range=room).startswith(
        f"Push the plate back by 15.0{MM}"
    )
    assert said(PullbackState.IDLE, 0.0, math.nan, plate_range=room).startswith("Arm when")


def test_a_note_takes_the_place_of_the_detail():
    guidance = guidance_for(
        PullbackSituation(PullbackState.HELD, AT_REST, 0.012, note="It drifts. Hold it still")
    )
    assert str(guidance.instruction) == "Hold the table still"
    assert str(guidance.detail) == "It drifts. Hold it still"
    assert guidance.is_warning


def test_a_note_is_added_where_the_operator_needs_the_reading():
    guidance = guidance_for(PullbackSituation(PullbackState.PULLING, AT_REST, 0.0062, note="It was let down"))
    assert str(guidance.detail) == f"now 6.0{MM}. It was let down"
    position = StandPosition(0.012, side=1, plate_wanted_m=0.0)
    moved = PullbackSituation(PullbackState.RECENTRE, position, plate_m=0.016, note="Gently")
    assert str(guidance_for(moved).detail).endswith(f"now 16.0{MM}. Gently")


def test_a_lost_device_comes_first():
    lost = PullbackSituation(PullbackState.TAIL, AT_REST, 0.0, 0.0, loss_reason="COM7 is gone")
    guidance = guidance_for(lost)
    assert str(guidance.instruction) == "Plug the device in again"
    assert str(guidance.detail) == "COM7 is gone. The run goes on when it is back."
    assert guidance.is_warning


def test_an_early_release_is_the_instruction_until_the_zero_is_known_again():
    position = StandPosition(0.012, 0.24e-3, 0.2e-3, early_release_m=0.00404)
    swinging = PullbackSituation(PullbackState.ZERO, position, 0.003, note="It swings")
    guidance = guidance_for(swinging)
    assert str(guidance.instruction) == f"Let go too early, at 4.0{MM}"
    assert str(guidance.detail) == "Put the plate back and pull again. It swings"
    assert guidance.is_warning
    simulated = guidance_for(PullbackSituation(PullbackState.ZERO, position, simulated=True))
    assert str(simulated.detail) == "The stand puts the plate back and pulls again by itself."


def test_nobody_is_asked_to_plug_in_a_simulated_device():
    lost = PullbackSituation(PullbackState.TAIL, AT_REST, simulated=True, loss_reason="the port is gone")
    assert str(guidance_for(lost).instruction) == "Wait for the device"
