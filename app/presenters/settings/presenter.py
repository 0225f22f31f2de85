"""What the settings page does: each change holds at once and is kept at once, and can be taken back."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from app.presenters.base import EMPTY_CHIP, Chip, Presenter, Tone
from app.presenters.results import sentence
from app.presenters.settings.state import SettingsFile, SettingsState
from config.schema import ConfigError, Settings
from messages.i18n import gettext

_AT_START = ("language", "scale", "recordings")
"""What only holds from the next start on."""


class SettingsStore(Protocol):
    """Where settings are kept."""

    def save(self, settings: Settings) -> Path | None:
        """Keep them; returns what an unreadable file was put aside as. Raises ConfigError."""


class NullStore:
    """Keeps nothing."""

    def save(self, _settings: Settings) -> None:
        """Do nothing."""


@dataclass(frozen=True, slots=True)
class PersonalSettings:
    """What the window takes from a person's settings when it starts.

    Attributes
    ----------
    settings : Settings
    fault : str
        Why the defaults are used instead of what was kept; empty where all is well.
    recordings, overridden : str
        The folder in use, and what else than the settings says so.
    files : tuple of SettingsFile
    store : Store
    """

    settings: Settings = field(default_factory=Settings)
    fault: str = ""
    recordings: str = ""
    override: str = ""
    files: tuple[SettingsFile, ...] = ()
    store: SettingsStore = field(default_factory=NullStore)


class SettingsPresenter(Presenter[SettingsState]):
    """A person's choices.

    Parameters
    ----------
    personal : Personal
    apply : callable
        Lets the rest of the window take new settings.
    """

    def __init__(self, personal: PersonalSettings, apply: Callable[[Settings], None]) -> None:
        super().__init__(
            SettingsState(personal.settings, personal.recordings, personal.override, personal.files)
        )
        self._at_start = personal.settings
        self._store = personal.store
        self._apply = apply
        self._before: list[Settings] = []

    def change(self, **changes: Any) -> None:
        """Give fields of `Settings` new values; what cannot be is said and leaves all as it was."""
        before = self.state.settings
        try:
            if folder := changes.get("recordings"):
                _check_folder(folder)
            settings = before.replace(**changes)
        except (ConfigError, ValueError) as error:
            self._update(message=Chip(sentence(str(error)), Tone.BAD))
            return
        if settings != before:
            self._before.append(before)
            self._take(settings)

    def undo(self) -> None:
        """Take the last change back."""
        if self._before:
            self._take(self._before.pop())

    def _take(self, settings: Settings) -> None:
        waits = any(getattr(settings, name) != getattr(self._at_start, name) for name in _AT_START)
        self._update(
            settings=settings, needs_restart=waits, can_undo=bool(self._before), message=self._keep(settings)
        )
        self._apply(settings)

    def _keep(self, settings: Settings) -> Chip:
        try:
            aside = self._store.save(settings)
        except ConfigError as error:
            return Chip(sentence(str(error)), Tone.BAD)
        if aside is None:
            return EMPTY_CHIP
        return Chip(
            gettext("The file before could not be read. It is kept as {name}", name=aside.name), Tone.WARN
        )


def _check_folder(folder: str) -> None:
    """Refuse what cannot become a folder of runs. Raises ConfigError."""
    path = Path(folder).expanduser()
    if not path.is_absolute():
        raise ConfigError(
            gettext(
                "Folder {folder} is no full path: choose it, or write one from the root on", folder=folder
            )
        )
    if path.exists() and not path.is_dir():
        raise ConfigError(gettext("{folder} is a file: choose a folder", folder=folder))
