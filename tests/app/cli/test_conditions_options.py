"""Conditions given to `import`, and shown by `runs`."""

from pathlib import Path
from typing import Any

import pytest
from cli_kit import assert_one_error_line

from app.runs.metadata import Conditions
from app.runs.reader import open_run

GIVEN = ["--temperature", "-3.5", "--humidity", "30", "--plate-id", "P-1", "--contact-id", "C-7",
         "--surface", "acetone", "--run-in", "12", "--condition", "weather=dry"]  # fmt: skip


def importing(folder: Path, *more: str) -> list[str]:
    table = folder / "record.csv"
    table.write_text("t,u\n" + "\n".join(f"{i / 100},{i % 7}" for i in range(50)))
    columns = ["--time", "t", "--table", "u", "--unit", "mm"]
    return ["import", str(table), *columns, "-o", str(folder / "run.h5"), *more]


def test_they_are_kept_and_listed(slipstand: Any, tmp_path: Path) -> None:
    assert slipstand(*importing(tmp_path, *GIVEN)).code == 0
    conditions = open_run(tmp_path / "run.h5").metadata.conditions
    assert conditions == Conditions(-3.5, 30.0, "P-1", "C-7", "acetone", 12, {"weather": "dry"})
    (listed,) = slipstand("runs", tmp_path, "--json").json
    assert listed["conditions"]["temperature_c"] == -3.5
    assert listed["conditions"]["other"] == {"weather": "dry"}
    assert "-3.5 °C, 30 %, run-in 12, P-1, C-7, acetone, weather: dry" in slipstand("runs", tmp_path).out


@pytest.mark.parametrize(
    ("option", "value", "said"),
    [("--humidity", "101", "humidity_percent = 101"), ("--surface", "a\tb", "surface_preparation"),
     ("--condition", "weather", "'weather' must be KEY=VALUE")],
)  # fmt: skip
def test_what_cannot_be_leaves_no_run(
    slipstand: Any, tmp_path: Path, option: str, value: str, said: str
) -> None:
    assert_one_error_line(slipstand(*importing(tmp_path, option, value)), said)
    assert not (tmp_path / "run.h5").exists()
