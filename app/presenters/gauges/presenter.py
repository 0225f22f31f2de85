"""Presenter of the Gauges screen: calibrations in use, gauge health, presenters of the tabs."""

import datetime
from collections.abc import Callable
from typing import Any, Final

from app.acquisition.messages import Connected
from app.acquisition.ring import RingRows
from app.presenters.base import EMPTY_CHIP, Chip, Presenter, Tone
from app.presenters.events import TaskDone, TaskFailed, WorkerEvent
from app.presenters.gauges.calibration import CalibrationPresenter
from app.presenters.gauges.cards import gauge_cards
from app.presenters.gauges.check import CheckPresenter
from app.presenters.gauges.ports import PortsPresenter
from app.presenters.gauges.recent_samples import WINDOW_S, RecentSamples
from app.presenters.gauges.state import GaugesState, GaugesTab
from app.presenters.gauges.tasks import (
    EXECUTE,
    ActiveCalibrations,
    CheckGauge,
    FitCalibration,
    GaugesTask,
    LoadCalibrations,
    MeasureHealth,
    SaveCalibration,
)
from app.presenters.navigator import Navigator
from app.presenters.results import sentence
from app.presenters.worker import EventWorker
from config.schema import GaugeChecks, Gauges
from messages.i18n import N_, gettext
from messages.message import Message

HEALTH_S: Final = 5.0
"""Length of the samples that health is measured from: resolves hum to 0.2 Hz and drift to minutes."""
HEALTH_EVERY_S: Final = 1.0
_LEAST_S: Final = 1.1
"""Least length: `measure_health` needs more than a second."""
_LIVE_EVERY_S: Final = 0.1
_NOT_CONNECTED: Final = N_(
    "Nothing is connected. Connect the device, let the stand rest, and noise, drift, hum and spectrum of both"
    " gauges appear here."
)
_WAITING: Final = N_("Looking at the gauges: let the stand rest for a few seconds.")


class GaugesPresenter(Presenter[GaugesState]):
    """Calibrations, health, and presenters of the tabs; `close` ends both workers."""

    def __init__(
        self,
        worker: EventWorker,
        port_worker: EventWorker,
        gauges: Gauges,
        navigator: Navigator,
        now: Callable[[], datetime.datetime] = datetime.datetime.now,
    ) -> None:
        cards = gauge_cards(gauges, GaugeChecks(), now().date())
        super().__init__(GaugesState(cards, health_note=gettext(_NOT_CONNECTED)))
        self._worker = worker
        self._gauges = gauges
        self.navigator = navigator
        self._now = now
        self._recent = RecentSamples(max(HEALTH_S, WINDOW_S + 1.0))
        self.ports = PortsPresenter(port_worker, navigator)
        self.calibration = CalibrationPresenter(self._recent, self._submit, now)
        self.check = CheckPresenter(self._recent, self._submit)
        self._stream_gauges: Gauges | None = None
        self._rate_hz = 0.0
        self._is_shown = False
        self._is_measuring = False
        self._measured_s = self._live_s = float("-inf")

    def enter(self) -> None:
        """Reload calibrations and ports: they may have changed while another screen was shown."""
        self._is_shown = True
        self._submit(LoadCalibrations())
        self.ports.list_ports()

    def leave(self) -> None:
        self._is_shown = False

    def set_tab(self, tab: GaugesTab) -> None:
        self._update(tab=tab)

    def on_connecting(self, port: str) -> None:
        """A port is being opened; its samples are converted with the calibrations in use now."""
        self.on_disconnected()
        self.ports.connected_url = port
        self._stream_gauges = self._gauges

    def on_connected(self, event: Connected) -> None:
        self._rate_hz = event.rate_hz
        self.calibration.set_connected(True)
        self.check.on_connected(self._stream_gauges, event.device)
        self._update(device=event.device, health_note=gettext(_WAITING))

    def on_disconnected(self) -> None:
        self.ports.connected_url = ""
        self._stream_gauges = None
        self._recent.clear()
        self._measured_s = self._live_s = float("-inf")
        self.calibration.set_connected(False)
        self.check.on_connected(None)
        self._update(device="", health=(), health_note=gettext(_NOT_CONNECTED))

    def on_rows(self, rows: RingRows) -> None:
        self._recent.append(rows)

    def tick(self) -> None:
        for event in self._worker.poll():
            self._on_event(event)
        self.ports.poll()
        now_s = self._recent.end_s
        is_reading = self.calibration.state.reading_status or self.check.state.reading_status
        if (self._is_shown or is_reading) and now_s - self._live_s >= _LIVE_EVERY_S:
            self._live_s = now_s
            self.calibration.tick()
            self.check.tick()
        if self._is_shown and self.state.tab is GaugesTab.HEALTH:
            self._measure_health(now_s)

    def close(self) -> None:
        self._worker.close()
        self.ports.close()

    def _submit(self, task: GaugesTask) -> None:
        self._worker.submit(EXECUTE, task)

    def _measure_health(self, now_s: float) -> None:
        if self._is_measuring or self._stream_gauges is None or now_s - self._measured_s < HEALTH_EVERY_S:
            return
        rows = self._recent.since(now_s - HEALTH_S)
        if rows is not None and self._recent.length_s >= _LEAST_S:
            self._is_measuring, self._measured_s = True, now_s
            self._submit(MeasureHealth(rows, self._rate_hz, self._stream_gauges))

    def _on_event(self, event: WorkerEvent) -> None:
        if isinstance(event, TaskFailed):
            self._on_failed(event.argument, event.message)
        elif isinstance(event, TaskDone):
            self._on_done(event)

    def _on_failed(self, task: Any, message: Message) -> None:
        match task:
            case FitCalibration() | SaveCalibration():
                self.calibration.on_failed(task, message)
            case CheckGauge():
                self.check.on_failed(message)
            case MeasureHealth():
                self._is_measuring = False
                if self._stream_gauges is task.gauges:
                    self._update(health=(), health_note=sentence(message))
            case LoadCalibrations():
                self._update(checks_fault=Chip(sentence(message), Tone.BAD))

    def _on_done(self, event: TaskDone[Any]) -> None:
        task, answer = event.argument, event.answer
        match task:
            case LoadCalibrations():
                self._on_loaded(answer)
            case MeasureHealth():
                self._is_measuring = False
                if self._stream_gauges is task.gauges:
                    self._update(health=answer)
            case FitCalibration():
                self.calibration.on_fitted(task, answer)
            case SaveCalibration():
                self.calibration.on_saved(answer)
                self._submit(LoadCalibrations())
            case CheckGauge():
                self.check.on_checked(task, answer)
                self._submit(LoadCalibrations())

    def _on_loaded(self, loaded: ActiveCalibrations) -> None:
        if loaded.gauges != self._gauges:
            self._gauges = loaded.gauges
            self.navigator.set_gauges(loaded.gauges)
        fault = Chip(sentence(loaded.checks_fault), Tone.BAD) if loaded.checks_fault else EMPTY_CHIP
        cards = gauge_cards(loaded.gauges, loaded.checks, self._now().date())
        self._update(cards=cards, file=loaded.file, checks_fault=fault)
