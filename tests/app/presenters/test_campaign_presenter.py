"""The Campaign screen as values: table, figure, sentences, leaving out, and where one comes to."""

from dataclasses import replace
from typing import Any

import pytest
from campaign_stage import ALL_SERIES, FOLDER, found, path_of, run, runs
from stage import FakeWorker

from app.presenters.base import Progress, Tone
from app.presenters.campaign.presenter import CampaignPresenter
from app.presenters.campaign.state import Product
from app.presenters.campaign.tasks import (
    CollectRuns,
    ExcludeRun,
    SimulateCampaign,
    UndoExclusion,
    WriteProduct,
)
from app.presenters.events import TaskDone, TaskFailed, TaskProgress
from app.presenters.worker import CANCELLED


class Stage:
    """Presenter, fake worker, and where the operator was taken."""

    def __init__(self) -> None:
        self.worker = FakeWorker()
        self.went: list[tuple[str, ...]] = []
        self.presenter = CampaignPresenter(self.worker, FOLDER, ALL_SERIES, "me", self)  # type: ignore[arg-type]

    def show_runs(self, folder: str, series: str) -> None:
        self.went.append((folder, series))

    def open_run(self, path: str) -> None:
        self.went.append((path,))

    def show_record(self) -> None:
        self.went.append(("record",))

    def last(self) -> Any:
        return self.worker.submitted[-1][1]

    def say(self, *news: Any) -> None:
        self.worker.news = list(news)
        self.presenter.tick()

    def gather(self, answer: Any = None) -> None:
        self.presenter.refresh()
        self.say(TaskDone(self.last(), answer or found()))


@pytest.fixture
def stage() -> Stage:
    return Stage()


def test_entering_gathers_once_and_shows_how_far_it_is(stage: Stage) -> None:
    stage.presenter.refresh()
    stage.presenter.refresh()
    assert [task for _, task in stage.worker.submitted] == [CollectRuns(FOLDER, ALL_SERIES)]
    stage.say(TaskProgress(stage.last(), Progress("3 of 9 runs", 0.3)))
    assert stage.presenter.state.progress == Progress("3 of 9 runs", 0.3)
    stage.say(TaskDone(stage.last(), found()))
    assert stage.presenter.state.progress is None
    stage.presenter.refresh()
    assert len(stage.worker.submitted) == 2


def test_every_series_of_the_stand_has_a_row_and_what_is_missing_is_said(stage: Stage) -> None:
    stage.gather()
    state = stage.presenter.state
    assert [(row.label, row.runs) for row in state.rows] == [
        ("1FFM0", 3), ("1FFM1", 3), ("1SSM0", 3), ("1SSM1", 0)
    ]  # fmt: skip
    symbols = [symbol for symbol, _ in state.columns]
    cells = dict(zip(symbols, state.rows[0].cells, strict=True))
    pooled = found().campaign.rows[0].quantities["friction_dynamic"].quantity
    assert float(cells["f_d"].value) == pytest.approx(pooled.value, abs=1e-5)
    assert cells["f_d"].uncertainty == f"± {pooled.standard_uncertainty:.5f}"
    assert cells["f_d"].hint == "From 3 runs"
    assert cells["f_s"].value == "≥ 0.1199"
    assert (cells["u_s"].value, cells["u_s"].hint) == (
        "–", "Slip had not ended when the record did: u_s is not known."
    )  # fmt: skip
    assert state.rows[3].cells[0].value == ""
    assert state.rows[3].cells[0].hint == "No run of 1SSM1 yet."
    assert (state.runs, state.series) == (9, 3)


def test_runs_of_other_series_stand_below_those_of_the_stand(stage: Stage) -> None:
    stage.gather(found([*runs(), run("9XXM0", 1, 0.2)]))
    assert stage.presenter.state.rows[-1].label == "9XXM0"
    assert stage.presenter.state.rows[-1].status.text == "one run"


