"""A simulated device with the reference firmware."""

import re

import numpy as np

from drivers.arrays import Floats, Int32s, UInt8s
from drivers.devices.slipstand_binary import DRIVER, codec
from drivers.devices.slipstand_binary.codec import FirmwareIdentity, FrameFlags
from drivers.devices.slipstand_binary.source import BinarySettings
from drivers.samples import SampleStatus
from drivers.simulated.identity import FIRMWARE
from drivers.simulated.protocol import Command, CommandKind, SimulatedProtocol
from drivers.stream import parse_settings

_COMMAND = re.compile(rb"[SPI]|R(\d{1,9})\r?\n")
_KINDS = {b"S": CommandKind.START, b"P": CommandKind.STOP, b"I": CommandKind.IDENTIFY}


class SimulatedBinary(SimulatedProtocol):
    """Sends frames with index, device time and CRC once it is started; obeys commands."""

    flags_overload = True

    def find_commands(self, data: bytes) -> tuple[list[Command], int]:
        matches = list(_COMMAND.finditer(data))
        unfinished = data.rfind(b"R", matches[-1].end() if matches else 0)
        commands = [Command(_KINDS.get(m[0], CommandKind.RATE), float(m[1] or 0)) for m in matches]
        return commands, unfinished if unfinished >= 0 else len(data)

    def respond(self, command: Command, is_done: bool, rate_hz: float) -> bytes:  # noqa: ARG002
        if command.kind is CommandKind.IDENTIFY:
            return codec.encode_identity(FirmwareIdentity(FIRMWARE, rate_hz, 2))
        return b""

    def samples_per_frame(self, rate_hz: float) -> int:
        return codec.samples_per_frame(rate_hz)

    def encode(self, first_sequence: int, counts: Int32s, status: UInt8s, times_s: Floats) -> list[bytes]:
        seen = np.bitwise_or.reduce(status.reshape(len(times_s), -1), axis=1)
        table = np.where(seen & SampleStatus.OVERLOAD_TABLE, np.uint8(FrameFlags.OVERLOAD_TABLE), np.uint8(0))
        relative = seen & SampleStatus.OVERLOAD_RELATIVE
        flags = np.where(relative, table | np.uint8(FrameFlags.OVERLOAD_RELATIVE), table)
        times_us = np.rint(times_s * 1e6).astype(np.int64)
        return [row.tobytes() for row in codec.encode_frames(first_sequence, times_us, counts, flags)]


def make_protocol(settings: dict[str, str]) -> SimulatedBinary:
    """The simulated device with its own settings. Raises SettingsError."""
    parse_settings(BinarySettings, settings, DRIVER.name)
    return SimulatedBinary()
