"""The Campaign presenter: table, figure, findings, exclusions and navigation."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from campaign_stage import ALL_SERIES, FOLDER, found, path_of, run, runs, runs_with_a_mode
from stage import Call, FakeWorker

from analysis.campaign.campaign import summarize
from app.presenters.base import Progress, Tone
from app.presenters.campaign.presenter import CampaignPresenter
from app.presenters.campaign.state import CampaignScope, Product

SCOPE = CampaignScope(FOLDER, ALL_SERIES)


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

    @property
    def last(self) -> Call:
        return self.worker.calls[-1]

    def asked(self) -> tuple[Any, ...]:
        return (self.last.name, *self.last.arguments)

    def gather(self, answer: Any = None) -> None:
        self.presenter.refresh()
        self.last.done(answer or found())


@pytest.fixture
def stage() -> Stage:
    return Stage()


def test_entering_gathers_once_and_shows_how_far_it_is(stage: Stage) -> None:
    stage.presenter.refresh()
    stage.presenter.refresh()
    assert [call.name for call in stage.worker.calls] == ["collect"]
    assert stage.asked() == ("collect", SCOPE, False)
    stage.last.progress(Progress("3 of 9 runs", 0.3))
    assert stage.presenter.state.progress == Progress("3 of 9 runs", 0.3)
    stage.last.done(found())
    assert stage.presenter.state.progress is None
    stage.presenter.refresh()
    assert len(stage.worker.calls) == 2


def test_simulated_runs_are_counted_anew_when_they_are_chosen(stage: Stage) -> None:
    stage.presenter.set_count_simulated(True)
    assert stage.worker.calls == [], "the screen was not shown yet"
    stage.presenter.set_count_simulated(False)
    stage.gather()
    stage.presenter.set_count_simulated(False)
    assert len(stage.worker.calls) == 1
    stage.presenter.set_count_simulated(True)
    assert stage.asked() == ("collect", replace(SCOPE, counts_simulated=True), False)
    stage.last.done(found())
    stage.presenter.export(Product.TABLE, "/tmp/t.csv")
    assert stage.asked()[1] == replace(SCOPE, counts_simulated=True)


def test_every_series_of_the_stand_has_a_row_and_what_is_missing_is_said(stage: Stage) -> None:
    stage.gather()
    state = stage.presenter.state
    assert [(row.label, len(row.runs)) for row in state.summary.rows] == [
        ("1FFM0", 3), ("1FFM1", 3), ("1SSM0", 3), ("1SSM1", 0)
    ]  # fmt: skip
    symbols = [symbol for symbol, _ in state.columns]
    cells = dict(zip(symbols, state.summary.rows[0].cells, strict=True))
    (pooled, *_) = summarize(runs()).rows
    friction = pooled.quantities["friction_dynamic"].quantity
    assert float(cells["f_d"].value) == pytest.approx(friction.value, abs=1e-5)
    assert cells["f_d"].uncertainty == f"± {friction.standard_uncertainty:.5f}"
    assert cells["f_d"].hint == "From 3 runs"
    assert cells["f_s"].value == "≥ 0.1199"
    assert (cells["u_s"].value, cells["u_s"].hint) == (
        "–", "Slip had not ended when the record did: u_s is not known."
    )  # fmt: skip
    assert state.summary.rows[3].cells[0].value == ""
    assert state.summary.rows[3].cells[0].hint == "No run of 1SSM1 yet."
    assert (state.summary.run_count, state.summary.series_count) == (9, 3)


def test_runs_of_other_series_stand_below_those_of_the_stand(stage: Stage) -> None:
    stage.gather(found([*runs(), run("9XXM0", 1, 0.2)]))
    assert stage.presenter.state.summary.rows[-1].label == "9XXM0"
    assert stage.presenter.state.summary.rows[-1].status.text == "one run"


def test_the_figure_holds_means_series_and_least_values(stage: Stage) -> None:
    stage.gather()
    ff, ss = stage.presenter.state.summary.contacts
    assert (ff.contact, ff.name) == ("FF", "fluoroplastic on fluoroplastic")
    assert ff.dynamic is not None
    low, high = ff.dynamic.interval_95
    assert low < 0.100 < high
    assert len(ff.dynamic_of_series) == 2
    assert ff.static is None
    assert ff.static_at_least == pytest.approx((0.12, 0.12), abs=5e-4)
    assert ss.dynamic is not None
    assert ss.dynamic.value == pytest.approx(0.15, abs=1e-3)


def test_effects_are_told_in_words_and_sentences(stage: Stage) -> None:
    stage.gather()
    effects = {row.cause: row for row in stage.presenter.state.summary.effects}
    assert effects["Contact"].conclusion == "found"
    assert effects["Contact"].is_found
    assert "depends on the contact" in effects["Contact"].sentence
    assert effects["Pullback"].conclusion == "cannot be told"


def test_effects_of_the_stand_are_told_apart_from_those_of_runs(stage: Stage) -> None:
    stage.gather(found(runs_with_a_mode()))
    summary = stage.presenter.state.summary
    mode, ramp = summary.stand_effects
    assert (mode.tone, ramp.tone) == (Tone.WARN, Tone.PLAIN)
    assert mode.text.startswith("2 of 2 runs: a second mode at 8.20")
    assert ramp.text.startswith("1 of 2 runs (1FFM0_002.h5): the release took 31.00")
    assert not any("second mode" in text or "release" in text for text in summary.warnings)
    stage.gather(found())
    assert stage.presenter.state.summary.stand_effects == ()


def test_a_run_far_from_the_others_is_named_where_one_looks(stage: Stage) -> None:
    stage.gather(found([*runs(), run("1FFM0", 9, 0.120)]))
    state = stage.presenter.state
    assert state.summary.rows[0].status.text == "outlier"
    assert state.summary.repeatability[0].label == "1FFM0"
    assert state.summary.repeatability[0].status.text == "outlier: 1FFM0_009"
    stage.presenter.select_series("1FFM0")
    marks = {line.name: line.status.text for line in stage.presenter.state.selected_runs}
    assert marks["1FFM0_009.h5"] == "outlier"
    assert marks["1FFM0_001.h5"] == ""


def test_the_next_test_is_said_with_what_to_expect(stage: Stage) -> None:
    stage.gather()
    test = stage.presenter.state.summary.next_test
    assert test is not None
    assert test.series == "1SSM1"
    assert test.reason == "No run yet: the first series in the paper's order without one."
    assert test.expectations == (
        "f<sub>d</sub> by one test: 0.13000 ± 0.00029",
        "the plate ends 5.4\u202fmm off: re-centre it afterwards",
    )


def test_the_next_test_is_planned_with_the_stands_effects(stage: Stage) -> None:
    shown = runs_with_a_mode()
    stage.gather(found(shown))
    with_mode = stage.presenter.state.summary.next_test
    stage.gather(found([replace(run, effects=(), warnings=()) for run in shown]))
    ideal = stage.presenter.state.summary.next_test
    assert with_mode is not None
    assert ideal is not None
    assert with_mode.series == ideal.series == "1FFM1"
    (_, ends_with), (_, ends_ideal) = with_mode.expectations, ideal.expectations
    assert ends_with.startswith("the plate ends")
    assert ends_with != ends_ideal


def test_a_run_is_left_out_with_a_reason_taken_in_and_all_undone(stage: Stage) -> None:
    stage.gather()
    path = path_of("1FFM0", 1)
    stage.presenter.exclude_run(path, "  ")
    assert stage.presenter.state.message.tone is Tone.WARN
    assert stage.last.name == "collect"
    stage.presenter.exclude_run(path, " the plate was touched ")
    assert stage.asked() == ("exclude_run", SCOPE, path, "the plate was touched", "me")
    stage.last.done(found(excluded={path: "the plate was touched"}))
    (line,) = stage.presenter.state.summary.excluded
    assert (line.name, line.reason, line.can_return) == ("1FFM0_001.h5", "The plate was touched", True)
    assert (stage.presenter.state.summary.run_count, stage.presenter.state.undo_text) == (8, "leaving out")
    assert stage.presenter.state.message.text == "1FFM0_001 is left out"
    stage.presenter.set_author("you")
    stage.presenter.include_run(path)
    assert stage.asked() == ("exclude_run", SCOPE, path, "", "you")
    stage.last.done(found())
    assert stage.presenter.state.undo_text == "taking in"
    assert stage.presenter.state.message.text == "1FFM0_001 counts again"
    for left in ("leaving out", ""):
        stage.presenter.undo()
        assert stage.asked() == ("undo_exclusion", SCOPE, path, "you")
        stage.last.done(found())
        assert stage.presenter.state.undo_text == left
    assert stage.presenter.state.summary.excluded == ()


def test_a_run_that_cannot_be_left_out_is_said_and_there_is_nothing_to_undo(stage: Stage) -> None:
    stage.gather()
    stage.presenter.exclude_run(path_of("1FFM0", 1), "touched")
    stage.last.fail("a.h5 is being changed by another program. Try again")
    assert stage.presenter.state.message.text == "a.h5 is being changed by another program. Try again"
    count = len(stage.worker.calls)
    stage.presenter.undo()
    assert len(stage.worker.calls) == count


def test_the_second_file_of_a_recording_cannot_be_taken_in(stage: Stage) -> None:
    again = replace(run("1FFM0", 4, 0.1), excluded="the same recording as 1FFM0_001.h5")
    stage.gather(found([*runs(), again]))
    (line,) = stage.presenter.state.summary.excluded
    assert not line.can_return


def test_runs_that_failed_and_what_to_know_are_listed(stage: Stage) -> None:
    stage.gather()
    assert stage.presenter.state.summary.faults == ("torn.h5: It is no run. Choose another",)
    assert stage.presenter.state.summary.warnings[0] == "Results of a.h5 were stale: new ones are taken."


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
    assert stage.worker.calls == []
    stage.gather()
    stage.presenter.export(Product.TABLE, "/tmp/t.csv")
    assert stage.asked() == ("write_product", SCOPE, Product.TABLE, "/tmp/t.csv")
    stage.last.done(("/tmp/t.csv",))
    assert stage.presenter.state.message.text == "Wrote /tmp/t.csv"
    assert stage.presenter.state.written_to == stage.presenter.recent.export_folder == str(Path("/tmp"))
    stage.presenter.exclude_run(path_of("1FFM1", 2), "")
    assert stage.presenter.state.written_to == "", "the message is about something else now"
    stage.presenter.export(Product.REPORT, "/tmp/r.pdf")
    stage.last.fail("the disk is full. Free some room")
    assert stage.presenter.state.message.text == "The disk is full. Free some room"
    assert stage.presenter.state.summary.run_count == 9


def test_results_that_are_not_kept_are_counted_and_kept_on_request(stage: Stage) -> None:
    stage.gather(found(unsaved=4))
    assert stage.presenter.state.summary.unsaved_count == 4
    stage.presenter.save_results()
    assert stage.asked() == ("collect", SCOPE, True)
    stage.last.done(found())
    assert stage.presenter.state.message.text == "New results are kept in their runs"


def test_giving_up_leaves_what_was_shown(stage: Stage) -> None:
    stage.gather()
    stage.presenter.refresh()
    stage.presenter.cancel()
    assert stage.worker.cancelled == 1
    stage.last.cancel()
    state = stage.presenter.state
    assert (state.summary.run_count, state.progress, state.message.text) == (9, None, "")
    stage.presenter.refresh()
    assert stage.last.name == "collect"


def test_a_synthetic_campaign_is_made_and_then_gathered(stage: Stage) -> None:
    stage.presenter.simulate_campaign()
    assert stage.asked() == ("simulate", FOLDER)
    stage.last.done("/recordings/synthetic-campaign-1")
    assert stage.asked() == ("collect", CampaignScope("/recordings/synthetic-campaign-1", ALL_SERIES), False)
    assert stage.presenter.state.folder == "/recordings/synthetic-campaign-1"


def test_another_folder_forgets_what_could_be_undone(stage: Stage) -> None:
    stage.gather()
    stage.presenter.exclude_run(path_of("1FFM0", 1), "touched")
    stage.last.done(found())
    stage.presenter.refresh()
    earlier = stage.last
    stage.presenter.choose_folder("/elsewhere")
    assert stage.asked() == ("collect", CampaignScope("/elsewhere", ALL_SERIES), False)
    assert (stage.presenter.state.summary.run_count, stage.presenter.state.undo_text) == (0, "")
    earlier.done(found())
    assert stage.presenter.state.summary.run_count == 0
    assert stage.presenter.state.progress is not None
    stage.last.done(found())
    assert (stage.presenter.state.summary.run_count, stage.presenter.state.progress) == (9, None)