def test_the_figure_holds_means_series_and_least_values(stage: Stage) -> None:
    stage.gather()
    ff, ss = stage.presenter.state.contacts
    assert (ff.contact, ff.name) == ("FF", "fluoroplastic on fluoroplastic")
    assert ff.dynamic is not None
    assert ff.dynamic.low < 0.100 < ff.dynamic.high
    assert len(ff.dynamic_of_series) == 2
    assert ff.static is None
    assert ff.static_at_least == pytest.approx((0.12, 0.12), abs=5e-4)
    assert ss.dynamic is not None
    assert ss.dynamic.value == pytest.approx(0.15, abs=1e-3)


def test_effects_are_told_in_words_and_sentences(stage: Stage) -> None:
    stage.gather()
    effects = {row.cause: row for row in stage.presenter.state.effects}
    assert effects["Contact"].conclusion == "found"
    assert effects["Contact"].is_found
    assert "depends on the contact" in effects["Contact"].sentence
    assert effects["Pullback"].conclusion == "cannot be told"


def test_a_run_far_from_the_others_is_named_where_one_looks(stage: Stage) -> None:
    stage.gather(found([*runs(), run("1FFM0", 9, 0.120)]))
    state = stage.presenter.state
    assert state.rows[0].status.text == "outlier"
    assert state.repeatability[0].label == "1FFM0"
    assert state.repeatability[0].status.text == "outlier: 1FFM0_009"
    stage.presenter.select_series("1FFM0")
    marks = {line.name: line.status.text for line in stage.presenter.state.selected_runs}
    assert marks["1FFM0_009.h5"] == "outlier"
    assert marks["1FFM0_001.h5"] == ""


def test_the_next_test_is_said_with_what_to_expect(stage: Stage) -> None:
    stage.gather()
    test = stage.presenter.state.next_test
    assert test is not None
    assert test.series == "1SSM1"
    assert test.reason == "No run yet: the first series in the paper's order without one."
    assert test.expectations == (
        "f<sub>d</sub> by one test: 0.16000 ± 0.00030",
        "the plate ends 10.3\u202fmm off: re-centre it afterwards",
    )


def test_a_run_is_left_out_with_a_reason_taken_in_and_all_undone(stage: Stage) -> None:
    stage.gather()
    path = path_of("1FFM0", 1)
    stage.presenter.exclude_run(path, "  ")
    assert stage.presenter.state.message.tone is Tone.WARN
    assert not isinstance(stage.last(), ExcludeRun)
    stage.presenter.exclude_run(path, " the plate was touched ")
    assert stage.last() == ExcludeRun(FOLDER, ALL_SERIES, path, "the plate was touched", "me")
    stage.say(TaskDone(stage.last(), found(excluded={path: "the plate was touched"})))
    (line,) = stage.presenter.state.excluded
    assert (line.name, line.reason, line.can_return) == ("1FFM0_001.h5", "The plate was touched", True)
    assert (stage.presenter.state.runs, stage.presenter.state.undo_text) == (8, "leaving out")
    assert stage.presenter.state.message.text == "1FFM0_001 is left out"
    stage.presenter.set_author("you")
    stage.presenter.include_run(path)
    assert stage.last() == ExcludeRun(FOLDER, ALL_SERIES, path, "", "you")
    stage.say(TaskDone(stage.last(), found()))
    assert stage.presenter.state.undo_text == "taking in"
    assert stage.presenter.state.message.text == "1FFM0_001 counts again"
    for left in ("leaving out", ""):
        stage.presenter.undo()
        task = stage.last()
        assert (type(task), task.path) == (UndoExclusion, path)
        stage.say(TaskDone(task, found()))
        assert stage.presenter.state.undo_text == left
    assert stage.presenter.state.excluded == ()


def test_a_run_that_cannot_be_left_out_is_said_and_there_is_nothing_to_undo(stage: Stage) -> None:
    stage.gather()
    stage.presenter.exclude_run(path_of("1FFM0", 1), "touched")
    stage.say(TaskFailed(stage.last(), "a.h5 is being changed by another program. Try again"))
    assert stage.presenter.state.message.text == "a.h5 is being changed by another program. Try again"
    count = len(stage.worker.submitted)
    stage.presenter.undo()
    assert len(stage.worker.submitted) == count


