"""The window as a whole: which screen is shown, what is connected, and who gets to know what."""

import getpass
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Any

from app.acquisition.messages import Connected, Event, Failed, PortSettings, RunEnded
from app.presenters import recovery
from app.presenters.analysis_task import warm_up
from app.presenters.base import Notice, Presenter, Tone
from app.presenters.campaign.presenter import CampaignPresenter
from app.presenters.connection import Connection, SimulationStarted
from app.presenters.error_reports import ErrorReporter
from app.presenters.gauges.presenter import GaugesPresenter
from app.presenters.identify.presenter import IdentifyPresenter, IdentifyTask
from app.presenters.record.presenter import RecordPresenter
from app.presenters.record.state import (
    Connecting,
    Disconnected,
    IdentificationFailed,
    IdentificationProgress,
    RunsChanged,
    ScreenEntered,
    StandContext,
)
from app.presenters.recovery import LATER, RECOVER, RecoverFolder, recover_runs
from app.presenters.results import sentence
from app.presenters.runs.presenter import RunsPresenter
from app.presenters.runs.state import RunFilter
from app.presenters.settings.presenter import PersonalSettings, SettingsPresenter
from app.presenters.stand.presenter import StandPresenter
from app.presenters.start.presenter import StartPresenter
from app.presenters.start.state import ConnectForm, PortChoice, StartState
from app.presenters.worker import TaskDone, TaskFailed, TaskProgress, Worker
from app.simulated_stand.options import SimulatedStandOptions
from config.schema import Gauges, Settings
from messages.i18n import N_, gettext

RECONNECT = N_("Connect again")


class Screen(StrEnum):
    """The screens there are, in the order of the side bar."""

    START = "start"
    RECORD = "record"
    IDENTIFY = "identify"
    RUNS = "runs"
    CAMPAIGN = "campaign"
    GAUGES = "gauges"
    STAND = "stand"
    SETTINGS = "settings"


@dataclass(frozen=True, slots=True)
class WindowState:
    """Which screen is shown, a notice above it, and the theme: system, light or dark."""

    screen: Screen = Screen.START
    notice: Notice | None = None
    theme: str = "system"


