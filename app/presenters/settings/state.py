"""The Settings screen: state and presenter. Each change is applied and saved at once, and can be undone."""

from dataclasses import dataclass, field

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
    """A settings file.

    Attributes
    ----------
    name : str
        Its content, as a label.
    path : str
    """

    name: str
    path: str


@dataclass(frozen=True, slots=True)
class SettingsState:
    """State of the screen.

    Attributes
    ----------
    settings : Settings
    recordings : str
        Folder of the runs that is in use.
    override : str
        Environment variable that overrides the setting; empty if none does.
    files : tuple of SettingsFile
    needs_restart : bool
        Whether a change takes effect after a restart.
    can_undo : bool
    message : Chip
        Fault of the last change.
    """

    settings: Settings = field(default_factory=Settings)
    recordings: str = ""
    override: str = ""
    files: tuple[SettingsFile, ...] = ()
    needs_restart: bool = False
    can_undo: bool = False
    message: Chip = EMPTY_CHIP
