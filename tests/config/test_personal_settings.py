"""Personal settings and window geometry: stored, explained when invalid, never overwritten."""

import datetime
from pathlib import Path

import pytest

from config.files import (
    load_recent,
    load_settings,
    load_window_layout,
    save_recent,
    save_settings,
    save_window_layout,
)
from config.schema import ConfigError, RecentDevice, RecentUse, Settings, WindowLayout

DAY = datetime.date(2026, 1, 12)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("SLIPSTAND_CONFIG", str(tmp_path / "settings"))
    return tmp_path / "settings"


def test_without_a_file_the_defaults_hold_and_nothing_is_written(folder: Path) -> None:
    assert load_settings() == Settings()
    assert load_window_layout() == WindowLayout()
    assert not folder.exists()


def test_what_is_kept_comes_back() -> None:
    chosen = Settings("dark", "ru", 1.5, "/data/runs", "Анна", sounds=True)
    widths, sorted_by = {"runs": (184, 140), "identify": (900, 380)}, {"runs": (3, True)}
    columns = {"runs": ("DATE", "FRICTION"), "campaign": ("series",)}
    place = WindowLayout(10, -20, 1280, 800, False, "runs", widths, sorted_by, columns)
    assert save_settings(chosen, DAY) is None
    assert save_window_layout(place, DAY) is None
    assert load_settings() == chosen
    assert load_window_layout() == place


@pytest.mark.parametrize("device", [None, RecentDevice("GSV-8", "COM7", "gsv", stop_bits="2")])
def test_what_was_used_last_comes_back(device: RecentDevice | None) -> None:
    assert load_recent() == RecentUse()
    recent = RecentUse(device, ("/runs/ä.h5", "C:\\runs\\b.h5"), ("/runs",), "/tables", "/logger")
    assert save_recent(RecentUse(runs=("/old.h5",)), DAY) is None
    assert save_recent(recent, DAY) is None
    assert load_recent() == recent


@pytest.mark.parametrize(
    "rubbish",
    [
        "x = 99999999999",
        "[widths]\nruns = [100, -2147483649]",
        '[widths]\nruns = "wide"',
        "[sorted_by]\nruns = [1]",
        '[sorted_by]\nruns = ["date", true]',
        "[columns]\nruns = [1, 2]",
    ],
)
def test_a_place_that_no_window_can_have_is_refused_and_put_aside_later(folder: Path, rubbish: str) -> None:
    folder.mkdir()
    (folder / "window.toml").write_text(rubbish, encoding="utf-8")
    with pytest.raises(ConfigError, match=r"window\.toml"):
        load_window_layout()
    aside = save_window_layout(WindowLayout(screen="runs"), DAY)
    assert aside == folder / "window-unreadable-2026-01-12.toml"
    assert aside.read_text(encoding="utf-8") == rubbish
    assert load_window_layout().screen == "runs"


def test_comments_of_the_file_stay(folder: Path) -> None:
    folder.mkdir()
    (folder / "settings.toml").write_text('# ours\ntheme = "dark"  # less glare\n', encoding="utf-8")
    save_settings(Settings("light"), DAY)
    written = (folder / "settings.toml").read_text(encoding="utf-8")
    assert "# ours" in written
    assert "less glare" in written
    assert load_settings().theme == "light"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('theme = "pink"', r"theme = 'pink'"),
        ("theme = ", "not valid TOML"),
        ("scale = 9.0", r"scale = 9\.0 must be from 1 to 2"),
        ("colour = 1", "colour"),
    ],
)
def test_a_wrong_file_is_explained_and_put_aside_before_another_is_written(
    folder: Path, text: str, said: str
) -> None:
    folder.mkdir()
    wrong = folder / "settings.toml"
    for number in (1, 2):
        wrong.write_text(text, encoding="utf-8")
        with pytest.raises(ConfigError, match=said) as fault:
            load_settings()
        assert "\n" not in str(fault.value)
        aside = save_settings(Settings("dark"), DAY)
        assert aside == folder / f"settings-unreadable-2026-01-12{'' if number == 1 else '-2'}.toml"
        assert aside.read_text(encoding="utf-8") == text
        assert load_settings() == Settings("dark")


def test_a_folder_that_cannot_be_written_is_said(folder: Path) -> None:
    folder.write_text("in the way")
    with pytest.raises(ConfigError, match="cannot be written"):
        save_settings(Settings(), DAY)
