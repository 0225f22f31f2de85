"""An operator's day by keys alone: connect, record, decide, plan, review, report, set up, close."""

import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest
from looking import visible_words
from PySide6.QtCore import Qt, QTimer
from PySide6.QtWidgets import QAbstractButton, QApplication, QDialog, QFileDialog, QWidget
from pytestqt.qtbot import QtBot
from test_whole_flow import QUICK, seconds_after_release

from app.presenters.composition import make_window_presenter
from app.presenters.record.state import Action
from app.presenters.screens import Screen
from app.qt.record.plan_dialog import PlanDialog
from app.qt.stand_settings_dialog import StandSettingsDialog
from app.qt.theme import Theme
from app.qt.window import MainWindow
from app.runs.reader import open_run
from config.files import load_stand
from tests.waiting import PATIENCE_MS

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="the simulated stand uses a pseudo-terminal")

NONE, CONTROL, ALT = (
    Qt.KeyboardModifier.NoModifier,
    Qt.KeyboardModifier.ControlModifier,
    Qt.KeyboardModifier.AltModifier,
)


class Operator:
    """Presses keys, each where the focus is, and never touches the mouse."""

    def __init__(self, window: MainWindow, qtbot: QtBot) -> None:
        self.window, self.qtbot = window, qtbot
        self.presenter = window._presenter

    def focused(self) -> QWidget:
        return QApplication.focusWidget() or QApplication.activeWindow() or self.window

    def press(self, key: Qt.Key, modifier: Qt.KeyboardModifier = NONE) -> None:
        self.qtbot.keyClick(self.focused(), key, modifier)

    def press_in_menu(self, key: Qt.Key) -> None:
        self.qtbot.keyClick(QApplication.activePopupWidget(), key)

    def write(self, text: str) -> None:
        self.qtbot.keyClicks(self.focused(), text)

    def wait(self, until: Callable[[], bool]) -> None:
        self.qtbot.waitUntil(until, timeout=PATIENCE_MS)

    def tab_to(self, text: str, key: Qt.Key = Qt.Key.Key_Tab) -> None:
        """Go on by Tab until a button has the focus."""
        for _ in range(60):
            button = self.focused()
            if isinstance(button, QAbstractButton) and button.text().startswith(text):
                return
            self.press(key)
        pytest.fail(f"Tab does not reach {text!r}")

    def dialog(self, kind: type[QDialog]) -> QDialog:
        """The open dialog of a kind, once it is active."""
        (found,) = [one for one in self.window.findChildren(kind) if one.isVisible()]
        found.activateWindow()
        self.wait(found.isActiveWindow)
        return found

    def leave_dialog(self) -> None:
        self.press(Qt.Key.Key_Escape)
        self.window.activateWindow()
        self.wait(self.window.isActiveWindow)

    def words(self) -> str:
        return visible_words(self.window)

    def record(self) -> str:
        """Arm, wait for the tail, stop, and wait for the result; the path of the run."""
        record = self.presenter.record
        self.wait(lambda: Action.ARM in record.state.allowed)
        self.press(Qt.Key.Key_A)
        self.wait(lambda: record.state.result is None and seconds_after_release(self.presenter) > 3.0)
        self.press(Qt.Key.Key_Escape)
        self.wait(lambda: record.state.decision is not None)
        assert record.state.result is not None
        return record.state.result.path


@pytest.fixture
def operator(
    theme: Theme, qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Operator]:
    monkeypatch.setenv("SLIPSTAND_RECORDINGS", str(tmp_path / "runs"))
    monkeypatch.setenv("SLIPSTAND_CONFIG", str(tmp_path / "config"))
    window = MainWindow(theme, make_window_presenter(QUICK))
    qtbot.addWidget(window)
    window.show()
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow)
    yield Operator(window, qtbot)
    window.close()


def test_a_day_needs_no_mouse(operator: Operator, tmp_path: Path) -> None:
    connect(operator)
    kept = decide(operator)
    plan(operator)
    review(operator, Path(kept))
    report(operator, Path(kept))
    set_up(operator)
    operator.press(Qt.Key.Key_Q, CONTROL)
    assert not operator.window.isVisible()


