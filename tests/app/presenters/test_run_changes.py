"""Changes of runs: input, messages and undo; rows of the library."""

import pytest

from app.presenters.base import Chip, Tone
from app.presenters.runs.changes import (
    Change,
    copy,
    delete,
    edit,
    outcome_chip,
    parse_field,
    restore,
    trash,
)
from app.presenters.runs.state import Column, RunFilter
from app.presenters.runs.table import RunList
from app.presenters.runs.tasks import MAX_OVERLAID_RUNS, load_overlay
from app.runs.summary import RunSummary
from messages.message import message

TWO = ("/runs/a.h5", "/runs/b.h5")
EDIT, TRASH, COPY = edit(TWO, "plate_mass_kg", 22.5, "me"), trash(TWO), copy(TWO, "/runs")


def undo(change: Change, *paths: str) -> Change:
    assert change.undo is not None
    return change.undo(paths)


@pytest.mark.parametrize(
    ("field", "text", "value"),
    [("plate_mass_kg", " 22,5 ", 22.5), ("series", "1ffm0 ", "1FFM0"), ("note", " dry ", "dry")],
)
def test_what_is_typed_becomes_a_value(field: str, text: str, value: object) -> None:
    assert parse_field(field, text, ("1FFM0",)) == value


@pytest.mark.parametrize(
    ("field", "text", "words"),
    [("series", "9x", "'9x' is not one of this stand: write one like 1FFM0"), ("plate_mass_kg", "0", "'0'")],
)
def test_what_cannot_be_is_refused(field: str, text: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        parse_field(field, text, ("1FFM0",))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (EDIT, "Changed the plate mass of 2 runs"),
        (undo(EDIT, *TWO), "Undone in 2 runs"),
        (TRASH, "Moved 2 runs to the trash"),
        (undo(TRASH, *TWO), "Brought back 2 runs"),
        (restore(TWO), "Brought back 2 runs"),
        (undo(restore(TWO), *TWO), "Moved 2 runs to the trash"),
        (delete(TWO), "Deleted 2 runs"),
        (COPY, "Copied 2 runs into this folder"),
    ],
)
def test_each_change_is_said(change: Change, words: str) -> None:
    assert change.text("2 runs") == words


def test_the_way_back_leads_to_where_the_runs_are_now() -> None:
    restore = undo(TRASH, "/runs/.trash/a.h5", "/runs/.trash/b.h5")
    assert restore.paths == ("/runs/.trash/a.h5", "/runs/.trash/b.h5")
    assert restore.undone_text == "move of 2 runs to the trash"
    assert (undo(EDIT, *TWO).paths, undo(EDIT, *TWO).arguments) == (TWO, ("me", ("plate_mass_kg",)))
    assert undo(EDIT, *TWO).undone_text == "change of plate mass"
    assert COPY.undo is delete(TWO).undo is None


@pytest.mark.parametrize("change", [EDIT, TRASH, restore(TWO)])
def test_what_undoes_a_change_is_not_undone_itself(change: Change) -> None:
    assert undo(change, *TWO).undo is None


@pytest.mark.parametrize(
    ("done", "faults", "chip"),
    [
        (TWO, (), Chip("Done", Tone.OK)),
        (TWO, ("c.h5: is locked",), Chip("Done. c.h5: is locked", Tone.BAD)),
        ((), ("c.h5: is locked",), Chip("c.h5: is locked", Tone.BAD)),
        (TWO, ("c", "d"), Chip("Done. 2 runs failed: see details", Tone.BAD)),
    ],
)
def test_what_failed_is_said_with_what_was_done(
    done: tuple[str, ...], faults: tuple[str, ...], chip: Chip
) -> None:
    assert outcome_chip("Done", done, faults) == chip


def test_a_line_is_made_anew_only_where_its_run_has_changed() -> None:
    library = RunList()
    library.set_runs((RunSummary(path="/a.h5"), RunSummary(path="/b.h5")))
    first = library.rows(RunFilter(), Column.NAME, descending=False)
    library.set_runs((RunSummary(path="/a.h5"), RunSummary(path="/b.h5", fault=message("is no run"))))
    second = library.rows(RunFilter(), Column.NAME, descending=False)
    assert first[0] is second[0]
    assert first[1] != second[1]
    assert library.readable(("/a.h5", "/b.h5")) == ("/a.h5",)
    assert str(library.fault("/b.h5")) == "is no run"


def test_so_many_runs_are_drawn_and_what_cannot_be_read_is_said(tmp_path) -> None:
    paths = tuple(str(tmp_path / f"{number}.h5") for number in range(MAX_OVERLAID_RUNS + 1))
    drawn = load_overlay(paths)
    assert drawn.traces == ()
    assert drawn.message.count(".h5") >= MAX_OVERLAID_RUNS
    assert paths[-1] not in drawn.message
    assert drawn.message.endswith("The first 8 of 9 selected runs are drawn")
