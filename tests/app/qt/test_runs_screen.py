"""The Runs screen: table, preview and facts follow the state; keys and clicks reach the presenter."""

import datetime
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from looking import clipped_words, plain, visible_words
from msgspec.structs import replace
from pointing import Hand
from PySide6.QtCore import QDir, QItemSelectionModel, QMimeData, QPointF, Qt, QUrl
from PySide6.QtGui import QDropEvent, QGuiApplication, QTextDocument
from PySide6.QtWidgets import QApplication, QFileDialog, QLineEdit, QMessageBox, QPushButton
from pytestqt.qtbot import QtBot
from stage import Call, FakeWorker

from app.presenters.runs.presenter import RunsPresenter
from app.presenters.runs.state import USUAL_COLUMNS, BatchOutcome, Column, Overlay, Trace
from app.qt.runs.export_dialog import ExportDialog
from app.qt.runs.screen import RunsScreen
from app.qt.theme import Theme
from app.qt.widgets.tables import shown_columns
from app.runs.metadata import Conditions, RunSource
from app.runs.summary import RunSummary
from messages.i18n import gettext

RUNS = tuple(
    RunSummary(
        path=f"/runs/20260201_{series}_{number:03d}.h5", series=series, ended="rest", operator="A. Berger"
    )
    for series in ("1FFM0", "2SSM1")
    for number in (1, 2, 3)
)


def trace(name: str, shift_mm: float = 0.0) -> Trace:
    time_s = np.linspace(-1.0, 9.0, 500)
    return Trace(name, time_s, 12.0 * np.cos(20.0 * time_s) + shift_mm, np.full(500, -10.0))


class Stage:
    """Screen and presenter, shown, with a worker whose work the test does."""

    def __init__(self, theme: Theme, qtbot: QtBot) -> None:
        self.qtbot = qtbot
        self.worker, self.analyst = FakeWorker(), FakeWorker()
        self.opened: list[str] = []
        self.asked = self.imports = 0
        self.presenter = RunsPresenter(
            self.worker,  # type: ignore[arg-type]
            self.analyst,  # type: ignore[arg-type]
            "/runs",
            ("1FFM0", "2SSM1"),
            "me",
            self.opened.append,
        )
        self.screen = RunsScreen(theme, self.presenter, self)
        qtbot.addWidget(self.screen)
        self.screen.resize(1188, 800)
        self.presenter.attach(self.screen)
        self.screen.show()
        qtbot.waitExposed(self.screen)
        self.table = self.screen._table

    def ask_for_export(self) -> None:
        self.asked += 1

    def show_import(self) -> None:
        self.imports += 1

    def ask_for_run(self) -> None:
        raise NotImplementedError

    def list_runs(self) -> None:
        self.presenter.refresh()
        self.answer("list_folder", RUNS)

    def answer(self, name: str, answer: object) -> None:
        """Answer the last call of a task."""
        self.calls(name)[-1].done(answer)
        self.presenter.tick()

    def calls(self, name: str) -> list[Call]:
        return [call for call in self.worker.calls if call.name == name]

    def click_row(self, number: int, modifier: Qt.KeyboardModifier = Qt.KeyboardModifier.NoModifier) -> None:
        place = self.table.visualRect(self.table.model().index(number, 0)).center()
        self.qtbot.mouseClick(self.table.viewport(), Qt.MouseButton.LeftButton, modifier, place)

    def button(self, text: str) -> QPushButton:
        (found,) = [b for b in self.screen.findChildren(QPushButton) if b.text() == text]
        return found

    def field(self, name: str) -> QLineEdit:
        (found,) = [f for f in self.screen.findChildren(QLineEdit) if f.accessibleName() == name]
        return found


@pytest.fixture
def stage(theme: Theme, qtbot: QtBot) -> Stage:
    return Stage(theme, qtbot)


