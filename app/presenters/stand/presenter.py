"""What the Simulated stand screen does: options before it starts, faults while it runs, its truth."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Final, Protocol

import msgspec

from analysis.formatting import typeset, with_unit
from app.presenters.base import EMPTY_CHIP, Chip, Presenter, Tone
from app.presenters.gauges.state import LabelledValue
from app.presenters.number_text import format_fixed, format_millimetres, parse_number
from app.presenters.results import sentence
from app.presenters.stand.state import StandForm, StandState
from app.simulated_stand.options import SimulatedStandError, SimulatedStandOptions
from app.simulated_stand.truth import Truth
from config.files import published_row
from drivers.errors import SettingsError
from messages.i18n import gettext

_LISTED: Final = 8
_TRUTH_EVERY: Final = 30
"""Ticks between two looks at the truth."""


class RunningStand(Protocol):
    """A simulated stand that runs."""

    def truth(self) -> Truth:
        """What is true of it."""

    def disturb(self, text: str) -> None:
        """Let something happen to it. Raises SettingsError, SimulatedStandError."""


class StandPresenter(Presenter[StandState]):
    """The simulated stand.

    Parameters
    ----------
    options : SimulatedStandOptions
        What is not on the screen, and what an empty field stands for.
    all_series : tuple of str
    open_stand : callable
        Starts a stand and connects to it.
    running : callable
        The stand that is connected; None where none is.
    """

    def __init__(
        self,
        options: SimulatedStandOptions,
        all_series: tuple[str, ...],
        open_stand: Callable[[SimulatedStandOptions], None],
        running: Callable[[], RunningStand | None],
    ) -> None:
        form = StandForm(options.series)
        super().__init__(StandState(all_series, form, _usual(options, form)))
        self._options = options
        self._open_stand = open_stand
        self._running = running
        self._ticks = 0

    # --- what the operator does ---

    def set_form(self, form: StandForm) -> None:
        """Take what was filled in."""
        self._update(form=form, defaults=_usual(self._options, form), message=EMPTY_CHIP)

    def start(self) -> None:
        """Start a stand that is so, and connect to it."""
        try:
            options = stand_options(self.state.form, self._options)
        except ValueError as error:
            self._update(message=Chip(sentence(str(error)), Tone.BAD))
        else:
            self._open_stand(options)

    def set_fault_duration(self, seconds: str) -> None:
        """How long the next fault lasts."""
        self._update(fault_duration_s=seconds, message=EMPTY_CHIP)

    def inject_fault(self, kind: str) -> None:
        """Let a fault happen now."""
        stand = self._running()
        if stand is None:
            self._update(message=Chip(gettext("Start the simulated stand first"), Tone.WARN))
            return
        text = f"{kind} {self.state.fault_duration_s.strip().replace(',', '.')}".strip()
        try:
            stand.disturb(text)
        except (SettingsError, SimulatedStandError) as error:
            self._update(message=Chip(sentence(str(error)), Tone.BAD))
        else:
            self._update(message=EMPTY_CHIP)

    # --- what happens elsewhere ---

    def select_series(self, series: str) -> SimulatedStandOptions:
        """A stand without faults that runs a series, as the start page offers it."""
        self.set_form(replace(self.state.form, series=series))
        return msgspec.structs.replace(self._options, series=series)

    def tick(self) -> None:
        """Look at the truth now and then."""
        self._ticks = (self._ticks + 1) % _TRUTH_EVERY
        stand = self._running()
        if self._ticks and (stand is not None) == self.state.is_running:
            return
        if stand is None:
            self._update(is_running=False, truth=(), disturbances=())
            return
        truth = stand.truth()
        self._update(is_running=True, truth=truth_values(truth), disturbances=_happened(truth))


def stand_options(form: StandForm, base: SimulatedStandOptions) -> SimulatedStandOptions:
    """The stand that was filled in. Raises ValueError that names field, value and remedy."""
    wanted = {
        "friction": _number(form.friction, gettext("Friction")),
        "tilt_rad": _scaled(form.tilt_mrad, gettext("Tilt"), 1e3),
        "noise_m": _scaled(form.noise_um, gettext("Noise"), 1e6),
        "rate_hz": _number(form.rate_hz, gettext("Rate")),
        "drop": _scaled(form.drop_percent, gettext("Frames that lose a byte"), 100.0),
        "flip": _scaled(form.flip_percent, gettext("Frames with a wrong bit"), 100.0),
    }
    filled = {name: value for name, value in wanted.items() if value is not None}
    return msgspec.structs.replace(base, series=form.series, **filled)


def truth_values(truth: Truth) -> tuple[LabelledValue, ...]:
    """What is true of a stand and of its wire."""
    stand, wire = truth.stand, truth.wire
    releases = str(len(truth.release_s))
    if truth.release_s:
        at = with_unit(f"{truth.release_s[-1]:.1f}", "s")
        releases = gettext("{count}, the last {at} after its start", count=releases, at=at)
    return (
        LabelledValue(gettext("series"), stand.series),
        LabelledValue("f<sub>d</sub>", f"{stand.friction_dynamic:.5g}"),
        LabelledValue("f<sub>s</sub>", f"{stand.friction_static:.5g}"),
        LabelledValue(gettext("tilt"), with_unit(typeset(f"{stand.tilt_rad * 1e3:.3g}"), "mrad")),
        LabelledValue(gettext("pullback"), with_unit(format_millimetres(stand.pullback_m, 2), "mm")),
        LabelledValue("T", with_unit(format_fixed(stand.period_s * 1e3, 2), "ms")),
        LabelledValue("n<sub>1</sub>", with_unit(f"{stand.damping_n1_per_s:.4g}", "1/s")),
        LabelledValue(
            gettext("table, plate"), with_unit(f"{stand.table_mass_kg:g}, {stand.plate_mass_kg:g}", "kg")
        ),
        LabelledValue(
            gettext("slip of a release"),
            with_unit(format_millimetres(truth.residual_displacement_m, 3), "mm"),
        ),
        LabelledValue(gettext("releases"), releases),
        LabelledValue(gettext("frames sent"), f"{wire.frames}"),
        LabelledValue(gettext("damaged, lost"), f"{wire.frames_damaged}, {wire.frames_lost}"),
    )


def _happened(truth: Truth) -> tuple[str, ...]:
    lines = []
    for one in sorted(truth.disturbances, key=lambda one: one.at_s or 0.0, reverse=True)[:_LISTED]:
        length = gettext("for ever") if one.seconds is None else with_unit(typeset(f"{one.seconds:g}"), "s")
        at = with_unit(f"{one.at_s or 0.0:.1f}", "s")
        lines.append(gettext("{kind}, {length}, at {at}", kind=one.kind, length=length, at=at))
    return tuple(lines)


def _usual(options: SimulatedStandOptions, form: StandForm) -> StandForm:
    """What each empty field stands for."""
    friction = options.friction
    if friction is None:
        friction = published_row(form.series).friction_dynamic
    return StandForm(
        form.series,
        f"{friction:g}",
        f"{options.tilt_rad * 1e3:g}",
        f"{options.noise_m * 1e6:g}",
        f"{options.rate_hz:g}",
        f"{options.drop * 100:g}",
        f"{options.flip * 100:g}",
    )


def _scaled(text: str, name: str, parts: float) -> float | None:
    """Read a number that is written in so many parts of its unit."""
    value = _number(text, name)
    return None if value is None else value / parts


def _number(text: str, name: str) -> float | None:
    """Read a number; None where nothing was filled in. A decimal comma is one too."""
    value = parse_number(text)
    if value is not None and math.isnan(value):
        raise ValueError(
            gettext(
                "{name} {text!r} is not a number: write one, or leave it empty", name=name, text=text.strip()
            )
        )
    return value
