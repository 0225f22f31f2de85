"""A simulated GSV-8: sends from the moment its port is opened, and answers every request."""

import struct

import numpy as np

from drivers.arrays import Floats, Int32s, UInt8s
from drivers.devices.gsv import DRIVER, codec, commands
from drivers.devices.gsv.codec import FrameLayout, ValueKind
from drivers.devices.gsv.commands import Code, InputType
from drivers.devices.gsv.source import GsvSettings
from drivers.samples import SampleStatus
from drivers.simulated.protocol import Command, CommandKind, SimulatedProtocol
from drivers.stream import parse_settings

SERIAL_NUMBER = 15_060_001
FIRMWARE = (1, 45)
MAX_RATE_HZ = 48_000.0
_MIN_REQUEST_BYTES = 4
_FLOAT = commands.set_float()[3:-1]
_VALUES = {
    Code.SERIAL_NUMBER: struct.pack(">I", SERIAL_NUMBER),
    Code.FIRMWARE: struct.pack(">HH", *FIRMWARE),
}
_KINDS: dict[int, CommandKind] = {
    Code.START: CommandKind.START,
    Code.STOP: CommandKind.STOP,
    Code.WRITE_RATE: CommandKind.RATE,
}


def find_commands(data: bytes) -> tuple[list[Command], int]:
    """Requests in `data`; see `SimulatedProtocol`."""
    found = []
    at = data.find(commands.SYNC)
    while 0 <= at <= len(data) - _MIN_REQUEST_BYTES:
        end = at + _MIN_REQUEST_BYTES + (data[at + 1] & commands.LENGTH)
        if data[at + 1] & ~commands.LENGTH != commands.REQUEST:
            at = data.find(commands.SYNC, at + 1)
        elif end > len(data):
            break
        elif data[end - 1] != commands.END:
            at = data.find(commands.SYNC, at + 1)
        else:
            found.append(_command(data[at + 2], data[at + 3 : end - 1]))
            at = data.find(commands.SYNC, end)
    return found, at if at >= 0 else len(data)


def _command(code: int, parameters: bytes) -> Command:
    is_rate = code == Code.WRITE_RATE and len(parameters) == struct.calcsize(">f")
    rate_hz = float(struct.unpack(">f", parameters)[0]) if is_rate else 0.0
    return Command(_KINDS.get(code, CommandKind.OTHER), rate_hz, code, parameters)


class SimulatedGsv(SimulatedProtocol):
    """Sends a frame a sample, with `format=device` as 24-bit integers; obeys `SET_ZERO`."""

    streams_on_open = True
    max_rate_hz = MAX_RATE_HZ
    flags_overload = True
    find_commands = staticmethod(find_commands)

    def __init__(self, settings: GsvSettings) -> None:
        self._channels = (settings.table, settings.relative)
        self._kind = ValueKind.FLOAT32 if settings.format == "float32" else ValueKind.INT24
        self._last = np.zeros(2)
        self._zero = np.zeros(2)

    def encode(self, _first_sequence: int, counts: Int32s, status: UInt8s, _times_s: Floats) -> list[bytes]:
        self._last = counts[-1].astype(np.float64)
        overloads = SampleStatus.OVERLOAD_TABLE | SampleStatus.OVERLOAD_RELATIVE
        flags = np.where(status & overloads, np.uint8(1), np.uint8(0))
        return [row.tobytes() for row in codec.encode_frames(self._layout, counts - self._zero, flags)]

    def respond(self, command: Command, is_done: bool, rate_hz: float) -> bytes:
        values = {Code.READ_RATE: struct.pack(">f", rate_hz)} | _VALUES
        if command.code in values:
            return commands.encode_response(commands.OK, values[Code(command.code)])
        if command.code == Code.GET_VALUE:
            return codec.encode_frames(self._layout, (self._last - self._zero)[None]).tobytes()
        if command.code in (Code.SET_FORMAT, Code.SET_ZERO, Code.SET_INPUT):
            is_done = self._set(command)
        elif command.code not in _KINDS:
            return commands.encode_response(commands.UNKNOWN_COMMAND)
        return commands.encode_response(commands.OK if is_done else commands.WRONG_VALUE)

    @property
    def _layout(self) -> FrameLayout:
        return FrameLayout(max(self._channels), self._kind, *self._channels)

    def _set(self, command: Command) -> bool:
        given = command.parameters
        match command.code:
            case Code.SET_FORMAT if given == _FLOAT:
                self._kind = ValueKind.FLOAT32
            case Code.SET_ZERO if len(given) == 1 and given[0] <= max(self._channels):
                chosen = np.array([given[0] in (0, channel) for channel in self._channels])
                self._zero = np.where(chosen, self._last, self._zero)
            case Code.SET_INPUT:
                return len(given) == 2 and given[1] in tuple(InputType)
            case _:
                return False
        return True


def make_protocol(settings: dict[str, str]) -> SimulatedGsv:
    """The simulated device with its own settings. Raises SettingsError."""
    return SimulatedGsv(parse_settings(GsvSettings, settings, DRIVER.name))
