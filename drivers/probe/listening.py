"""Listening to a port at one baud rate after the other, until what comes can be read. Nothing is sent."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from drivers.diagnosis import is_text
from drivers.errors import SettingsError
from drivers.probe.recognition import Recognition, recognise
from drivers.source import Link

FIRST_WAIT_S = 3.5
"""A board that opening its port resets is silent for two seconds and more."""
_WINDOW_S = 0.8
_SLOW_WINDOW_S = 1.2
_TEXT_WINDOW_S = 6.0
"""Slow loggers and scales send a line or two a second, after a banner."""
_ENOUGH_BYTES = 600
_SURE_SHARE = 0.9
_PLENTY_BYTES = 1 << 18


@dataclass(frozen=True, slots=True)
class LineSettings:
    """Baud rate and parity of a port."""

    baud: int
    parity: str = "N"

    def __str__(self) -> str:
        return f"{self.baud} baud 8{self.parity}1"


_BAUDS = (115200, 9600, 460800, 500_000, 230400, 1_000_000, 57600, 38400, 19200, 921600, 2_000_000)
_BAUDS_WITH_PARITY = (115200, 9600, 19200, 38400, 57600)
COMMON_LINE_SETTINGS = (
    *(LineSettings(baud) for baud in _BAUDS),
    *(LineSettings(baud, parity) for baud in _BAUDS_WITH_PARITY for parity in "EO"),
)
"""The likely ones first: of the built protocols, then what loggers and transmitters are shipped with."""


class ConfigurableLink(Link, Protocol):
    """An open port; `drivers.port.Port` is one."""

    @property
    def has_baud(self) -> bool:
        """Whether baud rate and parity mean anything."""

    def configure(self, baud: int, parity: str) -> None:
        """Set them and throw away what waits. Raises SettingsError where the port cannot."""


@dataclass(frozen=True, slots=True)
class ListenResult:
    """What came of listening.

    Attributes
    ----------
    recognition : Recognition or None
        What the bytes are, if they are anything that is built.
    tuning : Tuning or None
        How the port was set then; None where that means nothing.
    received : bytes
        What came at the tuning that was recognised, else at the one that looked most like text.
    """

    recognition: Recognition | None
    line_settings: LineSettings | None
    received: bytes


def listen(
    link: ConfigurableLink,
    on_progress: Callable[[str], None],
    candidates: Sequence[LineSettings] = COMMON_LINE_SETTINGS,
    clock: Callable[[], float] = time.monotonic,
) -> ListenResult:
    """Listen until what comes is known; a device that is silent at one baud rate is silent at all.

    Parameters
    ----------
    link : TunableLink
        Open, set to the first of `tunings`.
    tell : callable (str)
        Takes what is done now, for people.
    tunings : sequence of Tuning
        To be tried in this order.
    clock : callable
        Seconds, as of `time.monotonic`.

    Raises
    ------
    DeviceLostError
        If the port is gone.
    """
    heard = ListenResult(None, None, b"")
    for number, tuning in enumerate(candidates if link.has_baud else candidates[:1]):
        on_progress(f"listening at {tuning}" if link.has_baud else "listening")
        try:
            if number:
                link.configure(tuning.baud, tuning.parity)
        except SettingsError:
            continue  # this port has no such baud rate, so no device on it does
        received, recognition = _listen_once(link, FIRST_WAIT_S if not number else _SLOW_WINDOW_S, clock)
        if not received and not number:
            break
        heard = _better(heard, ListenResult(recognition, tuning if link.has_baud else None, received))
        if heard.recognition is not None and heard.recognition.share >= _SURE_SHARE:
            break
    return heard


def _listen_once(link: Link, wait_s: float, clock: Callable[[], float]) -> tuple[bytes, Recognition | None]:
    """What comes within `wait_s` and a window after it, and what it is; unknown text may go on for longer."""
    began_s = clock()
    received = b""
    while not received and clock() - began_s < wait_s:
        received = link.read()
    first_s = last_s = clock()
    recognition = None
    while received and recognition is None:
        data = link.read()
        now_s = clock()
        received, last_s = received + data, now_s if data else last_s
        if not _is_enough(received, now_s - first_s):
            continue
        recognition = recognise(received, last_s - first_s)
        may_tell_more = is_text(received) and len(received) < _PLENTY_BYTES
        if not may_tell_more or now_s - first_s > _TEXT_WINDOW_S:
            break
    return received, recognition


def _is_enough(received: bytes, heard_s: float) -> bool:
    """Whether so much, heard for so long, is worth being looked at."""
    window_s = _WINDOW_S if len(received) >= _ENOUGH_BYTES else _SLOW_WINDOW_S
    return heard_s >= window_s or len(received) >= _PLENTY_BYTES


def _better(one: ListenResult, other: ListenResult) -> ListenResult:
    """The one that tells more."""

    def worth(heard: ListenResult) -> tuple[float, bool, float]:
        share = heard.recognition.share if heard.recognition else 0.0
        return share, bool(heard.received), _printable_share(heard.received)

    return other if worth(other) > worth(one) else one


def _printable_share(data: bytes) -> float:
    return sum(0x20 <= byte < 0x7F or byte in b"\r\n\t" for byte in data) / max(len(data), 1)
