"""Versions, licences, documentation and log."""

from pathlib import Path

import pytest

from app.log import FOLDER_VARIABLE
from app.presenters import about
from app.version import version_text


def test_the_program_and_every_library_state_a_licence() -> None:
    ours, python, *libraries = about.components()
    assert (ours.version, ours.licence) == (version_text(), "MIT")
    assert python.name == "Python"
    stated = {part.name: part.licence for part in libraries}
    assert "LGPL-3.0" in stated["PySide6-Essentials"]
    assert {"numpy", "h5py", "typst"} <= stated.keys()
    assert [name for name, licence in stated.items() if not licence or "\n" in licence] == []
    assert "nexusformat" not in stated, "of extras only those who chose them have them"


def test_versions_are_copied_in_lines() -> None:
    lines = about.versions_text().splitlines()
    assert lines[0] == f"Slipstand {version_text()}"
    assert len(lines) == len(about.components()) + 1


def test_the_documentation_is_that_of_the_checkout_else_of_the_package(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert Path(about.documentation()).read_text(encoding="utf-8").startswith("# Documentation")
    monkeypatch.setattr(about, "is_checkout", lambda: False)
    assert about.documentation() == "", "the package states no address"
    monkeypatch.setattr(about, "PACKAGE", "numpy")
    assert about.documentation().startswith("https://")


def test_the_log_is_that_of_the_window(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path))
    assert about.log_file() == tmp_path / "window.log"
