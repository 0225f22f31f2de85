"""Samples of an LSL stream from packed chunks; gaps show in the time stamps."""

import numpy as np

from drivers.arrays import Counts, Flags, Floats, Record, Records
from drivers.compiled import compiled, inlined
from drivers.envelope import Unwrapper
from drivers.packets import (
    MAX_GAP_S,
    PACKET,
    PacketDecoder,
    count_estimated_packets,
    is_plausible_gap,
    state_type,
)
from drivers.samples import overload_status
from drivers.stream_packets import DESCRIPTION, unpack_chunk

CONFIRMED_S = 0.1
"""A gap is believed once the stamps of so much time (s) confirm it: one sample may be stamped late."""
_SMOOTHING_S = 1.0
"""Time constant of the clock that follows the stamps (s)."""
_LEAST_LATE = 0.75
"""Lateness in periods that may be a gap; half a period would be one that is as near to none."""
_SCATTERS = 8.0
"""Nor is a lateness below so many times the mean scatter of the stamps a gap."""
_FIRST_SCATTER_S = 0.002
"""Scatter that is assumed before it is measured: that of stamps by a common computer's clock."""

STATE = state_type("broken", "stamp_s scatter_s")
"""What the decoder keeps between calls: samples without a reading since the last good one, the smoothed stamp
of the last row, and the mean scatter of stamps."""


class StreamDecoder(PacketDecoder):
    """Bytes to sample blocks. Device times are the stamps on this computer's clock, smoothed.

    Rows stand for gaps in the stamps; they are estimated, because no number proves them. A gap shorter than
    the scatter of the stamps is not seen. A sample that is no finite number is a damaged row. Samples whose
    stamps fall behind are a restart of the sender.
    """

    def __init__(
        self,
        table: int,
        relative: int,
        rate_hz: float,
        overload: float = np.inf,
        max_gap_s: float = MAX_GAP_S,
    ) -> None:
        super().__init__(STATE, rate_hz, max_gap_s)
        self._state["scatter_s"] = _FIRST_SCATTER_S
        self._channels = [table, relative]
        self._overload = overload
        self._unwrapper = Unwrapper()
        self._max_gap_s = max_gap_s
        self._held = (np.empty(0), np.empty((0, 2)))
        """Stamps and readings of a gap that is not confirmed yet."""

    @property
    def unfinished_bytes(self) -> int:
        return self._unwrapper.unfinished_bytes

    def _find_packets(self, data: bytes, arrival_ns: int) -> tuple[Records, Counts]:
        stamps_s, values = self._unpack(data)
        if self._state[0]["restarting"]:
            self._state["restart_rows"] = self._rows_since(arrival_ns, len(stamps_s))
        packets = np.zeros(len(stamps_s), dtype=PACKET)
        is_good: Flags = np.asarray(np.isfinite(values).all(axis=1))
        found, used = place_samples(stamps_s, is_good, self._max_gap_s, self._state, packets)
        self._held = (stamps_s[used:], values[used:])
        counts = values[:used][is_good[:used]]
        packets = packets[:found]
        packets["status"] = overload_status(np.abs(counts) >= self._overload)
        count_estimated_packets(packets, self._state)
        return packets, counts

    def _unpack(self, data: bytes) -> tuple[Floats, Floats]:
        """Stamps (n,) and readings (n, 2) that are to be placed, held ones included."""
        stamps_s, values = [self._held[0]], [self._held[1]]
        discarded = self._unwrapper.discarded_bytes
        for read in self._unwrapper.feed(data):
            chunk = unpack_chunk(read)
            if chunk is not None and chunk[1].shape[1] > max(self._channels):
                stamps_s.append(chunk[0])
                values.append(chunk[1][:, self._channels])
            elif read.port != DESCRIPTION:
                self._state["discarded_bytes"] += len(read.data)
        self._state["discarded_bytes"] += self._unwrapper.discarded_bytes - discarded
        return np.concatenate(stamps_s), np.concatenate(values)


@compiled
def place_samples(
    stamps_s: Floats, is_good: Flags, max_gap_s: float, states: Records, packets: Records
) -> tuple[int, int]:
    """Fill packets (n,) for good samples by their stamps (n,); returns numbers of packets and used samples.

    Samples after a gap that later stamps have still to confirm are left. `states` (1,) is updated.
    """
    state = states[0]
    found = 0
    for i in range(len(stamps_s)):
        if not is_good[i]:
            state.broken += state.started
            continue
        packet = packets[found]
        if not state.started:
            state.started = 1
            state.stamp_s = stamps_s[i]
        elif state.restarting:
            _restart(state, packet, stamps_s[i])
        else:
            expected_s = state.stamp_s + state.period_s * (1 + state.broken)
            late_s = stamps_s[i] - expected_s
            most_s = max(_LEAST_LATE * state.period_s, _SCATTERS * state.scatter_s)
            if abs(late_s) > most_s:
                if (
                    stamps_s[-1] - stamps_s[i] < CONFIRMED_S
                    and len(stamps_s) - i < CONFIRMED_S / state.period_s
                ):
                    return found, i
                late_s = _confirmed(stamps_s, i, expected_s, state.period_s)
            if late_s > max_gap_s or late_s < -most_s:
                state.restart_rows = 0
                _restart(state, packet, stamps_s[i])
            else:
                _advance(state, packet, expected_s, late_s, late_s > most_s)
        packet.samples = 1
        packet.time_s = state.row_time_s
        state.broken = 0
        found += 1
    return found, len(stamps_s)


@inlined
def _confirmed(stamps_s: Floats, first: int, expected_s: float, period_s: float) -> float:
    """Lateness of the sample `first` that those of the next 0.1 s share: the one nearest to none."""
    nearest_s = stamps_s[first] - expected_s
    for k in range(first, len(stamps_s)):
        passed_s = (k - first) * period_s
        if passed_s > CONFIRMED_S:
            break
        late_s = stamps_s[k] - expected_s - passed_s
        if abs(late_s) < abs(nearest_s):
            nearest_s = late_s
    return float(nearest_s)


@inlined
def _advance(state: Record, packet: Record, expected_s: float, late_s: float, is_gap: bool) -> None:
    """Place a sample: after the one before, or after a gap."""
    missing = int(np.rint(late_s / state.period_s)) if is_gap else 0
    rest_s = late_s - missing * state.period_s
    share = min(1.0, state.period_s / _SMOOTHING_S)
    state.scatter_s += share * (abs(rest_s) - state.scatter_s)
    stamp_s = expected_s + missing * state.period_s + (rest_s if is_gap else share * rest_s)
    state.row_time_s += stamp_s - state.stamp_s
    state.stamp_s = stamp_s
    packet.damaged = state.broken
    packet.missing = missing


@inlined
def _restart(state: Record, packet: Record, stamp_s: float) -> None:
    """Place the first sample of a new start: by its stamp if the host's clock agrees, else by that clock."""
    passed_s = stamp_s - state.stamp_s
    by_stamps = int(np.rint(passed_s / state.period_s)) - 1
    is_continued = state.restarting and by_stamps >= 0 and is_plausible_gap(state, by_stamps)
    gap = by_stamps if is_continued else int(state.restart_rows)
    state.row_time_s += passed_s if is_continued else (gap + 1) * state.period_s
    state.stamp_s = stamp_s
    state.restarts += 0 if is_continued else 1
    state.restarting = 0
    packet.damaged = min(gap, state.broken)
    packet.missing = gap - packet.damaged
