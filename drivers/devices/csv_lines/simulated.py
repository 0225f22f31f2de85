"""A simulated device that sends lines of values."""

from drivers.arrays import Floats, Int32s, UInt8s
from drivers.devices.csv_lines import DRIVER
from drivers.devices.csv_lines.codec import encode_lines
from drivers.devices.csv_lines.columns import LineFormat
from drivers.devices.csv_lines.source import CsvSettings
from drivers.simulated.protocol import SimulatedProtocol
from drivers.stream import parse_settings


class SimulatedCsv(SimulatedProtocol):
    """Sends a line a sample from the moment the port is opened; an overload shows as clipping only."""

    streams_on_open = True
    line_end = b"\r\n"

    def __init__(self, layout: LineFormat | None = None) -> None:
        self._layout = layout or LineFormat()

    def encode(self, first_sequence: int, counts: Int32s, _status: UInt8s, times_s: Floats) -> list[bytes]:
        return encode_lines(self._layout, times_s, counts, first_sequence)


def make_protocol(settings: dict[str, str]) -> SimulatedCsv:
    """The simulated device with its own settings. Raises SettingsError."""
    return SimulatedCsv(parse_settings(CsvSettings, settings, DRIVER.name).layout())