def test_an_empty_library_says_how_to_fill_it(stage: Stage) -> None:
    assert "Looking into the folder" in visible_words(stage.screen)
    stage.presenter.refresh()
    stage.answer("list_folder", ())
    assert "There are no runs in /runs yet. Record a pullback" in visible_words(stage.screen)


def test_searching_leaves_what_fits_and_says_how_many(stage: Stage) -> None:
    stage.list_runs()
    stage.qtbot.keyClicks(stage.field("Search"), "2ssm1")
    assert stage.table.model().rowCount() == 3
    assert "3 of 6 runs" in visible_words(stage.screen)
    stage.qtbot.keyClicks(stage.field("Search"), "nothing")
    assert "No run is like that" in visible_words(stage.screen)


def test_a_click_on_a_title_sorts(stage: Stage) -> None:
    stage.list_runs()
    titles = stage.table.horizontalHeader()
    place = QPointF(titles.sectionViewportPosition(0) + 10, titles.height() / 2).toPoint()
    first = stage.presenter.state.rows[0]
    stage.qtbot.mouseClick(titles.viewport(), Qt.MouseButton.LeftButton, pos=place)
    stage.qtbot.mouseClick(titles.viewport(), Qt.MouseButton.LeftButton, pos=place)
    assert stage.presenter.state.rows[0].path == RUNS[-1].path != first.path


MEASURED = RunSummary(
    path="/runs/20260201T142611_3SSLM3_003.h5",
    series="3SSLM3",
    start_time=datetime.datetime(2026, 2, 1, 14, 26, 11, tzinfo=datetime.UTC),
    source=RunSource.SIMULATED,
    conditions=Conditions(temperature_c=21.46),
    analyses=1,
    adequate=True,
    friction_dynamic=-0.10030,
    friction_dynamic_uncertainty=0.00064,
    period_s=0.319942,
    period_uncertainty_s=4.8e-6,
    damping_n1_per_s=0.12104,
    damping_n1_uncertainty_per_s=0.000042,
    note="a note that is longer than its column",
)


def list_measured(stage: Stage) -> None:
    stage.presenter.refresh()
    stage.answer("list_folder", (MEASURED, *(replace(MEASURED, path=f"/runs/{n}.h5") for n in range(60))))
    QApplication.processEvents()


def column_of(column: Column) -> int:
    return list(Column).index(column)


def test_a_run_says_its_time_and_series_once_and_what_was_found_where_from_and_how_warm(
    stage: Stage,
) -> None:
    list_measured(stage)
    header, model = stage.table.horizontalHeader(), stage.table.model()
    assert shown_columns(header) == tuple(column.name for column in USUAL_COLUMNS)
    row = stage.presenter.state.rows[0]
    cells = dict(zip(Column, row.cells, strict=True))
    assert [cells[column] for column in USUAL_COLUMNS[1:-1]] == [
        "3SSLM3", "003", "−0.10030 ± 0.00064", "319.9420", "0.121040", "✓ fits", "simulated", "21.5",
    ]  # fmt: skip
    assert cells[Column.DATE].startswith("2026-02-0")
    assert cells[Column.FILE] == "20260201T142611_3SSLM3_003"
    assert dict(zip(Column, stage.presenter.state.rows[1].cells, strict=True))[Column.NAME] == "0"
    hint = model.index(0, column_of(Column.PERIOD)).data(Qt.ItemDataRole.ToolTipRole)
    assert hint == "319.9420 ± 0.0048\u202fms"


@pytest.mark.parametrize("language", ["en", "ru", "uz"])
def test_a_window_of_1280_shows_the_usual_columns_without_scrolling_sideways(
    theme: Theme, qtbot: QtBot, language: str, use_language: Callable[[str], None]
) -> None:
    use_language(language)
    stage = Stage(theme, qtbot)
    stage.screen.resize(1280 - 90, 780)
    list_measured(stage)
    table = stage.table
    assert table.horizontalScrollBar().maximum() == 0
    assert table.verticalScrollBar().maximum() > 0
    for column in USUAL_COLUMNS[:-1]:
        number = column_of(column)
        assert table.columnWidth(number) >= table.sizeHintForIndex(table.model().index(0, number)).width(), (
            column
        )
        title = table.horizontalHeader().fontMetrics().horizontalAdvance(gettext(column.value))
        assert table.columnWidth(number) >= title + 16, column
    assert table.columnWidth(column_of(Column.NOTE)) >= 44


