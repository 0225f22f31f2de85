"""Live data of the Record screen: traces, readings, and the status of device, stream and gauges."""

import datetime
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from analysis.formatting import THIN_SPACE, with_unit
from app.acquisition.messages import Health, LiveResult, PullbackState, StandPosition, is_known
from app.acquisition.pullback.plan import AllowedPlateRange
from app.acquisition.ring import RingRows
from app.presenters import number_text, results
from app.presenters.base import EMPTY_CHIP, Chip, Tone
from app.presenters.decimated_history import DecimatedHistory, Polyline
from app.presenters.record.state import LiveEstimate, LiveReadings, Span, TraceMarks, Traces
from app.presenters.results import FRICTION, MAIN, PLATE_FRICTION
from config.schema import Gauge, Gauges
from drivers.samples import SampleStatus
from messages.i18n import gettext

Floats = NDArray[np.float64]

ROLLING_S = 10.0  # time span before release: a pull takes a few seconds
BEFORE_RELEASE_S = 1.0  # shown before the release afterwards: as long as the usual pretrigger of a run
_TARE_S, _TARE_PARTS = 1.0, 10
_STILL_M = 50e-6
"""Largest difference of the means over tenths of a second at rest: above the noise and drift of a sound
gauge, below the motion of a hand."""
_MEAN_S = 0.05  # readings are means over this time: noise is suppressed, a pull by hand is followed
_READINGS_EVERY_S = 0.1  # digits that change more often cannot be read
PIXELS_MIN = 64
_SPANS_S = (2.0, 4.0, 8.0, 12.0, 20.0, 30.0, 60.0, 120.0, 300.0, 600.0, 1200.0, 3600.0)
_SIDE_KNOWN = 0.05
"""Part of the pullback from which on the table counts as pulled to its side: above noise and a knock."""
_LIMITS_MM = (0.5, 1.0, 2.0, 3.0, 5.0, 8.0, 10.0, 15.0, 20.0, 30.0, 40.0, 60.0, 100.0)
"""Axes grow in steps, so that they seldom change."""
_AFTER_RELEASE = (PullbackState.SLIPPING, PullbackState.NO_SLIP, PullbackState.TAIL)
_RUN_BEGINS = (PullbackState.RECENTRE, PullbackState.ZERO, PullbackState.RECORDING)
_TABLE_PULLED = (PullbackState.PULLING, PullbackState.HELD, PullbackState.ARMED)

DISK_SCARCE_BYTES = 2_000_000_000  # warn: some hours of recording at 10 kHz are left
DISK_CRITICAL_BYTES = 200_000_000  # alarm: less than a long run at a high rate
_SILENT_S = 2.0  # the engine reports twice a second; a busy computer delays it
_OVERLOAD_SHOWN_S = 1.0  # an overload of a single sample stays visible this long
_NEAR_LIMIT = 0.95  # part of a gauge's range beyond which a reading is near its limit


