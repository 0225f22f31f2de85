"""Origin of results: what made them, of what, and a command that gives the same digits."""

import csv
import os
import re
import shlex
import shutil
from pathlib import Path
from typing import Any

import h5py
import pytest
from cli_kit import assert_one_error_line

from app.runs.analysis_request import AnalysisRequest
from app.runs.analyze import analyze_run
from app.version import __version__, commit


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory, short_runs: list[Path]) -> Path:
    """A copy of a simulated run under a name that a shell has to quote."""
    path = tmp_path_factory.mktemp("library") / "first run.h5"
    shutil.copy(short_runs[0], path)
    return path


@pytest.fixture
def run(simulated: Path, tmp_path: Path) -> Path:
    return Path(shutil.copy(simulated, tmp_path))


_WINDOWS = os.name == "nt"
_QUOTE = '"' if _WINDOWS else "'"


def _split_on_windows(command: str) -> list[str]:
    return [word.strip('"') for word in re.findall(r'"[^"]*"|\S+', command)]


def repeated(slipstand: Any, command: str, *more: object) -> Any:
    program, *words = _split_on_windows(command) if _WINDOWS else shlex.split(command)
    assert program == "slipstand"
    return slipstand(*words, *more)


@pytest.mark.parametrize(
    "options",
    [
        [],
        ["--model", "static+tilt", "--table-mass", "131.25", "--until", "4.1"],
        ["--kind", "one-mass", "--from", "3", "--added-mass", "0.3", "--added-mass-uncertainty", "0.1"],
    ],
    ids=str,
)
def test_a_result_names_its_origin_and_the_command_gives_the_same_digits(
    slipstand: Any, run: Path, options: list[str]
) -> None:
    (document,) = slipstand("analyze", run, *options, "--json").json
    origin = document["origin"]
    assert (origin["version"], origin["commit"]) == (__version__, commit() or None)
    assert origin["source"] == "simulated"
    assert origin["gravity_m_per_s2"] == 9.81
    assert origin["masses"]["table_mass_kg"] == (131.25 if "--table-mass" in options else 131.6)
    assert origin["calibrations"]["table"]["serial_number"] == "SIM-1"
    (again,) = repeated(slipstand, origin["reproduce"], "--json").json
    undated = {"date": ""}
    assert again | {"origin": again["origin"] | undated} == document | {"origin": origin | undated}


def test_requests_inputs_and_calibrations_are_told_apart(slipstand: Any, run: Path) -> None:
    def origin(*options: object) -> Any:
        (document,) = slipstand("analyze", run, *options, "--json").json
        return document["origin"]

    plain = origin("--model", "coulomb")
    assert plain["request_hash"] == origin("--model", "coulomb")["request_hash"]
    assert plain["request_hash"] != origin("--model", "static")["request_hash"]
    assert plain["inputs_hash"] == origin("--model", "static", "--until", 4)["inputs_hash"]
    assert plain["inputs_hash"] != origin("--model", "coulomb", "--plate-mass", 22.5)["inputs_hash"]
    identities = [gauge["identity"] for gauge in plain["calibrations"].values()]
    assert len(set(identities)) == 2


def test_a_kept_result_keeps_its_origin_and_follows_its_run(slipstand: Any, run: Path) -> None:
    (made,) = slipstand("analyze", run, "--model", "coulomb", "--save", "--json").json
    moved = run.rename(run.with_name("moved.h5"))
    (kept,) = slipstand("analyze", moved, "--model", "coulomb", "--save", "--json").json
    assert kept["origin"] == made["origin"] | {"reproduce": f"slipstand analyze {moved} --model coulomb"}
    with h5py.File(moved) as file:
        group = file["entry/analysis_001"]
        assert group["request_hash"].asstr()[()] == made["origin"]["request_hash"]
        assert group["reproduce"].asstr()[()] == made["origin"]["reproduce"]


def test_the_lines_of_a_simulated_result_say_so_and_name_its_origin(slipstand: Any, run: Path) -> None:
    said = slipstand("analyze", run, "--model", "coulomb").out
    assert said.splitlines()[1].startswith("  SIMULATED: ")
    assert f"program     slipstand {__version__}" in said
    assert "gauge 1     SIM-1 of 2026-01-12 (" in said
    assert f"reproduce   slipstand analyze {_QUOTE}{run}{_QUOTE} --model coulomb\n" in said


def test_results_of_samples_that_changed_since_are_not_served(slipstand: Any, run: Path) -> None:
    assert slipstand("analyze", run, "--model", "coulomb", "--save").code == 0
    with h5py.File(run, "r+") as file:
        file["entry/motion/table_displacement"][1000] += 1e-3
    for command in (["analyze", run, "--model", "coulomb", "--save"], ["table", run]):
        outcome = slipstand(*command)
        assert outcome.code == 1
        assert "table_displacement is not what was stored, by its checksum" in outcome.err
    (listed,) = slipstand("runs", run.parent, "--json").json
    assert "by its checksum" in listed["fault"]
    assert listed["friction_dynamic"] is None


