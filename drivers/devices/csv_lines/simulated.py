"""Simulated devices that send lines of values: by themselves, once they are started, or when asked."""

import numpy as np

from drivers.arrays import Floats, Int32s, UInt8s
from drivers.devices.csv_lines import DRIVER
from drivers.devices.csv_lines.codec import encode_lines
from drivers.devices.csv_lines.columns import LineFormat
from drivers.devices.csv_lines.source import Commands, read_csv_settings, unescape
from drivers.simulated.protocol import Command, CommandKind, PolledProtocol, SimulatedProtocol

_BITS_PER_BYTE = 10
_TURNAROUND_S = 0.001  # of a microcontroller that has the reading already


class SimulatedCsv(SimulatedProtocol):
    """Sends a line a sample, from the moment the port is opened unless it has a command to start.

    An overload shows as clipping only, unless a status column tells it.
    """

    def __init__(self, layout: LineFormat | None = None, commands: Commands | None = None) -> None:
        self._layout = layout or LineFormat()
        commands = commands or Commands()
        self._kinds = {
            last_line(commands.stop): CommandKind.STOP,
            last_line(commands.start): CommandKind.START,
        }
        self.streams_on_open = not commands.start
        self.line_end = self._layout.line_end.encode("ascii")
        self.flags_overload = bool(self._layout.overload_status)

    def find_commands(self, data: bytes) -> tuple[list[Command], int]:
        return find_texts(data, self._kinds)

    def encode(self, first_sequence: int, counts: Int32s, status: UInt8s, times_s: Floats) -> list[bytes]:
        return encode_lines(self._layout, times_s, counts, first_sequence, status)


class PolledCsv(PolledProtocol):
    """Sends the latest sample as a line each time it is asked, over a line of `baud`."""

    turnaround_s = _TURNAROUND_S

    def __init__(
        self, layout: LineFormat, commands: Commands, baud: int, query: bytes = b"", identity: bytes = b""
    ) -> None:
        self._layout = layout
        self._poll, self._query, self._identity = commands.poll, query, identity
        self.byte_s = _BITS_PER_BYTE / baud
        self.line_end = layout.line_end.encode("ascii")
        self._counts, self._status = np.zeros((1, 2), dtype=np.int32), np.zeros(1, dtype=np.uint8)

    def find_commands(self, data: bytes) -> tuple[list[Command], int]:
        return find_texts(data, {self._poll: CommandKind.OTHER, self._query: CommandKind.IDENTIFY})

    def request_bytes(self, command: Command) -> int:
        return len(self._query if command.kind is CommandKind.IDENTIFY else self._poll)

    def store_sample(self, counts: Int32s, status: int) -> None:
        self._counts, self._status = counts[None], np.array([status], dtype=np.uint8)

    def respond(self, command: Command, is_done: bool, rate_hz: float) -> bytes:  # noqa: ARG002
        if command.kind is CommandKind.IDENTIFY:
            return self._identity
        return encode_lines(self._layout, np.zeros(1), self._counts, status=self._status)[0]


def last_line(text: bytes) -> bytes:
    """The last of several commands, each ended by CR or LF: those before it set the device up."""
    return (text.splitlines(keepends=True) or [b""])[-1]


def find_texts(data: bytes, kinds: dict[bytes, CommandKind]) -> tuple[list[Command], int]:
    """Commands in `data` that are texts of `kinds`, the longest first; see `SimulatedProtocol`."""
    texts = sorted(filter(None, kinds), key=len, reverse=True)
    found, at = [], 0
    while at < len(data):
        rest = data[at:]
        text = next((text for text in texts if rest.startswith(text)), b"")
        if not text and any(text.startswith(rest) for text in texts):
            break  # it may become one
        if text:
            found.append(Command(kinds[text]))
        at += len(text) or 1
    return found, at


def make_protocol(settings: dict[str, str]) -> SimulatedProtocol:
    """The simulated device with its own settings. Raises SettingsError."""
    parsed, preset = read_csv_settings(settings)
    commands = parsed.commands()
    if commands.poll:
        baud = (preset.baud if preset else 0) or DRIVER.default_baud
        identity = preset.identity if preset else None
        texts = (identity.query, identity.answer) if identity else ()
        return PolledCsv(parsed.layout(), commands, baud, *(unescape("identity", text) for text in texts))
    return SimulatedCsv(parsed.layout(), commands)
