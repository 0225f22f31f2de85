"""What the settings page shows, as values."""

from dataclasses import dataclass, field
from typing import Protocol

from app.presenters.base import EMPTY_CHIP, Chip
from config.schema import Settings
from messages.i18n import N_

THEMES = {
    "system": N_("As the system"),
    "light": N_("Light"),
    "dark": N_("Dark"),
}
LANGUAGES = {"system": N_("As the system"), "en": "English", "ru": "Русский"}
SCALES = (1.0, 1.25, 1.5, 1.75, 2.0)


@dataclass(frozen=True, slots=True)
class SettingsFile:
    """A file that settings come from.

    Attributes
    ----------
    name : str
        What it holds.
    path : str
    """

    name: str
    path: str


@dataclass(frozen=True, slots=True)
class SettingsState:
    """The whole page.

    Attributes
    ----------
    settings : Settings
    recordings : str
        Folder of the runs that is in use since the start of the window.
    overridden : str
        What sets the folder whatever is chosen here; empty when nothing does.
    files : tuple of SettingsFile
    waits : bool
        Something chosen only holds from the next start on.
    undo : bool
        A change can be taken back.
    message : Chip
        What came of the last change.
    """

    settings: Settings = field(default_factory=Settings)
    recordings: str = ""
    override: str = ""
    files: tuple[SettingsFile, ...] = ()
    needs_restart: bool = False
    can_undo: bool = False
    message: Chip = EMPTY_CHIP


class SettingsEvents(Protocol):
    """What the settings page tells its presenter."""

    def change(self, **changes: object) -> None:
        """Give fields of `Settings` new values."""

    def undo(self) -> None:
        """Take the last change back."""
