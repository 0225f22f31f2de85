"""Scheduled faults of a device: their options and times."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import SettingsError
from drivers.simulated.faults import Disturbance, DisturbanceKind, DisturbanceSchedule, parse_disturbance


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("stall", Disturbance(DisturbanceKind.STALL)),
        ("stall 2", Disturbance(DisturbanceKind.STALL, 2.0)),
        ("  Unplug 1.5 at 8 ", Disturbance(DisturbanceKind.UNPLUG, 1.5, 8.0)),
        ("power .5", Disturbance(DisturbanceKind.POWER, 0.5)),
        ("rubbish at 3", Disturbance(DisturbanceKind.GARBAGE, None, 3.0)),
        ("jump -5 at 1e1", Disturbance(DisturbanceKind.JUMP, -5.0, 10.0)),
    ],
)
def test_a_disturbance_is_read_from_words(text, meant):
    assert parse_disturbance(text) == meant


@pytest.mark.parametrize(
    "text",
    [
        "",
        "boom",
        "stall two",
        "stall 0",
        "stall -1",
        "stall 1 2",
        "stall at -1",
        "jump",
        "jump 0",
        "stall nan",
    ],
)
def test_what_is_none_is_refused_with_what_would_be(text):
    with pytest.raises(SettingsError, match="give") as refused:
        parse_disturbance(text)
    assert "\n" not in str(refused.value)


@given(st.text(max_size=40))
def test_any_text_is_read_or_refused(text):
    try:
        disturbance = parse_disturbance(text)
    except SettingsError:
        return
    assert disturbance.kind in DisturbanceKind


def script(*texts: str) -> DisturbanceSchedule:
    made = DisturbanceSchedule([parse_disturbance(text) for text in texts])
    made.restart()
    return made


def test_faults_hold_from_their_time_to_their_end():
    planned = script("stall 2 at 1", "rubbish at 5", "unplug 0.5 at 2", "power 1 at 2.25")
    times_s = [0.0, 0.99, 1.0, 2.99, 3.0, 4.99, 5.0, 1e6]
    kinds = [None, None, "stall", "stall", None, None, "rubbish", "rubbish"]
    assert [planned.wire_fault(t) for t in times_s] == kinds
    cable = [planned.cable_fault(t) for t in (1.9, 2.0, 2.3, 2.6, 3.3)]
    assert cable == [None, "unplug", "power", "power", None]


def test_leaps_of_the_clock_add_up():
    planned = script("jump -5 at 1", "jump 2 at 3")
    np.testing.assert_array_equal(
        planned.clock_offset_s(np.array([0.0, 1.0, 2.9, 3.0])), [0.0, -5.0, -5.0, -3.0]
    )


def test_a_new_session_has_what_is_planned_and_nothing_that_was_asked_for_before():
    made = DisturbanceSchedule([parse_disturbance("stall 1 at 5")])
    assert made.wire_fault(5.5) is None
    made.add(parse_disturbance("rubbish 1"), 2.0)
    assert made.wire_fault(2.5) == "rubbish"
    made.restart()
    assert made.wire_fault(2.5) is None
    assert made.wire_fault(5.5) == "stall"
    made.add(parse_disturbance("rubbish 1 at 9"), 2.0)
    assert [one.at_s for one in made.disturbances] == [5.0, 9.0]
