"""Compiled inner loop of the Harp decoder: find load cell events among messages and rubbish."""

import numpy as np
from numpy.typing import NDArray

from drivers.clock import rate_from_steps
from drivers.compiled import compiled, inlined
from drivers.harp.messages import EVENT, HAS_TIMESTAMP, MIN_MESSAGE_BYTES, PORT, S16, TICKS_PER_S, Register
from drivers.line_counting import BY_TIME, STREAM, count_lines, make_rules
from drivers.packets import MAX_GAP_S, PACKET, PacketDecoder, Packets, Record

CHANNELS = 8
EVENT_BYTES = 28
"""Bytes of a load cell event."""
VALUES_OFFSET = 11
"""Place of its first value."""

LINE = np.dtype(
    [
        ("start", np.int64),
        ("end", np.int64),
        ("good", np.int64),
        ("time", np.float64),  # in 32 us
        ("sequence", np.float64),  # there is none
        ("table", np.float64),
        ("relative", np.float64),
        ("discarded", np.int64),  # bytes of this call that were discarded before it
    ],
    align=True,
)
"""A good event, or up to `LENGTH` bytes of rubbish; as `drivers.line_counting` takes them."""

_LENGTH_BYTE = EVENT_BYTES - 2
_ADDRESS = int(Register.LOAD_CELLS)
_PAYLOAD = S16 | HAS_TIMESTAMP
_ERROR_MASK = 0xF7


@compiled
def find_events(
    buffer: NDArray[np.uint8],
    channels: NDArray[np.int64],
    rubbish: int,
    lines: NDArray[np.void],
) -> tuple[int, int, int, int]:
    """Events in `buffer` and what is none, as `lines`.

    `rubbish` are the bytes since the last whole message. Where that ended, any whole message is passed
    over; after rubbish only an event is believed, since a checksum of eight bits tells too little. Returns
    how many lines there are, how many bytes are done with and discarded, and the rubbish until then.
    """
    at = 0
    found = 0
    discarded = 0
    while at + MIN_MESSAGE_BYTES <= len(buffer):
        size = 0
        if _may_begin(buffer, at, rubbish):
            size = 2 + int(buffer[at + 1])
            if at + size > len(buffer):
                break
            if not _is_whole(buffer, at, size):
                size = 0
        if size == 0:
            if rubbish % EVENT_BYTES == 0:
                _break_line(lines[found], at)
                found += 1
            rubbish += 1
            discarded += 1
            at += 1
            continue
        if _is_event(buffer, at):
            _fill_line(lines[found], buffer, at, channels, discarded)
            found += 1
        rubbish = 0
        at += size
    return found, at, discarded, rubbish


@inlined
def _may_begin(buffer: NDArray[np.uint8], at: int, rubbish: int) -> bool:
    if rubbish:
        return _is_event(buffer, at)
    kind = buffer[at] & _ERROR_MASK
    return bool(1 <= kind <= EVENT and buffer[at + 1] >= MIN_MESSAGE_BYTES - 2)


@inlined
def _is_event(buffer: NDArray[np.uint8], at: int) -> bool:
    return bool(
        buffer[at] == EVENT
        and buffer[at + 1] == _LENGTH_BYTE
        and buffer[at + 2] == _ADDRESS
        and buffer[at + 3] == PORT
        and buffer[at + 4] == _PAYLOAD
    )


@inlined
def _is_whole(buffer: NDArray[np.uint8], at: int, size: int) -> bool:
    total = 0
    for place in range(at, at + size - 1):
        total += buffer[place]
    return bool(total & 0xFF == buffer[at + size - 1])


@inlined
def _break_line(line: Record, at: int) -> None:
    line.start = line.end = at
    line.good = 0


@inlined
def _fill_line(
    line: Record, buffer: NDArray[np.uint8], at: int, channels: NDArray[np.int64], discarded: int
) -> None:
    line.start = at
    line.end = at + EVENT_BYTES
    line.good = 1
    seconds = 0
    for place in range(3, -1, -1):
        seconds = seconds << 8 | int(buffer[at + 5 + place])
    line.time = float(seconds * TICKS_PER_S + (int(buffer[at + 9]) | int(buffer[at + 10]) << 8))
    line.table = _value(buffer, at + VALUES_OFFSET + 2 * channels[0])
    line.relative = _value(buffer, at + VALUES_OFFSET + 2 * channels[1])
    line.discarded = discarded


@inlined
def _value(buffer: NDArray[np.uint8], at: int) -> float:
    value = int(buffer[at]) | int(buffer[at + 1]) << 8
    return float(value - 65536 if value >= 32768 else value)


FULL_SCALE = 32767
"""Largest reading."""
_MAX_HELD_BYTES = 1024


