"""An AED or FIT as a `SampleSource`."""

from collections.abc import Callable
from typing import Literal

import msgspec
import numpy as np

from drivers.devices.hbm_aed import DRIVER, codec, commands
from drivers.devices.hbm_aed.codec import FORMATS, Format, ValueDecoder
from drivers.errors import NoDataError, ProtocolError, SettingsError
from drivers.host_time import ArrivalRate
from drivers.recognition import IdentityQuery, Recognition, is_text, rate_from_count, unless_coincidence
from drivers.samples import DeviceIdentity
from drivers.source import LineSettings, Link
from drivers.stream import SampleSource, check_rate, parse_settings
from messages.i18n import N_
from messages.message import EMPTY, Message, message

_TRIES = 2
_VALUES_AT_START = 4
_LONGEST_PERIOD_S = 1.3
"""Between two values at the slowest rate of all, 100 / 2 ** 7 Hz."""
_TIMED_S = 0.5
_LAST_ADDRESS = 89


class HbmAedSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What `--set` and `[device.settings]` may give. Raises SettingsError."""

    format: Format = Format.BINARY
    filter: Literal["off", "device"] = "off"
    """`off` switches the digital filter off, because the factory setting, 0.3 Hz, hides a decay."""
    address: int | None = None
    """Of the device on a bus; None: it is alone."""

    def __post_init__(self) -> None:
        if self.address is not None and not 0 <= self.address <= _LAST_ADDRESS:
            template = N_("address {address} is none of a bus: give 0 to {last}, or leave it out")
            raise SettingsError(template, address=self.address, last=_LAST_ADDRESS)


class HbmAedSource(SampleSource):
    """Conversation: stop, select, identify, set format, filter and rate (None: that of the device), start.

    The device tells by what power of two its rate is divided, and not the rate. So the stream is timed by the
    host's clock, which tells one of the rates that the maker names. After a loss it is not timed again.
    """

    stop_command = commands.STOP
    answer_timeout_s = 0.5

    def __init__(self, settings: HbmAedSettings, rate_hz: float | None = None) -> None:
        super().__init__(DeviceIdentity(DRIVER.name, "HBM AED"), DRIVER.default_baud, rate_hz)
        self._settings = settings
        self._output = FORMATS[settings.format]
        self._full_hz: float | None = None

    @property
    def channels(self) -> int:
        return 1

    @property
    def run_note(self) -> Message:
        if self._settings.filter == "off":
            return EMPTY
        return message("the digital filter of the device was left as it is: state it in the calibration file")

    def prepare(self) -> None:
        frames = codec.encode_frames(self._settings.format, np.zeros((5, 2), dtype=np.int32))
        list(ValueDecoder(self._settings.format, 1.0).feed(b"".join(frames), 0))

    def start(self, link: Link) -> bytes:
        self.prepare()
        received = self.silence(link)
        if self._settings.address is not None:
            link.write(commands.select(self._settings.address))
        identity = self.request(link, commands.IDENTIFY, commands.find_identity, _TRIES)
        if identity is None:
            raise self.no_answer_error(received, sends=self._has_values(received))
        self._identity = DeviceIdentity(
            DRIVER.name, f"HBM {identity.name}", identity.firmware, identity.serial_number
        )
        self._require(link, commands.set_format(self._output.code))
        self.request(link, commands.STATUS_IN_VALUES, commands.find_line)  # some have no other, and refuse
        if self._settings.filter == "off":
            self._require(link, commands.FILTER_OFF)
        return self._start_at_rate(link)

    def make_decoder(self, data: bytes) -> ValueDecoder | None:  # noqa: ARG002 - all is known but the rate
        return None if self._rate_hz is None else ValueDecoder(self._settings.format, self._rate_hz)

    def _require(self, link: Link, command: bytes) -> None:
        if self.request(link, command, commands.find_line) != commands.DONE:
            template = N_("the device does not take {command}: choose what this model can do")
            raise ProtocolError(template, command=command.decode("ascii"))

    def _start_at_rate(self, link: Link) -> bytes:
        """Start, find out the rate, and start again where another one was asked for."""
        divider = self._read_divider(link)
        if self._full_hz is not None:
            return self._start_again(link, self._full_hz, divider)
        received, sent_hz = self._start_stream(link)
        full_hz = _full_rate(sent_hz, divider)
        wanted = divider if self._rate_hz is None else _divider_for(full_hz, self._rate_hz)
        if wanted != divider:
            self.silence(link)
            received = self._start_divided(link, full_hz, wanted)
        self._full_hz, self._rate_hz = full_hz, self._rate_hz or full_hz / 2**divider
        return received

    def _start_again(self, link: Link, full_hz: float, divider: int) -> bytes:
        """Start a device that is back, whose full rate is known and whose divider may have been lost."""
        wanted = _divider_for(full_hz, self.rate_hz)
        if wanted != divider:
            self._require(link, commands.set_divider(wanted))
        return self._await_values(link)

    def _start_divided(self, link: Link, full_hz: float, divider: int) -> bytes:
        """Set the divider, start, and check the rate by the host's clock."""
        self._require(link, commands.set_divider(divider))
        received, sent_hz = self._start_stream(link)
        if sent_hz is None or commands.full_rate(sent_hz, divider) != full_hz:
            template = N_(
                "the device was set to {rate_hz:g} Hz and sends {sent_hz:.3g} Hz: raise its baud rate, or ask"
                " for a lower rate"
            )
            raise ProtocolError(template, rate_hz=self.rate_hz, sent_hz=sent_hz or 0.0)
        return received

    def _read_divider(self, link: Link) -> int:
        line = self.request(link, commands.READ_DIVIDER, commands.find_line)
        if line is None or not line.isdigit() or int(line) > commands.MAX_DIVIDER:
            raise self.no_rate_error()
        return int(line)

    def _start_stream(self, link: Link) -> tuple[bytes, float | None]:
        """Start; returns what came, and how many values a second, None where they come unevenly."""
        received = self._await_values(link)
        arrivals = ArrivalRate(_TIMED_S)
        timed = _until_steady(arrivals, self._output.marks.length)
        more, _ = self.await_data(link, self.timeout_s, timed)
        windows_hz = arrivals.windows_hz
        return received + more, arrivals.steady_hz or (windows_hz[-1] if windows_hz else None)

    def _await_values(self, link: Link) -> bytes:
        """Start, and wait for the first values."""
        link.write(commands.START)
        longest_s = max(self.timeout_s, (_VALUES_AT_START + 1) * _LONGEST_PERIOD_S)
        received, good = self.await_data(link, longest_s, self._has_values)
        if not good:
            raise self._no_values_error(received)
        return received

    def _has_values(self, received: bytes) -> bool:
        return codec.count_frames(self._settings.format, received) >= _VALUES_AT_START

    def _no_values_error(self, received: bytes) -> NoDataError:
        if received and self._settings.format is Format.BINARY and not is_text(received):
            return NoDataError(
                "values come without line ends, so that a lost byte would not show: set format to ascii"
            )
        return self.no_data_error(received)


