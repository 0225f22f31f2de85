"""Streams of all devices for the drill with random bytes, and of two devices as one."""

from collections.abc import Iterator

from drivers.devices.csv_lines.codec import encode_lines
from drivers.devices.csv_lines.columns import Column, LineFormat
from drivers.driver import GAUGES
from drivers.envelope import wrap
from drivers.pair.source import make_pair
from drivers.registry import find_driver
from drivers.samples import Losses, SampleBlock
from tests.drivers.examples import RATE_HZ, Counts, WireExample, times_s, wire_examples

_HALF = LineFormat((Column.SEQUENCE, Column.VALUE))
_CHECKED_HALF = LineFormat((Column.SEQUENCE, Column.VALUE, Column.CRC))
_LINES_DIFFER_BYTES = 12
Speaker = WireExample


def _host_ns(index: int) -> int:
    return round((index + 0.5) * 1e9 / RATE_HZ)


class _Pair:
    """Two devices of one gauge, each with lines of its own, as one decoder."""

    def __init__(self, layout: LineFormat) -> None:
        facts = {f"{gauge}.rate_hz": repr(RATE_HZ) for gauge in GAUGES}
        columns = ",".join(layout.columns)
        self._source = make_pair(find_driver("csv"), {"columns": columns}, None, facts)

    @property
    def losses(self) -> Losses:
        return self._source.losses

    @property
    def unfinished_bytes(self) -> int:
        return self._source._decoder.buffered if self._source._decoder else 0

    def expect_restart(self) -> None:
        list(self._source.decode(b"", 0))

    def feed(self, data: bytes, arrival_ns: int) -> Iterator[SampleBlock]:
        return self._source.decode(data, arrival_ns)


def _pair_lines(layout: LineFormat, first: int, counts: Counts) -> list[tuple[bytes, bytes]]:
    both = (
        encode_lines(layout, times_s(first, counts), column, first) for column in (counts, counts[:, ::-1])
    )
    return list(zip(*both, strict=True))


def _in_two_envelopes(index: int, lines: bytes) -> bytes:
    """As read from two ports, cut where a line ends near the middle."""
    middle = lines.find(b"\n", max(0, len(lines) // 2 - _LINES_DIFFER_BYTES)) + 1
    return wrap(0, _host_ns(index), lines[:middle]) + wrap(1, _host_ns(index), lines[middle:])


def _pair_frames(first: int, counts: Counts) -> list[bytes]:
    return [
        b"".join(wrap(gauge, _host_ns(first + i), line) for gauge, line in enumerate(lines))
        for i, lines in enumerate(_pair_lines(_HALF, first, counts))
    ]


_PAIRS = (
    WireExample(
        "pair",  # a reading whose counterpart is lost takes its neighbour: such rows were never sent
        lambda: _Pair(_HALF),
        _pair_frames,
        has_checksum=False,
        following=600,  # it listens for half a second before it pairs readings
    ),
    WireExample(
        "pair, whole envelopes",  # without its checksum garbage claims more gaps than rows can be made of
        lambda: _Pair(_CHECKED_HALF),
        lambda first, counts: list(map(b"".join, _pair_lines(_CHECKED_HALF, first, counts))),
        has_checksum=False,
        following=600,
        envelope=_in_two_envelopes,
    ),
)

SPEAKERS = {example.name: example for example in (*wire_examples(), *_PAIRS)}
