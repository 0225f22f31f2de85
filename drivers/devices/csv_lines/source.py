"""A device that sends lines of values, as a `SampleSource`."""

import math
import re
import time
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Literal

import msgspec

from drivers.devices.csv_lines import DRIVER, codec
from drivers.devices.csv_lines.codec import LineDecoder
from drivers.devices.csv_lines.columns import CHECKSUMS, DECIMALS, LINE_ENDS, SEPARATORS, Column, LineFormat
from drivers.devices.csv_lines.inference import (
    OPENSCALE_FORMAT,
    InferredColumns,
    find_openscale_format,
    infer_columns,
)
from drivers.devices.csv_lines.line_parser import LineParser
from drivers.devices.csv_lines.presets import Preset, read_preset, shipped_presets, with_preset
from drivers.errors import NoDataError, ProtocolError, SettingsError
from drivers.polling import (
    TRIALS,
    PollSchedule,
    ResponseTiming,
    Transaction,
    drain,
    poll_rate_error,
    quasi_static_note,
    transact,
)
from drivers.recognition import IdentityQuery, Recognition, rate_from_count, unless_coincidence
from drivers.samples import DeviceIdentity
from drivers.source import LineSettings, Link
from drivers.stream import RATE_GROWTH, SampleSource, check_rate, parse_settings
from messages.i18n import N_
from messages.message import EMPTY, Message, joined, message

_LINE_END = b" \r\n"
_HOST_STEP_S = 1e-6  # of the host's time in front of a line that was asked for
_DOUBTED_BYTES = 1 << 14
"""Some hundred lines, few of which are damaged: if their rate is wrong, the settings are."""


class CsvSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What `--set` and `[device.settings]` may give; see `LineFormat`. Raises SettingsError."""

    format: Literal["columns", "openscale"] = "columns"
    """`openscale` infers the columns of a SparkFun OpenScale; presets were put in before (`with_preset`)."""
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
    start: str = ""  # what is sent to start, stop and ask, with escapes such as \\r and \\x11
    stop: str = ""
    poll: str = ""
    """Asks for each line, which then gets the host's time; "" for a device that sends by itself."""
    overload_status: str = ""  # words of the status column, with commas between
    fault_status: str = ""
    good_status: str = "ok"
    line_end: Literal["crlf", "lf", "cr"] = "crlf"

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
        return LineFormat(
            tuple(map(Column, columns)),
            SEPARATORS.get(self.separator, self.separator),
            DECIMALS.get(self.decimal, self.decimal),
            self.comment,
            self.time_bits,
            self.sequence_bits,
            self.unit,
            _words(self.overload_status),
            _words(self.fault_status),
            self.good_status,
            LINE_ENDS[self.line_end],
        )

    def commands(self) -> "Commands":
        """What is sent to the device. Raises SettingsError."""
        names = ("start", "stop", "poll")
        return Commands(*(unescape(name, getattr(self, name)) for name in names))


@dataclass(frozen=True, slots=True)
class Commands:
    """What is sent to a device; b"" for nothing."""

    start: bytes = b""
    stop: bytes = b""
    poll: bytes = b""


def unescape(name: str, text: str) -> bytes:
    r"""Bytes of a setting such as `\x1bP\r\n`. Raises SettingsError for an escape that is none."""
    try:
        return text.encode("ascii").decode("unicode_escape").encode("latin-1")
    except UnicodeError:
        template = N_("{name} {text!r} cannot be sent: write characters and escapes such as {examples}")
        raise SettingsError(template, name=name, text=text, examples=r"\r \n \x11") from None


def _words(text: str) -> tuple[str, ...]:
    return tuple(word.strip() for word in text.split(",") if word.strip())


