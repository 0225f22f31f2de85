"""Base of all screens: presenter with an immutable state, and small values that states are made of."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum, StrEnum
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

from config.schema import Gauges, Stand
from messages.i18n import N_, gettext, ngettext
from messages.message import Message

State = TypeVar("State")
Shown = TypeVar("Shown", contravariant=True)


class View(Protocol[Shown]):
    """Passive view: shows a state, and passes actions of the operator to the presenter."""

    def show_state(self, state: Shown) -> None:
        """Show a state; parts that have not changed may stay as they are."""


class Presenter(Generic[State]):
    """Base of all presenters. Views may be attached at any time."""

    def __init__(self, state: State) -> None:
        self.state = state
        self._views: list[View[State]] = []

    def attach(self, view: View[State]) -> None:
        """Show the state on `view`, now and whenever it changes."""
        self._views.append(view)
        view.show_state(self.state)

    def enter(self) -> None:
        """React to the screen being shown."""

    def leave(self) -> None:
        """React to another screen being shown."""

    def tick(self) -> None:
        """Process what has come from workers and the engine; called some 60 times a second."""

    def on_gauges(self, gauges: Gauges) -> None:
        """React to other calibrations being in use."""

    def on_stand(self, stand: Stand) -> None:
        """React to another stand being in use."""

    def close(self) -> None:
        """End the workers."""

    def _set_state(self, state: State) -> None:
        if state != self.state:
            self.state = state
            for view in self._views:
                view.show_state(state)

    def _update(self, **changes: Any) -> None:
        if any(getattr(self.state, name) != value for name, value in changes.items()):
            self._set_state(replace(self.state, **changes))  # type: ignore[type-var]


class Tone(StrEnum):
    """Colour of a text; the text itself always says the same."""

    PLAIN = "plain"
    OK = "ok"
    WARN = "warn"
    BAD = "bad"
    STALE = "stale"  # what is shown was true once


@dataclass(frozen=True, slots=True)
class Chip:
    text: str
    tone: Tone = Tone.PLAIN
    hint: str = ""


EMPTY_CHIP = Chip("")


@dataclass(frozen=True, slots=True)
class LabelledValue:
    label: str
    value: str


class NoticeAction(Enum):
    """Action that a notice offers, and the text of its button."""

    RECONNECT = N_("Connect again")
    RECOVER = N_("Recover")
    CLOSE = N_("Close the window")
    SIMULATE = N_("Start the simulated stand")
    OPEN_RUN = N_("Look at it")


@dataclass(frozen=True, slots=True)
class Notice:
    """Message above the screen, shown until it is dismissed or what it tells of is over.

    A question is answered by its action, or by its dismissal, which leaves all as it is. `details` can be
    unfolded and copied; `path` is the run that the action opens.
    """

    text: str
    tone: Tone = Tone.BAD
    action: NoticeAction | None = None
    dismiss: str = N_("Dismiss")
    details: str = ""
    is_question: bool = False
    path: str = ""


@dataclass(frozen=True, slots=True)
class Progress:
    """Progress of a task; `fraction` is None where it is unknown."""

    text: str
    fraction: float | None = None


@dataclass(frozen=True, slots=True)
class TaskFailure:
    """Why a task of a worker has failed."""

    message: Message
    is_cancelled: bool = False


@dataclass(frozen=True, slots=True)
class SimulationStarted:
    """A simulated stand has started and is being connected."""

    series: str
    true_friction: float


ReportProgress = Callable[[Progress], None]
_ROUNDING = 1e-9


def batch_progress(
    report: ReportProgress, template: str, paths: Sequence[str]
) -> Callable[[float, object], None]:
    """Make a callback for `app.runs.batch` that reports which run is being processed.

    `template` has the fields `{name}`, `{number}` and `{all}`, and is translated here.
    """

    def on_share(share: float, _what: object) -> None:
        number = min(int(share * len(paths) + _ROUNDING), len(paths) - 1)
        name = Path(paths[number]).stem
        report(Progress(gettext(template, name=name, number=number + 1, all=len(paths)), share))

    return on_share


def run_count_text(paths: Sequence[str]) -> str:
    return Path(paths[0]).stem if len(paths) == 1 else ngettext("{count} run", "{count} runs", len(paths))
