"""A device that sends lines of values, as a `SampleSource`."""

import math
import time
from typing import Literal

import msgspec

from drivers.csv_lines import openscale
from drivers.csv_lines.codec import (
    LineDecoder,
    clock_step_from_lines,
    compile_decoder,
    has_good_line,
    rate_from_lines,
)
from drivers.csv_lines.columns import Column, LineFormat
from drivers.errors import NoDataError, SettingsError
from drivers.samples import DeviceIdentity
from drivers.settings import parse_settings
from drivers.source import Link
from drivers.stream import StreamSource

PROTOCOL = "csv"
DEFAULT_BAUD = 115200
_SEPARATORS = {"comma": ",", "semicolon": ";", "tab": "\t", "space": " "}
_DECIMALS = {"point": ".", "comma": ","}
_RATE_TOLERANCE = 0.02
_DOUBTED_BYTES = 1 << 14
"""Some hundred lines, of which the damaged ones are few."""


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What `--set` and `[device.settings]` may give; see `LineFormat`."""

    format: Literal["columns", "openscale"] = "columns"
    """`openscale` finds out the columns of a SparkFun OpenScale by itself."""
    columns: str = "time_us,table,relative"
    separator: str = "comma"
    decimal: str = "point"
    comment: str = "#%;/"
    unit: str = ""
    """The word that `unit` columns hold; any where it is absent."""
    time_bits: int = 32
    sequence_bits: int = 32
    overload_count: float = math.inf
    """Readings of this size and more are marked as overloaded."""

    def __post_init__(self) -> None:
        if not self.overload_count > 0:
            raise ValueError(f"overload_count {self.overload_count:g} must be positive")
        if self.format == "openscale":
            _check_rest_is_absent(self)

    def layout(self) -> LineFormat:
        """Columns as the decoder takes them, as shipped with an OpenScale. Raises SettingsError."""
        if self.format == "openscale":
            return openscale.DEFAULT_FORMAT
        return LineFormat(
            columns=tuple(_column(name.strip()) for name in self.columns.split(",")),
            separator=_SEPARATORS.get(self.separator, self.separator),
            decimal=_DECIMALS.get(self.decimal, self.decimal),
            comment=self.comment,
            time_bits=self.time_bits,
            sequence_bits=self.sequence_bits,
            unit=self.unit,
        )


class CsvLinesSource(StreamSource):
    """The device talks and the host listens: there are no commands.

    Parameters
    ----------
    layout : LineFormat or None
        None for a device whose lines tell it, once some came (`find_layout`).
    rate_hz : float or None
        Nominal samples a second; needed where no column holds the time.
    overload_count : float
        Readings of this size and more are marked as overloaded.
    """

    name = "CSV lines"

    def __init__(
        self, layout: LineFormat | None, rate_hz: float | None, overload_count: float = math.inf
    ) -> None:
        super().__init__(DeviceIdentity(PROTOCOL, self.name), DEFAULT_BAUD, rate_hz)
        self._layout = layout
        self._overload_count = overload_count
        if layout is not None:
            self._check_rate(layout)

    @property
    def channels(self) -> int:
        """One where there is a `value` column."""
        return 1 if self._layout is None else self._layout.channels

    def prepare(self) -> None:
        """Compile the decoder, which takes seconds on the very first use."""
        compile_decoder(self._layout or LineFormat())

    def start(self, link: Link) -> bytes:
        """Wait for the first good line, and with a time column for as many as tell the rate.

        Opening the port resets many an Arduino, which is silent for two seconds after it.

        Raises
        ------
        NoDataError
            If no good line came in time, or after it too few to tell the rate.
        SettingsError
            If the rate asked for is not that of the device's own times.
        """
        self.prepare()
        link.read()  # what waited there is old, and maybe not all of it is there
        first, good = self.await_data(link, time.monotonic() + self.timeout_s, self._has_good_line)
        if not good or self._layout is None:
            raise self.no_data_error(first)
        self._check_rate(self._layout)
        if self._layout.time_column is None:
            return first
        more, good = self.await_data(
            link, time.monotonic() + self.timeout_s, lambda data: self._tells_rate(first + data)
        )
        if not good:
            raise NoDataError(f"the lines of {self.timeout_s:g} s do not tell a rate: the device is too slow")
        self._decoder = self._decoder or self.make_decoder(first + more)
        if self._decoder is None:
            raise self._contradiction(rate_from_lines(self._layout, first + more) or 0.0)
        return first + more

    def stop(self, link: Link) -> None:
        """Nothing to say: the device goes on sending."""

    def make_decoder(self, data: bytes) -> LineDecoder | None:
        """Decoder once the layout is known, and the rate is given or the device's own times tell it.

        Where both rates are there and disagree the first lines may be damaged: more of them will tell.

        Raises
        ------
        SettingsError
            If many lines still disagree, or neither rate can be known.
        """
        layout = self._layout = self._layout or self.find_layout(data)
        if layout is None:
            return None
        self._check_rate(layout)
        measured_hz = self._rate_hz if layout.time_column is None else rate_from_lines(layout, data)
        if measured_hz is None:
            return None
        self._rate_hz = self._rate_hz or measured_hz
        if abs(measured_hz / self._rate_hz - 1) > _RATE_TOLERANCE:
            if len(data) < _DOUBTED_BYTES:
                return None
            raise self._contradiction(measured_hz)
        return LineDecoder(layout, measured_hz, clock_step_from_lines(layout, data), self._overload_count)

    def find_layout(self, data: bytes) -> LineFormat | None:  # noqa: ARG002 - it was given
        """Layout of the lines in `data`, where none was given."""
        return self._layout

    def _contradiction(self, measured_hz: float) -> SettingsError:
        return SettingsError(
            f"rate {self._rate_hz:g} Hz is not that of the device, whose times say {measured_hz:.5g} Hz: "
            "leave --rate out, or check the unit of the time column"
        )

    def _has_good_line(self, data: bytes) -> bool:
        self._layout = self._layout or self.find_layout(data)
        return self._layout is not None and has_good_line(self._layout, data)

    def _tells_rate(self, data: bytes) -> bool:
        return self._layout is not None and rate_from_lines(self._layout, data) is not None

    def _check_rate(self, layout: LineFormat) -> None:
        if self._rate_hz is None and layout.time_column is None:
            raise SettingsError("lines without a time column do not tell their rate: give --rate")


class OpenScaleSource(CsvLinesSource):
    """A SparkFun OpenScale, with whatever columns it is set to send."""

    name = "SparkFun OpenScale"
    timeout_s = 8.0
    """It resets when its port is opened, and averages readings before the first line."""

    def __init__(self, rate_hz: float | None, overload_count: float = math.inf) -> None:
        super().__init__(None, rate_hz, overload_count)

    def find_layout(self, data: bytes) -> LineFormat | None:
        """See `drivers.csv_lines.openscale`."""
        return openscale.find_layout(data)


def make_source(settings: dict[str, str], rate_hz: float | None) -> CsvLinesSource:
    """Source for `drivers.registry`. Raises SettingsError for a setting or rate that cannot be."""
    if rate_hz is not None and not 0 < rate_hz < math.inf:
        raise SettingsError(f"rate {rate_hz:g} Hz cannot be: give samples a second, for example 80")
    read = parse_settings(Settings, settings, PROTOCOL)
    if read.format == "openscale":
        return OpenScaleSource(rate_hz, read.overload_count)
    return CsvLinesSource(read.layout(), rate_hz, read.overload_count)


def _column(name: str) -> Column:
    try:
        return Column(name)
    except ValueError as error:
        raise SettingsError(f"column {name!r} is not known: allowed are {', '.join(Column)}") from error


def _check_rest_is_absent(settings: Settings) -> None:
    for field in msgspec.structs.fields(Settings):
        given = getattr(settings, field.name)
        if field.name not in ("format", "overload_count") and given != field.default:
            raise ValueError(f"format openscale finds {field.name} by itself: leave {field.name} out")