@dataclass(frozen=True, eq=False, slots=True)
class LiveTraces:
    """Samples since the connection, and what is drawn of them.

    Until release the last `ROLLING_S` are drawn. From release on, the time axis starts `BEFORE_RELEASE_S`
    before it and grows in steps. After the end of the run the traces stand still until `restarted`. All
    methods return a changed copy; only `samples` grows in place.
    """

    ranges_m: tuple[float | None, float | None] = (None, None)
    width_px: int = 800
    samples: DecimatedHistory = field(default_factory=DecimatedHistory)
    """Table and relative displacement (m)."""
    tare_m: Floats = field(default_factory=lambda: np.zeros(2))
    zero_m: Floats = field(default_factory=lambda: np.zeros(2))
    """Shown readings count from `zero_m`: the zero of a run, else the tare. Neither is stored."""
    tolerance_m: float = 0.0
    state: PullbackState | None = None
    release_s: float | None = None
    slip_s: Span | None = None
    end_s: float | None = None
    """On the time axis of the samples; None as long as they have not happened."""
    is_pulled: bool = False  # the table is being pulled or held
    side: int = 0  # side to which the table is pulled, or was pulled last: 1, -1, or 0 if unknown
    zoom_s: Span | None = None
    """Part of the shown time axis that is in view; None is all of it."""
    earlier: "LiveTraces | None" = None
    """An earlier run whose traces are shown until `restarted`."""
    stopped_at: str = ""
    """Time of day of the newest sample, where none comes any more."""
    read_s: float = float("-inf")
    traces: Traces = field(default_factory=Traces)
    readings: LiveReadings = field(default_factory=LiveReadings)

    @classmethod
    def of_gauges(cls, gauges: Gauges) -> "LiveTraces":
        return cls((gauges.table.range_m, gauges.relative.range_m))

    @property
    def is_settled(self) -> bool:
        """Tell whether new samples change nothing that is drawn."""
        has_ended = self.end_s is not None and self.samples.end_s >= self.end_s
        return self.earlier is not None or (has_ended and self.traces.span == self._time_axis()[1])

    def newest_m(self) -> Floats:
        """Mean of both gauges (2,) over the last `_MEAN_S`, as the gauges read; NaN without samples."""
        end_s = self.samples.end_s
        return self.samples.mean(end_s - _MEAN_S, end_s + 1e-9)

    def reconnected(self, gauges: Gauges) -> "LiveTraces":
        """Begin with another device; the drawn traces stay until samples come or `cleared`."""
        return replace(
            LiveTraces.of_gauges(gauges), width_px=self.width_px, zoom_s=self.zoom_s, traces=self.traces
        )

    def cleared(self, pullback_m: float) -> "LiveTraces":
        return replace(self, traces=self._draw(pullback_m, None))

    def restarted(self) -> "LiveTraces":
        rolling = replace(self, release_s=None, slip_s=None, end_s=None)
        return replace(rolling, zero_m=self.tare_m, is_pulled=False, earlier=None)

    def stopped(self) -> "LiveTraces":
        """End the run with the newest sample, unless its end is known."""
        return self if self.end_s is not None else replace(self, end_s=self.samples.end_s)

    def dated(self, stopped_at: str) -> "LiveTraces":
        """Date what is shown by the time of day of the last sample; "" shows it as live again."""
        dated = replace(self, stopped_at=stopped_at, readings=replace(self.readings, stopped_at=stopped_at))
        if self.is_settled or self.release_s is not None:
            return dated
        return replace(dated, traces=replace(self.traces, time_title=dated._time_title()))

    def with_earlier(self, earlier: "LiveTraces") -> "LiveTraces":
        """Show traces of an earlier run until `restarted`."""
        shown = replace(self, earlier=earlier.earlier or earlier, traces=earlier.traces)
        return shown if self.zoom_s == earlier.zoom_s else shown.zoomed(self.zoom_s)

    def zoomed(self, zoom_s: Span | None) -> "LiveTraces":
        """Draw a part of the shown time axis, or all of it, as finely as its pixels allow."""
        changed = replace(self, zoom_s=zoom_s)
        drawn = replace(self.earlier or self, width_px=self.width_px, zoom_s=zoom_s)
        if not len(drawn.samples):  # traces of the device before stay
            return changed
        origin_s, _ = drawn._time_axis()
        table, relative = drawn._lines(origin_s, zoom_s or self.traces.span)
        return replace(changed, traces=replace(self.traces, table=table, relative=relative))

    def tared(self) -> "LiveTraces | None":
        """Count readings from where both gauges stand; None if they were not at rest for a second."""
        end_s = self.samples.end_s
        edges_s = end_s + _TARE_S * np.linspace(-1.0, 0.0, _TARE_PARTS + 1)
        parts_m = np.array([self.samples.mean(start_s, to_s) for start_s, to_s in pairwise(edges_s)])
        if not np.ptp(parts_m, axis=0).max() < _STILL_M:  # False for NaN, where readings are missing
            return None
        return self._counted_from(parts_m.mean(axis=0))

    def untared(self) -> "LiveTraces":
        return self._counted_from(np.zeros(2))

    def on_state(self, state: PullbackState, since_s: float, position: StandPosition) -> "LiveTraces":
        """Take a state of the pullback test; one that is reported again moves no mark."""
        changed = self if state is self.state else self._moved_on(state, since_s)
        zero_m = changed.zero_m
        if position.table_zero_m is not None:
            zero_m = np.array([position.table_zero_m, position.relative_zero_m or 0.0])
        side = position.side or changed.side
        return replace(changed, state=state, tolerance_m=position.tolerance_m, zero_m=zero_m, side=side)

    def with_rows(
        self, rows: RingRows, pullback_m: float, plate_range: AllowedPlateRange | None
    ) -> "LiveTraces":
        """Append samples, at least one, and draw them; readings are taken every `_READINGS_EVERY_S`.

        `pullback_m` is the nominal pullback; `plate_range` is drawn unless it is None.
        """
        is_settled = self.is_settled
        self.samples.append(rows.time_s, np.column_stack((rows.table_m, rows.relative_m)))
        changed = self
        if not is_settled:
            changed = replace(self, side=self._side(pullback_m)) if self.is_pulled else self
            changed = replace(changed, traces=changed._draw(pullback_m, plate_range))
        newest_s = float(rows.time_s[-1])
        return changed if newest_s - self.read_s < _READINGS_EVERY_S else changed._read(newest_s)

    def _counted_from(self, zero_m: Floats) -> "LiveTraces":
        return replace(self, tare_m=zero_m, zero_m=zero_m)._read(self.read_s)

    def _read(self, at_s: float) -> "LiveTraces":
        table, relative = (
            number_text.displacement_number(m, 2) for m in (self.newest_m() - self.zero_m).tolist()
        )
        readings = LiveReadings(table, relative, self._origin(), self.stopped_at)
        return replace(self, read_s=at_s, readings=readings)

    def _origin(self) -> str:
        if (self.zero_m != self.tare_m).any():
            return gettext("from the zero of this run")
        return gettext("from the tare") if self.tare_m.any() else gettext("by the calibration")

    def _moved_on(self, state: PullbackState, since_s: float) -> "LiveTraces":
        changed = self
        if state in _RUN_BEGINS:
            changed = self.restarted()
        elif state is PullbackState.PULLING:  # the table was let down, not released
            changed = replace(self, release_s=None, slip_s=None)
        elif state is PullbackState.RELEASED or (state in _AFTER_RELEASE and self.release_s is None):
            changed = replace(self, release_s=since_s)
        elif state is PullbackState.CLOSING:
            changed = replace(self, end_s=since_s)
        slip_s = changed.slip_s
        if state is PullbackState.SLIPPING:
            slip_s = (since_s, np.inf)
        elif slip_s is not None and slip_s[1] == np.inf:
            slip_s = (slip_s[0], since_s)
        return replace(changed, slip_s=slip_s, is_pulled=state in _TABLE_PULLED)

    def _draw(self, pullback_m: float, room: AllowedPlateRange | None) -> Traces:
        origin_s, span = self._time_axis()
        table, relative = self._lines(origin_s, span)
        seen = (table, relative) if self.zoom_s is None else self._lines(origin_s, self.zoom_s)
        is_released = self.release_s is not None
        marks = TraceMarks(
            before_release=(-BEFORE_RELEASE_S, 0.0) if is_released else None,
            release_s=0.0 if is_released else None,
            slip=self._slip_span(origin_s, span),
            target_mm=self._target_mm(pullback_m) if self.is_pulled else None,
            table_range_mm=self._range_mm(0),
            relative_range_mm=self._range_mm(1),
            plate_range_mm=None if room is None else self._shown_mm(1, room.low_m, room.high_m),
        )
        return Traces(
            table=seen[0],
            relative=seen[1],
            span=span,
            time_title=self._time_title(),
            table_limit_mm=_limit_mm(table, pullback_m, marks.table_range_mm),
            relative_limit_mm=_limit_mm(relative, pullback_m, marks.relative_range_mm),
            marks=marks,
        )

    def _lines(self, origin_s: float, span: Span) -> tuple[Polyline, Polyline]:
        """Both channels in a part of the time axis."""
        last_s = min(origin_s + span[1], np.inf if self.end_s is None else self.end_s)
        lines = self.samples.lines(origin_s + span[0], last_s + 1e-9, self.width_px)
        table, relative = (
            Polyline(line.time_s - origin_s, 1e3 * (line.value - zero_m))
            for line, zero_m in zip(lines, self.zero_m, strict=True)
        )
        return table, relative

    def _time_title(self) -> str:
        if self.release_s is not None:
            return gettext("time from release, s")
        if self.stopped_at:
            return gettext("time from {time}, s", time=self.stopped_at)
        return gettext("time from now, s")

    def _time_axis(self) -> tuple[float, Span]:
        now_s = self.samples.end_s if self.end_s is None else self.end_s
        if not np.isfinite(now_s):
            return 0.0, (-ROLLING_S, 0.0)
        if self.release_s is None:
            return now_s, (-ROLLING_S, 0.0)
        since_s = now_s - self.release_s
        last_s = _step_up(since_s, _SPANS_S) if self.end_s is None else since_s
        return self.release_s, (-BEFORE_RELEASE_S, last_s)

    def _side(self, pullback_m: float) -> int:
        """Side of the pull; as before until the table is far enough on one."""
        pulled_m = float(self.newest_m()[0] - self.zero_m[0])
        if not abs(pulled_m) > _SIDE_KNOWN * pullback_m:  # also NaN
            return self.side
        return 1 if pulled_m > 0.0 else -1

    def _target_mm(self, pullback_m: float) -> Span | None:
        if not self.side:
            return None
        target_m = self.side * pullback_m
        return 1e3 * (target_m - self.tolerance_m), 1e3 * (target_m + self.tolerance_m)

    def _range_mm(self, channel: int) -> Span | None:
        range_m = self.ranges_m[channel]
        return None if range_m is None else self._shown_mm(channel, -range_m, range_m)

    def _shown_mm(self, channel: int, low_m: float, high_m: float) -> Span:
        zero_m = float(self.zero_m[channel])
        return 1e3 * (low_m - zero_m), 1e3 * (high_m - zero_m)

    def _slip_span(self, origin_s: float, span: Span) -> Span | None:
        if self.slip_s is None:
            return None
        start_s, end_s = (at_s - origin_s for at_s in self.slip_s)
        return max(start_s, span[0]), min(end_s, self.samples.end_s - origin_s)


