"""The Runs presenter: listing, sorting, and results of work on runs."""

import datetime
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace
from stage import Call, FakeWorker

from app.presenters.base import Progress, Tone
from app.presenters.runs.presenter import RunsPresenter
from app.presenters.runs.state import BatchOutcome, Column, Overlay, RunAnalysed, RunFilter, StatusFilter
from app.runs.summary import RunSummary
from messages.message import message


def run(name: str, minute: int, **facts: object) -> RunSummary:
    start = datetime.datetime(2026, 2, 1, 9, minute, tzinfo=datetime.UTC)
    known = {
        "series": "1FFM0",
        "ended": "rest",
        "duration_s": 12.0,
        "operator": "A. Berger",
        "plate_mass_kg": 22.4,
    }
    return RunSummary(path=f"/runs/{name}.h5", start_time=start, **{**known, **facts})  # type: ignore[arg-type]


A = run("a", 1, analyses=1, friction_dynamic=0.10030, friction_dynamic_uncertainty=0.00064, adequate=True)
B = run(
    "b",
    2,
    analyses=1,
    friction_dynamic=0.09,
    friction_dynamic_uncertainty=0.001,
    stale=True,
    note="new plate",
)
C = run("c", 3, series="2SSM1", plate_mass_kg=42.0)
D = run("d", 4, analyses=1, friction_dynamic=0.2, friction_dynamic_uncertainty=0.01, adequate=False)
BAD = RunSummary(path="/runs/bad.h5", fault=message("/runs/bad.h5 is not an HDF5 file. Give a run file"))
ALL = (A, B, C, D, BAD)
LIST = ("list_folder", "/runs", False)


def asked_of(call: Call) -> tuple[Any, ...]:
    """Name and arguments of a call; of a change of runs, its function, the runs and its arguments."""
    if call.name != "change_runs":
        return (call.name, *call.arguments)
    paths, function, arguments, _ = call.arguments
    return (function.name, paths, *arguments)


class Desk:
    """The presenter and its workers, whose calls a test answers."""

    def __init__(self) -> None:
        self.worker, self.analyst = FakeWorker(), FakeWorker()
        self.opened: list[str] = []
        self.runs = RunsPresenter(
            self.worker,  # type: ignore[arg-type]
            self.analyst,  # type: ignore[arg-type]
            "/runs",
            ("1FFM0", "2SSM1"),
            "me",
            self.opened.append,
        )
        self.runs.refresh()
        self.worker.calls[-1].done(ALL)

    @property
    def names(self) -> str:
        return "".join(row.cells[0][0] for row in self.runs.state.rows)

    @property
    def tasks(self) -> list[tuple[Any, ...]]:
        """Names and arguments of the calls since the last look."""
        asked = [asked_of(call) for call in self.worker.calls]
        self.worker.calls.clear()
        return asked

    def answer(self, name: str, answer: object) -> None:
        """Answer the last call of a task."""
        [call for call in self.worker.calls if asked_of(call)[0] == name][-1].done(answer)

    def analysed(self, run: RunSummary, number: int = -1, **facts: Any) -> None:
        self.analyst.calls[number].progress(RunAnalysed(run.path, **facts))
        self.runs.tick()

    def end_analysis(self, number: int = -1) -> None:
        self.analyst.calls[number].done(None)

    def select(self, *runs: RunSummary) -> None:
        self.runs.select(tuple(one.path for one in runs))


@pytest.fixture
def desk() -> Desk:
    made = Desk()
    assert made.tasks == [LIST]
    return made


def test_newest_first_and_what_cannot_be_read_last(desk: Desk) -> None:
    assert desk.names == "dcbab"
    assert desk.runs.state.rows[-1].tone is Tone.BAD
    assert "not an HDF5 file" in desk.runs.state.rows[-1].hint
    columns = dict(zip(Column, desk.runs.state.rows[3].cells, strict=True))
    assert columns[Column.FRICTION] == "0.10030 ± 0.00064"
    assert columns[Column.VERDICT] == "✓ fits"
    assert columns[Column.ENDED] == "at rest"


