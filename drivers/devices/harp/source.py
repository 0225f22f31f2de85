"""Harp LoadCells as a `SampleSource`."""

from collections.abc import Callable

import msgspec
import numpy as np

from drivers.devices.harp import DRIVER, codec
from drivers.devices.harp.codec import EventDecoder, Register
from drivers.errors import ProtocolError, SettingsError
from drivers.recognition import IdentityQuery, Recognition, rate_from_count, unless_coincidence
from drivers.samples import DeviceIdentity
from drivers.source import LineSettings, Link
from drivers.stream import SampleSource, check_gauge_channels, parse_settings
from messages.i18n import N_
from messages.message import EMPTY, Message, joined, message, option

RATE_HZ = 1000.0
_TRIES = 2


class HarpSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What `--set` and `[device.settings]` may give. Raises SettingsError."""

    table: int = 0
    relative: int = 1
    """Channels that the two gauges are wired to, 0 to 7."""
    overload_count: float = codec.FULL_SCALE  # readings of this size and more are marked as overloaded

    def __post_init__(self) -> None:
        check_gauge_channels(self.table, self.relative, range(codec.CHANNELS))
        if not self.overload_count > 0:
            raise SettingsError("overload_count {count:g} must be positive", count=self.overload_count)


class HarpSource(SampleSource):
    """Conversation: stop, identify, enable events, start. The device's times show its fixed rate."""

    stop_command = codec.STOP

    def __init__(self, settings: HarpSettings, rate_hz: float = RATE_HZ) -> None:
        super().__init__(DeviceIdentity(DRIVER.name, "Harp LoadCells"), DRIVER.default_baud, rate_hz)
        self._settings = settings

    def prepare(self) -> None:
        list(EventDecoder(1.0).feed(codec.encode_events(np.zeros(1), np.zeros((1, 2))).tobytes(), 0))

    def start(self, link: Link) -> bytes:
        self.prepare()
        self._identify(link)
        self._write(link, Register.OPERATION, codec.with_active_mode)
        self._write(link, Register.EVENTS, lambda events: events | codec.LOAD_CELL_EVENTS)
        link.write(codec.START)
        received, good = self.await_data(link, self.timeout_s, codec.rate_from_events)
        reply = codec.find_reply(received, Register.ACQUISITION)
        if reply is not None and reply.kind & codec.ERROR:
            raise ProtocolError("the device refuses to start: switch it off and on, and try again")
        if not good:
            raise self.no_data_error(received)
        measured_hz = codec.rate_from_events(received)
        if not self.is_same_rate(measured_hz):
            template = N_(
                "the device sends {actual_hz:.5g} Hz where {rate_hz:g} Hz is expected: "
                "ask for --rate {actual_hz:.4g}"
            )
            raise ProtocolError(template, actual_hz=measured_hz, rate_hz=self.rate_hz)
        return received

    def make_decoder(self, data: bytes) -> EventDecoder:  # noqa: ARG002 - all is known
        settings = self._settings
        return EventDecoder(self.rate_hz, settings.table, settings.relative, settings.overload_count)

    def _identify(self, link: Link) -> None:
        received = self.silence(link)
        who = self._read(link, Register.WHO_AM_I)
        if who is None:
            raise self.no_answer_error(received, sends=bool(codec.find_messages(received)[0]))
        if who != codec.WHO_AM_I:
            template = N_("the device is Harp {number}, and LoadCells is {expected}: choose its port")
            raise ProtocolError(template, number=who, expected=codec.WHO_AM_I)
        high, low = (self._read(link, r) for r in (Register.FIRMWARE_HIGH, Register.FIRMWARE_LOW))
        serial_number = self._read(link, Register.SERIAL_NUMBER)
        firmware = "" if high is None or low is None else f"{high}.{low}"
        serial = "" if serial_number is None else str(serial_number)
        self._identity = DeviceIdentity(DRIVER.name, "Harp LoadCells", firmware, serial)

    def _read(self, link: Link, register: Register) -> int | None:
        command = codec.encode_read(register)
        reply = self.request(link, command, lambda data: codec.find_reply(data, register), _TRIES)
        return None if reply is None or reply.kind & codec.ERROR else reply.number

    def _write(self, link: Link, register: Register, wanted: Callable[[int], int]) -> None:
        present = self._read(link, register)
        if present is None or wanted(present) == present:
            return
        link.write(codec.encode_write(register, wanted(present)))
        if self._read(link, register) != wanted(present):
            template = N_("the device does not take {value} in register {register}: switch it off and on")
            raise ProtocolError(template, value=wanted(present), register=register)


def make_source(settings: dict[str, str], rate_hz: float | None) -> HarpSource:
    """Source of the device. Raises SettingsError for a setting or rate that cannot be."""
    parsed = parse_settings(HarpSettings, settings, DRIVER.name)
    if rate_hz is not None and not 0 < rate_hz <= codec.TICKS_PER_S:
        template = N_("rate {rate_hz:g} Hz cannot be: LoadCells sends {usual_hz:g} Hz, leave --rate out")
        raise SettingsError(template, rate_hz=rate_hz, usual_hz=RATE_HZ)
    return HarpSource(parsed, rate_hz or RATE_HZ)


def recognise(data: bytes, duration_s: float | None) -> Recognition | None:
    """What `data` are; see `drivers.recognition.recognise`."""
    events = len(codec.event_times(data))
    share = events * codec.EVENT_BYTES / max(len(data), 1)
    rate_hz = codec.rate_from_events(data) or rate_from_count(events, duration_s)
    template = N_("say which channels the gauges are: {option} table=N {option} relative=N")
    remark = message(template, option=option("--set"))
    found = Recognition(DRIVER.name, share, events, rate_hz=rate_hz, remark=remark)
    return unless_coincidence(found, has_checksum=True)


def explain(received: bytes) -> Message | None:
    """Which reader boards are not plugged in, by their events in `received`; None if all are."""
    return (
        joined([codec.absent_board_warning(board) for board in codec.absent_boards(received)], "; ") or None
    )


def _parse_who_am_i(received: bytes) -> Message | None:
    reply = codec.find_reply(received, Register.WHO_AM_I)
    if reply is None or reply.number == codec.WHO_AM_I:
        return None if reply is None else EMPTY
    template = N_("it is Harp {number}, and LoadCells is {expected}")
    return message(template, number=reply.number, expected=codec.WHO_AM_I)


IDENTITY_QUERY = IdentityQuery(
    2, codec.encode_read(Register.WHO_AM_I), (LineSettings(DRIVER.default_baud),), _parse_who_am_i
)
