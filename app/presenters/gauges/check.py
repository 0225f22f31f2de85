"""A gauge checked before a test: at rest, then with what is known, and the verdict kept."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from app.acquisition.gauge_samples import AveragedCounts
from app.presenters.base import EMPTY_CHIP, Chip, Tone
from app.presenters.gauges.calibration import NOT_TAKEN_LOST
from app.presenters.gauges.reading_averager import ReadingAverager
from app.presenters.gauges.recent_samples import InvalidWindow, RecentSamples
from app.presenters.gauges.state import NO_DEVICE, CheckForm, CheckKind, CheckState
from app.presenters.gauges.tasks import CheckGauge, CheckOutcome
from app.presenters.number_text import parse_number, with_minus_sign, with_unit
from app.presenters.results import sentence
from config.schema import Gauges
from messages.i18n import gettext


class CheckSession:
    """Leads through a check of two readings.

    Parameters
    ----------
    recent : RecentSamples
        Live samples.
    submit : callable
        Has a check done.
    show : callable
        Takes each new state.
    """

    def __init__(
        self,
        recent: RecentSamples,
        submit: Callable[[CheckGauge], None],
        show: Callable[[CheckState], None],
    ) -> None:
        self.state = CheckState()
        self._averaging = ReadingAverager(recent)
        self._submit = submit
        self._show = show
        self._gauges: Gauges | None = None
        self._device = ""
        self._rest: AveragedCounts | None = None

    # --- what the operator does ---

    def set_form(self, form: CheckForm) -> None:
        """Take what was filled in; while a check is under way it is fixed."""
        if not self.state.is_started:
            self._change(form=form, message=EMPTY_CHIP)

    def advance(self) -> None:
        """Begin a check, or take the reading that is asked for."""
        if self._gauges is None:
            self._change(message=Chip(gettext(NO_DEVICE), Tone.WARN))
        elif not self.state.is_started:
            self._begin()
        elif not self._averaging.is_active and self.state.instruction:
            if self._averaging.start():
                self._change(reading_status=gettext("Averaging: hold it still"), message=EMPTY_CHIP)
            else:
                self._change(message=Chip(gettext(NO_DEVICE), Tone.WARN))

    def cancel(self) -> None:
        """Break the check off; nothing of it is kept."""
        if self.state.is_started:
            self._end(Chip(gettext("The check was broken off: nothing is kept")))

    # --- what happens elsewhere ---

    def on_connected(self, gauges: Gauges | None, device: str = "") -> None:
        """By these calibrations live samples are displacements now; None: nothing is connected."""
        self._gauges, self._device = gauges, device
        if self.state.is_started:
            self._end(Chip(gettext(NOT_TAKEN_LOST), Tone.WARN))

    def tick(self) -> None:
        """Look at the newest samples."""
        if self._gauges is None:
            return
        seen = self._averaging.poll(self.state.form.gauge, self._gauges)
        if isinstance(seen, AveragedCounts):
            self._take(seen)
        elif isinstance(seen, InvalidWindow):
            self._change(reading_status="", message=Chip(seen.reason, Tone.BAD))
        elif seen is not None:
            self._change(reading_status=seen.text)

    def on_checked(self, task: CheckGauge, checked: CheckOutcome) -> None:
        """The check has been judged and kept."""
        name = gettext("Gauge {number}", number=task.form.gauge + 1)
        verdict = Chip(gettext("{gauge} passed", gauge=name), Tone.OK, checked.file)
        if not checked.passed:
            verdict = Chip(gettext("{gauge} FAILED", gauge=name), Tone.BAD, checked.file)
        remedy = "" if checked.passed else gettext("Check plugs and mounting, then calibrate it again.")
        cautions = (*checked.warnings, remedy) if remedy else checked.warnings
        self._end(EMPTY_CHIP)
        self._change(outcome=verdict, values=checked.values, warnings=cautions)

    def on_failed(self, message: str) -> None:
        """It could not be judged or kept."""
        self._end(Chip(sentence(message), Tone.BAD))

    # --- inside ---

    def _begin(self) -> None:
        try:
            form = _checked_form(self.state.form)
        except ValueError as error:
            self._change(message=Chip(str(error), Tone.BAD))
            return
        self._rest = None
        self._change(
            form=form, is_started=True, outcome=EMPTY_CHIP, values=(), warnings=(), message=EMPTY_CHIP,
            instruction=_at_rest(form),
        )  # fmt: skip

    def _take(self, average: AveragedCounts) -> None:
        if self._rest is None:
            self._rest = average
            self._change(reading_status="", instruction=_with_it(self.state.form))
            return
        self._change(reading_status="", instruction="")
        self._submit(CheckGauge(self.state.form, self._rest, average, self._device))

    def _end(self, message: Chip) -> None:
        self._averaging.stop()
        self._rest = None
        self._change(is_started=False, instruction="", reading_status="", message=message)

    def _change(self, **changes: Any) -> None:
        changed = {name: value for name, value in changes.items() if getattr(self.state, name) != value}
        if changed:
            self.state = replace(self.state, **changed)
            self._show(self.state)


def _checked_form(form: CheckForm) -> CheckForm:
    """The form with plain numbers in it. Raises ValueError that names field, value and remedy."""
    known = _number(form.known, gettext("Known"))
    if known is None or known == 0.0:
        raise ValueError(gettext("Say how far the gauge is moved, with its sign: a number that is not 0"))
    uncertainty = _number(form.uncertainty, gettext("Its uncertainty"))
    if uncertainty is not None and uncertainty < 0.0:
        raise ValueError(
            gettext("Its uncertainty {text} is below 0: write a standard uncertainty", text=uncertainty)
        )
    return replace(
        form,
        known=repr(known),
        uncertainty="" if uncertainty is None else repr(uncertainty),
        reference=form.reference.strip(),
        checked_by=form.checked_by.strip(),
    )


def _number(text: str, name: str) -> float | None:
    value = parse_number(text)
    if value is not None and math.isnan(value):
        raise ValueError(
            gettext("{name} {text} is not a number: write one like 10.0", name=name, text=text.strip())
        )
    return value


def _at_rest(form: CheckForm) -> str:
    if form.kind is CheckKind.DISPLACEMENT:
        return gettext("Let the gauge rest, the dial at 0. Then take the reading")
    return gettext("Shunt off, the table at rest. Then take the reading")


def _with_it(form: CheckForm) -> str:
    if form.kind is CheckKind.DISPLACEMENT:
        known = with_unit(with_minus_sign(f"{float(form.known):+g}"), "mm")
        return gettext("Move the gauge by {known} and hold it. Then take the reading", known=known)
    return gettext("Switch the shunt on, and move nothing. Then take the reading")