class WindowPresenter(Presenter[WindowState]):
    """Owns the other presenters, the session and the worker.

    Parameters
    ----------
    session : Session
    worker : Worker
    analyse : task
        Reads and identifies the run at a path, in the worker.
    bench : Bench
    start : StartState
    ports : callable
        Lists the serial ports of this computer.
    library : Worker
        Does the work of the Runs screen.
    gauge_workers : tuple of Worker
        Do the work of the Gauges screen; the second one looks at ports.
    unfinished : callable, optional
        Counts the runs in the bench's folder that a crash has left unfinished.
    simulation : SimulatedStandOptions, optional
        The simulated stand that is offered.
    personal : Personal, optional
        A person's settings.
    faults : Faults, optional
        Faults of the program, which are shown.
    files : Worker, optional
        Does what Record does with files.
    gatherer : Worker, optional
        Does the work of the Campaign screen.
    analyst : Worker, optional
        Does the analyses of the Runs screen.
    """

    def __init__(
        self,
        session: Connection,
        worker: Worker,
        analyse: Callable[..., Any],
        bench: StandContext,
        start: StartState,
        ports: Callable[[], tuple[PortChoice, ...]],
        library: Worker,
        gauge_workers: tuple[Worker, Worker],
        unfinished: Callable[[], int] = lambda: 0,
        simulation: SimulatedStandOptions | None = None,
        personal: PersonalSettings | None = None,
        faults: ErrorReporter | None = None,
        files: Worker | None = None,
        gatherer: Worker | None = None,
        analyst: Worker | None = None,
    ) -> None:
        super().__init__(WindowState())
        self._faults = faults or ErrorReporter()
        self._session = session
        self._worker = worker
        self._analyse = analyse
        self._folder = str(bench.directory)
        self._unfinished = unfinished
        self._reconnect: Callable[[], None] | None = None
        self._true_friction: float | None = None
        self._recorded: dict[str, float | None] = {}
        self.start = StartPresenter(start, self, ports)
        self.record = RecordPresenter(session, bench, files or Worker(), getpass.getuser())
        self.identify = IdentifyPresenter(worker, self._poll_worker)
        self.gauges = GaugesPresenter(*gauge_workers, bench.gauges, self)
        session.add_row_listener(self.gauges.on_rows)
        self.stand = StandPresenter(
            simulation or SimulatedStandOptions(),
            start.all_series,
            self.open_stand,
            lambda: self._session.simulation,
        )
        self.runs = RunsPresenter(
            library, analyst or Worker(), self._folder, bench.all_series, getpass.getuser(), self.open_run
        )
        self.campaign = CampaignPresenter(
            gatherer or Worker(), self._folder, bench.all_series, getpass.getuser(), self
        )
        self.settings = SettingsPresenter(personal or PersonalSettings(), self._apply_settings)
        self._begin(personal or PersonalSettings())

    # --- what the operator does ---

    def show_screen(self, screen: Screen) -> None:
        """Show another screen; recording goes on meanwhile."""
        if screen is Screen.RUNS:
            self.runs.refresh()
        elif screen is Screen.CAMPAIGN:
            self.campaign.refresh()
        self._show(screen)

    def dismiss_notice(self) -> None:
        """The operator has read it."""
        self._update(notice=None)

    def execute_notice_action(self) -> None:
        """Do what the notice offers."""
        offered = self.state.notice.action if self.state.notice else ""
        self._update(notice=None)
        if offered == RECOVER:
            self._update(notice=recovery.recovery_progress())
            self._worker.submit(recover_runs, RecoverFolder(self._folder))
        else:
            self.reconnect()

    def open_simulated(self, series: str) -> None:
        """Start the simulated stand as it usually is, and record from it."""
        self.open_stand(self.stand.select_series(series))

    def open_stand(self, options: SimulatedStandOptions) -> None:
        """Start a simulated stand and record from it."""
        self._connect(
            gettext("Simulated stand"),
            gettext("Starting the simulated stand"),
            lambda: self._session.open_simulated(options),
        )

    def open_port(self, port: PortSettings) -> None:
        """Record from an amplifier."""
        self._connect(
            port.url, gettext("Connecting to {port}", port=port.url), lambda: self._session.open_port(port)
        )

    def close_connection(self) -> None:
        """Let go of what is connected, unless a run would be cut short."""
        if not self._refuse_while_recording():
            self._session.disconnect()
            self._forget_connection()

    def open_run(self, path: str) -> None:
        """Show a recording."""
        path = str(Path(path).absolute())
        self.identify.on_opening(path)
        self._show(Screen.IDENTIFY)
        self._update(notice=None)
        self._worker.submit(self._analyse, path)

    def show_runs(self, folder: str, series: str) -> None:
        """Show runs of a folder on the Runs screen, those of a series alone unless it is ""."""
        if folder != self.runs.state.folder:
            self.runs.choose_folder(folder)
        self.runs.set_filter(RunFilter(series=series))
        self.show_screen(Screen.RUNS)

    def show_record(self) -> None:
        """Go to Record."""
        self.show_screen(Screen.RECORD)

    def show_start(self) -> None:
        """Go where a device is connected."""
        self.show_screen(Screen.START)

    def fill_connection(self, form: ConnectForm) -> None:
        """Go there, with all filled in."""
        self.start.set_form(form)
        self.show_screen(Screen.START)

    def fill_second_port(self, url: str) -> None:
        """Go there, with a port of gauge 2's own filled in beside what is there."""
        self.fill_connection(replace(self.start.state.form, relative_port=url))

    def reconnect(self) -> None:
        """Connect to the same device again."""
        if self._reconnect is not None:
            self._reconnect()

    def set_gauges(self, gauges: Gauges) -> None:
        """These calibrations are in use from now on."""
        self.record.dispatch(gauges)

    def ask_to_recover(self) -> None:
        """Ask what is to become of runs that a crash has left unfinished, if there are any."""
        count = self._unfinished()
        if count:
            self._update(notice=recovery.recovery_question(count))

    def warm_up(self) -> None:
        """Make the first analysis as quick as all others; to be called once the window is there."""
        self._worker.submit(warm_up, None)

    # --- what time brings ---

    def tick(self) -> None:
        """Take in what engine and worker have said, and draw new samples."""
        if (fault := self._faults.next_report()) is not None:  # first: it may be this that fails
            self._update(notice=Notice(sentence(fault.message), Tone.BAD, details=fault.details))
        for event in self._session.poll():
            self._on_engine_event(event)
        self.record.tick()
        self.gauges.tick()
        self.stand.tick()
        self.runs.tick()
        self.campaign.tick()
        self._poll_worker()

    def close(self) -> None:
        """Finish what is being recorded, and end all processes."""
        self._session.close()
        self._worker.close()
        self.record.close()
        self.runs.close()
        self.campaign.close()
        self.gauges.close()

    # --- inside ---

    def _begin(self, personal: PersonalSettings) -> None:
        self._apply_settings(personal.settings)
        if personal.fault:
            said = gettext("{fault}. The usual settings are used until then", fault=personal.fault)
            self._update(notice=Notice(sentence(said), Tone.WARN))

    def _apply_settings(self, settings: Settings) -> None:
        self.record.dispatch(settings)
        self.runs.set_author(settings.operator or getpass.getuser())
        self.campaign.set_author(settings.operator or getpass.getuser())
        self._update(theme=settings.theme)

    def _connect(self, device: str, waiting_for: str, open_it: Callable[[], None]) -> None:
        if self._refuse_while_recording():
            return
        self._reconnect = lambda: self._connect(device, waiting_for, open_it)
        self._forget_connection()
        self.start.set_busy(waiting_for)
        self.record.dispatch(Connecting(device, waiting_for))
        self.gauges.on_connecting(device)
        self._show(Screen.RECORD)
        self._update(notice=None)
        open_it()

    def _show(self, screen: Screen) -> None:
        """Show a screen; the one of the gauges works only while it is seen."""
        if screen is Screen.GAUGES:
            self.gauges.enter()
        else:
            self.gauges.leave()
        if screen is Screen.RECORD:
            self.record.dispatch(ScreenEntered())
        self._update(screen=screen)

    def _refuse_while_recording(self) -> bool:
        """Refuse, in words, what would cut a run short."""
        if self.record.is_recording:
            self._update(
                notice=Notice(gettext("A run is being recorded. Stop it first: Esc on Record"), Tone.WARN)
            )
        return self.record.is_recording

    def _forget_connection(self) -> None:
        self._true_friction = None
        self.record.dispatch(Disconnected())
        self.gauges.on_disconnected()
        self.start.set_connected("")

    def _on_engine_event(self, event: Event | SimulationStarted) -> None:
        if isinstance(event, SimulationStarted):
            self._true_friction = event.true_friction
        self.record.dispatch(event)
        if isinstance(event, Connected):
            self.start.set_connected(event.device)
            self.gauges.on_connected(event)
        elif isinstance(event, RunEnded):
            self._run_ended(event)
        elif isinstance(event, Failed):
            self._forget_connection()
            self._update(notice=self._fault(event.message, RECONNECT))

    def _run_ended(self, event: RunEnded) -> None:
        if event.message:
            self._update(
                notice=self._fault(event.message, tone=Tone.WARN if event.ended.is_normal else Tone.BAD)
            )
        if not event.path:
            return
        self._recorded[event.path] = self._true_friction
        self.identify.on_opening(event.path)
        self._worker.submit(self._analyse, event.path)

    def _fault(self, message: str, action: str = "", tone: Tone = Tone.BAD) -> Notice:
        """Say what went wrong; where it has left a run unfinished, that comes before all else."""
        if self._unfinished():
            return Notice(sentence(message), Tone.BAD, RECOVER, LATER)
        return Notice(sentence(message), tone, action)

    def _poll_worker(self) -> None:
        """Take in what the worker has said."""
        for news in self._worker.poll():
            self._on_worker_event(news)

    def _on_recovery_event(self, news: TaskDone[Any] | TaskFailed | TaskProgress) -> None:
        if isinstance(news, TaskProgress):
            self._update(notice=recovery.recovery_progress(news.progress))
        elif isinstance(news, TaskFailed):
            self._update(notice=Notice(sentence(news.message), Tone.BAD, RECOVER, LATER))
        else:
            self._update(notice=recovery.recovery_outcome(news.answer))
            self.record.dispatch(RunsChanged())

    def _on_worker_event(self, news: TaskDone[Any] | TaskFailed | TaskProgress) -> None:
        if isinstance(news.argument, RecoverFolder):
            self._on_recovery_event(news)
        elif isinstance(news.argument, IdentifyTask):
            self.identify.on_event(news)
        elif isinstance(news, TaskProgress):
            self.record.dispatch(IdentificationProgress(news.argument, news.progress))
            self.identify.on_progress(news.argument, news.progress)
        elif isinstance(news, TaskFailed):
            self.record.dispatch(IdentificationFailed(news.argument, news.message))
            self.identify.on_failed(news.argument, news.message)
        elif news.answer is not None:
            self.record.dispatch(news.answer)
            self.identify.on_analysed(news.answer, self._recorded.get(news.argument))