def encode_events(
    times_s: NDArray[np.float64],
    counts: NDArray[np.int32] | NDArray[np.float64],
    table: int = 0,
    relative: int = 1,
) -> NDArray[np.uint8]:
    """Events as a device that never fails would send them; channels of no gauge are 0.

    Parameters
    ----------
    times_s : (n,)
        Device time (s), sent in steps of 32 us.
    counts : (n, 2)
        Table and relative, cut to 16 bits.
    table, relative : int
        Channels of the gauges, 0 to 7.

    Returns
    -------
    (n, 28) uint8
        An event a row; `.tobytes()` is what goes onto the wire.
    """
    wire = np.zeros((len(counts), EVENT_BYTES), dtype=np.uint8)
    wire[:, :5] = EVENT, EVENT_BYTES - 2, Register.LOAD_CELLS, PORT, S16 | HAS_TIMESTAMP
    seconds, ticks = np.divmod(np.rint(np.asarray(times_s) * TICKS_PER_S).astype(np.int64), TICKS_PER_S)
    wire[:, 5:9] = seconds.astype("<u4").view(np.uint8).reshape(-1, 4)
    wire[:, 9:11] = ticks.astype("<u2").view(np.uint8).reshape(-1, 2)
    values = np.zeros((len(counts), CHANNELS), dtype="<i2")
    values[:, [table, relative]] = np.clip(counts, -FULL_SCALE - 1, FULL_SCALE)
    wire[:, VALUES_OFFSET:-1] = values.view(np.uint8)
    wire[:, -1] = wire.sum(axis=1)
    return wire


class EventDecoder(PacketDecoder):
    """Bytes to sample blocks, with every lost sample accounted for as far as the device's times tell it.

    An event that comes k periods after the one before says that k - 1 are lost (`missing_estimated`); as
    many of them as the bytes between can have held are damaged. Other messages are passed over. A time
    that does not follow is believed only if the next event agrees, since a checksum of eight bits lets
    one in 256 damaged events pass.

    Parameters
    ----------
    rate_hz : float
        Nominal rate, > 0.
    table, relative : int
        Channels of the gauges, 0 to 7.
    overload_count : float
        Readings of this size and more are marked as overloaded.
    max_gap_s : float
        Longest gap that is believed.
    """

    def __init__(
        self,
        rate_hz: float,
        table: int = 0,
        relative: int = 1,
        overload_count: float = FULL_SCALE,
        max_gap_s: float = MAX_GAP_S,
    ) -> None:
        super().__init__(np.zeros(1, dtype=STREAM), rate_hz, max_gap_s)
        self._state["period_s"] = 1 / rate_hz
        self._channels = np.array([table, relative])
        self._rules = make_rules(
            BY_TIME,
            rate_hz,
            unit_s=1 / TICKS_PER_S,
            clock_step_s=1 / TICKS_PER_S,
            time_wrap=float((1 << 32) * TICKS_PER_S),
            overload_count=overload_count,
            max_gap_s=max_gap_s,
        )
        self._rubbish = 0

    def expect_restart(self) -> None:
        """The link was broken: time goes on if the host's clock bears it out, else it began anew."""
        self._state["broken"] += self._state["started"] * bool(self._unfinished)
        self._rubbish = 0
        super().expect_restart()

    def _read(self, data: bytes, arrival_ns: int) -> Packets | None:
        lines = np.empty(2 * len(data) // EVENT_BYTES + 2, dtype=LINE)
        buffer = np.frombuffer(data, dtype=np.uint8)
        found, used, discarded, self._rubbish = find_events(buffer, self._channels, self._rubbish, lines)
        self._unfinished = data[used:]
        stream = self._state[0]
        units = np.empty(found, dtype=PACKET)
        counts = np.empty((found, 2))
        first_index, last_time_s = int(stream["samples"]), float(stream["row_time_s"])
        stream["restart_rows"] = self._rows_since(arrival_ns, found)
        hold_from = len(data) - _MAX_HELD_BYTES
        good, done = count_lines(lines[:found], hold_from, self._state, self._rules, units, counts)
        if done < found:
            self._unfinished = data[int(lines[done]["start"]) :]
            discarded = int(lines[done]["discarded"])
            self._rubbish = 0
        stream["discarded_bytes"] += discarded
        if not good:
            return None
        return Packets(
            packets=units[:good],
            counts=counts[:good],
            first_index=first_index,
            rows=int(stream["samples"]) - first_index,
            last_time_s=last_time_s,
            period_s=1 / self._rate_hz,
            timed=True,
            arrival_ns=arrival_ns,
        )


def rate_from_events(data: bytes) -> float | None:
    """Samples a second that the device's own times show; None while there are too few events."""
    lines = np.empty(2 * len(data) // EVENT_BYTES + 2, dtype=LINE)
    buffer = np.frombuffer(data, dtype=np.uint8)
    found, _, _, _ = find_events(buffer, np.zeros(2, dtype=np.int64), 0, lines)
    times = lines["time"][:found][lines["good"][:found] != 0]
    return rate_from_steps(np.diff(times) / TICKS_PER_S, 1 / TICKS_PER_S)


def compile_decoder() -> None:
    """Compile what the decoder needs, or load it, so that no stream waits for it."""
    for _ in EventDecoder(1.0).feed(encode_events(np.zeros(1), np.zeros((1, 2))).tobytes(), 0):
        pass
