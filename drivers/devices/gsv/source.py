"""A GSV-8 or GSV-6 as a `SampleSource`."""

from typing import Literal

import msgspec
import numpy as np

from drivers.devices.gsv import DRIVER, codec, commands
from drivers.devices.gsv.codec import FrameDecoder, FrameLayout, ValueKind
from drivers.devices.gsv.commands import Code, InputType, Response
from drivers.errors import ProtocolError
from drivers.recognition import (
    IdentityQuery,
    Recognition,
    rate_from_count,
    unless_coincidence,
    which_channels,
)
from drivers.samples import ChannelFilter, DeviceIdentity
from drivers.source import LineSettings, Link
from drivers.stream import SampleSource, check_gauge_channels, parse_settings
from messages.i18n import N_
from messages.message import EMPTY, Message, message

_TRIES = 2
_CORNER_PER_RATE = 0.4
"""Corner by the data rate of the decimating filter, a weighted mean (kb.me-systeme.de, "Grenzfrequenz des
GSV-8")."""
_INPUTS = dict(zip(("bridge-8.75v", "bridge-5v", "bridge-2.5v", "single-ended"), InputType, strict=True))


class GsvSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What `--set` and `[device.settings]` may give. Raises SettingsError."""

    table: int = 1
    relative: int = 2
    """Channels that the two gauges are wired to, from 1."""
    format: Literal["float32", "device"] = "float32"
    """`float32` sets the device to it; `device` leaves it, and accepts int16 and int24 too."""
    input: Literal["device", "bridge-8.75v", "bridge-5v", "bridge-2.5v", "single-ended"] = "device"
    """Input range of both channels; `device` leaves it."""

    def __post_init__(self) -> None:
        check_gauge_channels(self.table, self.relative, range(1, codec.MAX_CHANNELS + 1))


class GsvSource(SampleSource):
    """Conversation: stop, identify, set format, input and rate (None: that of the device), start.

    The stream is timed by the host's clock, because a GSV-6 may confirm a rate and go on at the one before.
    """

    stop_command = commands.encode_request(Code.STOP)

    def __init__(self, settings: GsvSettings, rate_hz: float | None = None) -> None:
        super().__init__(DeviceIdentity(DRIVER.name, "ME-Systeme GSV"), DRIVER.default_baud, rate_hz)
        self._settings = settings
        self._layout: FrameLayout | None = None

    @property
    def filters(self) -> tuple[ChannelFilter, ChannelFilter]:
        """Decimation filter of the GSV-8; nothing is published of the GSV-6, which has the same commands."""
        own = ChannelFilter(1, _CORNER_PER_RATE * self.rate_hz)
        return own, own

    def prepare(self) -> None:
        layout = FrameLayout(2)
        list(FrameDecoder(layout, 1.0).feed(codec.encode_frames(layout, np.zeros((2, 2))).tobytes(), 0))

    def start(self, link: Link) -> bytes:
        self.prepare()
        received = self.silence(link)
        if self.request(link, self.stop_command, commands.find_response, _TRIES) is None:
            raise self.no_answer_error(received, sends=codec.find_layout(received) is not None)
        self._set_up(link)
        link.write(commands.encode_request(Code.START))
        received = self.await_stream(link, codec.find_layout, self.timeout_s)
        received = received.removeprefix(commands.encode_response(commands.OK))
        self._set_layout(received)
        return received + self._check_sent_rate(link)

    @property
    def run_note(self) -> Message:
        if self._layout is None or self._layout.kind is ValueKind.FLOAT32:
            return EMPTY
        template = N_(
            "the device sends {kind}, whose scale was not verified on hardware: calibrate in this format, and"
            " use that calibration for it alone"
        )
        return message(template, kind=self._layout.kind.name.lower())

    def make_decoder(self, data: bytes) -> FrameDecoder | None:
        if self._rate_hz is None:
            return None
        if self._layout is None:
            self._set_layout(data)
        return FrameDecoder(self._layout, self._rate_hz) if self._layout else None

    def _ask(self, link: Link, command: bytes) -> Response | None:
        return self.request(link, command, commands.find_response)

    def _require(self, link: Link, command: bytes, what: Message) -> None:
        response = self._ask(link, command)
        if response is None or not response.is_ok:
            template = N_("the device does not take {what} ({fault}): choose what this model can do")
            raise ProtocolError(
                template, what=what, fault=response.fault if response else message("no answer")
            )

    def _set_up(self, link: Link) -> None:
        serial_number = self._ask(link, commands.encode_request(Code.SERIAL_NUMBER))
        firmware = self._ask(link, commands.encode_request(Code.FIRMWARE))
        version = commands.firmware_from_response(firmware) if firmware else ""
        serial = commands.serial_number_from_response(serial_number) if serial_number else ""
        self._identity = DeviceIdentity(DRIVER.name, self._identity.name, version, serial)
        if self._settings.format == "float32":
            self._require(link, commands.set_float(), message("the format float32"))
        if self._settings.input in _INPUTS:
            for channel in (self._settings.table, self._settings.relative):
                template = N_("input {input} on channel {channel}")
                what = message(template, input=self._settings.input, channel=channel)
                self._require(link, commands.set_input(channel, _INPUTS[self._settings.input]), what)
        self._set_rate(link)

    def _set_rate(self, link: Link) -> None:
        if self._rate_hz is not None:
            what = message("{rate_hz:g} Hz", rate_hz=self._rate_hz)
            self._require(link, commands.write_rate(self._rate_hz), what)
        response = self._ask(link, commands.encode_request(Code.READ_RATE))
        actual_hz = commands.rate_from_response(response) if response else None
        if actual_hz is None:
            raise self.no_rate_error()
        if not self.is_same_rate(actual_hz):
            template = N_(
                "the device does not take {rate_hz:g} Hz and stays at {actual_hz:g} Hz: "
                "ask for --rate {actual_hz:g} or one that it can do"
            )
            raise ProtocolError(template, rate_hz=self._rate_hz, actual_hz=actual_hz)
        self._rate_hz = actual_hz

    def _check_sent_rate(self, link: Link) -> bytes:
        received, sent_hz = self.time_stream(link, self._layout.length if self._layout else 0)
        if sent_hz is not None:
            template = N_(
                "the device says {rate_hz:g} Hz and sends {actual_hz:.3g} Hz: switch it off and on, after"
                " which a GSV-6 takes a new rate, raise its baud rate, or ask for --rate {actual_hz:.3g}"
            )
            raise ProtocolError(template, rate_hz=self._rate_hz, actual_hz=sent_hz)
        return received

    def _set_layout(self, data: bytes) -> None:
        found = codec.find_layout(data)
        if found is None:
            return
        channels, kind = found
        if self._settings.format == "float32" and kind is not ValueKind.FLOAT32:
            template = N_("the device sends {kind} where float32 was asked for: set format to device")
            raise ProtocolError(template, kind=kind.name.lower())
        self._layout = FrameLayout(channels, kind, self._settings.table, self._settings.relative)


def make_source(settings: dict[str, str], rate_hz: float | None) -> GsvSource:
    """Source of the device. Raises SettingsError for a setting or rate that cannot be."""
    parsed = parse_settings(GsvSettings, settings, DRIVER.name)
    if rate_hz is not None:
        commands.write_rate(rate_hz)
    return GsvSource(parsed, rate_hz)


def recognise(data: bytes, duration_s: float | None) -> Recognition | None:
    """What `data` are; see `drivers.recognition.recognise`."""
    frame = codec.find_layout(data)
    if frame is None or frame[0] < DRIVER.channels:
        return None
    channels, kind = frame
    layout = FrameLayout(channels, kind)
    frames = sum(map(len, FrameDecoder(layout, 1.0).feed(data, 0)))
    share = frames * layout.length / max(len(data), 1)
    settings = {} if kind is ValueKind.FLOAT32 else {"format": "device"}
    remark = which_channels(channels) if channels > DRIVER.channels else EMPTY
    rate_hz = rate_from_count(frames, duration_s)
    found = Recognition(DRIVER.name, share, frames, settings=settings, rate_hz=rate_hz, remark=remark)
    return unless_coincidence(found, has_checksum=False)


def _parse_firmware(received: bytes) -> Message | None:
    response = commands.find_response(received)
    if response is None:
        return None
    version = commands.firmware_from_response(response)
    return message("firmware {version}", version=version) if version else message("firmware unknown")


IDENTITY_QUERY = IdentityQuery(
    3, commands.encode_request(Code.FIRMWARE), (LineSettings(115200), LineSettings(230400)), _parse_firmware
)
