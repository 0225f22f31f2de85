"""Harp LoadCells as a `SampleSource`."""

import contextlib
import time
from collections.abc import Callable

import msgspec

from drivers.errors import DeviceLostError, NoDataError, ProtocolError, SettingsError
from drivers.harp.codec import CHANNELS, FULL_SCALE, EventDecoder, compile_decoder, rate_from_events
from drivers.harp.messages import (
    ERROR,
    TICKS_PER_S,
    WHO_AM_I,
    Register,
    encode_read,
    encode_start,
    encode_stop,
    encode_write,
    find_messages,
    find_reply,
    with_active_mode,
    with_load_cells,
)
from drivers.samples import DeviceIdentity
from drivers.settings import parse_settings
from drivers.source import Link
from drivers.stream import StreamSource

PROTOCOL = "harp"
DEFAULT_BAUD = 1_000_000
RATE_HZ = 1000.0
_ANSWER_S = 0.4
_QUIET_S = 0.3
_TRIES = 2
_RATE_TOLERANCE = 0.02


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What `--set` and `[device.settings]` may give."""

    table: int = 0
    relative: int = 1
    """Channels that the two gauges are wired to, 0 to 7."""
    overload_count: float = FULL_SCALE
    """Readings of this size and more are marked as overloaded."""

    def __post_init__(self) -> None:
        for name in ("table", "relative"):
            if not 0 <= getattr(self, name) < CHANNELS:
                raise ValueError(f"{name} {getattr(self, name)} is no channel: give 0 to {CHANNELS - 1}")
        if self.table == self.relative:
            raise ValueError(f"table and relative are both channel {self.table}: give each gauge its own")
        if not self.overload_count > 0:
            raise ValueError(f"overload_count {self.overload_count:g} must be positive")


class HarpSource(StreamSource):
    """Conversation: stop, identify, let it send events, start. Its rate is fixed, and told by its times.

    Parameters
    ----------
    settings : Settings
    rate_hz : float
        Samples a second that are expected.
    """

    def __init__(self, settings: Settings, rate_hz: float = RATE_HZ) -> None:
        super().__init__(DeviceIdentity(PROTOCOL, "Harp LoadCells"), DEFAULT_BAUD, rate_hz)
        self._settings = settings

    def prepare(self) -> None:
        """Compile the decoder, which takes seconds on the very first use."""
        compile_decoder()

    def start(self, link: Link) -> bytes:
        """Stop what runs, see who it is, start, and wait for as many events as tell the rate.

        Raises
        ------
        NoDataError
            If the device does not answer, or too few events came within 3 s.
        ProtocolError
            If it is another Harp device, does not start, or sends at another rate.
        """
        self.prepare()
        self._identify(link)
        self._set(link, Register.OPERATION, with_active_mode)
        self._set(link, Register.EVENTS, with_load_cells)
        deadline_s = time.monotonic() + self.timeout_s
        link.write(encode_start())
        received, good = self.await_data(link, deadline_s, lambda data: rate_from_events(data) is not None)
        said = find_reply(received, Register.ACQUISITION)
        if said is not None and said.kind & ERROR:
            raise ProtocolError("the device refuses to start: switch it off and on, and try again")
        if not good:
            raise self.no_data_error(received)
        self._check_rate(rate_from_events(received))
        return received

    def stop(self, link: Link) -> None:
        """Ask the device to stop; quiet when it is gone."""
        with contextlib.suppress(DeviceLostError):
            link.write(encode_stop())

    def make_decoder(self, data: bytes) -> EventDecoder:  # noqa: ARG002 - all is known
        """Decoder at the rate of the device."""
        settings = self._settings
        return EventDecoder(self.rate_hz, settings.table, settings.relative, settings.overload_count)

    def _identify(self, link: Link) -> None:
        received = self._silence(link)
        who = self._read(link, Register.WHO_AM_I)
        if who is None and not find_messages(received)[0]:
            raise self.no_data_error(received)
        if who is None:
            raise NoDataError(
                "the device sends and does not answer: check the line from this computer to the device"
            )
        if who != WHO_AM_I:
            raise ProtocolError(f"the device is Harp {who}, and LoadCells is {WHO_AM_I}: choose its port")
        high, low = (self._read(link, r) for r in (Register.FIRMWARE_HIGH, Register.FIRMWARE_LOW))
        serial_number = self._read(link, Register.SERIAL_NUMBER)
        self._identity = DeviceIdentity(
            PROTOCOL,
            "Harp LoadCells",
            firmware="" if high is None or low is None else f"{high}.{low}",
            serial_number="" if serial_number is None else str(serial_number),
        )

    def _silence(self, link: Link) -> bytes:
        """Stop what runs; returns what was under way."""
        link.write(encode_stop())
        received = b""
        end_s = time.monotonic() + _QUIET_S
        while (data := link.read()) and time.monotonic() < end_s:
            received += data
        return received

    def _read(self, link: Link, register: Register) -> int | None:
        """What a register holds; None where it has none, or the device is silent."""
        for _ in range(_TRIES):
            link.write(encode_read(register))
            received, _ = self.await_data(
                link, time.monotonic() + _ANSWER_S, lambda data: find_reply(data, register) is not None
            )
            said = find_reply(received, register)
            if said is not None:
                return None if said.kind & ERROR else said.number
        return None

    def _set(self, link: Link, register: Register, wanted: Callable[[int], int]) -> None:
        """Let a register hold what is wanted, made of what it holds; left alone where it cannot be read."""
        held = self._read(link, register)
        if held is None or wanted(held) == held:
            return
        link.write(encode_write(register, wanted(held)))
        if self._read(link, register) != wanted(held):
            raise ProtocolError(
                f"the device does not take {wanted(held)} in register {register.value}: switch it off and on"
            )

    def _check_rate(self, measured_hz: float | None) -> None:
        if measured_hz is not None and abs(measured_hz / self.rate_hz - 1) > _RATE_TOLERANCE:
            raise ProtocolError(
                f"the device sends {measured_hz:.5g} Hz where {self.rate_hz:g} Hz is expected: "
                f"ask for --rate {measured_hz:.4g}"
            )


def make_source(settings: dict[str, str], rate_hz: float | None) -> HarpSource:
    """Source for `drivers.registry`. Raises SettingsError for a setting or rate that cannot be."""
    read_as = parse_settings(Settings, settings, PROTOCOL)
    if rate_hz is not None and not 0 < rate_hz <= TICKS_PER_S:
        raise SettingsError(
            f"rate {rate_hz:g} Hz cannot be: LoadCells sends {RATE_HZ:g} Hz, leave --rate out"
        )
    return HarpSource(read_as, rate_hz or RATE_HZ)
