"""Streams of lines."""

from collections.abc import Callable

from drivers.devices.csv_lines.codec import LineDecoder, encode_lines
from drivers.devices.csv_lines.columns import Column, LineFormat
from drivers.devices.csv_lines.inference import OPENSCALE_FORMAT
from tests.drivers.examples import RATE_HZ, Counts, RecordingExample, WireExample, times_s

CHECKED = LineFormat((Column.TIME_US, Column.TABLE, Column.RELATIVE, Column.CRC))
PLAIN = LineFormat()
STATUS = LineFormat(
    (Column.TIME_US, Column.STATUS, Column.VALUE, Column.UNIT),
    overload_status=("OL",),
    fault_status=("ERR",),
    line_end="\r",
)


def lines(layout: LineFormat) -> Callable[[int, Counts], list[bytes]]:
    return lambda first, counts: encode_lines(layout, times_s(first, counts), counts, first)


WIRE = (
    WireExample(
        "csv with checksum", lambda: LineDecoder(CHECKED, RATE_HZ), lines(CHECKED), has_checksum=True
    ),
    WireExample("csv", lambda: LineDecoder(PLAIN, RATE_HZ), lines(PLAIN), has_checksum=False),
    WireExample(
        "csv with status",
        lambda: LineDecoder(STATUS, RATE_HZ),
        lines(STATUS),
        has_checksum=False,
        gauges=1,
    ),
    WireExample(
        "openscale",
        lambda: LineDecoder(OPENSCALE_FORMAT, RATE_HZ),
        lines(OPENSCALE_FORMAT),
        has_checksum=False,
        gauges=1,
    ),
)
RECORDING = RecordingExample("CSV lines, time and two values")
