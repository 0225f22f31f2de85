"""How the simulated device packs its samples: the frames or lines of each protocol it can speak."""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from drivers.csv_lines import source as csv_lines
from drivers.csv_lines.codec import encode_lines
from drivers.csv_lines.columns import LineFormat
from drivers.errors import SettingsError
from drivers.gsv import source as gsv
from drivers.gsv.simulated import SimulatedGsv
from drivers.harp import source as harp
from drivers.harp.simulated import SimulatedHarp
from drivers.modbus import source as modbus
from drivers.modbus.simulated import SimulatedModbus
from drivers.samples import SampleStatus
from drivers.settings import parse_settings
from drivers.simulated.commands import (
    Command,
    CommandKind,
    CommandParser,
    FirmwareCommandParser,
    NullCommandParser,
)
from drivers.slipstand_binary import source as slipstand_binary
from drivers.slipstand_binary.codec import FrameFlags, encode_frames
from drivers.slipstand_binary.commands import FirmwareIdentity, encode_identity, samples_per_frame

FIRMWARE = "simulated-1"
MAX_RATE_HZ = 100_000.0


class SimulatedProtocol(Protocol):
    """Samples to frames, a frame being what is damaged or lost as a whole."""

    @property
    def streams_on_open(self) -> bool:
        """True: sends once its port is open. False: when started by command."""

    @property
    def max_rate_hz(self) -> float:
        """Highest rate that may be asked for."""

    def command_parser(self) -> CommandParser:
        """What finds the protocol's commands in what a reader sends."""

    def respond(self, command: Command, is_done: bool, rate_hz: float) -> bytes:
        """What the device says to a command that it did or could not do, at its rate (Hz)."""

    @property
    def line_end(self) -> bytes:
        """What ends a frame; damage to its last byte takes the next frame along. Empty: no such thing."""

    @property
    def flags_overload(self) -> bool:
        """Whether a frame says that one of its readings is clipped."""

    def samples_per_frame(self, rate_hz: float) -> int:
        """Samples in each frame at this rate."""

    def encode(
        self,
        first_sequence: int,
        counts: NDArray[np.int32],
        status: NDArray[np.uint8],
        times_s: NDArray[np.float64],
    ) -> list[bytes]:
        """Whole frames.

        Parameters
        ----------
        first_sequence : int
            Number of the very first sample; it is sent as wide as the protocol has it.
        counts : (frames * n, 2) int32
        status : (frames * n,) uint8
            `SampleStatus` of each sample.
        times_s : (frames,) float64
            Device time of the first sample of each frame (s).
        """


class SimulatedBinary:
    """`slipstand-binary`: frames with index, device time and CRC; obeys commands."""

    streams_on_open = False
    max_rate_hz = MAX_RATE_HZ
    line_end = b""
    flags_overload = True

    def command_parser(self) -> FirmwareCommandParser:
        """Finds the commands of the reference firmware."""
        return FirmwareCommandParser()

    def respond(self, command: Command, is_done: bool, rate_hz: float) -> bytes:  # noqa: ARG002
        """Says who it is; all else is done in silence."""
        if command.kind is CommandKind.IDENTIFY:
            return encode_identity(FirmwareIdentity(FIRMWARE, rate_hz, 2))
        return b""

    def samples_per_frame(self, rate_hz: float) -> int:
        """As the reference firmware: at most 5 ms and at most 32 samples."""
        return samples_per_frame(rate_hz)

    def encode(
        self,
        first_sequence: int,
        counts: NDArray[np.int32],
        status: NDArray[np.uint8],
        times_s: NDArray[np.float64],
    ) -> list[bytes]:
        """Whole frames; a frame is flagged as overloaded when one of its samples is."""
        seen = np.bitwise_or.reduce(status.reshape(len(times_s), -1), axis=1)
        table = np.where(seen & SampleStatus.OVERLOAD_TABLE, np.uint8(FrameFlags.OVERLOAD_TABLE), np.uint8(0))
        relative = seen & SampleStatus.OVERLOAD_RELATIVE
        flags = np.where(relative, table | np.uint8(FrameFlags.OVERLOAD_RELATIVE), table)
        times_us = np.rint(times_s * 1e6).astype(np.int64)
        return [row.tobytes() for row in encode_frames(first_sequence, times_us, counts, flags)]


@dataclass(frozen=True)
class SimulatedCsv:
    """`csv`: a line a sample from the moment the port is opened; overload shows as clipping only."""

    layout: LineFormat = field(default_factory=LineFormat)
    streams_on_open: bool = True
    max_rate_hz: float = MAX_RATE_HZ
    line_end: bytes = b"\r\n"
    flags_overload: bool = False

    def command_parser(self) -> NullCommandParser:
        """It talks and does not listen."""
        return NullCommandParser()

    def respond(self, command: Command, is_done: bool, rate_hz: float) -> bytes:  # noqa: ARG002
        """Nothing."""
        return b""

    def samples_per_frame(self, rate_hz: float) -> int:  # noqa: ARG002 - the same at any rate
        """One sample a line."""
        return 1

    def encode(
        self,
        first_sequence: int,
        counts: NDArray[np.int32],
        status: NDArray[np.uint8],  # noqa: ARG002 - a line of numbers has no flags
        times_s: NDArray[np.float64],
    ) -> list[bytes]:
        """A line for each sample."""
        return encode_lines(self.layout, times_s, counts, first_sequence)


def make_simulated_protocol(protocol: str, settings: dict[str, str]) -> SimulatedProtocol:
    """The packing of a protocol, with the device's own settings.

    Raises
    ------
    SettingsError
        If the simulated device does not speak that protocol, or has no such setting.
    """
    match protocol:
        case slipstand_binary.PROTOCOL:
            parse_settings(slipstand_binary.Settings, settings, protocol)
            return SimulatedBinary()
        case csv_lines.PROTOCOL:
            return SimulatedCsv(parse_settings(csv_lines.Settings, settings, protocol).layout())
        case gsv.PROTOCOL:
            return SimulatedGsv(parse_settings(gsv.Settings, settings, protocol))
        case harp.PROTOCOL:
            return SimulatedHarp(parse_settings(harp.Settings, settings, protocol))
        case modbus.PROTOCOL:
            return SimulatedModbus(modbus.read_modbus_settings(settings)[1])
    spoken = (slipstand_binary.PROTOCOL, csv_lines.PROTOCOL, gsv.PROTOCOL, harp.PROTOCOL, modbus.PROTOCOL)
    raise SettingsError(f"the simulated stand does not speak {protocol!r}: choose {', '.join(spoken)}")
