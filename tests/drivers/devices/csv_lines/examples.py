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


def one_gauge(name: str, layout: LineFormat) -> WireExample:
    return WireExample(
        name, lambda: LineDecoder(layout, RATE_HZ), lines(layout), has_checksum=False, gauges=1
    )


WIRE = (
    WireExample(
        "csv with checksum", lambda: LineDecoder(CHECKED, RATE_HZ), lines(CHECKED), has_checksum=True
    ),
    WireExample("csv", lambda: LineDecoder(PLAIN, RATE_HZ), lines(PLAIN), has_checksum=False),
    one_gauge("csv with status", STATUS),
    one_gauge("openscale", OPENSCALE_FORMAT),
)
RECORDING = RecordingExample("CSV lines, time and two values")
VARIANTS = {
    "csv-polled": RecordingExample(
        "two SCPI multimeters, lines that are asked for",
        rates_hz=(5, 10, 20, 50, 100, 150, 200, 250),
        is_exact=False,
        polled_hz=20.0,
        is_pair=True,
        settings={"format": "scpi-read"},
    )
}
