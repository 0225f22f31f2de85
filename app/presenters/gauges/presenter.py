"""What the Gauges screen does: live samples and worker's news in, one state out."""

import datetime
from collections.abc import Callable
from typing import Any, Final, Protocol

from app.acquisition.messages import Connected
from app.acquisition.ring import RingRows
from app.presenters.base import EMPTY_CHIP, Chip, Presenter, Tone
from app.presenters.gauges.calibration import CalibrationSession
from app.presenters.gauges.cards import gauge_cards
from app.presenters.gauges.check import CheckSession
from app.presenters.gauges.port_probe import PortProbe
from app.presenters.gauges.reading_averager import WINDOW_S
from app.presenters.gauges.recent_samples import RecentSamples
from app.presenters.gauges.state import CalibrationForm, CheckForm, GaugesState, GaugesTab
from app.presenters.gauges.tasks import (
    ActiveCalibrations,
    CheckGauge,
    FitCalibration,
    GaugesTask,
    LoadCalibrations,
    MeasureHealth,
    SaveCalibration,
    execute,
)
from app.presenters.results import sentence
from app.presenters.start.state import ConnectForm
from app.presenters.worker import TaskDone, TaskFailed, Worker, WorkerEvent
from config.schema import GaugeChecks, Gauges
from messages.i18n import N_, gettext

HEALTH_S: Final = 5.0
"""So much is looked at, once a second."""
HEALTH_EVERY_S: Final = 1.0
_LEAST_S: Final = 1.1
_LIVE_EVERY_S: Final = 0.1
_NOT_CONNECTED: Final = N_(
    "Nothing is connected. Connect the device, let the stand rest, and noise, drift, hum and spectrum of both"
    " gauges appear here."
)
_WAITING: Final = N_("Looking at the gauges: let the stand rest for a few seconds.")


class Navigator(Protocol):
    """Where the Gauges screen leads."""

    def show_start(self) -> None:
        """Go where a device is connected."""

    def fill_connection(self, form: ConnectForm) -> None:
        """Go there, with all filled in."""

    def fill_second_port(self, url: str) -> None:
        """Go there, with a port of gauge 2's own filled in beside what is there."""

    def reconnect(self) -> None:
        """Connect to the same device again."""

    def set_gauges(self, gauges: Gauges) -> None:
        """These calibrations are in use from now on."""


