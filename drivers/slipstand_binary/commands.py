"""What the host says to a Slipstand binary device, and how the device says who it is."""

import re
from dataclasses import dataclass

from drivers.errors import ProtocolError, SettingsError

START = b"S"
STOP = b"P"
IDENTIFY = b"I"

_IDENTITY = re.compile(rb"slipstand-fw (\S+) (\d+(?:\.\d+)?) (\d+)\r?\n")
_FRAME_SPAN_RATE_HZ = 200.0
_MAX_RATE_HZ = 1_000_000


@dataclass(frozen=True, slots=True)
class FirmwareIdentity:
    """The answer to `IDENTIFY`."""

    version: str
    rate_hz: float
    channels: int


def encode_rate(rate_hz: float) -> bytes:
    """Command that sets the sample rate: `R<hz>` and a newline, whole hertz.

    Raises
    ------
    SettingsError
        If `rate_hz` is no whole number from 1 to 1,000,000.
    """
    if not (1 <= rate_hz <= _MAX_RATE_HZ and rate_hz == int(rate_hz)):
        raise SettingsError(f"rate {rate_hz:g} Hz cannot be set: give whole hertz from 1 to {_MAX_RATE_HZ}")
    return b"R%d\n" % int(rate_hz)


def find_identity(received: bytes) -> FirmwareIdentity | None:
    """The identify line in `received`, wherever it stands; None if it is not whole yet.

    Raises
    ------
    ProtocolError
        If the device has not two channels.
    """
    match = _IDENTITY.search(received)
    if match is None:
        return None
    identity = FirmwareIdentity(match[1].decode("ascii", "replace"), float(match[2]), int(match[3]))
    if identity.channels != 2:
        raise ProtocolError(
            f"the device has {identity.channels} channels and 2 are needed (table, relative): "
            "flash firmware for two channels"
        )
    return identity


def encode_identity(identity: FirmwareIdentity) -> bytes:
    """What a device answers to `IDENTIFY`."""
    return f"slipstand-fw {identity.version} {identity.rate_hz:g} {identity.channels}\n".encode("ascii")


def samples_per_frame(rate_hz: float) -> int:
    """Samples the device puts into a frame: at most 32, and below 6.4 kHz at most 5 ms of them."""
    return int(min(max(rate_hz / _FRAME_SPAN_RATE_HZ, 1), 32))
