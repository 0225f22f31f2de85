"""Presenter of the tab Calibrate: live readings against a dial gauge, fitted at once, saved as a file."""

import datetime
import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import msgspec

from analysis.formatting import typeset, with_unit
from app.acquisition.averaged_counts import (
    AveragedCounts,
    NoAverageError,
    ReadingAverager,
    RecentSamples,
    average_counts,
)
from app.acquisition.ring import RingRows
from app.presenters.base import EMPTY_CHIP, Chip, Presenter, State, TaskFailure, Tone
from app.presenters.gauges.state import (
    CONNECTION_LOST,
    DEVICE_LOST,
    NO_DEVICE,
    NO_SAMPLES,
    CalibrationData,
    CalibrationFit,
    CalibrationForm,
    CalibrationPoint,
    CalibrationState,
)
from app.presenters.number_text import FormError, format_fixed, normalize_number, parse_number
from app.presenters.results import sentence
from app.presenters.worker import LazyModule, Worker
from config.schema import Filter
from messages.i18n import N_, gettext
from messages.message import MessageError

if TYPE_CHECKING:
    from app.presenters.gauges import tasks
else:
    tasks = LazyModule("app.presenters.gauges.tasks")

_LIVE_S: Final = 0.5
"""Averaging time of the live counts: long enough to read the number, short enough to follow a hand."""
_NAMES: Final = ("table", "relative")
_FITTED_FROM: Final = 2
"""Fewer points than this many plus one do not determine a line with a residual; that is no fault."""


class ReadingPresenter(Presenter[State]):
    """Base of a tab that averages readings; calls `on_kept` when it has written a file.

    Its state has the fields `message`, `reading_status` and `stopped_at`.
    """

    def __init__(
        self, state: State, recent: RecentSamples, worker: Worker, on_kept: Callable[[], None]
    ) -> None:
        super().__init__(state)
        self._averager = ReadingAverager(recent)
        self._worker = worker
        self._on_kept = on_kept
        self._stopped_at = ""

    def set_stopped(self, stopped_at: str) -> None:
        """Samples have stopped at this time of day, which ends a reading; "" if they come again."""
        self._stopped_at = stopped_at
        self._update(stopped_at=stopped_at)

    def _show_error(self, error: MessageError | TaskFailure, **changes: Any) -> None:
        self._update(message=Chip(sentence(error.message), Tone.BAD), **changes)

    def _take_reading(self, gauge: int) -> AveragedCounts | None:
        """Return a reading once it is complete; its progress or failure is shown."""
        try:
            average = self._averager.poll(gauge)
        except NoAverageError as error:
            text = gettext("Not taken. {words}", words=sentence(error.message))
            self._update(reading_status="", message=Chip(text, Tone.BAD))
            return None
        if average is None or not self._averager.is_active:
            return average
        creep = typeset(f"{average.creep_counts:.3g}")
        self._update(reading_status=gettext("Still moving by {creep} counts, waiting", creep=creep))
        return None