def test_a_run_that_is_left_out_says_so_and_why(desk: Desk) -> None:
    desk.runs.refresh()
    desk.answer("list_folder", (replace(A, excluded="gauge 2 was touched"),))
    (row,) = desk.runs.state.rows
    assert dict(zip(Column, row.cells, strict=True))[Column.VERDICT] == "✓ fits, left out"
    assert row.hint == "It does not count on Campaign: gauge 2 was touched"


def test_sorting_by_a_column_twice_turns_it_round_and_leaves_the_valueless_last(desk: Desk) -> None:
    desk.runs.sort_by(Column.FRICTION)
    assert desk.names == "badcb"
    desk.runs.sort_by(Column.FRICTION)
    assert desk.names == "dabcb"


@pytest.mark.parametrize(
    ("wanted", "names"),
    [
        (RunFilter(text="new PLATE"), "b"),
        (RunFilter(text="berger"), "dcba"),
        (RunFilter(series="2SSM1"), "c"),
        (RunFilter(status=StatusFilter.STALE), "b"),
        (RunFilter(status=StatusFilter.NOT_ANALYSED), "c"),
        (RunFilter(status=StatusFilter.NOT_FITTING), "d"),
        (RunFilter(status=StatusFilter.FAULTY), "b"),
        (RunFilter(text="nowhere"), ""),
    ],
)
def test_only_what_is_wanted_is_shown(desk: Desk, wanted: RunFilter, names: str) -> None:
    desk.runs.set_filter(wanted)
    assert desk.names == names
    assert desk.runs.state.total == 5
    desk.runs.set_filter(RunFilter())
    assert desk.names == "dcbab"


def test_what_is_no_longer_shown_is_no_longer_selected(desk: Desk) -> None:
    desk.select(A, C)
    desk.runs.set_filter(RunFilter(series="1FFM0"))
    assert desk.runs.state.selected == (A.path,)


def test_selected_runs_are_previewed_and_their_common_facts_shown(desk: Desk) -> None:
    desk.select(A, C)
    (call,) = desk.worker.calls
    assert (call.name, call.arguments) == ("load_overlay", ((A.path, C.path),))
    facts = desk.runs.state.metadata
    assert facts is not None
    assert facts.texts == {"series": "", "plate_mass_kg": "", "operator": "A. Berger", "note": ""}
    assert facts.mixed == {"series", "plate_mass_kg"}
    drawn = Overlay(message="two")
    desk.select(A)
    call.done(Overlay(message="late"))
    assert desk.runs.state.overlay is None, "another selection's picture is not shown"
    desk.select(A, C)
    call.done(drawn)
    assert desk.runs.state.overlay is drawn


def test_a_file_that_cannot_be_read_says_why_and_cannot_be_edited(desk: Desk) -> None:
    desk.select(BAD)
    assert desk.tasks == []
    assert desk.runs.state.metadata is None
    assert desk.runs.state.overlay is not None
    assert "not an HDF5 file" in desk.runs.state.overlay.message


def test_an_edit_can_be_undone(desk: Desk) -> None:
    desk.select(A, B)
    desk.runs.edit("plate_mass_kg", "22,5")
    both = (A.path, B.path)
    call = desk.worker.calls[-1]
    assert asked_of(call) == ("edit", both, "plate_mass_kg", 22.5, "me")
    desk.worker.calls.clear()
    call.done(BatchOutcome(both))
    assert desk.runs.state.message.text == "Changed the plate mass of 2 runs"
    assert desk.runs.state.undo_text == "change of plate mass"
    assert desk.tasks == [LIST]
    desk.runs.undo()
    (undo,) = desk.worker.calls
    assert asked_of(undo) == ("undo_edit", both, "me", ("plate_mass_kg",))
    undo.done(BatchOutcome(both))
    assert desk.runs.state.undo_text == ""


@pytest.mark.parametrize(
    ("field", "text", "said"),
    [
        ("plate_mass_kg", "heavy", "'heavy' is not a number above 0"),
        ("series", "9XXM9", "'9XXM9' is not one of"),
    ],
)
def test_what_cannot_be_is_said_and_the_old_text_comes_back(
    desk: Desk, field: str, text: str, said: str
) -> None:
    desk.select(A)
    before = desk.runs.state.metadata
    desk.runs.edit(field, text)
    assert desk.tasks == [("load_overlay", (A.path,))]
    assert said in desk.runs.state.message.text
    assert desk.runs.state.metadata == before


