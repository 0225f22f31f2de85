"""Export of the run on Identify: report as a file or on paper, samples, and its folder."""

import re
from pathlib import Path

import pytest
from looking import clipped_words
from PySide6.QtCore import QBuffer, QDir, Qt
from PySide6.QtGui import QDesktopServices, QImage
from PySide6.QtPrintSupport import QPrintDialog, QPrinter
from PySide6.QtWidgets import QFileDialog
from pytestqt.qtbot import QtBot
from stage import RUN, analysed
from test_identify_screen import Stage

from app.qt.printing import print_pages
from app.qt.theme import Theme


@pytest.fixture
def stage(theme: Theme, qtbot: QtBot) -> Stage:
    """Identify with a run."""
    made = Stage(theme, qtbot)
    made.presenter.on_opening(RUN)
    made.presenter.on_analysed(analysed())
    made.screen.activateWindow()
    qtbot.waitUntil(made.screen.isActiveWindow)
    return made


def chosen(stage: Stage, text: str) -> None:
    """Choose an entry of the menu Export."""
    (action,) = [action for action in stage.button("Export…").menu().actions() if action.text() == text]
    action.trigger()


def test_the_report_of_a_run_is_written_where_its_operator_says(stage: Stage, tmp_path: Path) -> None:
    chosen(stage, "Report as PDF…")
    dialog = stage.screen.findChild(QFileDialog)
    assert dialog is not None
    dialog.fileSelected.emit(str(tmp_path / "report.pdf"))
    dialog.close()
    (call,) = stage.reports.calls
    assert (call.name, call.arguments) == ("write_run_report", (RUN, str(tmp_path / "report.pdf")))
    assert not stage.button("Export…").isEnabled()
    call.done(str(tmp_path / "report.pdf"))
    assert f"✓ Wrote {tmp_path / 'report.pdf'}" in stage.words()
    assert stage.button("Export…").isEnabled()
    assert clipped_words(stage.screen) == []


def test_a_report_is_offered_in_the_folder_of_its_run(
    stage: Stage, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    selected: list[str] = []
    monkeypatch.setattr(QFileDialog, "selectFile", lambda _dialog, name: selected.append(name))
    monkeypatch.setattr(type(stage.presenter.report), "proposed_target", str(tmp_path / "run.pdf"))
    chosen(stage, "Report as PDF…")
    dialog = stage.screen.findChild(QFileDialog)
    assert dialog is not None
    assert selected == ["run.pdf"]
    assert Path(dialog.directory().path()) == tmp_path
    dialog.close()


def test_a_path_that_is_chosen_is_written_as_the_system_writes_it(
    stage: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(QDir, "toNativeSeparators", lambda path: path.replace("/", "\\"))
    chosen(stage, "Report as PDF…")
    dialog = stage.screen.findChild(QFileDialog)
    assert dialog is not None
    dialog.fileSelected.emit("C:/tests/report.pdf")
    dialog.close()
    assert stage.reports.calls[-1].arguments == (RUN, "C:\\tests\\report.pdf")


def test_the_folders_of_a_report_and_of_a_run_are_opened(
    stage: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[str] = []
    monkeypatch.setattr(QDesktopServices, "openUrl", lambda url: opened.append(url.toLocalFile()))
    chosen(stage, "Open folder")
    stage.presenter.report.write("/tables/report.pdf")
    stage.reports.calls[-1].done("/tables/report.pdf")
    stage.button("Open folder").click()
    assert [Path(path) for path in opened] == [Path(RUN).parent, Path("/tables")]


def test_samples_and_coefficients_of_the_run_are_exported(stage: Stage) -> None:
    chosen(stage, "Samples and coefficients…")
    assert stage.exported == [RUN]


def test_the_report_is_printed_page_by_page(stage: Stage, qtbot: QtBot, tmp_path: Path) -> None:
    qtbot.keyClick(stage.screen, Qt.Key.Key_P, Qt.KeyboardModifier.ControlModifier)
    (call,) = stage.reports.calls
    assert (call.name, call.arguments) == ("render_run_report", (RUN,))
    pages = [png(210, 297), png(297, 210)]
    call.done(pages)
    dialog = stage.screen.findChild(QPrintDialog)
    assert dialog is not None
    assert dialog.printer().docName() == Path(RUN).stem
    dialog.close()
    printer = QPrinter()
    printer.setOutputFileName(str(tmp_path / "printed.pdf"))
    print_pages(printer, pages)
    printed = (tmp_path / "printed.pdf").read_bytes()
    assert len(re.findall(rb"/Type\s*/Page\b", printed)) == 2
    sheets = [tuple(map(float, box.split())) for box in re.findall(rb"/MediaBox \[0 0 ([\d. ]+)\]", printed)]
    assert [width > height for width, height in sheets] == [False, True]


def png(width: int, height: int) -> bytes:
    image = QImage(width, height, QImage.Format.Format_RGB32)
    image.fill(Qt.GlobalColor.white)
    buffer = QBuffer()
    image.save(buffer, "PNG")
    return bytes(buffer.data().data())
