"""Presenter of the window: shown screen, connection, and events for the screens."""

import getpass
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.acquisition.messages import Connected, Event, Failed, PortSettings, RunEnded
from app.presenters import recovery
from app.presenters.analysed_run import AnalysedRun
from app.presenters.base import (
    Notice,
    NoticeAction,
    Presenter,
    Progress,
    SimulationStarted,
    TaskFailure,
    Tone,
)
from app.presenters.campaign.presenter import CampaignPresenter
from app.presenters.connection import Connection
from app.presenters.device_status import DeviceStatus
from app.presenters.error_reports import ErrorReporter
from app.presenters.gauges.presenter import GaugesPresenter
from app.presenters.identify.presenter import IdentifyPresenter
from app.presenters.identify.report import ReportPresenter
from app.presenters.navigator import ConnectForm, StandContext
from app.presenters.notices import NoticeCause, NoticeList, NoticeSources
from app.presenters.recent import RecentItems
from app.presenters.record.presenter import RecordPresenter
from app.presenters.record.state import AnalysisFailed, AnalysisProgress, Connecting, Notification
from app.presenters.recovery import RecoveryReport
from app.presenters.results import sentence
from app.presenters.runs.presenter import RunsPresenter
from app.presenters.runs.state import RunFilter
from app.presenters.screens import Screen
from app.presenters.settings_screen import PersonalSettings, SettingsPresenter
from app.presenters.stand_screen import StandPresenter
from app.presenters.stand_settings import StandSettingsPresenter
from app.presenters.start_screen import PortChoice, StartPresenter, StartState
from app.presenters.worker import LazyModule, Worker, WorkerPool
from app.simulated_stand.options import SimulatedStandOptions
from config.schema import Gauges, Settings, Stand
from messages.i18n import N_, gettext

if TYPE_CHECKING:
    from app.presenters import analysis_task
else:
    analysis_task = LazyModule("app.presenters.analysis_task")


NAME = "Slipstand"


@dataclass(frozen=True, slots=True)
class WindowState:
    """Shown screen, notice above it, theme (`system`, `light`, `dark`), title; `is_closing` ends it."""

    screen: Screen = Screen.START
    notice: Notice | None = None
    more_notices: int = 0  # that wait behind it
    theme: str = "system"
    is_closing: bool = False
    title: str = NAME


@dataclass(frozen=True, slots=True)
class WindowContext:
    stand: StandContext
    start: StartState
    personal: PersonalSettings = field(default_factory=PersonalSettings)
    simulation: SimulatedStandOptions = field(default_factory=SimulatedStandOptions)
    list_ports: Callable[[], tuple[PortChoice, ...]] = tuple
    notices: NoticeSources = field(default_factory=NoticeSources)
    recent: RecentItems = field(default_factory=RecentItems)
    save_stand: Callable[[Stand], Path] = lambda _: Path()
    """Stores another stand, and returns its file. Raises ConfigError."""


