"""From port settings to a source and its open port: one device, or two that are read as one."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from app.acquisition.messages import PortSettings
from drivers.errors import SettingsError
from drivers.pair.link import PairLink, PortChoice, open_pair
from drivers.pair.source import PairSource, make_pair
from drivers.port import OpenPort, PortInfo
from drivers.registry import find_protocol
from drivers.source import SampleSource


class PortOpener(Protocol):
    """How to come to an open port, and to that of the same device again."""

    def open(self) -> OpenPort:
        """Open it. Raises DriverError."""

    def reopen(self) -> OpenPort:
        """Open that of the device that was opened before. Raises DriverError while it is not there."""


def create_source(
    settings: PortSettings, rate_hz: float | None, facts: Mapping[str, str] | None = None
) -> SampleSource:
    """Source of the device, or of both.

    Parameters
    ----------
    settings : PortSettings
    rate_hz : float or None
        Rows a second, asked for or of an earlier recording.
    facts : mapping, optional
        What an earlier recording noted of its device's settings; it tells the rates of two devices.

    Raises
    ------
    SettingsError
        If it cannot be.
    """
    protocol = find_protocol(settings.protocol)
    if settings.relative_url:
        return make_pair(protocol, settings.device, settings.rate_hz, facts)
    source = protocol.make_source(settings.device, rate_hz)
    if source.channels == 1:
        raise SettingsError(
            f"{settings.protocol} is set to one gauge, and two are recorded: "
            "give the port of the other device too, with --relative-port"
        )
    return source


def create_opener(settings: PortSettings, source: SampleSource) -> PortOpener:
    """How its port, or both, are opened. Raises SettingsError where both gauges are said to be at one."""
    baud = settings.baud or find_protocol(settings.protocol).usual_baud(settings.device)
    choice = PortChoice(settings.url, baud, settings.parity)
    if not isinstance(source, PairSource):
        return _Single(choice)
    if settings.relative_url == settings.url:
        raise SettingsError(f"both gauges are said to be at {settings.url}: give the port of each device")
    return _Pair((choice, PortChoice(settings.relative_url, baud, settings.parity)), source)


@dataclass(slots=True)
class _Single:
    choice: PortChoice
    opened: PortInfo | None = None

    def open(self) -> OpenPort:
        port = self.choice.open()
        self.opened = port.info
        return port

    def reopen(self) -> OpenPort:
        return self.open() if self.opened is None else self.choice.reopen(self.opened)


@dataclass(slots=True)
class _Pair:
    choices: tuple[PortChoice, PortChoice]
    source: PairSource
    opened: tuple[PortInfo, PortInfo] | None = None

    def open(self) -> OpenPort:
        return self._opened(None)

    def reopen(self) -> OpenPort:
        return self._opened(self.opened)

    def _opened(self, lost: tuple[PortInfo, PortInfo] | None) -> PairLink:
        first, second = self.source.halves
        link = open_pair(self.choices, (first.source, second.source), lost)
        self.opened = self.opened or link.halves
        return link