class CalibrationPresenter(ReadingPresenter[CalibrationState]):
    """Takes one reading at a time, and fits a calibration to them."""

    def __init__(
        self,
        recent: RecentSamples,
        worker: Worker,
        on_kept: Callable[[], None],
        now: Callable[[], datetime.datetime],
    ) -> None:
        super().__init__(CalibrationState(live_note=gettext(NO_DEVICE)), recent, worker, on_kept)
        self._recent = recent
        self._now = now
        self._device = ""
        self._device_of_points = ""
        self._dial_mm = 0.0
        self._file_name = ""

    def set_form(self, form: CalibrationForm) -> None:
        before = self.state.form
        if self.state.points:
            form = replace(form, gauge=before.gauge)
        self._update(form=form, live_value=self.state.live_value if form.gauge == before.gauge else "")
        if _fit_options(form) != _fit_options(before):
            self._fit()

    def take_point(self, dial_text: str) -> None:
        """Begin a reading at the dial reading (mm) that was typed."""
        try:
            dial_mm = _millimetres(dial_text, gettext("Dial"))
        except FormError as error:
            self._show_error(error)
            return
        fault = self._why_not_taken()
        if fault:
            self._update(message=Chip(fault, Tone.WARN))
            return
        self._dial_mm = dial_mm
        status = gettext("Averaging at {dial:g} mm: hold the table still", dial=dial_mm)
        self._update(reading_status=status, message=EMPTY_CHIP)

    def undo(self) -> None:
        if self._averager.is_active:
            self._averager.stop()
            self._update(reading_status="", message=Chip(gettext("Not taken"), Tone.PLAIN))
        elif self.state.points:
            last = self.state.points[-1]
            text = gettext("Reading at {dial:g} mm taken back", dial=last.dial_mm)
            self._update(points=self.state.points[:-1], message=Chip(text))
            self._fit()

    def restart(self) -> None:
        self._averager.stop()
        self._update(points=(), fit=None, can_save=False, reading_status="", message=EMPTY_CHIP)

    def save(self) -> None:
        if not self.state.can_save:
            return
        if self._stopped_at or self._device != self._device_of_points:
            template = N_(
                "Not saved: {device}, which these readings are of, sends nothing. Connect it and save again;"
                " the readings are kept in {file}"
            )
            text = gettext(template, device=self._device_of_points, file=self._file_name)
            self._update(message=Chip(text, Tone.BAD))
            return
        form, today = self.state.form, self._now().date()
        try:
            data, valid_until = self._data(), _last_day(form.valid_until, today)
            stated = _stated_filter(form)
        except FormError as error:
            self._show_error(error)
            return
        self._update(message=Chip(gettext("Writing"), Tone.PLAIN), can_save=False)
        done, failed = self._on_saved, partial(self._show_error, can_save=True)
        given = form, data, today, valid_until, stated
        self._worker.submit(tasks.save_calibration, *given, done=done, failed=failed)

    def set_device(self, device: str) -> None:
        """Live samples come from this device from now on, or from none."""
        self._device = device
        was_averaging = self._averager.is_active
        self._averager.stop()
        self._update(live_value="", live_note=gettext(NO_DEVICE), reading_status="", offers_reconnect=False)
        if was_averaging:
            self._update(message=Chip(gettext(CONNECTION_LOST), Tone.WARN))

    def set_stopped(self, stopped_at: str) -> None:
        super().set_stopped(stopped_at)
        if stopped_at and self._averager.is_active:
            self._averager.stop()
            text = gettext(DEVICE_LOST, time=stopped_at)
            self._update(reading_status="", message=Chip(text, Tone.BAD))

    def tick(self) -> None:
        if not self._device:
            return
        rows = self._recent.since(self._recent.end_s - _LIVE_S)
        if rows is not None:
            self._show_live(rows)
        average = self._take_reading(self.state.form.gauge)
        if average is not None:
            self._add_point(average, self._dial_mm)

    def _why_not_taken(self) -> str:
        """Begin a reading; return why none can be taken, else an empty text."""
        if self._stopped_at:
            return gettext(NO_SAMPLES, time=self._stopped_at)
        if self.state.points and self._device != self._device_of_points:
            template = N_("The readings before are of {device}: start over to calibrate with {other}")
            return gettext(template, device=self._device_of_points, other=self._device or gettext("none"))
        return "" if self._device and self._averager.start() else gettext(NO_DEVICE)

    def _show_live(self, rows: RingRows) -> None:
        try:
            mean, noise = _format_counts(average_counts(rows, self.state.form.gauge))
        except NoAverageError as error:
            self._update(live_value="", live_note=sentence(error.message))
            return
        time = with_unit(f"{_LIVE_S:g}", "s")
        note = gettext("counts, mean of {time}; noise {noise}", time=time, noise=noise)
        self._update(live_value=mean, live_note=note)

    def _add_point(self, average: AveragedCounts, dial_mm: float) -> None:
        text = gettext("{dial:g} mm: {counts} counts taken", dial=dial_mm, counts=_format_counts(average)[0])
        tone, creep = Tone.OK, typeset(f"{average.creep_counts:.3g}")
        if not average.is_steady:
            text = gettext("{words}, though still creeping by {creep}", words=text, creep=creep)
            tone = Tone.WARN
        if not self.state.points:
            self._device_of_points = self._device
            self._file_name = f"readings-{_NAMES[self.state.form.gauge]}-{self._now():%Y-%m-%d-%H%M%S}.csv"
        points = (*self.state.points, CalibrationPoint(average.counts, dial_mm))
        self._update(points=points, reading_status="", message=Chip(text, tone))
        self._fit()

    def _fit(self) -> None:
        if not self.state.points:
            self._update(fit=None, can_save=False)
            return
        try:
            data = self._data()
        except FormError as error:
            self._show_error(error, can_save=False)
            return
        done, failed = partial(self._on_fitted, data.points), partial(self._on_fit_failed, data.points)
        self._worker.submit(tasks.fit_calibration, data, done=done, failed=failed)

    def _on_fitted(self, points: tuple[CalibrationPoint, ...], fit: CalibrationFit) -> None:
        if points == self.state.points:
            self._update(fit=fit, can_save=True)

    def _on_fit_failed(self, points: tuple[CalibrationPoint, ...], failure: TaskFailure) -> None:
        if points == self.state.points:
            tone = Tone.PLAIN if len(points) <= _FITTED_FROM else Tone.WARN
            self._update(fit=None, can_save=False, message=Chip(sentence(failure.message), tone))

    def _on_saved(self, files: tuple[str, str]) -> None:
        file, previous = files
        text = gettext("Written to {file}.", file=file)
        if previous:
            text += " " + gettext("The one before is kept as {file}.", file=previous)
        offers_reconnect = self.state.form.use and bool(self._device)
        self._update(message=Chip(text, Tone.OK), can_save=True, offers_reconnect=offers_reconnect)
        self._on_kept()

    def _data(self) -> CalibrationData:
        form, uncertainty_m = self.state.form, None
        if form.uncertainty_mm.strip():
            uncertainty_mm = _millimetres(form.uncertainty_mm, gettext("Uncertainty of the dial"), least=0.0)
            uncertainty_m = uncertainty_mm * 1e-3
        resolution_mm = _millimetres(form.resolution_mm, gettext("Resolution of the dial"), least=0.0)
        return CalibrationData(
            self.state.points, form.degree, resolution_mm * 1e-3, uncertainty_m, self._file_name
        )


