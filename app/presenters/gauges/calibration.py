"""Presenter of the tab Calibrate: live readings against a dial gauge, fitted at once, saved as a file."""

import datetime
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Final

from analysis.formatting import typeset, with_unit
from app.acquisition.averaged_counts import AveragedCounts
from app.presenters.base import EMPTY_CHIP, Chip, Presenter, Tone
from app.presenters.gauges.recent_samples import InvalidWindow, ReadingAverager, RecentSamples, average_counts
from app.presenters.gauges.state import (
    CONNECTION_LOST,
    NO_DEVICE,
    CalibrationFit,
    CalibrationForm,
    CalibrationPoint,
    CalibrationState,
)
from app.presenters.gauges.tasks import FitCalibration, SaveCalibration, SavedCalibration
from app.presenters.number_text import format_fixed, parse_number
from app.presenters.results import sentence
from messages.i18n import gettext
from messages.message import Message

_LIVE_S: Final = 0.5
"""Averaging time of the live counts: long enough to read the number, short enough to follow a hand."""
_NAMES: Final = ("table", "relative")
_FITTED_FROM: Final = 2
"""Fewer points than this many plus one do not determine a line with a residual; that is no fault."""


class CalibrationPresenter(Presenter[CalibrationState]):
    """Takes one reading at a time; results of `submit` come to `on_fitted`, `on_saved` or `on_failed`."""

    def __init__(
        self,
        recent: RecentSamples,
        submit: Callable[[FitCalibration | SaveCalibration], None],
        now: Callable[[], datetime.datetime],
    ) -> None:
        super().__init__(CalibrationState())
        self._recent = recent
        self._submit = submit
        self._now = now
        self._is_connected = False
        self._averager = ReadingAverager(recent)
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
        except ValueError as error:
            self._update(message=Chip(str(error), Tone.BAD))
            return
        if not self._is_connected or not self._averager.start():
            self._update(message=Chip(gettext(NO_DEVICE), Tone.WARN))
            return
        self._dial_mm = dial_mm
        self._update(
            reading_status=gettext("Averaging at {dial:g} mm: hold the table still", dial=dial_mm),
            message=EMPTY_CHIP,
        )

    def undo(self) -> None:
        if self._averager.is_active:
            self._averager.stop()
            self._update(reading_status="", message=Chip(gettext("Not taken"), Tone.PLAIN))
        elif self.state.points:
            last = self.state.points[-1]
            self._update(
                points=self.state.points[:-1],
                message=Chip(gettext("Reading at {dial:g} mm taken back", dial=last.dial_mm), Tone.PLAIN),
            )
            self._fit()

    def restart(self) -> None:
        self._averager.stop()
        self._update(points=(), fit=None, can_save=False, reading_status="", message=EMPTY_CHIP)

    def save(self) -> None:
        if not self.state.can_save:
            return
        form = self.state.form
        try:
            today = self._now().date()
            task = SaveCalibration(
                self._fit_task(),
                form.use,
                today,
                _last_day(form.valid_until, today),
                _reference(form),
                form.certificate.strip(),
                form.calibrated_by.strip(),
            )
        except ValueError as error:
            self._update(message=Chip(str(error), Tone.BAD))
            return
        self._update(message=Chip(gettext("Writing"), Tone.PLAIN), can_save=False)
        self._submit(task)

    def set_connected(self, is_connected: bool) -> None:
        """Live samples come from now on, or no longer."""
        self._is_connected = is_connected
        was_averaging = self._averager.is_active
        self._averager.stop()
        self._update(live_value="", live_note=gettext(NO_DEVICE), reading_status="", offers_reconnect=False)
        if was_averaging:
            self._update(message=Chip(gettext(CONNECTION_LOST), Tone.WARN))

    def tick(self) -> None:
        if not self._is_connected:
            return
        rows = self._recent.since(self._recent.end_s - _LIVE_S)
        if rows is not None:
            self._show_live(average_counts(rows, self.state.form.gauge))
        self._poll_reading()

    def on_fitted(self, task: FitCalibration, fit: CalibrationFit) -> None:
        if task.points == self.state.points:
            self._update(fit=fit, can_save=True)

    def on_saved(self, saved: SavedCalibration) -> None:
        used = self.state.form.use
        text = gettext("Written to {file}.", file=saved.file)
        if saved.previous:
            text += " " + gettext("The one before is kept as {file}.", file=saved.previous)
        self._update(message=Chip(text, Tone.OK), can_save=True, offers_reconnect=used and self._is_connected)

    def on_failed(self, task: FitCalibration | SaveCalibration, message: Message) -> None:
        if isinstance(task, SaveCalibration):
            self._update(message=Chip(sentence(message), Tone.BAD), can_save=True)
        elif task.points == self.state.points:
            tone = Tone.PLAIN if len(task.points) <= _FITTED_FROM else Tone.WARN
            self._update(fit=None, can_save=False, message=Chip(sentence(message), tone))

    def _show_live(self, average: AveragedCounts | InvalidWindow) -> None:
        if isinstance(average, InvalidWindow):
            self._update(live_value="", live_note=average.reason)
            return
        mean, noise = _format_counts(average)
        self._update(
            live_value=mean,
            live_note=gettext(
                "counts, mean of {time}; noise {noise}", time=with_unit(f"{_LIVE_S:g}", "s"), noise=noise
            ),
        )

    def _poll_reading(self) -> None:
        average = self._averager.poll(self.state.form.gauge)
        if isinstance(average, AveragedCounts):
            self._add_point(average, self._dial_mm)
        elif isinstance(average, InvalidWindow):
            self._update(
                reading_status="", message=Chip(gettext("Not taken. {words}", words=average.reason), Tone.BAD)
            )
        elif average is not None:
            self._update(reading_status=average.text)

    def _add_point(self, average: AveragedCounts, dial_mm: float) -> None:
        text = gettext("{dial:g} mm: {counts} counts taken", dial=dial_mm, counts=_format_counts(average)[0])
        message = Chip(text, Tone.OK)
        if not average.is_steady:
            message = Chip(
                gettext(
                    "{words}, though still creeping by {creep}",
                    words=text,
                    creep=typeset(f"{average.creep_counts:.3g}"),
                ),
                Tone.WARN,
            )
        if not self.state.points:
            self._file_name = f"readings-{_NAMES[self.state.form.gauge]}-{self._now():%Y-%m-%d-%H%M%S}.csv"
        self._update(
            points=(*self.state.points, CalibrationPoint(average.counts, dial_mm)),
            reading_status="",
            message=message,
        )
        self._fit()

    def _fit(self) -> None:
        if not self.state.points:
            self._update(fit=None, can_save=False)
            return
        try:
            self._submit(self._fit_task())
        except ValueError as error:
            self._update(can_save=False, message=Chip(str(error), Tone.BAD))

    def _fit_task(self) -> FitCalibration:
        form = self.state.form
        uncertainty_m = None
        if form.uncertainty_mm.strip():
            uncertainty_m = (
                _millimetres(form.uncertainty_mm, gettext("Uncertainty of the dial"), least=0.0) * 1e-3
            )
        resolution_m = _millimetres(form.resolution_mm, gettext("Resolution of the dial"), least=0.0) * 1e-3
        return FitCalibration(
            form.gauge, self.state.points, form.degree, resolution_m, uncertainty_m, self._file_name
        )


