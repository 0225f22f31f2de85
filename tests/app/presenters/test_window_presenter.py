"""The window presenter from the start page to the result, with fake engine and workers."""

import datetime
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest
from stage import (
    END_S,
    RUN,
    Call,
    FakeLauncher,
    FakePool,
    FakeWorker,
    RecordingView,
    analysed,
    bench,
    ended,
    standing,
)

from app.acquisition.messages import (
    EndReason,
    Failed,
    PortSettings,
    Reconnected,
    Reconnecting,
    StateChanged,
)
from app.presenters.base import NoticeAction, Progress, Tone
from app.presenters.connection import Connection
from app.presenters.device_status import DeviceMonitor
from app.presenters.error_reports import ErrorReporter, error_report
from app.presenters.navigator import ConnectForm
from app.presenters.recent import RecentItems
from app.presenters.record.state import Action
from app.presenters.screens import Screen
from app.presenters.settings_screen import PersonalSettings
from app.presenters.start_screen import StartState
from app.presenters.window import WindowContext, WindowPresenter
from config.files import load_gauges
from config.schema import ConfigError, RecentDevice, RecentUse, Settings
from tests.waiting import wait_until

NOON = datetime.datetime(2026, 2, 1, 12, tzinfo=datetime.UTC)


class Desk:
    """A window presenter with everything around it."""

    def __init__(self, personal: PersonalSettings | None = None, recent: RecentItems | None = None) -> None:
        self.recent = recent or RecentItems()
        self.launcher = FakeLauncher()
        self.worker = FakeWorker()
        self.now_s = 0.0
        monitor = DeviceMonitor(lambda: self.now_s, lambda: NOON + datetime.timedelta(seconds=self.now_s))
        self.errors = ErrorReporter()
        self.session = Connection(*self.launcher.starters, self.errors.report, monitor)
        start = StartState(all_series=bench().all_series, series="1FFM0", recordings="/recordings")
        self.window = WindowPresenter(
            self.session,
            self.worker,  # type: ignore[arg-type]
            FakePool(),
            WindowContext(bench(), start, personal or PersonalSettings(), recent=self.recent),
            self.errors,
        )

    def tick_until_connected(self) -> None:
        wait_until(lambda: self.window.tick() or self.window.start.state.connected)

    def analysis(self, path: str = RUN) -> Call:
        """The only analysis that was submitted."""
        (call,) = self.worker.calls
        assert (call.name, call.arguments) == ("analyse_run", (path,))
        return call

    def play(self, until_s: float) -> None:
        self.launcher.engines[-1].play(until_s)
        self.window.tick()


@pytest.fixture
def desk() -> Iterator[Desk]:
    made = Desk()
    yield made
    made.session.close()


def test_from_the_start_page_to_the_result(desk: Desk) -> None:
    window = desk.window
    window.start.start_simulation()
    assert window.state.screen is Screen.RECORD
    assert window.start.state.busy == "Starting the simulated stand"
    desk.tick_until_connected()
    assert window.start.state.busy == ""
    window.record.dispatch(Action.ARM)
    for until_s in (1.0, 3.0, 6.0, END_S + 0.1):
        desk.play(until_s)
    analysis = desk.analysis()
    analysis.progress(Progress("Fitting", 0.5))
    assert window.record.state.progress == window.identify.state.progress == Progress("Fitting", 0.5)
    analysis.done(analysed())
    assert window.record.state.result is not None
    assert window.record.state.result.comparison == "True value 0.10000: found +0.30\u202f%"
    assert window.identify.state.curves is not None
    assert window.identify.state.result == window.record.state.result
    assert window.state.screen is Screen.RECORD, "nobody asked for another screen"


def test_a_run_that_cannot_be_identified_says_why_on_both_screens(desk: Desk) -> None:
    window = desk.window
    window.open_simulated("1FFM0")
    desk.tick_until_connected()
    window.record.dispatch(Action.ARM)
    desk.play(1.0)
    window.record.dispatch(Action.STOP)
    window.tick()
    desk.analysis().fail("there is no release. Record until one")
    assert window.record.state.result is not None
    assert window.record.state.result.warnings == ("There is no release. Record until one",)
    assert window.identify.state.failure == "there is no release. Record until one"


