"""Load cell events of Harp, made from samples and taken apart again."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from drivers.clock import rate_of_steps
from drivers.csv_lines.accounting import BY_TIME, RULES, STREAM, account
from drivers.harp.kernels import CHANNELS, LENGTH, LINE, VALUES, find_events
from drivers.harp.messages import EVENT, PORT, S16, TICKS_PER_S, TIMED, Register
from drivers.rows import MAX_GAP_S, UNIT, Units, blocks, losses_in
from drivers.samples import Losses, SampleBlock

FULL_SCALE = 32767
"""Largest reading."""
_MAX_HELD_BYTES = 1024
_PIECE_BYTES = 1 << 16


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
    wire = np.zeros((len(counts), LENGTH), dtype=np.uint8)
    wire[:, :5] = EVENT, LENGTH - 2, Register.LOAD_CELLS, PORT, S16 | TIMED
    seconds, ticks = np.divmod(np.rint(np.asarray(times_s) * TICKS_PER_S).astype(np.int64), TICKS_PER_S)
    wire[:, 5:9] = seconds.astype("<u4").view(np.uint8).reshape(-1, 4)
    wire[:, 9:11] = ticks.astype("<u2").view(np.uint8).reshape(-1, 2)
    values = np.zeros((len(counts), CHANNELS), dtype="<i2")
    values[:, [table, relative]] = np.clip(counts, -FULL_SCALE - 1, FULL_SCALE)
    wire[:, VALUES:-1] = values.view(np.uint8)
    wire[:, -1] = wire.sum(axis=1)
    return wire


class EventDecoder:
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
        self._rate_hz = rate_hz
        self._channels = np.array([table, relative])
        self._rules = _rules(rate_hz, overload_count, max_gap_s)
        self._memory = np.zeros(1, dtype=STREAM)
        self._memory["period_s"] = 1 / rate_hz
        self._rest = b""
        self._rubbish = 0
        self._arrival_ns: int | None = None
        self._last_time_s = 0.0

    @property
    def losses(self) -> Losses:
        """The account until now."""
        return losses_in(self._memory)

    @property
    def unfinished_bytes(self) -> int:
        """Bytes kept for the next call, at most 1.3 kB."""
        return len(self._rest)

    def expect_restart(self) -> None:
        """The link was broken: time goes on if the host's clock bears it out, else it began anew."""
        self._memory["restarting"] = self._memory["started"]
        self._memory["broken"] += self._memory["started"] * bool(self._rest)
        self._memory["discarded_bytes"] += len(self._rest)
        self._rest = b""
        self._rubbish = 0

    def feed(self, data: bytes, arrival_ns: int) -> Iterator[SampleBlock]:
        """Blocks that `data` completes; bytes of an unfinished message are kept. Exhaust it."""
        for start in range(0, len(data), _PIECE_BYTES):
            found = self._read(self._rest + data[start : start + _PIECE_BYTES], arrival_ns)
            if found is not None:
                yield from blocks(found)

    def _read(self, data: bytes, arrival_ns: int) -> Units | None:
        lines = np.empty(2 * len(data) // LENGTH + 2, dtype=LINE)
        buffer = np.frombuffer(data, dtype=np.uint8)
        found, used, discarded, self._rubbish = find_events(buffer, self._channels, self._rubbish, lines)
        self._rest = data[used:]
        units, counts, done = self._accounted(lines[:found], len(data) - _MAX_HELD_BYTES, arrival_ns)
        if done < found:
            self._rest = data[int(lines[done]["start"]) :]
            discarded = int(lines[done]["discarded"])
            self._rubbish = 0
        self._memory["discarded_bytes"] += discarded
        rows = int(units["damaged"].sum() + units["missing"].sum()) + len(units)
        if not rows:
            return None
        self._arrival_ns = arrival_ns
        return Units(
            units=units,
            counts=counts,
            first_index=int(self._memory[0]["samples"]) - rows,
            rows=rows,
            last_time_s=self._last_time_s,
            period_s=1 / self._rate_hz,
            timed=True,
            arrival_ns=arrival_ns,
        )

    def _accounted(
        self, lines: NDArray[np.void], hold_from: int, arrival_ns: int
    ) -> tuple[NDArray[np.void], NDArray[np.float64], int]:
        """Units and counts of the good events among `lines`, and how many lines are done with."""
        units = np.empty(len(lines), dtype=UNIT)
        counts = np.empty((len(lines), 2))
        self._last_time_s = float(self._memory[0]["row_time_s"])
        self._memory["restart_rows"] = self._rows_since(arrival_ns, len(lines))
        found, done = account(lines, hold_from, self._memory, self._rules, units, counts)
        return units[:found], counts[:found], done

    def _rows_since(self, arrival_ns: int, samples: int) -> int:
        """Rows that the host's clock has room for since the last good event, less those that came."""
        if self._arrival_ns is None:
            return 0
        elapsed = round((arrival_ns - self._arrival_ns) * 1e-9 * self._rate_hz)
        return min(max(elapsed - samples, 0), int(self._rules[0]["max_gap"]))


def _rules(rate_hz: float, overload_count: float, max_gap_s: float) -> NDArray[np.void]:
    rules = np.zeros(1, dtype=RULES)
    rules["place"] = BY_TIME
    rules["period_s"] = 1 / rate_hz
    rules["unit_s"] = rules["clock_step_s"] = 1 / TICKS_PER_S
    rules["time_wrap"] = float((1 << 32) * TICKS_PER_S)
    rules["max_gap"] = max_gap_s * rate_hz
    rules["overload_count"] = overload_count
    return rules


def rate_of_events(data: bytes) -> float | None:
    """Samples a second that the device's own times show; None while there are too few events."""
    lines = np.empty(2 * len(data) // LENGTH + 2, dtype=LINE)
    buffer = np.frombuffer(data, dtype=np.uint8)
    found, _, _, _ = find_events(buffer, np.zeros(2, dtype=np.int64), 0, lines)
    times = lines["time"][:found][lines["good"][:found] != 0]
    return rate_of_steps(np.diff(times) / TICKS_PER_S, 1 / TICKS_PER_S)


def compile_decoder() -> None:
    """Compile what the decoder needs, or load it, so that no stream waits for it."""
    for _ in EventDecoder(1.0).feed(encode_events(np.zeros(1), np.zeros((1, 2))).tobytes(), 0):
        pass
