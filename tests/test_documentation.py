"""Pages that are made from the program agree with it, and the site builds without a warning."""

import subprocess
import sys
from pathlib import Path

from tools import reference_pages

ROOT = Path(__file__).resolve().parents[1]


def test_the_pages_of_options_and_settings_are_those_of_the_program(monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    remedy = "run python -m tools.reference_pages"
    assert reference_pages.OPTIONS.read_text("utf-8") == reference_pages.options_page(), remedy
    assert reference_pages.CONFIGURATION.read_text("utf-8") == reference_pages.configuration_page(), remedy


def test_every_option_and_key_has_a_word() -> None:
    pages = reference_pages.options_page() + reference_pages.configuration_page()
    rows = [line.split(" | ") for line in pages.splitlines() if line.startswith("| `")]
    assert [row[0] for row in rows if not row[-1].strip(" |")] == []


def test_the_site_builds_without_a_warning(tmp_path) -> None:
    """Its links lead somewhere, and its API has docstrings."""
    command = [
        sys.executable,
        "-m",
        "sphinx",
        "-q",
        "-W",
        "--keep-going",
        "-b",
        "html",
        "-d",
        tmp_path / "trees",
    ]
    built = subprocess.run(
        [*command, ROOT / "docs", tmp_path / "html"], capture_output=True, text=True, check=False
    )
    assert built.returncode == 0, built.stderr
    assert "friction" in (tmp_path / "html" / "searchindex.js").read_text("utf-8")
    assert (tmp_path / "html" / "reference" / "api.html").read_text("utf-8").count("slipstand.Result") > 1
