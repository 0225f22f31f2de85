"""Factory of screens. A screen in a folder is imported when it is first shown: its plots load pyqtgraph."""

import importlib
from collections.abc import Callable
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
    """Build the view of a screen, attached to its presenter."""
    presenter = window.presenters[screen]
    view: Any
    match screen:
        case Screen.START:
            view = StartScreen(window.start, dialogs.ask_for_run)
        case Screen.STAND:
            view = StandScreen(window.stand)
        case Screen.SETTINGS:
            view = SettingsScreen(window.settings)
        case Screen.RECORD:
            view = _view_class(screen)(theme, presenter, window.show_start)
        case Screen.IDENTIFY:
            view = _view_class(screen)(theme, presenter, dialogs.ask_for_run)
        case Screen.RUNS:
            view = _view_class(screen)(theme, presenter, dialogs)
        case _:
            view = _view_class(screen)(theme, presenter)
    presenter.attach(view)
    return cast(QWidget, view)


def _view_class(screen: Screen) -> Callable[..., QWidget]:
    """Class `<Name>Screen` of `app.qt.<name>.screen`."""
    view: Callable[..., QWidget] = getattr(
        importlib.import_module(f"app.qt.{screen}.screen"), f"{screen.capitalize()}Screen"
    )
    return view
