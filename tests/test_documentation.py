"""Pages that are made from the program agree with it, and the site builds without a warning."""

import gettext
import re
import subprocess
import sys
from pathlib import Path

import pytest

from messages.i18n import DOMAIN, LOCALE
from tools import reference_pages, translated_pages

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


@pytest.mark.parametrize("page", translated_pages.pages(), ids=lambda page: f"{page.parent.name}/{page.stem}")
def test_a_translated_page_is_as_new_as_its_source(page: Path) -> None:
    assert translated_pages.faults(page) == [], "then run python -m tools.translated_pages --revised"


@pytest.mark.parametrize("page", translated_pages.pages(), ids=lambda page: f"{page.parent.name}/{page.stem}")
def test_a_translated_page_has_the_code_rows_and_pictures_of_its_source(page: Path) -> None:
    source = (translated_pages.DOCS / translated_pages.SOURCES[page.name]).read_text("utf-8")
    text = page.read_text("utf-8")
    for pattern in (r"^```.*?^```", r"\]\(\.\./screenshots/[^)]*\)"):
        assert re.findall(pattern, text, re.M | re.S) == re.findall(pattern, source, re.M | re.S)
    for pattern in (r"`(slipstand [^`]*)`", r"^\|", r"^- ", r"\*\*(?:[A-Z]|Enter|Esc|Del|F2|Ctrl\+Z)\*\*"):
        assert len(re.findall(pattern, text, re.M)) == len(re.findall(pattern, source, re.M)), pattern


@pytest.mark.parametrize("page", translated_pages.pages(), ids=lambda page: f"{page.parent.name}/{page.stem}")
def test_a_translated_page_calls_screens_and_labels_as_the_translated_window_does(page: Path) -> None:
    catalogue = gettext.translation(DOMAIN, LOCALE, [page.parent.name])
    words = vars(catalogue)["_catalog"].values()
    text = re.sub(r"`[^`]*`", "", page.read_text("utf-8"))
    named = re.findall(r"\*\*([^*]+)\*\* (?:экран[иы]? )?\(Ctrl\+\d\)|\*\*([^*]+)\*\* ekrani \(Ctrl", text)
    labels = re.findall(r"(?<!\*)\*([^*|\n]{4,})\*(?!\*)", text)
    called = ["".join(one) for one in named] + labels
    assert called or page.stem == "first-test"
    assert [name for name in called if name not in words and f"{name}…" not in words] == []


def test_a_changed_section_of_a_source_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in (*translated_pages.SOURCES.values(), "ru/first-test.md"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text((translated_pages.DOCS / name).read_text("utf-8"), "utf-8")
    monkeypatch.setattr(translated_pages, "DOCS", tmp_path)
    page = tmp_path / "ru" / "first-test.md"
    assert translated_pages.faults(page) == []
    source = tmp_path / "tutorial" / "first-test.md"
    source.write_text(source.read_text("utf-8").replace("opens the window", "shows the window"), "utf-8")
    (fault,) = translated_pages.faults(page)
    assert "section 'In the window'" in fault