def _limit_mm(line: Polyline, pullback_m: float, ends_mm: Span | None) -> float:
    """Half height of an axis: holds pullback and all drawn values, and the gauge range if that is near."""
    present = line.value[np.isfinite(line.value)]
    largest = float(np.abs(present).max(initial=0.0))
    limit = _step_up(1.1 * max(largest, 1e3 * pullback_m, 0.4), _LIMITS_MM)
    if ends_mm is None:
        return limit
    range_mm = max(abs(end) for end in ends_mm)
    return 1.12 * range_mm if 0.8 * range_mm <= limit and largest <= range_mm else limit


def _step_up(wanted: float, steps: Iterable[float]) -> float:
    return next((step for step in steps if step >= wanted), wanted)


def tare_chip(live: LiveTraces | None) -> Chip:
    if live is None:
        return Chip(gettext("The stand moves: tare when it is at rest"), Tone.WARN)
    by = gettext(" and ").join(number_text.format_displacement(m, 2) for m in live.tare_m.tolist())
    hint = gettext("The calibration and what is stored stay as they are")
    return Chip(gettext("Tared by {by}", by=by), Tone.OK, hint)


def live_estimate(result: LiveResult) -> LiveEstimate:
    """Rows of T, n1 and f_d as far as they are known, and whether waiting still narrows them."""
    if result.message:
        return LiveEstimate(note=results.sentence(result.message))
    values = (result.period, result.damping_n1, result.friction_dynamic, result.friction_dynamic_plate)
    rows = tuple(
        results.make_row(shown, value)
        for shown, value in zip((*MAIN, FRICTION, PLATE_FRICTION), values, strict=True)
        if value is not None and is_known(value)
    )
    return LiveEstimate(rows, _stop_note(result) if result.may_stop else "")


