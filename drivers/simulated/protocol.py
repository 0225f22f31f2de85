"""The device's side of a protocol: how a simulated device encodes samples and answers commands."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import Enum, auto
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

MAX_RATE_HZ = 100_000.0
"""Rate at which the simulated stand still keeps up on a common computer."""


class CommandKind(Enum):
    """What a command asks for."""

    START = auto()
    STOP = auto()
    IDENTIFY = auto()
    RATE = auto()
    OTHER = auto()
    """Known to the protocol alone, which answers by itself."""


@dataclass(frozen=True, slots=True)
class Command:
    """One command, with the rate (Hz) where it carries one, and with code and parameters of its protocol."""

    kind: CommandKind
    rate_hz: float = 0.0
    code: int = 0
    parameters: bytes = b""


class CommandParser(Protocol):
    """Finds the commands of a protocol in received bytes."""

    def feed(self, data: bytes) -> list[Command]:
        """Commands completed by `data`, which may be cut anywhere."""


class NullCommandParser:
    """For a device that takes no commands."""

    def feed(self, data: bytes) -> list[Command]:  # noqa: ARG002
        """No commands."""
        return []


class SimulatedProtocol(ABC):
    """Samples to frames, and commands to answers. A frame is damaged or lost as a whole."""

    streams_on_open = False
    """Whether it sends once its port is open, or when a command starts it."""
    max_rate_hz = MAX_RATE_HZ
    line_end = b""
    """What ends a frame; damage to its last byte damages the next frame too. b"" for frames of fixed form."""
    flags_overload = False
    """Whether a frame says that one of its readings is clipped."""

    @abstractmethod
    def command_parser(self) -> CommandParser:
        """A new parser for what a reader sends."""

    @abstractmethod
    def respond(self, command: Command, is_done: bool, rate_hz: float) -> bytes:
        """Answer to a command that the device did or could not do, at its rate (Hz); b"" for none."""

    def samples_per_frame(self, rate_hz: float) -> int:  # noqa: ARG002 - most have one
        """Samples in each frame at this rate."""
        return 1

    @abstractmethod
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
            Number of the very first sample; the protocol limits its width.
        status : (frames * n,) uint8
            `SampleStatus` of each sample.
        times_s : (frames,) float64
            Device time of the first sample of each frame (s).
        """


class PolledProtocol(SimulatedProtocol):
    """A protocol whose samples are not sent: the latest one is held in registers until it is asked for."""

    streams_on_open = True
    byte_s: float
    """Time of one byte on the wire (s)."""
    turnaround_s: float
    """From the end of a request to the beginning of its answer (s)."""

    @abstractmethod
    def request_bytes(self, command: Command) -> int:
        """Length of a request."""

    @abstractmethod
    def store_sample(self, counts: NDArray[np.int32], status: int) -> None:
        """Put a sample, (2,) counts and the overload bits of `SampleStatus`, into the registers."""

    def encode(
        self,
        first_sequence: int,  # noqa: ARG002 - registers have no number
        counts: NDArray[np.int32],
        status: NDArray[np.uint8],
        times_s: NDArray[np.float64],
    ) -> list[bytes]:
        """Store the last sample; nothing is sent that was not asked for."""
        self.store_sample(counts[-1], int(status[-1]))
        return [b""] * len(times_s)
