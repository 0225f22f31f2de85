"""The plan of a folder is stored in it; finished tests are counted from the runs."""

from pathlib import Path

import pytest

from app.runs.errors import MetadataError, RunError
from app.runs.metadata import Conditions
from app.runs.next_tests import (
    FILE_NAME,
    NextTests,
    PlannedSeries,
    counts_as_done,
    load_next_tests,
    save_next_tests,
)
from app.runs.summary import RunSummary
from messages.message import message

KEPT = NextTests(
    plan=(PlannedSeries("1FFM0", 3), PlannedSeries("2SSM1", 1)),
    series="2SSM1",
    operator="Ada Weiß",
    conditions=Conditions(21.5, 48.0, "P-1", "C-7", "acetone", 3, {"weather": "dry"}),
)


def test_what_is_kept_is_there_again(tmp_path: Path) -> None:
    folder = tmp_path / "new"
    assert load_next_tests(folder) == NextTests()
    save_next_tests(folder, KEPT)
    save_next_tests(folder, KEPT)
    assert load_next_tests(folder) == KEPT
    assert [path.name for path in folder.iterdir()] == [FILE_NAME]


@pytest.mark.parametrize(
    "text",
    ["{", '{"plan": [{"series": "1FFM0", "repeats": 0}]}', '{"conditions": {"humidity_percent": 400}}'],
)
def test_a_file_that_holds_something_else_is_named(tmp_path: Path, text: str) -> None:
    (tmp_path / FILE_NAME).write_text(text)
    with pytest.raises(MetadataError, match=r"next-tests\.json: cannot be used .*Mend it"):
        load_next_tests(tmp_path)


def test_a_folder_that_cannot_be_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RunError, match="file"):
        save_next_tests(tmp_path / "file" / "folder", KEPT)


@pytest.mark.parametrize(
    ("run", "done"),
    [
        (RunSummary("a.h5", ended="rest"), True),
        (RunSummary("a.h5", ended="stopped", analyses=1), True),
        (RunSummary("a.h5", ended="stopped"), False),
        (RunSummary("a.h5", ended="device-lost"), False),
        (RunSummary("a.h5", fault=message("being recorded"), ended="rest"), False),
    ],
)
def test_a_run_is_done_that_ended_by_itself_or_was_analysed(run: RunSummary, done: bool) -> None:
    assert counts_as_done(run) is done


def test_a_run_that_waits_for_a_decision_does_not_count_by_its_end_alone() -> None:
    run = RunSummary("/runs/a.h5", ended="rest")
    assert not counts_as_done(run, ("a.h5",))
    assert counts_as_done(run, ("b.h5",))
    assert counts_as_done(RunSummary("/runs/a.h5", ended="rest", analyses=1), ("a.h5",)), "analysed on Runs"
