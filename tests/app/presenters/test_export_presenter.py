"""The export presenter: formats, destination and messages."""

from pathlib import Path

import pytest
from stage import Call, FakeWorker

from analysis.motion.two_mass import TwoMassParameters
from app.presenters.base import Progress, Tone
from app.presenters.runs.export_presenter import ExportPresenter
from app.presenters.runs.state import BatchOutcome
from app.presenters.runs.tasks import export_files, preview_export
from app.runs.simulated import write_simulated_run

RUNS = ("/runs/a.h5", "/runs/b.h5")


class Desk:
    def __init__(self, *runs: str) -> None:
        self.worker = FakeWorker()
        self.export = ExportPresenter(self.worker)  # type: ignore[arg-type]
        self.export.open(runs, "/runs")

    @property
    def exports(self) -> list[Call]:
        return [call for call in self.worker.calls if call.name == "export_files"]

    @property
    def output(self) -> str:
        return self.export.state.output.replace("\\", "/")


def test_several_runs_go_to_a_folder_and_their_coefficients_to_a_file() -> None:
    desk = Desk(*RUNS)
    assert desk.output == "/runs/exported"
    assert desk.export.state.is_folder
    desk.export.set_content("coefficients")
    assert desk.output == "/runs/coefficients.csv"
    assert not desk.export.state.is_folder
    desk.export.set_format("xlsx")
    assert desk.output == "/runs/coefficients.xlsx"


def test_a_place_of_ones_own_stays_while_it_can() -> None:
    desk = Desk(RUNS[0])
    desk.export.set_output("/elsewhere/mine.csv")
    desk.export.set_content("samples")
    assert desk.output == "/elsewhere/mine.csv"


@pytest.mark.parametrize(
    ("name", "contents"),
    [("uff58", ("samples",)), ("latex", ("coefficients",)), ("mat", ("both", "samples", "coefficients"))],
)
def test_only_what_a_format_can_hold_is_offered(name: str, contents: tuple[str, ...]) -> None:
    desk = Desk(*RUNS)
    desk.export.set_format(name)
    assert desk.export.state.contents == contents
    assert desk.export.state.content in contents


def test_a_late_preview_is_not_shown() -> None:
    desk = Desk(RUNS[0])
    first = desk.worker.calls[-1]
    desk.export.set_format("json")
    first.done("csv")
    assert desk.export.state.preview == ""
    desk.worker.calls[-1].done("json")
    assert desk.export.state.preview == "json"


def test_the_folder_of_an_export_can_be_opened_and_is_that_of_the_next_one() -> None:
    desk = Desk(RUNS[0])
    desk.export.set_output("/elsewhere/mine.csv")
    desk.export.export()
    desk.exports[-1].done(BatchOutcome(("/elsewhere/mine.csv",)))
    assert desk.export.state.written_to.replace("\\", "/") == "/elsewhere"
    desk.export.open((RUNS[1],), "/runs")
    assert (desk.output, desk.export.state.written_to) == ("/elsewhere/b.csv", "")


def test_one_export_at_a_time_and_its_outcome_in_words() -> None:
    desk = Desk(*RUNS)
    desk.export.export()
    desk.export.export()
    (export,) = desk.exports
    export.progress(Progress("Exporting a.h5", 0.0))
    export.done(BatchOutcome(("/runs/exported/a.csv", "/runs/exported/b.csv"), ("b.h5: it is damaged",)))
    state = desk.export.state
    assert state.message.tone is Tone.BAD
    assert state.message.text.startswith("Wrote 2 files to")
    assert "1 of 2 runs could not be exported" in state.message.text
    assert state.details == ("b.h5: it is damaged",)


def test_without_a_place_nothing_is_exported() -> None:
    desk = Desk(RUNS[0])
    desk.export.set_output("  ")
    desk.export.export()
    assert "Choose the file" in desk.export.state.message.text
    assert desk.exports == []


def test_the_preview_of_a_real_run_shows_what_would_be_written(tmp_path: Path) -> None:
    parameters = TwoMassParameters.from_free_decay(
        period_s=0.32,
        damping_n1_per_s=0.12,
        table_mass_kg=131.6,
        plate_mass_kg=22.4,
        friction_dynamic=0.1,
        pullback_m=0.012,
    )
    path = str(write_simulated_run(tmp_path / "run.h5", parameters.simulate(9.0), parameters).path)
    text = preview_export(path, {"format": "csv", "content": "both"})
    assert "time_s,table_displacement_m,relative_displacement_m,status" in text
    assert "run.coefficients.csv" in text
    choice = {"format": "mat", "content": "samples", "replace": False}
    outcome = export_files((path,), str(tmp_path / "x.mat"), choice, lambda _: None)
    assert [Path(file).name for file in outcome.done] == ["x.mat"]
    assert (tmp_path / "x.mat").stat().st_size > 10_000