def test_a_recording_is_opened_on_identify(desk: Desk) -> None:
    desk.window.open_run("/recordings/a.h5")
    assert desk.window.state.screen is Screen.IDENTIFY
    opened = str(Path("/recordings/a.h5").absolute())
    desk.analysis(opened).done(analysed(path=opened))
    assert desk.window.identify.state.title == "a.h5"
    assert desk.window.identify.state.result is not None
    assert desk.window.identify.state.result.comparison == "", "the truth of another run is not known"
    assert desk.window.record.state.result is None


def test_a_lost_device_is_said_with_a_way_back(desk: Desk) -> None:
    window = desk.window
    port = PortSettings("COM7", "csv")
    window.open_port(port)
    desk.tick_until_connected()
    desk.launcher.engines[0].say(Failed("COM7 is gone. Plug it in again"))
    window.tick()
    notice = window.state.notice
    assert notice is not None
    assert (notice.text, notice.tone, notice.action) == (
        "COM7 is gone. Plug it in again",
        Tone.BAD,
        NoticeAction.RECONNECT,
    )
    assert window.start.state.connected == ""
    assert window.record.state.guidance.instruction == "Connect an amplifier"
    window.execute_notice_action()
    desk.tick_until_connected()
    assert window.state.notice is None
    assert desk.launcher.ports == [port, port]


def test_every_screen_dates_what_a_lost_device_sent_last(desk: Desk) -> None:
    window = desk.window
    window.open_port(PortSettings("COM7", "csv"))
    desk.tick_until_connected()
    desk.now_s = 21.0
    desk.play(2.0)

    def shown() -> set[str]:
        states = window.record.state.status_bar, window.record.state.readings, window.gauges.state
        tabs = window.gauges.calibration.state, window.gauges.check.state
        return {state.stopped_at for state in (*states, *tabs, window.start.state)}

    assert shown() == {""}
    desk.now_s = 30.0
    desk.launcher.engines[-1].say(Reconnecting("COM7 is gone"))
    window.tick()
    assert shown() == {"12:00:21"}
    desk.launcher.engines[-1].say(Reconnected(9.0, "back"))
    desk.play(3.0)
    assert shown() == {""}
    desk.now_s = 33.0
    window.tick()
    assert shown() == {"12:00:30"}, "silence, without a word of the engine"
    window.close_connection()
    window.tick()
    assert shown() == {""}


def test_a_run_that_ended_badly_is_said_and_still_identified(desk: Desk) -> None:
    window = desk.window
    window.open_simulated("1FFM0")
    desk.tick_until_connected()
    desk.launcher.engines[0].say(ended(RUN, EndReason.DISK_FULL, "the disk is full. Free some space"))
    window.tick()
    assert window.state.notice is not None
    assert window.state.notice.text == "The disk is full. Free some space"
    assert window.state.notice.action is None
    desk.analysis()
    window.dismiss_notice()
    assert window.state.notice is None


def test_a_run_that_was_not_kept_is_not_analysed(desk: Desk) -> None:
    desk.window.open_simulated("1FFM0")
    desk.tick_until_connected()
    desk.launcher.engines[0].say(ended("", EndReason.DISK_FULL, "the disk is full. Free some space"))
    desk.window.tick()
    assert desk.worker.calls == []
    assert desk.window.state.notice is not None


def test_nothing_else_is_opened_while_a_run_is_recorded(desk: Desk) -> None:
    window = desk.window
    window.open_simulated("1FFM0")
    desk.tick_until_connected()
    window.record.dispatch(Action.ARM)
    desk.play(1.0)
    window.start.start_simulation()
    window.start.navigator.close_connection()
    assert len(desk.launcher.engines) == 1
    assert window.start.state.connected
    assert window.state.notice is not None
    assert window.state.notice.tone is Tone.WARN
    desk.play(END_S + 0.1)
    window.start.navigator.close_connection()
    assert not window.start.state.connected