def test_leaving_a_field_as_it_was_edits_nothing(desk: Desk) -> None:
    desk.select(A)
    desk.runs.edit("operator", "A. Berger")
    assert desk.tasks == [("load_overlay", (A.path,))]


def test_the_trash_gives_back(desk: Desk) -> None:
    desk.select(A)
    desk.runs.trash()
    desk.answer("move_to_trash", BatchOutcome(("/runs/.trash/a.h5",)))
    desk.answer("list_folder", (B, C, D, BAD))
    assert desk.runs.state.selected == ()
    assert desk.names == "dcbb"
    desk.runs.undo()
    assert ("restore_from_trash", ("/runs/.trash/a.h5",)) in desk.tasks


def test_many_are_analysed_by_a_worker_of_their_own_and_faults_do_not_stop_the_rest(desk: Desk) -> None:
    desk.select(A, B, C, D, BAD)
    desk.runs.analyse()
    (call,) = desk.analyst.calls
    paths = (A.path, B.path, C.path, D.path)
    assert (call.name, *call.arguments) == ("analyse_runs", paths, False)
    assert desk.tasks == [("load_overlay", paths)]
    assert desk.runs.state.progress == Progress("Analysing a, 1 of 4", 0.0)
    desk.analysed(A)
    call.progress(Progress("Analysing b, 2 of 4", 0.25))
    desk.runs.tick()
    assert desk.runs.state.progress == Progress("Analysing b, 2 of 4", 0.25)
    desk.analysed(B, fault="b.h5: the record holds no free decay")
    desk.analysed(C, fault="c.h5: its worker failed")
    desk.analysed(D, is_up_to_date=True)
    desk.end_analysis()
    assert desk.runs.state.progress is None
    assert desk.runs.state.message.text == "Analysed a, 1 was up to date. 2 runs failed: see details"
    assert desk.runs.state.details == ("b.h5: the record holds no free decay", "c.h5: its worker failed")
    assert desk.tasks == [LIST]


def test_what_is_up_to_date_is_said_with_the_key_that_analyses_it_anew(desk: Desk) -> None:
    desk.select(A, D)
    desk.runs.analyse()
    desk.analysed(A, is_up_to_date=True)
    desk.analysed(D, is_up_to_date=True)
    desk.end_analysis()
    assert desk.runs.state.message.text == "2 runs were up to date. Shift+R analyses them anew"
    desk.runs.analyse(reanalyse=True)
    assert desk.analyst.calls[-1].arguments == ((A.path, D.path), True)


def test_what_waits_for_an_analysis_is_not_asked_for_twice_and_told_together(desk: Desk) -> None:
    desk.select(A, B)
    desk.runs.analyse()
    desk.select(B, C)
    desk.runs.analyse()
    first, second = desk.analyst.calls
    assert (first.arguments, second.arguments) == (((A.path, B.path), False), ((C.path,), False))
    for run in (A, B):
        desk.analysed(run, 0)
    desk.end_analysis(0)
    assert desk.runs.state.progress is not None
    second.fail("the process died")
    assert desk.runs.state.message.text == "Analysed 2 runs. c.h5: the process died"


def test_other_work_goes_on_beside_an_analysis(desk: Desk) -> None:
    desk.select(A)
    desk.runs.analyse()
    desk.runs.refresh()
    desk.worker.calls[-1].progress(Progress("Looking at new files", 0.5))
    desk.runs.tick()
    assert desk.runs.state.progress == Progress("Analysing a, 1 of 1", 0.0)
    desk.runs.edit("note", "dry")
    desk.answer("edit", BatchOutcome((A.path,)))
    assert desk.runs.state.message.text == "Changed the note of a"
    assert desk.runs.state.progress == Progress("Analysing a, 1 of 1", 0.0)
    desk.runs.cancel()
    assert (desk.analyst.cancelled, desk.worker.cancelled) == (1, 0)


