"""Protocols as the drill with rubbish knows them: what their frames are, and what decodes them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.devices.csv_lines import inference
from drivers.devices.csv_lines.codec import LineDecoder, encode_lines
from drivers.devices.csv_lines.columns import Column, LineFormat
from drivers.devices.gsv.codec import FrameDecoder as GsvDecoder
from drivers.devices.gsv.codec import FrameLayout
from drivers.devices.gsv.codec import encode_frames as encode_gsv
from drivers.devices.harp.codec import EventDecoder, encode_events
from drivers.devices.modbus.decoder import ResponseDecoder, wrap_response
from drivers.devices.modbus.frames import encode_read_response
from drivers.devices.modbus.maps import read_map
from drivers.devices.modbus.registers import plan_poll
from drivers.devices.slipstand_binary.codec import FrameDecoder, encode_frames
from drivers.driver import GAUGES
from drivers.envelope import wrap
from drivers.pair.source import make_pair
from drivers.registry import find_driver
from drivers.samples import Losses, SampleBlock
from drivers.stream import Decoder

RATE_HZ = 1000.0
_CHECKED = LineFormat((Column.TIME_US, Column.TABLE, Column.RELATIVE, Column.CRC))
_PLAIN = LineFormat()
_HALF = LineFormat((Column.SEQUENCE, Column.VALUE))
_CHECKED_HALF = LineFormat((Column.SEQUENCE, Column.VALUE, Column.CRC))
_GSV = FrameLayout(2)
_POLL = plan_poll(tuple(read_map("generic", {}).channels.values()))
(_ASKED,) = _POLL.requests
_LINES_DIFFER_BYTES = 12
Counts = NDArray[np.int32]


@dataclass(frozen=True, slots=True)
class Speaker:
    """A protocol."""

    name: str
    decoder: Callable[[], Decoder]
    frames: Callable[[int, Counts], list[bytes]]
    """From the index of the first sample and the counts (n, 2): a frame each."""
    has_checksum: bool
    """One that hardly any damage passes."""
    count_bits: int = 24
    gauges: int = 2
    """Columns of the counts that it sends."""
    leap: int = 500_000
    """Index of the first good sample after the rubbish."""
    following: int = 1
    """Frames that must follow a good one until its sample is given: some tell their end by the next one."""
    envelope: Callable[[int, bytes], bytes] = lambda _, data: data
    """What the host makes of a read, from the index of its sample, before it is stored or decoded."""


def _times_s(first: int, counts: Counts) -> NDArray[np.float64]:
    return (first + np.arange(len(counts))) / RATE_HZ


def _lines(layout: LineFormat) -> Callable[[int, Counts], list[bytes]]:
    return lambda first, counts: encode_lines(layout, _times_s(first, counts), counts, first)


def _binary_frames(first: int, counts: Counts) -> list[bytes]:
    times_us = np.rint(_times_s(first, counts) * 1e6).astype(np.int64)
    return [frame.tobytes() for frame in encode_frames(first, times_us, counts)]


def _answers(first: int, counts: Counts) -> list[bytes]:
    return [encode_read_response(_ASKED.unit, _ASKED.function, row.astype(">i4").tobytes()) for row in counts]


def _in_envelope(index: int, answer: bytes) -> bytes:
    return wrap_response(0, _host_ns(index), answer)


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
    times_s = _times_s(first, counts)
    both = (encode_lines(layout, times_s, column, first) for column in (counts, counts[:, ::-1]))
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


SPEAKERS = {
    speaker.name: speaker
    for speaker in (
        Speaker("slipstand-binary", lambda: FrameDecoder(RATE_HZ), _binary_frames, has_checksum=True),
        Speaker(
            "csv with checksum", lambda: LineDecoder(_CHECKED, RATE_HZ), _lines(_CHECKED), has_checksum=True
        ),
        Speaker("csv", lambda: LineDecoder(_PLAIN, RATE_HZ), _lines(_PLAIN), has_checksum=False),
        Speaker(
            "gsv",
            lambda: GsvDecoder(_GSV, RATE_HZ),
            lambda _, counts: [frame.tobytes() for frame in encode_gsv(_GSV, counts)],
            has_checksum=False,
        ),
        Speaker(
            "harp",  # the sum of its bytes modulo 256 is no checksum that this drill could count on
            lambda: EventDecoder(RATE_HZ),
            lambda first, counts: [
                frame.tobytes() for frame in encode_events(_times_s(first, counts), counts)
            ],
            has_checksum=False,
            count_bits=16,
        ),
        Speaker(
            "openscale",
            lambda: LineDecoder(inference.OPENSCALE_FORMAT, RATE_HZ),
            _lines(inference.OPENSCALE_FORMAT),
            has_checksum=False,
            gauges=1,
        ),
        Speaker(
            "modbus",
            lambda: ResponseDecoder(_POLL, (0, 1), RATE_HZ),
            _answers,
            has_checksum=True,
            envelope=_in_envelope,
        ),
        Speaker(
            "modbus, damaged envelopes",
            lambda: ResponseDecoder(_POLL, (0, 1), RATE_HZ),
            lambda first, counts: [
                _in_envelope(first + i, answer) for i, answer in enumerate(_answers(first, counts))
            ],
            has_checksum=True,
        ),
        Speaker(
            "pair",  # a reading whose counterpart is lost takes its neighbour: such rows were never sent
            lambda: _Pair(_HALF),
            _pair_frames,
            has_checksum=False,
            following=600,  # it listens for half a second before it lays one device beside the other
        ),
        Speaker(
            "pair, whole envelopes",  # without its checksum rubbish claims more gaps than rows can be made of
            lambda: _Pair(_CHECKED_HALF),
            lambda first, counts: list(map(b"".join, _pair_lines(_CHECKED_HALF, first, counts))),
            has_checksum=False,
            following=600,
            envelope=_in_two_envelopes,
        ),
    )
}