def _full_rate(sent_hz: float | None, divider: int) -> float:
    """Rate at ICR0 of a device that sends `sent_hz`. Raises ProtocolError if no known one does."""
    full_hz = commands.full_rate(sent_hz, divider) if sent_hz else None
    if full_hz is None:
        template = N_(
            "the device sends {sent_hz:.3g} values a second at ICR{divider}, which is none of the rates"
            " known of it ({rates} at ICR0): raise its baud rate"
        )
        rates = [f"{rate_hz:g}" for rate_hz in commands.FULL_RATES_HZ]
        raise ProtocolError(template, sent_hz=sent_hz or 0.0, divider=divider, rates=rates)
    return full_hz


def _divider_for(full_hz: float, rate_hz: float) -> int:
    """The divider for a rate. Raises SettingsError if the device has not that rate."""
    divider = commands.find_divider(full_hz, rate_hz)
    if divider is None:
        template = N_("the device cannot send {rate_hz:g} Hz: give one of {rates}")
        rates = [f"{full_hz / 2**n:g}" for n in range(commands.MAX_DIVIDER + 1)]
        raise SettingsError(template, rate_hz=rate_hz, rates=rates)
    return divider


def _until_steady(arrivals: ArrivalRate, frame_bytes: int) -> Callable[[bytes], bool]:
    def is_steady(received: bytes) -> bool:
        arrivals.add(len(received) / frame_bytes)
        return arrivals.steady_hz is not None

    return is_steady


def make_source(settings: dict[str, str], rate_hz: float | None) -> HbmAedSource:
    """Source of the device. Raises SettingsError for a setting or rate that cannot be."""
    check_rate(rate_hz)
    return HbmAedSource(parse_settings(HbmAedSettings, settings, DRIVER.name), rate_hz)


def recognise(data: bytes, duration_s: float | None) -> Recognition | None:
    """What `data` are; see `drivers.recognition.recognise`. A device sends by itself once it is set to."""
    if is_text(data):
        return None
    frames = codec.count_frames(Format.BINARY, data)
    share = frames * FORMATS[Format.BINARY].marks.length / max(len(data), 1)
    rate_hz = rate_from_count(frames, duration_s)
    found = Recognition(DRIVER.name, share, frames, DRIVER.channels, rate_hz=rate_hz)
    return unless_coincidence(found, has_checksum=False)


def _parse_identity(received: bytes) -> Message | None:
    identity = commands.find_identity(received)
    if identity is None:
        return None
    return message("{name}, firmware {version}", name=identity.name, version=identity.firmware)


IDENTITY_QUERY = IdentityQuery(
    5,
    commands.IDENTIFY,
    tuple(LineSettings(baud, parity) for baud in (9600, 38400, 115200) for parity in "EN"),
    _parse_identity,
)