def _stop_note(result: LiveResult) -> str:
    symbols = {shown.name: shown.symbol.html for shown in (*MAIN, FRICTION)}
    narrower = gettext(" and ").join(symbols[name] for name in result.narrowing if name in symbols)
    may_stop = gettext("Waiting no longer narrows f<sub>d</sub>: you may stop")
    if not narrower:
        return may_stop
    return gettext("{may_stop}; it still narrows {what}", may_stop=may_stop, what=narrower)


def rate_text(rate_hz: float) -> str:
    return with_unit(number_text.format_fixed(rate_hz, 2 if rate_hz < 10_000.0 else 0), "Hz")


def lost_samples_chip(health: Health) -> Chip:
    lost = health.missing + health.missing_estimated + health.damaged
    hint = gettext(
        "{missing} missing, {estimated} missing by the clock, {damaged} damaged, of {samples} samples",
        missing=health.missing,
        estimated=health.missing_estimated,
        damaged=health.damaged,
        samples=health.samples,
    )
    return Chip(gettext("Lost {lost}", lost=lost), Tone.WARN if lost else Tone.OK, hint)


def disk_chip(health: Health) -> Chip:
    free_bytes = health.free_disk_bytes
    if free_bytes is None:
        return EMPTY_CHIP
    text = gettext("{size} free", size=number_text.format_file_size(free_bytes))
    if health.bytes_per_s > 0.0:
        text += f", {_duration_text(free_bytes / health.bytes_per_s)}"
    if free_bytes < DISK_CRITICAL_BYTES:
        hint = gettext("Make room before the next run.")
        return Chip(gettext("Disk nearly full: {text}", text=text), Tone.BAD, hint)
    tone = Tone.WARN if free_bytes < DISK_SCARCE_BYTES else Tone.OK
    hint = gettext("Free space where runs are stored, and how long a recording it takes")
    return Chip(gettext("Disk {text}", text=text), tone, hint)


