"""Description of a device folder, whose modules are imported when they are used."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, cast

from drivers.errors import SettingsError
from messages.i18n import N_
from messages.message import Message

if TYPE_CHECKING:
    from drivers.recognition import IdentityQuery, Recognition
    from drivers.simulated.protocol import SimulatedProtocol
    from drivers.stream import SampleSource

UNVERIFIED = N_("not verified on hardware")
RESERVED = N_("reserved, comes later")
GAUGES = ("table", "relative")


@dataclass(frozen=True, slots=True)
class DeviceVariant:
    """A device that is read by a protocol with settings: a preset, a register map."""

    name: str
    title: str
    settings: Mapping[str, str]  # as given to `--set`
    verified: str
    """What it was tested against."""


@dataclass(frozen=True, slots=True)
class DeviceDriver:
    """Description of a device folder, which is its `DRIVER`.

    The folder holds `source.py` with `make_source(settings, rate_hz)` and, where they apply,
    `recognise(data, duration_s)`, `IDENTITY_QUERY`, `explain(received)` and
    `single_gauge_settings(gauge, settings)`; `simulated.py` with `make_protocol(settings)`; where settings
    choose the device also `variants.py` with `list_variants()`.
    """

    name: str  # as given to `--protocol`
    title: str
    rank: int
    """Place in lists of devices; by how often the device is used."""
    default_baud: int = 0  # 0 where none is usual
    channels: int = 2  # gauges on one port
    evidence: str = ""  # what it was tested against, beside hardware
    on_hardware: bool = False  # whether it was tested on the device itself
    package: str = ""  # the folder as a package (`__name__`); "" for a name that is only reserved
    format_bauds: Mapping[str, int] = field(default_factory=dict)
    """Usual baud rates of a device that is chosen by its setting `format`."""
    frames_title: str = ""  # what its bytes are called in messages; "" where they are lines of text
    simulated_rate_hz: float = 2000.0  # samples a second of its simulated device, unless told otherwise
    simulated_gauges: str = ""
    """Settings file with the calibration of its simulated device; "" for the one in use."""
    has_single_gauge_settings: bool = False  # whether it can be set to one gauge of two

    @property
    def verified(self) -> str:
        """What it was tested against, in English."""
        return self.say_verified(str)

    def say_verified(self, translate: Callable[[str], str]) -> str:
        """What it was tested against, each part rendered by `translate`."""
        if not self.available:
            return translate(RESERVED)
        parts = ("" if self.on_hardware else UNVERIFIED, self.evidence)
        return "; ".join(translate(part) for part in parts if part)

    @property
    def available(self) -> bool:
        return bool(self.package)

    def list_variants(self) -> list[DeviceVariant]:
        """Devices that its settings choose, by title; none where it has no `variants.py`."""
        if not self.available or find_spec(f"{self.package}.variants") is None:
            return []
        found = import_module(f"{self.package}.variants").list_variants()
        return sorted(cast(list[DeviceVariant], found), key=lambda variant: variant.title.lower())

    def default_baud_for(self, settings: Mapping[str, str]) -> int:
        return self.format_bauds.get(settings.get("format", ""), self.default_baud)

    def make_source(self, settings: Mapping[str, str], rate_hz: float | None) -> "SampleSource":
        return cast("SampleSource", self._source().make_source(dict(settings), rate_hz))

    def make_simulated(self, settings: Mapping[str, str]) -> "SimulatedProtocol":
        self._source()
        simulated = import_module(f"{self.package}.simulated")
        return cast("SimulatedProtocol", simulated.make_protocol(dict(settings)))

    def recognise(self, data: bytes, duration_s: float | None) -> "Recognition | None":
        """What `data` are, received within `duration_s`; None where they are not of this device."""
        recognise = getattr(self._source(), "recognise", None)
        return recognise(data, duration_s) if recognise else None

    @property
    def identity_queries(self) -> "tuple[IdentityQuery, ...]":
        """The questions that ask a silent device who it is; `identity_queries()` where there are several."""
        source = self._source()
        several, one = (getattr(source, name, None) for name in ("identity_queries", "IDENTITY_QUERY"))
        if several is not None:
            return cast("tuple[IdentityQuery, ...]", several())
        return () if one is None else (one,)

    def explain(self, received: bytes) -> Message | None:
        """Why the device sent `received` instead of samples, where its own bytes show it."""
        explain = getattr(self._source(), "explain", None)
        return explain(received) if explain else None

    def single_gauge_settings(self, gauge: str, settings: Mapping[str, str]) -> tuple[dict[str, str], int]:
        """Settings of a device with only this gauge, and the column of its readings. Raises SettingsError."""
        if self.has_single_gauge_settings:
            found = self._source().single_gauge_settings(gauge, dict(settings))
            return cast(tuple[dict[str, str], int], found)
        if self.channels > 1:
            template = N_("protocol {protocol} has both gauges on one port: leave the port of gauge 2 out")
            raise SettingsError(template, protocol=self.name)
        return dict(settings), 0

    def _source(self) -> Any:
        if not self.available:
            template = N_("protocol {name!r} ({title}) comes later: choose another one")
            raise SettingsError(template, name=self.name, title=self.title)
        return import_module(f"{self.package}.source")
