"""Factory of screens. A screen is imported when it is first shown: screens with plots load pyqtgraph."""

import importlib
from collections.abc import Callable
from typing import TYPE_CHECKING

from PySide6.QtWidgets import QWidget

from app.presenters.window import Screen, WindowPresenter
from app.qt.settings_screen import SettingsScreen
from app.qt.stand_screen import StandScreen
from app.qt.start_screen import StartScreen
from app.qt.theme import Theme

if TYPE_CHECKING:
    from app.qt.window import MainWindow


def build_screen(screen: Screen, presenter: WindowPresenter, theme: Theme, dialogs: "MainWindow") -> QWidget:
    """Build the view of a screen, attached to its presenter."""
    view: QWidget
    match screen:
        case Screen.START:
            view = StartScreen(presenter.start, dialogs.ask_for_run)
        case Screen.RECORD:
            view = _view_class("Record")(theme, presenter.record, presenter.show_start)
        case Screen.IDENTIFY:
            view = _view_class("Identify")(theme, presenter.identify, dialogs.ask_for_run)
        case Screen.RUNS:
            view = _view_class("Runs")(theme, presenter.runs, dialogs)
        case Screen.CAMPAIGN:
            view = _view_class("Campaign")(theme, presenter.campaign)
        case Screen.GAUGES:
            view = _view_class("Gauges")(theme, presenter.gauges)
        case Screen.STAND:
            view = StandScreen(presenter.stand)
        case Screen.SETTINGS:
            view = SettingsScreen(presenter.settings)
    getattr(presenter, screen.value).attach(view)
    return view


def _view_class(name: str) -> Callable[..., QWidget]:
    view: Callable[..., QWidget] = getattr(
        importlib.import_module(f"app.qt.{name.lower()}.screen"), f"{name}Screen"
    )
    return view
