"""Factory of screens. A screen in a folder is imported when it is first shown: its plots load pyqtgraph."""

import importlib
from typing import TYPE_CHECKING, Any, cast

from PySide6.QtWidgets import QWidget

from app.presenters.screens import Screen
from app.presenters.window import WindowPresenter
from app.qt.settings_screen import SettingsScreen
from app.qt.stand_screen import StandScreen
from app.qt.start_screen import StartScreen
from app.qt.theme import Theme

if TYPE_CHECKING:
    from app.qt.window import MainWindow


def build_screen(screen: Screen, window: WindowPresenter, theme: Theme, dialogs: "MainWindow") -> QWidget:
    presenter = window.presenters[screen]
    more = {Screen.RECORD: window.show_start, Screen.IDENTIFY: dialogs.ask_for_run, Screen.RUNS: dialogs}
    view: Any
    match screen:
        case Screen.START:
            view = StartScreen(window.start, dialogs.ask_for_run)
        case Screen.STAND:
            view = StandScreen(window.stand)
        case Screen.SETTINGS:
            view = SettingsScreen(window.settings)
        case _:
            module = importlib.import_module(f"app.qt.{screen}.screen")
            needed = (more[screen],) if screen in more else ()
            view = getattr(module, f"{screen.capitalize()}Screen")(theme, presenter, *needed)
    presenter.attach(view)
    return cast(QWidget, view)
