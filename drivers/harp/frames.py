"""Load cell events of Harp, made from samples and taken apart again."""

import numpy as np
from numpy.typing import NDArray

from drivers.accounting import BY_TIME, STREAM, count_lines, make_rules
from drivers.clock import rate_from_steps
from drivers.decoder import PacketDecoder
from drivers.harp.kernels import CHANNELS, EVENT_BYTES, LINE, VALUES_OFFSET, find_events
from drivers.harp.messages import EVENT, HAS_TIMESTAMP, PORT, S16, TICKS_PER_S, Register
from drivers.rows import MAX_GAP_S, PACKET, Packets

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
        self._state["broken"] += self._state["started"] * bool(self._rest)
        self._rubbish = 0
        super().expect_restart()

    def _read(self, data: bytes, arrival_ns: int) -> Packets | None:
        lines = np.empty(2 * len(data) // EVENT_BYTES + 2, dtype=LINE)
        buffer = np.frombuffer(data, dtype=np.uint8)
        found, used, discarded, self._rubbish = find_events(buffer, self._channels, self._rubbish, lines)
        self._rest = data[used:]
        stream = self._state[0]
        units = np.empty(found, dtype=PACKET)
        counts = np.empty((found, 2))
        first_index, last_time_s = int(stream["samples"]), float(stream["row_time_s"])
        stream["restart_rows"] = self._rows_since(arrival_ns, found)
        hold_from = len(data) - _MAX_HELD_BYTES
        good, done = count_lines(lines[:found], hold_from, self._state, self._rules, units, counts)
        if done < found:
            self._rest = data[int(lines[done]["start"]) :]
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
