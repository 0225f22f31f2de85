"""A calibration against the dial gauge: readings taken live, fitted at once, kept as a file."""

import datetime
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final

from app.acquisition.gauge_samples import AveragedCounts
from app.presenters.base import EMPTY_CHIP, Chip, Tone
from app.presenters.gauges.reading_averager import ReadingAverager
from app.presenters.gauges.recent_samples import InvalidWindow, RecentSamples, average_counts
from app.presenters.gauges.state import NO_DEVICE, CalibrationForm, CalibrationPoint, CalibrationState
from app.presenters.gauges.tasks import FitCalibration, SaveCalibration, SavedCalibration
from app.presenters.number_text import format_fixed, parse_number, with_minus_sign, with_unit
from app.presenters.results import sentence
from config.schema import Gauges
from messages.i18n import N_, gettext

_LIVE_S: Final = 0.5
NOT_TAKEN_LOST: Final = N_("The connection is gone: the reading was not taken")
_NAMES: Final = ("table", "relative")
_FITTED_FROM: Final = 2


class CalibrationSession:
    """Takes readings, one at a time.

    Parameters
    ----------
    recent : RecentSamples
        Live samples.
    submit : callable
        Has a task done.
    show : callable
        Takes each new state.
    now : callable
        Time of day.
    """

    def __init__(
        self,
        recent: RecentSamples,
        submit: Callable[[FitCalibration | SaveCalibration], None],
        show: Callable[[CalibrationState], None],
        now: Callable[[], datetime.datetime],
    ) -> None:
        self.state = CalibrationState()
        self._recent = recent
        self._submit = submit
        self._show = show
        self._now = now
        self._gauges: Gauges | None = None
        self._averaging = ReadingAverager(recent)
        self._dial_mm = 0.0
        self._file_name = ""

    # --- what the operator does ---

    def set_form(self, form: CalibrationForm) -> None:
        """Take what was filled in; with another dial or curve it is fitted anew.

        The gauge stays the same as long as there are readings of it.
        """
        before = self.state.form
        if self.state.points:
            form = replace(form, gauge=before.gauge)
        self._change(form=form, live_value=self.state.live_value if form.gauge == before.gauge else "")
        if _fit_of(form) != _fit_of(before):
            self._fit()

    def take_point(self, dial_text: str) -> None:
        """Average from now on, for the dial reading that was typed (mm)."""
        try:
            dial_mm = _millimetres(dial_text, gettext("Dial"))
        except ValueError as error:
            self._change(message=Chip(str(error), Tone.BAD))
            return
        if self._gauges is None or not self._averaging.start():
            self._change(message=Chip(gettext(NO_DEVICE), Tone.WARN))
            return
        self._dial_mm = dial_mm
        self._change(
            reading_status=gettext("Averaging at {dial:g} mm: hold the table still", dial=dial_mm),
            message=EMPTY_CHIP,
        )

    def undo(self) -> None:
        """Leave the reading that is being taken, else take back the last one."""
        if self._averaging.is_active:
            self._averaging.stop()
            self._change(reading_status="", message=Chip(gettext("Not taken"), Tone.PLAIN))
        elif self.state.points:
            last = self.state.points[-1]
            self._change(
                points=self.state.points[:-1],
                message=Chip(gettext("Reading at {dial:g} mm taken back", dial=last.dial_mm), Tone.PLAIN),
            )
            self._fit()

    def restart(self) -> None:
        """Begin anew, with the same gauge or the other one; the readings stay in their file."""
        self._averaging.stop()
        self._change(points=(), fit=None, can_save=False, reading_status="", message=EMPTY_CHIP)

    def save(self) -> None:
        """Write the calibration, if all that was filled in can be."""
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
            self._change(message=Chip(str(error), Tone.BAD))
            return
        self._change(message=Chip(gettext("Writing"), Tone.PLAIN), can_save=False)
        self._submit(task)

    # --- what happens elsewhere ---

    def on_connected(self, gauges: Gauges | None) -> None:
        """By these calibrations live samples are displacements now; None: nothing is connected."""
        self._gauges = gauges
        was_taking = self._averaging.is_active
        self._averaging.stop()
        self._change(live_value="", live_note=gettext(NO_DEVICE), reading_status="", offers_reconnect=False)
        if was_taking:
            self._change(message=Chip(gettext(NOT_TAKEN_LOST), Tone.WARN))

    def tick(self) -> None:
        """Look at the newest samples."""
        if self._gauges is None:
            return
        rows = self._recent.since(self._recent.end_s - _LIVE_S)
        if rows is not None:
            seen = average_counts(rows, self.state.form.gauge, self._gauges)
            self._show_live(seen)
        self._look(self._gauges)

    def on_fitted(self, task: FitCalibration, answer: Any) -> None:
        """The readings make this calibration."""
        if task.points == self.state.points:
            self._change(fit=answer, can_save=True)

    def on_saved(self, saved: SavedCalibration) -> None:
        """It has been written."""
        used = self.state.form.use
        words = gettext("Written to {file}.", file=saved.file)
        if saved.previous:
            words += " " + gettext("The one before is kept as {file}.", file=saved.previous)
        self._change(
            message=Chip(words, Tone.OK), can_save=True, offers_reconnect=used and self._gauges is not None
        )

    def on_failed(self, task: FitCalibration | SaveCalibration, message: str) -> None:
        """It could not be done; readings too few for a curve are nothing that went wrong."""
        if isinstance(task, SaveCalibration):
            self._change(message=Chip(sentence(message), Tone.BAD), can_save=True)
        elif task.points == self.state.points:
            tone = Tone.PLAIN if len(task.points) <= _FITTED_FROM else Tone.WARN
            self._change(fit=None, can_save=False, message=Chip(sentence(message), tone))

    # --- inside ---

    def _show_live(self, seen: AveragedCounts | InvalidWindow) -> None:
        if isinstance(seen, InvalidWindow):
            self._change(live_value="", live_note=seen.reason)
            return
        mean, noise = _figures(seen)
        self._change(
            live_value=mean,
            live_note=gettext(
                "counts, mean of {time}; noise {noise}", time=with_unit(f"{_LIVE_S:g}", "s"), noise=noise
            ),
        )

    def _look(self, gauges: Gauges) -> None:
        """Keep the reading that is being taken, once it is one."""
        seen = self._averaging.poll(self.state.form.gauge, gauges)
        if isinstance(seen, AveragedCounts):
            self._keep(seen, self._dial_mm)
        elif isinstance(seen, InvalidWindow):
            self._change(
                reading_status="", message=Chip(gettext("Not taken. {words}", words=seen.reason), Tone.BAD)
            )
        elif seen is not None:
            self._change(reading_status=seen.text)

    def _keep(self, seen: AveragedCounts, dial_mm: float) -> None:
        words = gettext("{dial:g} mm: {counts} counts taken", dial=dial_mm, counts=_figures(seen)[0])
        message = Chip(words, Tone.OK)
        if not seen.is_steady:
            message = Chip(
                gettext(
                    "{words}, though still creeping by {creep}",
                    words=words,
                    creep=with_minus_sign(f"{seen.creep_counts:.3g}"),
                ),
                Tone.WARN,
            )
        if not self.state.points:
            self._file_name = f"readings-{_NAMES[self.state.form.gauge]}-{self._now():%Y-%m-%d-%H%M%S}.csv"
        self._change(
            points=(*self.state.points, CalibrationPoint(seen.counts, dial_mm)),
            reading_status="",
            message=message,
        )
        self._fit()

    def _fit(self) -> None:
        if not self.state.points:
            self._change(fit=None, can_save=False)
            return
        try:
            self._submit(self._fit_task())
        except ValueError as error:
            self._change(can_save=False, message=Chip(str(error), Tone.BAD))

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

    def _change(self, **changes: Any) -> None:
        changed = {name: value for name, value in changes.items() if getattr(self.state, name) != value}
        if changed:
            self.state = replace(self.state, **changed)
            self._show(self.state)


def _fit_of(form: CalibrationForm) -> tuple[object, ...]:
    return form.degree, form.resolution_mm, form.uncertainty_mm


def _figures(average: AveragedCounts) -> tuple[str, str]:
    """Mean and noise, to the digit that the noise leaves sure; a count may be a millivolt, too."""
    noise = average.noise_counts
    decimals = 0 if noise <= 0.0 else min(max(1 - math.floor(math.log10(noise / average.samples**0.5)), 0), 9)
    return format_fixed(average.counts, decimals), format_fixed(noise, decimals)


def _millimetres(text: str, name: str, least: float = -math.inf) -> float:
    """Read a length as typed. Raises ValueError that names value and remedy."""
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
    """Read the day until which a calibration holds. Raises ValueError."""
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
