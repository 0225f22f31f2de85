"""From packets and the gaps before them to sample blocks without a hole.

A packet is a run of good samples (a frame or a line) and the number of samples lost before it. Every decoder
reduces its bytes to packets; how packets become rows is the same for all devices.
"""

from abc import abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import fields, replace

import numpy as np

from drivers.arrays import Counts, Floats, Record, Records, UInt8s, record_type
from drivers.compiled import compiled, inlined
from drivers.samples import Losses, SampleBlock, SampleStatus
from drivers.source import Decoder, Read

_SINGLE_READS = 2
"""Reads that are decoded one by one at the end of many: at least one of them ends a packet as a rule."""

MAX_BLOCK_ROWS = 65536  # a long gap becomes several blocks, so that no block is large
MAX_GAP_S = 600.0
"""Longest gap that is believed. A sequence or time that leaps further is a new start of the device."""

PACKET = np.dtype(
    [
        ("damaged", np.int64),  # rows before the packet that came broken
        ("missing", np.int64),  # rows before the packet that never came, proven or estimated
        ("time_s", np.float64),  # device time of the packet's first sample
        ("samples", np.int32),
        ("status", np.int32),
    ],
    align=True,
)

CURSOR = record_type("packet lost sample", "time_s")
"""Progress of `fill_rows`: packet, filled rows of its gap, its first sample, and time of the row before."""

_LOSSES = [field.name for field in fields(Losses)]


def state_type(ints: str, floats: str) -> np.dtype[np.void]:
    """Type of what a decoder keeps between calls: counts of losses, what all decoders need, and own fields.

    `started`: there was a good packet; `restarting`: the connection broke, and the device may have restarted;
    `restart_rows`: rows for the time of a restart, by the host's clock; `period_s`: nominal, between samples;
    `row_time_s`: unwrapped device time of the last row, from 0 at the first.
    """
    common = f"{' '.join(_LOSSES)} started restarting restart_rows"
    return record_type(f"{common} {ints}", f"period_s row_time_s {floats}")


_SLACK_S = 1.0
_SLACK = 0.02
"""How far a device's count may be from the host's estimate of a gap: a busy computer reads bytes late by up
to a second, and the clocks of devices are wrong by up to 2 %. A device that restarted is further off,
unless it was unplugged within its first second."""

_MISSING = int(SampleStatus.MISSING)
_DAMAGED = int(SampleStatus.DAMAGED)


