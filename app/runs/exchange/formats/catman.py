"""HBM catman binary files (.bin).

Layout: HBM, catman data format, as leonbohmann/APReader reads it (`apread/apreader.py`, `entries.py`, 1.1.3),
which is the peer of the tests. Written here since that package needs OpenCV and matplotlib and asks at the
keyboard which channel is the time.
"""

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from app.runs.errors import ImportFileError
from app.runs.exchange.columns import ReportShare
from app.runs.exchange.csv_layout import FileLayout
from app.runs.exchange.tables import Table

_VERSION_MIN = 5010  # number of the format from which on the data stand channel after channel
_CHANNELS_MOST = 10_000
_RESERVED_TEXTS = 32
_EXPORT_FORMAT_AT = 140
"""Byte of the extended header of a channel that tells the width of its numbers."""
_WIDTHS = {0: 8, 1: 4, 2: 2}
_SCALED_STEPS = 32767  # of numbers of two bytes, from the channel's lowest to its highest


@dataclass(frozen=True, slots=True)
class _Channel:
    name: str
    unit: str
    rows: int
    width: int
    """Bytes of a number."""


class _Reader:
    """Little-endian values of a file. Raises ImportFileError where it ends."""

    def __init__(self, path: Path, file: BinaryIO) -> None:
        self._path = path
        self._file = file

    def bytes(self, count: int) -> bytes:
        data = self._file.read(max(count, 0))
        if count < 0 or len(data) < count:
            raise ImportFileError("{path} is cut short, or no catman file. Export it again", path=self._path)
        return data

    def number(self, code: str) -> Any:
        return struct.unpack("<" + code, self.bytes(struct.calcsize("<" + code)))[0]

    def text(self, length_code: str = "h") -> str:
        data = self.bytes(self.number(length_code))
        try:
            return data.decode("utf-8").strip("\0 ")
        except UnicodeDecodeError:
            return data.decode("cp1252", "replace").strip("\0 ")


def open_table(path: Path, _layout: FileLayout, _report: ReportShare) -> Table:
    """Channels by their names, the times among them. Raises ImportFileError."""
    with path.open("rb") as file:
        reader = _Reader(path, file)
        version, data_at = reader.number("h"), reader.number("i")
        if version < _VERSION_MIN:
            raise ImportFileError(
                "{path} is no catman file, or of an old version. Export it again", path=path
            )
        reader.text()
        for _ in range(_RESERVED_TEXTS):
            reader.text()
        count = reader.number("h")
        if not 0 < count <= _CHANNELS_MOST:
            raise ImportFileError("{path} is damaged: it has {count} channels", path=path, count=count)
        reader.bytes(4 + 4 * count + 4)  # longest channel, offsets, reduction
        channels = [_channel(reader) for _ in range(count)]
    places = []
    for channel in channels:
        places.append(data_at)
        data_at += channel.rows * channel.width + (16 if channel.width == 2 and channel.rows else 0)

    def column(at: int) -> NDArray[Any]:
        return _read(path, channels[at], places[at])

    names, units = [one.name for one in channels], [one.unit for one in channels]
    return Table(names, column, units=units, lengths=[one.rows for one in channels])


def _channel(reader: _Reader) -> _Channel:
    reader.number("h")  # number of the channel
    rows, name, unit = reader.number("i"), reader.text(), reader.text()
    reader.text()  # comment
    reader.bytes(2 + 2 + 8)  # kind, width, time of reading
    header = reader.bytes(reader.number("i"))
    reader.bytes(2)  # linearisation, scale
    reader.bytes(8 * reader.number("B") + 2)  # points of the scale, thermocouple
    reader.text()  # formula
    reader.text("i")  # sensor
    code = header[_EXPORT_FORMAT_AT] if len(header) > _EXPORT_FORMAT_AT else 0
    return _Channel(name, unit, max(rows, 0), _WIDTHS.get(code, 8))


def _read(path: Path, channel: _Channel, place: int) -> NDArray[Any]:
    if channel.rows * channel.width > path.stat().st_size:
        raise ImportFileError("{path} is cut short, or no catman file. Export it again", path=path)
    with path.open("rb") as file:
        file.seek(place)
        reader = _Reader(path, file)
        low, high = (reader.number("d"), reader.number("d")) if channel.width == 2 else (0.0, 0.0)
        data = reader.bytes(channel.rows * channel.width)
    if channel.width == 2:
        return np.frombuffer(data, "<u2") * ((high - low) / _SCALED_STEPS) + low
    return np.frombuffer(data, f"<f{channel.width}")
