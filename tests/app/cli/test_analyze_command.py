"""`slipstand analyze` and `runs`: many runs, saved results, records that cannot be identified."""

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_kit import assert_one_error_line

from app.cli.analysis_text import print_analysis
from app.cli.measurement_options import MotionOptions, SimulateOptions
from app.cli.simulate import simulate
from app.runs.reader import open_run

SCHEMA_KEYS = {
    "origin",
    "schema",
    "run",
    "series",
    "kind",
    "results",
    "model",
    "plate",
    "budget",
    "events",
    "warnings",
    "quality",
    "classical",
}


@pytest.fixture(scope="module")
def simulated_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of a simulated test."""
    path = tmp_path_factory.mktemp("runs") / "good.h5"
    simulate(SimulateOptions(motion=MotionOptions(series="1FFM0"), output=path, rate=500.0))
    return path


def imported(
    slipstand: Any, folder: Path, table_mm: np.ndarray[Any, Any], time_s: np.ndarray[Any, Any]
) -> Path:
    """A run made of readings of one gauge."""
    csv, run = folder / "record.csv", folder / "record.h5"
    np.savetxt(csv, np.column_stack([time_s, table_mm, 0 * table_mm]), delimiter=",")
    columns = ["--time", 0, "--table", 1, "--relative", 2, "--no-header", "--unit", "mm"]
    assert slipstand("import", csv, *columns, "-o", run, "--force").code == 0
    return run


def test_json_is_what_interface_says(slipstand: Any, simulated_run: Path) -> None:
    (document,) = slipstand("analyze", simulated_run, "--json").json
    assert set(document) == SCHEMA_KEYS
    assert document["schema"] == "slipstand-analysis/1"
    assert Path(document["run"]).is_absolute()
    assert document["events"]["release_s"] == pytest.approx(1.0, abs=1e-4)
    friction = document["results"]["friction_dynamic"]
    assert set(friction) == {
        "value", "standard_uncertainty", "interval_95", "unit", "expanded_uncertainty", "coverage_factor",
    }  # fmt: skip
    assert friction["coverage_factor"] == 2.0
    assert friction["expanded_uncertainty"] == 2.0 * friction["standard_uncertainty"]
    assert friction["interval_95"][0] < friction["value"] < friction["interval_95"][1]


def test_json_holds_friction_slip_by_slip(slipstand: Any, simulated_run: Path) -> None:
    (document,) = slipstand("analyze", simulated_run, "--json").json
    mean = document["results"]["friction_dynamic_plate"]["value"]
    slips = document["plate"]["slips"]
    assert len(slips) > 5
    assert all(slip["friction"] == pytest.approx(mean, rel=0.02) for slip in slips)
    assert set(document["plate"]["variation"]) == {"sliding velocity", "position", "slid path"}


def test_a_simulated_clock_is_exact(slipstand: Any, simulated_run: Path) -> None:
    (document,) = slipstand("analyze", simulated_run, "--json").json
    assert "clock-not-timed" not in [warning["code"] for warning in document["warnings"]]


def test_many_values_of_friction_are_counted(
    slipstand: Any, simulated_run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A residual displacement of nothing allows 541 of them."""
    (document,) = slipstand("analyze", simulated_run, "--json").json
    document["classical"]["friction_of_residual"] = np.linspace(0.03, 0.3, 541).tolist()
    print_analysis(document)
    assert "u_s allows    541 values of f_d from 0.0300 to 0.3000" in capsys.readouterr().out


def test_a_run_that_fails_does_not_stop_the_rest(slipstand: Any, simulated_run: Path, tmp_path: Path) -> None:
    text = tmp_path / "text.h5"
    text.write_text("not a run")
    outcome = slipstand("analyze", text, simulated_run, tmp_path / "nix.h5", "--json")
    assert outcome.code == 1
    first, second, third = outcome.json
    assert set(first) == set(third) == {"run", "error"}
    assert "not an HDF5 file" in first["error"]
    assert second["kind"] == "two-mass"
    assert len([line for line in outcome.err.splitlines() if line.startswith("error: ")]) == 2


