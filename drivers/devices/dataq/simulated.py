"""A simulated DATAQ instrument: answers each command by its echo, and sends scans once it is started."""

import numpy as np

from drivers.arrays import Floats, Int32s, Ints, UInt8s
from drivers.devices.dataq import DRIVER, codec, commands
from drivers.devices.dataq.commands import MODELS, Divisors
from drivers.devices.dataq.source import DataqSettings
from drivers.simulated.protocol import Command, CommandKind, SimulatedProtocol
from drivers.stream import parse_settings

MODEL = "2108"  # unless another is set
FIRMWARE = "87"  # hexadecimal hundredths: 1.35
SERIAL_NUMBER = "5A3C10E2"
_VALUES = {"srate": 30_000, "dec": 1, "deca": 1, "encode": 0, "eol": 0}
"""At power-on; the rate is the driver's usual one."""
_DIVISORS = ("srate", "dec", "deca")
_ECHOED = ("filter", "led", "endo", "dout", "reset")
_FUNCTION_BITS = 0x0F  # of a scan list word: an analog channel, or another input
_COUNTER_AT_REST = -(1 << 15)  # what rate and counter inputs read without a signal (page 60)
_LINE_ENDS = ("\r", "\n", "\r\n")  # by `eol` (page 39)


class SimulatedDataq(SimulatedProtocol):
    """Sends a scan a sample: the words of its scan list; an analog channel without a gauge reads 0.

    While it scans, all commands but `stop` are ignored. After `encode 1` it sends lines of volts.
    """

    max_count = -codec.LOWEST - 1
    buffer_bytes = commands.BUFFER_BYTES

    def __init__(self, settings: DataqSettings) -> None:
        self._model = MODELS[MODEL if settings.model == "auto" else settings.model]
        self._gauges = (settings.table, settings.relative)
        self._volts_per_count = settings.range_v / -codec.LOWEST
        self.max_rate_hz = commands.DIVIDEND_HZ / self._model.lowest_srate
        self._values = dict(_VALUES)
        self.packet_bytes = commands.PACKET_BYTES
        self._scan_list = [0]
        self._is_scanning = False

    def overflow(self) -> bytes:
        self._is_scanning = False
        return commands.OVERFLOW

    def find_commands(self, data: bytes) -> tuple[list[Command], int]:
        *lines, rest = data.split(commands.END)
        return [self._command(line.decode("ascii", "replace").strip()) for line in lines], len(data) - len(
            rest
        )

    def respond(self, command: Command, is_done: bool, rate_hz: float) -> bytes:  # noqa: ARG002
        return command.parameters if is_done else b""

    def encode(self, _first_sequence: int, counts: Int32s, _status: UInt8s, _times_s: Floats) -> list[bytes]:
        words = np.stack([self._readings(word, counts) for word in self._scan_list], axis=1)
        if self._values["encode"]:
            end = _LINE_ENDS[self._values["eol"]]
            rows = (words * self._volts_per_count).tolist()
            return [(",".join(f"{volts:.4f}" for volts in row) + end).encode("ascii") for row in rows]
        if not self._model.has_digital_word:
            words[:, 0] |= codec.PLAIN.open_inputs
        return [row.tobytes() for row in words.astype("<i2")]

    def _readings(self, word: int, counts: Int32s) -> Ints:
        function = word & _FUNCTION_BITS
        if function in self._gauges:
            return codec.left_justified(counts[:, self._gauges.index(function)], self._model.bits)
        if function < commands.DIGITAL_INPUTS:
            return np.zeros(len(counts), dtype=np.int64)
        other = codec.WITH_DIGITAL.open_inputs if function == commands.DIGITAL_INPUTS else _COUNTER_AT_REST
        return np.full(len(counts), other, dtype=np.int64)

    def _command(self, line: str) -> Command:
        name, *given = line.split() or [""]
        numbers = [int(one) for one in given if one.isdecimal()]
        if name == "stop":
            self._is_scanning = False
            return Command(CommandKind.STOP, parameters=commands.STOP)
        if self._is_scanning:
            return Command(CommandKind.OTHER)
        if name == "start":
            self._is_scanning = True
            return Command(CommandKind.START)
        if name in _DIVISORS and numbers:
            return self._set_rate(name, numbers[0], line)
        return Command(CommandKind.OTHER, parameters=self._reply(name, numbers, line))

    def _set_rate(self, name: str, value: int, line: str) -> Command:
        wanted = self._values | {name: value}
        lowest = self._model.lowest_srate if name == "srate" else 1
        most = {"srate": commands.MAX_SRATE, "dec": commands.MAX_DEC, "deca": commands.MAX_DECA}[name]
        if not lowest <= value <= most or (name == "dec" and not self._model.has_dec):
            return Command(CommandKind.OTHER)
        self._values = wanted
        rate_hz = Divisors(*(wanted[one] for one in _DIVISORS)).rate_hz()
        return Command(CommandKind.RATE, rate_hz, parameters=line.encode("ascii") + commands.END)

    def _reply(self, name: str, numbers: list[int], line: str) -> bytes:
        """Echo of a command, and what it asks for; b"" for one that is not known."""
        answer = ""
        match name, numbers:
            case "info", [number]:
                facts = {0: "DATAQ", 1: self._model.name, 2: FIRMWARE, 6: SERIAL_NUMBER}
                answer = (facts | {9: str(commands.DIVIDEND_HZ)}).get(number, "")
            case "ps", []:
                answer = str(self.packet_bytes)
            case "ps", [step] if step <= commands.MAX_PACKET:
                self.packet_bytes = commands.PACKET_BYTES << step
            case "slist", [place, word] if place <= len(self._scan_list):
                self._scan_list[place:] = [word]
            case (("encode" | "eol"), [value]):
                self._values[name] = value
            case _, [] if name in _DIVISORS:
                answer = str(self._values[name])
            case _ if name not in _ECHOED:
                return b""
        return " ".join([line, answer]).strip().encode("ascii") + commands.END


def make_protocol(settings: dict[str, str]) -> SimulatedDataq:
    """The simulated device with its own settings. Raises SettingsError."""
    return SimulatedDataq(parse_settings(DataqSettings, settings, DRIVER.name))
