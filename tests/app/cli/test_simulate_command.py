"""`slipstand simulate` against the golden motions, and in every form of output."""

import csv
import errno
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_kit import assert_one_error_line

from app.runs.reader import open_run

GOLDEN = json.loads((Path(__file__).parents[2] / "golden" / "two_mass.json").read_text())
OPTIONS = {
    "pullback_m": "--pullback",
    "table_mass_kg": "--table-mass",
    "plate_mass_kg": "--plate-mass",
    "stiffness_n_per_m": "--stiffness",
    "damping_coefficient_kg_per_s": "--damping",
    "friction_dynamic": "--friction",
    "friction_static": "--static-friction",
    "tilt_rad": "--tilt",
    "duration_s": "--duration",
}


@pytest.mark.parametrize("golden", GOLDEN, ids=lambda golden: str(golden["name"]))
def test_options_give_the_golden_motion(slipstand: Any, golden: dict[str, Any]) -> None:
    arguments = [word for key, option in OPTIONS.items() for word in (option, repr(golden[key]))]
    found = slipstand("simulate", *arguments, "--json").json
    assert found["phases"] == golden["phases"]
    assert found["slip_end_s"] == pytest.approx(golden["slip_end_s"], abs=1e-9)
    assert found["residual_displacement_m"] == pytest.approx(golden["residual_displacement_m"], abs=1e-9)


def test_a_series_brings_its_row_of_table_1(slipstand: Any) -> None:
    by_series = slipstand("simulate", "--series", "1FFM0", "--json").json
    assert by_series["stiffness_n_per_m"] == pytest.approx(GOLDEN[0]["stiffness_n_per_m"], rel=1e-12)
    assert by_series["residual_displacement_m"] == pytest.approx(
        GOLDEN[0]["residual_displacement_m"], abs=1e-9
    )


def test_an_option_overrides_what_the_series_brings(slipstand: Any) -> None:
    document = slipstand(
        "simulate", "--series", "1FFM0", "--stiffness", 60000, "--friction", 0.2, "--json"
    ).json
    assert document["stiffness_n_per_m"] == 60000
    assert document["parameters"]["friction_dynamic"] == 0.2


def test_csv_holds_the_motion(slipstand: Any, tmp_path: Path) -> None:
    path = tmp_path / "motion.csv"
    assert slipstand("simulate", "--series", "1FFM0", "--rate", 100, "-o", path).code == 0
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == [
        "time_s",
        "table_displacement_m",
        "relative_displacement_m",
        "table_velocity_m_per_s",
        "plate_velocity_m_per_s",
        "table_acceleration_m_per_s2",
        "plate_acceleration_m_per_s2",
        "phase",
    ]
    assert len(rows) == 1001
    for time_s, table_m, relative_m in zip(
        GOLDEN[0]["sample_times_s"],
        GOLDEN[0]["table_displacement_m"],
        GOLDEN[0]["relative_displacement_m"],
        strict=True,
    ):
        row = rows[round(time_s * 100)]
        assert float(row["table_displacement_m"]) == pytest.approx(table_m, abs=1e-12)
        assert float(row["relative_displacement_m"]) == pytest.approx(relative_m, abs=1e-12)


def test_a_simulated_run_is_identified_as_what_it_is(slipstand: Any, tmp_path: Path) -> None:
    path = tmp_path / "motion.h5"
    assert slipstand("simulate", "--series", "2SSM1", "--tilt", 0.001, "-o", path).code == 0
    (found,) = slipstand("analyze", path, "--json").json
    assert found["results"]["friction_dynamic"]["value"] == pytest.approx(0.15, rel=1e-4)
    assert found["results"]["tilt_rad"]["value"] == pytest.approx(0.001, rel=1e-2)
    assert found["model"]["name"] == "coulomb+tilt"
    assert found["model"]["adequate"]