def test_the_second_file_of_a_recording_cannot_be_taken_in(stage: Stage) -> None:
    again = replace(run("1FFM0", 4, 0.1), excluded="the same recording as 1FFM0_001.h5")
    stage.gather(found([*runs(), again]))
    (line,) = stage.presenter.state.excluded
    assert not line.can_return


def test_runs_that_failed_and_what_to_know_are_listed(stage: Stage) -> None:
    stage.gather()
    assert stage.presenter.state.faults == ("torn.h5: It is no run. Choose another",)
    assert stage.presenter.state.warnings[0] == "Results of a.h5 were stale: new ones are taken."


def test_a_row_leads_to_its_runs_and_a_run_to_identify(stage: Stage) -> None:
    stage.gather()
    stage.presenter.open_row("1SSM1")
    assert stage.went == []
    stage.presenter.open_row("1FFM1")
    stage.presenter.navigator.open_run(path_of("1FFM1", 2))
    stage.presenter.navigator.show_record()
    assert stage.went == [(FOLDER, "1FFM1"), (path_of("1FFM1", 2),), ("record",)]


def test_products_are_written(stage: Stage) -> None:
    stage.presenter.export(Product.TABLE, "/tmp/t.csv")
    assert stage.worker.submitted == []
    stage.gather()
    stage.presenter.export(Product.TABLE, "/tmp/t.csv")
    assert stage.last() == WriteProduct(FOLDER, Product.TABLE, "/tmp/t.csv")
    stage.say(TaskDone(stage.last(), ("/tmp/t.csv",)))
    assert stage.presenter.state.message.text == "Wrote /tmp/t.csv"
    stage.presenter.export(Product.REPORT, "/tmp/r.pdf")
    stage.say(TaskFailed(stage.last(), "the disk is full. Free some room"))
    assert stage.presenter.state.message.text == "The disk is full. Free some room"
    assert stage.presenter.state.runs == 9


def test_results_that_are_not_kept_are_counted_and_kept_on_request(stage: Stage) -> None:
    stage.gather(found(unsaved=4))
    assert stage.presenter.state.unsaved_count == 4
    stage.presenter.save_results()
    assert stage.last() == CollectRuns(FOLDER, ALL_SERIES, save=True)
    stage.say(TaskDone(stage.last(), found()))
    assert stage.presenter.state.message.text == "New results are kept in their runs"


def test_giving_up_leaves_what_was_shown(stage: Stage) -> None:
    stage.gather()
    stage.presenter.refresh()
    stage.presenter.cancel()
    assert stage.worker.cancelled == 1
    stage.say(TaskFailed(stage.last(), CANCELLED, is_cancelled=True))
    state = stage.presenter.state
    assert (state.runs, state.progress, state.message.text) == (9, None, "")
    stage.presenter.refresh()
    assert isinstance(stage.last(), CollectRuns)


def test_a_synthetic_campaign_is_made_and_then_gathered(stage: Stage) -> None:
    stage.presenter.simulate_campaign(FOLDER)
    assert stage.last() == SimulateCampaign(FOLDER)
    stage.say(TaskDone(stage.last(), "/recordings/synthetic-campaign-1"))
    assert stage.last() == CollectRuns("/recordings/synthetic-campaign-1", ALL_SERIES)
    assert stage.presenter.state.folder == "/recordings/synthetic-campaign-1"


def test_another_folder_forgets_what_could_be_undone(stage: Stage) -> None:
    stage.gather()
    stage.presenter.exclude_run(path_of("1FFM0", 1), "touched")
    stage.say(TaskDone(stage.last(), found()))
    stage.presenter.choose_folder("/elsewhere")
    assert stage.last() == CollectRuns("/elsewhere", ALL_SERIES)
    assert (stage.presenter.state.runs, stage.presenter.state.undo_text) == (0, "")
    stage.say(TaskDone(CollectRuns(FOLDER, ALL_SERIES), found()))
    assert stage.presenter.state.runs == 0
    assert stage.presenter.state.progress is not None
    stage.say(TaskDone(stage.last(), found()))
    assert (stage.presenter.state.runs, stage.presenter.state.progress) == (9, None)
