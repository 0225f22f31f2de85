"""A window on fakes, as a person would use it."""

from pathlib import Path

from looking import visible_words
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLineEdit, QPushButton
from pytestqt.qtbot import QtBot
from stage import FakeLauncher, FakePool, FakeWorker, bench

from app.presenters.connection import Connection
from app.presenters.error_reports import ErrorReporter
from app.presenters.navigator import ConnectForm
from app.presenters.notices import NoticeSources
from app.presenters.recent import RecentItems
from app.presenters.screens import Screen
from app.presenters.start_screen import PortChoice, StartState
from app.presenters.window import WindowContext, WindowPresenter
from app.qt.theme import Theme
from app.qt.window import MainWindow
from config.files import save_stand
from config.schema import RecentUse, WindowLayout
from drivers.driver import DeviceDriver


class Desk:
    """A window on fakes."""

    def __init__(
        self,
        theme: Theme,
        qtbot: QtBot,
        place: WindowLayout | None = None,
        recent: RecentUse | None = None,
    ) -> None:
        self.qtbot = qtbot
        self.faults = ErrorReporter()
        self.unfinished = 0
        self.launcher = FakeLauncher()
        self.worker = FakeWorker()
        start = StartState(
            all_series=bench().all_series,
            series="1FFM0",
            protocols=(
                DeviceDriver("slipstand-binary", "", 1, 460800, evidence="its manual", package="drivers"),
                DeviceDriver("csv", "", 2, 115200),
            ),
            form=ConnectForm(protocol="slipstand-binary"),
            recordings=str(Path.home()),
        )
        self.presenter = WindowPresenter(
            Connection(*self.launcher.starters, ErrorReporter().report),
            self.worker,  # type: ignore[arg-type]
            FakePool(),
            WindowContext(
                bench(),
                start,
                list_ports=lambda: (PortChoice("COM7", "FT232R"),),
                notices=NoticeSources(lambda: self.unfinished),
                recent=RecentItems(recent),
                save_stand=save_stand,
            ),
            self.faults,
        )
        self.window = MainWindow(theme, self.presenter, place)
        qtbot.addWidget(self.window)
        self.window.show()
        qtbot.waitExposed(self.window)

    def button(self, text: str) -> QPushButton:
        (found,) = [b for b in self.window.findChildren(QPushButton) if b.text() == text and b.isVisible()]
        return found

    def click(self, text: str) -> None:
        self.qtbot.mouseClick(self.button(text), Qt.MouseButton.LeftButton)

    def press_number_of(self, screen: Screen) -> None:
        number = list(Screen).index(screen) + 1
        self.qtbot.keyClick(self.window, str(number), Qt.KeyboardModifier.ControlModifier)

    def words(self) -> str:
        return visible_words(self.window)

    def field(self, name: str) -> QLineEdit:
        (found,) = [
            f for f in self.window.findChildren(QLineEdit) if f.accessibleName() == name and f.isVisible()
        ]
        return found