def connect(operator: Operator) -> None:
    operator.tab_to("Try with the simulated stand")
    operator.press(Qt.Key.Key_Return)
    operator.wait(lambda: bool(operator.presenter.start.state.connected))
    assert operator.presenter.state.screen is Screen.RECORD


def decide(operator: Operator) -> str:
    """Keep a run with a note, discard another; the path of the kept one."""
    record = operator.presenter.record
    kept = operator.record()
    operator.press(Qt.Key.Key_N)
    operator.write("first of the day")
    operator.press(Qt.Key.Key_Return)
    operator.wait(lambda: record.state.status_message.text.endswith(f"Kept {Path(kept).stem}"))
    assert open_run(Path(kept), trusted=True).metadata.note == "first of the day"
    discarded = operator.record()
    operator.press(Qt.Key.Key_D)
    operator.wait(lambda: record.state.status_message.text == f"Moved {Path(discarded).stem} to the trash")
    return kept


def plan(operator: Operator) -> None:
    operator.press(Qt.Key.Key_P)
    operator.dialog(PlanDialog)
    operator.write("3FFM0 x2")
    operator.press(Qt.Key.Key_Return)
    operator.tab_to("Simulated runs count")
    operator.press(Qt.Key.Key_Space)
    operator.leave_dialog()
    operator.wait(lambda: "Plan 1/2" in operator.words())


def review(operator: Operator, kept: Path) -> None:
    """Bring the discarded run back from the trash, and open the one that was kept."""
    runs = operator.presenter.runs
    operator.press(Qt.Key.Key_4, CONTROL)
    operator.wait(lambda: len(runs.state.rows) == 1)
    operator.press(Qt.Key.Key_T, CONTROL)
    operator.wait(lambda: runs.state.in_trash and len(runs.state.rows) == 1)
    operator.press(Qt.Key.Key_Down)
    operator.press(Qt.Key.Key_Insert)
    operator.wait(lambda: runs.state.total == 0 and runs.state.is_listed)
    operator.press(Qt.Key.Key_T, CONTROL)
    operator.wait(lambda: not runs.state.in_trash and len(runs.state.rows) == 2)
    operator.press(Qt.Key.Key_End)
    operator.press(Qt.Key.Key_Down)
    assert runs.state.selected == (str(kept),)
    operator.press(Qt.Key.Key_Return)
    operator.wait(lambda: operator.presenter.identify.state.curves is not None)
    operator.wait(lambda: operator.window.windowTitle().startswith(f"{kept.stem} "))


def report(operator: Operator, kept: Path) -> None:
    """Write the report of the run that is shown, at the place that is proposed."""
    for after_ms, key in ((200, Qt.Key.Key_Down), (400, Qt.Key.Key_Return)):  # the menu waits for them
        QTimer.singleShot(after_ms, partial(operator.press_in_menu, key))
    operator.press(Qt.Key.Key_E, CONTROL)
    operator.wait(lambda: bool(operator.window.findChildren(QFileDialog)))
    operator.dialog(QFileDialog)
    operator.press(Qt.Key.Key_Return)
    target = kept.with_suffix(".pdf")
    operator.wait(lambda: f"Wrote {target}" in operator.words())
    assert target.read_bytes().startswith(b"%PDF")


def set_up(operator: Operator) -> None:
    """Change the mass of the plate, and dismiss the notice that says what to do about it, and all others."""
    operator.window.activateWindow()
    operator.wait(operator.window.isActiveWindow)
    operator.press(Qt.Key.Key_Comma, CONTROL)
    operator.press(Qt.Key.Key_E, ALT)
    operator.dialog(StandSettingsDialog)
    while operator.focused().accessibleName() != "Mass of the plate, kg":
        operator.press(Qt.Key.Key_Tab)
    operator.press(Qt.Key.Key_A, CONTROL)
    operator.write("22.5")
    operator.press(Qt.Key.Key_S, CONTROL)
    assert load_stand().plate_mass_kg == 22.5
    operator.leave_dialog()
    notices = 1 + operator.presenter.state.more_notices  # on a busy computer the quick stand is told of, too
    for _ in range(notices):
        operator.tab_to("Dismiss")
        operator.press(Qt.Key.Key_Return)
    assert operator.presenter.state.notice is None
