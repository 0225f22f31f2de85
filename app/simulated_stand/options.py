"""Options of a simulated stand."""

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Literal

import msgspec

from app.simulated_stand.effects import check_effects
from config.files import load_gauges, settings_file
from drivers.errors import DriverError
from drivers.registry import find_driver
from drivers.simulated.faults import parse_disturbance

PULLBACK_MAX_M = 0.1  # no stand is pulled back farther; larger numbers are millimetres by mistake


class Gesture(StrEnum):
    """What the operator of a simulated stand is asked to do."""

    PULL = "pull"  # begin a test, where they begin on demand and the last one was released
    EARLY = "early"  # let the next test go too early
    END = "end"  # take the device away


class SimulatedStandError(DriverError):
    """The simulated stand could not be set up or started."""


@dataclass(frozen=True, slots=True)
class Timetable:
    """Parts of one test in their order (s), and how tests follow each other (see `SimulatedStandOptions`)."""

    rest_s: float
    pull_s: float
    hold_s: float
    decay_s: float
    recentre_s: float
    """The table is stilled, and the plate put back if it is its turn."""
    every_s: float | None = None
    count: int | None = None
    recentre_every: int = 1

    @property
    def release_s(self) -> float:
        return self.rest_s + self.pull_s + self.hold_s

    @property
    def parts_s(self) -> float:
        return self.release_s + self.decay_s + self.recentre_s

    @property
    def cycle_s(self) -> float:
        return self.parts_s if self.every_s is None else self.every_s


_LIMITS = {
    "rate_hz": (1.0, 100_000.0), "friction": (0.0, 2.0), "static_friction": (0.0, 4.0),
    "tilt_rad": (-0.1, 0.1), "pullback_m": (-PULLBACK_MAX_M, PULLBACK_MAX_M), "noise_m": (0.0, 1e-2),
    "nonlinearity_m": (-1e-2, 1e-2), "clock_ppm": (-100_000.0, 100_000.0),
    "table_drift_m_per_s": (-1e-2, 1e-2), "relative_drift_m_per_s": (-1e-2, 1e-2),
    "rest_s": (0.05, 3600.0), "pull_s": (0.05, 3600.0), "hold_s": (0.05, 3600.0),
    "decay_s": (0.05, 3600.0), "recentre_s": (0.05, 3600.0), "count": (0, 1_000_000),
    "recentre_every": (0, 1_000_000), "plate_offset_m": (-0.1, 0.1), "table_clip_m": (1e-6, 1.0),
    "early_release_m": (1e-4, PULLBACK_MAX_M),
    "relative_clip_m": (1e-6, 1.0), "rate_error": (-0.999, 9.0), "first_sequence": (0, (1 << 32) - 1),
    "lag_s": (-1.0, 1.0), "first_time_s": (0.0, 1e6), "tcp_port": (0, 65535), "start_at_unix_s": (0.0, 1e11),
}  # fmt: skip
"""Least and largest value of each option: beyond them it is another unit by mistake, or no stand."""


