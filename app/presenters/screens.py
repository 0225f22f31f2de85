"""List of screens: a screen is a row here, a folder of `app/presenters` and a folder of `app/qt`."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from app.presenters.base import Presenter
from app.presenters.navigator import Navigator
from app.presenters.record.state import StandContext
from app.presenters.worker import LazyFunction, Worker
from messages.i18n import N_


@dataclass(frozen=True, slots=True)
class ScreenContext:
    """What the presenter of an added screen may use."""

    stand: StandContext
    navigator: Navigator
    make_worker: Callable[[], Worker]
    """Makes a worker for the tasks of the screen, which closes it in `close`."""


class Screen(StrEnum):
    """All screens, in the order of the side bar: name, title, icon, and what makes the presenter.

    The view of a screen is `<Name>Screen` in `app.qt.<name>.screen`. The window makes the presenters of
    screens without a function itself, since they share its connection and its workers.
    """

    label: str
    """Title in the side bar."""
    icon: str
    """Phosphor name."""
    make_presenter: Callable[[ScreenContext], Presenter[Any]] | None

    START = "start", N_("Start"), "house"
    RECORD = "record", N_("Record"), "record"
    IDENTIFY = "identify", N_("Identify"), "chart-line"
    RUNS = "runs", N_("Runs"), "stack"
    CAMPAIGN = "campaign", N_("Campaign"), "table"
    GAUGES = "gauges", N_("Gauges"), "gauge"
    STAND = "stand", N_("Stand"), "flask"
    SETTINGS = "settings", N_("Settings"), "gear"

    def __new__(cls, name: str, label: str, icon: str, make_presenter: str = "") -> "Screen":
        """Make a member; `make_presenter` is `module:function`, imported when the window starts."""
        member = str.__new__(cls, name)
        member._value_ = name
        member.label, member.icon = label, icon
        member.make_presenter = LazyFunction(*make_presenter.split(":")) if make_presenter else None
        return member
