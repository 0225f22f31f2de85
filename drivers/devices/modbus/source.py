"""A transmitter that is polled by Modbus RTU or Modbus TCP, as a `SampleSource`."""

import itertools
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import msgspec

from drivers.devices.modbus import DRIVER, frames
from drivers.devices.modbus.decoder import ResponseDecoder, wrap_response
from drivers.devices.modbus.frames import MAX_UNIT, Function, Request, Response
from drivers.devices.modbus.maps import MAP_KEYS, RegisterMap, is_map_key, read_map
from drivers.devices.modbus.registers import Framing, plan_poll
from drivers.devices.modbus.tcp_frames import TcpRequest, find_tcp_exception
from drivers.driver import GAUGES
from drivers.errors import DeviceLostError, NoDataError, ProtocolError, SettingsError
from drivers.polling import (
    TRIALS,
    PollSchedule,
    ResponseTiming,
    Transaction,
    drain,
    poll_rate_error,
    quasi_static_note,
    transact,
)
from drivers.recognition import IdentityQuery, describe_unreadable
from drivers.samples import DeviceIdentity
from drivers.source import LineSettings, Link
from drivers.stream import SampleSource, parse_settings
from messages.i18n import N_
from messages.message import Message, joined, message, option

MAX_RATE_HZ = 1000.0
_SILENCE_S = 2.0
"""A TCP connection does not show that its device was switched off: after so long without an answer it is
closed and opened again."""
_QUERY = Request(1, Function.READ_HOLDING, 0)
_TCP_UNITS = (1, 255)
"""Units asked for over TCP: the usual one, and the one that stands for the device at the IP address (MODBUS
Messaging on TCP/IP Implementation Guide V1.0b, 4.4.2.1)."""


class ModbusSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What `--set` and `[device.settings]` may give, beside the keys of a register map."""

    map: str = "generic"  # a shipped register map, or a file that ends in `.toml`
    framing: Framing | None = None  # of the frames; None: that of the map
    channel: Literal["both", "table", "relative"] = "both"
    """Gauges on this port; the column of another gauge is 0."""
    zero: bool = False  # whether to send the zero command of the map at the start
    timeout_s: float = 0.2

    def __post_init__(self) -> None:
        if not 0.005 <= self.timeout_s <= 1.0:
            template = N_("timeout_s {timeout_s:g} is out of range: give 0.005 to 1")
            raise SettingsError(template, timeout_s=self.timeout_s)

    @property
    def gauges(self) -> tuple[str, ...]:
        return GAUGES if self.channel == "both" else (self.channel,)


@dataclass(frozen=True, slots=True)
class Exchange:
    """A request, and what came after it."""

    transaction: Transaction
    earlier: bytes
    """What came before the response: the responses to earlier requests, and garbage."""
    data: bytes  # the response, whole or not
    response: Response


class ModbusSource(SampleSource):
    """Conversation: ask until there is a response, measure the response time, then poll at the rate.

    Rows lie on a grid of the host's clock (`drivers.devices.modbus.decoder`). A poll is made at the beginning
    of its cell, or not at all. `rate_hz` are polls a second; None polls as often as the device answers.
    """

    is_polled = True

    def __init__(
        self, settings: ModbusSettings, register_map: RegisterMap, rate_hz: float | None = None
    ) -> None:
        identity = DeviceIdentity(DRIVER.name, register_map.title, settings={"map": register_map.name})
        super().__init__(identity, DRIVER.default_baud, rate_hz)
        self._settings = settings
        self._map = register_map
        channels = tuple(register_map.channels[gauge] for gauge in settings.gauges)
        self._poll = plan_poll(channels, register_map.framing)
        self._numbers = itertools.count(1)
        self._last_answer_s = 0.0
        self._schedule: PollSchedule | None = None
        self._timing: ResponseTiming | None = None
        self._response_overdue = False
        """The last request got no response: it may still come."""
        self._was_invalid = False  # what came last was no response
        self._has_echo = False  # the line sends back what is written to it

    @property
    def skew_s(self) -> float:
        """How much later gauge 2 is measured than gauge 1 in one poll (s); 0 before the start."""
        return self._timing.skew_s(*self._poll.gauge_requests) if self._timing else 0.0

    @property
    def channels(self) -> int:
        return len(self._settings.gauges)

    @property
    def run_note(self) -> Message:
        parts = [note] if (note := quasi_static_note(self.rate_hz)) else []
        if self._map.caution:
            parts.append(message("{caution}", caution=self._map.caution))
        if self.skew_s:
            template = N_("gauge 2 is asked {skew_ms:.2g} ms after gauge 1, one request after the other")
            parts.append(message(template, skew_ms=1e3 * self.skew_s))
        return joined(parts, "; ")

    def prepare(self) -> None:
        decoder = self._decoder_at(1.0)
        for number, request in enumerate(self._poll.requests):
            list(decoder.feed(wrap_response(number, 0, bytes(request.response_bytes)), 0))

    def start(self, link: Link) -> bytes:
        """Wait for a response, zero the device if asked to, and choose or check the rate."""
        self.prepare()
        self._await_responses(link)
        if self._settings.zero:
            self._zero(link)
            self._await_responses(link)
        self._measure_timing(link)
        self._last_answer_s = time.perf_counter()
        return b""

    def resume(self, link: Link) -> bytes:
        self._await_responses(link)
        self._response_overdue = self._was_invalid = False
        self._last_answer_s = time.perf_counter()
        return b""

    def set_poll_rate(self, rate_hz: float) -> None:
        self._rate_hz, self._schedule = rate_hz, PollSchedule(rate_hz)

    def read(self, link: Link) -> bytes:
        """Wait for the next poll and make it; b"" where it is not due within 50 ms, or nothing came."""
        schedule, timing = self._schedule, self._timing
        if schedule is None or timing is None:
            raise ProtocolError("the device was not started: start it before it is read")
        if not schedule.wait():
            return b""
        wrapped, earlier, measured_ns = b"", b"", 0
        answered: list[Transaction] = []
        for number, planned in enumerate(self._poll.requests):
            found = self._ask(link, planned)
            transaction, response, earlier = found.transaction, found.response, earlier + found.earlier
            measured_ns = measured_ns or transaction.measured_ns
            is_stale = not planned.is_numbered and (self._response_overdue or timing.is_stale(transaction))
            is_late = is_stale or not timing.is_on_schedule(number, transaction, schedule)
            if found.data:
                wrapped += wrap_response(number, transaction.measured_ns, found.data, is_late=is_late)
            # One damaged response leaves no bytes behind; two in a row may be out of step with the requests.
            was_invalid, self._was_invalid = self._was_invalid, response.is_invalid
            if found.data and (is_stale or (was_invalid and response.is_invalid)):
                drain(link)
            self._response_overdue = not found.data
            if not response.fault and not is_stale:
                answered.append(transaction)
            if is_late or response.fault:
                break
        timing.update(answered, schedule)
        if earlier:  # before the responses, because a late one ends the poll that it belongs to
            wrapped = wrap_response(0, measured_ns, earlier, is_late=True) + wrapped
        self._check_silence(bool(wrapped))
        schedule.mark_used(measured_ns)
        return wrapped

    def take_warnings(self) -> list[Message]:
        return self._schedule.take_warnings() if self._schedule else []

    def make_decoder(self, data: bytes) -> ResponseDecoder:  # noqa: ARG002 - settings and rate are enough
        return self._decoder_at(self.rate_hz)

    def _decoder_at(self, rate_hz: float) -> ResponseDecoder:
        columns = tuple(GAUGES.index(gauge) for gauge in self._settings.gauges)
        return ResponseDecoder(self._poll, columns, rate_hz)

    def _ask(self, link: Link, planned: Request) -> Exchange:
        request = planned.numbered(next(self._numbers))
        transaction = transact(link, request, self._settings.timeout_s, has_echo=self._has_echo)
        self._has_echo = self._has_echo or transaction.has_echo
        earlier, data = request.split(transaction.data)
        return Exchange(transaction, earlier, data, request.parse_response(data))

    def _check_silence(self, has_answered: bool) -> None:
        now_s = time.perf_counter()
        if has_answered:
            self._last_answer_s = now_s
        elif self._map.framing is Framing.TCP and now_s - self._last_answer_s > _SILENCE_S:
            template = N_("the device has not answered for {seconds:g} s: check its power and the network")
            raise DeviceLostError(template, seconds=_SILENCE_S)

    def _await_responses(self, link: Link) -> None:
        deadline_s = time.perf_counter() + self.timeout_s
        received = drain(link)
        for request in self._poll.requests:
            last: Response | None = None
            while True:
                found = self._ask(link, request)
                if not found.response.fault:
                    break
                received += found.earlier + found.data + drain(link)
                last = found.response if last is None or found.data else last
                if time.perf_counter() > deadline_s:
                    raise self._no_response_error(request, last, received)

    def _no_response_error(self, request: Request, response: Response, received: bytes) -> Exception:
        unit, asked = request.unit, request.description
        if response.is_exception:
            template = N_(
                "unit {unit} refuses {request}: {fault}. Hold register map {map} against the device's manual"
            )
            return ProtocolError(template, unit=unit, request=asked, fault=response.fault, map=self._map.name)
        if not received:
            template = N_(
                "unit {unit} does not answer {request}: check baud rate, parity and unit,"
                " cable and power, and whether A and B are swapped"
            )
            if self._map.framing is Framing.TCP:
                template = N_(
                    "unit {unit} does not answer {request}: check unit and port number (usually 502), and"
                    " whether another program holds the device's only connection"
                )
            return NoDataError(template, unit=unit, request=asked)
        what = describe_unreadable(received, DRIVER.name, DRIVER.default_baud)
        template = N_("no answer of unit {unit} to {request} ({reason}); {what}")
        return NoDataError(template, unit=unit, request=asked, reason=response.fault, what=what)

    def _zero(self, link: Link) -> None:
        for gauge, channel in self._map.channels.items():
            if channel.zero_register is None or channel.zero_value is None:
                continue
            values = (channel.zero_value,)
            kind = type(self._poll.requests[0])
            response = self._ask(
                link, kind(channel.unit, channel.zero_function, channel.zero_register, 1, values)
            ).response
            if response.fault:
                template = N_("the {gauge} gauge was not set to zero: {reason}. Try again, or without zero")
                raise ProtocolError(template, gauge=gauge, reason=response.fault)

    def _measure_timing(self, link: Link) -> None:
        timing = ResponseTiming([self._trial_poll(link) for _ in range(TRIALS)])
        if self._rate_hz is None:
            self._rate_hz = min(MAX_RATE_HZ, timing.max_rate_hz)
        elif timing.poll_s * self._rate_hz > 1:
            raise poll_rate_error(self._rate_hz, timing)
        self._timing, self._schedule = timing, PollSchedule(self._rate_hz)

    def _trial_poll(self, link: Link) -> list[Transaction]:
        transactions = []
        for request in self._poll.requests:
            found = self._ask(link, request)
            transactions.append(found.transaction)
            if found.response.fault:
                drain(link)
        return transactions


def make_source(settings: Mapping[str, str], rate_hz: float | None) -> ModbusSource:
    """Source of the device. Raises SettingsError for a setting, map or rate that cannot be."""
    if rate_hz is not None and not 0 < rate_hz <= MAX_RATE_HZ:
        template = N_("rate {rate_hz:g} Hz cannot be polled: give one up to {most:g}, or leave it out")
        raise SettingsError(template, rate_hz=rate_hz, most=MAX_RATE_HZ)
    parsed, register_map = read_modbus_settings(settings)
    _check_registers(register_map)
    return ModbusSource(parsed, register_map, rate_hz)


def single_gauge_settings(gauge: str, settings: dict[str, str]) -> tuple[dict[str, str], int]:
    """Settings of a device with one gauge, and the column of its readings."""
    return settings | {"channel": gauge}, GAUGES.index(gauge)


def read_modbus_settings(settings: Mapping[str, str]) -> tuple[ModbusSettings, RegisterMap]:
    """Settings of the driver, and the register map that they choose and change. Raises SettingsError."""
    own = {key: value for key, value in settings.items() if not is_map_key(key)}
    known = {field.name for field in msgspec.structs.fields(ModbusSettings)}
    for key in sorted(own.keys() - known):
        template = N_(
            "setting {key!r} is not known to {protocol}: allowed are {allowed}, the keys of a map also"
            " for one gauge, such as table_register"
        )
        raise SettingsError(template, key=key, protocol=DRIVER.name, allowed=[*sorted(known), *MAP_KEYS])
    parsed = parse_settings(ModbusSettings, own, DRIVER.name)
    given = {key: value for key, value in settings.items() if is_map_key(key)}
    register_map = read_map(parsed.map, given, parsed.gauges)
    if parsed.framing is not None:
        register_map = replace(register_map, framing=parsed.framing)
    _check_units(register_map)
    if parsed.zero and all(one.zero_register is None for one in register_map.channels.values()):
        raise SettingsError(
            "zero is asked for, but map {map} has no zero command: leave zero out, or give"
            " zero_register and zero_value from the device's manual",
            map=parsed.map,
        )
    return parsed, register_map


def _check_units(register_map: RegisterMap) -> None:
    for gauge, channel in register_map.channels.items():
        if register_map.framing is Framing.RTU and not 1 <= channel.unit <= MAX_UNIT:
            template = N_("{gauge}_unit = {unit} is no unit of a serial line: give 1 to {most}")
            raise SettingsError(template, gauge=gauge, unit=channel.unit, most=MAX_UNIT)


def _check_registers(register_map: RegisterMap) -> None:
    """Raise SettingsError where one device would give both gauges the same reading."""
    channels = register_map.channels.values()
    places = [(channel.unit, channel.function, channel.register) for channel in channels]
    if len(places) > len(set(places)):
        template = N_(
            "both gauges would be read from register {register} of unit {unit}: give the unit or the register"
            " of one (relative_unit, relative_register), or the port of its own device with --relative-port"
        )
        raise SettingsError(template, register=places[0][2], unit=places[0][0])


def explain(received: bytes) -> Message | None:
    """Meaning of a Modbus exception in `received`; None without one."""
    refused = frames.find_exception(received) or find_tcp_exception(received)
    if refused is None:
        return None
    return message("the device refuses, {fault}: hold its registers against its manual", fault=refused.fault)


def _parse_response(request: Request, received: bytes) -> Message | None:
    if request.parse_response(request.split(received)[1]).is_invalid:
        return None
    template = N_("unit {unit} answers: choose its register map with {option} map=NAME")
    return message(template, unit=request.unit, option=option("--set"))


def _tcp_query(unit: int) -> IdentityQuery:
    request = TcpRequest(unit, Function.READ_HOLDING, 0, transaction=unit)
    settings = {"framing": "tcp"} | ({"unit": str(unit)} if unit != _QUERY.unit else {})
    return IdentityQuery(
        5, request.encode(), (), partial(_parse_response, request), settings, is_network=True
    )


def identity_queries() -> tuple[IdentityQuery, ...]:
    """Questions over TCP, and on a serial line."""
    lines = tuple(LineSettings(baud, parity) for baud in (115200, 9600, 19200, 38400) for parity in "NE")
    on_line = IdentityQuery(4, _QUERY.encode(), lines, partial(_parse_response, _QUERY))
    return (*map(_tcp_query, _TCP_UNITS), on_line)
