"""What a stand and its gauges are: frozen structs with units in their names, each value checked."""

import datetime
import itertools
import math
import re
from typing import TYPE_CHECKING, Any, Literal, Self, get_args

import msgspec

from messages.i18n import N_, languages
from messages.message import Message, MessageError, message

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


_MAX_POLYNOMIAL_TERMS = 2  # terms of a gauge's polynomial beyond the line: of degree 3 at most
_NEWTON_STEPS = 8  # enough for bends of a tenth of the range
SCALE_MIN, SCALE_MAX = 1.0, 2.0
"""How much larger than the system's scaling the window may be."""
FILTER_ORDER_MAX = 8  # anti-aliasing filters of amplifiers have 2 to 8
_FILTER_NAMES = {"rc": "RC", "butterworth": "Butterworth", "bessel": "Bessel", "sinc": "sinc"}
_MAX_PIXELS = 100_000  # more than any wall of screens has; larger numbers come from a damaged file


_FINITE, _NOT_NEGATIVE, _POSITIVE = "", ", 0 or above", " above 0"


class ConfigError(MessageError):
    """A settings file that cannot be used: names file, key, value and what is allowed."""


class SeriesError(ConfigError, ValueError):
    """A series code that is not one of this stand."""


_CODES = {
    "pullbacks_m": (r"\d", N_("a digit, such as 1")),
    "contacts": (r"[A-Z]+", N_("capital letters, such as FF")),
    "added_masses_kg": (r"M\d+", N_("M and a number, such as M0")),
}
"""Form of the three parts of a series code, and that form in words."""