class WindowPresenter(Presenter[WindowState]):
    """Owns the presenters of all screens, the connection and the workers; shows the reports of `errors`.

    `analysis` identifies recorded and opened runs, in a process of its own that has the analysis loaded. The
    other workers share the processes of `pool`. Each screen has a presenter, an attribute of its name.
    """

    def __init__(
        self,
        connection: Connection,
        analysis: Worker,
        pool: WorkerPool,
        context: WindowContext,
        errors: ErrorReporter | None = None,
    ) -> None:
        super().__init__(WindowState())
        self._errors = errors or ErrorReporter()
        self._connection = connection
        self._analysis = analysis
        self._pool = pool
        self._notices = NoticeList(context.notices, self._show_notice)
        self._folder = str(context.stand.directory)
        self._recent = context.recent
        self._open_again: Callable[[], None] | None = None
        self._open_stand_instead: Callable[[], None] | None = None
        self._port: PortSettings | None = None
        """Port of the amplifier that is connected or being connected; None for the simulated stand."""
        self._device = DeviceStatus()
        self._true_friction: float | None = None
        self._true_frictions: dict[str, float | None] = {}
        stand, author = context.stand, getpass.getuser()
        runs, batch = pool.make_worker(), pool.make_worker()
        self.start = StartPresenter(context.start, self, context.list_ports, self._recent)
        self.record = RecordPresenter(connection, stand, pool.make_worker(), author, self.count_simulated)
        self.identify = IdentifyPresenter(analysis, ReportPresenter(pool.make_worker(), self._recent))
        self.gauges = GaugesPresenter(pool.make_worker(), pool.make_worker(), stand.gauges, self)
        connection.add_row_listener(self.gauges.on_rows)
        self.stand = StandPresenter(
            context.simulation, context.start.all_series, self.open_stand, lambda: connection.stand
        )
        self.runs = RunsPresenter(
            runs, batch, self._folder, stand.all_series, author, self.open_run, self._recent
        )
        self.campaign = CampaignPresenter(
            pool.make_worker(), self._folder, stand.all_series, author, self, self._recent
        )
        self.settings = SettingsPresenter(context.personal, self._apply_settings)
        self.stand_settings = StandSettingsPresenter(
            stand.stand, context.save_stand, self._apply_stand, lambda: self.record.is_recording
        )
        self.presenters: dict[Screen, Presenter[Any]] = {screen: getattr(self, screen) for screen in Screen}
        self._apply_settings(context.personal.settings)
        if context.personal.fault:
            text = gettext("{fault}. The usual settings are used until then", fault=context.personal.fault)
            self._notices.put(NoticeCause.SETTINGS, Notice(sentence(text), Tone.WARN))

    def show_screen(self, screen: Screen) -> None:
        before, entered = self.presenters[self.state.screen], self.presenters[screen]
        if entered is not before:
            before.leave()
        entered.enter()
        self._update(screen=screen)

    def dismiss_notice(self) -> None:
        self._notices.dismiss()

    def execute_notice_action(self) -> None:
        notice = self._notices.dismiss()
        match notice.action if notice else None:
            case NoticeAction.RECOVER:
                self._recover_runs()
            case NoticeAction.RECONNECT:
                self.reconnect()
            case NoticeAction.CLOSE:
                self.close_window()
            case NoticeAction.SIMULATE if self._open_stand_instead is not None:
                self._open_stand_instead()
            case NoticeAction.OPEN_RUN if notice is not None:
                self.open_run(notice.path)

    def may_close(self) -> bool:
        """Tell whether the window may close; while a run is recorded, ask and name what becomes of it."""
        fate = "" if self.state.is_closing else self.record.fate_when_closed
        if fate:
            question = Notice(fate, Tone.WARN, NoticeAction.CLOSE, N_("Go on recording"), is_question=True)
            self._notices.put(NoticeCause.CLOSING, question)
        return not fate

    def close_window(self) -> None:
        """Close the window without asking; a run that is being recorded is ended."""
        self._update(is_closing=True)

    def open_simulated(self, series: str) -> None:
        self.open_stand(self.stand.select_series(series))

    def open_stand(self, options: SimulatedStandOptions) -> None:
        """Start a simulated stand and connect it; ask first if it would take the place of an amplifier."""
        waiting_for = gettext("Starting the simulated stand")
        start = partial(self._connection.open_simulated, options)
        open_it = partial(self._connect, gettext("Simulated stand"), waiting_for, start)
        if self._port is None or self.record.is_recording:
            open_it()
            return
        self._open_stand_instead = open_it
        device = self.start.state.connected or self._port.url
        text = gettext("{device} is connected. The simulated stand would take its place", device=device)
        dismiss = N_("Keep the amplifier")
        question = Notice(text, Tone.WARN, NoticeAction.SIMULATE, dismiss, is_question=True)
        self._notices.put(NoticeCause.REPLACING, question)

    def open_port(self, port: PortSettings) -> None:
        waiting_for = gettext("Connecting to {port}", port=port.url)
        self._connect(port.url, waiting_for, partial(self._connection.open_port, port), port)

    def connect_at_start(self) -> None:
        """Connect the last amplifier, if that is a setting."""
        if self.settings.state.settings.connect_at_start:
            self.start.connect_last()

    def close_connection(self) -> None:
        if not self._refuse_while_recording():
            self._connection.disconnect()
            self._forget_connection()

    def open_run(self, path: str) -> None:
        path = str(Path(path).absolute())
        self._recent.add_run(path)
        self.identify.on_opening(path)
        self.show_screen(Screen.IDENTIFY)
        self._notices.on_run_opened(path)
        self._analyse(path)

    def show_runs(self, folder: str, series: str) -> None:
        if folder != self.runs.state.folder:
            self.runs.choose_folder(folder)
        self.runs.set_filter(RunFilter(series=series))
        self.show_screen(Screen.RUNS)

    def show_record(self) -> None:
        self.show_screen(Screen.RECORD)

    def show_start(self) -> None:
        self.show_screen(Screen.START)

    def connect_device(self, form: ConnectForm) -> None:
        self.start.set_form(form)
        self.start.connect()

    def fill_connection(self, form: ConnectForm) -> None:
        self.start.set_form(form)
        self.show_screen(Screen.START)

    def fill_second_port(self, url: str) -> None:
        self.fill_connection(replace(self.start.state.form, relative_port=url))

    def reconnect(self) -> None:
        if self._open_again is not None:
            self._open_again()

    def count_simulated(self, counted: bool) -> None:
        self.settings.change(count_simulated=counted)

    def set_gauges(self, gauges: Gauges) -> None:
        for presenter in self.presenters.values():
            presenter.on_gauges(gauges)

    def ask_to_recover(self) -> None:
        self._notices.ask_to_recover()

    def warm_up(self) -> None:
        """Load the analysis, so that the first one is as fast as the others."""
        self._analysis.submit(analysis_task.warm_up)

    def tick(self) -> None:
        """Process events of engine and workers, and new samples; called some 60 times a second."""
        if (report := self._errors.next_report()) is not None:  # first: the rest may fail
            notice = Notice(sentence(report.message), Tone.BAD, details=report.details)
            self._notices.put(NoticeCause.PROGRAM_ERROR, notice, str(report.message))
        for event in self._connection.poll():
            self._on_engine_event(event)
        for presenter in self.presenters.values():
            presenter.tick()
        self._follow_device()
        self._notices.follow(is_recording=self.record.is_recording)
        self._analysis.poll()
        self._update(title=self._title())

    def close(self) -> None:
        self._connection.close()
        self._analysis.close()
        for presenter in self.presenters.values():
            presenter.close()
        self._pool.close()

    def _title(self) -> str:
        """Run, device and state of the recording; on Identify the run that is shown there."""
        parts, shown = self.record.state.title, Path(self.identify.state.title).stem
        if self.state.screen is Screen.IDENTIFY and shown not in ("", *parts):
            parts = (shown, *parts)
        return " \u2013 ".join((*parts, NAME))

    def _apply_settings(self, settings: Settings) -> None:
        self.record.dispatch(settings)
        self.runs.set_author(settings.operator or getpass.getuser())
        self.campaign.set_author(settings.operator or getpass.getuser())
        self.campaign.set_count_simulated(settings.count_simulated)
        self._update(theme=settings.theme)
        if self.settings.state.message.tone is not Tone.BAD:  # they were saved
            self._notices.withdraw(NoticeCause.SETTINGS)

    def _apply_stand(self, stand: Stand) -> None:
        for presenter in self.presenters.values():
            presenter.on_stand(stand)
        if self._connection.is_active:
            text = gettext("The stand has changed. Connect again, so that runs are recorded with it")
            self._notices.put(NoticeCause.CONNECTION, Notice(text, Tone.WARN, NoticeAction.RECONNECT))

    def _connect(
        self, device: str, waiting_for: str, open_it: Callable[[], None], port: PortSettings | None = None
    ) -> None:
        if self._refuse_while_recording():
            return
        self._open_again = partial(self._connect, device, waiting_for, open_it, port)
        self._forget_connection()
        self._port = port
        self.start.set_busy(waiting_for)
        self.record.dispatch(Connecting(device, waiting_for))
        self.gauges.on_connecting(device)
        self.show_screen(Screen.RECORD)
        self._notices.withdraw(NoticeCause.CONNECTION)
        open_it()

    def _refuse_while_recording(self) -> bool:
        if self.record.is_recording:
            text = gettext("A run is being recorded. Stop it first: Esc on Record")
            self._notices.put(NoticeCause.RECORDING, Notice(text, Tone.WARN))
        return self.record.is_recording

    def _forget_connection(self) -> None:
        self._true_friction = None
        self._port = None
        self._notices.withdraw(NoticeCause.REPLACING)
        self.record.dispatch(Notification.DISCONNECTED)
        self.gauges.on_disconnected()
        self.start.set_connected("")

    def _show_notice(self, notice: Notice | None, more: int) -> None:
        self._update(notice=notice, more_notices=more)

    def _follow_device(self) -> None:
        """Tell the screens whether samples come; after their `tick`, in which the samples are taken."""
        status = self._connection.status
        if status != self._device:
            self._device = status
            self.record.dispatch(status)
            self.gauges.on_device_status(status)
            self.start.set_stopped(status.stopped_at)

    def _on_engine_event(self, event: Event | SimulationStarted) -> None:
        if isinstance(event, SimulationStarted):
            self._true_friction = event.true_friction
        self.record.dispatch(event)
        if isinstance(event, RunEnded | Failed):
            self._notices.withdraw(NoticeCause.CLOSING)
        if isinstance(event, Connected):
            self.start.set_connected(event.device)
            if self._port is not None:
                self.start.remember_device(event.device, self._port)
            self.gauges.on_connected(event)
        elif isinstance(event, RunEnded):
            self._on_run_ended(event)
        elif isinstance(event, Failed):
            self._forget_connection()
            failure = Notice(sentence(event.message), Tone.BAD, NoticeAction.RECONNECT)
            self._notices.put_failure(NoticeCause.CONNECTION, failure)

    def _on_run_ended(self, event: RunEnded) -> None:
        if event.message:
            tone = Tone.WARN if event.ended.is_normal else Tone.BAD
            self._notices.put_failure(NoticeCause.RUN, Notice(sentence(event.message), tone))
        if event.path:
            self._recent.add_run(event.path)
            self._true_frictions[event.path] = self._true_friction
            self.identify.on_opening(event.path)
            self._analyse(event.path)

    def _recover_runs(self) -> None:
        self._notices.put(NoticeCause.RECOVERY, recovery.recovery_progress())
        self._analysis.submit(
            analysis_task.recover_runs,
            self._folder,
            done=self._on_recovered,
            failed=self._on_recovery_failed,
            progress=lambda progress: self._notices.put(
                NoticeCause.RECOVERY, recovery.recovery_progress(progress)
            ),
        )

    def _on_recovered(self, report: RecoveryReport) -> None:
        self._notices.put(NoticeCause.RECOVERY, recovery.recovery_outcome(report))
        self.record.dispatch(Notification.RUNS_CHANGED)

    def _on_recovery_failed(self, failure: TaskFailure) -> None:
        self._notices.withdraw(NoticeCause.RECOVERY)
        self._notices.put(NoticeCause.UNFINISHED, recovery.offer_recovery(sentence(failure.message)))

    def _analyse(self, path: str) -> None:
        self._analysis.submit(
            analysis_task.analyse_run,
            path,
            done=self._on_analysed,
            failed=partial(self._on_analysis_failed, path),
            progress=partial(self._on_analysis_progress, path),
        )

    def _on_analysed(self, run: AnalysedRun) -> None:
        self.record.dispatch(run)
        self.identify.on_analysed(run, self._true_frictions.get(str(run.path)))

    def _on_analysis_failed(self, path: str, failure: TaskFailure) -> None:
        if not Path(path).exists():
            self._recent.remove_runs((path,))
        self.record.dispatch(AnalysisFailed(path, failure.message))
        self.identify.on_failed(path, failure.message)

    def _on_analysis_progress(self, path: str, progress: Progress) -> None:
        self.record.dispatch(AnalysisProgress(path, progress))
        self.identify.on_progress(path, progress)
