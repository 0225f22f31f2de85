"""An eNod4 that sends fast SCMBus, as a `SampleSource`."""

from typing import Annotated, Literal

import msgspec
import numpy as np
from msgspec import Meta

from drivers.devices.enod4 import DRIVER, codec
from drivers.devices.enod4.codec import Checksum, Code, FrameDecoder
from drivers.errors import ProtocolError, SettingsError
from drivers.recognition import IdentityQuery, Recognition, rate_from_count, unless_coincidence
from drivers.samples import DeviceIdentity
from drivers.source import LineSettings, Link
from drivers.stream import SampleSource, parse_settings
from messages.i18n import N_
from messages.message import Message, message, option

_STARTS = {"gross": Code.START_GROSS, "net": Code.START_NET, "factory": Code.START_FACTORY}
_FRAMES_AT_START = 3
_QUERY = codec.encode_command(1, Code.STOP)  # nothing to a device that does not send


class Enod4Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What `--set` and `[device.settings]` may give."""

    address: Annotated[int, Meta(ge=1, le=247)] = 1
    value: Literal["gross", "net", "factory"] = "gross"
    """Which measurement it sends; "factory" are the points of the factory's calibration."""
    checksum: Checksum = Checksum.FRAME


class Enod4Source(SampleSource):
    """Conversation: stop, start. The stream is timed by the host's clock, which must agree with `rate_hz`."""

    def __init__(self, settings: Enod4Settings, rate_hz: float) -> None:
        super().__init__(DeviceIdentity(DRIVER.name, "Scaime eNod4"), DRIVER.default_baud, rate_hz)
        self._settings = settings
        self.stop_command = codec.encode_command(settings.address, Code.STOP)

    @property
    def channels(self) -> int:
        return DRIVER.channels

    def prepare(self) -> None:
        (frame,) = codec.encode_frames(np.zeros(1, dtype=np.int32), np.zeros(1, dtype=np.int64))
        list(FrameDecoder(1.0).feed(frame, 0))

    def start(self, link: Link) -> bytes:
        self.prepare()
        self.silence(link)
        command = codec.encode_command(self._settings.address, _STARTS[self._settings.value])
        link.write(command)
        received, is_good = self.await_data(link, self.timeout_s, self._has_frames)
        received = received.replace(command, b"", 1)  # sent back where it was done
        if not is_good:
            self._check_checksum(received)
            raise self.no_data_error(received)
        frames, length = codec.measure_frames(received, self._settings.checksum)
        more, sent_hz = self.time_stream(link, length / frames)
        if sent_hz is not None:
            template = N_("the device sends {actual_hz:.3g} Hz, not {rate_hz:g} Hz: give --rate as it is set")
            raise ProtocolError(template, actual_hz=sent_hz, rate_hz=self.rate_hz)
        return received + more

    def make_decoder(self, data: bytes) -> FrameDecoder:  # noqa: ARG002 - settings and rate are enough
        return FrameDecoder(self.rate_hz, self._settings.checksum)

    def _has_frames(self, received: bytes) -> bool:
        return codec.measure_frames(received, self._settings.checksum)[0] >= _FRAMES_AT_START

    def _check_checksum(self, received: bytes) -> None:
        """Raise ProtocolError where the frames are those of another setting of the checksum."""
        for checksum in Checksum:
            if codec.measure_frames(received, checksum)[0] >= _FRAMES_AT_START:
                template = N_("the checksums are sums of other bytes: give --set checksum={checksum}")
                raise ProtocolError(template, checksum=checksum.value)


def make_source(settings: dict[str, str], rate_hz: float | None) -> Enod4Source:
    """Source of the device. Raises SettingsError for a setting or rate that cannot be."""
    parsed = parse_settings(Enod4Settings, settings, DRIVER.name)
    if rate_hz is None or not 0 < rate_hz < float("inf"):
        raise SettingsError(
            "an eNod4 does not send its rate: give --rate, its A/D conversion rate or what SCMBus is set to"
        )
    return Enod4Source(parsed, rate_hz)


def recognise(data: bytes, duration_s: float | None) -> Recognition | None:
    """What `data` are; see `drivers.recognition.recognise`."""
    checksum = max(Checksum, key=lambda one: codec.measure_frames(data, one))
    frames, good_bytes = codec.measure_frames(data, checksum)
    settings = {} if checksum is Checksum.FRAME else {"checksum": checksum.value}
    share = good_bytes / max(len(data), 1)
    rate_hz = rate_from_count(frames + 1, duration_s)
    found = Recognition(DRIVER.name, share, frames, 1, settings, rate_hz, needs_rate=True)
    return unless_coincidence(found, has_checksum=True)


def explain(received: bytes) -> Message | None:
    """Meaning of an error frame in `received`; None without one."""
    for code, template in (
        (codec.UNKNOWN_COMMAND, N_("the device does not know the command: set its protocol to fast SCMBus")),
        (codec.FAILED_COMMAND, N_("the device could not do the command: switch it off and on")),
    ):
        if received[1:3] == bytes([code]) + b"\r":
            return message(template)
    return None


def _parse_echo(received: bytes) -> Message | None:
    if received != _QUERY:
        return None
    template = N_("an eNod4 with address {address}: give its rate with {option}")
    return message(template, address=_QUERY[0], option=option("--rate"))


IDENTITY_QUERY = IdentityQuery(
    3, _QUERY, tuple(LineSettings(baud, stop_bits=2) for baud in (115200, 9600)), _parse_echo
)
