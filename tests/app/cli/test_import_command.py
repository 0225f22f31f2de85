"""`slipstand import`: a foreign record gives the run's own results; an invalid one, one clear line."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_kit import assert_one_error_line

from analysis.motion.two_mass import TwoMassParameters
from app.runs.exchange.content import ExportedRun, sample_columns
from app.runs.exchange.exporting import write_exported_run
from app.runs.reader import open_run
from config.files import published_row

GOOD = "t,u1,rel\n" + "".join(f"{n / 100},1,2\n" for n in range(60))
COLUMNS = ["--time", "t", "--table", "u1", "--relative", "rel"]


def foreign_record(folder: Path) -> Path:
    """A noisy pullback test as another program would write it: millimetres, semicolons, decimal commas."""
    row = published_row("1FFM0")
    parameters = TwoMassParameters.from_free_decay(
        period_s=row.period_s,
        damping_n1_per_s=row.damping_n1_per_s,
        table_mass_kg=131.6,
        plate_mass_kg=22.4,
        friction_dynamic=0.1,
        pullback_m=0.012,
    )
    time_s = np.arange(8000) / 1000.0
    table_m, relative_m = parameters.simulate(8.0).sample_displacements(time_s - 1.0)
    noise = np.random.default_rng(1).normal(0.0, 2e-5, (2, len(time_s)))
    path = folder / "foreign.csv"
    lines = [
        f"{t * 1e3 + 250:.1f};{1e3 * u:.9f};{1e3 * r:.9f};".replace(".", ",")
        for t, u, r in zip(time_s, table_m + noise[0], relative_m + noise[1], strict=True)
    ]
    path.write_text(
        "\ufeffmade by another program\nZeit ;Tisch; Platte;\n" + "\n".join(lines) + "\n", "utf-8"
    )
    return path


def test_a_foreign_record_gives_what_the_run_itself_gives(slipstand: Any, tmp_path: Path) -> None:
    csv = foreign_record(tmp_path)
    first, second, exported = tmp_path / "first.h5", tmp_path / "second.h5", tmp_path / "exported.csv"
    common = ["--series", "1FFM0", "-o"]
    german = ["--skip", 1, "--decimal", ",", "--time-unit", "ms", "--unit", "mm"]
    columns = ["--time", "Zeit", "--table", 1, "--relative", "Platte"]
    assert slipstand("import", csv, *columns, *german, *common, first).code == 0
    write_exported_run("csv", ExportedRun(open_run(first), None, sample_columns(open_run(first))), exported)
    columns = ["--time", 0, "--table", "table_displacement_m", "--relative", "relative_displacement_m"]
    assert slipstand("import", exported, *columns, *common, second).code == 0
    one, two = slipstand("analyze", first, second, "--json").json
    assert one["results"] == two["results"]
    assert one["results"]["friction_dynamic"]["value"] == pytest.approx(0.1, rel=0.003)
    assert one["quality"]["samples"] == 8000


@pytest.mark.parametrize(
    ("content", "arguments", "said"),
    [
        (GOOD, ["--time", "t", "--table", "nix"], "nix"),
        (GOOD, ["--time", "t", "--table", "7"], "7"),
        ("t,u1,rel\n0,1,2\n0.2,1,2\n0.1,1,2\n", COLUMNS, "line 4"),
        ("t,u1,rel\n0,1,2\n0.1,x,2\n", COLUMNS, "x"),
        ("t,u1,rel\n", COLUMNS, "bad.csv"),
        ("", COLUMNS, "bad.csv"),
        (GOOD, [*COLUMNS, "--gain", "0"], "--gain 0 cannot be"),
        (GOOD, [*COLUMNS, "--gain", "nan"], "--gain nan"),
        (GOOD, [*COLUMNS, "--gain", "1", "--offset", "inf"], "--offset inf cannot be"),
        (GOOD, [*COLUMNS, "--gain", "1", "--gain-uncertainty", "-1"], "--gain-uncertainty -1"),
        (GOOD, ["--time", "t", "--table", "t"], "column 't' is given for the time and gauge 1"),
        (GOOD, ["--time", "t", "--table", "u1", "--relative", "u1"], "'u1' is given for gauge 1 and gauge 2"),
        (GOOD, ["--time", "t", "--table", "u1", "--plate", "t"], "'t' is given for the time and gauge 2"),
        (GOOD, ["--time", "0", "--table", "t"], "'t' is given for the time and gauge 1"),
        (GOOD, [*COLUMNS, "--offset", "0.001"], "--offset 0.001 goes with --gain"),
        (GOOD, [*COLUMNS, "--skip", "-1"], "--skip -1"),
        (GOOD, [*COLUMNS, "--unit", "inch"], "'inch'"),
        (GOOD, [*COLUMNS, "--time-unit", "h"], "'h'"),
        (GOOD, [*COLUMNS, "--from", "5"], "5 s"),
        (GOOD, [*COLUMNS, "--plate", "rel"], "--relative and --plate"),
        (GOOD, [*COLUMNS, "--series", "4FFM0"], "4FFM0"),
        (GOOD, [*COLUMNS, "--plate-mass", "-1"], "--plate-mass -1"),
    ],
)
def test_a_wrong_record_is_one_line(
    slipstand: Any, tmp_path: Path, content: str, arguments: list[str], said: str
) -> None:
    csv, run = tmp_path / "bad.csv", tmp_path / "run.h5"
    csv.write_text(content)
    assert_one_error_line(slipstand("import", csv, *arguments, "-o", run), said)
    assert not run.exists()


def test_a_missing_file_is_one_line(slipstand: Any, tmp_path: Path) -> None:
    outcome = slipstand("import", tmp_path / "nix.csv", *COLUMNS, "-o", tmp_path / "run.h5")
    assert_one_error_line(outcome, "nix.csv")


def test_gain_not_stated_is_said_in_the_budget(slipstand: Any, tmp_path: Path) -> None:
    run = tmp_path / "run.h5"
    columns = ["--time", 0, "--table", 1, "--relative", 2, "--skip", 1, "--decimal", ","]
    slipstand("import", foreign_record(tmp_path), *columns, "--time-unit", "ms", "--unit", "mm", "-o", run)
    (document,) = slipstand("analyze", run, "--json").json
    assert "not stated" in json.dumps(document["budget"])


def test_masses_that_are_not_those_of_the_series_are_said(slipstand: Any, tmp_path: Path) -> None:
    csv, run = tmp_path / "good.csv", tmp_path / "run.h5"
    csv.write_text(GOOD)
    masses = ["--series", "1FFM1", "--plate-mass", "40", "--table-mass", "131.6", "--unit", "m"]
    outcome = slipstand("import", csv, *COLUMNS, *masses, "-o", run)
    assert outcome.code == 0
    assert outcome.err.splitlines() == [
        "note: the plate mass is 40 kg as given, not the 27.4 kg of series 1FFM1"
    ]
    assert open_run(run).metadata.plate_mass_kg == 40.0


def test_a_negative_gain_is_a_gauge_mounted_the_other_way(slipstand: Any, tmp_path: Path) -> None:
    csv, run = tmp_path / "good.csv", tmp_path / "run.h5"
    csv.write_text(GOOD)
    assert slipstand("import", csv, *COLUMNS, "--gain", "-0.001", "-o", run).code == 0
    plain = tmp_path / "plain.h5"
    assert slipstand("import", csv, *COLUMNS, "--gain", "0.001", "-o", plain).code == 0
    assert (open_run(run).table_reading == -open_run(plain).table_reading).all()
