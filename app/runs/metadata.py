"""What a run carries beside its samples: typed, frozen, checked, with units in the names."""

import datetime
import math
import re
from collections.abc import Iterator
from enum import StrEnum
from typing import Any, Literal, Self

import msgspec

from app.runs.errors import ConditionError, MetadataError
from config.schema import ConfigError, GaugeCheck, Gauges, Stand
from drivers.clock import TimeBase
from drivers.samples import DeviceIdentity, Losses
from drivers.simulated.identity import is_simulated_device
from messages.i18n import N_
from messages.message import Message, message

_FACT_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,62}")


class RunSource(StrEnum):
    """Where the samples of a run come from."""

    REAL = "real"
    SIMULATED = "simulated"
    IMPORTED = "imported"


Quantity = Literal["displacement", "velocity", "acceleration"]
IMPORT_PROTOCOL = "import"
"""Protocol of runs that were imported."""
SIMULATION_PROTOCOL = "simulate"
"""Protocol of runs that were computed, without a device."""
QUANTITY_UNITS: dict[Quantity, str] = {"displacement": "m", "velocity": "m/s", "acceleration": "m/s^2"}
"""SI unit of each quantity that a channel can hold."""


class _FrozenStruct(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Base of what a run carries: immutable, unknown keys refused, `replace` checks again."""

    def replace(self, **changes: Any) -> Self:
        """Return a copy with `changes`, checked like a new one. Raises ValueError."""
        return msgspec.structs.replace(self, **changes)


def is_field_name(name: str) -> bool:
    """Tell whether `name` can name a fact in a run file: a letter, then letters, digits, underscores."""
    return _FACT_NAME.fullmatch(name) is not None


def _is_line(text: str) -> bool:
    return len(text) <= _TEXT_MAX and text.isprintable()


_PLAUSIBLE = {"temperature_c": (-40.0, 80.0), "humidity_percent": (0.0, 100.0), "run_in_number": (0, 10**9)}
_CONDITION_TEXTS = ("plate_id", "contact_id", "surface_preparation")
_TEXT_MAX = 200
_NOT_IN_NAMES = frozenset('/\\:*?"<>|[]')
_YEARS = (1900, 9000)
"""Far enough from the ends of the calendar for every time zone."""


class Conditions(_FrozenStruct, frozen=True, gc=False):
    """Circumstances of one test, as far as known."""

    temperature_c: float | None = None
    humidity_percent: float | None = None
    plate_id: str = ""
    contact_id: str = ""
    surface_preparation: str = ""
    run_in_number: int | None = None
    other: dict[str, str] = {}
    """Anything else, by a name of letters, digits and underscores."""

    def __post_init__(self) -> None:
        for name, reason in self._faults():
            raise ConditionError("condition {name} = {reason}", name=name, reason=reason)
        for name in self.other:
            if not is_field_name(name) or name in Conditions.__struct_fields__:
                raise MetadataError(
                    "condition {name!r} is not a usable name. Use letters, digits and underscores", name=name
                )

    def _faults(self) -> Iterator[tuple[str, Message]]:
        """Names of fields that cannot be, and why."""
        for name, (low, high) in _PLAUSIBLE.items():
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                template = N_("{value:g} cannot be. Give {low:g} to {high:g}, or leave it out")
                yield name, message(template, value=value, low=low, high=high)
        for name, text in ({name: getattr(self, name) for name in _CONDITION_TEXTS} | self.other).items():
            if not _is_line(text):
                template = N_("{text!r} is not a line of text of up to {text_max} characters")
                yield name, message(template, text=text[:40], text_max=_TEXT_MAX)

    def as_text(self) -> str:
        """What is known, in a few words; "" where nothing is."""
        said = (
            "" if self.temperature_c is None else f"{self.temperature_c:g} °C",
            "" if self.humidity_percent is None else f"{self.humidity_percent:g} %",
            "" if self.run_in_number is None else f"run-in {self.run_in_number}",
            *(self.plate_id, self.contact_id, self.surface_preparation),
            *(f"{name}: {text}" for name, text in self.other.items()),
        )
        return ", ".join(filter(None, said))

    @classmethod
    def parse(cls, facts: dict[str, str]) -> "Conditions":
        """Sort `name: text` pairs into typed conditions; others go to `other`. Raises MetadataError."""
        kinds = {"temperature_c": float, "humidity_percent": float, "run_in_number": int}
        known: dict[str, Any] = {}
        for name, text in facts.items():
            if name in cls.__struct_fields__ and name != "other":
                try:
                    known[name] = kinds.get(name, str)(text)
                except ValueError:
                    reason = message("{text!r} is not a number. Give digits, or leave it out", text=text)
                    raise ConditionError("condition {name} = {reason}", name=name, reason=reason) from None
        other = {name: text for name, text in facts.items() if name not in known}
        return cls(**known, other=other)


class SourceFile(_FrozenStruct, frozen=True):
    """The file that a run was imported from."""

    name: str = ""
    sha256: str = ""
    """Of its bytes, 64 hexadecimal digits."""
    size_bytes: int | None = None


class RunMetadata(_FrozenStruct, frozen=True):
    """What is known when a run begins."""

    title: str
    start_time: datetime.datetime | None
    """Of the first stored sample, with zone; None of an imported record whose time is not known."""
    stand: Stand  # as configured; the masses of this run stand beside it
    gauges: Gauges
    table_mass_kg: float
    plate_mass_kg: float
    """Plate with its added mass, as it slid in this run."""
    series: str | None = None
    pullback_m: float | None = None
    """Nominal, where one is known."""
    operator: str = ""
    note: str = ""
    conditions: Conditions = Conditions()
    device: DeviceIdentity = DeviceIdentity(protocol="", name="")
    port: str = ""
    """What identifies the port: its address and, for USB, vendor, product and serial number."""
    rate_hz: float | None = None
    """Nominal samples a second; None where there is none (uneven imported records)."""
    host: str = ""
    quantity: Quantity = "displacement"
    unit: str = "m"
    source: str = ""
    """Where a run that was not recorded here comes from, for example `imported from run.csv`."""
    stated_source: RunSource | None = None
    """`source_type` as stated in the file; None in files of versions that did not state it."""
    source_file: SourceFile = SourceFile()
    truth: dict[str, float | int | str] = {}
    gauge_checks: tuple[GaugeCheck, ...] = ()
    """The last check of each gauge's calibration before the run, one a gauge at most."""
    excluded: str = ""

    def __post_init__(self) -> None:
        start = self.start_time
        if start is None and self.device.protocol != IMPORT_PROTOCOL:
            raise MetadataError("a recorded run without start_time cannot be. Give it")
        if start is not None and start.tzinfo is None:
            raise MetadataError(
                "start_time {isoformat} has no time zone. Give one", isoformat=start.isoformat()
            )
        if start is not None and not _YEARS[0] <= start.year <= _YEARS[1]:
            raise MetadataError(
                "start_time {isoformat} cannot be. Set the clock", isoformat=start.isoformat()
            )
        if any(c in _NOT_IN_NAMES or not c.isprintable() for c in self.series or ""):
            template = N_("series {series!r} cannot be part of a file's name. Use letters and digits")
            raise MetadataError(template, series=self.series)
        for name in ("table_mass_kg", "plate_mass_kg", "pullback_m", "rate_hz"):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise MetadataError(
                    "{name} = {value!r} must be a finite number above 0", name=name, value=value
                )
        if not _is_line(self.excluded):
            template = N_("excluded = {excluded!r} is not a line of text of up to {text_max} characters")
            raise MetadataError(template, excluded=self.excluded[:40], text_max=_TEXT_MAX)
        for name in self.truth:
            if not is_field_name(name):
                raise MetadataError(
                    "truth {name!r} is not a usable name. Use letters, digits and underscores", name=name
                )

    @property
    def known_start_time(self) -> datetime.datetime:
        """Start of a run that this program recorded or simulated. Raises MetadataError for others."""
        if self.start_time is None:
            raise MetadataError("the start of the run is not known")
        return self.start_time

    @property
    def source_type(self) -> RunSource:
        """Where the samples come from: as stated, else derived from device, port and truth."""
        if self.stated_source is not None:
            return self.stated_source
        if self.device.protocol == IMPORT_PROTOCOL:
            return RunSource.IMPORTED
        computed = self.device.protocol == SIMULATION_PROTOCOL or bool(self.truth)
        is_simulated = computed or is_simulated_device(self.device, self.port)
        return RunSource.SIMULATED if is_simulated else RunSource.REAL

    @property
    def origin(self) -> str:
        """Where samples come from that no stand gave; empty for a recorded run."""
        return self.source or ("" if self.source_type is RunSource.REAL else self.source_type.value)

    def format_start(self, pattern: str) -> str:
        """Start by a pattern of `strftime`; "" where it is not known."""
        return "" if self.start_time is None else self.start_time.strftime(pattern)

    @property
    def contact(self) -> str:
        """What rubs on what, from the series code; empty where the series is not one of the stand."""
        try:
            code = self.stand.series(self.series or "").contact
        except ConfigError:
            return ""
        return self.stand.contacts[code].name


def create_metadata(
    stand: Stand,
    gauges: Gauges,
    start_time: datetime.datetime | None,
    *,
    series: str | None = None,
    pullback_m: float | None = None,
    table_mass_kg: float | None = None,
    plate_mass_kg: float | None = None,
    title: str = "",
    **facts: Any,
) -> RunMetadata:
    """Combine stand, series code and what overrides them into the metadata of one run.

    A series code brings pullback and plate mass; without one the plate carries no added mass. `facts` are the
    remaining fields of `RunMetadata`. Raises SeriesError, MetadataError.
    """
    of_series = stand.series(series) if series else None
    if of_series:
        pullback_m = of_series.pullback_m if pullback_m is None else pullback_m
        plate_mass_kg = of_series.plate_mass_kg if plate_mass_kg is None else plate_mass_kg
    code = of_series.code if of_series else None
    metadata = RunMetadata(
        title=title or (f"Pullback test {code}" if code else "Pullback test"),
        start_time=start_time,
        stand=stand,
        gauges=gauges,
        series=code,
        pullback_m=pullback_m,
        table_mass_kg=stand.table_mass_kg if table_mass_kg is None else table_mass_kg,
        plate_mass_kg=stand.plate_mass_kg if plate_mass_kg is None else plate_mass_kg,
        **facts,
    )
    return metadata.replace(stated_source=metadata.source_type)


class Events(_FrozenStruct, frozen=True):
    """What happened when, in the base of the run's `time_s` (s); None where it did not or is not known."""

    pulled_back_s: float | None = None
    armed_s: float | None = None
    release_s: float | None = None
    slip_end_s: float | None = None
    rest_s: float | None = None


class EndMetadata(_FrozenStruct, frozen=True):
    """What is known when a run ends."""

    ended: str  # why, as in `record --json`: rest, enough, duration, stopped, device-lost, ...
    end_time: datetime.datetime | None
    """None of an imported record whose time is not known."""
    events: Events = Events()
    losses: Losses = msgspec.field(default_factory=Losses)
    """Of this run, not of the whole stream."""
    time_base: TimeBase = TimeBase()
    dwell_s: float | None = None
    zero_m: float | None = None
    """Displacement of the table at rest before the pull."""
    relative_zero_m: float | None = None  # displacement of the plate against the table then
    held_m: float | None = None  # displacement of the table in the hold, in the same base as `zero_m`
    message: str = ""