def _fit_options(form: CalibrationForm) -> tuple[object, ...]:
    return form.degree, form.resolution_mm, form.uncertainty_mm


def _format_counts(average: AveragedCounts) -> tuple[str, str]:
    """Mean and noise with the decimals that the standard error of the mean justifies."""
    noise = average.noise_counts
    decimals = 0 if noise <= 0.0 else min(max(1 - math.floor(math.log10(noise / average.samples**0.5)), 0), 9)
    return format_fixed(average.counts, decimals), format_fixed(noise, decimals)


def _millimetres(text: str, name: str, least: float = -math.inf) -> float:
    """Parse a length (mm). Raises ValueError that names value and remedy."""
    value_mm = parse_number(text)
    if value_mm is None or math.isnan(value_mm) or value_mm < least:
        limit = gettext(", 0 or above") if least == 0.0 else ""
        raise ValueError(
            gettext(
                "{name} {text!r} is not a number of millimetres{limit}: write one like 2.5",
                name=name,
                text=text.strip(),
                limit=limit,
            )
        )
    return value_mm


def _last_day(text: str, today: datetime.date) -> datetime.date | None:
    """Parse the last day of validity. Raises ValueError."""
    if not text.strip():
        return None
    try:
        day = datetime.date.fromisoformat(text.strip())
    except ValueError:
        raise ValueError(
            gettext(
                "Valid until {text!r} is no day: write it like {day}",
                text=text.strip(),
                day=today.isoformat(),
            )
        ) from None
    if day < today:
        raise ValueError(gettext("Valid until {day} is past: write a day to come", day=day))
    return day


def _reference(form: CalibrationForm) -> str:
    return form.reference.strip() or f"dial gauge {form.resolution_mm.strip()} mm"
