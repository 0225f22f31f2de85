"""The commit that a program was made of, as it is known in a checkout and without one."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from app import version

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def module(tmp_path, monkeypatch) -> Path:
    """A copy of the module outside the checkout, which the functions take for their own."""
    folder = tmp_path / "app"
    folder.mkdir()
    monkeypatch.setattr(version, "__file__", str(folder / "version.py"))
    monkeypatch.setattr(version, "_of_installation", lambda: "")
    version.commit.cache_clear()
    yield folder
    version.commit.cache_clear()


@pytest.mark.parametrize(
    ("text", "commit", "shown"),
    [
        ("$Format:%H$\n", "", version.__version__),
        (f"{'0123456789abcdef' * 3}\n", "0123456789ab", f"{version.__version__} (0123456789ab)"),
        ("0123456789ab-dirty\n", "0123456789ab-dirty", f"{version.__version__} (0123456789ab-dirty)"),
    ],
)
def test_the_commit_is_that_of_the_package_or_archive(module, text, commit, shown):
    (module / "commit.txt").write_text(text, "utf-8")
    assert (version.commit(), version.version_text()) == (commit, shown)


def test_a_program_of_unknown_commit_shows_its_version(module):
    assert (version.commit(), version.version_text()) == ("", version.__version__)


def test_the_option_shows_version_and_commit():
    done = subprocess.run(
        [sys.executable, "-m", "app", "--version"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout == f"slipstand {version.version_text()}\n"


@pytest.mark.skipif(shutil.which("git") is None, reason="git is not installed")
def test_an_archive_of_the_sources_states_its_commit():
    archived = subprocess.run(
        ["git", "-C", str(ROOT), "check-attr", "export-subst", "app/commit.txt"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if archived.returncode:
        pytest.skip("no checkout of git")
    assert archived.stdout.endswith(": set\n")
    assert (ROOT / "app" / "commit.txt").read_text("utf-8") == "$Format:%H$\n"
