"""What all screens share: a presenter holds one immutable state and shows it whenever it has changed."""

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, Generic, Protocol, TypeVar

from messages.i18n import N_

State = TypeVar("State")
Shown = TypeVar("Shown", contravariant=True)


class View(Protocol[Shown]):
    """The passive side: draws a state, and tells the presenter what the operator did."""

    def show_state(self, state: Shown) -> None:
        """Draw `state`; parts that have not changed may be left as they are."""


class Presenter(Generic[State]):
    """Base of all presenters. Works without a view too: one may be attached at any time."""

    def __init__(self, state: State) -> None:
        self.state = state
        self._view: View[State] | None = None

    def attach(self, view: View[State]) -> None:
        """Show the state on `view`, now and whenever it changes."""
        self._view = view
        view.show_state(self.state)

    def _set_state(self, state: State) -> None:
        """Replace the state, and show it if it differs."""
        if state != self.state:
            self.state = state
            if self._view is not None:
                self._view.show_state(state)

    def _update(self, **changes: Any) -> None:
        """Replace fields of the state, and show it if that makes a difference."""
        if any(getattr(self.state, name) != value for name, value in changes.items()):
            self._set_state(replace(self.state, **changes))  # type: ignore[type-var]


class Tone(StrEnum):
    """What a word is coloured by; the word itself always says it too."""

    PLAIN = "plain"
    OK = "ok"
    WARN = "warn"
    BAD = "bad"


@dataclass(frozen=True, slots=True)
class Chip:
    """A short statement with a tone, and more words for who points at it."""

    text: str
    tone: Tone = Tone.PLAIN
    hint: str = ""


EMPTY_CHIP = Chip("")


@dataclass(frozen=True, slots=True)
class Notice:
    """Something the operator must know, shown in the window until it is dismissed.

    `action` and `dismiss` are buttons; without an action there is only the latter. `details` can be unfolded
    and copied.
    """

    text: str
    tone: Tone = Tone.BAD
    action: str = ""
    dismiss: str = N_("Dismiss")
    details: str = ""


@dataclass(frozen=True, slots=True)
class Progress:
    """Work that goes on elsewhere. `fraction` is None where nobody knows how long it takes."""

    text: str
    fraction: float | None = None
