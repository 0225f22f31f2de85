"""The Simulated stand screen: state and presenter. Options before the start, faults and truth after it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import msgspec

from analysis.catalogue import KILOGRAM, MILLIRADIAN, MILLISECOND, PER_SECOND
from analysis.formatting import typeset, with_unit
from app.presenters.base import EMPTY_CHIP, Chip, LabelledValue, Presenter, Tone
from app.presenters.number_text import format_displacement, format_in, normalize_number, parse_field
from app.presenters.results import sentence
from app.simulated_stand.client import SimulatedStand
from app.simulated_stand.effects import parse_effects
from app.simulated_stand.options import Gesture, SimulatedStandError, SimulatedStandOptions
from app.simulated_stand.truth import Truth
from config.files import published_row
from drivers.errors import SettingsError
from messages.i18n import N_, gettext
from messages.message import message_of


@dataclass(frozen=True, slots=True)
class StandForm:
    """Options as typed; an empty field takes the default."""

    series: str
    friction: str = ""
    tilt_mrad: str = ""
    noise_um: str = ""
    rate_hz: str = ""
    drop_percent: str = ""
    flip_percent: str = ""
    effects: str = ""  # name=value, with blanks between them


_FIELDS: Final = {
    "friction": ("friction", N_("Friction"), 1.0),
    "tilt_mrad": ("tilt_rad", N_("Tilt"), 1e3),
    "noise_um": ("noise_m", N_("Noise"), 1e6),
    "rate_hz": ("rate_hz", N_("Rate"), 1.0),
    "drop_percent": ("drop", N_("Frames that lose a byte"), 100.0),
    "flip_percent": ("flip", N_("Frames with a wrong bit"), 100.0),
}
"""Option of the stand, title in messages, and units per unit of the option, of each field of `StandForm`."""


@dataclass(frozen=True, slots=True)
class StandState:
    all_series: tuple[str, ...]
    form: StandForm
    defaults: StandForm
    is_running: bool = False
    fault_duration_s: str = "2"
    truth: tuple[LabelledValue, ...] = ()
    disturbances: tuple[str, ...] = ()
    message: Chip = EMPTY_CHIP


_MAX_LISTED: Final = 8  # injected faults on the screen: more do not fit into the lowest window
_TRUTH_EVERY: Final = 30  # ticks between two updates of the truth: about half a second


class StandPresenter(Presenter[StandState]):
    """Starts and disturbs the simulated stand.

    `options` are defaults, also of what is not on the screen. `open_stand` starts a stand and connects to it.
    `running` returns the connected stand, or None.
    """

    def __init__(
        self,
        options: SimulatedStandOptions,
        all_series: tuple[str, ...],
        open_stand: Callable[[SimulatedStandOptions], None],
        running: Callable[[], SimulatedStand | None],
    ) -> None:
        form = StandForm(options.series)
        super().__init__(StandState(all_series, form, _default_form(options, form)))
        self._options = options
        self._open_stand = open_stand
        self._running = running
        self._ticks = 0

    def set_form(self, form: StandForm) -> None:
        self._update(form=form, defaults=_default_form(self._options, form), message=EMPTY_CHIP)

    def start(self) -> None:
        try:
            options = stand_options(self.state.form, self._options)
        except ValueError as error:
            self._update(message=Chip(sentence(message_of(error)), Tone.BAD))
        else:
            self._open_stand(options)

    def set_fault_duration(self, seconds: str) -> None:
        self._update(fault_duration_s=seconds, message=EMPTY_CHIP)

    def inject_fault(self, kind: str) -> None:
        stand = self._running()
        if stand is None:
            self._update(message=Chip(gettext("Start the simulated stand first"), Tone.WARN))
            return
        if kind == Gesture.EARLY:
            stand.ask(Gesture.EARLY)
            self._update(message=Chip(gettext("The next pull is let go too early")))
            return
        text = f"{kind} {self.state.fault_duration_s.strip().replace(',', '.')}".strip()
        try:
            stand.disturb(text)
        except (SettingsError, SimulatedStandError) as error:
            self._update(message=Chip(sentence(error.message), Tone.BAD))
        else:
            self._update(message=EMPTY_CHIP)

    def select_series(self, series: str) -> SimulatedStandOptions:
        """Select a series; return options without faults, for the Start screen."""
        self.set_form(replace(self.state.form, series=series))
        return msgspec.structs.replace(self._options, series=series)

    def tick(self) -> None:
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
    """Options of a form. Raises ValueError that names field, value and remedy."""
    filled: dict[str, Any] = {}
    for name, (option, title, scale) in _FIELDS.items():
        value = parse_field(getattr(form, name), gettext(title), scale)
        if value is not None:
            filled[option] = value
    if form.effects.strip():
        filled["effects"] = _effects(form.effects)
    return msgspec.structs.replace(base, series=form.series, **filled)


def _effects(text: str) -> dict[str, float]:
    """Read `name=value` pairs. Raises EffectError."""
    pairs = (part.rstrip(",").partition("=") for part in text.replace(";", " ").split())
    return parse_effects({name: normalize_number(value) for name, _, value in pairs})


def _effects_text(effects: Mapping[str, float]) -> str:
    return " ".join(f"{name}={value:g}" for name, value in effects.items())


def truth_values(truth: Truth) -> tuple[LabelledValue, ...]:
    stand, wire = truth.stand, truth.wire
    releases = str(len(truth.release_s))
    if truth.release_s:
        at = with_unit(f"{truth.release_s[-1]:.1f}", "s")
        releases = gettext("{count}, the last {at} after its start", count=releases, at=at)
    masses = f"{stand.table_mass_kg:g}, {stand.plate_mass_kg:g}"
    values = {
        gettext("series"): stand.series,
        "f<sub>d</sub>": f"{stand.friction_dynamic:.5g}",
        "f<sub>s</sub>": f"{stand.friction_static:.5g}",
        gettext("tilt"): with_unit(typeset(f"{MILLIRADIAN.scale * stand.tilt_rad:.3g}"), MILLIRADIAN.symbol),
        gettext("pullback"): format_displacement(stand.pullback_m, 2),
        "T": format_in(MILLISECOND, stand.period_s, 2),
        "n<sub>1</sub>": with_unit(f"{stand.damping_n1_per_s:.4g}", PER_SECOND.symbol),
        gettext("table, plate"): with_unit(masses, KILOGRAM.symbol),
        **({gettext("effects"): _effects_text(effects)} if (effects := truth.options.effects) else {}),
        gettext("slip of a release"): format_displacement(truth.residual_displacement_m, 3),
        gettext("releases"): releases,
        gettext("frames sent"): f"{wire.frames}",
        gettext("damaged, lost"): f"{wire.frames_damaged}, {wire.frames_lost}",
    }
    return tuple(LabelledValue(label, value) for label, value in values.items())


def _happened(truth: Truth) -> tuple[str, ...]:
    lines = []
    for one in sorted(truth.disturbances, key=lambda one: one.at_s or 0.0, reverse=True)[:_MAX_LISTED]:
        length = gettext("for ever") if one.seconds is None else with_unit(typeset(f"{one.seconds:g}"), "s")
        at = with_unit(f"{one.at_s or 0.0:.1f}", "s")
        lines.append(gettext("{kind}, {length}, at {at}", kind=one.kind, length=length, at=at))
    return tuple(lines)


def _default_form(options: SimulatedStandOptions, form: StandForm) -> StandForm:
    values = {name: getattr(options, option) for name, (option, _, _) in _FIELDS.items()}
    values["rate_hz"] = options.sample_rate_hz
    if options.friction is None:
        values["friction"] = published_row(form.series).friction_dynamic
    texts = {name: f"{value * _FIELDS[name][2]:g}" for name, value in values.items()}
    return StandForm(form.series, **texts, effects=_effects_text(options.effects))
