"""The window asks what is to become of unfinished runs, and says what came of it."""

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
from app.presenters.recovery import RecoveryReport
from app.presenters.start_screen import StartState
from app.presenters.window import WindowContext, WindowPresenter


class Desk:
    """A window presenter, with as many unfinished runs as wanted."""

    def __init__(self) -> None:
        self.unfinished = 2
        self.launcher = FakeLauncher()
        self.worker = FakeWorker()
        self.session = Connection(*self.launcher.starters, ErrorReporter().report)
        start = StartState(all_series=bench().all_series, series="1FFM0", recordings="/recordings")
        context = WindowContext(bench(), start, count_unfinished=lambda: self.unfinished)
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
    assert desk.notice.text == "Recovering x: 40%"
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
