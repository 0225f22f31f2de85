"""`slipstand demo`: wire, engine, run file and identification, compared with the truth."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from schema_kit import check

from app.cli.demo import _print_compared
from app.runs.reader import open_run
from tools import page_commands

pytestmark = pytest.mark.skipif(os.name != "posix", reason="the simulated stand needs a pseudo-terminal")


@pytest.fixture(scope="module")
def demonstrated(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """Folder and JSON of one `slipstand demo`, run as a user runs it."""
    folder = tmp_path_factory.mktemp("demo")
    command = [sys.executable, "-m", "app", "demo", "--json", "--directory", str(folder)]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    (folder.parent / "said.txt").write_text(result.stderr, "utf-8")
    document = json.loads(result.stdout)
    check("demo", document)
    return folder, document


def test_friction_is_within_one_per_cent_of_the_truth(demonstrated: tuple[Path, dict[str, Any]]) -> None:
    _, document = demonstrated
    found, true = document["results"], document["truth"]
    assert found["friction_dynamic"]["value"] == pytest.approx(true["friction_dynamic"], rel=0.01)
    assert found["period_s"]["value"] == pytest.approx(true["period_s"], rel=0.001)
    assert document["model"]["adequate"]


def test_every_sample_is_accounted_for(demonstrated: tuple[Path, dict[str, Any]]) -> None:
    _, document = demonstrated
    run = open_run(document["run"])
    assert document["quality"]["samples"] == len(run)
    assert document["quality"]["missing"] == document["quality"]["damaged"] == 0
    assert not run.status.any()


def test_the_run_holds_a_second_before_release_and_eight_after(
    demonstrated: tuple[Path, dict[str, Any]],
) -> None:
    _, document = demonstrated
    run = open_run(document["run"])
    release_s = document["events"]["release_s"]
    assert release_s == pytest.approx(1.0, abs=0.02)
    assert run.time_s[-1] - release_s == pytest.approx(8.0, abs=0.02)


def test_the_demo_leaves_run_and_figure_only(demonstrated: tuple[Path, dict[str, Any]]) -> None:
    folder, document = demonstrated
    assert {path.name for path in folder.iterdir()} == {
        Path(document["run"]).name,
        Path(document["figure"]).name,
    }


def test_the_tutorial_shows_what_the_demo_prints(
    demonstrated: tuple[Path, dict[str, Any]], capsys: pytest.CaptureFixture[str]
) -> None:
    folder, document = demonstrated
    said = (folder.parent / "said.txt").read_text("utf-8")
    _print_compared(document["results"], document["truth"])
    printed = said.splitlines() + capsys.readouterr().out.splitlines()
    shown = page_commands.shown_lines("slipstand demo")
    assert len(shown) > 12
    assert page_commands.faults(shown, printed, exactly=False) == [], "\n".join(printed)