class CsvLinesSource(SampleSource):
    """The device sends by itself, or once it is started; of commands it takes only those.

    `layout` is None for a device whose lines show it (`find_layout`). `rate_hz` is needed where no column
    holds the time. Readings of `overload_count` and more are marked as overloaded. `preset` describes a known
    device.
    """

    name = "CSV lines"

    def __init__(
        self,
        layout: LineFormat | None,
        rate_hz: float | None,
        overload_count: float = math.inf,
        commands: Commands | None = None,
        preset: Preset | None = None,
    ) -> None:
        identity = DeviceIdentity(DRIVER.name, preset.title if preset else self.name)
        super().__init__(identity, (preset.baud if preset else 0) or DRIVER.default_baud, rate_hz)
        self._layout = layout
        self._overload_count = overload_count
        self._commands = commands or Commands()
        self._caution = preset.caution if preset else ""
        self.stop_command = self._commands.stop
        if layout is not None:
            self._check_rate(layout)

    @property
    def run_note(self) -> Message:
        return message("{caution}", caution=self._caution) if self._caution else EMPTY

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
        if self._commands.start:
            link.write(self._commands.start)
        first = self.await_stream(link, self._has_good_line, self.timeout_s)
        if self._layout is None:
            raise self.no_data_error(first)
        self._check_rate(self._layout)
        if self._layout.time_column is None:
            return first
        layout = self._layout
        more, good = self.await_data(
            link, self.timeout_s, lambda data: codec.rate_from_lines(layout, first + data), RATE_GROWTH
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


@dataclass(frozen=True, slots=True)
class LineRequest:
    """Asks for one line."""

    data: bytes
    is_repeated = False

    def encode(self) -> bytes:
        return self.data

    def is_complete(self, received: bytes) -> bool:
        return bool(received.strip(_LINE_END)) and received[-1:] in (b"\r", b"\n")


class PolledLinesSource(CsvLinesSource):
    """A device that sends a line when it is asked.

    Each line gets the host's time of its measurement in front, in microseconds, so that the stored bytes make
    the same samples again. Polls are made at the beginning of the cells of a grid, or not at all. A line that
    may be the answer to an earlier request, or was not measured at its place in its cell, gets no time: it is
    a damaged one.
    """

    is_polled = True
    _answer_s = 0.5  # balances and multimeters integrate for up to some tenths of a second

    def __init__(
        self,
        layout: LineFormat,
        rate_hz: float | None,
        overload_count: float,
        commands: Commands,
        preset: Preset | None,
    ) -> None:
        super().__init__(_with_host_time(layout), rate_hz, overload_count, commands, preset)
        self._mark = layout.separator.encode("ascii")
        self._request = LineRequest(commands.poll)
        self._identity_query = preset.identity if preset else None
        self._schedule: PollSchedule | None = None
        self._timing: ResponseTiming | None = None
        self._answer_overdue = False

    @property
    def run_note(self) -> Message:
        return joined([note for note in (quasi_static_note(self.rate_hz), super().run_note) if note], "; ")

    def start(self, link: Link) -> bytes:
        """Wait for a good line, and choose or check the rate."""
        self.prepare()
        if self._commands.start:
            link.write(self._commands.start)
        self._await_line(link)
        self._ask_identity(link)
        timing = ResponseTiming([[transact(link, self._request, self._answer_s)] for _ in range(TRIALS)])
        if self._rate_hz is None:
            self._rate_hz = timing.max_rate_hz
        elif timing.poll_s * self._rate_hz > 1:
            raise poll_rate_error(self._rate_hz, timing)
        self._timing, self._schedule = timing, PollSchedule(self._rate_hz)
        return b""

    def resume(self, link: Link) -> bytes:
        if self._commands.start:
            link.write(self._commands.start)
        self._await_line(link)
        self._answer_overdue = False
        return b""

    def set_poll_rate(self, rate_hz: float) -> None:
        self._rate_hz, self._schedule = rate_hz, PollSchedule(rate_hz)

    def read(self, link: Link) -> bytes:
        """Wait for the next poll and make it; b"" where it is not due within 50 ms, or nothing came."""
        if self._schedule is None or self._timing is None:
            raise ProtocolError("the device was not started: start it before it is read")
        if not self._schedule.wait():
            return b""
        transaction = transact(link, self._request, self._answer_s)
        is_stale = self._answer_overdue or self._timing.is_stale(transaction)
        is_late = is_stale or not self._timing.is_on_schedule(0, transaction, self._schedule)
        is_complete = self._request.is_complete(transaction.data)
        self._answer_overdue = not is_complete
        if is_complete and not is_stale:
            self._timing.update([transaction], self._schedule)
        elif transaction.data:
            drain(link)  # so that what comes next is the answer to the next request
        self._schedule.mark_used(transaction.measured_ns)
        return b"".join(_lines(transaction.data)) if is_late else self._with_time(transaction)

    def take_warnings(self) -> list[Message]:
        return (self._schedule.take_warnings() if self._schedule else []) + super().take_warnings()

    def make_decoder(self, data: bytes) -> LineDecoder | None:  # noqa: ARG002 - the rate is that of the polls
        if self._layout is None or self._rate_hz is None:
            return None
        return LineDecoder(self._layout, self._rate_hz, _HOST_STEP_S, self._overload_count)

    def _await_line(self, link: Link) -> None:
        received = drain(link)

        def read() -> bytes:
            return self._with_time(transact(link, self._request, self._answer_s))

        deadline_s = time.perf_counter() + self.timeout_s
        while not self._has_good_line(received):
            received += read()
            if time.perf_counter() > deadline_s:
                raise self.no_data_error(received)

    def _ask_identity(self, link: Link) -> None:
        """Ask the device who it is, where its preset knows how. Some devices of a kind have no answer."""
        asked = self._identity_query
        if asked is None:
            return
        answer = transact(link, LineRequest(unescape("query", asked.query)), self._answer_s)
        name = _find_identity(asked.pattern, answer.data)
        if name:
            self._identity = replace(self._identity, name=name)
        else:
            drain(link)

    def _with_time(self, transaction: Transaction) -> bytes:
        """What came, each line on its own and the last one with its time; b"" for nothing."""
        lines = _lines(transaction.data)
        if lines:
            lines[-1] = b"%d%s%s" % (transaction.measured_ns // 1000, self._mark, lines[-1])
        return b"".join(lines)

    def _check_rate(self, layout: LineFormat) -> None:
        """The host's time tells it."""


def _lines(data: bytes) -> list[bytes]:
    """Lines that are not empty, each with one terminator."""
    return [line + b"\n" for line in data.replace(b"\r", b"\n").split(b"\n") if line.strip()]


def _with_host_time(layout: LineFormat) -> LineFormat:
    if layout.time_column is not None or Column.SEQUENCE in layout.columns or layout.checksum is not None:
        template = N_(
            "columns {columns}: a line that is polled has the host's time, name others ignore or word"
        )
        raise SettingsError(template, columns=",".join(layout.columns))
    return replace(layout, columns=(Column.TIME_US, *layout.columns), time_bits=0)


def make_source(settings: dict[str, str], rate_hz: float | None) -> CsvLinesSource:
    """Source of the device. Raises SettingsError for a setting or rate that cannot be."""
    check_rate(rate_hz)
    parsed, preset = read_csv_settings(settings)
    if parsed.format == "openscale":
        return OpenScaleSource(None, rate_hz, parsed.overload_count)
    commands = parsed.commands()
    kind = PolledLinesSource if commands.poll else CsvLinesSource
    return kind(parsed.layout(), rate_hz, parsed.overload_count, commands, preset)


def read_csv_settings(settings: dict[str, str]) -> tuple[CsvSettings, Preset | None]:
    """Settings, completed by the preset that they name. Raises SettingsError."""
    complete, preset = with_preset(settings)
    return parse_settings(CsvSettings, complete, DRIVER.name), preset


def single_gauge_settings(gauge: str, settings: dict[str, str]) -> tuple[dict[str, str], int]:  # noqa: ARG001
    """Settings of a device with one gauge, and the column of its readings. Raises SettingsError."""
    if settings.get("format", "columns") != "columns" and "columns" not in settings:
        return settings, 0  # the device shows its columns itself, or its preset says them
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
    candidates += _presets_with_status()
    found = [_recognise_lines(candidate, data, duration_s) for candidate in candidates]
    return max(filter(None, found), key=lambda one: one.share, default=None)


def identity_queries() -> tuple[IdentityQuery, ...]:
    """Questions of the presets whose device tells who it is."""
    presets = {name: read_preset(name) for name in shipped_presets()}
    return tuple(
        IdentityQuery(
            6,
            unescape("query", preset.identity.query),
            (LineSettings(preset.baud),),
            partial(_parse_identity, preset.identity.pattern),
            {"format": name},
            channels=make_source({"format": name}, 1.0).channels,
        )
        for name, preset in presets.items()
        if preset.identity is not None
    )


def _parse_identity(pattern: str, received: bytes) -> Message | None:
    name = _find_identity(pattern, received)
    return message("{identity}", identity=name) if name else None


def _find_identity(pattern: str, received: bytes) -> str:
    """What the first group of a pattern finds in a whole line; empty for nothing."""
    found = re.search(pattern + r"\s*[\r\n]", received.decode("ascii", "replace"))
    return found[1].strip() if found else ""


@cache
def _presets_with_status() -> tuple[InferredColumns, ...]:
    """Presets of lines that are like no other: with a status, as a device sends them that was told to."""
    settings = {name: read_csv_settings({"format": name})[0] for name in shipped_presets()}
    return tuple(
        InferredColumns(one.layout(), {"format": name})
        for name, one in settings.items()
        if one.overload_status or one.fault_status
    )


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