def test_letting_go_leaves_nothing_connected(desk: Desk) -> None:
    desk.window.open_simulated("1FFM0")
    desk.tick_until_connected()
    desk.window.start.navigator.close_connection()
    desk.window.tick()
    assert desk.window.start.state.connected == ""
    assert desk.window.record.state.allowed == frozenset()
    desk.window.close()
    assert desk.launcher.engines[0].closed
    assert desk.launcher.simulations[0].stopped
    assert desk.worker.closed


def test_warming_up_shows_nothing(desk: Desk) -> None:
    view = RecordingView()
    desk.window.attach(view)
    desk.window.warm_up()
    (call,) = desk.worker.calls
    assert (call.name, call.arguments) == ("warm_up", ())
    call.done(None)
    call.fail("numba is broken")
    assert len(view.states) == 1
    assert desk.window.identify.state.failure == ""


def test_screens_change_when_asked(desk: Desk) -> None:
    desk.window.show_screen(Screen.IDENTIFY)
    assert desk.window.state.screen is Screen.IDENTIFY


def test_settings_that_cannot_be_read_are_said_once_and_the_usual_ones_hold() -> None:
    desk = Desk(PersonalSettings(fault="/x/settings.toml: theme = 'pink': not known"))
    notice = desk.window.state.notice
    assert notice is not None
    assert notice.text.startswith("/x/settings.toml: theme = 'pink'")
    assert notice.tone is Tone.WARN
    assert desk.window.state.theme == "system"


def test_settings_that_are_saved_can_be_read_again() -> None:
    desk = Desk(PersonalSettings(fault="/x/settings.toml: theme = 'pink': not known"))
    desk.window.open_run("/recordings/a.h5")
    assert desk.window.state.notice is not None, "a run has nothing to do with it"
    desk.window.settings.change(theme="dark")
    assert desk.window.state.notice is None


def test_settings_that_cannot_be_saved_stay_unreadable() -> None:
    def save(_: Settings) -> None:
        raise ConfigError("settings.toml: the disk is full")

    desk = Desk(PersonalSettings(fault="/x/settings.toml: theme = 'pink': not known", save=save))
    desk.window.settings.change(theme="dark")
    assert desk.window.state.notice is not None


def test_notices_wait_for_one_another_and_each_leaves_with_its_cause(desk: Desk) -> None:
    window = desk.window
    window.open_simulated("1FFM0")
    desk.tick_until_connected()
    desk.errors.report(error_report(ValueError("a bug")))
    window.tick()
    window.record.dispatch(Action.ARM)
    desk.play(1.0)
    window.start.start_simulation()
    assert window.state.notice is not None
    assert window.state.notice.text.startswith("A run is being recorded")
    assert window.state.more_notices == 1
    desk.play(END_S + 0.1)
    window.tick()
    assert window.state.notice.text.startswith("Slipstand itself failed"), "the recording has ended"
    assert window.state.more_notices == 0
    window.open_run("/recordings/a.h5")
    window.start.start_simulation()
    desk.tick_until_connected()
    assert window.state.notice.text.startswith("Slipstand itself failed"), "until somebody has read it"
    window.dismiss_notice()
    assert window.state.notice is None


def test_how_a_run_ended_is_told_until_the_next_is_recorded(desk: Desk) -> None:
    window = desk.window
    window.open_simulated("1FFM0")
    desk.tick_until_connected()
    desk.launcher.engines[0].say(ended(RUN, EndReason.DISK_FULL, "the disk is full. Free some space"))
    window.tick()
    window.tick()
    assert window.state.notice is not None
    window.record.dispatch(Action.ARM)
    desk.play(1.0)
    assert window.state.notice is None


