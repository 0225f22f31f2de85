"""Presenter of the Gauges screen: calibrations in use, gauge health, presenters of the tabs."""

import datetime
from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING, Final

from analysis.catalogue import MICROMETRE, displacement_unit
from analysis.formatting import format_signed, typeset, with_unit
from app.acquisition.averaged_counts import WINDOW_S, RecentSamples
from app.acquisition.messages import Connected
from app.acquisition.ring import RingRows
from app.presenters.base import EMPTY_CHIP, Chip, LabelledValue, Presenter, TaskFailure, Tone
from app.presenters.device_status import DeviceStatus
from app.presenters.gauge_health_state import GaugeHealthState
from app.presenters.gauges.calibration import CalibrationPresenter
from app.presenters.gauges.check import CheckPresenter
from app.presenters.gauges.ports import PortsPresenter
from app.presenters.gauges.state import (
    NAMES,
    NO_SAMPLES,
    ActiveCalibrations,
    GaugeCard,
    GaugesState,
    GaugesTab,
)
from app.presenters.navigator import Navigator
from app.presenters.number_text import format_displacement, format_in
from app.presenters.results import sentence
from app.presenters.worker import LazyModule, Worker
from config.schema import Gauge, GaugeCheck, GaugeChecks, Gauges
from messages.i18n import N_, gettext, ngettext, translate

if TYPE_CHECKING:
    from app.presenters.gauges import tasks
else:
    tasks = LazyModule("app.presenters.gauges.tasks")

HEALTH_S: Final = 5.0
"""Length of the samples that health is measured from: resolves hum to 0.2 Hz and drift to minutes."""
HEALTH_EVERY_S: Final = 1.0
_LEAST_S: Final = 1.1  # least length: `measure_health` needs more than a second
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
        worker: Worker,
        port_worker: Worker,
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
        self.calibration = CalibrationPresenter(self._recent, worker, self._load_calibrations, now)
        self.check = CheckPresenter(self._recent, worker, self._load_calibrations)
        self._stream_gauges: Gauges | None = None
        self._rate_hz = 0.0
        self._is_shown = False
        self._is_measuring = False
        self._measured_s = self._live_s = float("-inf")

    def enter(self) -> None:
        """Reload calibrations and ports: they may have changed while another screen was shown."""
        self._is_shown = True
        self._load_calibrations()
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
        self.calibration.set_device(event.device)
        self.check.on_connected(self._stream_gauges, event.device)
        self._update(device=event.device, health_note=gettext(_WAITING))

    def on_disconnected(self) -> None:
        self.ports.connected_url = ""
        self._stream_gauges = None
        self._recent.clear()
        self._measured_s = self._live_s = float("-inf")
        self.calibration.set_device("")
        self.check.on_connected(None)
        self._update(device="", health=(), health_note=gettext(_NOT_CONNECTED))

    def on_device_status(self, status: DeviceStatus) -> None:
        """Samples come no longer, or again; an average of samples before and after is none."""
        if status.stopped_at:
            self._recent.clear()
        for tab in (self.calibration, self.check):
            tab.set_stopped(status.stopped_at)
        self._update(stopped_at=status.stopped_at)
        if self.state.device:
            lost = gettext(NO_SAMPLES, time=status.stopped_at)
            self._update(health_note=lost if status.stopped_at else gettext(_WAITING))

    def on_rows(self, rows: RingRows) -> None:
        self._recent.append(rows)

    def tick(self) -> None:
        self._worker.poll()
        self.ports.tick()
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

    def _load_calibrations(self) -> None:
        self._worker.submit(tasks.load_calibrations, done=self._on_loaded, failed=self._on_load_failed)

    def _on_loaded(self, loaded: ActiveCalibrations) -> None:
        if loaded.gauges != self._gauges:
            self._gauges = loaded.gauges
            self.navigator.set_gauges(loaded.gauges)
        fault = Chip(sentence(loaded.checks_fault), Tone.BAD) if loaded.checks_fault else EMPTY_CHIP
        cards = gauge_cards(loaded.gauges, loaded.checks, self._now().date())
        self._update(cards=cards, file=loaded.file, checks_fault=fault)

    def _on_load_failed(self, failure: TaskFailure) -> None:
        self._update(checks_fault=Chip(sentence(failure.message), Tone.BAD))

    def _measure_health(self, now_s: float) -> None:
        gauges = self._stream_gauges
        if self._is_measuring or gauges is None or now_s - self._measured_s < HEALTH_EVERY_S:
            return
        rows = self._recent.since(now_s - HEALTH_S)
        if rows is not None and self._recent.length_s >= _LEAST_S:
            self._is_measuring, self._measured_s = True, now_s
            done, failed = partial(self._on_measured, gauges), partial(self._on_measure_failed, gauges)
            self._worker.submit(tasks.measure_gauges, rows, self._rate_hz, gauges, done=done, failed=failed)

    def _on_measured(self, gauges: Gauges, health: tuple[GaugeHealthState, ...]) -> None:
        self._is_measuring = False
        if self._stream_gauges is gauges:
            self._update(health=health)

    def _on_measure_failed(self, gauges: Gauges, failure: TaskFailure) -> None:
        self._is_measuring = False
        if self._stream_gauges is gauges:
            self._update(health=(), health_note=sentence(failure.message))


