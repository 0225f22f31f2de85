"""The recordings folder: from the environment, else from the personal settings."""

import datetime
from pathlib import Path

import pytest

from app.runs.paths import recordings_directory
from config.files import save_settings
from config.schema import ConfigError, Settings


def test_the_settings_say_where_runs_go(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SLIPSTAND_CONFIG", str(tmp_path))
    monkeypatch.delenv("SLIPSTAND_RECORDINGS", raising=False)
    usual = recordings_directory()
    save_settings(Settings(recordings=str(tmp_path / "runs")), datetime.date(2026, 1, 12))
    assert recordings_directory() == tmp_path / "runs"
    assert recordings_directory(Settings()) == usual, "given settings are not read again"
    monkeypatch.setenv("SLIPSTAND_RECORDINGS", str(tmp_path / "other"))
    assert recordings_directory() == tmp_path / "other"


def test_settings_that_cannot_be_read_do_not_send_runs_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLIPSTAND_CONFIG", str(tmp_path))
    monkeypatch.delenv("SLIPSTAND_RECORDINGS", raising=False)
    (tmp_path / "settings.toml").write_text("recordings = 3")
    with pytest.raises(ConfigError, match="recordings = 3"):
        recordings_directory()