class SimulatedStandOptions(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A simulated stand: its protocol, its true parameters, and faults of its wire.

    SI units. None takes the value of the series' row in Table 1, for `static_friction` that of `friction`,
    for `rate_hz` that of the protocol's device. Raises ValueError (msgspec.ValidationError when decoded) for
    a value out of range.
    """

    protocol: str = "slipstand-binary"
    rate_hz: float | None = None
    series: str = "1FFM0"
    stand_file: str | None = None
    gauges_file: str | None = None
    """Calibration that turns its displacements into counts. None takes that of the protocol's simulated
    device, where it has one, else the settings in use."""
    device: dict[str, str] = {}  # the device's own settings, `--set KEY=VALUE`, as its driver knows them

    friction: float | None = None
    static_friction: float | None = None
    tilt_rad: float = 0.0
    pullback_m: float | None = None
    """Negative pulls to the other side."""
    noise_m: float = 20e-6  # standard deviation of both gauges' white noise
    table_drift_m_per_s: float = 0.0
    relative_drift_m_per_s: float = 0.0
    """Drifts begin again with each pullback test."""
    nonlinearity_m: float = 0.0  # largest deviation of both gauges from their calibration line
    effects: dict[str, float] = {}
    """Deviations from the ideal stand, by their names in `effects.EFFECTS`."""
    table_clip_m: float | None = None
    relative_clip_m: float | None = None
    """Readings beyond are clipped, and flagged where the protocol can."""
    clock_ppm: float = 0.0  # how much the device's clock is fast
    rate_error: float = 0.0
    """Fraction by which the device samples faster than it reports; the times that it sends are right."""
    first_sequence: int = 0  # what the device's counter of samples reads at sample 0; it wraps at 2**32
    gauge: Literal["table", "relative"] | None = None
    """The only gauge of the device, where it has but one, which the driver of its protocol says."""
    lag_s: float = 0.0  # how much older its readings are than the time at which they are taken
    first_time_s: float = 0.0  # what the device's clock reads at sample 0; its microseconds wrap at 2**32

    tcp_port: int | None = None
    """Where to listen on this computer, 0 being any free port; None: on a pseudo-terminal, if there are."""

    rest_s: float = 1.0
    pull_s: float = 2.0
    hold_s: float = 1.5
    decay_s: float = 20.0
    recentre_s: float = 1.0
    """How long the operator takes to still the table and put the plate back."""
    every_s: float | None = None
    """From the beginning of a test to the next; at once after its last part if None."""
    count: int | None = None  # tests before the stand rests for good; None goes on for ever
    recentre_every: int = 1  # the plate is put back after each so many tests; 0 leaves it where it slid to
    plate_offset_m: float = 0.0
    on_demand: bool = False  # a test begins when it is asked for, `Gesture.PULL`; the stand rests before it
    early_release_m: float | None = None
    """Distance at which the first test is let go while it is being pulled; a full one follows at once."""

    start_at_unix_s: float | None = None
    """Time of day (Unix, s) at which the stand's own time is 0, so that several with the same one show one
    motion; before it the stand rests. None: its time begins when its device is started afresh."""

    drop: float = 0.0
    flip: float = 0.0
    truncate: float = 0.0
    disturbances: tuple[str, ...] = ()
    """Disturbances with their times after the first start: `stall 2 at 5`; see `faults.parse_disturbance`."""
    seed: int | None = None
    truth_file: str | None = None

    def __post_init__(self) -> None:
        for name, (low, high) in _LIMITS.items():
            check_within(name, getattr(self, name), low, high)
        check_within("every_s", self.every_s, self.timetable().parts_s, 86400.0)
        for name in ("drop", "flip", "truncate", "drop + flip + truncate"):
            check_within(name, sum(getattr(self, part) for part in name.split(" + ")), 0.0, 1.0)
        check_effects(self.effects)
        for text in self.disturbances:
            parse_disturbance(text)

    def completed(self) -> "SimulatedStandOptions":
        """Options with rate and calibration of the protocol, where none is given. Raises SettingsError."""
        driver = find_driver(self.protocol)
        gauges_file = self.gauges_file
        if gauges_file is None and driver.simulated_gauges and load_gauges().device.protocol != driver.name:
            gauges_file = str(settings_file(driver.simulated_gauges))
        return msgspec.structs.replace(self, rate_hz=self.sample_rate_hz, gauges_file=gauges_file)

    @property
    def sample_rate_hz(self) -> float:
        return find_driver(self.protocol).simulated_rate_hz if self.rate_hz is None else self.rate_hz

    def device_settings(self) -> tuple[dict[str, str], bool]:
        """Settings of the device, and whether its first column holds gauge 2. Raises SettingsError."""
        driver = find_driver(self.protocol)
        if self.gauge is None or (driver.channels > 1 and not driver.has_single_gauge_settings):
            return self.device, False
        settings, column = driver.single_gauge_settings(self.gauge, self.device)
        return settings, self.gauge == "relative" and column == 0

    def timetable(self) -> Timetable:
        return msgspec.convert(self, Timetable, from_attributes=True)


class OutOfRangeError(ValueError):
    """A value out of its range; `field` is the option that has it."""

    def __init__(self, field: str, fault: str) -> None:
        super().__init__(f"{field} = {fault}")
        self.field = field
        self.fault = fault


def check_within(name: str, value: float | None, low: float, high: float) -> None:
    """Raise OutOfRangeError unless a value is in its range."""
    if value is not None and not (math.isfinite(value) and low <= value <= high):
        raise OutOfRangeError(name, f"{value:g} is out of range: give {low:g} to {high:g}")
