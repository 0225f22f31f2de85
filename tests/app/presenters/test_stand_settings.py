"""Settings of the stand: checked as its file is, saved together, undone one by one."""

from dataclasses import replace
from pathlib import Path

import pytest

from app.presenters.base import Tone
from app.presenters.stand_settings import NUMBERS, StandSettingsForm, StandSettingsPresenter, stand_form
from config.files import load_stand
from config.schema import ConfigError, Contact, Stand

STAND = load_stand()


class Desk:
    def __init__(self) -> None:
        self.saved: list[Stand] = []
        self.applied: list[Stand] = []
        self.error = ""
        self.is_locked = False
        self.page = StandSettingsPresenter(STAND, self.save, self.applied.append, lambda: self.is_locked)

    def save(self, stand: Stand) -> Path:
        if self.error:
            raise ConfigError(self.error)
        self.saved.append(stand)
        return Path("/settings/stand.toml")

    @property
    def form(self) -> StandSettingsForm:
        return self.page.state.form

    def type(self, **changes: object) -> None:
        self.page.set_form(replace(self.form, **changes))  # type: ignore[arg-type]

    def type_number(self, name: str, text: str) -> None:
        number = list(NUMBERS).index(name)
        self.type(numbers=(*self.form.numbers[:number], text, *self.form.numbers[number + 1 :]))


@pytest.fixture
def desk() -> Desk:
    return Desk()


def test_the_form_holds_the_stand_with_pullbacks_in_millimetres(desk: Desk) -> None:
    assert desk.form.pullbacks == (("1", "12"), ("2", "9"), ("3", "6"))
    assert desk.form.contacts[0] == ("FF", "fluoroplastic on fluoroplastic")
    assert desk.form.added_masses[3] == ("M3", "20")
    assert desk.form.numbers[:2] == ("131.6", "0.3")


def test_a_form_that_nobody_changed_is_the_same_stand(desk: Desk) -> None:
    desk.page.save()
    assert desk.saved == [STAND]


def test_what_is_saved_reaches_the_window_and_the_file(desk: Desk) -> None:
    desk.type_number("plate_mass_kg", "22,5")
    desk.type(pullbacks=(("1", "12"), ("4", "4,5"), ("", "")), contacts=(("al", "aluminium "),))
    assert (desk.page.state.is_changed, desk.saved) == (True, [])
    desk.page.save()
    changed = STAND.replace(
        plate_mass_kg=22.5,
        pullbacks_m={"1": 0.012, "4": 0.0045},
        contacts={"AL": Contact("aluminium")},
    )
    assert desk.saved == desk.applied == [changed]
    assert (desk.form, desk.page.state.is_changed) == (stand_form(changed), False)
    assert desk.page.state.message.text == f"Saved in {Path('/settings/stand.toml')}"


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("table_mass_kg", "heavy", "Table_mass_kg = 'heavy': Expected `float`, got `str`"),
        ("table_mass_kg", "", "Table_mass_kg = '': Expected `float`, got `str`"),
        ("table_mass_kg", "-1", "Table_mass_kg = -1.0 must be a finite number above 0"),
        ("plate_mass_standard_uncertainty_kg", "-0.1", "= -0.1 must be a finite number, 0 or above"),
    ],
)
def test_a_number_that_cannot_be_is_explained_as_in_the_file(
    desk: Desk, name: str, text: str, said: str
) -> None:
    desk.type_number(name, text)
    desk.page.save()
    assert said.casefold() in desk.page.state.message.text.casefold()
    assert desk.page.state.message.tone is Tone.BAD
    assert desk.saved == desk.applied == []
    assert desk.page.state.is_changed, "what was typed stays"


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"pullbacks": (("1", "12"), ("1", "9"))}, "code '1' is given twice"),
        ({"pullbacks": (("12", "12"),)}, "code '12' makes no series code: write a digit, such as 1"),
        ({"contacts": (("F1", "x"),)}, "code 'F1' makes no series code: write capital letters"),
        ({"added_masses": (("5", "5"),)}, "code '5' makes no series code: write M and a number"),
        ({"added_masses": ()}, "is empty: a series needs one"),
        ({"pullbacks": (("1", "0"),)}, "pullbacks_m.1 = 0.0 must be a finite number above 0"),
    ],
)
def test_series_codes_that_cannot_be_are_refused(desk: Desk, changes: dict[str, object], said: str) -> None:
    desk.type(**changes)
    desk.page.save()
    assert said in desk.page.state.message.text
    assert desk.saved == []


def test_saves_are_undone_one_by_one(desk: Desk) -> None:
    for mass in ("23", "24"):
        desk.type_number("plate_mass_kg", mass)
        desk.page.save()
    assert desk.page.state.can_undo
    for plate_mass_kg in (23.0, 22.4):
        desk.page.undo()
        assert desk.applied[-1].plate_mass_kg == plate_mass_kg
    assert desk.saved[-1] == STAND
    assert not desk.page.state.can_undo
    desk.page.undo()
    assert len(desk.saved) == 4


def test_a_file_that_cannot_be_written_is_said_and_nothing_holds(desk: Desk) -> None:
    desk.error = "/settings/stand.toml: cannot be written (disk full). Check the folder"
    desk.type(name="another")
    desk.page.save()
    assert desk.page.state.message.text == desk.error
    assert (desk.applied, desk.page.state.can_undo, desk.page.state.is_changed) == ([], False, True)


def test_the_stand_stays_as_it_is_while_a_run_is_recorded(desk: Desk) -> None:
    desk.is_locked = True
    desk.type(name="another")
    desk.page.save()
    assert "A run is being recorded" in desk.page.state.message.text
    assert desk.saved == []


def test_what_was_typed_is_reset_to_what_is_stored(desk: Desk) -> None:
    desk.type(name="another")
    desk.page.reset()
    assert (desk.form, desk.page.state.is_changed) == (stand_form(STAND), False)
