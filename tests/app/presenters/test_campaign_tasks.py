"""The campaign's work on real run files: the same numbers as the command line, from the same code."""

import csv
from pathlib import Path

import pytest

from analysis.campaign.campaign import summarize
from analysis.motion.two_mass import TwoMassParameters
from app.presenters.campaign import told
from app.presenters.campaign.state import Product
from app.presenters.campaign.tasks import Exclusion, FoundCampaign, Gather, SumUp, Write, do
from app.presenters.screen import Progress
from app.runs.campaign.gathering import gather
from app.runs.simulated import write_simulated_run

SERIES = ("1FFM0", "1FFM1")


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


def test_a_folder_is_told_as_the_command_line_tells_it(folder: Path, tmp_path: Path) -> None:
    said: list[Progress] = []
    task = Gather(str(folder), SERIES)
    found: FoundCampaign = do(task, said.append)
    (row,) = found.campaign.rows
    (expected,) = summarize(gather([folder]).runs).rows
    assert row.quantities["friction_dynamic"].quantity == expected.quantities["friction_dynamic"].quantity
    assert said[-1].fraction is not None
    assert found.unsaved == 2
    assert [line.name for line in told.runs_of(found, "1FFM0")] == ["run_0.h5", "run_1.h5"]
    assert found.expected is not None
    assert (found.expected.series, found.expected.runs) == ("1FFM1", 0)
    assert found.expected.friction is not None

    said.clear()
    assert do(task, said.append).campaign.rows[0].quantities == row.quantities
    assert said == []  # nothing has changed, so nothing is read again

    out = (Exclusion(str(folder / "run_1.h5"), "touched"),)
    fewer: FoundCampaign = do(SumUp(str(folder), SERIES, out), said.append)
    assert fewer.campaign.rows[0].runs == (str(folder / "run_0.h5"),)
    assert [line.is_mine for line in told.left_out(fewer, out)] == [True]

    target = tmp_path / "table.csv"
    assert do(Write(str(folder), out, Product.TABLE, str(target)), said.append) == (str(target),)
    (written,) = csv.DictReader(target.read_text().splitlines())
    assert float(written["friction_dynamic"]) == pytest.approx(0.1000, abs=2e-4)


def test_an_empty_folder_holds_a_campaign_without_runs(tmp_path: Path) -> None:
    for folder in (tmp_path, tmp_path / "not-there"):
        found: FoundCampaign = do(Gather(str(folder), SERIES), lambda _: None)
        assert found.campaign.rows == ()
        assert [row.runs for row in told.table(found, SERIES)] == [0, 0]
        assert {row.verdict for row in told.effects(found)} == {"cannot be told"}