_SOON: Final = datetime.timedelta(days=30)  # time that a laboratory usually needs to arrange a calibration


def gauge_cards(gauges: Gauges, checks: GaugeChecks, today: datetime.date) -> tuple[GaugeCard, ...]:
    """Cards of both gauges, gauge 1 first."""
    last = {check.gauge: check for check in checks.latest_checks(gauges)}
    used = ((gauges.table, last.get("table")), (gauges.relative, last.get("relative")))
    return tuple(
        GaugeCard(gettext(name), _validity(gauge, today), tuple(_values(gauge)), _last_check_chip(check))
        for name, (gauge, check) in zip(NAMES, used, strict=True)
    )


def _validity(gauge: Gauge, today: datetime.date) -> Chip:
    until = gauge.valid_until
    if until is None:
        return Chip(
            gettext("No expiry date stated"),
            Tone.PLAIN,
            gettext("Whoever calibrates next should say until when it holds"),
        )
    if gauge.is_expired(today):
        return Chip(
            gettext("EXPIRED on {until}", until=until),
            Tone.BAD,
            gettext("Calibrate the gauge before the next test"),
        )
    days = (until - today).days
    if until - today <= _SOON:
        left = gettext("Expires today")
        if days:
            left = ngettext("Expires in {count} day", "Expires in {count} days", days)
        return Chip(left, Tone.WARN, gettext("Calibrate the gauge soon"))
    return Chip(gettext("Valid until {until}", until=until), Tone.OK)


def _last_check_chip(check: GaugeCheck | None) -> Chip:
    if check is None:
        return Chip(
            gettext("Not checked yet"),
            Tone.PLAIN,
            gettext("Check it before a test: the tab Check, or slipstand calibrate check"),
        )
    off = typeset(format_signed(MICROMETRE.scale * check.deviation_m, 0))
    reference_kind = gettext("Known shunt") if check.kind == "shunt" else gettext("Known displacement")
    text = gettext(
        "{time}: {off} at {known}, {allowed} allowed",
        time=f"{check.at:%Y-%m-%d %H:%M}",
        off=with_unit(off, MICROMETRE.symbol),
        known=format_displacement(check.expected_m, 3),
        allowed=format_in(MICROMETRE, check.tolerance_m, 0),
    )
    by = f"{reference_kind}. {check.reference} {check.checked_by}".strip()
    if check.passed:
        return Chip(gettext("Check passed {words}", words=text), Tone.OK, by)
    return Chip(
        gettext("Check FAILED {words}", words=text),
        Tone.BAD,
        gettext("{by}. Check plugs and mounting, then calibrate again", by=by),
    )


def _range_text(range_m: float) -> str:
    unit = displacement_unit()
    return with_unit(f"± {unit.scale * range_m:.6g}", unit.symbol)


def _values(gauge: Gauge) -> Iterator[LabelledValue]:
    relative, range_m = gauge.gain_relative_standard_uncertainty, gauge.range_m
    polynomial = ", ".join(typeset(f"{term:.3g}") for term in gauge.polynomial)
    linearity = "" if gauge.nonlinearity_m is None else format_in(MICROMETRE, gauge.nonlinearity_m)
    gain, unit = MICROMETRE.scale * gauge.gain_m_per_count, f"{MICROMETRE.symbol}/count"
    values = {
        gettext("gain"): with_unit(typeset(f"{gain:.6g}"), unit),
        gettext("gain uncertainty"): "" if relative is None else with_unit(f"{100 * relative:.2f}", "%"),
        gettext("zero"): with_unit(typeset(f"{gauge.zero_count:.9g}"), "counts"),
        **({gettext("polynomial"): polynomial} if polynomial else {}),
        gettext("range"): "" if range_m is None else _range_text(range_m),
        **({gettext("non-linearity"): linearity} if linearity else {}),
        gettext("filter"): translate(gauge.filter.description) if gauge.filter else "",
        gettext("calibrated"): gauge.date.isoformat() if gauge.date else "",
        gettext("by"): gauge.calibrated_by,
        gettext("reference"): gauge.reference,
        gettext("certificate"): gauge.certificate,
        gettext("serial number"): gauge.serial_number,
    }
    for label, value in values.items():
        yield LabelledValue(label, value or gettext("not stated"))
