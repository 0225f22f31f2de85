"""A device that sends lines of values, as a `SampleSource`."""

import math
from typing import Literal

import msgspec

from drivers.devices.csv_lines import DRIVER, codec
from drivers.devices.csv_lines.codec import LineDecoder
from drivers.devices.csv_lines.columns import CHECKSUMS, DECIMALS, SEPARATORS, Column, LineFormat
from drivers.devices.csv_lines.inference import (
    OPENSCALE_FORMAT,
    InferredColumns,
    find_openscale_format,
    infer_columns,
)
from drivers.devices.csv_lines.line_parser import LineParser
from drivers.errors import NoDataError, SettingsError
from drivers.recognition import Recognition, rate_from_count, unless_coincidence
from drivers.samples import DeviceIdentity
from drivers.source import Link
from drivers.stream import SampleSource, parse_settings
from messages.i18n import N_

_DOUBTED_BYTES = 1 << 14
"""Some hundred lines, few of which are damaged: if their rate is wrong, the settings are."""


class CsvSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What `--set` and `[device.settings]` may give; see `LineFormat`. Raises SettingsError."""

    format: Literal["columns", "openscale"] = "columns"
    """`openscale` infers the columns of a SparkFun OpenScale."""
    columns: str = "time_us,table,relative"
    separator: str = "comma"
    decimal: str = "point"
    comment: str = "#%;/"
    unit: str = ""
    """The word in `unit` columns; any word if empty."""
    time_bits: int = 32
    sequence_bits: int = 32
    overload_count: float = math.inf
    """Readings of this size and more are marked as overloaded."""

    def __post_init__(self) -> None:
        if not self.overload_count > 0:
            raise SettingsError("overload_count {count:g} must be positive", count=self.overload_count)
        for field in msgspec.structs.fields(type(self)) if self.format == "openscale" else ():
            given = getattr(self, field.name)
            if field.name not in ("format", "overload_count") and given != field.default:
                template = N_("format openscale finds {name} by itself: leave {name} out")
                raise SettingsError(template, name=field.name)

    def layout(self) -> LineFormat:
        """Columns as the decoder takes them; those of a new OpenScale for one. Raises SettingsError."""
        if self.format == "openscale":
            return OPENSCALE_FORMAT
        columns = [name.strip() for name in self.columns.split(",")]
        unknown = next((name for name in columns if name not in list(Column)), None)
        if unknown is not None:
            template = N_("column {name!r} is not known: allowed are {allowed}")
            raise SettingsError(template, name=unknown, allowed=list(Column))
        marks = SEPARATORS.get(self.separator, self.separator), DECIMALS.get(self.decimal, self.decimal)
        bits = self.time_bits, self.sequence_bits
        return LineFormat(tuple(map(Column, columns)), *marks, self.comment, *bits, self.unit)


class CsvLinesSource(SampleSource):
    """The device sends by itself and takes no commands.

    `layout` is None for a device whose lines show it (`find_layout`). `rate_hz` is needed where no column
    holds the time. Readings of `overload_count` and more are marked as overloaded.
    """

    name = "CSV lines"

    def __init__(
        self, layout: LineFormat | None, rate_hz: float | None, overload_count: float = math.inf
    ) -> None:
        super().__init__(DeviceIdentity(DRIVER.name, self.name), DRIVER.default_baud, rate_hz)
        self._layout = layout
        self._overload_count = overload_count
        if layout is not None:
            self._check_rate(layout)

    @property
    def channels(self) -> int:
        return 1 if self._layout is None else self._layout.channels

    def prepare(self) -> None:
        layout = self._layout or LineFormat()
        list(LineDecoder(layout, 1.0).feed(b"\n" + codec.encode_line(layout, 0.0, 0, 0), 0))

    def start(self, link: Link) -> bytes:
        """Wait for the first good line, and with a time column for as many as show the rate."""
        self.prepare()
        link.read()  # what waited in the port is old, and some of it may be lost
        first = self.await_stream(link, self._has_good_line, self.timeout_s)
        if self._layout is None:
            raise self.no_data_error(first)
        self._check_rate(self._layout)
        if self._layout.time_column is None:
            return first
        layout = self._layout
        more, good = self.await_data(
            link, self.timeout_s, lambda data: codec.rate_from_lines(layout, first + data)
        )
        if not good:
            template = N_("the lines of {timeout_s:g} s do not tell a rate: the device is too slow")
            raise NoDataError(template, timeout_s=self.timeout_s)
        self._decoder = self._decoder or self.make_decoder(first + more)
        if self._decoder is None:
            raise self._rate_error(codec.rate_from_lines(self._layout, first + more) or 0.0)
        return first + more

    def make_decoder(self, data: bytes) -> LineDecoder | None:
        """Decoder once the layout is known, and the rate is given or shown by the device's own times.

        Where both disagree, the first lines may be damaged: more are awaited, then SettingsError is raised.
        """
        layout = self._layout = self._layout or self.find_layout(data)
        if layout is None:
            return None
        self._check_rate(layout)
        measured_hz = self._rate_hz if layout.time_column is None else codec.rate_from_lines(layout, data)
        if measured_hz is None:
            return None
        self._rate_hz = self._rate_hz or measured_hz
        if not self.is_same_rate(measured_hz):
            if len(data) < _DOUBTED_BYTES:
                return None
            raise self._rate_error(measured_hz)
        return LineDecoder(
            layout, measured_hz, codec.clock_step_from_lines(layout, data), self._overload_count
        )

    def find_layout(self, data: bytes) -> LineFormat | None:  # noqa: ARG002 - it was given
        return self._layout

    def _rate_error(self, measured_hz: float) -> SettingsError:
        template = N_(
            "rate {rate_hz:g} Hz is not that of the device, whose times say {measured_hz:.5g} Hz: "
            "leave --rate out, or check the unit of the time column"
        )
        return SettingsError(template, rate_hz=self._rate_hz, measured_hz=measured_hz)

    def _has_good_line(self, data: bytes) -> bool:
        self._layout = self._layout or self.find_layout(data)
        return self._layout is not None and codec.has_good_line(self._layout, data)

    def _check_rate(self, layout: LineFormat) -> None:
        if self._rate_hz is None and layout.time_column is None:
            raise SettingsError("lines without a time column do not tell their rate: give --rate")


class OpenScaleSource(CsvLinesSource):
    """A SparkFun OpenScale, with whatever columns it is set to send."""

    name = "SparkFun OpenScale"
    timeout_s = 8.0
    """It is reset by opening its port, and averages readings before the first line."""

    def find_layout(self, data: bytes) -> LineFormat | None:
        return find_openscale_format(data)


def make_source(settings: dict[str, str], rate_hz: float | None) -> CsvLinesSource:
    """Source of the device. Raises SettingsError for a setting or rate that cannot be."""
    if rate_hz is not None and not 0 < rate_hz < math.inf:
        template = N_("rate {rate_hz:g} Hz cannot be: give samples a second, for example 80")
        raise SettingsError(template, rate_hz=rate_hz)
    parsed = parse_settings(CsvSettings, settings, DRIVER.name)
    if parsed.format == "openscale":
        return OpenScaleSource(None, rate_hz, parsed.overload_count)
    return CsvLinesSource(parsed.layout(), rate_hz, parsed.overload_count)


def single_gauge_settings(gauge: str, settings: dict[str, str]) -> tuple[dict[str, str], int]:  # noqa: ARG001
    """Settings of a device with one gauge, and the column of its readings. Raises SettingsError."""
    if settings.get("format", "columns") != "columns":
        return settings, 0  # the device shows its columns itself
    columns = settings.get("columns", "time_us,value")
    if "value" not in (name.strip() for name in columns.split(",")):
        template = N_("columns {columns} have no value: a device with one gauge sends one, as time_us,value")
        raise SettingsError(template, columns=columns)
    return settings | {"columns": columns}, 0


def recognise(data: bytes, duration_s: float | None) -> Recognition | None:
    """What `data` are; see `drivers.recognition.recognise`. An OpenScale is preferred to other lines."""
    openscale, inferred = find_openscale_format(data), infer_columns(data, duration_s)
    candidates = [InferredColumns(openscale, {"format": "openscale"})] if openscale else []
    candidates += [inferred] if inferred else []
    found = [_recognise_lines(candidate, data, duration_s) for candidate in candidates]
    return max(filter(None, found), key=lambda one: one.share, default=None)


def _recognise_lines(inferred: InferredColumns, data: bytes, duration_s: float | None) -> Recognition | None:
    layout = inferred.layout
    whole = codec.whole_lines(data)
    lines = LineParser(layout).read(whole)
    good = lines[lines["good"] != 0]
    share = int((good["end"] - good["start"] + 1).sum()) / max(len(whole.replace(b"\r\n", b"\n")), 1)
    samples = len(good) + 1  # the first line was left out
    rate_hz = codec.rate_from_lines(layout, data) or rate_from_count(samples, duration_s)
    needs_rate = layout.time_column is None
    share, packets = min(share, 1.0), len(good)
    settings, remark = inferred.settings, inferred.remark
    found = Recognition(DRIVER.name, share, packets, layout.channels, settings, rate_hz, needs_rate, remark)
    return unless_coincidence(found, has_checksum=layout.checksum in CHECKSUMS)
