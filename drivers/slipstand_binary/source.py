"""A device that speaks Slipstand binary, as a `SampleSource`."""

import contextlib
import time

import msgspec

from drivers.errors import DeviceLostError, ProtocolError
from drivers.samples import DeviceIdentity
from drivers.settings import parse_settings
from drivers.slipstand_binary.codec import (
    FrameDecoder,
    compile_decoder,
    find_frame_headers,
    rate_from_frames,
)
from drivers.slipstand_binary.commands import (
    IDENTIFY,
    START,
    STOP,
    FirmwareIdentity,
    encode_rate,
    find_identity,
)
from drivers.source import Link
from drivers.stream import StreamSource

PROTOCOL = "slipstand-binary"
DEFAULT_BAUD = 460800
_ANSWER_S = 0.5
_QUIET_S = 0.3
_TRIES = 4
"""A board that opening its port has reset (an Arduino) is deaf for the first second or two."""
_LISTEN_S = 0.5
_RATE_S = 0.8
_RATE_TOLERANCE = 0.02


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The protocol leaves nothing to set."""


class SlipstandBinarySource(StreamSource):
    """Conversation: stop, drain, identify, set the rate where another is asked for, start."""

    def __init__(self, rate_hz: float | None = None) -> None:
        super().__init__(DeviceIdentity(PROTOCOL, "Slipstand binary"), DEFAULT_BAUD, rate_hz)

    def prepare(self) -> None:
        """Compile the decoder, which takes seconds on the very first use."""
        compile_decoder()

    def start(self, link: Link) -> bytes:
        """Stop what runs, set up, start, and wait for the first good frame.

        A device that does not answer `identify` is taken if its frames come; its rate is the one that
        its times show.

        Raises
        ------
        NoDataError
            If no good frame came within 3 s.
        ProtocolError
            If the device does not take the rate, or has not two channels.
        """
        self.prepare()
        deadline_s = time.monotonic() + self.timeout_s
        link.write(STOP)
        self._drain(link)
        device = self._identify(link)
        if device is not None:
            device = self._with_rate(link, device)
            self._rate_hz = device.rate_hz
            self._identity = DeviceIdentity(PROTOCOL, "slipstand-fw", firmware=device.version)
        link.write(START)
        return self._await_frames(link, deadline_s, measure=device is None)

    def resume(self, link: Link) -> bytes:
        """Go on; see `drivers.source.SampleSource`. Raises like `start`."""
        received, sends = self.await_data(
            link, time.monotonic() + _LISTEN_S, lambda data: len(find_frame_headers(data)) > 0
        )
        if sends:
            more, _ = self.await_data(
                link, time.monotonic() + _RATE_S, lambda data: rate_from_frames(received + data) is not None
            )
            received += more
        rate_hz = rate_from_frames(received)
        if self._rate_hz and rate_hz and abs(rate_hz / self._rate_hz - 1) <= _RATE_TOLERANCE:
            return received
        return self.start(link)

    def stop(self, link: Link) -> None:
        """Ask the device to stop; quiet when it is gone."""
        with contextlib.suppress(DeviceLostError):
            link.write(STOP)

    def make_decoder(self, data: bytes) -> FrameDecoder | None:
        """Decoder at the known rate, else at the one that the frames in `data` show."""
        if self._rate_hz is None:
            self._rate_hz = rate_from_frames(data)
        return FrameDecoder(self._rate_hz) if self._rate_hz else None

    def _drain(self, link: Link) -> None:
        """Let pass what was under way when the device was stopped."""
        end_s = time.monotonic() + _QUIET_S
        while link.read() and time.monotonic() < end_s:
            pass

    def _identify(self, link: Link) -> FirmwareIdentity | None:
        for _ in range(_TRIES):
            link.write(IDENTIFY)
            received, _ = self.await_data(
                link, time.monotonic() + _ANSWER_S, lambda data: find_identity(data) is not None
            )
            device = find_identity(received)
            if device is not None:
                return device
        return None

    def _with_rate(self, link: Link, device: FirmwareIdentity) -> FirmwareIdentity:
        """Set the rate if it is to be another, and let the device confirm it."""
        if self._rate_hz is None or device.rate_hz == self._rate_hz:
            return device
        link.write(encode_rate(self._rate_hz))
        told = self._identify(link)
        if told is None or told.rate_hz != self._rate_hz:
            raise ProtocolError(
                f"the device does not take {self._rate_hz:g} Hz and stays at {device.rate_hz:g} Hz: "
                f"ask for --rate {device.rate_hz:g} or one that it can do"
            )
        return told

    def _await_frames(self, link: Link, deadline_s: float, measure: bool) -> bytes:
        def is_enough(received: bytes) -> bool:
            return bool(rate_from_frames(received)) if measure else len(find_frame_headers(received)) > 0

        received, good = self.await_data(link, deadline_s, is_enough)
        if not good:
            raise self.no_data_error(received)
        if measure:
            self._take_measured(rate_from_frames(received))
        return received

    def _take_measured(self, rate_hz: float | None) -> None:
        if self._rate_hz is None or rate_hz is None:
            self._rate_hz = rate_hz
        elif abs(rate_hz / self._rate_hz - 1) > _RATE_TOLERANCE:
            raise ProtocolError(
                f"the device sends {rate_hz:.5g} Hz where {self._rate_hz:g} Hz is asked for, and cannot be "
                "set: leave --rate out"
            )


def make_source(settings: dict[str, str], rate_hz: float | None) -> SlipstandBinarySource:
    """Source for `drivers.registry`. Raises SettingsError for a setting or rate that cannot be."""
    parse_settings(Settings, settings, PROTOCOL)
    if rate_hz is not None:
        encode_rate(rate_hz)
    return SlipstandBinarySource(rate_hz)
