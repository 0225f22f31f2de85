"""The last runs of a stand: kept results alone, of this stand, and a bounded number."""

import datetime
import os
from pathlib import Path
from typing import Any

import pytest

from app.runs.campaign import last_runs, run_result
from app.runs.campaign.last_runs import read_last_runs
from app.runs.metadata import RunSource, create_metadata
from app.runs.saved_analyses import save_analysis
from config.files import load_gauges, load_stand
from tests.app.runs.runs_kit import ANALYSIS, small_run

STAND = load_stand()
DAY = datetime.datetime(2026, 11, 21, tzinfo=datetime.UTC)


pytestmark = pytest.mark.usefixtures("unhurried")


def write(folder: Path, number: int, *, kept: bool = True, stand: str = STAND.name, **changes: Any) -> None:
    """A run whose file was changed so many seconds after the day began."""
    path = folder / f"{number}.h5"
    metadata = create_metadata(STAND.replace(name=stand), load_gauges(), DAY).replace(**changes)
    small_run(path, metadata.replace(start_time=DAY + datetime.timedelta(seconds=number)))
    if kept:
        save_analysis(path, ANALYSIS, "")
    stamp = DAY.timestamp() + number
    os.utime(path, (stamp, stamp))


def names(folder: Path) -> list[str]:
    return [Path(result.name).stem for result in read_last_runs(folder, STAND.name).results]


def test_kept_results_of_this_stand_are_taken_in_their_order(tmp_path: Path) -> None:
    write(tmp_path, 2)
    write(tmp_path, 1)
    write(tmp_path, 3, kept=False)
    write(tmp_path, 4, stand="another")
    write(tmp_path, 5, excluded="bumped")
    (tmp_path / "6.h5").write_bytes(b"no run")

    assert names(tmp_path) == ["1", "2"]
    assert read_last_runs(tmp_path, STAND.name).looked_at == 6


def test_simulated_runs_do_not_count_beside_recorded_ones(tmp_path: Path) -> None:
    write(tmp_path, 1, stated_source=RunSource.SIMULATED)
    assert names(tmp_path) == ["1"]

    write(tmp_path, 2)
    assert names(tmp_path) == ["2"]


def test_only_the_newest_files_are_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(last_runs, "RUNS_MOST", 2)
    for number in (3, 1, 2):
        write(tmp_path, number)

    assert names(tmp_path) == ["2", "3"]


def test_reading_ends_after_a_while(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path, 1)
    monkeypatch.setattr(last_runs, "_LONGEST_S", -1.0)

    assert read_last_runs(tmp_path, STAND.name).looked_at == 0


def test_nothing_is_analysed_or_changed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_result, "analyze_run", pytest.fail)
    write(tmp_path, 1, kept=False)
    before = (tmp_path / "1.h5").read_bytes()

    assert names(tmp_path) == []
    assert (tmp_path / "1.h5").read_bytes() == before


def test_a_folder_that_does_not_exist_has_none(tmp_path: Path) -> None:
    assert read_last_runs(tmp_path / "none", STAND.name).results == ()
