"""How the simulated device packs its samples: the frames or lines of each protocol it can speak."""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from drivers.csv_lines import source as csv_lines
from drivers.csv_lines.columns import LineFormat
from drivers.csv_lines.frames import encode_lines
from drivers.errors import SettingsError
from drivers.samples import SampleStatus
from drivers.settings import read_settings
from drivers.slipstand_binary import source as slipstand_binary
from drivers.slipstand_binary.commands import samples_per_frame
from drivers.slipstand_binary.frames import FrameFlags, encode_frames


class Packing(Protocol):
    """Samples to frames, a frame being what is damaged or lost as a whole."""

    @property
    def obeys_commands(self) -> bool:
        """True: sends when started by command. False: sends as long as its port is open."""

    @property
    def line_end(self) -> bytes:
        """What ends a frame; damage to its last byte takes the next frame along. Empty: no such thing."""

    @property
    def flags_overload(self) -> bool:
        """Whether a frame says that one of its readings is clipped."""

    def samples_per_frame(self, rate_hz: float) -> int:
        """Samples in each frame at this rate."""

    def pack(
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


class BinaryPacking:
    """`slipstand-binary`: frames with index, device time and CRC; obeys commands."""

    obeys_commands = True
    line_end = b""
    flags_overload = True

    def samples_per_frame(self, rate_hz: float) -> int:
        """As the reference firmware: at most 5 ms and at most 32 samples."""
        return samples_per_frame(rate_hz)

    def pack(
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
class CsvPacking:
    """`csv`: a line a sample from the moment the port is opened; overload shows as clipping only."""

    layout: LineFormat = field(default_factory=LineFormat)
    obeys_commands: bool = False
    line_end: bytes = b"\r\n"
    flags_overload: bool = False

    def samples_per_frame(self, rate_hz: float) -> int:  # noqa: ARG002 - the same at any rate
        """One sample a line."""
        return 1

    def pack(
        self,
        first_sequence: int,
        counts: NDArray[np.int32],
        status: NDArray[np.uint8],  # noqa: ARG002 - a line of numbers has no flags
        times_s: NDArray[np.float64],
    ) -> list[bytes]:
        """A line for each sample."""
        return encode_lines(self.layout, times_s, counts, first_sequence)


def packing_for(protocol: str, settings: dict[str, str]) -> Packing:
    """The packing of a protocol, with the device's own settings.

    Raises
    ------
    SettingsError
        If the simulated device does not speak that protocol, or has no such setting.
    """
    match protocol:
        case slipstand_binary.PROTOCOL:
            read_settings(slipstand_binary.Settings, settings, protocol)
            return BinaryPacking()
        case csv_lines.PROTOCOL:
            return CsvPacking(read_settings(csv_lines.Settings, settings, protocol).layout())
    raise SettingsError(
        f"the simulated stand does not speak {protocol!r}: choose {slipstand_binary.PROTOCOL} or"
        f" {csv_lines.PROTOCOL}"
    )
