"""Builds a screen when it is first shown. Those with plots import their library only then."""

from collections.abc import Callable
from typing import Protocol

from PySide6.QtWidgets import QWidget

from app.presenters.window import Screen, WindowPresenter
from app.qt.theme import Theme


class WindowDialogs(Protocol):
    """What screens ask of the window."""

    def ask_for_run(self) -> None:
        """Let the operator choose a recording."""

    def ask_for_export(self) -> None:
        """Let the operator choose what becomes of the selected runs."""

    def show_import(self) -> None:
        """Show the dialog of the files that wait to be imported."""


def build_screen(screen: Screen, presenter: WindowPresenter, theme: Theme, dialogs: WindowDialogs) -> QWidget:
    """The view of a screen, attached to its presenter."""
    return _BUILDERS[screen](presenter, theme, dialogs)


def _start(presenter: WindowPresenter, _theme: Theme, dialogs: WindowDialogs) -> QWidget:
    from app.qt.start_screen import StartScreen

    view = StartScreen(presenter.start, dialogs.ask_for_run)
    presenter.start.attach(view)
    return view


def _record(presenter: WindowPresenter, theme: Theme, _dialogs: WindowDialogs) -> QWidget:
    from app.qt.record.screen import RecordScreen

    view = RecordScreen(theme, presenter.record, lambda: presenter.show_screen(Screen.START))
    presenter.record.attach(view)
    return view


def _identify(presenter: WindowPresenter, theme: Theme, dialogs: WindowDialogs) -> QWidget:
    from app.qt.identify.screen import IdentifyScreen

    view = IdentifyScreen(theme, presenter.identify, dialogs.ask_for_run)
    presenter.identify.attach(view)
    return view


def _runs(presenter: WindowPresenter, theme: Theme, dialogs: WindowDialogs) -> QWidget:
    from app.qt.runs.screen import RunsScreen

    view = RunsScreen(theme, presenter.runs, dialogs)
    presenter.runs.attach(view)
    return view


def _campaign(presenter: WindowPresenter, theme: Theme, _dialogs: WindowDialogs) -> QWidget:
    from app.qt.campaign.screen import CampaignScreen

    view = CampaignScreen(theme, presenter.campaign)
    presenter.campaign.attach(view)
    return view


def _gauges(presenter: WindowPresenter, theme: Theme, _dialogs: WindowDialogs) -> QWidget:
    from app.qt.gauges.screen import GaugesScreen

    view = GaugesScreen(theme, presenter.gauges)
    presenter.gauges.attach(view)
    return view


def _stand(presenter: WindowPresenter, _theme: Theme, _dialogs: WindowDialogs) -> QWidget:
    from app.qt.stand_screen import StandScreen

    view = StandScreen(presenter.stand)
    presenter.stand.attach(view)
    return view


def _settings(presenter: WindowPresenter, _theme: Theme, _dialogs: WindowDialogs) -> QWidget:
    from app.qt.settings_screen import SettingsScreen

    view = SettingsScreen(presenter.settings)
    presenter.settings.attach(view)
    return view


_BUILDERS: dict[Screen, Callable[[WindowPresenter, Theme, WindowDialogs], QWidget]] = {
    Screen.START: _start,
    Screen.RECORD: _record,
    Screen.IDENTIFY: _identify,
    Screen.RUNS: _runs,
    Screen.CAMPAIGN: _campaign,
    Screen.GAUGES: _gauges,
    Screen.STAND: _stand,
    Screen.SETTINGS: _settings,
}
