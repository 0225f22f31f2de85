"""The header of Record: device, true rate, losses, gauges, disk, each with its word."""

import datetime
from collections.abc import Callable
from dataclasses import replace

from app.acquisition.messages import Health
from app.acquisition.ring import Floats, RingRows
from app.presenters import number_text
from app.presenters.base import Chip, Tone
from app.presenters.record.live_traces import LiveTraces
from app.presenters.record.state import StatusBar
from config.schema import Gauge, Gauges
from drivers.samples import SampleStatus
from messages.i18n import gettext

DISK_SCARCE_BYTES = 2_000_000_000
DISK_CRITICAL_BYTES = 200_000_000
_OVERLOAD_SHOWN_S = 1.0


def rate_text(rate_hz: float) -> str:
    """Write `1000.02 Hz`."""
    return number_text.with_unit(number_text.format_fixed(rate_hz, 2 if rate_hz < 10_000.0 else 0), "Hz")


def lost_chip(health: Health) -> Chip:
    """Sum up every sample that came damaged or not at all."""
    lost = health.missing + health.missing_estimated + health.damaged
    hint = gettext(
        "{missing} missing, {estimated} missing by the clock, {damaged} damaged, of {samples} samples",
        missing=health.missing,
        estimated=health.missing_estimated,
        damaged=health.damaged,
        samples=health.samples,
    )
    return Chip(gettext("Lost {lost}", lost=lost), Tone.WARN if lost else Tone.OK, hint)


def disk_chip(free_bytes: int, bytes_per_s: float = 0.0) -> Chip:
    """Free space where runs are stored, and how long one could record into it."""
    text = gettext("{size} free", size=number_text.format_file_size(free_bytes))
    if bytes_per_s > 0.0:
        text += f", {_lasts(free_bytes / bytes_per_s)}"
    if free_bytes < DISK_CRITICAL_BYTES:
        return Chip(
            gettext("Disk nearly full: {text}", text=text),
            Tone.BAD,
            gettext("Make room before the next run."),
        )
    tone = Tone.WARN if free_bytes < DISK_SCARCE_BYTES else Tone.OK
    return Chip(
        gettext("Disk {text}", text=text),
        tone,
        gettext("Free space where runs are stored, and how long a recording it takes"),
    )


def device_chip(name: str, lost: str = "", silent_s: float = 0.0) -> Chip:
    """Who sends, and whether anything comes."""
    if lost:
        return Chip(gettext("{name} lost", name=name), Tone.BAD, lost)
    if silent_s > 0.0:
        time = number_text.with_unit(number_text.format_fixed(silent_s, 0), "s")
        text = gettext("engine silent for {time}", time=time)
        return Chip(
            text, Tone.WARN, gettext("The process that records has said nothing; it may be busy or hang.")
        )
    return Chip(name)


def tare_chip(tare_m: Floats) -> Chip:
    """Say by how much both gauges (2,) are shown from elsewhere."""
    by = gettext(" and ").join(
        number_text.with_unit(number_text.format_millimetres(x, 2), "mm") for x in tare_m.tolist()
    )
    return Chip(
        gettext("Tared by {by}", by=by),
        Tone.OK,
        gettext("The calibration and what is stored stay as they are"),
    )


def no_tare_chip() -> Chip:
    """Say why there is no tare."""
    return Chip(gettext("The stand moves: tare when it is at rest"), Tone.WARN)


def origin_text(live: LiveTraces) -> str:
    """From where the readings count."""
    if (live.zero_m != live.tare_m).any():
        return gettext("from the zero of this run")
    return gettext("from the tare") if live.tare_m.any() else gettext("by the calibration")


def _lasts(time_s: float) -> str:
    if time_s < 3600.0:
        return number_text.with_unit(number_text.format_fixed(time_s / 60.0, 0), "min")
    return number_text.with_unit(f"{time_s / 3600.0:,.0f}".replace(",", number_text.THIN_SPACE), "h")