def _fit_options(form: CalibrationForm) -> tuple[object, ...]:
    return form.degree, form.resolution_mm, form.uncertainty_mm


def _format_counts(average: AveragedCounts) -> tuple[str, str]:
    """Mean and noise with the decimals that the standard error of the mean justifies."""
    noise = average.noise_counts
    decimals = 0 if noise <= 0.0 else min(max(1 - math.floor(math.log10(noise / average.samples**0.5)), 0), 9)
    return format_fixed(average.counts, decimals), format_fixed(noise, decimals)


def _millimetres(text: str, name: str, least: float = -math.inf) -> float:
    """Parse a length (mm). Raises FormError that names value and remedy."""
    value_mm = parse_number(text)
    if value_mm is None or math.isnan(value_mm) or value_mm < least:
        template = N_("{name} {text!r} is not a number of millimetres{limit}: write one like 2.5")
        limit = gettext(", 0 or above") if least == 0.0 else ""
        raise FormError(template, name=name, text=text.strip(), limit=limit)
    return value_mm


def _stated_filter(form: CalibrationForm) -> Filter | None:
    """Read the filter, None to keep it as it was. Raises FormError."""
    kind = form.filter_kind
    if kind is None or kind == "none":
        return kind and Filter(kind)
    given = {
        "kind": kind,
        "order": form.filter_order.strip(),
        "corner_hz": normalize_number(form.filter_corner_hz),
    }
    try:
        return msgspec.convert({name: text for name, text in given.items() if text}, Filter, strict=False)
    except msgspec.ValidationError as fault:
        template = N_("The filter cannot be: {fault}. Write its order and corner as its data sheet does")
        raise FormError(template, fault=fault) from None


def _last_day(text: str, today: datetime.date) -> datetime.date | None:
    """Parse the last day of validity. Raises FormError."""
    if not text.strip():
        return None
    try:
        day = datetime.date.fromisoformat(text.strip())
    except ValueError:
        template = N_("Valid until {text!r} is no day: write it like {day}")
        raise FormError(template, text=text.strip(), day=today.isoformat()) from None
    if day < today:
        raise FormError("Valid until {day} is past: write a day to come", day=day)
    return day