def test_the_papers_method_differs_by_its_step(slipstand: Any) -> None:
    exact = slipstand("simulate", "--series", "1FFM0", "--json").json
    paper = slipstand("simulate", "--series", "1FFM0", "--method", "paper", "--json").json
    difference = abs(exact["residual_displacement_m"] - paper["residual_displacement_m"])
    assert 1e-6 < difference < 1e-4


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--series", "9FFM0"], "'9FFM0'"),
        (["--pullback", "0.012"], "--table-mass"),
        (["--series", "1FFM0", "--friction", "nan"], "--friction nan"),
        (["--series", "1FFM0", "--friction", "-0.1"], "--friction -0.1"),
        (["--series", "1FFM0", "--plate-mass", "0"], "--plate-mass 0"),
        (["--series", "1FFM0", "--rate", "0"], "--rate 0"),
        (["--series", "1FFM0", "--duration", "inf"], "--duration inf"),
        (["--series", "1FFM0", "--period", "0"], "--period 0"),
        (["--series", "1FFM0", "--period", "0.3", "--stiffness", "6e4"], "--period and --stiffness"),
        (["--series", "1FFM0", "--static-friction", "0.05"], "friction_static is 0.05"),
        (["--series", "1FFM0", "--method", "euler"], "'euler'"),
        (["--series", "1FFM0", "--method", "paper", "--step", "10"], "--step 10"),
        (["--series", "1FFM0", "--tilt", "nan"], "--tilt nan"),
        (["--series", "1FFM0", "--n1", "-0.1"], "--n1 -0.1"),
        (["--series", "1FFM0", "--pullback", "inf"], "--pullback inf"),
        (["--series", "1FFM0", "--pullback", "-1"], "--pullback -1 m is farther than stands are pulled back"),
        (["--series", "1FFM0", "--pullback", "12"], "Give metres, -0.1 to 0.1"),
        (["--series", "1FFM0", "--pullback", "0", "-o", "still.h5"], "--pullback 0 makes no run"),
        (["--series", "1FFM0", "--static-friction", "nan"], "--static-friction nan"),
        (["--series", "1FFM0", "-o", "motion.xls"], ".csv or .h5"),
    ],
)
def test_bad_input_is_one_line(slipstand: Any, arguments: list[str], said: str) -> None:
    assert_one_error_line(slipstand("simulate", *arguments), said)


def test_a_pullback_to_the_other_side_makes_a_run_too(slipstand: Any, tmp_path: Path) -> None:
    ways = {}
    for pullback in (0.01, -0.01):
        path = tmp_path / f"{pullback}.h5"
        given = ("simulate", "--series", "1FFM0", "--pullback", pullback, "-o", path, "--json")
        ways[pullback] = slipstand(*given).json["residual_displacement_m"], open_run(path)

    assert ways[-0.01][0] == pytest.approx(-ways[0.01][0])
    run = ways[-0.01][1]
    assert run.metadata.pullback_m == 0.01, "the series' nominal size, as of a recorded run"
    assert run.metadata.truth["pullback_m"] == -0.01
    assert run.table_reading[0] == pytest.approx(-0.01, rel=1e-3)


def test_nothing_is_overwritten_without_force(slipstand: Any, tmp_path: Path) -> None:
    path = tmp_path / "motion.csv"
    path.write_text("precious")
    assert_one_error_line(slipstand("simulate", "--series", "1FFM0", "-o", path), "exists already")
    assert path.read_text() == "precious"
    assert slipstand("simulate", "--series", "1FFM0", "-o", path, "--force").code == 0
    assert path.read_text() != "precious"


def test_wrong_usage_ends_with_2(slipstand: Any) -> None:
    assert slipstand("simulate", "--no-such-option").code == 2


