"""The Settings screen: state and presenter. Each change is applied and saved at once, and can be undone."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from analysis.catalogue import DISPLACEMENT_UNITS
from analysis.formatting import with_unit
from app.presenters.base import EMPTY_CHIP, Chip, Presenter, Tone
from app.presenters.results import sentence
from config.schema import ConfigError, Settings, Stand
from messages.i18n import N_, gettext, language_names
from messages.message import message_of

CHOICES: dict[str, dict[Any, str]] = {
    "theme": {"system": N_("As the system"), "light": N_("Light"), "dark": N_("Dark")},
    "language": {"system": N_("As the system"), **language_names()},
    "scale": {scale: with_unit(f"{100 * scale:.0f}", "%") for scale in (1.0, 1.25, 1.5, 1.75, 2.0)},
    "displacement_unit": {name: unit.symbol for name, unit in DISPLACEMENT_UNITS.items()},
    "log_level": {
        "error": N_("Errors only"),
        "warning": N_("Errors and warnings"),
        "info": N_("Usual"),
        "debug": N_("Everything"),
    },
}
"""Values of settings and their titles."""
_AT_START = (
    "language",
    "scale",
    "displacement_unit",
    "recordings",
    "log_level",
)  # settings that take effect after a restart


@dataclass(frozen=True, slots=True)
class SettingsFile:
    name: str
    path: str


@dataclass(frozen=True, slots=True)
class SettingsState:
    settings: Settings = field(default_factory=Settings)
    needs_restart: bool = False
    can_undo: bool = False
    message: Chip = EMPTY_CHIP
    """Fault of the last change."""
    files: tuple[SettingsFile, ...] = ()


@dataclass(frozen=True, slots=True)
class PersonalSettings:
    """Personal settings at the start of the window, and where runs and settings are."""

    settings: Settings = field(default_factory=Settings)
    fault: str = ""
    """Why the defaults are used; empty if the settings were read."""
    recordings: str = ""
    override: str = ""
    """Environment variable that overrides the folder; empty if none does."""
    list_files: Callable[[], tuple[SettingsFile, ...]] = tuple
    """Lists the files of settings that are in use: the laboratory's own, else the shipped ones."""
    save: Callable[[Settings], Path | None] = lambda _: None
    """Saves settings; returns the backup of an unreadable file, if there was one. Raises ConfigError."""


class SettingsPresenter(Presenter[SettingsState]):
    """Changes personal settings; `apply` applies new ones to the window."""

    def __init__(self, personal: PersonalSettings, apply: Callable[[Settings], None]) -> None:
        super().__init__(SettingsState(personal.settings, files=personal.list_files()))
        self.personal = personal
        self._apply = apply
        self._before: list[Settings] = []

    def on_stand(self, _stand: Stand) -> None:
        """Show another file, where the laboratory had none of its own before."""
        self._update(files=self.personal.list_files())

    def change(self, **changes: Any) -> None:
        """Set fields of `Settings`, and save them; an invalid value changes nothing."""
        before = self.state.settings
        try:
            if folder := changes.get("recordings"):
                _check_folder(folder)
            settings = before.replace(**changes)
        except (ConfigError, ValueError) as error:
            self._update(message=Chip(sentence(message_of(error)), Tone.BAD))
            return
        if settings != before:
            self._before.append(before)
            self._apply_settings(settings)

    def undo(self) -> None:
        if self._before:
            self._apply_settings(self._before.pop())

    def _apply_settings(self, settings: Settings) -> None:
        waits = any(getattr(settings, name) != getattr(self.personal.settings, name) for name in _AT_START)
        self._update(
            settings=settings, needs_restart=waits, can_undo=bool(self._before), message=self._save(settings)
        )
        self._apply(settings)

    def _save(self, settings: Settings) -> Chip:
        try:
            backup = self.personal.save(settings)
        except ConfigError as error:
            return Chip(sentence(error.message), Tone.BAD)
        if backup is None:
            return EMPTY_CHIP
        text = gettext("The file before could not be read. It is kept as {name}", name=backup.name)
        return Chip(text, Tone.WARN)


def _check_folder(folder: str) -> None:
    path = Path(folder).expanduser()
    if not path.is_absolute():
        raise ConfigError(
            "Folder {folder} is no full path: choose it, or write one from the root on", folder=folder
        )
    if path.exists() and not path.is_dir():
        raise ConfigError("{folder} is a file: choose a folder", folder=folder)
