"""A simulated GSV-4, GSV-3 or GSV-2: sends from the moment its port is opened, and obeys its commands."""

import numpy as np

from drivers.arrays import Floats, Int32s, UInt8s
from drivers.devices.gsv_234 import DRIVER, codec, commands
from drivers.devices.gsv_234.codec import FORMATS, GSV_2, GSV_3, GSV_4
from drivers.devices.gsv_234.commands import Code
from drivers.devices.gsv_234.source import Gsv234Settings
from drivers.simulated.protocol import Command, CommandKind, SimulatedProtocol
from drivers.stream import parse_settings

SERIAL_NUMBER = b"08449050"
FIRMWARE = {GSV_4: b"\x19", GSV_3: b"\x01\x30", GSV_2: b"\x01\x36"}
MAX_RATE_HZ = {GSV_4: 937.5, GSV_3: 1000.0, GSV_2: 500.0}
"""That of a GSV-2 fits its line: 768 frames of 5 bytes a second at 38400 baud."""
_PARAMETER_BYTES = {Code.LOCK: 7, Code.WRITE_RATE: 3}
_KINDS: dict[int, CommandKind] = {Code.START: CommandKind.START, Code.STOP: CommandKind.STOP}


class SimulatedGsv234(SimulatedProtocol):
    """Sends a frame a sample; a GSV-4 takes a rate only while it is unlocked."""

    streams_on_open = True

    def __init__(self, settings: Gsv234Settings) -> None:
        self._model = settings.format
        self._layout = FORMATS[self._model]
        self._channels = (settings.table, settings.relative)
        self._last = self._zero = np.zeros(2, dtype=np.int32)
        self._is_unlocked = False
        self.max_rate_hz = MAX_RATE_HZ[self._model]
        self.max_count = self._layout.max_count

    def find_commands(self, data: bytes) -> tuple[list[Command], int]:
        found, at = [], 0
        while at < len(data):
            length = _PARAMETER_BYTES.get(Code(data[at]), 0) if data[at] in tuple(Code) else 0
            length += data[at] == Code.SET_ZERO and self._model == GSV_4
            if at + 1 + length > len(data):
                break
            found.append(self._command(data[at], data[at + 1 : at + 1 + length]))
            at += 1 + length
        return found, at

    def encode(self, _first_sequence: int, counts: Int32s, _status: UInt8s, _times_s: Floats) -> list[bytes]:
        self._last = counts[-1].copy()
        frames = codec.encode_frames(self._layout, counts - self._zero, self._channels)
        return [frame.tobytes() for frame in frames]

    def respond(self, command: Command, is_done: bool, rate_hz: float) -> bytes:  # noqa: ARG002
        model = self._model
        answers = {
            Code.FIRMWARE: FIRMWARE[model],
            Code.SERIAL_NUMBER: SERIAL_NUMBER,
            commands.read_rate(model): commands.encode_rate(model, rate_hz),
        }
        if command.code in answers:
            return commands.encode_answer(model, Code(command.code), answers[Code(command.code)])
        match command.code:
            case Code.GET_VALUE:
                return codec.encode_frames(
                    self._layout, (self._last - self._zero)[None], self._channels
                ).tobytes()
            case Code.SET_ZERO:
                self._set_zero(command.parameters)
        return b""

    def _set_zero(self, parameters: bytes) -> None:
        if self._model != GSV_4:
            self._zero = self._last
        elif self._is_unlocked:
            chosen = np.array([channel == parameters[0] for channel in self._channels])
            self._zero = np.where(chosen, self._last, self._zero)

    def _command(self, code: int, parameters: bytes) -> Command:
        rate_hz, whole = 0.0, bytes([code]) + parameters
        if whole in (commands.UNLOCK, commands.LOCK):  # before what follows it in the same read
            self._is_unlocked = whole == commands.UNLOCK
        if self._model == GSV_4 and self._is_unlocked:
            rate_hz = commands.GSV_4_RATES_HZ.get(code, 0.0)
        elif self._model == GSV_3 and code == Code.WRITE_RATE:
            rate_hz = commands.GSV_3_RATES_HZ.get(parameters, 0.0)
        kind = CommandKind.RATE if rate_hz else _KINDS.get(code, CommandKind.OTHER)
        return Command(kind, rate_hz, code, parameters)


def make_protocol(settings: dict[str, str]) -> SimulatedGsv234:
    """The simulated device with its own settings. Raises SettingsError."""
    return SimulatedGsv234(parse_settings(Gsv234Settings, settings, DRIVER.name))