def test_an_output_that_cannot_be_written_leaves_the_file_that_was_there(
    slipstand: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "out.csv"
    target.write_text("from before")

    def full(*_: Any, **__: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("numpy.savetxt", full)
    said = slipstand("simulate", "--series", "1FFM0", "--duration", 1, "-o", target, "--force")
    assert_one_error_line(said, "full")
    assert target.read_text() == "from before"
    assert list(tmp_path.iterdir()) == [target]


def test_an_output_run_that_cannot_be_written_leaves_the_run_that_was_there(
    slipstand: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "out.h5"
    arguments = ("simulate", "--series", "1FFM0", "--duration", 1, "-o", target)
    assert slipstand(*arguments).code == 0
    before = target.read_bytes()

    def full(*_: Any, **__: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("app.runs.writer.create_run", full)
    assert slipstand(*arguments, "--force").code == 1
    assert target.read_bytes() == before


def test_a_folder_is_no_output_file(slipstand: Any, tmp_path: Path) -> None:
    (tmp_path / "out.csv").mkdir()
    said = slipstand("simulate", "--series", "1FFM0", "-o", tmp_path / "out.csv", "--force")
    assert_one_error_line(said, "is a folder")


def test_a_stand_that_is_not_ideal_is_stored_with_its_truth(slipstand: Any, tmp_path: Path) -> None:
    path = tmp_path / "real.h5"
    effects = ("--effect", "release-ramp=0.01", "--effect", "gauge-2-lag=0.002")
    outcome = slipstand("simulate", "--series", "1FFM0", "--duration", 3, *effects, "-o", path, "--json")
    assert outcome.json["parameters"]["release_ramp_s"] == 0.01
    run = open_run(path)
    assert run.metadata.truth["release_ramp_s"] == 0.01
    assert run.metadata.truth["gauge_2_lag_s"] == 0.002
    ideal = tmp_path / "ideal.h5"
    slipstand("simulate", "--series", "1FFM0", "--duration", 3, *effects[:2], "-o", ideal)
    np.testing.assert_allclose(run.relative_reading[2:], open_run(ideal).relative_reading[:-2], atol=1e-12)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (("--effect", "film"), "--effect 'film' must be KEY=VALUE, for example --effect release-ramp=0.01"),
        (("--effect", "film=1", "--method", "paper"), "--effect needs --method exact"),
        (("--effect", "cross-talk=0.01"), "--effect cross-talk changes readings, which only a run holds"),
        (("--effect", "film=99"), "effect film = 99 s/m is out of range: give -5 to 20"),
    ],
)
def test_an_effect_that_cannot_be_is_refused(slipstand: Any, given: Any, said: str) -> None:
    assert_one_error_line(slipstand("simulate", "--series", "1FFM0", *given), said)


@pytest.mark.parametrize("more", [["--duration", "100"], ["--rate", "20000"], ["--method", "paper"]])
def test_a_long_one_is_compiled_whatever_the_order_of_its_arguments(more: list[str]) -> None:
    code = (
        "import sys; from analysis import compiled; from app.__main__ import main\n"
        "compiled.interpret = lambda: print('interpreted', file=sys.stderr)\n"
        "import app.cli.simulate as command\ncommand.interpret = compiled.interpret\n"
        "import app.cli.simulation as work\nwork.simulate_test = lambda options: None\nmain()"
    )
    for arguments in ([*more, "--series", "1FFM0"], ["--series", "1FFM0"]):
        command = [sys.executable, "-c", code, "simulate", *arguments]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        assert done.stderr.split() == ([] if more[0] in arguments else ["interpreted"])


@pytest.mark.parametrize("more", [[], ["--duration", "5"], ["--static-friction", "0.2", "--tilt", "0.01"]])
def test_a_brief_one_is_the_same_without_compiled_code(slipstand: Any, more: list[str]) -> None:
    """What it prints is that of compiled code, and numba is not even imported.

    To the last digit, but on Windows, whose sine and exponential function are not those of the compiler.
    """
    arguments = ["simulate", "--series", "1FFM0", "--friction", "0.12", *more, "--json"]
    code = (
        "import sys; from app.__main__ import main\ntry: main()\n"
        "finally: print('numba' in sys.modules, file=sys.stderr)"
    )
    command = [sys.executable, "-c", code, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stderr.split() == ["False"]
    found, compiled = json.loads(done.stdout), slipstand(*arguments).json
    assert found.pop("parameters") == compiled.pop("parameters")
    assert found == (pytest.approx(compiled, rel=1e-12) if os.name == "nt" else compiled)