class PacketDecoder(Decoder):
    """A `Decoder` for devices that send by themselves; a device adds `_find_packets`.

    `state` is the type of what compiled loops keep between calls (`state_type`); `rate_hz` the nominal rate,
    > 0; `max_gap_s` the longest gap that rows stand for.
    """

    _piece_bytes = 1 << 16  # long data are decoded in pieces that fit a processor's cache
    _has_time = True  # whether the device sends its time
    _loss_estimator: "LossEstimator | None" = None  # for a device whose stream proves no loss
    _is_timed_at_restarts_only = False
    """Whether arrival times have a part in rows and losses only where the device restarts."""

    def __init__(self, state: np.dtype[np.void], rate_hz: float, max_gap_s: float) -> None:
        self._state = np.zeros(1, dtype=state)
        self._state["period_s"] = 1 / rate_hz
        self._rate_hz = rate_hz
        self._max_gap = round(max_gap_s * rate_hz)
        self._unfinished = b""
        self._arrival_ns: int | None = None
        """Of the last good packet."""

    @property
    def losses(self) -> Losses:
        losses = Losses(*self._state[_LOSSES].item())
        if self._loss_estimator is not None:
            losses.missing_estimated += self._loss_estimator.lost
        return losses

    @property
    def unfinished_bytes(self) -> int:
        """Bytes kept for the next call; a frame of most devices, 3 kB at most."""
        return len(self._unfinished)

    def expect_restart(self) -> None:
        """The connection broke: the device goes on if the host's clock agrees with it, else it restarted."""
        self._state["restarting"] = self._arrival_ns is not None
        self._state["discarded_bytes"] += len(self._unfinished)
        self._unfinished = b""

    def feed(self, data: bytes, arrival_ns: int) -> Iterator[SampleBlock]:
        period_s = 1 / self._rate_hz
        for start in range(0, len(data), self._piece_bytes):
            piece = self._unfinished + data[start : start + self._piece_bytes]
            first_index, last_time_s = int(self._state["samples"][0]), float(self._state["row_time_s"][0])
            packets, counts = self._find_packets(piece, arrival_ns)
            if not len(packets):
                continue
            self._arrival_ns = arrival_ns
            rows = range(first_index, int(self._state["samples"][0]))
            if self._loss_estimator is not None:
                self._loss_estimator.add(rows.stop, arrival_ns)
            blocks = sample_blocks(packets, counts, rows, last_time_s, period_s, arrival_ns)
            yield from blocks if self._has_time else (replace(one, device_time_s=None) for one in blocks)

    def feed_reads(self, reads: Sequence[Read]) -> list[SampleBlock]:
        if self._is_timed_at_restarts_only and not self._state["restarting"]:
            kept = vars(self).items()
            before = {name: part.copy() if isinstance(part, np.ndarray) else part for name, part in kept}
            blocks = self._feed_joined(reads)
            if self._arrival_ns is not None and self._state["restarts"] == before["_state"]["restarts"]:
                return blocks
            vars(self).update(before)
        return super().feed_reads(reads)

    def _feed_joined(self, reads: Sequence[Read]) -> list[SampleBlock]:
        """Decode all but the last reads in one piece; those give the arrival of the last good packet."""
        joined, single = reads[:-_SINGLE_READS], reads[-_SINGLE_READS:]
        blocks: list[SampleBlock] = []
        if joined:
            blocks += self.feed(b"".join(data for data, _ in joined), joined[-1][1])
        self._arrival_ns = None
        return blocks + super().feed_reads(single)

    @abstractmethod
    def _find_packets(self, data: bytes, arrival_ns: int) -> tuple[Records, Counts]:
        """Packets (p,) in `data`, which begin with the unfinished bytes, and their samples (s, 2).

        Keeps the new unfinished bytes, and counts the packets in the state.
        """

    def _rows_since(self, arrival_ns: int, samples: int) -> int:
        """Rows for which there was time since the last good packet, less `samples` that came."""
        if self._arrival_ns is None:
            return 0
        elapsed = round((arrival_ns - self._arrival_ns) * 1e-9 * self._rate_hz)
        return min(max(elapsed - samples, 0), self._max_gap)


def sample_blocks(
    packets: Records, samples: Counts, rows: range, last_time_s: float, period_s: float, arrival_ns: int
) -> Iterator[SampleBlock]:
    """Rows of packets (p,) with samples (s, 2), lost rows included, in blocks of at most `MAX_BLOCK_ROWS`.

    `last_time_s` is the device time of the row before, `period_s` the nominal one between samples.
    """
    cursor = np.zeros(1, dtype=CURSOR)
    cursor["time_s"] = last_time_s
    first = rows.start
    while first < rows.stop:
        size = min(rows.stop - first, MAX_BLOCK_ROWS)
        counts = np.empty((size, 2), dtype=samples.dtype)
        status, times_s = np.empty(size, dtype=np.uint8), np.empty(size)
        size = fill_rows(packets, samples, period_s, cursor, counts, status, times_s)
        yield SampleBlock(first, counts[:size], status[:size], arrival_ns, times_s[:size])
        first += size


@inlined
def count_packet(state: Record, packet: Record, is_estimated: bool) -> None:
    """Add a packet and the rows before it to the counts of a decoder's state."""
    state.samples += packet.damaged + packet.missing + packet.samples
    state.damaged += packet.damaged
    state.missing_estimated += packet.missing if is_estimated else 0
    state.missing += 0 if is_estimated else packet.missing
    state.overloaded += packet.samples if packet.status else 0


@compiled
def count_estimated_packets(packets: Records, states: Records) -> None:
    """Add packets whose missing rows are estimated to the counts in `states` (1,)."""
    state = states[0]
    for packet in packets:
        count_packet(state, packet, True)


