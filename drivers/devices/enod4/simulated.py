"""A simulated eNod4: sends one gauge in fast SCMBus from a start command on."""

import numpy as np

from drivers.arrays import Floats, Int32s, UInt8s
from drivers.devices.enod4 import DRIVER, codec
from drivers.devices.enod4.codec import Code
from drivers.devices.enod4.source import Enod4Settings
from drivers.samples import SampleStatus
from drivers.simulated.protocol import Command, CommandKind, SimulatedProtocol
from drivers.stream import parse_settings

MAX_RATE_HZ = 1300.0
"""Frames of 8 bytes, of 11 bits each with two stop bits, a second at 115200 baud."""
_COMMAND_BYTES = 4


class SimulatedEnod4(SimulatedProtocol):
    """Answers commands to its address; others are skipped."""

    max_rate_hz = MAX_RATE_HZ
    flags_overload = True

    def __init__(self, settings: Enod4Settings) -> None:
        self._settings = settings

    def find_commands(self, data: bytes) -> tuple[list[Command], int]:
        found, at = [], 0
        while at + _COMMAND_BYTES <= len(data):
            if data[at] == self._settings.address and data[at + 2] == ord("\r"):
                found.append(Command(_kind(data[at + 1]), code=data[at + 1]))
                at += _COMMAND_BYTES
            else:
                at += 1
        return found, at

    def respond(self, command: Command, is_done: bool, rate_hz: float) -> bytes:  # noqa: ARG002
        code = codec.UNKNOWN_COMMAND if command.kind is CommandKind.OTHER else command.code
        return codec.encode_command(self._settings.address, code)

    def encode(self, _first_sequence: int, counts: Int32s, status: UInt8s, _times_s: Floats) -> list[bytes]:
        overloads = status & np.uint8(SampleStatus.OVERLOAD_TABLE)
        return codec.encode_frames(counts[:, 0], codec.status_words(overloads), self._settings.checksum)


def _kind(code: int) -> CommandKind:
    if code == Code.STOP:
        return CommandKind.STOP
    return CommandKind.START if code in tuple(Code) else CommandKind.OTHER


def make_protocol(settings: dict[str, str]) -> SimulatedEnod4:
    """The simulated device with its own settings. Raises SettingsError."""
    return SimulatedEnod4(parse_settings(Enod4Settings, settings, DRIVER.name))
