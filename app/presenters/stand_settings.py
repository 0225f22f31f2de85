"""Settings of the stand: masses, pullbacks, contacts and added masses, edited as text and saved together."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from app.presenters.base import EMPTY_CHIP, Chip, Presenter, Tone
from app.presenters.number_text import parse_number
from app.presenters.results import sentence
from config.files import parse_stand
from config.schema import ConfigError, Stand
from messages.i18n import N_, gettext

Rows = tuple[tuple[str, str], ...]
"""Code and value of each row, as typed."""

NUMBERS: Final = {
    "table_mass_kg": N_("Mass of the table, kg"),
    "table_mass_standard_uncertainty_kg": N_("Its standard uncertainty, kg"),
    "plate_mass_kg": N_("Mass of the plate, kg"),
    "plate_mass_standard_uncertainty_kg": N_("Its standard uncertainty, kg"),
    "gravity_m_per_s2": N_("Gravity, m/s²"),
    "gravity_standard_uncertainty_m_per_s2": N_("Its standard uncertainty, m/s²"),
}
"""Fields of `Stand` that are numbers, and their titles."""
_TABLES: Final = ("pullbacks_m", "contacts", "added_masses_kg")
_MILLIMETRES: Final = 1e3


@dataclass(frozen=True, slots=True)
class StandSettingsForm:
    """The stand as typed: pullbacks in mm, all else in SI."""

    name: str
    numbers: tuple[str, ...]
    """In the order of `NUMBERS`."""
    pullbacks: Rows
    contacts: Rows
    added_masses: Rows


@dataclass(frozen=True, slots=True)
class StandSettingsState:
    """`is_changed` until the form is saved."""

    form: StandSettingsForm
    is_changed: bool = False
    can_undo: bool = False
    message: Chip = EMPTY_CHIP


class StandSettingsPresenter(Presenter[StandSettingsState]):
    """Edits the stand; `save` stores it and returns its file, and `apply` gives it to the window.

    `is_locked` tells whether a run is being recorded, during which the stand stays as it is.
    """

    def __init__(
        self,
        stand: Stand,
        save: Callable[[Stand], Path],
        apply: Callable[[Stand], None],
        is_locked: Callable[[], bool],
    ) -> None:
        super().__init__(StandSettingsState(stand_form(stand)))
        self._stand = stand
        self._save = save
        self._apply = apply
        self._is_locked = is_locked
        self._before: list[Stand] = []

    def set_form(self, form: StandSettingsForm) -> None:
        self._update(form=form, is_changed=form != stand_form(self._stand), message=EMPTY_CHIP)

    def reset(self) -> None:
        """Show the stand as it is stored."""
        self.set_form(stand_form(self._stand))

    def save(self) -> None:
        """Check and save the form; one that cannot be used changes nothing."""
        try:
            stand = parse_stand_form(self.state.form, self._stand)
        except ConfigError as error:
            self._update(message=Chip(sentence(error.message), Tone.BAD))
            return
        before = self._stand
        if self._use(stand):
            self._before.append(before)
            self._update(can_undo=True)

    def undo(self) -> None:
        """Save the stand as it was before the last save."""
        if self._before and self._use(self._before[-1]):
            self._before.pop()
            self._update(can_undo=bool(self._before))

    def _use(self, stand: Stand) -> bool:
        if self._is_locked():
            text = gettext("A run is being recorded. Stop it first: Esc on Record")
            self._update(message=Chip(text, Tone.WARN))
            return False
        try:
            file = self._save(stand)
        except ConfigError as error:
            self._update(message=Chip(sentence(error.message), Tone.BAD))
            return False
        self._stand = stand
        text = gettext("Saved in {file}", file=file)
        self._update(form=stand_form(stand), is_changed=False, message=Chip(text, Tone.OK))
        self._apply(stand)
        return True


def stand_form(stand: Stand) -> StandSettingsForm:
    return StandSettingsForm(
        name=stand.name,
        numbers=tuple(f"{getattr(stand, name):.12g}" for name in NUMBERS),
        pullbacks=_number_rows(stand.pullbacks_m, _MILLIMETRES),
        contacts=tuple((code, contact.name) for code, contact in stand.contacts.items()),
        added_masses=_number_rows(stand.added_masses_kg),
    )


def parse_stand_form(form: StandSettingsForm, base: Stand) -> Stand:
    """Stand of a form; what the form does not hold is as in `base`. Raises ConfigError."""
    numbers = {name: _number(text) for name, text in zip(NUMBERS, form.numbers, strict=True)}
    rows = (form.pullbacks, form.contacts, form.added_masses)
    pullbacks, contacts, added_masses = map(_by_code, _TABLES, rows)
    values: dict[str, Any] = {
        "name": form.name.strip(),
        **numbers,
        "pullbacks_m": {code: _number(text, _MILLIMETRES) for code, text in pullbacks.items()},
        "contacts": {code: {"name": text} for code, text in contacts.items()},
        "added_masses_kg": {code: _number(text) for code, text in added_masses.items()},
        "geometry": base.geometry,
    }
    return parse_stand(values)


def _number_rows(values: Mapping[str, float], scale: float = 1.0) -> Rows:
    return tuple((code, f"{scale * value:.12g}") for code, value in values.items())


def _number(text: str, scale: float = 1.0) -> float | str:
    """Number in SI of a text in `scale` per unit; a text that is no number stays, for the checks."""
    value = parse_number(text)
    return text if value is None or value != value else value / scale


def _by_code(name: str, rows: Rows) -> dict[str, str]:
    """Rows by code; those without any text are left out. Raises ConfigError where a code occurs twice."""
    values: dict[str, str] = {}
    for code, text in ((code.strip().upper(), text.strip()) for code, text in rows if (code + text).strip()):
        if code in values:
            raise ConfigError("{name}: code {code!r} is given twice", name=name, code=code)
        values[code] = text
    return values
