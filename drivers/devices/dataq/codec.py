"""Scans of a DATAQ instrument, encoded and decoded: readings of 16 bits, one channel after the other.

A scan has no mark, no number and no checksum. What shows where it begins are bits that are always 0, and the
digital inputs, which hardly change (DATAQ, "Command Protocol", 1 August 2019, pages 61 to 68).
"""

import re
from dataclasses import dataclass

import numpy as np

from drivers.arrays import Counts, Int32s, Ints, Records, UInt8s
from drivers.compiled import compiled, inlined
from drivers.devices.dataq.commands import MODELS, OVERFLOW
from drivers.packets import (
    MAX_GAP_S,
    PACKET,
    LossEstimator,
    PacketDecoder,
    count_estimated_packets,
    frames_in,
    state_type,
)
from drivers.samples import overload_status
from messages.i18n import N_
from messages.message import Message, message

FOLLOWING = 3
"""Scans that must follow a good one until its readings are given."""
HIGHEST = 2047 << 4
"""Readings of this size and more are overload: the largest of 12 bits. Those of 14 and 16 bits are 12 and 15
larger."""
LOWEST = -(1 << 15)
_DIGITAL_KEPT_BYTES = 4096
"""Bytes without a scan for which the digital inputs are taken to be as they were; about a second."""
_SURE_SHARE = 0.75
"""Of the bytes, in good scans, of a stream whose layout is known by its fixed bits."""
_TO_BE_ESTIMATED = -1
_SIGN = 0x80


@dataclass(frozen=True, slots=True)
class ScanLayout:
    """What all scans of a stream share. The first word is the table gauge, the second the relative gauge."""

    zeros: bytes
    """Bits of each byte that are 0 in every scan."""
    digital: bytes
    """Bits that are digital inputs, all in one byte; copies of them are left out."""
    digital_word: int
    """Word that holds them."""
    open_inputs: int
    """Its bits while nothing is wired to the inputs: they are pulled up."""

    @property
    def length(self) -> int:
        return len(self.zeros)


PLAIN = ScanLayout(bytes.fromhex("0c000f00"), bytes.fromhex("03000000"), 0, 0x0003)
"""Of the DI-1100: 12 bits left-justified, digital inputs in the low bits of the first word (page 61)."""
WITH_DIGITAL = ScanLayout(bytes.fromhex("00000000fc80"), bytes.fromhex("00000000007f"), 2, 0x7F00)
"""Of the others, the digital inputs being the third word (pages 63 to 67)."""
_MARKS = re.compile(re.escape(OVERFLOW) + rb"|info 1 (\d{4})\r")


def layout_of(model: str) -> ScanLayout:
    """Layout of the scans of a model of `MODELS`."""
    return WITH_DIGITAL if MODELS[model].has_digital_word else PLAIN


def header(model: str) -> bytes:
    """What is put before a stream: the reply to `info 1`, after which the next byte begins a scan."""
    return b"info 1 %b\r" % model.encode("ascii")


def layout_in_header(data: bytes) -> ScanLayout | None:
    """Layout of the stream by the header in `data`; None without one of a known model."""
    found = re.search(rb"info 1 (\d{4})\r", data)
    model = found[1].decode("ascii") if found else ""
    return layout_of(model) if model in MODELS else None


def find_layout(data: bytes) -> ScanLayout | None:
    """Layout by the fixed bits of `data`; None where most of them are not scans of any.

    Only open digital inputs are known by it: a stream whose fixed bits are all 0 could be any, and so could
    one that repeats itself.
    """
    for layout in (WITH_DIGITAL, PLAIN):
        if data[layout.length :] == data[: -layout.length]:
            continue
        decoder = ScanDecoder(layout, 1.0)
        bytes_of_scans = sum(map(len, decoder.feed(data, 0))) * layout.length
        held = (FOLLOWING + 1) * layout.length
        if decoder.inputs_are_open and bytes_of_scans >= _SURE_SHARE * (len(data) - held):
            return layout
    return None


