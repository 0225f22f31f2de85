"""A simulated Modbus transmitter, RTU or TCP: the units of a register map, which answer requests."""

import struct
from dataclasses import replace

import numpy as np

from drivers.arrays import Int32s
from drivers.devices.modbus import DRIVER, frames
from drivers.devices.modbus.frames import Function
from drivers.devices.modbus.maps import RegisterMap
from drivers.devices.modbus.registers import ChannelValue, Framing, encode_channel, plan_poll
from drivers.devices.modbus.source import read_modbus_settings
from drivers.devices.modbus.tcp_frames import find_bodies, with_header
from drivers.driver import GAUGES
from drivers.samples import SampleStatus
from drivers.simulated.protocol import Command, CommandKind, PolledProtocol

MAX_RATE_HZ = 10_000.0
_BITS_PER_BYTE = 10
_TURNAROUND_S = 0.0004
"""At least 3.5 bytes of silence (MODBUS over Serial Line V1.02, 2.5.1.1), 0.3 ms at 115200 baud, and the time
of a microcontroller."""
_TCP_BYTE_S = 8e-8  # of Ethernet at 100 Mbit/s
_TCP_TURNAROUND_S = 0.001
"""Assumed for the network stack of a microcontroller; the manuals state no time."""
_ILLEGAL_FUNCTION, _ILLEGAL_ADDRESS, _ILLEGAL_VALUE = 1, 2, 3
_UNIT_SILENT = 11  # a gateway's, whose unit did not answer
_READ_BYTES = 8
_CHECK_BYTES = 2
_OVERLOADS = {"table": SampleStatus.OVERLOAD_TABLE, "relative": SampleStatus.OVERLOAD_RELATIVE}


def find_commands(data: bytes) -> tuple[list[Command], int]:
    """Requests in `data`: `code` is the unit, `parameters` are all from the function on."""
    commands, at = [], 0
    while at + _READ_BYTES <= len(data):
        size = 9 + data[at + 6] if data[at + 1] == Function.WRITE_MULTIPLE else _READ_BYTES
        if at + size > len(data):
            break
        frame = data[at : at + size]
        if frames.with_crc(frame[:-2]) == frame:
            commands.append(Command(CommandKind.OTHER, code=frame[0], parameters=frame[1:-2]))
            at += size
        else:
            at += 1
    return commands, at


class SimulatedModbus(PolledProtocol):
    """Registers with the latest sample, of one unit or two, on a line of 115200 baud."""

    max_rate_hz = MAX_RATE_HZ
    find_commands = staticmethod(find_commands)
    byte_s = _BITS_PER_BYTE / DRIVER.default_baud
    turnaround_s = _TURNAROUND_S

    def __init__(self, register_map: RegisterMap) -> None:
        self._channels = register_map.channels
        self._registers: dict[tuple[int, int], dict[int, int]] = {}
        for request in plan_poll(tuple(self._channels.values())).requests:
            held = self._registers.setdefault((request.unit, request.function), {})
            held.update(dict.fromkeys(range(request.register, request.register + request.count), 0))
        self._latest = dict.fromkeys(GAUGES, 0)
        self._zero = dict.fromkeys(GAUGES, 0)
        self.store_sample(np.zeros(2, dtype=np.int32), 0)

    def request_bytes(self, command: Command) -> int:
        return len(command.parameters) + 3

    def store_sample(self, counts: Int32s, status: int) -> None:
        self._latest = dict(zip(GAUGES, counts.tolist(), strict=True))
        states: dict[tuple[int, int, int], int] = {}
        for gauge, channel in self._channels.items():
            reading = ChannelValue(self._latest[gauge] - self._zero[gauge], bool(status & _OVERLOADS[gauge]))
            value, word = encode_channel(channel, reading)
            held = self._registers.setdefault((channel.unit, channel.function), {})
            held.update(enumerate(struct.unpack(f">{channel.registers}H", value), channel.register))
            if channel.status_register is not None:
                place = (channel.unit, channel.function, channel.status_register)
                states[place] = states.get(place, 0) | word  # two channels may share it
        for (unit, function, register), word in states.items():
            self._registers[unit, function][register] = word

    def respond(self, command: Command, is_done: bool, rate_hz: float) -> bytes:  # noqa: ARG002
        """Response or exception of the requested unit; nothing where there is no such unit."""
        unit, function = command.code, command.parameters[0]
        if unit not in {channel.unit for channel in self._channels.values()}:
            return b""
        if function in frames.WRITE_FUNCTIONS:
            return self._write(unit, function, command.parameters)
        return self._read(unit, function, command.parameters)

    def _read(self, unit: int, function: int, asked: bytes) -> bytes:
        first, count = struct.unpack_from(">HH", asked, 1)
        held = self._registers.get((unit, function))
        if held is None:
            return frames.encode_exception(unit, function, _ILLEGAL_FUNCTION)
        if not 1 <= count <= frames.MAX_REGISTERS:
            return frames.encode_exception(unit, function, _ILLEGAL_VALUE)
        values = [held.get(register) for register in range(first, first + count)]
        if None in values:
            return frames.encode_exception(unit, function, _ILLEGAL_ADDRESS)
        return frames.encode_read_response(unit, function, struct.pack(f">{count}H", *values))

    def _write(self, unit: int, function: int, asked: bytes) -> bytes:
        (register,) = struct.unpack_from(">H", asked, 1)
        (value,) = struct.unpack_from(">H", asked, 6 if function == Function.WRITE_MULTIPLE else 3)
        known = {
            gauge: channel.zero_value
            for gauge, channel in self._channels.items()
            if channel.unit == unit and channel.zero_register == register
        }
        if not known:
            return frames.encode_exception(unit, function, _ILLEGAL_ADDRESS)
        zeroed = [gauge for gauge, zero_value in known.items() if zero_value == value]
        if not zeroed:
            return frames.encode_exception(unit, function, _ILLEGAL_VALUE)
        for gauge in zeroed:
            self._zero[gauge] = self._latest[gauge]
        return frames.with_crc(struct.pack(">B", unit) + asked[:5])


def find_tcp_commands(data: bytes) -> tuple[list[Command], int]:
    """Requests in `data`: `code` is transaction * 256 + unit, `parameters` are all from the function on."""
    bodies, used = find_bodies(data)
    return [
        Command(CommandKind.OTHER, code=transaction << 8 | body[0], parameters=body[1:])
        for transaction, body in bodies
    ], used


class SimulatedModbusTcp(SimulatedModbus):
    """The same behind Modbus TCP, where a unit that is not there is refused, as by a gateway."""

    find_commands = staticmethod(find_tcp_commands)
    byte_s = _TCP_BYTE_S
    turnaround_s = _TCP_TURNAROUND_S

    def respond(self, command: Command, is_done: bool, rate_hz: float) -> bytes:
        transaction, unit = divmod(command.code, 1 << 8)
        response = super().respond(replace(command, code=unit), is_done, rate_hz)
        response = response or frames.encode_exception(unit, command.parameters[0], _UNIT_SILENT)
        return with_header(transaction, response[:-_CHECK_BYTES])


def make_protocol(settings: dict[str, str]) -> SimulatedModbus:
    """The simulated device with its own settings. Raises SettingsError."""
    register_map = read_modbus_settings(settings)[1]
    return (SimulatedModbusTcp if register_map.framing is Framing.TCP else SimulatedModbus)(register_map)