class _Checked(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Base of all settings: immutable, unknown keys refused, `replace` checks again."""

    def replace(self, **changes: Any) -> Self:
        """Return a copy with `changes`, checked like a new one."""
        return msgspec.structs.replace(self, **changes)

    def _check(self, rule: str, *names: str) -> None:
        """Check fields that hold a number, None, or numbers by key."""
        for name in names:
            held = getattr(self, name)
            is_by_key = isinstance(held, dict)
            numbers = {f"{name}.{key}": one for key, one in held.items()} if is_by_key else {name: held}
            for key, value in numbers.items():
                if value is None:
                    continue
                is_allowed = rule == _FINITE or value > 0 or (value == 0 and rule == _NOT_NEGATIVE)
                if not (math.isfinite(value) and is_allowed):
                    raise ValueError(f"{key} = {value!r} must be a finite number{rule}")


class Contact(_Checked, frozen=True):
    """The two surfaces that slide on each other."""

    name: str  # both surfaces in words


class Stand(_Checked, frozen=True):
    """A shaking stand and the series it runs.

    Masses in kg with their standard uncertainties; `pullbacks_m`, `contacts` and `added_masses_kg`
    are the alphabets of the series code `ABBMI`.
    """

    name: str  # of the stand, in runs and reports
    table_mass_kg: float  # table, box, lower plate and half of the elastic plates
    plate_mass_kg: float  # upper plate without added mass
    pullbacks_m: dict[str, float]  # by the first digit of a series code
    contacts: dict[str, Contact]  # by the letters of a series code
    added_masses_kg: dict[str, float]  # by the end of a series code, M0
    table_mass_standard_uncertainty_kg: float = 0.0  # part of the budget of c and f_d
    plate_mass_standard_uncertainty_kg: float = 0.0  # part of the budget of c and f_d
    gravity_m_per_s2: float = 9.81  # at the stand
    gravity_standard_uncertainty_m_per_s2: float = 0.0  # part of the budget of f_d
    geometry: dict[str, float] = {}  # further lengths, kept with each run

    def __post_init__(self) -> None:
        self._check(_POSITIVE, "table_mass_kg", "plate_mass_kg", "gravity_m_per_s2", "pullbacks_m")
        self._check(_NOT_NEGATIVE, "table_mass_standard_uncertainty_kg", "plate_mass_standard_uncertainty_kg")
        self._check(_NOT_NEGATIVE, "gravity_standard_uncertainty_m_per_s2", "added_masses_kg")

    def check_codes(self) -> None:
        """Check that its alphabets make series codes. Raises ConfigError.

        A run that holds such a stand can still be read.
        """
        for name, (form, words) in _CODES.items():
            codes = list(getattr(self, name))
            if not codes:
                raise ConfigError("{name} is empty: a series needs one", name=name)
            for code in codes:
                if re.fullmatch(form, code) is None:
                    template = N_("{name}: code {code!r} makes no series code: write {words}")
                    raise ConfigError(template, name=name, code=code, words=message(words))

    @property
    def all_series(self) -> tuple[str, ...]:
        """Codes of all its series, in the order of the paper's Table 1."""
        parts = itertools.product(self.contacts, self.pullbacks_m, self.added_masses_kg)
        return tuple(f"{pullback}{contact}{mass}" for contact, pullback, mass in parts)

    def series(self, code: str) -> "Series":
        """Take a series code such as `1FFM0` apart. Raises SeriesError naming what is allowed."""
        match = re.fullmatch(r"(\d)([A-Z]+)(M\d+)", code.strip().upper())
        if match:
            pullback, contact, mass = match.groups()
            if pullback in self.pullbacks_m and contact in self.contacts and mass in self.added_masses_kg:
                plate_mass_kg = self.plate_mass_kg + self.added_masses_kg[mass]
                name = f"{pullback}{contact}{mass}"
                return Series(name, self.pullbacks_m[pullback], contact, plate_mass_kg)
        template = N_(
            "series {code!r} is not one of this stand: write pullback ({pullbacks}), contact ({contacts}) and"
            " mass ({masses}), for example 1FFM0"
        )
        pullbacks, contacts = list(self.pullbacks_m), list(self.contacts)
        masses = list(self.added_masses_kg)
        raise SeriesError(template, code=code, pullbacks=pullbacks, contacts=contacts, masses=masses)


class Series(_Checked, frozen=True):
    """A series of tests: one pullback, one contact, one plate mass."""

    code: str
    pullback_m: float
    contact: str
    plate_mass_kg: float


FilterKind = Literal["none", "rc", "butterworth", "bessel", "sinc"]

FILTER_KINDS: tuple[FilterKind, ...] = get_args(FilterKind)


class Filter(_Checked, frozen=True):
    """Low-pass filter of an amplifier or converter; `none` states that there is none.

    `rc` is `order` equal stages, `sinc` is `order` moving averages over one window each. The corner is where
    the amplitude has fallen by 3 dB.
    """

    kind: FilterKind  # equal RC stages, Butterworth, Bessel, moving averages, or none
    order: int = 1  # number of stages, of poles, or of moving averages
    corner_hz: float | None = None  # where the amplitude has fallen by 3 dB
    corner_relative_standard_uncertainty: float = 0.05
    """The usual components are within 10 %, rectangular."""

    def __post_init__(self) -> None:
        self._check(_POSITIVE, "corner_hz")
        self._check(_NOT_NEGATIVE, "corner_relative_standard_uncertainty")
        if not 1 <= self.order <= FILTER_ORDER_MAX:
            raise ValueError(f"order = {self.order} must be from 1 to {FILTER_ORDER_MAX}")
        if (self.kind == "none") != (self.corner_hz is None):
            raise ValueError(f"corner_hz = {self.corner_hz} and kind = {self.kind!r}: a filter has a corner")

    @property
    def description(self) -> Message:
        """Kind, order and corner in words."""
        if self.corner_hz is None:
            return message("none")
        template = N_("{kind}, order {order}, {corner_hz:g} Hz")
        return message(template, kind=_FILTER_NAMES[self.kind], order=self.order, corner_hz=self.corner_hz)


class Gauge(_Checked, frozen=True):
    """Calibration of one strain gauge: displacement = x + p1 x^2 + p2 x^3 with x = gain * (count - zero).

    `polynomial` is (p1, p2) in 1/m, 1/m^2; a line has none. A count is whatever number the device sends. A
    negative gain is a gauge mounted the other way. Uncertainties are standard uncertainties; None means
    "not stated".
    """

    gain_m_per_count: float  # negative for a gauge mounted the other way; not 0
    zero_count: float  # the count at rest
    gain_relative_standard_uncertainty: float | None = None  # "not stated" if absent, which is warned of
    zero_standard_uncertainty_m: float | None = None  # of the displacement at `zero_count`
    nonlinearity_m: float | None = None
    """Largest deviation from line or polynomial."""
    delay_s: float = 0.0  # by which this channel is later than its time stamp, without the filter
    delay_standard_uncertainty_s: float = 0.0  # of `delay_s`
    range_m: float | None = None  # readings beyond it on either side are clipped
    measures: Literal["relative", "plate"] = "relative"
    """Gauge 2 only: against the table (`relative`), or the plate against the base (`plate`)."""
    serial_number: str = ""  # of the gauge
    reference: str = ""  # what the gauge was calibrated against
    date: datetime.date | None = None  # of the calibration
    valid_until: datetime.date | None = None  # runs after it are warned of
    polynomial: tuple[float, ...] = ()  # p1 (1/m) and p2 (1/m^2)
    hysteresis_m: float | None = None  # largest difference between the way up and the way down
    repeatability_m: float | None = None  # standard deviation of repeated readings
    certificate: str = ""
    """Of the reference."""
    calibrated_by: str = ""  # name of a person
    filter: Filter | None = None
    """What `delay_s` does not include."""

    def __post_init__(self) -> None:
        if not math.isfinite(self.gain_m_per_count) or self.gain_m_per_count == 0.0:
            raise ValueError(f"gain_m_per_count = {self.gain_m_per_count!r} must be finite and not 0")
        self._check(_FINITE, "zero_count", "delay_s")
        self._check(_NOT_NEGATIVE, "gain_relative_standard_uncertainty", "zero_standard_uncertainty_m")
        self._check(_NOT_NEGATIVE, "nonlinearity_m", "delay_standard_uncertainty_s")
        self._check(_NOT_NEGATIVE, "hysteresis_m", "repeatability_m")
        self._check(_POSITIVE, "range_m")
        terms = len(self.polynomial)
        if terms > _MAX_POLYNOMIAL_TERMS:
            raise ValueError(f"polynomial has {terms} terms, {_MAX_POLYNOMIAL_TERMS} at most are used")
        for term in self.polynomial:
            if not math.isfinite(term):
                raise ValueError(f"polynomial = {term!r} must be a finite number")

    def displacement_m(self, counts: "NDArray[np.float64]") -> "NDArray[np.float64]":
        """Displacements (n,) that counts (n,) stand for (m)."""
        linear = (counts - self.zero_count) * self.gain_m_per_count
        if not self.polynomial:
            return linear
        bend = 0.0 * linear
        for term in reversed(self.polynomial):
            bend = (bend + term) * linear
        return linear * (1.0 + bend)

    def counts(self, displacement_m: "NDArray[np.float64]") -> "NDArray[np.float64]":
        """Counts (n,), not rounded, that displacements (n,) (m) make; by Newton's method where it bends."""
        x = 1.0 * displacement_m
        for _ in range(_NEWTON_STEPS if self.polynomial else 0):
            bend, slope = 0.0 * x, 0.0 * x
            for power, term in reversed(list(enumerate(self.polynomial, start=2))):
                bend = (bend + term) * x
                slope = (slope + power * term) * x
            x = x - (x * (1.0 + bend) - displacement_m) / (1.0 + slope)
        return x / self.gain_m_per_count + self.zero_count

    def is_expired(self, day: datetime.date) -> bool:
        """Whether the calibration was valid only until before `day`."""
        return self.valid_until is not None and self.valid_until < day


class Device(_Checked, frozen=True):
    """The amplifier that the gauges hang on. `settings` belongs to its driver, which checks it."""

    protocol: str = "slipstand-binary"  # as `slipstand device list` names it
    baud: int | None = None  # the protocol's own if absent
    parity: Literal["N", "E", "O"] = "N"  # none, even, odd
    stop_bits: Literal[1, 2] = 1  # of the serial line
    rate_hz: float | None = None  # samples a second; the device's own if absent
    settings: dict[str, Any] = {}  # as `--set KEY=VALUE` gives them


class Gauges(_Checked, frozen=True):
    """A calibration file: both gauges, and the device they are read through."""

    table: Gauge  # gauge 1: table against the base
    relative: Gauge  # gauge 2: plate against the table
    device: Device = Device()  # amplifier of both


class GaugeCheck(_Checked, frozen=True):
    """A gauge compared with a known displacement or a shunt resistor: an entry of the history of checks."""

    gauge: Literal["table", "relative"]
    at: datetime.datetime
    passed: bool
    expected_m: float
    measured_m: float
    tolerance_m: float
    gain_m_per_count: float
    """Of the calibration that was checked."""
    polynomial: tuple[float, ...] = ()
    serial_number: str = ""
    kind: Literal["displacement", "shunt"] = "displacement"
    reference: str = ""
    checked_by: str = ""
    device: str = ""

    def __post_init__(self) -> None:
        if self.at.tzinfo is None:
            raise ValueError(f"at = {self.at.isoformat()} has no time zone")
        self._check(_FINITE, "expected_m", "measured_m", "gain_m_per_count")
        self._check(_NOT_NEGATIVE, "tolerance_m")

    @property
    def deviation_m(self) -> float:
        """Measured minus expected (m)."""
        return self.measured_m - self.expected_m

    def is_of(self, gauge: Gauge) -> bool:
        """Whether this calibration of this gauge was checked; its zero does not matter."""
        names = ("gain_m_per_count", "polynomial", "serial_number")
        return all(getattr(self, name) == getattr(gauge, name) for name in names)


class GaugeChecks(_Checked, frozen=True):
    """The history of checks, oldest first."""

    check: tuple[GaugeCheck, ...] = ()

    def latest_checks(self, gauges: Gauges) -> tuple[GaugeCheck, ...]:
        """Latest check of each gauge's present calibration, gauge 1 first; none where there was none."""
        last = {one.gauge: one for one in self.check if one.is_of(getattr(gauges, one.gauge))}
        return tuple(last[name] for name in ("table", "relative") if name in last)


class Settings(_Checked, frozen=True):
    """What a person has chosen for the window, and where runs go."""

    theme: Literal["system", "light", "dark"] = "system"  # of the window
    language: str = "system"
    """Of the window, from the next start on: `system`, `en`, or that of a catalogue of `messages/locale`."""
    scale: float = 1.0
    """Of all that is shown, on top of the system's own scaling."""
    recordings: str = ""  # folder of the runs; empty for the usual one
    operator: str = ""  # who records, unless a run names another operator
    sounds: bool = False  # whether each state of a pullback has a sound
    count_simulated: bool = False  # whether simulated runs count beside others, in plan and campaign
    connect_at_start: bool = False  # whether the window connects to the last amplifier by itself
    log_level: Literal["error", "warning", "info", "debug"] = "info"  # of all logs
    displacement_unit: Literal["mm", "um"] = "mm"  # of displacements on screens
    laboratory: str = ""  # who issues reports
    laboratory_address: str = ""  # printed below it; several lines by \n
    laboratory_logo: str = ""
    """PNG, JPEG or SVG file, printed on the first page of reports; a relative path is one in this folder."""

    def __post_init__(self) -> None:
        if self.language not in ("system", *languages()):
            known = ", ".join(("system", *languages()))
            raise ValueError(f"language = {self.language!r} must be one of {known}")
        if not SCALE_MIN <= self.scale <= SCALE_MAX:
            raise ValueError(f"scale = {self.scale!r} must be from {SCALE_MIN:g} to {SCALE_MAX:g}")


class WindowLayout(_Checked, frozen=True):
    """How the window was left: place, size, screen, widths, and columns and order of tables."""

    x: int = 0
    y: int = 0
    width: int = 0
    """0 where nothing is known."""
    height: int = 0
    maximized: bool = False
    screen: str = ""
    widths: dict[str, tuple[int, ...]] = {}
    """By the name of a table or splitter, in pixels of a screen at 96 dpi."""
    sorted_by: dict[str, tuple[int, bool]] = {}
    """By the name of a table: number of the column, from 0, and whether descending."""
    columns: dict[str, tuple[str, ...]] = {}
    """By the name of a table: names of the shown columns, in their order."""

    def __post_init__(self) -> None:
        pixels = [(name, getattr(self, name)) for name in ("x", "y", "width", "height")]
        pixels += [(f"widths.{name}", width) for name, widths in self.widths.items() for width in widths]
        for name, value in pixels:
            if abs(value) > _MAX_PIXELS:
                raise ValueError(
                    f"{name} = {value} is beyond any screen: must be within ±{_MAX_PIXELS} pixels"
                )


class RecentDevice(_Checked, frozen=True):
    """The amplifier that was connected last, as its port is typed on Start."""

    name: str  # by which the device calls itself
    port: str
    protocol: str
    baud: str = ""
    rate_hz: str = ""
    parity: Literal["N", "E", "O"] = "N"
    stop_bits: Literal["1", "2"] = "1"
    settings: str = ""
    relative_port: str = ""
    usb: str = ""
    """USB numbers of the port, by which it is found under another name; empty for others."""


class RecentUse(_Checked, frozen=True):
    """What was used last; runs and folders newest first."""

    device: RecentDevice | None = None
    runs: tuple[str, ...] = ()
    folders: tuple[str, ...] = ()
    """Folders of runs."""
    export_folder: str = ""
    import_folder: str = ""


class PublishedRow(_Checked, frozen=True):
    """A row of the paper's Table 1, as printed (stiffness in a unit that the print leaves open)."""

    number: int
    series: str
    plate_mass_kg: float
    stiffness_as_printed: float
    period_s: float
    residual_displacement_m: float
    damping_n1_per_s: float
    damping_n2_per_s: float
    friction_static: float
    friction_dynamic: float
    velocity_max_m_per_s: float
    acceleration_max_m_per_s2: float
