"""A GSV-4, GSV-3 or GSV-2 as a `SampleSource`."""

from typing import Literal

import msgspec
import numpy as np

from drivers.devices.gsv_234 import DRIVER, codec, commands
from drivers.devices.gsv_234.codec import FORMATS, GSV_2, GSV_3, GSV_4, FrameDecoder
from drivers.devices.gsv_234.commands import Code
from drivers.errors import ProtocolError, SettingsError
from drivers.recognition import (
    IdentityQuery,
    Recognition,
    rate_from_count,
    unless_coincidence,
    which_channels,
)
from drivers.samples import DeviceIdentity
from drivers.source import LineSettings, Link
from drivers.stream import SampleSource, check_gauge_channels, check_rate, parse_settings
from messages.i18n import N_
from messages.message import EMPTY, Message, message, option

_TRIES = 2
_FRAMES_AT_START = 3


class Gsv234Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What `--set` and `[device.settings]` may give. Raises SettingsError."""

    format: Literal["gsv-4", "gsv-3", "gsv-2"] = "gsv-4"
    """The model: each has frames of its own."""
    table: int = 1
    relative: int = 2
    """Channels of a GSV-4 that the two gauges are wired to, from 1."""

    def __post_init__(self) -> None:
        check_gauge_channels(self.table, self.relative, range(1, codec.CHANNELS + 1))


class Gsv234Source(SampleSource):
    """Conversation: stop, identify, set and read the rate, start.

    The first stream is timed by the host's clock. After a loss it is not, because readings are waited for.
    """

    stop_command = commands.STOP

    def __init__(self, settings: Gsv234Settings, rate_hz: float | None = None) -> None:
        self._model = settings.format
        identity = DeviceIdentity(DRIVER.name, f"ME-Systeme {self._model.upper()}")
        super().__init__(identity, DRIVER.default_baud_for({"format": self._model}), rate_hz)
        self._channels = (settings.table, settings.relative)
        self._layout = FORMATS[self._model]
        self._was_timed = False

    @property
    def channels(self) -> int:
        return 1 if len(self._layout.places) == 1 else 2

    def prepare(self) -> None:
        wire = codec.encode_frames(self._layout, np.zeros((9, 2), dtype=np.int32))
        list(FrameDecoder(self._layout, 1.0).feed(wire.tobytes(), 0))

    def start(self, link: Link) -> bytes:
        self.prepare()
        received = self.silence(link)
        firmware = self._ask(link, Code.FIRMWARE, _TRIES)
        if firmware is None:
            sends = codec.count_frames(self._layout, received) >= _FRAMES_AT_START
            raise self.no_answer_error(received, sends=sends)
        version = commands.firmware_from_answer(firmware)
        serial = commands.serial_number_from_answer(self._ask(link, Code.SERIAL_NUMBER) or b"")
        self._identity = DeviceIdentity(DRIVER.name, self._identity.name, version, serial)
        self._set_rate(link)
        link.write(commands.START)
        first = self.await_stream(link, self._has_frames, self.timeout_s)
        if self._was_timed:
            return first
        more, sent_hz = self.time_stream(link, self._layout.marks.length)
        if sent_hz is not None:
            template = N_(
                "the device says {rate_hz:g} Hz and sends {actual_hz:.3g} Hz: switch its averaging over more"
                " than a second off with the vendor's program, and check its baud rate"
            )
            raise ProtocolError(template, rate_hz=self.rate_hz, actual_hz=sent_hz)
        self._was_timed = True
        return first + more

    def make_decoder(self, data: bytes) -> FrameDecoder | None:  # noqa: ARG002 - all is known but the rate
        if self._rate_hz is None:
            return None
        return FrameDecoder(self._layout, self._rate_hz, self._channels)

    def _ask(self, link: Link, code: Code, tries: int = 1) -> bytes | None:
        return self.request(
            link, bytes([code]), lambda received: commands.find_answer(self._model, code, received), tries
        )

    def _has_frames(self, received: bytes) -> bool:
        return codec.count_frames(self._layout, received) >= _FRAMES_AT_START

    def _set_rate(self, link: Link) -> None:
        """Read the rate, and set it if another one was asked for."""
        asked_hz, actual_hz = self._rate_hz, self._read_rate(link)
        if asked_hz is not None and not self.is_same_rate(actual_hz):
            for command in commands.write_rate(self._model, asked_hz):
                link.write(command)
                actual_hz = self._read_rate(link)
                if self.is_same_rate(actual_hz):
                    break
            else:
                template = N_(
                    "the device does not take {rate_hz:g} Hz and stays at {actual_hz:g} Hz: unlock it with"
                    " the vendor's program, or leave --rate out"
                )
                raise ProtocolError(template, rate_hz=asked_hz, actual_hz=actual_hz)
        self._rate_hz = actual_hz

    def _read_rate(self, link: Link) -> float:
        answer = self._ask(link, commands.read_rate(self._model))
        actual_hz = commands.rate_from_answer(self._model, answer) if answer else None
        if actual_hz is None:
            raise self.no_rate_error()
        return actual_hz


def make_source(settings: dict[str, str], rate_hz: float | None) -> Gsv234Source:
    """Source of the device. Raises SettingsError for a setting or rate that cannot be."""
    check_rate(rate_hz)
    return Gsv234Source(parse_settings(Gsv234Settings, settings, DRIVER.name), rate_hz)


def single_gauge_settings(gauge: str, settings: dict[str, str]) -> tuple[dict[str, str], int]:  # noqa: ARG001
    """Settings of a device with one gauge, and the column of its readings. Raises SettingsError."""
    if settings.get("format", GSV_4) == GSV_4:
        template = N_(
            "a GSV-4 has both gauges on one port: leave the port of gauge 2 out, or set format to {models}"
        )
        raise SettingsError(template, models=f"{GSV_3} or {GSV_2}")
    return settings, 0


def recognise(data: bytes, duration_s: float | None) -> Recognition | None:
    """What `data` are; see `drivers.recognition.recognise`."""
    found = [_recognise_model(model, data, duration_s) for model in FORMATS]
    return max(filter(None, found), key=lambda one: one.share, default=None)


def _recognise_model(model: str, data: bytes, duration_s: float | None) -> Recognition | None:
    layout = FORMATS[model]
    frames = codec.count_frames(layout, data)
    share = frames * layout.marks.length / max(len(data), 1)
    remark = which_channels(codec.CHANNELS) if model == GSV_4 else EMPTY
    rate_hz = rate_from_count(frames + 1, duration_s)  # the last frame was left out
    settings = {} if model == GSV_4 else {"format": model}
    channels = len(layout.places) if len(layout.places) == 1 else DRIVER.channels
    found = Recognition(DRIVER.name, share, frames, channels, settings, rate_hz, remark=remark)
    return unless_coincidence(found, has_checksum=False)


def _parse_firmware(received: bytes) -> Message | None:
    data = commands.find_answer(GSV_4, Code.FIRMWARE, received)
    if data is not None:
        return message("GSV-4, firmware {version}", version=commands.firmware_from_answer(data))
    is_short = received[:1] == bytes([commands.ANSWER]) and received[1:2] != bytes([Code.FIRMWARE])
    data = commands.find_answer(GSV_3, Code.FIRMWARE, received) if is_short else None
    if data is None or len(received) > 1 + len(data):
        return None
    template = N_("GSV-3 or GSV-2, firmware {version}: choose it with {option} format=gsv-3 or gsv-2")
    return message(template, version=commands.firmware_from_answer(data), option=option("--set"))


IDENTITY_QUERY = IdentityQuery(
    # before the query of a GSV-8, whose first byte sets the rate of a GSV-4
    0,
    bytes([Code.FIRMWARE]),
    (LineSettings(115200), LineSettings(38400)),
    _parse_firmware,
)