def test_rows_are_copied_with_uncertainties_in_columns_of_their_own(stage: Stage) -> None:
    list_measured(stage)
    stage.click_row(0)
    stage.screen.activateWindow()
    stage.qtbot.keyClick(stage.table, Qt.Key.Key_C, Qt.KeyboardModifier.ControlModifier)
    titles, row = (line.split("\t") for line in QGuiApplication.clipboard().text().splitlines())
    assert dict(zip(titles, row, strict=True)) == {
        "Recorded": stage.presenter.state.rows[0].cells[column_of(Column.DATE)],
        "Series": "3SSLM3",
        "Run": "003",
        "f_d": "-0.10030",
        "u(f_d)": "0.00064",
        "T, ms": "319.9420",
        "u(T), ms": "0.0048",
        "n1, 1/s": "0.121040",
        "u(n1), 1/s": "0.000042",
        "Model": "✓ fits",
        "Source": "simulated",
        "°C": "21.5",
        "Note": "a note that is longer than its column",
    }


def test_the_new_columns_sort(stage: Stage) -> None:
    stage.presenter.refresh()
    other = replace(MEASURED, path="/runs/b.h5", period_s=0.2, source=RunSource.REAL, conditions=Conditions())
    stage.answer("list_folder", (MEASURED, other))
    for column in (Column.PERIOD, Column.SOURCE):
        stage.presenter.sort_by(column)
        assert [row.path for row in stage.presenter.state.rows] == [other.path, MEASURED.path]
    stage.presenter.sort_by(Column.TEMPERATURE)
    assert stage.presenter.state.rows[0].path == MEASURED.path, "what has no value comes last"


def test_titles_stand_over_their_figures(stage: Stage) -> None:
    model = stage.table.model()
    for number, column in enumerate(Column):
        side = model.headerData(number, Qt.Orientation.Horizontal, Qt.ItemDataRole.TextAlignmentRole)
        is_right = side is not None and bool(side & Qt.AlignmentFlag.AlignRight)
        figures = {Column.FRICTION, Column.PERIOD, Column.DAMPING, Column.DURATION, Column.TEMPERATURE}
        assert is_right == (column in figures)


def test_no_dash_of_the_legend_is_parted_from_its_name(stage: Stage) -> None:
    preview = stage.screen._preview
    preview.show_overlay(Overlay((trace("one"), trace("two"), trace("three")), "time, s"))
    text = QTextDocument()
    text.setHtml(preview._names.text())
    text.setTextWidth(text.idealWidth() / 2.0)
    text.documentLayout().documentSize()  # lays it out
    block = text.firstBlock()
    lines = [block.layout().lineAt(number) for number in range(block.layout().lineCount())]
    starts = [block.text()[line.textStart() : line.textStart() + line.textLength()] for line in lines]
    assert [start.replace("\u00a0", " ").strip() for start in starts] == [
        "——— one",
        "− − − two",
        "· · · three",
    ]


def test_readings_are_drawn_in_the_unit_that_they_have(stage: Stage) -> None:
    preview = stage.screen._preview
    for unit in ("mm", "V"):
        preview.show_overlay(Overlay((trace("one"),), "time, s", unit=unit))
        assert all(plain(plot.title.text).endswith(f", {unit}") for plot in preview._stack.plots)