def test_saved_results_stand_beside_earlier_ones(slipstand: Any, simulated_run: Path) -> None:
    samples = open_run(simulated_run).table_reading.copy()
    assert slipstand("analyze", simulated_run, "--save", "--model", "coulomb").code == 0
    assert slipstand("analyze", simulated_run, "--save", "--model", "static", "--plate-mass", 23).code == 0
    run = open_run(simulated_run)
    assert [saved.settings["plate_mass_kg"] for saved in run.analyses] == [None, 23.0]
    assert np.array_equal(run.table_reading, samples)
    (listed,) = slipstand("runs", simulated_run.parent, "--json").json
    assert listed["analyses"] == 2
    assert listed["friction_dynamic"] == pytest.approx(0.1, rel=0.01)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two runs without results, one of them in a folder below."""
    for name in ("first.h5", "below/second.h5"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        simulate(SimulateOptions(motion=MotionOptions(series="1FFM0"), output=tmp_path / name, rate=200.0))
    return tmp_path


def analysed(outcome: Any) -> list[str]:
    """Names of the runs of which results were printed as JSON."""
    assert outcome.code == 0
    return [Path(document["run"]).name for document in outcome.json]


def test_only_new_runs_are_analysed(slipstand: Any, folder: Path) -> None:
    again = ("analyze", folder, "--save", "--only-new", "--model", "coulomb", "--json")
    assert analysed(slipstand(*again)) == ["second.h5", "first.h5"]

    outcome = slipstand(*again)
    assert analysed(outcome) == []
    assert outcome.err == "2 of 2 runs are up to date\n"

    shutil.copy(folder / "first.h5", folder / "third.h5")
    slipstand("edit", folder / "first.h5", "--plate-mass", 23)
    assert analysed(slipstand(*again)) == ["first.h5"]
    other = (*again[:-2], "static", "--json")
    assert analysed(slipstand(*other)) == ["second.h5", "first.h5", "third.h5"]
    assert analysed(slipstand("analyze", folder / "first.h5", *again[2:])) == ["first.h5"]


def test_only_new_runs_without_any_print_nothing(slipstand: Any, folder: Path) -> None:
    assert slipstand("analyze", folder, "--save", "--model", "coulomb").code == 0
    outcome = slipstand("analyze", folder, "--save", "--only-new", "--model", "coulomb")
    assert (outcome.code, outcome.out) == (0, "")


@pytest.mark.parametrize("other", [("--anew",), ("--added-mass", 1, "--kind", "one-mass")])
def test_only_new_is_refused_with_what_needs_all_runs(
    slipstand: Any, folder: Path, other: tuple[object, ...]
) -> None:
    assert_one_error_line(slipstand("analyze", folder, "--save", "--only-new", *other), str(other[0]))


def test_the_figure_is_drawn(slipstand: Any, simulated_run: Path, tmp_path: Path) -> None:
    figure = tmp_path / "figure.png"
    assert slipstand("analyze", simulated_run, "--figure", figure).code == 0
    assert figure.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("readings", [3000, 50], ids=["rest", "as few as a record may have"])
def test_a_record_without_release_is_one_line(slipstand: Any, tmp_path: Path, readings: int) -> None:
    table_mm = 0.002 * np.random.default_rng(0).normal(size=readings)
    run = imported(slipstand, tmp_path, table_mm, np.arange(readings) / 500)
    assert_one_error_line(slipstand("analyze", run), "record.h5")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [(["--model", "nope"], "'nope'"), (["--plate-mass", "0"], "--plate-mass 0")],
)
def test_bad_options_are_one_line(
    slipstand: Any, simulated_run: Path, arguments: list[str], said: str
) -> None:
    assert_one_error_line(slipstand("analyze", simulated_run, *arguments), said)


def test_runs_says_what_to_do_where_there_are_none(slipstand: Any, tmp_path: Path) -> None:
    assert "slipstand demo" in slipstand("runs", tmp_path).out
    assert slipstand("runs", tmp_path, "--json").json == []
    assert_one_error_line(slipstand("runs", tmp_path / "nix"), "nix")
    assert_one_error_line(slipstand("runs", tmp_path, "--since", "yesterday"), "'yesterday'")
    assert_one_error_line(slipstand("runs", tmp_path, "--series", "9XX"), "'9XX'")
