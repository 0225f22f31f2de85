"""A device with the Slipstand binary protocol, as a `SampleSource`."""

import time

import msgspec
import numpy as np

from drivers.devices.slipstand_binary import DRIVER, codec
from drivers.devices.slipstand_binary.codec import FirmwareIdentity, FrameDecoder
from drivers.devices.slipstand_binary.converters import converter_filter
from drivers.errors import ProtocolError
from drivers.recognition import IdentityQuery, Recognition, rate_from_count, unless_coincidence
from drivers.samples import ChannelFilter, DeviceIdentity
from drivers.source import LineSettings, Link
from drivers.stream import RATE_GROWTH, SampleSource, parse_settings
from messages.i18n import N_
from messages.message import Message, message

_TRIES = 4
"""A board that is reset by opening its port (an Arduino) answers nothing for the first second or two."""
_LISTEN_S = 0.5  # how long a device is listened to that may still be sending; ten frames at 20 Hz
_RATE_S = 0.8  # how long its rate is measured, which needs 0.5 s of frames


class BinarySettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The protocol has no settings."""


class SlipstandBinarySource(SampleSource):
    """Conversation: stop, identify, set the rate where another is asked for, start."""

    answer_timeout_s = 0.5
    stop_command = codec.STOP

    def __init__(self, rate_hz: float | None = None) -> None:
        super().__init__(DeviceIdentity(DRIVER.name, "Slipstand binary"), DRIVER.default_baud, rate_hz)

    @property
    def filters(self) -> tuple[ChannelFilter | None, ChannelFilter | None]:
        own = converter_filter(self._identity.firmware, self.rate_hz)
        return own, own

    def prepare(self) -> None:
        frame = codec.encode_frame(0, 0, np.zeros((1, 2), dtype=np.int32))
        list(FrameDecoder(1.0).feed(frame, 0))

    def start(self, link: Link) -> bytes:
        """Accept a device that does not answer `IDENTIFY` if its frames come; its rate is then measured."""
        self.prepare()
        deadline_s = time.perf_counter() + self.timeout_s
        self.silence(link)
        device = self.request(link, codec.IDENTIFY, codec.find_identity, _TRIES)
        if device is not None:
            device = self._with_rate(link, device)
            self._rate_hz = device.rate_hz
            self._identity = DeviceIdentity(DRIVER.name, "slipstand-fw", firmware=device.version)
        link.write(codec.START)
        return self._await_frames(link, deadline_s - time.perf_counter(), measure=device is None)

    def resume(self, link: Link) -> bytes:
        received, sends = self.await_data(link, _LISTEN_S, codec.has_frame)
        if sends:
            more, _ = self.await_data(
                link, _RATE_S, lambda data: codec.rate_from_frames(received + data), RATE_GROWTH
            )
            received += more
        rate_hz = codec.rate_from_frames(received)
        if self._rate_hz and rate_hz and self.is_same_rate(rate_hz):
            return received
        return self.start(link)

    def make_decoder(self, data: bytes) -> FrameDecoder | None:
        """Decoder at the known rate, else at the one that the frames in `data` show."""
        if self._rate_hz is None:
            self._rate_hz = codec.rate_from_frames(data)
        return FrameDecoder(self._rate_hz) if self._rate_hz else None

    def _with_rate(self, link: Link, device: FirmwareIdentity) -> FirmwareIdentity:
        if self._rate_hz is None or device.rate_hz == self._rate_hz:
            return device
        link.write(codec.encode_rate(self._rate_hz))
        confirmed = self.request(link, codec.IDENTIFY, codec.find_identity, _TRIES)
        if confirmed is None or confirmed.rate_hz != self._rate_hz:
            template = N_(
                "the device does not take {rate_hz:g} Hz and stays at {actual_hz:g} Hz: "
                "ask for --rate {actual_hz:g} or one that it can do"
            )
            raise ProtocolError(template, rate_hz=self._rate_hz, actual_hz=device.rate_hz)
        return confirmed

    def _await_frames(self, link: Link, timeout_s: float, *, measure: bool) -> bytes:
        wanted, growth = (codec.rate_from_frames, RATE_GROWTH) if measure else (codec.has_frame, 0.0)
        received = self.await_stream(link, wanted, timeout_s, growth)
        rate_hz = codec.rate_from_frames(received) if measure else None
        if not self.is_same_rate(rate_hz):
            template = N_(
                "the device sends {actual_hz:.5g} Hz where {rate_hz:g} Hz is asked for, and cannot be "
                "set: leave --rate out"
            )
            raise ProtocolError(template, actual_hz=rate_hz, rate_hz=self._rate_hz)
        self._rate_hz = self._rate_hz or rate_hz
        return received


def make_source(settings: dict[str, str], rate_hz: float | None) -> SlipstandBinarySource:
    """Source of the device. Raises SettingsError for a setting or rate that cannot be."""
    parse_settings(BinarySettings, settings, DRIVER.name)
    if rate_hz is not None:
        codec.encode_rate(rate_hz)
    return SlipstandBinarySource(rate_hz)


def recognise(data: bytes, duration_s: float | None) -> Recognition | None:
    """What `data` are; see `drivers.recognition.recognise`."""
    frames = codec.find_frames(data)
    share = sum(codec.frame_length(int(n)) for n in frames["n"]) / max(len(data), 1)
    rate_hz = codec.rate_from_frames(data) or rate_from_count(int(frames["n"].sum()), duration_s)
    return unless_coincidence(
        Recognition(DRIVER.name, share, len(frames), rate_hz=rate_hz), has_checksum=True
    )


def _parse_identity(received: bytes) -> Message | None:
    try:
        device = codec.find_identity(received)
    except ProtocolError as error:
        return error.message
    template = N_("firmware {version}, {rate_hz:g} Hz")
    return message(template, version=device.version, rate_hz=device.rate_hz) if device else None


IDENTITY_QUERY = IdentityQuery(
    1, codec.IDENTIFY, tuple(LineSettings(baud) for baud in (460800, 500000, 115200)), _parse_identity
)
