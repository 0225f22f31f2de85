"""The Settings presenter: changes are stored at once, can be undone, or are refused with a reason."""

from pathlib import Path

import pytest

from app.presenters.base import EMPTY_CHIP, Tone
from app.presenters.settings_screen import PersonalSettings, SettingsPresenter
from config.schema import ConfigError, Settings


class FakeStore:
    def __init__(self) -> None:
        self.saved: list[Settings] = []
        self.aside: Path | None = None
        self.error = ""

    def save(self, settings: Settings) -> Path | None:
        if self.error:
            raise ConfigError(self.error)
        self.saved.append(settings)
        return self.aside


class Page:
    def __init__(self) -> None:
        self.store = FakeStore()
        self.applied: list[Settings] = []
        self.presenter = SettingsPresenter(PersonalSettings(save=self.store.save), self.applied.append)


@pytest.fixture
def page() -> Page:
    return Page()


def test_a_change_holds_and_is_kept_at_once(page: Page) -> None:
    page.presenter.change(theme="dark")
    page.presenter.change(theme="dark")
    assert page.store.saved == page.applied == [Settings("dark")]
    assert not page.presenter.state.needs_restart


def test_changes_are_taken_back_one_by_one(page: Page) -> None:
    page.presenter.change(operator="A")
    page.presenter.change(operator="B", sounds=True)
    assert page.presenter.state.can_undo
    page.presenter.undo()
    assert page.presenter.state.settings == Settings(operator="A")
    page.presenter.undo()
    page.presenter.undo()
    assert page.presenter.state.settings == page.store.saved[-1] == page.applied[-1] == Settings()
    assert not page.presenter.state.can_undo


def test_what_holds_from_the_next_start_on_is_said_as_long_as_it_differs(page: Page) -> None:
    page.presenter.change(scale=1.5)
    assert page.presenter.state.needs_restart
    page.presenter.change(scale=1.0)
    assert not page.presenter.state.needs_restart


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"scale": 3.0}, "Scale = 3.0 must be from 1 to 2"),
        ({"recordings": "runs"}, "Folder runs is no full path"),
        ({"recordings": __file__}, "is a file: choose a folder"),
    ],
)
def test_what_cannot_be_is_said_and_changes_nothing(
    page: Page, changes: dict[str, object], said: str
) -> None:
    page.presenter.change(**changes)
    message = page.presenter.state.message
    assert said in message.text
    assert message.tone is Tone.BAD
    assert page.store.saved == page.applied == []
    page.presenter.change(operator="A")
    assert page.presenter.state.message == EMPTY_CHIP


def test_a_file_put_aside_or_not_written_is_said(page: Page) -> None:
    page.store.aside = Path("/x/settings-unreadable-2026-01-12.toml")
    page.presenter.change(theme="dark")
    assert "kept as settings-unreadable-2026-01-12.toml" in page.presenter.state.message.text
    page.store.error = "/x/settings.toml: cannot be written (disk full). Check the folder"
    page.presenter.change(theme="light")
    assert page.presenter.state.message.text == page.store.error
    assert page.applied[-1].theme == "light", "it still holds for now"