class GaugeMonitor:
    """Watches one gauge: overload flags, nearness of its limit, age of its calibration.

    Parameters
    ----------
    name : str
        As shown, `Gauge 1`.
    channel : int
        0 table, 1 relative.
    gauge : Gauge
    """

    def __init__(self, name: str, channel: int, gauge: Gauge) -> None:
        self._name = name
        self._channel = channel
        self._gauge = gauge
        self._flag = (SampleStatus.OVERLOAD_TABLE, SampleStatus.OVERLOAD_RELATIVE)[channel]
        self._overloaded_s = float("-inf")

    def status(self, rows: RingRows, today: datetime.date) -> Chip:
        """Judge the gauge by the newest rows."""
        flagged = rows.time_s[(rows.status & self._flag) != 0]
        if len(flagged):
            self._overloaded_s = float(flagged[-1])
        if len(rows) and rows.time_s[-1] - self._overloaded_s < _OVERLOAD_SHOWN_S:
            return Chip(
                gettext("{name} overload", name=self._name),
                Tone.BAD,
                gettext("Readings are clipped: they are marked, not used."),
            )
        return self._at_limit(rows) or self._expired(today) or self._good()

    def _at_limit(self, rows: RingRows) -> Chip | None:
        range_m = self._gauge.range_m
        if range_m is None or not len(rows):
            return None
        value_m = (rows.table_m, rows.relative_m)[self._channel][-1]
        if not abs(value_m) > 0.95 * range_m:
            return None
        at = number_text.with_unit(number_text.format_millimetres(value_m), "mm")
        return Chip(
            gettext("{name} at its limit", name=self._name), Tone.WARN, gettext("It stands at {at}.", at=at)
        )

    def _expired(self, today: datetime.date) -> Chip | None:
        until = self._gauge.valid_until
        if until is None or until >= today:
            return None
        return Chip(
            gettext("{name} expired", name=self._name),
            Tone.WARN,
            gettext("Its calibration was valid until {day}.", day=until.isoformat()),
        )

    def _good(self) -> Chip:
        gauge = self._gauge
        dated = gettext(", calibrated {day}", day=gauge.date.isoformat()) if gauge.date else ""
        return Chip(
            gettext("{name} ok", name=self._name),
            Tone.OK,
            gettext(
                "Gauge {number}{dated}", number=gauge.serial_number or gettext("without number"), dated=dated
            ),
        )


_SILENT_S = 2.0
"""The engine says something twice a second; a busy machine may make it late."""


class StatusBarPresenter:
    """The header as it stands.

    Parameters
    ----------
    gauges : Gauges
    today : callable
        Day, to tell whether a calibration has expired.
    clock : callable
        Seconds that only rise.
    """

    def __init__(
        self, gauges: Gauges, today: Callable[[], datetime.date], clock: Callable[[], float]
    ) -> None:
        self.status_bar = StatusBar()
        self._gauges = gauges
        self._today = today
        self._clock = clock
        self._watches = self._new_watches()
        self._device = ""
        self._lost = ""
        self._heard_s = 0.0

    def start(self, device: str) -> None:
        """Another device is connected, or none."""
        self._device, self._lost = device, ""
        self._watches = self._new_watches()
        self.status_bar = StatusBar(device_chip(device), run=self.status_bar.run) if device else StatusBar()

    def set_gauges(self, gauges: Gauges) -> None:
        """These calibrations are in use now."""
        self._gauges = gauges
        self._watches = self._new_watches()

    def on_connected(self, device: str, rate_hz: float) -> None:
        """The device answers."""
        self._device = device
        self._update(device=device_chip(device), rate=rate_text(rate_hz))

    def on_device_lost(self, message: str) -> None:
        """The device is away; back if there is nothing to say."""
        self._lost = message
        self._update(device=device_chip(self._device, message))

    def on_event(self) -> None:
        """The engine has said something."""
        self._heard_s = self._clock()

    def check_silence(self) -> None:
        """Notice an engine that says nothing."""
        silent_s = self._clock() - self._heard_s
        if not self._lost:
            self._update(device=device_chip(self._device, silent_s=silent_s if silent_s > _SILENT_S else 0.0))

    def on_health(self, health: Health) -> None:
        """How the stream does."""
        self._update(
            rate=rate_text(health.rate_hz),
            lost_samples=lost_chip(health),
            disk=disk_chip(health.free_disk_bytes, health.bytes_per_s),
        )

    def check_gauges(self, rows: RingRows) -> None:
        """Look at the newest rows."""
        today = self._today()
        self._update(gauges=tuple(watch.status(rows, today) for watch in self._watches))

    def set_run(self, run: Chip) -> None:
        """Which run it is."""
        self._update(run=run)

    def _new_watches(self) -> tuple[GaugeMonitor, GaugeMonitor]:
        gauges = self._gauges
        return GaugeMonitor(gettext("Gauge 1"), 0, gauges.table), GaugeMonitor(
            gettext("Gauge 2"), 1, gauges.relative
        )

    def _update(self, **changes: object) -> None:
        self.status_bar = replace(self.status_bar, **changes)  # type: ignore[arg-type]
