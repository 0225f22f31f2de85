"""A simulated Harp LoadCells: registers that can be read and written, and an event a sample."""

from drivers.arrays import Floats, Int32s, UInt8s
from drivers.devices.harp import DRIVER, codec
from drivers.devices.harp.codec import HarpMessage, Register
from drivers.devices.harp.source import HarpSettings
from drivers.simulated.protocol import Command, CommandKind, SimulatedProtocol
from drivers.stream import parse_settings

FIRMWARE = (1, 1)
SERIAL_NUMBER = 7
MAX_RATE_HZ = 10_000.0
_WRITABLE = (Register.OPERATION, Register.EVENTS, Register.ACQUISITION)
_STANDBY = 0xE0
_IDLE_COUNT = 1
"""Of channels without a gauge: 0 on a whole board is what a device sends whose board is not plugged in."""
_ALL_EVENTS = 0x0F


def find_commands(data: bytes) -> tuple[list[Command], int]:
    """Requests in `data`, their type and payload as `parameters`; see `SimulatedProtocol`."""
    messages, used = codec.find_messages(data)
    return [_command(message) for message in messages if message.kind in (codec.READ, codec.WRITE)], used


def _command(message: HarpMessage) -> Command:
    kind = CommandKind.OTHER
    if message.kind == codec.WRITE and message.address == Register.ACQUISITION:
        kind = CommandKind.START if message.number else CommandKind.STOP
    return Command(kind, code=message.address, parameters=bytes([message.kind]) + message.payload)


class SimulatedHarp(SimulatedProtocol):
    """Sends an event a sample. Readings are limited to 16 bits and show as overload there."""

    max_rate_hz = MAX_RATE_HZ
    max_count = codec.FULL_SCALE
    find_commands = staticmethod(find_commands)

    def __init__(self, settings: HarpSettings) -> None:
        self._channels = (settings.table, settings.relative)
        self._ticks = 0
        self._registers = {
            Register.WHO_AM_I: codec.WHO_AM_I,
            Register.FIRMWARE_HIGH: FIRMWARE[0],
            Register.FIRMWARE_LOW: FIRMWARE[1],
            Register.OPERATION: _STANDBY,
            Register.SERIAL_NUMBER: SERIAL_NUMBER,
            Register.ACQUISITION: 0,
            Register.EVENTS: _ALL_EVENTS,
        }

    def encode(self, _first_sequence: int, counts: Int32s, _status: UInt8s, times_s: Floats) -> list[bytes]:
        self._ticks = round(float(times_s[-1]) * codec.TICKS_PER_S)
        if codec.with_active_mode(self._registers[Register.OPERATION]) != self._registers[Register.OPERATION]:
            return [b""] * len(counts)
        events = codec.encode_events(times_s, counts, *self._channels, _IDLE_COUNT)
        return [row.tobytes() for row in events]

    def respond(self, command: Command, is_done: bool, rate_hz: float) -> bytes:  # noqa: ARG002
        kind, given = command.parameters[0], command.parameters[1:]
        if command.code not in self._registers:
            return codec.encode(HarpMessage(kind | codec.ERROR, command.code), codec.U8, self._ticks)
        register = Register(command.code)
        if kind == codec.WRITE and (register not in _WRITABLE or len(given) != codec.PAYLOAD_TYPES[register]):
            kind |= codec.ERROR
        elif kind == codec.WRITE:
            self._registers[register] = int.from_bytes(given, "little")
        payload = self._registers[register].to_bytes(codec.PAYLOAD_TYPES[register], "little")
        return codec.encode(HarpMessage(kind, register, payload), codec.PAYLOAD_TYPES[register], self._ticks)


def make_protocol(settings: dict[str, str]) -> SimulatedHarp:
    """The simulated device with its own settings. Raises SettingsError."""
    return SimulatedHarp(parse_settings(HarpSettings, settings, DRIVER.name))
