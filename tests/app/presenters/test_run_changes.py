"""Changes of runs as values: what was typed, what is said, and the way back; the lines of a library."""

import pytest

from app.presenters.base import Chip, Tone
from app.presenters.runs.changes import Undos, chip_of, undo_of, value_of, words_of
from app.presenters.runs.listed_runs import Library
from app.presenters.runs.overlays import OVERLAID_MOST, overlay_of
from app.presenters.runs.state import Column, Wanted
from app.presenters.runs.tasks import BringBack, CopyIn, EditRuns, Outcome, Trash, UndoEdits
from app.runs.summary import RunSummary

TWO = ("/runs/a.h5", "/runs/b.h5")
EDIT = EditRuns(TWO, "plate_mass_kg", 22.5, "me")


@pytest.mark.parametrize(
    ("field", "text", "value"),
    [("plate_mass_kg", " 22,5 ", 22.5), ("series", "1ffm0 ", "1FFM0"), ("note", " dry ", "dry")],
)
def test_what_is_typed_becomes_a_value(field: str, text: str, value: object) -> None:
    assert value_of(field, text, ("1FFM0",)) == value


@pytest.mark.parametrize(
    ("field", "text", "words"),
    [("series", "9x", "'9x' is not one of this stand: write one like 1FFM0"), ("plate_mass_kg", "0", "'0'")],
)
def test_what_cannot_be_is_refused(field: str, text: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        value_of(field, text, ("1FFM0",))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (EDIT, "Changed the plate mass of 2 runs"),
        (UndoEdits(TWO, "me", "note"), "Undone in 2 runs"),
        (Trash(TWO), "Moved 2 runs to the trash"),
        (BringBack(TWO), "Brought back 2 runs"),
        (CopyIn(TWO, "/runs"), "Copied 2 runs into this folder"),
    ],
)
def test_each_change_is_said(change, words: str) -> None:
    assert words_of(change, Outcome(TWO)) == words


def test_the_way_back_leads_to_where_the_runs_are_now() -> None:
    trashed = ("/runs/.trash/a.h5",)
    undo = undo_of(Trash(TWO), Outcome(trashed, ("b.h5: is locked",)), "me")
    assert undo is not None
    assert undo.task == BringBack(trashed)
    assert undo_of(EDIT, Outcome(TWO), "another").task == UndoEdits(TWO, "another", "plate_mass_kg")  # type: ignore[union-attr]
    assert undo_of(EDIT, Outcome(), "me") is None, "nothing was changed"
    assert undo_of(CopyIn(TWO, "/runs"), Outcome(TWO), "me") is None


def test_the_last_change_is_taken_back_first() -> None:
    undos = Undos()
    assert (undos.words, undos.take_last()) == ("", None)
    for change in (EDIT, Trash(TWO)):
        undos.add(undo_of(change, Outcome(TWO), "me"))
    undos.add(None)
    assert undos.words == "move of 2 runs to the trash"
    assert undos.take_last() == BringBack(TWO)
    assert undos.words == "change of plate mass"
    undos.forget()
    assert undos.words == ""


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
    assert chip_of("Done", done, faults) == chip


def test_a_line_is_made_anew_only_where_its_run_has_changed() -> None:
    library = Library()
    library.take((RunSummary(path="/a.h5"), RunSummary(path="/b.h5")))
    first = library.rows(Wanted(), Column.NAME, descending=False)
    library.take((RunSummary(path="/a.h5"), RunSummary(path="/b.h5", fault="is no run")))
    second = library.rows(Wanted(), Column.NAME, descending=False)
    assert first[0] is second[0]
    assert first[1] != second[1]
    assert library.readable(("/a.h5", "/b.h5")) == ("/a.h5",)
    assert library.fault("/b.h5") == "is no run"


def test_so_many_runs_are_drawn_and_what_cannot_be_read_is_said(tmp_path) -> None:
    paths = tuple(str(tmp_path / f"{number}.h5") for number in range(OVERLAID_MOST + 1))
    drawn = overlay_of(paths)
    assert drawn.traces == ()
    assert drawn.words.count(".h5") >= OVERLAID_MOST
    assert paths[-1] not in drawn.words
    assert drawn.words.endswith("The first 8 of 9 selected runs are drawn")
