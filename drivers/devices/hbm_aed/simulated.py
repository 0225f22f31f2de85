"""A simulated AED or FIT, which answers the commands of its manual and sends once it is asked to."""

import numpy as np

from drivers.arrays import Floats, Int32s, UInt8s
from drivers.devices.hbm_aed import DRIVER, codec, commands
from drivers.devices.hbm_aed.codec import FORMATS
from drivers.devices.hbm_aed.commands import DONE, LINE_END, REFUSED, Identity
from drivers.devices.hbm_aed.source import HbmAedSettings
from drivers.samples import SampleStatus
from drivers.simulated.protocol import Command, CommandKind, SimulatedProtocol
from drivers.stream import parse_settings

IDENTITY = Identity("AED104", "1234", "P20")
_ADC_OVERFLOW = 0x04
_MOST_FILTER = 8
_ENDS = b";\n"


class SimulatedHbmAed(SimulatedProtocol):
    """Sends a value a sample, in the format that it was set to; its filter is not simulated."""

    max_rate_hz = max(commands.FULL_RATES_HZ)
    max_count = codec.MAX_COUNT
    flags_overload = True

    def __init__(self, settings: HbmAedSettings) -> None:
        self._format = settings.format
        self._full_hz = self.max_rate_hz

    def find_commands(self, data: bytes) -> tuple[list[Command], int]:
        texts = data.replace(_ENDS[1:], _ENDS[:1]).split(_ENDS[:1])
        return [self._command(text.strip().upper()) for text in texts[:-1]], len(data) - len(texts[-1])

    def encode(self, _first_sequence: int, counts: Int32s, status: UInt8s, _times_s: Floats) -> list[bytes]:
        overloads = np.where(status & int(SampleStatus.OVERLOAD_TABLE), _ADC_OVERFLOW, 0).astype(np.uint8)
        return codec.encode_frames(self._format, counts, overloads)

    def respond(self, command: Command, is_done: bool, rate_hz: float) -> bytes:
        known = [
            full_hz
            for full_hz in commands.FULL_RATES_HZ
            if commands.find_divider(full_hz, rate_hz) is not None
        ]
        self._full_hz = max(known, default=self._full_hz)
        text = command.parameters
        if command.kind in (CommandKind.START, CommandKind.STOP) or not text or text[:1] == b"S":
            return b""
        if text + b";" == commands.IDENTIFY:
            return commands.encode_identity(IDENTITY)
        if text + b";" == commands.READ_DIVIDER:
            return b"%02d" % (commands.find_divider(self._full_hz, rate_hz) or 0) + LINE_END
        if command.kind is not CommandKind.RATE:
            is_done = self._set(text)
        return (DONE if is_done else REFUSED) + LINE_END

    def _command(self, text: bytes) -> Command:
        rate_hz, kind = 0.0, CommandKind.OTHER
        if text.startswith(b"ICR") and text[3:].isdigit():
            kind = CommandKind.RATE
            rate_hz = self._full_hz / 2 ** int(text[3:]) if int(text[3:]) <= commands.MAX_DIVIDER else 0.0
        elif text + b";" == commands.START:
            kind = CommandKind.START
        elif text == b"STP":
            kind = CommandKind.STOP
        return Command(kind, rate_hz, parameters=text)

    def _set(self, text: bytes) -> bool:
        for kind, output in FORMATS.items():
            if text + b";" == commands.set_format(output.code):
                self._format = kind
                return True
        return text[:3] == b"ASF" and text[3:].isdigit() and int(text[3:]) <= _MOST_FILTER


def make_protocol(settings: dict[str, str]) -> SimulatedHbmAed:
    """The simulated device with its own settings. Raises SettingsError."""
    return SimulatedHbmAed(parse_settings(HbmAedSettings, settings, DRIVER.name))