def test_given_up_work_keeps_what_is_done(desk: Desk) -> None:
    desk.select(A, B, C)
    desk.runs.analyse()
    desk.analysed(A)
    desk.runs.cancel()
    assert desk.analyst.cancelled == 1
    assert desk.runs.state.message.text == "Analysed a, then given up"
    assert desk.runs.state.progress is None
    desk.analyst.calls[-1].cancel()
    assert desk.runs.state.message.text == "Analysed a, then given up"
    assert desk.tasks[-1] == LIST


def test_both_workers_end_with_the_screen(desk: Desk) -> None:
    desk.runs.close()
    assert desk.worker.closed
    assert desk.analyst.closed


def test_dropped_runs_are_copied_and_other_files_wait_to_be_imported(desk: Desk) -> None:
    assert not desk.runs.add_files(("/elsewhere/x.H5",))
    assert desk.tasks == [("copy_run_into", ("/elsewhere/x.H5",), Path("/runs"))]
    assert desk.runs.add_files(("/elsewhere/x.csv", "/elsewhere/y.h5"))
    form = desk.runs.import_dialog.state.form
    assert desk.tasks == [
        ("copy_run_into", ("/elsewhere/y.h5",), Path("/runs")),
        ("survey_file", "/elsewhere/x.csv", form),
    ]


def test_a_first_look_tells_how_far_it_is(desk: Desk) -> None:
    desk.runs.refresh()
    desk.worker.calls[-1].progress(Progress("Looking at new files", 0.25))
    desk.runs.tick()
    assert desk.runs.state.progress == Progress("Looking at new files", 0.25)


def test_a_folder_that_is_gone_is_said(desk: Desk) -> None:
    desk.runs.choose_folder("/gone")
    assert not desk.runs.state.is_listed
    desk.worker.calls[-1].fail("/gone: there is no such folder")
    assert desk.runs.state.is_listed
    assert "no such folder" in desk.runs.state.message.text


def test_opening_shows_the_first_selected(desk: Desk) -> None:
    desk.select(B, A)
    desk.runs.open_selected()
    assert desk.opened == [B.path]


def test_the_trash_is_shown_and_runs_come_back_from_it(desk: Desk) -> None:
    desk.select(A)
    desk.runs.show_trash(True)
    assert (desk.runs.state.rows, desk.runs.state.is_listed, desk.runs.state.selected) == ((), False, ())
    gone = replace(A, path="/runs/.trash/a.h5")
    desk.answer("list_folder", (gone,))
    assert desk.tasks[-1] == ("list_folder", "/runs", True)
    desk.select(gone)
    assert desk.runs.state.metadata is None, "nothing is edited in the trash"
    desk.runs.trash()
    desk.runs.analyse(reanalyse=True)
    assert not desk.runs.open_export()
    assert desk.analyst.calls == []
    desk.runs.restore()
    desk.answer("restore_from_trash", BatchOutcome(("/runs/a.h5",)))
    assert desk.runs.state.message.text == "Brought back a"
    assert desk.runs.state.undo_text == "return of a from the trash"
    desk.runs.undo()
    assert desk.tasks[-1] == ("move_to_trash", ("/runs/a.h5",))


def test_emptying_the_trash_deletes_all_of_it_whatever_is_filtered(desk: Desk) -> None:
    desk.runs.empty_trash()
    assert desk.tasks == [], "only while it is shown"
    desk.runs.show_trash(True)
    desk.answer("list_folder", (replace(A, path="/runs/.trash/a.h5"), replace(C, path="/runs/.trash/c.h5")))
    desk.runs.set_filter(RunFilter(series="2SSM1"))
    desk.runs.empty_trash()
    assert desk.tasks[-1] == ("delete_from_trash", ("/runs/.trash/a.h5", "/runs/.trash/c.h5"))


def test_a_listing_of_another_place_than_the_one_shown_is_dropped(desk: Desk) -> None:
    desk.runs.refresh()
    desk.runs.show_trash(True)
    desk.answer("list_folder", ALL)
    assert (desk.runs.state.rows, desk.runs.state.is_listed) == ((), False)
    assert desk.tasks[-1] == ("list_folder", "/runs", True)
    desk.runs.show_trash(False)
    desk.runs.choose_folder("/elsewhere")
    assert desk.runs.state.folder == "/elsewhere"
