"""A transmitter that is asked by Modbus RTU, as a `SampleSource`."""

import time
from collections import deque
from collections.abc import Mapping
from typing import Literal

import msgspec

from drivers.diagnosis import describe_unreadable
from drivers.errors import NoDataError, ProtocolError, SettingsError
from drivers.modbus.decoder import ResponseDecoder, wrap_response
from drivers.modbus.frames import (
    ExceptionResponse,
    InvalidResponse,
    RegisterResponse,
    Request,
    encode_read_response,
    parse_response,
)
from drivers.modbus.maps import GAUGES, RegisterMap, is_map_key, map_keys, read_map
from drivers.modbus.polling import PollSchedule, ResponseTiming, Transaction, drain, transact
from drivers.modbus.registers import Poll, ZeroCommand, plan_poll
from drivers.samples import DeviceIdentity
from drivers.settings import parse_settings
from drivers.skew import Skew
from drivers.source import Link
from drivers.stream import StreamSource

PROTOCOL = "modbus"
DEFAULT_BAUD = 115200
MAX_RATE_HZ = 1000.0
QUASI_STATIC_HZ = 500.0
"""Below it a rate is labelled."""
_TRIALS = 24


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What `--set` and `[device.settings]` may give, beside the keys of a register map."""

    map: str = "generic"
    """A shipped register map, or a file that ends in `.toml`."""
    channel: Literal["both", "table", "relative"] = "both"
    """Gauges on this port; of a device with one of them the other column is 0."""
    zero: bool = False
    """Whether to send the zero command of the map at the start."""
    timeout_s: float = 0.2
    """How long an answer is waited for."""

    def __post_init__(self) -> None:
        if not 0.005 <= self.timeout_s <= 1.0:
            raise ValueError(f"timeout_s {self.timeout_s:g} is out of range: give 0.005 to 1")

    @property
    def gauges(self) -> tuple[str, ...]:
        """Gauges to read."""
        return GAUGES if self.channel == "both" else (self.channel,)


class ModbusSource(StreamSource):
    """Conversation: ask until there is an answer, see how quickly they come, then ask at the rate's pace.

    Rows lie on a grid of the host's clock (`drivers.modbus.decoder`). A poll is begun at the beginning of
    its cell, or not at all.

    Parameters
    ----------
    settings : Settings
    register_map : RegisterMap
    rate_hz : float or None
        Polls a second; None asks as often as the device answers.
    """

    def __init__(self, settings: Settings, register_map: RegisterMap, rate_hz: float | None = None) -> None:
        identity = DeviceIdentity(PROTOCOL, register_map.title, settings={"map": register_map.name})
        super().__init__(identity, DEFAULT_BAUD, rate_hz)
        self._settings = settings
        self._map = register_map
        self._poll: Poll = plan_poll(tuple(register_map.channels[gauge] for gauge in settings.gauges))
        self._cells: PollSchedule | None = None
        self._rhythm: ResponseTiming | None = None
        self._is_doubtful = False
        """No answer came last time: it may come yet."""
        self._is_misfit = False
        """What came last time was no answer."""
        self._notes: deque[str] = deque()
        self._was_busy = False

    @property
    def skew_s(self) -> float:
        """How much later gauge 2 is measured than gauge 1 in one poll (s); 0 before the start."""
        first, last = self._poll.values[0].request, self._poll.values[-1].request
        return self._rhythm.skew_s(first, last) if self._rhythm else 0.0

    @property
    def channels(self) -> int:
        """As set."""
        return len(self._settings.gauges)

    @property
    def run_note(self) -> str:
        """That the rate is quasi-static, what the map warns of, and the skew of two requests."""
        parts = [self._map.caution]
        if self.rate_hz < QUASI_STATIC_HZ:
            slow = f"polled at {self.rate_hz:g} Hz, which is quasi-static: quick motion is seen coarsely"
            parts.insert(0, slow)
        if self.skew_s:
            parts.append(
                f"gauge 2 is asked {1e3 * self.skew_s:.2g} ms after gauge 1, one request after the other"
            )
        return "; ".join(part for part in parts if part)

    def skew(self, first_index: int, end_index: int) -> Skew | None:
        """By how much later gauge 2 was read than gauge 1 in these rows; None for both in one request."""
        return (
            self._decoder.skew(first_index, end_index) if isinstance(self._decoder, ResponseDecoder) else None
        )

    def prepare(self) -> None:
        """Compile what lays rows out, which takes a second on the very first use."""
        decoder = self._decoder_at(1.0)
        for number, request in enumerate(self._poll.requests):
            data = encode_read_response(request.unit, request.function, bytes(2 * request.count))
            for _ in decoder.feed(wrap_response(number, 0, data), 0):
                pass

    def start(self, link: Link) -> bytes:
        """Wait for an answer, zero the device if asked to, and find or check the rate.

        Raises
        ------
        NoDataError
            If nothing intelligible comes within 3 s.
        ProtocolError
            If the device refuses, another one answers, or it is too slow for the rate.
        """
        self.prepare()
        self._await_responses(link)
        if self._settings.zero:
            self._zero(link)
            self._await_responses(link)
        self._measure_timing(link)
        return b""

    def resume(self, link: Link) -> bytes:
        """Go on with a device that answers again, at the rate of before."""
        self._await_responses(link)
        self._is_doubtful = self._is_misfit = False
        return b""

    def set_poll_rate(self, rate_hz: float) -> None:
        """Ask so often from now on, together with the device of the other gauge; before anything is decoded.

        `rate_hz` is not above what was found or held at the start.
        """
        self._rate_hz, self._cells = rate_hz, PollSchedule(rate_hz)

    def read(self, link: Link) -> bytes:
        """Wait for the next cell of the grid and ask once; b"" where it is far, or nothing came.

        Each answer is wrapped with the time at which it was measured (`Exchange.measured_ns`).
        """
        cells, rhythm = self._cells, self._rhythm
        if cells is None or rhythm is None:
            raise ProtocolError("the device was not started: start it before it is read")
        is_time = cells.wait()
        self._report_load(cells.is_computer_busy)
        if not is_time:
            return b""
        wrapped, measured_ns = b"", 0
        for number, request in enumerate(self._poll.requests):
            exchange = transact(link, request, self._settings.timeout_s)
            measured_ns = measured_ns or exchange.measured_ns
            is_of_before = self._is_doubtful or rhythm.is_stale(exchange)
            is_late = is_of_before or not rhythm.is_on_schedule(number, exchange, cells)
            if exchange.data:
                wrapped += wrap_response(number, exchange.measured_ns, exchange.data, is_late=is_late)
            is_answer = self._resynchronise(link, request, exchange, is_of_before=is_of_before)
            if is_answer and not is_of_before:
                rhythm.update(number, exchange, cells)
            if is_late or not is_answer:
                break
        cells.mark_used(measured_ns)
        return wrapped

    def take_warnings(self) -> list[str]:
        """That this computer is too busy to ask in time, each time that it has become so."""
        return [self._notes.popleft() for _ in range(len(self._notes))]

    def stop(self, link: Link) -> None:
        """A device that is not asked says nothing."""

    def make_decoder(self, data: bytes) -> ResponseDecoder:  # noqa: ARG002 - settings and rate tell all
        """Decoder at the rate of the polls."""
        return self._decoder_at(self.rate_hz)

    def _decoder_at(self, rate_hz: float) -> ResponseDecoder:
        columns = tuple(GAUGES.index(gauge) for gauge in self._settings.gauges)
        return ResponseDecoder(self._poll, columns, rate_hz)

    def _report_load(self, is_busy: bool) -> None:
        if is_busy and not self._was_busy:
            self._notes.append(
                f"this computer is too busy to poll at {self.rate_hz:g} Hz, more than one poll in ten is left"
                " out: close other programs, or ask for a lower rate"
            )
        self._was_busy = is_busy

    def _resynchronise(
        self, link: Link, request: Request, exchange: Transaction, *, is_of_before: bool
    ) -> bool:
        """Whether it was an answer; makes sure that what comes next is that of the next request.

        One damaged answer leaves nothing behind, or its end was waited for; two in a row may be out of step.
        """
        answer = parse_response(request, exchange.data)
        was_misfit, self._is_misfit = self._is_misfit, isinstance(answer, InvalidResponse)
        if exchange.data and (is_of_before or (was_misfit and self._is_misfit)):
            drain(link)
        self._is_doubtful = not exchange.data
        return isinstance(answer, RegisterResponse)

    def _await_responses(self, link: Link) -> None:
        """Ask all requests of a poll until each was answered. Raises NoDataError, ProtocolError."""
        deadline_s = time.monotonic() + self.timeout_s
        heard = drain(link)
        for request in self._poll.requests:
            said: ExceptionResponse | InvalidResponse | None = None
            while True:
                exchange = transact(link, request, self._settings.timeout_s)
                answer = parse_response(request, exchange.data)
                if isinstance(answer, RegisterResponse):
                    break
                heard += exchange.data + drain(link)
                said = answer if said is None or exchange.data else said
                if time.monotonic() > deadline_s:
                    raise self._no_response_error(request, said, heard)

    def _no_response_error(
        self, request: Request, answer: ExceptionResponse | InvalidResponse, heard: bytes
    ) -> Exception:
        if isinstance(answer, ExceptionResponse):
            return ProtocolError(
                f"unit {request.unit} refuses {request.description}: {answer.description}. Hold register map"
                f" {self._map.name} against the device's manual"
            )
        if not heard:
            return NoDataError(
                f"unit {request.unit} does not answer {request.description}: check baud rate, parity and"
                f" unit,"
                " cable and power, and whether A and B are swapped"
            )
        said = describe_unreadable(heard, PROTOCOL, DEFAULT_BAUD)
        return NoDataError(
            f"no answer of unit {request.unit} to {request.description} ({answer.reason}); {said}"
        )

    def _zero(self, link: Link) -> None:
        for gauge, channel in self._map.channels.items():
            if channel.zero_command is None:
                continue
            request = _write(channel.unit, channel.zero_command)
            answer = parse_response(request, transact(link, request, self._settings.timeout_s).data)
            if not isinstance(answer, RegisterResponse):
                why = answer.description if isinstance(answer, ExceptionResponse) else answer.reason
                raise ProtocolError(
                    f"the {gauge} gauge was not set to zero: {why}. Try again, or without zero"
                )

    def _measure_timing(self, link: Link) -> None:
        """See how quickly the device answers; choose the rate, or hold the one that was asked against it."""
        rhythm = ResponseTiming([self._timed(link) for _ in range(_TRIALS)])
        if self._rate_hz is None:
            self._rate_hz = min(MAX_RATE_HZ, rhythm.max_rate_hz)
        elif rhythm.poll_s * self._rate_hz > 1:
            raise ProtocolError(
                f"rate {self._rate_hz:g} Hz cannot be: a poll takes {1e3 * rhythm.poll_s:.2g} ms, ask for"
                f" --rate {rhythm.max_rate_hz:g} or leave it out"
            )
        self._rhythm, self._cells = rhythm, PollSchedule(self._rate_hz)

    def _timed(self, link: Link) -> list[Transaction]:
        exchanges = []
        for request in self._poll.requests:
            exchanges.append(transact(link, request, self._settings.timeout_s))
            if not isinstance(parse_response(request, exchanges[-1].data), RegisterResponse):
                drain(link)
        return exchanges


def make_source(settings: Mapping[str, str], rate_hz: float | None) -> ModbusSource:
    """Source for `drivers.registry`. Raises SettingsError for a setting, map or rate that cannot be."""
    if rate_hz is not None and not 0 < rate_hz <= MAX_RATE_HZ:
        raise SettingsError(
            f"rate {rate_hz:g} Hz cannot be polled: give one up to {MAX_RATE_HZ:g}, or leave it out"
        )
    read_as, register_map = read_modbus_settings(settings)
    return ModbusSource(read_as, register_map, rate_hz)


def read_modbus_settings(settings: Mapping[str, str]) -> tuple[Settings, RegisterMap]:
    """Settings of the driver, and the register map that they choose and change.

    Raises
    ------
    SettingsError
        For one that is not known or cannot be.
    """
    own = {key: value for key, value in settings.items() if not is_map_key(key)}
    known = {field.name for field in msgspec.structs.fields(Settings)}
    for key in own:
        if key not in known:
            allowed = ", ".join([*sorted(known), *map_keys()])
            raise SettingsError(
                f"setting {key!r} is not known to {PROTOCOL}: allowed are {allowed}, the keys of a map also"
                " for one gauge, such as table_register"
            )
    read_as = parse_settings(Settings, own, PROTOCOL)
    given = {key: value for key, value in settings.items() if is_map_key(key)}
    register_map = read_map(read_as.map, given, read_as.gauges)
    if read_as.zero and not any(channel.zero_command for channel in register_map.channels.values()):
        raise SettingsError(
            f"zero is asked for, but map {read_as.map} has no zero command: leave zero out, or give"
            " zero_register and zero_value from the device's manual"
        )
    return read_as, register_map


def _write(unit: int, zeroing: ZeroCommand) -> Request:
    return Request(unit, zeroing.function, zeroing.register, 1, (zeroing.value,))
