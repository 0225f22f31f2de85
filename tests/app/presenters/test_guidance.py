"""The sentence of each state, with its figures, for every situation."""

import math

import pytest

from app.acquisition.messages import PullbackState, StandPosition
from app.acquisition.pullback.plan import AllowedPlateRange
from app.presenters.base import Tone
from app.presenters.record.guidance import GuidanceInput, ScreenStage, guidance_for
from app.presenters.record.state import StepStatus

MM = "\u202fmm"
AT_REST = StandPosition(0.012, 0.24e-3, 0.2e-3, 0.0)


def said(where, table_mm=0.0, plate_mm=0.0, standing=AT_REST, **more):
    guidance = guidance_for(GuidanceInput(where, standing, table_mm * 1e-3, plate_mm * 1e-3, **more))
    return f"{guidance.instruction}: {guidance.detail}"


@pytest.mark.parametrize("where", [*PullbackState, *ScreenStage])
@pytest.mark.parametrize("simulated", [False, True])
def test_every_state_says_something_and_stands_somewhere(where, simulated):
    guidance = guidance_for(GuidanceInput(where, AT_REST, 0.0, 0.0, simulated=simulated))
    assert guidance.instruction
    assert "nan" not in guidance.detail
    during = where not in (PullbackState.CONNECTING, PullbackState.IDLE, ScreenStage.OFFLINE)
    assert any(step.status is not StepStatus.AHEAD for step in guidance.steps) == during


@pytest.mark.parametrize(
    ("table_mm", "sentence"),
    [
        (0.2, f"Pull the table back to 12.0{MM}: Now 0.0{MM}"),
        (11.8, f"Pull the table back to 12.0{MM}: Now 11.6{MM}"),
        (-11.4, f"Pull the table back to 12.0{MM}: Now 11.6{MM}"),
        (12.3, f"Pull the table back to 12.0{MM}: Now 12.1{MM}"),
        (12.8, f"Ease the table back to 12.0{MM}: Now 12.6{MM}, 0.6{MM} too far"),
        (math.nan, f"Pull the table back to 12.0{MM}: Now –{MM}"),
    ],
)
def test_how_far_to_pull_and_how_far_it_is(table_mm, sentence):
    assert said(PullbackState.PULLING, table_mm) == sentence


def test_without_a_wanted_pullback_only_what_is():
    assert said(PullbackState.PULLING, 5.2, standing=StandPosition(None, 0.0, 0.2e-3)) == (
        f"Pull the table back: Now 5.0{MM}"
    )


def test_hold_and_let_go():
    assert said(PullbackState.HELD, 12.2).startswith(f"Hold the table still: Now 12.0{MM}: it arms")
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
    standing = StandPosition(0.012, side=side, plate_m=-0.016, plate_wanted_m=0.0)
    sentence = said(PullbackState.RECENTRE, 0.0, plate_mm, standing)
    assert sentence == f"Push the plate back by 16.0{MM}: {how}"


def test_before_arming_a_plate_that_does_not_fit_is_said_too():
    room = AllowedPlateRange(-0.0146, 0.0146)
    assert said(PullbackState.IDLE, 0.0, 14.0, plate_range=room).startswith("Arm when the stand is at rest")
    assert said(PullbackState.IDLE, 0.0, 15.0, plate_range=room).startswith(
        f"Push the plate back by 15.0{MM}"
    )
    assert said(PullbackState.IDLE, 0.0, math.nan, plate_range=room).startswith("Arm when")


def test_what_went_wrong_takes_the_place_of_the_details():
    guidance = guidance_for(
        GuidanceInput(PullbackState.HELD, AT_REST, 0.012, note="It drifts. Hold it still")
    )
    assert (guidance.instruction, guidance.detail) == ("Hold the table still", "It drifts. Hold it still")
    assert guidance.tone is Tone.WARN


def test_what_went_wrong_is_added_where_the_figure_is_needed():
    guidance = guidance_for(GuidanceInput(PullbackState.PULLING, AT_REST, 0.0062, note="it was let down"))
    assert guidance.detail == f"Now 6.0{MM}. It was let down"


def test_the_target_bar_knows_the_tolerance():
    target = guidance_for(GuidanceInput(PullbackState.PULLING, AT_REST, 0.0120)).target
    assert target is not None
    assert (target.target_mm, target.now_mm) == pytest.approx((12.0, 11.8))
    assert target.is_reached
    assert not guidance_for(GuidanceInput(PullbackState.PULLING, AT_REST, 0.0118)).target.is_reached