@inlined
def frames_in(size: int, length: int) -> int:
    """Frames of `length` that `size` bytes without a good one stand for, rounded."""
    return (2 * size + length) // (2 * length)


@inlined
def is_plausible_gap(state: Record, gap: int) -> bool:
    """Whether the host's clock agrees with the `gap` that a device reports after the connection broke."""
    slack = _SLACK_S / state.period_s + _SLACK * state.restart_rows
    return bool(abs(gap - state.restart_rows) <= slack)


@compiled
def fill_rows(
    packets: Records,
    samples: Counts,
    period_s: float,
    cursor: Records,
    counts: Counts,
    status: UInt8s,
    times_s: Floats,
) -> int:
    """Fill one block (counts, status, times) from `cursor` on; returns the number of rows."""
    place, row = cursor[0], 0
    while place.packet < len(packets):
        packet = packets[place.packet]
        row = _fill_gap(packet, place, row, counts, status, times_s)
        if place.lost < packet.damaged + packet.missing or row + packet.samples > len(status):
            break
        for k in range(packet.samples):
            counts[row, 0] = samples[place.sample, 0]
            counts[row, 1] = samples[place.sample, 1]
            status[row] = packet.status
            times_s[row] = packet.time_s + k * period_s
            place.sample += 1
            row += 1
        place.time_s = times_s[row - 1]
        place.lost = 0
        place.packet += 1
    return row


@inlined
def _fill_gap(
    packet: Record, place: Record, row: int, counts: Counts, status: UInt8s, times_s: Floats
) -> int:
    """Rows lost before a packet, as far as the block has room; their times are interpolated."""
    left = packet.damaged + packet.missing - place.lost
    step_s = (packet.time_s - place.time_s) / (left + 1)
    for _ in range(min(left, len(status) - row)):
        place.time_s += step_s
        counts[row, 0] = counts[row, 1] = 0
        status[row] = _DAMAGED if place.lost < packet.damaged else _MISSING
        times_s[row] = place.time_s
        place.lost += 1
        row += 1
    return row


_WINDOW_NS = 1_000_000_000
_JITTER_S = 0.1
"""A count that lags behind the host's clock by less proves no loss: reads are late by up to so much."""
_RECOVERED_FACTOR = 1.5
"""Nor does a lag below so many times the longest one that was made up before: this computer is that busy."""
_CLOCK_ERROR = 5e-4  # nor does one that a wrong clock of the device, or a rate that it rounded, explains


class LossEstimator:
    """Estimates lost samples from the host's clock, where nothing in the stream proves them.

    A busy computer reads samples late and makes up for it; lost samples stay lost. So the lag is the least of
    the last one to two seconds, minus the least of the whole stream.
    """

    def __init__(self, rate_hz: float) -> None:
        self._rate_hz = rate_hz
        self._first: tuple[int, int] | None = None
        self._window = 0
        self._elapsed_s = self._least = self._before = self._now = self._worst = self._recovered = 0.0

    @property
    def lost(self) -> int:
        """Samples that should have come and did not."""
        jitter = max(_JITTER_S * self._rate_hz, _RECOVERED_FACTOR * self._recovered)
        unproven = jitter + _CLOCK_ERROR * self._elapsed_s * self._rate_hz
        return int(self._lag) if self._lag > max(1.0, unproven) else 0

    @property
    def _lag(self) -> float:
        return min(self._before, self._now) - self._least

    def add(self, samples: int, arrival_ns: int) -> None:
        """Add a read: samples until then, lost rows included, and its arrival (ns)."""
        if self._first is None:
            self._first = (samples, arrival_ns)
        passed_ns = arrival_ns - self._first[1]
        self._elapsed_s = passed_ns * 1e-9
        lag = self._elapsed_s * self._rate_hz - (samples - self._first[0])
        self._least = min(self._least, lag)
        if passed_ns // _WINDOW_NS == self._window:
            self._now = min(self._now, lag)
        else:
            self._window = passed_ns // _WINDOW_NS
            self._before, self._now = self._now, lag
            self._worst = max(self._worst, self._lag)
            self._recovered = max(self._recovered, self._worst - self._lag)