def test_selected_runs_are_drawn_over_one_another(stage: Stage) -> None:
    stage.list_runs()
    stage.click_row(0)
    stage.click_row(2, Qt.KeyboardModifier.ControlModifier)
    paths = stage.presenter.state.selected
    assert len(paths) == 2
    stage.answer("load_overlay", Overlay((trace("one"), trace("two", 1.0)), "time from release, s"))
    drawn = [curve for curve in stage.screen._preview._curves[0] if len(curve.samples()[0])]
    assert len(drawn) == 2
    assert "one" in visible_words(stage.screen)


def test_the_selection_survives_a_new_listing(stage: Stage) -> None:
    stage.list_runs()
    stage.click_row(1)
    path = stage.presenter.state.selected
    stage.list_runs()
    assert stage.presenter.state.selected == path
    assert [index.row() for index in stage.table.selectionModel().selectedRows()] == [1]


def test_keys_in_the_table_open_analyse_and_put_aside(stage: Stage) -> None:
    stage.list_runs()
    stage.click_row(0)
    (path,) = stage.presenter.state.selected
    for key in (Qt.Key.Key_Return, Qt.Key.Key_Delete):
        stage.qtbot.keyClick(stage.table, key)
    assert stage.opened == [path]
    assert stage.calls("change_runs")[-1].arguments[0] == (path,)
    stage.qtbot.keyClick(stage.screen, Qt.Key.Key_E, Qt.KeyboardModifier.ControlModifier)
    assert stage.asked == 1


def test_runs_are_analysed_by_key_and_anew_with_shift_and_shown_beside_other_work(stage: Stage) -> None:
    stage.list_runs()
    stage.click_row(0)
    (path,) = stage.presenter.state.selected
    stage.qtbot.keyClick(stage.table, Qt.Key.Key_R)
    assert [call.arguments for call in stage.analyst.calls] == [((path,), False)]
    stage.presenter.cancel()
    stage.qtbot.keyClick(stage.table, Qt.Key.Key_R, Qt.KeyboardModifier.ShiftModifier)
    assert stage.analyst.calls[-1].arguments == ((path,), True)
    assert stage.button("Cancel").isVisible()
    stage.presenter.trash()
    stage.answer("change_runs", BatchOutcome((path,)))
    said = visible_words(stage.screen)
    assert f"Analysing {Path(path).stem}, 1 of 1. Moved {Path(path).stem} to the trash" in said


@pytest.mark.parametrize("key", [Qt.Key.Key_Up, Qt.Key.Key_Down])
def test_an_arrow_selects_the_only_run(stage: Stage, key: Qt.Key) -> None:
    stage.presenter.refresh()
    stage.answer("list_folder", RUNS[:1])
    stage.table.setFocus()
    stage.qtbot.keyClick(stage.table, key)
    assert stage.presenter.state.selected == (RUNS[0].path,)


def test_a_note_is_kept_on_enter_and_undone_with_a_key(stage: Stage) -> None:
    stage.list_runs()
    stage.click_row(0)
    stage.field("Note").setFocus()
    stage.qtbot.keyClicks(stage.field("Note"), "dry")
    stage.qtbot.keyClick(stage.field("Note"), Qt.Key.Key_Return)
    (edit,) = stage.calls("change_runs")
    assert edit.arguments[0] == stage.presenter.state.selected
    assert edit.arguments[2] == ("note", "dry", "me")
    assert not stage.button("Undo").isEnabled()
    edit.done(BatchOutcome(edit.arguments[0]))
    assert stage.button("Undo").isEnabled()
    assert "change of note" in stage.button("Undo").toolTip()


def test_faults_of_many_are_folded_away(stage: Stage) -> None:
    stage.list_runs()
    stage.click_row(0)
    stage.presenter.trash()
    stage.answer("change_runs", BatchOutcome((), ("a.h5: no right to move it", "b.h5: it is being recorded")))
    assert "no right" not in visible_words(stage.screen)
    stage.qtbot.mouseClick(stage.button("Details"), Qt.MouseButton.LeftButton)
    assert "b.h5: it is being recorded" in visible_words(stage.screen)


