"""The window asks what is to become of unfinished runs, and says what came of it."""

import datetime
from collections.abc import Iterator
from pathlib import Path

import pytest
from stage import FakeLauncher, FakePool, FakeWorker, bench

from app.acquisition.messages import Failed
from app.presenters import recovery
from app.presenters.analysis_task import recover_runs
from app.presenters.base import Notice, NoticeAction, Progress, Tone
from app.presenters.connection import Connection
from app.presenters.error_reports import ErrorReporter
from app.presenters.notices import NoticeSources
from app.presenters.recovery import RecoveryReport
from app.presenters.start_screen import StartState
from app.presenters.window import WindowContext, WindowPresenter
from app.runs.unattended import UnattendedRun

NOON = datetime.datetime(2026, 2, 1, 12, tzinfo=datetime.UTC).astimezone()
DAY = datetime.timedelta(days=1)


class Desk:
    """A window presenter, with as many unfinished runs as wanted."""

    def __init__(self) -> None:
        self.unfinished = 2
        self.launcher = FakeLauncher()
        self.worker = FakeWorker()
        self.session = Connection(*self.launcher.starters, ErrorReporter().report)
        start = StartState(all_series=bench().all_series, series="1FFM0", recordings="/recordings")
        self.now_s = 0.0
        self.notes: dict[Path, UnattendedRun] = {}
        sources = NoticeSources(lambda: self.unfinished, lambda: self.notes, NOON.date, lambda: self.now_s)
        context = WindowContext(bench(), start, notices=sources)
        self.window = WindowPresenter(
            self.session,
            self.worker,  # type: ignore[arg-type]
            FakePool(),
            context,
        )

    @property
    def notice(self) -> Notice:
        assert self.window.state.notice is not None
        return self.window.state.notice


@pytest.fixture
def desk() -> Iterator[Desk]:
    made = Desk()
    yield made
    made.session.close()


def test_it_asks_at_the_start_and_recovers_when_told_to(desk: Desk) -> None:
    desk.window.ask_to_recover()
    assert (desk.notice.action, desk.notice.dismiss, desk.notice.tone) == (
        NoticeAction.RECOVER,
        "Later",
        Tone.WARN,
    )
    assert "2 runs were cut short" in desk.notice.text
    desk.window.execute_notice_action()
    (call,) = desk.worker.calls
    assert (call.name, call.arguments) == ("recover_runs", (str(bench().directory),))
    assert desk.notice.action is None
    call.progress(Progress("Recovering x", 0.4))
    assert desk.notice.text == "Recovering x: 40\u202f%"
    call.done(RecoveryReport(runs=("/r/a.h5", "/r/b.h5")))
    assert (desk.notice.text, desk.notice.tone) == ("Recovered 2 runs", Tone.OK)


def test_later_leaves_all_as_it_is(desk: Desk) -> None:
    desk.window.ask_to_recover()
    desk.window.dismiss_notice()
    assert desk.window.state.notice is None
    assert desk.worker.calls == []


def test_nothing_is_asked_where_nothing_is_unfinished(desk: Desk) -> None:
    desk.unfinished = 0
    desk.window.ask_to_recover()
    assert desk.window.state.notice is None


@pytest.mark.parametrize(("unfinished", "offered"), [(1, NoticeAction.RECOVER), (0, NoticeAction.RECONNECT)])
def test_an_engine_that_died_is_said_and_recovery_offered_where_there_is_any(
    desk: Desk, unfinished: int, offered: NoticeAction
) -> None:
    desk.unfinished = unfinished
    desk.window.open_simulated("1FFM0")
    while not desk.launcher.engines:
        desk.window.tick()
    desk.launcher.engines[-1].say(Failed("the engine ended by itself (code -9)"))
    while desk.window.state.notice is None:
        desk.window.tick()
    assert "ended by itself" in desk.notice.text
    assert desk.notice.action is offered
    desk.window.execute_notice_action()
    assert len(desk.worker.calls) == unfinished
    if unfinished:
        desk.worker.calls[0].done(RecoveryReport(runs=("/r/a.h5",)))
        desk.window.dismiss_notice()
        assert desk.notice.action is NoticeAction.RECONNECT, "it waited behind the recovery"


def test_the_question_leaves_when_somebody_else_has_recovered(desk: Desk) -> None:
    desk.window.ask_to_recover()
    desk.window.tick()
    assert desk.notice.action is NoticeAction.RECOVER
    desk.unfinished, desk.now_s = 0, 10.0
    desk.window.tick()
    assert desk.window.state.notice is None


def test_what_an_engine_finished_without_a_window_is_told_and_opened(
    desk: Desk, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    removed: list[Path] = []
    monkeypatch.setattr("app.presenters.notices.remove_note", removed.append)
    desk.window.tick()
    assert desk.window.state.notice is None
    run, end = str(tmp_path / "20260201_1FFM0.h5"), NOON.replace(hour=14, minute=3, second=21)
    desk.notes = {
        Path("/notes/1"): UnattendedRun("/recordings", "rest", end, run, "1FFM0"),
        Path("/notes/2"): UnattendedRun("/recordings", "interrupted", end - DAY, "", "1FFM1"),
    }
    desk.now_s = 10.0
    desk.window.tick()
    assert desk.notice.text == (
        "The program ended while it recorded 1FFM1: there is no run."
        " Ended early: the recording was interrupted, at 2026-01-31 14:03."
    )
    assert (desk.notice.action, desk.window.state.more_notices) == (None, 1)
    desk.window.dismiss_notice()
    assert desk.notice.text == (
        "The program ended while it recorded, and the recording went on: 20260201_1FFM0.h5 is stored."
        " Ended at rest, at 14:03:21."
    )
    desk.now_s = 20.0
    desk.window.tick()
    assert desk.window.state.more_notices == 0, "what was told is not told again"
    desk.window.execute_notice_action()
    assert desk.window.state.notice is None
    assert desk.worker.calls[-1].arguments == (run,)
    assert removed == [Path("/notes/2"), Path("/notes/1")]


def test_a_run_that_is_opened_by_itself_is_told_of_no_longer(desk: Desk, tmp_path: Path) -> None:
    run = str(tmp_path / "a.h5")
    desk.notes = {Path("/notes/1"): UnattendedRun("/recordings", "rest", NOON, run)}
    desk.window.tick()
    desk.window.open_run(run)
    assert desk.window.state.notice is None


def test_what_could_not_be_recovered_is_said(desk: Desk) -> None:
    desk.window.ask_to_recover()
    desk.window.execute_notice_action()
    faults = ("/r/x.journal is not a journal of Slipstand. Nothing was done to it",)
    (call,) = desk.worker.calls
    call.done(RecoveryReport(("/r/a.h5",), ("/r/a.h5.before-recovery",), faults))
    assert desk.notice.tone is Tone.BAD
    assert desk.notice.text == (
        "Recovered a.h5. What was there before is kept as a.h5.before-recovery. " + faults[0]
    )
    call.fail("the disk is full. Free some space")
    assert (desk.notice.action, desk.notice.text) == (
        NoticeAction.RECOVER,
        "The disk is full. Free some space",
    )


def test_the_task_itself_finishes_what_is_in_the_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.runs.paths.journal_fallback_folders", list)
    (tmp_path / "some.journal").write_bytes(b"not ours")
    done = recover_runs(str(tmp_path), lambda _: None)
    assert done.runs == ()
    assert "not a journal" in done.errors[0]
    assert recovery.recovery_outcome(RecoveryReport()).text == "Nothing was left to recover"