def simulated_chip(is_simulated: bool) -> Chip:
    if not is_simulated:
        return EMPTY_CHIP
    hint = gettext("Readings and runs are those of a simulated stand. Its runs are marked as simulated.")
    return Chip(gettext("SIMULATED"), Tone.WARN, hint)


def device_chip(name: str, loss_reason: str = "", silent_s: float = 0.0) -> Chip:
    """Name of the device, whether it is lost, and whether the engine is silent."""
    if loss_reason:
        return Chip(gettext("{name} lost", name=name), Tone.BAD, loss_reason)
    if silent_s > _SILENT_S:
        time = with_unit(number_text.format_fixed(silent_s, 0), "s")
        hint = gettext("The process that records has said nothing; it may be busy or hang.")
        return Chip(gettext("engine silent for {time}", time=time), Tone.WARN, hint)
    return Chip(name)


@dataclass(frozen=True, slots=True)
class GaugeMonitor:
    """Status of one gauge: overload, nearness of its limit, age of its calibration."""

    channel: int  # 0 table, 1 relative
    gauge: Gauge
    overload_s: float = float("-inf")

    @property
    def name(self) -> str:
        return (gettext("Gauge 1"), gettext("Gauge 2"))[self.channel]

    def with_rows(self, rows: RingRows) -> "GaugeMonitor":
        flag = (SampleStatus.OVERLOAD_TABLE, SampleStatus.OVERLOAD_RELATIVE)[self.channel]
        flagged_s = rows.time_s[(rows.status & flag) != 0]
        return replace(self, overload_s=float(flagged_s[-1])) if len(flagged_s) else self

    def chip(self, rows: RingRows, today: datetime.date) -> Chip:
        """Judge the gauge by the newest rows; at least one."""
        if rows.time_s[-1] - self.overload_s < _OVERLOAD_SHOWN_S:
            hint = gettext("Readings are clipped: they are marked, not used.")
            return Chip(gettext("{name} overload", name=self.name), Tone.BAD, hint)
        value_m = (rows.table_m, rows.relative_m)[self.channel][-1]
        range_m, until = self.gauge.range_m, self.gauge.valid_until
        if range_m is not None and abs(value_m) > _NEAR_LIMIT * range_m:
            at = number_text.format_displacement(float(value_m))
            hint = gettext("It stands at {at}.", at=at)
            return Chip(gettext("{name} at its limit", name=self.name), Tone.WARN, hint)
        if until is not None and until < today:
            hint = gettext("Its calibration was valid until {day}.", day=until.isoformat())
            return Chip(gettext("{name} expired", name=self.name), Tone.WARN, hint)
        return Chip(gettext("{name} ok", name=self.name), Tone.OK, self._description())

    def _description(self) -> str:
        gauge = self.gauge
        dated = gettext(", calibrated {day}", day=gauge.date.isoformat()) if gauge.date else ""
        number = gauge.serial_number or gettext("without number")
        return gettext("Gauge {number}{dated}", number=number, dated=dated)


def _duration_text(time_s: float) -> str:
    if time_s < 3600.0:
        return with_unit(number_text.format_fixed(time_s / 60.0, 0), "min")
    hours = f"{time_s / 3600.0:,.0f}".replace(",", THIN_SPACE)
    return with_unit(hours, "h")
