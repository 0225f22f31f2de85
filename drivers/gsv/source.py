"""A GSV-8 or GSV-6 as a `SampleSource`."""

import contextlib
import time
from typing import Literal

import msgspec

from drivers.errors import DeviceLostError, NoDataError, ProtocolError
from drivers.gsv.codec import MAX_CHANNELS, FrameDecoder, FrameLayout, ValueKind, compile_decoder, find_layout
from drivers.gsv.commands import (
    OK,
    Code,
    InputType,
    Response,
    encode_request,
    encode_response,
    find_response,
    rate_from_response,
    set_float,
    set_input,
    text_from_response,
    write_rate,
)
from drivers.samples import DeviceIdentity
from drivers.settings import parse_settings
from drivers.source import Link
from drivers.stream import StreamSource

PROTOCOL = "gsv"
DEFAULT_BAUD = 115200
_ANSWER_S = 0.4
_QUIET_S = 0.3
_TRIES = 2
_RATE_TOLERANCE = 0.02

_INPUTS = {
    "bridge-8.75v": InputType.BRIDGE_8_75_V,
    "bridge-5v": InputType.BRIDGE_5_V,
    "bridge-2.5v": InputType.BRIDGE_2_5_V,
    "single-ended": InputType.SINGLE_ENDED,
}


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What `--set` and `[device.settings]` may give."""

    table: int = 1
    relative: int = 2
    """Channels that the two gauges are wired to, from 1 on."""
    format: Literal["float32", "device"] = "float32"
    """`float32` sets the device to it; `device` leaves it, and takes int16 and int24 too."""
    input: Literal["device", "bridge-8.75v", "bridge-5v", "bridge-2.5v", "single-ended"] = "device"
    """Input range of both channels; `device` leaves it."""

    def __post_init__(self) -> None:
        for name in ("table", "relative"):
            if not 1 <= getattr(self, name) <= MAX_CHANNELS:
                raise ValueError(f"{name} {getattr(self, name)} is no channel: give 1 to {MAX_CHANNELS}")
        if self.table == self.relative:
            raise ValueError(f"table and relative are both channel {self.table}: give each gauge its own")


class GsvSource(StreamSource):
    """Conversation: stop, identify, set format, input and rate, start.

    Parameters
    ----------
    settings : Settings
    rate_hz : float or None
        Samples a second to set; None takes those of the device.
    """

    def __init__(self, settings: Settings, rate_hz: float | None = None) -> None:
        super().__init__(DeviceIdentity(PROTOCOL, "ME-Systeme GSV"), DEFAULT_BAUD, rate_hz)
        self._settings = settings
        self._layout: FrameLayout | None = None

    def prepare(self) -> None:
        """Compile the decoder, which takes seconds on the very first use."""
        compile_decoder()

    def start(self, link: Link) -> bytes:
        """Stop what it sends since it was switched on, set it up, and wait for the first frames.

        Raises
        ------
        NoDataError
            If the device does not answer, or no good frames came within 3 s.
        ProtocolError
            If the device does not take a setting, or has not the gauges' channels.
        """
        self.prepare()
        self._stop(link)
        self._set_up(link)
        deadline_s = time.monotonic() + self.timeout_s
        link.write(encode_request(Code.START))
        received, good = self.await_data(link, deadline_s, lambda data: find_layout(data) is not None)
        if not good:
            raise self.no_data_error(received)
        received = received.removeprefix(encode_response(OK))
        self._take_layout(received)
        return received

    def stop(self, link: Link) -> None:
        """Ask the device to stop; quiet when it is gone."""
        with contextlib.suppress(DeviceLostError):
            link.write(encode_request(Code.STOP))

    def make_decoder(self, data: bytes) -> FrameDecoder | None:
        """Decoder once the rate is known and `data` tell how frames are laid out.

        Raises
        ------
        ProtocolError
            If a gauge's channel is not in the frames.
        """
        if self._rate_hz is None:
            return None
        if self._layout is None:
            self._take_layout(data)
        return FrameDecoder(self._layout, self._rate_hz) if self._layout else None

    def _stop(self, link: Link) -> None:
        """Silence the device, let pass what was under way, and see that it answers."""
        link.write(encode_request(Code.STOP))
        end_s = time.monotonic() + _QUIET_S
        received = b""
        while (data := link.read()) and time.monotonic() < end_s:
            received += data
        for _ in range(_TRIES):
            if self._request(link, encode_request(Code.STOP)) is not None:
                return
        if find_layout(received) is None:
            raise self.no_data_error(received)
        raise NoDataError(
            "the device sends and does not answer: check the line from this computer to the device"
        )

    def _request(self, link: Link, command: bytes) -> Response | None:
        link.write(command)
        received, good = self.await_data(
            link, time.monotonic() + _ANSWER_S, lambda data: find_response(data) is not None
        )
        found = find_response(received)
        return found[0] if good and found else None

    def _require(self, link: Link, command: bytes, what: str) -> None:
        said = self._request(link, command)
        if said is None or not said.is_ok:
            fault = said.fault if said else "no answer"
            raise ProtocolError(f"the device does not take {what} ({fault}): choose what this model can do")

    def _set_up(self, link: Link) -> None:
        serial_number = self._request(link, encode_request(Code.SERIAL_NUMBER))
        firmware = self._request(link, encode_request(Code.FIRMWARE))
        self._identity = DeviceIdentity(
            PROTOCOL,
            self._identity.name,
            firmware=text_from_response(firmware) if firmware else "",
            serial_number=text_from_response(serial_number) if serial_number else "",
        )
        if self._settings.format == "float32":
            self._require(link, set_float(), "the format float32")
        if self._settings.input in _INPUTS:
            for channel in (self._settings.table, self._settings.relative):
                what = f"input {self._settings.input} on channel {channel}"
                self._require(link, set_input(channel, _INPUTS[self._settings.input]), what)
        self._set_rate(link)

    def _set_rate(self, link: Link) -> None:
        if self._rate_hz is not None:
            self._require(link, write_rate(self._rate_hz), f"{self._rate_hz:g} Hz")
        said = self._request(link, encode_request(Code.READ_RATE))
        told_hz = rate_from_response(said) if said else None
        if told_hz is None:
            raise ProtocolError("the device does not tell its rate: switch it off and on, and try again")
        if self._rate_hz is not None and abs(told_hz / self._rate_hz - 1) > _RATE_TOLERANCE:
            raise ProtocolError(
                f"the device does not take {self._rate_hz:g} Hz and stays at {told_hz:g} Hz: "
                f"ask for --rate {told_hz:g} or one that it can do"
            )
        self._rate_hz = told_hz

    def _take_layout(self, data: bytes) -> None:
        found = find_layout(data)
        if found is None:
            return
        channels, kind = found
        if self._settings.format == "float32" and kind is not ValueKind.FLOAT32:
            raise ProtocolError(
                f"the device sends {kind.name.lower()} where float32 was asked for: set format to device"
            )
        self._layout = FrameLayout(channels, kind, self._settings.table, self._settings.relative)


def make_source(settings: dict[str, str], rate_hz: float | None) -> GsvSource:
    """Source for `drivers.registry`. Raises SettingsError for a setting or rate that cannot be."""
    read = parse_settings(Settings, settings, PROTOCOL)
    if rate_hz is not None:
        write_rate(rate_hz)
    return GsvSource(read, rate_hz)
