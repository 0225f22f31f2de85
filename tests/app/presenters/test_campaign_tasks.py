"""The campaign's work on real run files: the same numbers as the command line, from the same code."""

import csv
import shutil
from pathlib import Path

import h5py
import pytest

from analysis.campaign.campaign import summarize
from analysis.motion.two_mass import TwoMassParameters
from app.presenters.base import Progress
from app.presenters.campaign import products, tasks
from app.presenters.campaign.state import CampaignScope, Product
from app.runs.campaign.collect import collect_runs
from app.runs.edits import edit_run
from app.runs.reader import open_run
from app.runs.simulated import write_simulated_run
from app.simulated_stand.synthetic_campaign import plan_tests

SERIES = ("1FFM0", "1FFM1")


def scope(folder: Path, **options: bool) -> CampaignScope:
    return CampaignScope(str(folder), SERIES, **options)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for number, friction in enumerate((0.1000, 0.1004)):
        parameters = TwoMassParameters.from_free_decay(
            period_s=0.32,
            damping_n1_per_s=0.12,
            table_mass_kg=131.6,
            plate_mass_kg=22.4,
            friction_dynamic=friction,
            pullback_m=0.012,
        )
        path = tmp_path / f"run_{number}.h5"
        write_simulated_run(path, parameters.simulate(8.0), parameters, series="1FFM0", rate_hz=200.0)
    return tmp_path


def test_a_folder_is_told_as_the_command_line_tells_it(folder: Path) -> None:
    said: list[Progress] = []
    found = tasks.collect(scope(folder), False, said.append)
    (row, _) = found.rows
    (expected,) = summarize(collect_runs([folder]).runs).rows
    friction = expected.quantities["friction_dynamic"].quantity
    shown = [cell.value for cell in row.cells if cell.uncertainty == f"± {friction.standard_uncertainty:.2g}"]
    assert f"{friction.value:.5f}" in shown
    assert said[-1].fraction is not None
    assert found.unsaved_count == 2
    assert [line.name for line in row.runs] == ["run_0.h5", "run_1.h5"]
    assert found.next_test is not None
    assert (found.next_test.series, found.next_test.reason[:10]) == ("1FFM1", "No run yet")
    assert any("by one test" in text for text in found.next_test.expectations)

    said.clear()
    assert tasks.collect(scope(folder), False, said.append).rows[0] == row
    assert said == []  # nothing has changed, so nothing is read again


def as_recorded(path: Path) -> None:
    """Make a run look like one that was recorded from an amplifier."""
    with h5py.File(path, "r+") as file:
        for field in ("run/source_type", "acquisition/protocol"):
            del file[f"entry/{field}"]
        del file["entry/truth"]


def test_simulated_runs_count_beside_recorded_ones_only_if_they_are_chosen(folder: Path) -> None:
    alone = tasks.collect(scope(folder), False, lambda _: None)
    assert (alone.run_count, alone.simulated_count, alone.is_mixed, alone.simulated_counts) == (
        2, 2, False, True,
    )  # fmt: skip
    as_recorded(folder / "run_0.h5")
    real = tasks.collect(scope(folder), False, lambda _: None)
    assert (real.run_count, real.simulated_count, real.is_mixed, real.simulated_counts) == (1, 1, True, False)
    assert [run.name for run in real.rows[0].runs] == ["run_0.h5"]
    chosen = tasks.collect(scope(folder, counts_simulated=True), False, lambda _: None)
    assert (chosen.run_count, chosen.is_mixed, chosen.simulated_counts) == (2, True, True)
    assert any("1 of these 2 runs are simulated" in warning for warning in chosen.warnings)
    target = folder / "table.csv"
    products.write_product(scope(folder), Product.TABLE, str(target), lambda _: None)
    (row,) = csv.DictReader(target.read_text(encoding="utf-8").splitlines())
    assert row["runs"] == "1", "what is exported is what is shown"


def test_what_is_left_out_is_kept_in_the_run_and_found_by_window_and_command_line(
    folder: Path, tmp_path: Path
) -> None:
    said: list[Progress] = []
    tasks.collect(scope(folder), False, said.append)
    said.clear()
    run = str(folder / "run_1.h5")
    fewer = tasks.exclude_run(scope(folder), run, "touched", "Ada", said.append)
    assert [run.name for run in fewer.rows[0].runs] == ["run_0.h5"]
    (line,) = fewer.excluded
    assert (line.path, line.reason, line.can_return) == (run, "Touched", True)
    assert (open_run(run).metadata.excluded, open_run(run).changes[-1].author) == ("touched", "Ada")
    assert [one.run for one in collect_runs([folder]).campaign().excluded] == [run]

    again = tasks.collect(scope(folder), False, said.append)
    assert again.excluded == fewer.excluded
    assert said == []  # what was edited here is known, so nothing is read again

    target = tmp_path / "table.csv"
    assert products.write_product(scope(folder), Product.TABLE, str(target), said.append) == (str(target),)
    (written,) = csv.DictReader(target.read_text().splitlines())
    assert float(written["friction_dynamic"]) == pytest.approx(0.1000, abs=2e-4)

    edit_run(Path(run), "Bob", note="dry")
    both = tasks.undo_exclusion(scope(folder), run, "Ada", said.append)
    assert len(both.rows[0].runs) == 2
    assert open_run(run).metadata.note == "dry"


def test_only_what_has_changed_is_read_again(folder: Path) -> None:
    said: list[Progress] = []
    tasks.collect(scope(folder), True, said.append)
    shutil.copy(folder / "run_0.h5", folder / "run_2.h5")
    said.clear()
    found = tasks.collect(scope(folder), False, said.append)
    assert {progress.text for progress in said} == {"Gathering run_2, 1 of 1"}
    assert [line.can_return for line in found.excluded] == [False]
    (folder / "run_0.h5").unlink()
    found = tasks.collect(scope(folder), False, said.append)
    assert found.excluded == ()
    assert [run.name for run in found.rows[0].runs] == ["run_1.h5", "run_2.h5"]


def test_only_results_that_are_not_kept_are_made_again_to_be_kept(folder: Path) -> None:
    said: list[Progress] = []
    assert tasks.collect(scope(folder), False, said.append).unsaved_count == 2
    assert tasks.collect(scope(folder), True, said.append).unsaved_count == 0
    said.clear()
    assert tasks.collect(scope(folder), True, said.append).unsaved_count == 0
    assert said == []


def test_a_synthetic_campaign_is_recorded_with_progress(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.presenters.campaign.tasks.plan_tests", lambda *given: plan_tests(*given)[:2])
    said: list[Progress] = []
    place = tasks.simulate(str(tmp_path), said.append)
    assert len(list(Path(place).glob("*.h5"))) == 2
    assert said[0].text.endswith("_1FFM0_002, 2 of 2")
    assert said[-1].fraction == 1.0


def test_an_empty_folder_holds_a_campaign_without_runs(tmp_path: Path) -> None:
    for folder in (tmp_path, tmp_path / "not-there"):
        found = tasks.collect(scope(folder), False, lambda _: None)
        assert [row.runs for row in found.rows] == [(), ()]
        assert {row.conclusion for row in found.effects} == {"cannot be told"}
