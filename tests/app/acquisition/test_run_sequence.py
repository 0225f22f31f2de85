"""Runs that follow one another: what they are, and what stops them."""

import pytest

from app.acquisition.messages import EndReason, RunEnded, RunSettings
from app.acquisition.run_setup import RunSequence, next_run
from app.runs.metadata import Conditions


def ended(reason: EndReason = EndReason.ENOUGH) -> RunEnded:
    return RunEnded("/runs/a.h5", reason, 100, 0, 0, 0, 0, 1000.0)


@pytest.mark.parametrize("reason", [EndReason.REST, EndReason.ENOUGH, EndReason.DURATION])
def test_a_run_that_ended_by_itself_is_followed_until_all_are_done(reason):
    repetition = RunSequence()
    repetition.begin(RunSettings("/runs", note="x"), 3)
    assert not repetition.is_repeat
    told, second = repetition.next_after(ended(reason))
    assert (told.remaining, second) == (2, RunSettings("/runs", note="x"))
    assert repetition.is_repeat
    told, third = repetition.next_after(ended(reason))
    assert (told.remaining, third) == (1, second)
    told, none = repetition.next_after(ended(reason))
    assert (told.remaining, none) == (0, None)
    assert not repetition.is_repeat


@pytest.mark.parametrize("reason", sorted(set(EndReason) - {"rest", "enough", "duration"}))
def test_a_run_that_needs_somebody_to_look_is_the_last(reason):
    repetition = RunSequence()
    repetition.begin(RunSettings("/runs"), 3)
    assert repetition.next_after(ended(reason)) == (ended(reason), None)
    assert repetition.next_after(ended()) == (ended(), None)


def test_stopped_nothing_follows_but_the_run_is_still_one_that_armed_itself():
    repetition = RunSequence()
    repetition.begin(RunSettings("/runs"), 3)
    repetition.next_after(ended())
    repetition.stop()
    assert repetition.is_repeat
    assert repetition.next_after(ended()) == (ended(), None)


def test_run_in_is_counted_up_where_it_is_known():
    run = RunSettings("/runs", conditions=Conditions(temperature_c=20.0, run_in_number=7))
    assert next_run(run).conditions == Conditions(temperature_c=20.0, run_in_number=8)
    assert next_run(RunSettings("/runs")) == RunSettings("/runs")