def left_justified(counts: Counts, bits: int) -> Ints:
    """Readings of a converter of `bits` as it sends them, limited to 16 bits, its low bits 0."""
    whole = np.clip(np.rint(counts), LOWEST, -LOWEST - 1).astype(np.int64)
    return whole & -(1 << 16 - bits)


def encode_scans(layout: ScanLayout, counts: Counts, bits: int = 16) -> UInt8s:
    """Scans of an instrument of `bits` while its digital inputs are open, as (n, length) uint8.

    `counts` (n, 2) are table and relative.
    """
    words = np.zeros((len(counts), layout.length // 2), dtype=np.int64)
    words[:, :2] = left_justified(counts, bits)
    words[:, layout.digital_word] |= layout.open_inputs
    return words.astype("<i2").view(np.uint8)


class ScanDecoder(PacketDecoder):
    """Bytes to sample blocks. Readings are int16 as sent, left-justified, digital inputs taken out.

    A scan is good if its fixed bits and those of the next three are right, so it is given after these. Where
    they are wrong, the scan is searched for byte by byte, and rows stand for the bytes between. A loss of
    exactly the length of scans leaves no trace but the time: it is estimated from the host's clock, in
    `losses` alone. After an overflow, a new header or a broken connection, rows stand for the time until the
    next scan.
    """

    _has_time = False

    def __init__(self, layout: ScanLayout, rate_hz: float, max_gap_s: float = MAX_GAP_S) -> None:
        super().__init__(STATE, rate_hz, max_gap_s)
        self._layout = layout
        self._zeros = np.frombuffer(layout.zeros, dtype=np.uint8)
        self._digital = np.frombuffer(layout.digital, dtype=np.uint8)
        self._inputs = np.zeros(layout.length, dtype=np.uint8)
        self._loss_estimator = LossEstimator(rate_hz)
        self._overflows = 0

    @property
    def inputs_are_open(self) -> bool:
        """Whether the digital inputs of the last scan are those of which nothing is wired to."""
        word = int(self._inputs.view("<u2")[self._layout.digital_word])
        return word & self._layout.open_inputs == self._layout.open_inputs

    def take_warnings(self) -> list[Message]:
        overflows, self._overflows = self._overflows, 0
        template = N_(
            "the instrument ran out of room and stopped, since this computer read too late; it was started"
            " again: close other programs, or lower the rate"
        )
        return [message(template)] if overflows else []

    def _find_packets(self, data: bytes, arrival_ns: int) -> tuple[Records, Counts]:
        packets: list[Records] = []
        counts: list[Int32s] = []
        at = 0
        for mark in _MARKS.finditer(data):
            piece = data[at : mark.start()]
            packets.append(self._find_scans(piece, counts))
            self._state["discarded_bytes"] += len(self._unfinished)
            self._state["garbage"] = self._state["is_aligned"] = 0
            self._state["restarting"] = self._state[0]["started"]
            self._overflows += mark[0] == OVERFLOW
            at = mark.end()
        packets.append(self._find_scans(data[at:], counts))
        found = np.concatenate(packets)
        if len(found):
            self._add_gap(found, arrival_ns)
            count_estimated_packets(found, self._state)
        return found, np.concatenate(counts)

    def _find_scans(self, data: bytes, counts: list[Int32s]) -> Records:
        """Packets of the scans in `data`, whose readings are added to `counts`; keeps the rest."""
        buffer = np.frombuffer(data, dtype=np.uint8)
        readings = np.empty((len(data) // self._layout.length, 2), dtype=np.int32)
        broken = np.empty(len(readings), dtype=np.int64)
        is_first = not self._state[0]["started"]
        found, used = find_scans(
            buffer, self._zeros, self._digital, self._inputs, self._state, readings, broken
        )
        self._unfinished = data[used:]
        readings = readings[:found]
        packets = np.zeros(found, dtype=PACKET)
        packets["samples"] = 1
        packets["damaged"] = broken[:found]
        packets["status"] = overload_status(np.abs(readings) >= HIGHEST)
        if is_first:
            packets["damaged"][:1] = 0
        elif found and self._state[0]["restarting"]:
            packets["damaged"][0], packets["missing"][0] = 0, _TO_BE_ESTIMATED
            self._state["restarts"] += 1
            self._state["restarting"] = 0
        counts.append(readings)
        return packets

    def _add_gap(self, packets: Records, arrival_ns: int) -> None:
        """Rows for the time until the first packet after a restart; further ones in one read share it."""
        restarted = np.flatnonzero(packets["missing"] == _TO_BE_ESTIMATED)
        packets["missing"][restarted] = 0
        packets["missing"][restarted[:1]] = self._rows_since(arrival_ns, len(packets))


STATE = state_type("garbage is_aligned", "")
"""What the decoder keeps between calls: bytes since the last good scan, and whether the last of them show
where the next one begins."""


@compiled
def find_scans(
    buffer: UInt8s,
    zeros: UInt8s,
    digital: UInt8s,
    inputs: UInt8s,
    states: Records,
    readings: Int32s,
    broken: Ints,
) -> tuple[int, int]:
    """Readings (n, 2) of the good scans in `buffer`, and how many scans came broken before each (n,).

    The first scan after other bytes is not given: bytes may be missing in its readings, before the bits that
    show where it is.

    `zeros` and `digital` (length,) are those of the layout, `inputs` (length,) the digital inputs of the last
    good scan. Returns the number of scans and the number of bytes that were used. `states` (1,) is updated.
    """
    state, length = states[0], len(zeros)
    at = found = 0
    while at + (FOLLOWING + 1) * length <= len(buffer):
        if _is_good(buffer, at, zeros, digital, inputs, state.started, state.garbage):
            is_proven = state.garbage == 0 or state.is_aligned
            if is_proven:
                for gauge in range(2):
                    low = buffer[at + 2 * gauge] & ~(zeros[2 * gauge] | digital[2 * gauge])
                    high = np.int32(buffer[at + 2 * gauge + 1])
                    readings[found, gauge] = low + 256 * (high if high < _SIGN else high - 2 * _SIGN)
                broken[found] = frames_in(state.garbage, length)
                found += 1
            for k in range(length):
                inputs[k] = buffer[at + k] & digital[k]
            state.started = 1
            state.garbage = 0 if is_proven else state.garbage + length
            state.is_aligned = not is_proven
            at += length
        else:
            state.garbage += 1
            state.is_aligned = 0
            at += 1
    state.discarded_bytes += at - found * length
    return found, at


@inlined
def _is_good(
    buffer: UInt8s, at: int, zeros: UInt8s, digital: UInt8s, inputs: UInt8s, is_known: int, garbage: int
) -> bool:
    """Whether a scan and the next three have their zeros, and digital inputs as before or as the last one.

    One input may change at a time; where scans were lost, none, until there was none for long.
    """
    length = len(zeros)
    end = at + FOLLOWING * length
    changed = 0
    for k in range(length):
        changed |= (buffer[end + k] & digital[k]) ^ inputs[k]
    may_change = not is_known or garbage > _DIGITAL_KEPT_BYTES
    may_change = may_change or (garbage == 0 and changed & (changed - 1) == 0)
    for start in range(at, end + 1, length):
        is_same, is_new = is_known != 0, may_change
        for k in range(length):
            if buffer[start + k] & zeros[k]:
                return False
            bits = buffer[start + k] & digital[k]
            is_same = is_same and bits == inputs[k]
            is_new = is_new and bits == buffer[end + k] & digital[k]
        if not (is_same or is_new):
            return False
    return True
