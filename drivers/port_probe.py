"""Probing a port: who uses it, what it sends at which line settings, and what answers a question."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

from drivers.errors import DriverError, SettingsError
from drivers.host_checks import PortHint, port_hints, usb_chip_name
from drivers.port import Port, PortInfo, PortUser, StreamPort, open_port, other_port_users
from drivers.recognition import (
    IdentityQuery,
    Recognition,
    describe_unrecognised,
    is_text,
    printable_share,
    recognise,
)
from drivers.registry import AVAILABLE, DRIVERS
from drivers.source import LineSettings, Link
from messages.i18n import N_
from messages.message import EMPTY, Message, message, option

FIRST_WAIT_S = 3.5  # a board that is reset by opening its port is silent for two seconds and more
_WINDOW_S = 0.8
_SLOW_WINDOW_S = 1.2
"""How long is listened at one setting: to a stream, and to a device of few bytes."""
_TEXT_WINDOW_S = 6.0  # slow loggers and scales send a line or two a second, after a banner
_ENOUGH_BYTES = 600
_SURE_SHARE = 0.9
"""Share of good bytes at which no other line settings are tried."""
_MAX_BYTES = 1 << 18
_ANSWER_S = 0.4
"""How long an answer is waited for; serial devices answer within 100 ms."""
_ECHO_TEST = b"\0\xff\0"  # no known device takes it for a command
_REOPEN_S = 0.5  # until a device that takes one connection has noticed that the last one was closed

_USUAL_BAUDS = (115200, 9600, 460800, 500_000, 230400, 1_000_000, 57600, 38400, 19200, 921600, 2_000_000)
_BAUDS = dict.fromkeys((*_USUAL_BAUDS, *(driver.default_baud for driver in AVAILABLE if driver.default_baud)))
_BAUDS_WITH_PARITY = (115200, 9600, 19200, 38400, 57600)
COMMON_LINE_SETTINGS = (
    *(LineSettings(baud) for baud in _BAUDS),
    *(LineSettings(baud, parity) for baud in _BAUDS_WITH_PARITY for parity in "EO"),
)
"""The likely ones first: of the built devices, then what loggers and transmitters are shipped with."""


class ProbeOutcome(StrEnum):
    """How probing a port ended."""

    RECOGNISED = "recognised"
    UNREADABLE = "unreadable"  # bytes come that no device folder knows
    SILENT = "silent"
    IN_USE = "held"
    UNAVAILABLE = "unavailable"


@dataclass(frozen=True, slots=True)
class PortReport:
    """What was found on a port."""

    port: PortInfo
    chip: str
    """Known name of the USB chip or board; "" for others."""
    outcome: ProbeOutcome
    message: Message = EMPTY
    """What is wrong and what to do, where nothing was recognised."""
    users: tuple[PortUser, ...] = ()
    recognition: Recognition | None = None
    line_settings: LineSettings | None = None
    """At which it was recognised; None where they have no effect."""
    hints: tuple[PortHint, ...] = ()


@dataclass(frozen=True, slots=True)
class ListenResult:
    """What was received, and at which line settings."""

    recognition: Recognition | None
    line_settings: LineSettings | None
    received: bytes = b""
    """What came at the settings that were recognised, else at those that looked most like text."""


def probe_port(port: PortInfo, write: bool, on_progress: Callable[[Message], None]) -> PortReport:
    """Find out who uses a port, else what it sends by itself, then, if `write`, what it answers."""
    chip = usb_chip_name(port.vendor_id, port.product_id)
    hints = tuple(port_hints(port))
    users = tuple(other_port_users(port.device))
    if users:  # reading would take bytes from that program
        what = message("in use by {users}: close that program, and look again", users=users)
        return PortReport(port, chip, ProbeOutcome.IN_USE, what, users, hints=hints)
    try:
        first = COMMON_LINE_SETTINGS[0]
        with open_port(port.device, first.baud, first.parity) as link:
            outcome, what, found = _probe_link(link, write, on_progress)
    except DriverError as error:
        return PortReport(port, chip, ProbeOutcome.UNAVAILABLE, error.message, hints=hints)
    return PortReport(port, chip, outcome, what, (), found.recognition, found.line_settings, hints)


def _probe_link(
    link: Port | StreamPort, write: bool, on_progress: Callable[[Message], None]
) -> tuple[ProbeOutcome, Message, ListenResult]:
    found = listen(link, on_progress)
    if found.recognition is not None:
        return ProbeOutcome.RECOGNISED, EMPTY, found
    if found.received:
        what = describe_unrecognised(found.received, has_baud=link.has_baud)
        return ProbeOutcome.UNREADABLE, what, found
    if not write:
        template = N_("nothing sends by itself: try {option}, which asks the device who it is")
        return ProbeOutcome.SILENT, message(template, option=option("--write")), found
    answered = query_identity(link, on_progress)
    if answered is None and link.is_network:
        link.close()
        time.sleep(_REOPEN_S)
        with open_port(link.url, COMMON_LINE_SETTINGS[0].baud) as anew:
            answered = query_identity(anew, on_progress, is_network=True)
    if answered is not None:
        return ProbeOutcome.RECOGNISED, EMPTY, answered
    template = N_(
        "nothing is sent and nothing answers: check cable and power, and that the device is switched on"
    )
    return ProbeOutcome.SILENT, message(template), found


def listen(
    link: Port | StreamPort,
    on_progress: Callable[[Message], None],
    clock: Callable[[], float] = time.perf_counter,
) -> ListenResult:
    """Listen at `COMMON_LINE_SETTINGS` until what comes is recognised; nothing is sent.

    `link` is set to the first; a device that is silent there is silent at all. Raises DeviceLostError.
    """
    best = ListenResult(None, None)
    for number, settings in enumerate(COMMON_LINE_SETTINGS[: None if link.has_baud else 1]):
        template = N_("listening at {line_settings}") if link.has_baud else N_("listening")
        on_progress(message(template, line_settings=settings))
        try:
            if number:
                link.configure(settings)
        except SettingsError:
            continue  # no device on this port can use settings that the port has not
        received, recognition = _listen_once(link, _SLOW_WINDOW_S if number else FIRST_WAIT_S, clock)
        if not received and not number:
            break
        result = ListenResult(recognition, settings if link.has_baud else None, received)
        best = max(best, result, key=_informativeness)
        if best.recognition is not None and best.recognition.share >= _SURE_SHARE:
            break
    return best


def query_identity(
    link: Port | StreamPort,
    on_progress: Callable[[Message], None],
    clock: Callable[[], float] = time.perf_counter,
    *,
    is_network: bool = False,
) -> ListenResult | None:
    """Ask one question after the other of all devices, or of those of networks. Raises DeviceLostError."""
    for protocol, query in identity_queries():
        if query.is_network is is_network:
            for settings in query.line_settings if link.has_baud else (None,):
                with_baud = N_("asking for {protocol} at {line_settings}")
                template = with_baud if link.has_baud else N_("asking for {protocol}")
                on_progress(message(template, protocol=protocol, line_settings=settings))
                remark = _query_once(link, query, settings, clock)
                if remark is not None:
                    channels = query.channels or DRIVERS[protocol].channels
                    found = Recognition(protocol, 1.0, 1, channels, query.settings, remark=remark)
                    return ListenResult(found, settings)
    return None


def identity_queries() -> list[tuple[str, IdentityQuery]]:
    """Protocol and question of each device that has one."""
    queries = [(driver.name, query) for driver in AVAILABLE for query in driver.identity_queries]
    return sorted(queries, key=lambda named: named[1].order)


def _listen_once(link: Link, wait_s: float, clock: Callable[[], float]) -> tuple[bytes, Recognition | None]:
    """What comes within `wait_s` and a window after it, and what it is; unknown text is read for longer."""
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
        window_s = _WINDOW_S if len(received) >= _ENOUGH_BYTES else _SLOW_WINDOW_S
        if now_s - first_s < window_s and len(received) < _MAX_BYTES:
            continue
        recognition = recognise(received, last_s - first_s)
        may_tell_more = is_text(received) and len(received) < _MAX_BYTES
        if not may_tell_more or now_s - first_s > _TEXT_WINDOW_S:
            break
    return received, recognition


def _informativeness(result: ListenResult) -> tuple[float, bool, float]:
    share = result.recognition.share if result.recognition else 0.0
    return share, bool(result.received), printable_share(result.received)


def _query_once(
    link: Port | StreamPort, query: IdentityQuery, settings: LineSettings | None, clock: Callable[[], float]
) -> Message | None:
    if settings is not None:
        try:
            link.configure(settings)
        except SettingsError:
            return None
    link.write(query.data)
    deadline_s = clock() + _ANSWER_S
    received = b""
    while clock() < deadline_s:
        received += link.read()
        if received.startswith(query.data):
            return _parse_behind_echo(link, query, received, clock)
        remark = query.parse(received)
        if remark is not None:
            return remark
    return None


def _parse_behind_echo(
    link: Link, query: IdentityQuery, received: bytes, clock: Callable[[], float]
) -> Message | None:
    """Answer to a query that came back: an eNod4 repeats it, a two-wire adapter repeats all that is sent."""
    link.write(_ECHO_TEST)
    deadline_s = clock() + _ANSWER_S
    more = b""
    while clock() < deadline_s:
        more += link.read()
    answer = received + more
    if _ECHO_TEST in more:
        answer = answer.removeprefix(query.data).replace(_ECHO_TEST, b"")
    return query.parse(answer)
