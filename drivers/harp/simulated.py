"""A simulated Harp LoadCells: registers that can be read and written, and an event a sample."""

import numpy as np
from numpy.typing import NDArray

from drivers.harp.codec import encode_events
from drivers.harp.messages import (
    ERROR,
    MAX_MESSAGE_BYTES,
    PAYLOAD_TYPES,
    READ,
    TICKS_PER_S,
    U8,
    WHO_AM_I,
    WRITE,
    Message,
    Register,
    encode,
    find_messages,
    with_active_mode,
)
from drivers.harp.source import Settings
from drivers.simulated.commands import Command, CommandKind

FIRMWARE = (1, 1)
SERIAL_NUMBER = 7
MAX_RATE_HZ = 10_000.0
_WRITABLE = (Register.OPERATION, Register.EVENTS, Register.ACQUISITION)
_STANDBY = 0xE0
_ALL_EVENTS = 0x0F


class HarpCommandParser:
    """Finds requests in bytes cut anywhere; passes over what is none."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[Command]:
        """Requests completed by `data`; `parameters` are their type and payload."""
        data = self._rest + data
        messages, used = find_messages(data)
        self._rest = data[used:][-MAX_MESSAGE_BYTES:]
        return [_command(message) for message in messages if message.kind in (READ, WRITE)]


def _command(message: Message) -> Command:
    order = CommandKind.OTHER
    if message.kind == WRITE and message.address == Register.ACQUISITION:
        order = CommandKind.START if message.number else CommandKind.STOP
    return Command(order, code=message.address, parameters=bytes([message.kind]) + message.payload)


class SimulatedHarp:
    """`harp`: an event a sample. Its converter has 16 bits: what is beyond is cut and shows as overload."""

    streams_on_open = False
    max_rate_hz = MAX_RATE_HZ
    line_end = b""
    flags_overload = False

    def __init__(self, settings: Settings) -> None:
        self._channels = (settings.table, settings.relative)
        self._ticks = 0
        self._held = {
            Register.WHO_AM_I: WHO_AM_I,
            Register.FIRMWARE_HIGH: FIRMWARE[0],
            Register.FIRMWARE_LOW: FIRMWARE[1],
            Register.OPERATION: _STANDBY,
            Register.SERIAL_NUMBER: SERIAL_NUMBER,
            Register.ACQUISITION: 0,
            Register.EVENTS: _ALL_EVENTS,
        }

    def samples_per_frame(self, rate_hz: float) -> int:  # noqa: ARG002 - the same at any rate
        """One sample an event."""
        return 1

    def command_parser(self) -> HarpCommandParser:
        """Finds requests."""
        return HarpCommandParser()

    def encode(
        self,
        first_sequence: int,  # noqa: ARG002 - events have no number
        counts: NDArray[np.int32],
        status: NDArray[np.uint8],  # noqa: ARG002 - and no flags
        times_s: NDArray[np.float64],
    ) -> list[bytes]:
        """An event for each sample; none while the device stands by."""
        self._ticks = round(float(times_s[-1]) * TICKS_PER_S)
        if with_active_mode(self._held[Register.OPERATION]) != self._held[Register.OPERATION]:
            return [b""] * len(counts)
        return [row.tobytes() for row in encode_events(times_s, counts, *self._channels)]

    def respond(self, command: Command, is_done: bool, rate_hz: float) -> bytes:  # noqa: ARG002
        """The reply to a request, with what the register holds then."""
        kind, given = command.parameters[0], command.parameters[1:]
        if command.code not in self._held:
            return encode(Message(kind | ERROR, command.code), U8, self._ticks)
        register = Register(command.code)
        if kind == WRITE and (register not in _WRITABLE or len(given) != PAYLOAD_TYPES[register]):
            kind |= ERROR
        elif kind == WRITE:
            self._held[register] = int.from_bytes(given, "little")
        payload = self._held[register].to_bytes(PAYLOAD_TYPES[register], "little")
        return encode(Message(kind, register, payload), PAYLOAD_TYPES[register], self._ticks)