def test_dropped_files_reach_the_presenter_as_the_system_writes_them(
    stage: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(QDir, "toNativeSeparators", lambda path: path.replace("/", "\\"))
    content = QMimeData()
    content.setUrls([QUrl.fromLocalFile("/elsewhere/x.h5")])
    drop = QDropEvent(
        QPointF(10, 10),
        Qt.DropAction.CopyAction,
        content,
        Qt.MouseButton.LeftButton,
        Qt.KeyboardModifier.NoModifier,
    )
    stage.screen.dropEvent(drop)
    (copy,) = stage.calls("change_runs")
    assert [path[-14:] for path in copy.arguments[0]] == ["elsewhere\\x.h5"]


def test_the_export_dialog_shows_what_will_be_written(stage: Stage) -> None:
    stage.list_runs()
    stage.table.selectAll()
    assert stage.presenter.open_export()
    dialog = ExportDialog(stage.presenter.export_dialog, stage.screen)
    stage.qtbot.addWidget(dialog)
    stage.presenter.export_dialog.attach(dialog)
    dialog.show()
    assert "Export 6 runs" in visible_words(dialog)
    stage.presenter.export_dialog.set_format("uff58")
    preview = stage.calls("preview_export")[-1]
    assert preview.arguments == (RUNS[0].path, {"format": "uff58", "content": "samples"})
    preview.done("a.uff, 12 kB")
    assert dialog._preview.toPlainText() == "a.uff, 12 kB"
    stage.qtbot.mouseClick(dialog._export, Qt.MouseButton.LeftButton)
    assert not dialog._export.isEnabled()
    stage.answer("export_files", BatchOutcome((), ("x.h5: the disk is full",)))
    assert "Nothing was written" in visible_words(dialog)
    assert "the disk is full" in visible_words(dialog)
    assert clipped_words(dialog) == []


@pytest.mark.parametrize("size", [(932, 640), (1188, 800), (1828, 1080)], ids=lambda size: f"{size[0]}")
def test_no_word_is_cut_off(stage: Stage, size: tuple[int, int]) -> None:
    stage.screen.resize(*size)
    stage.list_runs()
    stage.table.selectionModel().select(
        stage.table.model().index(0, 0),
        QItemSelectionModel.SelectionFlag.ClearAndSelect | QItemSelectionModel.SelectionFlag.Rows,
    )
    stage.answer("load_overlay", Overlay((trace("one"),), "time from release, s"))
    QApplication.processEvents()
    assert clipped_words(stage.screen) == []


def test_files_of_other_programs_are_chosen_and_open_the_import_dialog(stage: Stage) -> None:
    stage.qtbot.mouseClick(stage.button("Import…"), Qt.MouseButton.LeftButton)
    dialog = stage.screen.findChild(QFileDialog)
    assert dialog is not None
    dialog.filesSelected.emit(["/elsewhere/x.csv"])
    dialog.close()
    assert stage.imports == 1
    assert Path(stage.calls("survey_file")[-1].arguments[0]) == Path("/elsewhere/x.csv")


def decimated(name: str, start_s: float, end_s: float, spans: int) -> Trace:
    """A trace of lowest and highest readings, as of a long run."""
    time_s = np.repeat(np.linspace(start_s, end_s, spans), 2)
    return Trace(name, time_s, np.tile([-10.0, 10.0], spans), None, f"/runs/{name}.h5")


def test_the_part_of_a_long_run_in_view_is_read_more_finely(stage: Stage) -> None:
    stage.list_runs()
    stage.click_row(0)
    (path,) = stage.presenter.state.selected
    name = Path(path).stem
    stage.answer("load_overlay", Overlay((decimated(name, 0.0, 3600.0, 1500),), "time from release, s"))
    QApplication.processEvents()
    stack = stage.screen._preview._stack
    hand = Hand(stack)
    for _ in range(3):
        hand.wheel(5, hand.place(0.5, 0.5))
    start_s, end_s = zoomed = stack.time_range()
    first, *_ = stage.calls("load_part")
    assert len(stage.calls("load_part")) == 1, "one is read at a time"
    first.done((decimated(name, *first.arguments[1], 900),))
    last = stage.calls("load_part")[-1]
    assert last.arguments == ((path,), pytest.approx(zoomed), int(stack.plots[0].view.width()))
    last.done((decimated(name, start_s, end_s, 900),))
    time_s, _ = stage.screen._preview._curves[0][0].samples()
    assert np.count_nonzero((time_s >= start_s) & (time_s <= end_s)) == pytest.approx(1800, abs=4)
    assert (time_s[0], time_s[-1]) == (0.0, 3600.0)
    assert (np.diff(time_s) >= 0.0).all()
    assert stack.time_range() == zoomed
    hand.double_click(hand.place(0.5, 0.5))
    assert stack.time_range() == (0.0, 3600.0)


def test_a_run_that_is_drawn_whole_is_not_read_again_and_another_is_shown_whole(stage: Stage) -> None:
    stage.list_runs()
    stage.click_row(0)
    stage.answer("load_overlay", Overlay((trace("one"),), "time from release, s"))
    QApplication.processEvents()
    stack = stage.screen._preview._stack
    hand = Hand(stack)
    hand.wheel(5, hand.place(0.5, 0.5))
    assert stage.calls("load_part") == []
    stage.click_row(1)
    stage.answer("load_overlay", Overlay((trace("two"),), "time from release, s"))
    assert stack.time_range() == (-1.0, 9.0)


def test_a_picture_of_the_preview_has_the_names_of_the_runs(stage: Stage) -> None:
    stage.list_runs()
    stage.click_row(0)
    stage.answer("load_overlay", Overlay((trace("one"), trace("two")), "time from release, s"))
    QApplication.processEvents()
    preview = stage.screen._preview
    assert preview._stack.pictured is preview
    assert preview._stack.export_name == "2 runs"
    titles = [curve.title for curve in preview._stack.curves_in_view()]
    assert titles == [
        "one, table displacement, mm",
        "two, table displacement, mm",
        "one, relative displacement, mm",
        "two, relative displacement, mm",
    ]


def test_the_trash_is_emptied_after_a_question_alone(stage: Stage) -> None:
    stage.list_runs()
    assert not stage.button("Restore").isVisible()
    stage.qtbot.keyClick(stage.table, Qt.Key.Key_T, Qt.KeyboardModifier.ControlModifier)
    stage.answer("list_folder", ())
    assert "The trash of /runs is empty." in visible_words(stage.screen)
    assert not stage.button("Empty trash…").isEnabled()
    stage.list_runs()
    stage.click_row(0)
    stage.qtbot.keyClick(stage.table, Qt.Key.Key_Insert)
    assert [call.arguments[1].name for call in stage.calls("change_runs")] == ["restore_from_trash"]
    for answer, names in (("Cancel", []), ("Delete 6 runs", ["delete_from_trash"])):
        stage.worker.calls.clear()
        stage.qtbot.keyClick(stage.button("Empty trash…"), Qt.Key.Key_Space)
        box = stage.screen.findChildren(QMessageBox)[-1]
        assert box.text() == "Delete 6 runs for ever?"
        assert "/runs" in box.informativeText()
        assert box.defaultButton().text() == box.escapeButton().text() == "Cancel"
        (button,) = [button for button in box.buttons() if button.text() == answer]
        stage.qtbot.keyClick(button, Qt.Key.Key_Space)
        assert not box.isVisible()
        assert [call.arguments[1].name for call in stage.calls("change_runs")] == names


@pytest.mark.parametrize("size", [(932, 600), (1188, 760)], ids=lambda size: f"{size[0]}")
def test_no_word_of_the_trash_is_cut_off(stage: Stage, size: tuple[int, int]) -> None:
    stage.screen.resize(*size)
    stage.presenter.show_trash(True)
    stage.list_runs()
    QApplication.processEvents()
    assert clipped_words(stage.screen) == []
