"""The series plan: what is written, what it comes to, which run comes next."""

import pytest

from app.presenters.record.next_runs import (
    format_plan,
    next_series,
    parse_plan,
    plan_progress,
    plan_with_added,
    plan_with_moved,
    plan_with_repeats,
    plan_without,
    run_text,
)
from app.runs.next_tests import PlannedSeries
from config.files import published_table

ALL = tuple(published_table())


def test_a_plan_is_read_in_the_order_written() -> None:
    plan = parse_plan("2SSM1 x5, 1ffm0; 1FFM3 × 2", ALL)
    assert plan == (PlannedSeries("2SSM1", 5), PlannedSeries("1FFM0", 3), PlannedSeries("1FFM3", 2))
    assert parse_plan(format_plan(plan), ALL) == plan
    assert parse_plan("  ", ALL) == ()


def test_a_star_stands_for_every_series_it_fits() -> None:
    assert [one.series for one in parse_plan("1FF*", ALL)] == ["1FFM0", "1FFM1", "1FFM2", "1FFM3"]
    assert len(parse_plan("* x3", ALL)) == 36
    first, *rest = parse_plan("2SSM0 x6, * x2", ALL)
    assert (first.repeats, {one.repeats for one in rest}, len(rest)) == (6, {2}, 35)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("9FFM0 x3", "9FFM0 is no series of this stand"),
        ("1FFM0 x0", "repeat a series 1 to 999 times"),
        ("1FFM0 three times", "is no part of a plan"),
        ("1FFM0 x2, 1FFM0 x3", "1FFM0 is planned twice"),
    ],
)
def test_what_is_no_plan_is_said(text: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        parse_plan(text, ALL)


def test_a_plan_is_edited_row_by_row() -> None:
    progress = plan_progress(parse_plan("1FFM0 x3, 1FFM1 x10, 1FFM2 x2", ALL), {})
    assert plan_with_repeats(progress, 1, " 4 ") == "1FFM0 x3, 1FFM1 x4, 1FFM2 x2"
    assert plan_with_moved(progress, 2, -2) == "1FFM2 x2, 1FFM0 x3, 1FFM1 x10"
    assert plan_with_moved(progress, 0, 1) == "1FFM1 x10, 1FFM0 x3, 1FFM2 x2"
    assert plan_without(progress, {0, 2}) == "1FFM1 x10"
    assert plan_with_added(progress, "2SS*") == "1FFM0 x3, 1FFM1 x10, 1FFM2 x2, 2SS*"
    assert plan_with_added((), " 2SSM0 ") == "2SSM0"


def test_dots_tell_what_is_done_and_figures_where_there_are_many() -> None:
    plan = parse_plan("1FFM0 x3, 1FFM1 x10, 1FFM2 x2", ALL)
    progress = plan_progress(plan, {"1FFM0": 2, "1FFM1": 4, "1FFM2": 5, "3SSM0": 9})
    assert [one.dots for one in progress] == ["●●○", "4/10", "●●"]
    assert progress[0].description == "1FFM0: 2 of 3 runs are there"


def test_the_next_series_is_the_next_that_is_not_full() -> None:
    plan = parse_plan("1FFM0 x1, 1FFM1 x2, 1FFM2 x1", ALL)
    assert next_series(plan_progress(plan, {}), "1FFM1") == "1FFM1"
    assert next_series(plan_progress(plan, {"1FFM1": 2}), "1FFM1") == "1FFM2"
    assert next_series(plan_progress(plan, {"1FFM1": 2, "1FFM2": 1}), "1FFM1") == "1FFM0"
    full = plan_progress(plan, {"1FFM0": 1, "1FFM1": 2, "1FFM2": 1})
    assert next_series(full, "1FFM2") == "1FFM2"
    assert next_series(plan_progress(plan, {"1FFM0": 1}), "3SSM0") == "1FFM1"
    assert next_series((), "3SSM0") == "3SSM0"


def test_a_run_is_numbered_in_its_series() -> None:
    progress = plan_progress(parse_plan("1FFM0 x3", ALL), {})
    assert run_text(progress, "1FFM0", 1) == "1FFM0 run 2 of 3"
    assert run_text(progress, "1FFM0", 3) == "1FFM0 full: 3 of 3"
    assert run_text(progress, "2SSM0", 4) == "2SSM0 run 5"
