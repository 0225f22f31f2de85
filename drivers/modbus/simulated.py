"""A simulated stand behind Modbus RTU: the units of a register map, which answer real requests."""

import struct

import numpy as np
from numpy.typing import NDArray

from drivers.modbus.frames import (
    LONGEST,
    MAX_REGISTERS,
    READ_FUNCTIONS,
    WRITE_FUNCTIONS,
    Function,
    encode_exception,
    encode_read_response,
    with_crc,
)
from drivers.modbus.maps import GAUGES, RegisterMap
from drivers.modbus.registers import Channel, ChannelValue, encode_channel
from drivers.samples import SampleStatus
from drivers.simulated.commands import Command, CommandKind

BAUD = 115200
MAX_RATE_HZ = 10_000.0
_BITS_PER_BYTE = 10
_TURNAROUND_S = 0.0004
"""Three and a half bytes of silence at least, and what a microcontroller needs."""
_ILLEGAL_FUNCTION, _ILLEGAL_ADDRESS, _ILLEGAL_VALUE = 1, 2, 3
_READ_BYTES = 8
_OVERLOADS = {"table": SampleStatus.OVERLOAD_TABLE, "relative": SampleStatus.OVERLOAD_RELATIVE}


class ModbusCommandParser:
    """Finds requests in bytes cut anywhere; passes over what is none, a byte at a time."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[Command]:
        """Requests completed by `data`: `code` is the unit, `parameters` are all from the function on."""
        data = self._rest + data
        commands, at = [], 0
        while (size := _request_bytes(data, at)) and at + size <= len(data):
            frame = data[at : at + size]
            if with_crc(frame[:-2]) == frame:
                commands.append(Command(CommandKind.OTHER, code=frame[0], parameters=frame[1:-2]))
                at += size
            else:
                at += 1
        self._rest = data[at:][-LONGEST:]
        return commands


def _request_bytes(data: bytes, at: int) -> int:
    """Length of the request that begins there as far as can be told, 0 while it cannot."""
    if len(data) < at + _READ_BYTES:
        return 0
    return 9 + data[at + 6] if data[at + 1] == Function.WRITE_MULTIPLE else _READ_BYTES


class SimulatedModbus:
    """`modbus`: registers that hold the latest sample, of one unit or two, on a line of 115200 baud.

    Parameters
    ----------
    register_map : RegisterMap
        Its channels are there and no others.
    """

    streams_on_open = True
    max_rate_hz = MAX_RATE_HZ
    line_end = b""
    flags_overload = False
    byte_s = _BITS_PER_BYTE / BAUD
    turnaround_s = _TURNAROUND_S

    def __init__(self, register_map: RegisterMap) -> None:
        self._channels = register_map.channels
        self._held: dict[tuple[int, int], dict[int, int]] = {}
        self._latest = dict.fromkeys(GAUGES, 0)
        self._zero = dict.fromkeys(GAUGES, 0)
        self.store_sample(np.zeros(2, dtype=np.int32), 0)

    def samples_per_frame(self, rate_hz: float) -> int:  # noqa: ARG002 - the same at any rate
        """One sample at a time."""
        return 1

    def command_parser(self) -> ModbusCommandParser:
        """Finds requests."""
        return ModbusCommandParser()

    def request_bytes(self, command: Command) -> int:
        """Length of a request, unit and checksum included."""
        return len(command.parameters) + 3

    def store_sample(self, counts: NDArray[np.int32], status: int) -> None:
        """Put a sample into the registers."""
        self._latest = dict(zip(GAUGES, counts.tolist(), strict=True))
        states: dict[tuple[int, int, int], int] = {}
        for gauge, channel in self._channels.items():
            reading = ChannelValue(self._latest[gauge] - self._zero[gauge], bool(status & _OVERLOADS[gauge]))
            self._put(channel, reading, states)
        for (unit, function, register), word in states.items():
            self._held[unit, function][register] = word

    def encode(
        self,
        first_sequence: int,  # noqa: ARG002 - registers have no number
        counts: NDArray[np.int32],
        status: NDArray[np.uint8],
        times_s: NDArray[np.float64],
    ) -> list[bytes]:
        """Hold the last sample; nothing is sent that was not asked for."""
        self.store_sample(counts[-1], int(status[-1]))
        return [b""] * len(times_s)

    def respond(self, command: Command, is_done: bool, rate_hz: float) -> bytes:  # noqa: ARG002
        """The answer of the unit that is asked, with a Modbus exception for what cannot be; else nothing."""
        unit, function = command.code, command.parameters[0]
        if unit not in {channel.unit for channel in self._channels.values()}:
            return b""
        if function in READ_FUNCTIONS:
            return self._read(unit, function, command.parameters)
        if function in WRITE_FUNCTIONS:
            return self._write(unit, function, command.parameters)
        return encode_exception(unit, function, _ILLEGAL_FUNCTION)

    def _put(self, channel: Channel, reading: ChannelValue, states: dict[tuple[int, int, int], int]) -> None:
        held = self._held.setdefault((channel.unit, channel.function), {})
        value, status = encode_channel(channel, reading)
        held.update(enumerate(struct.unpack(f">{channel.registers}H", value), channel.register))
        if channel.status is not None:
            place = (channel.unit, channel.function, channel.status.register)
            states[place] = states.get(place, 0) | status  # two channels may share it

    def _read(self, unit: int, function: int, asked: bytes) -> bytes:
        first, count = struct.unpack_from(">HH", asked, 1)
        held = self._held.get((unit, function))
        if held is None:
            return encode_exception(unit, function, _ILLEGAL_FUNCTION)
        if not 1 <= count <= MAX_REGISTERS:
            return encode_exception(unit, function, _ILLEGAL_VALUE)
        values = [held.get(register) for register in range(first, first + count)]
        if None in values:
            return encode_exception(unit, function, _ILLEGAL_ADDRESS)
        return encode_read_response(unit, function, struct.pack(f">{count}H", *values))

    def _write(self, unit: int, function: int, asked: bytes) -> bytes:
        (register,) = struct.unpack_from(">H", asked, 1)
        (value,) = struct.unpack_from(">H", asked, 6 if function == Function.WRITE_MULTIPLE else 3)
        known = [
            (gauge, channel.zero_command)
            for gauge, channel in self._channels.items()
            if channel.unit == unit and channel.zero_command and channel.zero_command.register == register
        ]
        if not known:
            return encode_exception(unit, function, _ILLEGAL_ADDRESS)
        zeroed = [gauge for gauge, zeroing in known if zeroing and zeroing.value == value]
        if not zeroed:
            return encode_exception(unit, function, _ILLEGAL_VALUE)
        for gauge in zeroed:
            self._zero[gauge] = self._latest[gauge]
        return with_crc(struct.pack(">B", unit) + asked[:5])