def test_a_damaged_result_is_said_and_not_taken(slipstand: Any, run: Path) -> None:
    assert slipstand("analyze", run, "--model", "coulomb", "--save").code == 0
    with h5py.File(run, "r+") as file:
        text = file["entry/analysis_001/document"]
        text[()] = text[()].replace(b'"value":0.', b'"value":1.', 1)
    document = slipstand("table", run, "--json").json
    assert "result-damaged" in [warning["code"] for warning in document["warnings"]]
    assert document["rows"][0]["friction_dynamic"]["value"] == pytest.approx(0.1, abs=0.01)
    assert "a result is damaged" in slipstand("runs", run.parent).out


@pytest.mark.parametrize(
    ("part", "said"),
    [
        (["--from", "90"], "nothing is left from 90 s"),
        (["--until", "-1"], "nothing is left until -1 s"),
        (["--from", "90", "--until", "91"], "nothing is left from 90 to 91 s"),
    ],
)
def test_the_part_of_a_record_that_is_asked_for_has_to_be_there(
    slipstand: Any, run: Path, part: list[str], said: str
) -> None:
    assert_one_error_line(slipstand("analyze", run, *part), said)


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory, short_runs: list[Path]) -> Path:
    """A simulated run with a kept result, and one without."""
    folder = tmp_path_factory.mktemp("two runs")
    for run in short_runs:
        shutil.copy(run, folder)
    analyze_run(folder / short_runs[0].name, AnalysisRequest("coulomb"), save=True)
    return folder


def test_a_table_names_the_origin_of_every_result_and_its_command_gives_the_same_digits(
    slipstand: Any, campaign: Path
) -> None:
    excluded = sorted(campaign.iterdir())[1].name
    table = slipstand("table", campaign, "--exclude", f"{excluded}=plate was dirty", "--json").json
    origin = table["origin"]
    assert (origin["version"], origin["commit"]) == (__version__, commit() or None)
    (run,) = origin["runs"]
    assert (run["analysis"], run["request"], run["source"]) == (
        1, {"model": "coulomb", "kind": "two-mass"}, "simulated",
    )  # fmt: skip
    assert set(run["calibrations"].values()) == origin["calibrations"].keys()
    again = repeated(slipstand, origin["reproduce"], "--json").json
    assert again | {"origin": {}} == table | {"origin": {}}
    assert again["origin"]["inputs_hash"] == origin["inputs_hash"]


@pytest.mark.parametrize("name", ["text", "markdown", "latex", "csv"])
def test_a_table_of_simulated_runs_says_so(slipstand: Any, campaign: Path, name: str) -> None:
    said = slipstand("table", campaign, "--format", name).out
    assert "SIMULATED: 2 of 2 runs" in said or said.count("simulated") == 2
    plain = said.replace('""', '"').replace(r"\\", "\\")  # quotes of CSV, and backslashes of Markdown
    assert f"slipstand table {_QUOTE}{campaign}{_QUOTE}" in plain


def test_a_report_is_repeated_to_the_byte(slipstand: Any, campaign: Path, tmp_path: Path) -> None:
    path, again = tmp_path / "report.pdf", tmp_path / "again.pdf"
    head = ("--title", "On friction", "--laboratory", "Ours")
    origin = slipstand("report", campaign, "-o", path, *head, "--json").json["origin"]
    assert repeated(slipstand, origin["reproduce"].replace("REPORT.pdf", str(again))).code == 0
    assert again.read_bytes() == path.read_bytes()


def test_exported_coefficients_name_their_origin(slipstand: Any, run: Path, tmp_path: Path) -> None:
    slipstand("analyze", run, "--model", "coulomb", "--save")
    path = tmp_path / "found.csv"
    exported = slipstand("export", run, "--format", "csv", "--content", "coefficients", "-o", path)
    assert "SIMULATED" in exported.err
    with path.open(newline="", encoding="utf-8") as file:
        row = next(row for row in csv.DictReader(file) if row["quantity"] == "friction_dynamic")
    assert (row["source"], row["masses"]) == ("simulated", "m1 131.6 kg, m2 22.4 kg, g 9.81 m/s²")
    assert row["calibrations"].startswith("gauge 1 ")
    (again,) = repeated(slipstand, row["reproduce"], "--json").json
    assert again["results"]["friction_dynamic"]["value"] == float(row["value"])
    assert again["origin"]["inputs_hash"] == row["inputs_hash"]
