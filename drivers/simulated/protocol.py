"""The device's side of a protocol: how a simulated device encodes samples and answers commands."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, auto

from drivers.arrays import Floats, Int32s, UInt8s
from drivers.simulated.transport import Transport

MAX_RATE_HZ = 100_000.0  # rate at which the simulated stand still keeps up on a common computer
MAX_COUNT = 2**23 - 1  # of a 24-bit converter


class CommandKind(Enum):
    """What a command asks for."""

    START = auto()
    STOP = auto()
    IDENTIFY = auto()
    RATE = auto()
    OTHER = auto()  # known to the protocol alone, which answers by itself


@dataclass(frozen=True, slots=True)
class Command:
    """One command, with the rate (Hz) where it carries one, and with code and parameters of its protocol."""

    kind: CommandKind
    rate_hz: float = 0.0
    code: int = 0
    parameters: bytes = b""


_MAX_UNFINISHED_BYTES = 256  # no command of any device is longer


class CommandParser:
    """Finds the commands of a protocol in bytes in any cut; other bytes are skipped."""

    def __init__(self, find: Callable[[bytes], tuple[list[Command], int]]) -> None:
        self._find = find
        self._unfinished = b""

    def feed(self, data: bytes) -> list[Command]:
        data = self._unfinished + data
        commands, used = self._find(data)
        self._unfinished = data[used:][-_MAX_UNFINISHED_BYTES:]
        return commands


class SimulatedProtocol(ABC):
    """Samples to frames, and commands to answers. A frame is damaged or lost as a whole."""

    streams_on_open = False  # whether it sends once its port is open, or when a command starts it
    max_rate_hz = MAX_RATE_HZ
    max_count: float = MAX_COUNT
    """Largest count of its converter, and of its negative."""
    line_end = b""
    """What ends a frame; damage to its last byte damages the next frame too. b"" for frames of fixed form."""
    flags_overload = False  # whether a frame flags clipped readings
    buffer_bytes = 0
    """Room for what the port does not take, before the stream ends; 0: that is lost, as on a UART."""
    packet_bytes = 1
    """A device with a buffer sends no less at once, unless its stream has ended."""

    def overflow(self) -> bytes:
        """Stop, because the buffer is full; returns the last bytes of the stream."""
        return b""

    def open_transport(self, rate_hz: float) -> Transport | None:  # noqa: ARG002
        """Port of a device that has no serial one, at its rate (Hz); None for most."""
        return None

    def find_commands(self, data: bytes) -> tuple[list[Command], int]:
        """Whole commands in `data`, and the number of bytes that were used; the rest may begin a command."""
        return [], len(data)

    def respond(self, command: Command, is_done: bool, rate_hz: float) -> bytes:  # noqa: ARG002
        """Answer to a command that the device did or could not do, at its rate (Hz); b"" for none."""
        return b""

    def samples_per_frame(self, rate_hz: float) -> int:  # noqa: ARG002 - most have one
        return 1

    @abstractmethod
    def encode(self, first_sequence: int, counts: Int32s, status: UInt8s, times_s: Floats) -> list[bytes]:
        """Whole frames.

        `counts` (frames * n, 2) and `status` (frames * n,) are samples with their `SampleStatus`, `times_s`
        (frames,) the device time of the first sample of each frame, `first_sequence` the number of the very
        first sample; the protocol limits its width.
        """


class PolledProtocol(SimulatedProtocol):
    """A protocol whose samples are not sent: the latest one is held in registers until it is asked for."""

    streams_on_open = True
    byte_s: float
    """Time of one byte on the wire (s)."""
    turnaround_s: float  # from the end of a request to the beginning of its answer (s)

    @abstractmethod
    def request_bytes(self, command: Command) -> int:
        """Length of a request."""

    @abstractmethod
    def store_sample(self, counts: Int32s, status: int) -> None:
        """Put a sample, (2,) counts and the overload bits of `SampleStatus`, into the registers."""

    def encode(self, _first_sequence: int, counts: Int32s, status: UInt8s, times_s: Floats) -> list[bytes]:
        self.store_sample(counts[-1], int(status[-1]))
        return [b""] * len(times_s)
