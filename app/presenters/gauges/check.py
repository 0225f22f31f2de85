"""Presenter of the tab Check: compares a gauge with a known step, and records the outcome."""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from analysis.formatting import typeset, with_unit
from app.acquisition.averaged_counts import AveragedCounts, RecentSamples
from app.presenters.base import EMPTY_CHIP, Chip, TaskFailure, Tone
from app.presenters.gauges.calibration import ReadingPresenter
from app.presenters.gauges.state import (
    CONNECTION_LOST,
    NO_DEVICE,
    NO_SAMPLES,
    CheckForm,
    CheckKind,
    CheckOutcome,
    CheckState,
)
from app.presenters.number_text import FormError, parse_field
from app.presenters.results import sentence
from app.presenters.worker import LazyModule, Worker
from config.schema import Gauges
from messages.i18n import N_, gettext

if TYPE_CHECKING:
    from app.presenters.gauges import tasks
else:
    tasks = LazyModule("app.presenters.gauges.tasks")


class CheckPresenter(ReadingPresenter[CheckState]):
    """Takes two readings: at rest, and with the known step."""

    def __init__(self, recent: RecentSamples, worker: Worker, on_kept: Callable[[], None]) -> None:
        super().__init__(CheckState(), recent, worker, on_kept)
        self._gauges: Gauges | None = None
        self._device = ""
        self._rest: AveragedCounts | None = None

    def set_form(self, form: CheckForm) -> None:
        if not self.state.is_started:
            self._update(form=form, message=EMPTY_CHIP)

    def advance(self) -> None:
        if self._gauges is None:
            self._update(message=Chip(gettext(NO_DEVICE), Tone.WARN))
        elif self._stopped_at:
            self._update(message=Chip(gettext(NO_SAMPLES, time=self._stopped_at), Tone.WARN))
        elif not self.state.is_started:
            self._start()
        elif not self._averager.is_active and self.state.instruction:
            if self._averager.start():
                self._update(reading_status=gettext("Averaging: hold it still"), message=EMPTY_CHIP)
            else:
                self._update(message=Chip(gettext(NO_DEVICE), Tone.WARN))

    def cancel(self) -> None:
        if self.state.is_started:
            self._end(Chip(gettext("The check was broken off: nothing is kept")))

    def on_connected(self, gauges: Gauges | None, device: str = "") -> None:
        self._gauges, self._device = gauges, device
        if self._awaits_reading:
            self._end(Chip(gettext(CONNECTION_LOST), Tone.WARN))

    def set_stopped(self, stopped_at: str) -> None:
        super().set_stopped(stopped_at)
        if stopped_at and self._awaits_reading:
            template = N_("No sample came after {time}: the check is broken off, and nothing is kept")
            self._end(Chip(gettext(template, time=stopped_at), Tone.BAD))

    def tick(self) -> None:
        average = self._take_reading(self.state.form.gauge)
        if average is not None:
            self._on_reading(average)

    @property
    def _awaits_reading(self) -> bool:
        """Tell whether a check is under way whose readings are not both taken."""
        return self.state.is_started and bool(self.state.instruction)

    def _start(self) -> None:
        try:
            form = _normalised(self.state.form)
        except FormError as error:
            self._show_error(error)
            return
        self._rest = None
        self._update(
            form=form, is_started=True, outcome=EMPTY_CHIP, values=(), warnings=(), message=EMPTY_CHIP,
            instruction=_rest_instruction(form),
        )  # fmt: skip

    def _on_reading(self, average: AveragedCounts) -> None:
        if self._rest is None:
            self._rest = average
            self._update(reading_status="", instruction=_step_instruction(self.state.form))
            return
        self._update(reading_status="", instruction="")
        done, failed, form = self._on_checked, self._on_failed, self.state.form
        task = tasks.check_gauge
        self._worker.submit(task, form, self._rest, average, self._device, done=done, failed=failed)

    def _on_checked(self, checked: CheckOutcome) -> None:
        name = gettext("Gauge {number}", number=self.state.form.gauge + 1)
        text, tone = gettext("{gauge} passed", gauge=name), Tone.OK
        warnings = checked.warnings
        if not checked.passed:
            text, tone = gettext("{gauge} FAILED", gauge=name), Tone.BAD
            warnings += (gettext("Check plugs and mounting, then calibrate it again."),)
        self._end(EMPTY_CHIP)
        self._update(outcome=Chip(text, tone, checked.file), values=checked.values, warnings=warnings)
        self._on_kept()

    def _on_failed(self, failure: TaskFailure) -> None:
        self._end(Chip(sentence(failure.message), Tone.BAD))

    def _end(self, message: Chip) -> None:
        self._averager.stop()
        self._rest = None
        self._update(is_started=False, instruction="", reading_status="", message=message)


def _normalised(form: CheckForm) -> CheckForm:
    """Raises FormError that names field, value and remedy."""
    known = parse_field(form.known, gettext("Known"))
    if known is None or known == 0.0:
        raise FormError("Say how far the gauge is moved, with its sign: a number that is not 0")
    uncertainty = parse_field(form.uncertainty, gettext("Its uncertainty"))
    if uncertainty is not None and uncertainty < 0.0:
        raise FormError("Its uncertainty {text} is below 0: write a standard uncertainty", text=uncertainty)
    return replace(
        form,
        known=repr(known),
        uncertainty="" if uncertainty is None else repr(uncertainty),
        reference=form.reference.strip(),
        checked_by=form.checked_by.strip(),
    )


def _rest_instruction(form: CheckForm) -> str:
    if form.kind is CheckKind.DISPLACEMENT:
        return gettext("Let the gauge rest, the dial at 0. Then take the reading")
    return gettext("Shunt off, the table at rest. Then take the reading")


def _step_instruction(form: CheckForm) -> str:
    if form.kind is CheckKind.DISPLACEMENT:
        known = with_unit(typeset(f"{float(form.known):+g}"), "mm")
        return gettext("Move the gauge by {known} and hold it. Then take the reading", known=known)
    return gettext("Switch the shunt on, and move nothing. Then take the reading")
