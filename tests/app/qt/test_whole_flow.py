"""A whole test with the simulated stand: start page, pullback over a real port, result, kept, exported."""

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest
from looking import visible_words
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLineEdit, QPushButton
from pytestqt.qtbot import QtBot

from analysis.quantities import Quantity
from app.presenters.composition import make_window_presenter
from app.presenters.number_text import format_uncertain
from app.presenters.record.state import Action, RecordState
from app.presenters.screens import Screen
from app.presenters.window import WindowPresenter
from app.qt.runs.export_dialog import ExportDialog
from app.qt.theme import Theme
from app.qt.window import MainWindow
from app.runs.reader import open_run
from app.simulated_stand.options import SimulatedStandOptions
from tests.waiting import PATIENCE_MS

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="the simulated stand uses a pseudo-terminal")

QUICK = SimulatedStandOptions(
    series="3FFM0", rest_s=0.8, pull_s=0.4, hold_s=0.4, decay_s=6.0, recentre_s=0.2, seed=1, rate_hz=1000.0
)


@pytest.fixture
def presenter(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> WindowPresenter:
    monkeypatch.setenv("SLIPSTAND_RECORDINGS", str(tmp_path))
    monkeypatch.setenv("SLIPSTAND_CONFIG", str(tmp_path / "config"))
    (tmp_path / "config").mkdir()
    (tmp_path / "config" / "settings.toml").write_text("count_simulated = true\n")
    return make_window_presenter(QUICK)


@pytest.fixture
def window(theme: Theme, qtbot: QtBot, presenter: WindowPresenter) -> Iterator[MainWindow]:
    made = MainWindow(theme, presenter)
    qtbot.addWidget(made)
    made.show()
    qtbot.waitExposed(made)
    yield made
    made.close()


def arm_when_possible(window: MainWindow, presenter: WindowPresenter, qtbot: QtBot) -> None:
    (button,) = [b for b in window.findChildren(QPushButton) if b.text() == "Try with the simulated stand"]
    qtbot.mouseClick(button, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: presenter.record.state.primary is Action.ARM, timeout=PATIENCE_MS)
    qtbot.keyClick(window, Qt.Key.Key_A)


def seconds_after_release(presenter: WindowPresenter) -> float:
    """How much of the motion is drawn; 0 before the release."""
    traces = presenter.record.state.traces
    return float(traces.table.time_s[-1]) if traces.marks.release_s is not None else 0.0


class Shown:
    """Keeps what the operator was told, also where a busy computer shows it between two looks."""

    def __init__(self) -> None:
        self.instructions = set[str]()

    def show_state(self, state: RecordState) -> None:
        self.instructions.add(state.guidance.instruction)


def test_a_pullback_is_recorded_and_its_friction_found(
    window: MainWindow, presenter: WindowPresenter, qtbot: QtBot, tmp_path: Path
) -> None:
    arm_when_possible(window, presenter, qtbot)
    record, shown = presenter.record, Shown()
    record.attach(shown)

    def in_the_tail() -> bool:
        return "Both move together" in shown.instructions and seconds_after_release(presenter) > 3.0

    qtbot.waitUntil(in_the_tail, timeout=PATIENCE_MS)
    assert {"The stand pulls back to 6.0\u202fmm", "The plate slides"} <= shown.instructions
    qtbot.keyClick(window, Qt.Key.Key_Escape)
    qtbot.waitUntil(lambda: record.state.result is not None, timeout=PATIENCE_MS)

    result = record.state.result
    assert result is not None
    assert result.headline.name == "dynamic friction", result.warnings
    assert float(result.headline.value) == pytest.approx(0.12, rel=0.01), result
    assert result.comparison.startswith("True value 0.12000: found ")
    words = visible_words(window)
    assert result.headline.value in words
    assert "Stopped by the operator" in words

    run = open_run(Path(result.path), trusted=True)
    assert run.path.parent == tmp_path
    assert run.metadata.series == "3FFM0"
    assert run.end is not None
    assert (run.end.losses.missing, run.end.losses.damaged) == (0, 0)

    keep(window, presenter, qtbot, Path(result.path))
    qtbot.keyClick(window, Qt.Key.Key_3, Qt.KeyboardModifier.ControlModifier)
    assert presenter.state.screen is Screen.IDENTIFY
    assert f"{result.headline.value}" in visible_words(window)
    assert presenter.identify.state.curves is not None
    assert len(presenter.identify.state.curves.time_s) == len(run)
    assert export_coefficients(window, presenter, qtbot, run.path) == result.headline.value


def keep(window: MainWindow, presenter: WindowPresenter, qtbot: QtBot, path: Path) -> None:
    """Type a note and keep the run; it counts, and holds what was found."""
    (note,) = [f for f in window.findChildren(QLineEdit) if f.accessibleName() == "Note on this run"]
    qtbot.keyClicks(note, "first try")
    qtbot.keyClick(note, Qt.Key.Key_Return)
    assert presenter.record.state.status_bar.run.text == "3FFM0 run 2"
    qtbot.waitUntil(lambda: f"Kept {path.stem}" in visible_words(window), timeout=PATIENCE_MS)
    kept = open_run(path, trusted=True)
    assert kept.metadata.note == "first try"
    assert [saved.document["classical"]["cycles"] > 3 for saved in kept.analyses] == [True]
    qtbot.keyClick(window, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert presenter.record.state.status_bar.run.text == "3FFM0 run 1"
    assert note.text() == "first try"
    qtbot.keyClick(window, Qt.Key.Key_Return)
    qtbot.waitUntil(lambda: f"Kept {path.stem}" in visible_words(window), timeout=PATIENCE_MS)
    assert len(open_run(path, trusted=True).analyses) == 1


def export_coefficients(window: MainWindow, presenter: WindowPresenter, qtbot: QtBot, path: Path) -> str:
    """Export them as JSON by the dialog of the Runs screen; f_d in the file, as it is shown."""
    qtbot.keyClick(window, Qt.Key.Key_4, Qt.KeyboardModifier.ControlModifier)
    runs = presenter.runs
    qtbot.waitUntil(lambda: bool(runs.state.rows), timeout=PATIENCE_MS)
    runs.select((str(path),))
    (ask,) = [b for b in window.findChildren(QPushButton) if b.text() == "Export…" and b.isVisible()]
    qtbot.waitUntil(ask.isEnabled, timeout=PATIENCE_MS)
    qtbot.mouseClick(ask, Qt.MouseButton.LeftButton)
    runs.export_dialog.set_format("json")
    runs.export_dialog.set_content("coefficients")
    output = path.with_suffix(".json")
    runs.export_dialog.set_output(str(output))
    (dialog,) = window.findChildren(ExportDialog)
    (button,) = [b for b in dialog.findChildren(QPushButton) if b.text() == "Export"]
    qtbot.mouseClick(button, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: runs.export_dialog.state.message.text.startswith("Wrote"), timeout=PATIENCE_MS)
    coefficients = json.loads(output.read_text(encoding="utf-8"))["coefficients"]
    (found,) = [one for one in coefficients if one["quantity"] == "friction_dynamic"]
    value = Quantity.normal(found["value"], found["standard_uncertainty"], found["unit"])
    return format_uncertain(value)[0]


def test_closing_the_window_while_it_records_keeps_the_run(
    window: MainWindow, presenter: WindowPresenter, qtbot: QtBot, tmp_path: Path
) -> None:
    arm_when_possible(window, presenter, qtbot)
    qtbot.waitUntil(lambda: seconds_after_release(presenter) > 2.0, timeout=PATIENCE_MS)
    window.close()
    assert "Closing the window ends it now" in visible_words(window)
    presenter.execute_notice_action()
    qtbot.waitUntil(lambda: not window.isVisible(), timeout=PATIENCE_MS)
    (path,) = tmp_path.glob("*.h5")
    run = open_run(path, trusted=True)
    assert run.end is not None
    assert run.end.ended == "stopped"
    assert run.end.events.release_s == pytest.approx(1.0, abs=0.01)
    assert run.time_s[-1] > 2.9


def test_esc_before_the_pull_leaves_nothing(
    theme: Theme, qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLIPSTAND_RECORDINGS", str(tmp_path))
    presenter = make_window_presenter(msgspec.structs.replace(QUICK, on_demand=True, rest_s=30.0))
    window = MainWindow(theme, presenter)
    qtbot.addWidget(window)
    window.show()
    qtbot.waitExposed(window)
    arm_when_possible(window, presenter, qtbot)
    qtbot.waitUntil(lambda: presenter.record.state.disarms, timeout=PATIENCE_MS)
    guidance = "The stand pulls back to 6.0\u202fmm"
    qtbot.waitUntil(lambda: guidance in visible_words(window), timeout=PATIENCE_MS)
    qtbot.keyClick(window, Qt.Key.Key_Escape)
    qtbot.waitUntil(lambda: "Disarmed. Nothing was recorded" in visible_words(window), timeout=PATIENCE_MS)
    assert presenter.record.state.result is None
    assert presenter.record.state.primary is Action.ARM
    qtbot.waitUntil(
        lambda: [path.name for path in tmp_path.iterdir()] == ["next-tests.json"], timeout=PATIENCE_MS
    )
    window.close()


def test_a_release_that_came_too_early_is_said_and_the_next_one_is_recorded(
    theme: Theme, qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLIPSTAND_RECORDINGS", str(tmp_path))
    early = msgspec.structs.replace(QUICK, on_demand=True, early_release_m=0.002)
    presenter = make_window_presenter(early)
    window = MainWindow(theme, presenter)
    qtbot.addWidget(window)
    window.show()
    qtbot.waitExposed(window)
    arm_when_possible(window, presenter, qtbot)
    guidance = "Let go too early, at 2.0\u202fmm"
    qtbot.waitUntil(lambda: guidance in visible_words(window), timeout=PATIENCE_MS)
    qtbot.waitUntil(lambda: seconds_after_release(presenter) > 2.0, timeout=PATIENCE_MS)
    qtbot.keyClick(window, Qt.Key.Key_Escape)
    qtbot.waitUntil(lambda: presenter.record.state.result is not None, timeout=PATIENCE_MS)
    result = presenter.record.state.result
    assert result is not None
    assert float(result.headline.value) == pytest.approx(0.12, rel=0.01), result
    window.close()


def test_a_port_that_does_not_exist_is_said_in_the_window(
    window: MainWindow, presenter: WindowPresenter, qtbot: QtBot
) -> None:
    presenter.start.set_form(type(presenter.start.state.form)("/dev/no-such-port", "csv"))
    presenter.start.connect()
    qtbot.waitUntil(lambda: presenter.state.notice is not None, timeout=PATIENCE_MS)
    words = visible_words(window)
    assert "/dev/no-such-port" in words
    assert "Connect again" in words