def test_what_is_chosen_reaches_the_screens(desk: Desk) -> None:
    desk.window.settings.change(theme="dark", operator="Anna")
    assert desk.window.state.theme == "dark"
    assert desk.window.record.state.choices.form.operator == "Anna"


def test_simulated_runs_are_chosen_once_for_plan_and_campaign() -> None:
    saved: list[Settings] = []
    desk = Desk(PersonalSettings(save=saved.append))
    desk.window.record.count_simulated(True)
    assert [settings.count_simulated for settings in saved] == [True]
    assert desk.window.campaign._scope().counts_simulated
    desk.window.campaign.navigator.count_simulated(False)
    assert not saved[-1].count_simulated
    assert not desk.window.campaign._scope().counts_simulated


def test_gauge_2_gets_a_port_of_its_own_beside_what_is_filled_in(desk: Desk) -> None:
    desk.window.fill_connection(ConnectForm("COM7", "csv"))
    desk.window.fill_second_port("COM8")
    assert desk.window.start.state.form == ConnectForm("COM7", "csv", relative_port="COM8")
    assert desk.window.state.screen is Screen.START


def test_other_calibrations_reach_every_screen(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    reached = []
    for presenter in desk.window.presenters.values():
        monkeypatch.setattr(presenter, "on_gauges", lambda gauges, to=presenter: reached.append((to, gauges)))
    gauges = load_gauges()

    desk.window.set_gauges(gauges)

    assert reached == [(presenter, gauges) for presenter in desk.window.presenters.values()]


def test_record_measures_with_other_calibrations(desk: Desk) -> None:
    gauges = load_gauges()
    desk.window.set_gauges(gauges)
    assert desk.window.record._model.stand.gauges is gauges


def connect_amplifier(desk: Desk) -> None:
    desk.window.open_port(PortSettings("COM7", "csv"))
    desk.tick_until_connected()


def test_the_simulated_stand_does_not_take_the_place_of_an_amplifier_unasked(desk: Desk) -> None:
    window = desk.window
    connect_amplifier(desk)
    window.start.start_simulation()
    window.stand.start()
    assert desk.launcher.simulations == []
    notice = window.state.notice
    assert notice is not None
    assert notice.text == "Slipstand simulator is connected. The simulated stand would take its place"
    assert (notice.action, notice.dismiss) == (NoticeAction.SIMULATE, "Keep the amplifier")
    window.dismiss_notice()
    assert window.start.state.connected
    window.start.start_simulation()
    window.execute_notice_action()
    desk.tick_until_connected()
    assert len(desk.launcher.simulations) == 1
    assert window.state.notice is None
    window.start.start_simulation()
    desk.tick_until_connected()
    assert window.state.notice is None, "a simulated stand is replaced without a question"


def test_the_question_of_the_amplifier_leaves_with_it(desk: Desk) -> None:
    connect_amplifier(desk)
    desk.window.start.start_simulation()
    desk.window.close_connection()
    assert desk.window.state.notice is None
    desk.window.start.start_simulation()
    desk.tick_until_connected()
    assert len(desk.launcher.simulations) == 1


def test_a_window_in_which_nothing_is_recorded_closes_at_once(desk: Desk) -> None:
    assert desk.window.may_close()
    connect_amplifier(desk)
    assert desk.window.may_close()
    assert desk.window.state.notice is None


@pytest.mark.parametrize(
    ("until_s", "keeps_run", "words"),
    [
        (1.5, False, "A run of 1FFM0 is armed. Closing the window disarms it: nothing is recorded"),
        (
            3.0,
            True,
            "A run of 1FFM0 is being recorded. Closing the window ends it before the release: it is kept"
            " without a decision, and does not count in the plan",
        ),
        (
            6.0,
            True,
            "A run of 1FFM0 is being recorded. Closing the window ends it now: it is kept without a"
            " decision, and does not count in the plan",
        ),
    ],
)
def test_closing_in_a_recording_names_what_becomes_of_the_run(
    desk: Desk, until_s: float, keeps_run: bool, words: str
) -> None:
    window = desk.window
    connect_amplifier(desk)
    window.record.dispatch(Action.ARM)
    desk.play(until_s)
    state = window.record._model.session.engine
    assert state is not None
    position = msgspec.structs.replace(standing(state), keeps_run=keeps_run)
    desk.launcher.engines[-1].say(StateChanged(state, until_s, "", position))
    window.tick()
    assert not window.may_close()
    notice = window.state.notice
    assert notice is not None
    assert (notice.text, notice.action, notice.dismiss) == (words, NoticeAction.CLOSE, "Go on recording")
    assert not window.state.is_closing
    window.dismiss_notice()
    assert not window.may_close()
    window.execute_notice_action()
    assert window.state.is_closing
    assert window.may_close()


def test_the_question_of_closing_leaves_with_the_recording(desk: Desk) -> None:
    connect_amplifier(desk)
    desk.window.record.dispatch(Action.ARM)
    desk.play(3.0)
    assert not desk.window.may_close()
    desk.play(END_S + 0.1)
    assert desk.window.state.notice is None
    assert desk.window.may_close()


def test_an_amplifier_is_remembered_once_it_is_connected_and_the_simulated_stand_never(desk: Desk) -> None:
    desk.window.open_simulated("1FFM0")
    desk.tick_until_connected()
    assert desk.recent.device is None
    desk.window.open_port(PortSettings("COM7", "csv"))
    assert desk.recent.device is None
    desk.tick_until_connected()
    assert desk.recent.device == RecentDevice("Slipstand simulator", "COM7", "csv")
    desk.window.open_simulated("1FFM0")
    desk.tick_until_connected()
    assert desk.window.start.state.last_device == "Slipstand simulator on COM7"


@pytest.mark.parametrize("wanted", [False, True])
def test_the_last_amplifier_is_connected_at_the_start_if_that_is_a_setting(wanted: bool) -> None:
    recent = RecentItems(RecentUse(RecentDevice("GSV-8", "COM7", "csv")))
    desk = Desk(PersonalSettings(Settings(connect_at_start=wanted)), recent)
    desk.window.connect_at_start()
    if wanted:
        desk.tick_until_connected()
    assert [port.url for port in desk.launcher.ports] == (["COM7"] if wanted else [])
    desk.session.close()


def test_recorded_and_opened_runs_are_recent_until_they_are_gone(desk: Desk) -> None:
    desk.window.open_run("/recordings/a.h5")
    desk.window.start.start_simulation()
    desk.tick_until_connected()
    desk.window.record.dispatch(Action.ARM)
    desk.play(END_S + 0.1)
    assert desk.recent.runs == (RUN, str(Path("/recordings/a.h5").absolute()))
    desk.worker.calls[0].fail("there is no such run")
    assert desk.recent.runs == (RUN,)


def test_the_title_follows_run_device_and_state(desk: Desk) -> None:
    def title() -> str:
        desk.window.tick()
        return desk.window.state.title

    assert title() == "Slipstand"
    desk.window.start.start_simulation()
    assert desk.window.record.state.title == ("Simulated stand", "connecting")
    desk.tick_until_connected()
    assert title() == "Slipstand simulator \u2013 ready \u2013 Slipstand"
    desk.window.record.dispatch(Action.ARM)
    desk.play(3.0)
    assert title() == "20260112_1FFM0_001 \u2013 Slipstand simulator \u2013 recording: Pull \u2013 Slipstand"
    desk.play(END_S + 0.1)
    desk.window.show_screen(Screen.IDENTIFY)
    assert title() == "20260112_1FFM0_001 \u2013 Slipstand simulator \u2013 ready \u2013 Slipstand"
    desk.window.open_run("/recordings/other.h5")
    assert title().startswith("other \u2013 20260112_1FFM0_001 \u2013 ")
    desk.launcher.engines[-1].say(Reconnecting("COM7 is gone"))
    assert "device lost" in title()