class GaugesPresenter(Presenter[GaugesState]):
    """Calibrations, health, ports.

    Parameters
    ----------
    worker, prober : Worker
        The second one looks at ports, which takes long; it may be given up alone. Closed by `close`.
    gauges : Gauges
        In use at first.
    doors : Doors
    now : callable
        Time of day.
    """

    def __init__(
        self,
        worker: Worker,
        prober: Worker,
        gauges: Gauges,
        navigator: Navigator,
        now: Callable[[], datetime.datetime] = datetime.datetime.now,
    ) -> None:
        cards = gauge_cards(gauges, GaugeChecks(), now().date())
        super().__init__(GaugesState(cards, health_note=gettext(_NOT_CONNECTED)))
        self._worker = worker
        self._probing = PortProbe(prober, self._update)
        self._gauges = gauges
        self._navigator = navigator
        self._now = now
        self._recent = RecentSamples(max(HEALTH_S, WINDOW_S + 1.0))
        self._calibrating = CalibrationSession(self._recent, self._submit, self._show_calibration, now)
        self._checking = CheckSession(self._recent, self._submit, self._show_check)
        self._read_by: Gauges | None = None
        self._rate_hz = 0.0
        self._port = ""
        self._is_shown = False
        self._judging = False
        self._judged_s = self._live_s = float("-inf")

    # --- what the operator does ---

    def enter(self) -> None:
        """The screen is shown: files and ports may have changed meanwhile."""
        self._is_shown = True
        self._submit(LoadCalibrations())
        self._probing.list_ports()

    def leave(self) -> None:
        """Another screen is shown."""
        self._is_shown = False

    def set_tab(self, side: GaugesTab) -> None:
        """Show another tab."""
        self._update(tab=side)

    def show_start(self) -> None:
        """Go where a device is connected."""
        self._navigator.show_start()

    def set_query_silent(self, asks: bool) -> None:
        """Whether silent devices are asked who they are; else nothing is sent to any."""
        self._update(query_silent=asks)

    def probe(self) -> None:
        """Look at all ports."""
        self._probing.probe(self._port, query_silent=self.state.query_silent)

    def cancel_probe(self) -> None:
        """Stop looking."""
        self._probing.cancel()

    def fill_port(self, url: str) -> None:
        """Fill in how to record from a port, and go there."""
        for card in self.state.ports:
            if card.url == url and card.suggested_form is not None:
                self._navigator.fill_connection(card.suggested_form)

    def fill_second_port(self, url: str) -> None:
        """Fill in that gauge 2 has a device of its own on a port, and go there."""
        self._navigator.fill_second_port(url)

    def set_check_form(self, form: CheckForm) -> None:
        """Take what was filled in about a check."""
        self._checking.set_form(form)

    def advance_check(self) -> None:
        """Begin a check, or take the reading that is asked for."""
        self._checking.advance()

    def cancel_check(self) -> None:
        """Break the check off."""
        self._checking.cancel()

    def set_calibration_form(self, form: CalibrationForm) -> None:
        """Take what was filled in about the calibration."""
        self._calibrating.set_form(form)

    def take_point(self, dial_text: str) -> None:
        """The dial shows this many millimetres."""
        self._calibrating.take_point(dial_text)

    def undo_point(self) -> None:
        """Take the last reading back."""
        self._calibrating.undo()

    def restart_calibration(self) -> None:
        """Begin another calibration."""
        self._calibrating.restart()

    def save_calibration(self) -> None:
        """Keep the calibration as a file."""
        self._calibrating.save()

    def reconnect(self) -> None:
        """Connect again, by the new calibration."""
        self._navigator.reconnect()

    # --- what happens elsewhere ---

    def on_connecting(self, port: str) -> None:
        """A port is being opened, to be read by the calibrations that are in use now."""
        self.on_disconnected()
        self._port = port
        self._read_by = self._gauges

    def on_connected(self, event: Connected) -> None:
        """Samples flow."""
        self._rate_hz = event.rate_hz
        self._calibrating.on_connected(self._read_by)
        self._checking.on_connected(self._read_by, event.device)
        self._update(device=event.device, health_note=gettext(_WAITING))

    def on_disconnected(self) -> None:
        """Nothing is connected any more."""
        self._port = ""
        self._read_by = None
        self._recent.clear()
        self._judged_s = self._live_s = float("-inf")
        self._calibrating.on_connected(None)
        self._checking.on_connected(None)
        self._update(device="", health=(), health_note=gettext(_NOT_CONNECTED))

    def on_rows(self, rows: RingRows) -> None:
        """Live samples, whoever else draws them."""
        self._recent.append(rows)

    def tick(self) -> None:
        """Take in what the workers have said, and look at the newest samples."""
        for news in self._worker.poll():
            self._on_event(news)
        self._probing.poll()
        now_s = self._recent.end_s
        is_wanted = self._is_shown or self.state.calibration.reading_status or self.state.check.reading_status
        if is_wanted and now_s - self._live_s >= _LIVE_EVERY_S:
            self._live_s = now_s
            self._calibrating.tick()
            self._checking.tick()
        if self._is_shown and self.state.tab is GaugesTab.HEALTH:
            self._measure_health(now_s)

    def close(self) -> None:
        """End the workers."""
        self._worker.close()
        self._probing.close()

    # --- inside ---

    def _submit(self, task: GaugesTask) -> None:
        self._worker.submit(execute, task)

    def _measure_health(self, now_s: float) -> None:
        if self._judging or self._read_by is None or now_s - self._judged_s < HEALTH_EVERY_S:
            return
        rows = self._recent.since(now_s - HEALTH_S)
        if rows is not None and self._recent.length_s >= _LEAST_S:
            self._judging, self._judged_s = True, now_s
            self._submit(MeasureHealth(rows, self._rate_hz, self._read_by))

    def _on_event(self, news: WorkerEvent) -> None:
        if isinstance(news, TaskFailed):
            self._on_failed(news.argument, news.message)
        elif isinstance(news, TaskDone):
            self._on_done(news)

    def _on_failed(self, task: Any, message: str) -> None:
        match task:
            case FitCalibration() | SaveCalibration():
                self._calibrating.on_failed(task, message)
            case CheckGauge():
                self._checking.on_failed(message)
            case MeasureHealth():
                self._judging = False
                if self._read_by is task.gauges:
                    self._update(health=(), health_note=sentence(message))
            case LoadCalibrations():
                self._update(checks_fault=Chip(sentence(message), Tone.BAD))

    def _on_done(self, news: TaskDone[Any]) -> None:
        task, answer = news.argument, news.answer
        match task:
            case LoadCalibrations():
                self._on_loaded(answer)
            case MeasureHealth():
                self._judging = False
                if self._read_by is task.gauges:
                    self._update(health=answer)
            case FitCalibration():
                self._calibrating.on_fitted(task, answer)
            case SaveCalibration():
                self._calibrating.on_saved(answer)
                self._submit(LoadCalibrations())
            case CheckGauge():
                self._checking.on_checked(task, answer)
                self._submit(LoadCalibrations())

    def _on_loaded(self, in_use: ActiveCalibrations) -> None:
        if in_use.gauges != self._gauges:
            self._gauges = in_use.gauges
            self._navigator.set_gauges(in_use.gauges)
        fault = Chip(sentence(in_use.checks_fault), Tone.BAD) if in_use.checks_fault else EMPTY_CHIP
        cards = gauge_cards(in_use.gauges, in_use.checks, self._now().date())
        self._update(cards=cards, file=in_use.file, checks_fault=fault)

    def _show_check(self, check: Any) -> None:
        self._update(check=check)

    def _show_calibration(self, calibration: Any) -> None:
        self._update(calibration=calibration)
