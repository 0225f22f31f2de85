"""Drill: rubbish through each decoder; `python -m tests.drills.hostile_bytes --megabytes 1000`.

Nothing may crash or hang, memory stays bounded, the first good frame after the rubbish is found, and no frame
with a checksum gives samples that were never sent, apart from the one in 65,536 that chance lets pass.
"""

import argparse
import random
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from drivers.csv_lines.columns import Column, LineFormat
from drivers.csv_lines.frames import LineDecoder, encode_lines
from drivers.gsv.frames import FrameDecoder as GsvDecoder
from drivers.gsv.frames import encode_frames as encode_gsv
from drivers.gsv.layout import FrameLayout
from drivers.harp.frames import EventDecoder, encode_events
from drivers.slipstand_binary.frames import FrameDecoder, encode_frame
from drivers.stream import Decoder

RATE_HZ = 1000.0
PIECE_BYTES = 1 << 16
GOOD_FRAMES = 40
"""Good frames after the rubbish, of which the decoder must give the samples of all but the first few; one
more follows, since some protocols tell the end of a frame by the next one."""
GIVEN_UP_FRAMES = 3
HELD_BYTES_MAX = 1 << 12
CRC_CHANCE = 1 / 65_536
CHECKED = LineFormat((Column.TIME_US, Column.TABLE, Column.RELATIVE, Column.CRC))
PLAIN = LineFormat()
GSV = FrameLayout(2)
_MUTATIONS_A_STREAM = 1000


@dataclass(slots=True)
class HostileReport:
    """What came of it."""

    decoder: str
    megabytes: float = 0.0
    frames: int = 0
    samples_of_rubbish: int = 0
    never_sent: int = 0
    held_bytes: int = 0
    seconds: float = 0.0
    faults: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        said = (
            f"{self.decoder}: {self.megabytes:.0f} MB of random bytes ({self.samples_of_rubbish} samples),"
            f" {self.frames} mutated frames ({self.never_sent} samples that were never sent),"
            f" {self.held_bytes} bytes held at most, {self.seconds:.0f} s; {len(self.faults)} faults"
        )
        return "\n".join([said, *self.faults])


@dataclass(frozen=True, slots=True)
class Speaker:
    """A protocol: what its frames are, and what decodes them."""

    name: str
    decoder: Callable[[], Decoder]
    frame: Callable[[int, np.ndarray], bytes]
    """From a sample's index and its counts (1, 2)."""
    has_checksum: bool
    count_bits: int = 24


SPEAKERS = (
    Speaker(
        "slipstand-binary",
        lambda: FrameDecoder(RATE_HZ),
        lambda index, counts: encode_frame(index, round(index * 1e6 / RATE_HZ), counts),
        has_checksum=True,
    ),
    Speaker(
        "csv with checksum",
        lambda: LineDecoder(CHECKED, RATE_HZ),
        lambda index, counts: b"".join(encode_lines(CHECKED, np.array([index / RATE_HZ]), counts)),
        has_checksum=True,
    ),
    Speaker(
        "csv",
        lambda: LineDecoder(PLAIN, RATE_HZ),
        lambda index, counts: b"".join(encode_lines(PLAIN, np.array([index / RATE_HZ]), counts)),
        has_checksum=False,
    ),
    Speaker(
        "gsv",
        lambda: GsvDecoder(GSV, RATE_HZ),
        lambda _, counts: encode_gsv(GSV, counts).tobytes(),
        has_checksum=False,
    ),
    Speaker(
        "harp",  # the sum of its bytes modulo 256 is no checksum that this drill could count on
        lambda: EventDecoder(RATE_HZ),
        lambda index, counts: encode_events(np.array([index / RATE_HZ]), counts).tobytes(),
        has_checksum=False,
        count_bits=16,
    ),
)


def hostile_bytes(speaker: Speaker, megabytes: float, frames: int, seed: int = 0) -> HostileReport:
    """Feed rubbish to a decoder of `speaker`.

    Parameters
    ----------
    speaker : Speaker
    megabytes : float
        Random bytes, in reads of all sizes.
    frames : int
        Frames of which each is mutated: bits flipped, bytes lost, put in, doubled, swapped, cut.
    seed : int
        Makes it repeatable.
    """
    report = HostileReport(speaker.name, megabytes, frames)
    start = time.process_time()
    _random_bytes(speaker, round(megabytes * 1e6), np.random.default_rng(seed), report)
    for stream in range(-(-frames // _MUTATIONS_A_STREAM)):
        count = min(_MUTATIONS_A_STREAM, frames - stream * _MUTATIONS_A_STREAM)
        _mutated(speaker, count, random.Random(seed * 1_000_003 + stream), report)
    allowed = 10 + 5 * frames * CRC_CHANCE
    if speaker.has_checksum and report.never_sent > allowed:
        report.faults.append(f"{report.never_sent} samples were taken for good that were never sent")
    report.seconds = time.process_time() - start
    return report


def _random_bytes(speaker: Speaker, size: int, rng: np.random.Generator, report: HostileReport) -> None:
    decoder = speaker.decoder()
    arrival_ns = 0
    while size > 0:
        data = rng.bytes(min(size, int(rng.integers(1, PIECE_BYTES))))
        size -= len(data)
        arrival_ns += 10_000_000
        report.samples_of_rubbish += sum(len(block.counts) for block in decoder.feed(data, arrival_ns))
        report.held_bytes = max(report.held_bytes, len(decoder._rest))
    if report.held_bytes > HELD_BYTES_MAX:
        report.faults.append(f"{report.held_bytes} bytes were held")
    _check_recovery(speaker, decoder, arrival_ns, "random bytes", report)


def _check_recovery(
    speaker: Speaker, decoder: Decoder, arrival_ns: int, after: str, report: HostileReport
) -> None:
    """Good frames that follow must give their samples."""
    sent = np.arange(2 * GOOD_FRAMES + 2, dtype=np.int32).reshape(-1, 2) + (1 << speaker.count_bits - 3)
    wire = b"".join(speaker.frame(500_000 + i, sent[i : i + 1]) for i in range(len(sent)))
    found = [block.counts for block in decoder.feed(wire, arrival_ns + 50_000_000)]
    given = {tuple(row) for counts in found for row in counts.tolist()}
    lost = [row for row in sent.tolist()[GIVEN_UP_FRAMES:GOOD_FRAMES] if tuple(row) not in given]
    if lost:
        report.faults.append(f"after {after}, {len(lost)} of {GOOD_FRAMES} good frames were not found")


def _mutated(speaker: Speaker, count: int, rng: random.Random, report: HostileReport) -> None:
    largest = 1 << speaker.count_bits - 1
    counts = np.array([[rng.randrange(-largest, largest) for _ in range(2)] for _ in range(count)], np.int32)
    sent = {tuple(row) for row in counts.tolist()}
    wire = b"".join(mutate(speaker.frame(i, counts[i : i + 1]), rng) for i in range(count))
    decoder, place, arrival_ns = speaker.decoder(), 0, 0
    while place < len(wire):
        size = rng.randrange(1, 4000)
        arrival_ns += round(size * 5e4)
        for block in decoder.feed(wire[place : place + size], arrival_ns):
            good = block.counts[(block.status & 3) == 0]
            report.never_sent += sum(tuple(row) not in sent for row in good.tolist())
        place += size
    _check_recovery(speaker, decoder, arrival_ns, "mutated frames", report)


def mutate(frame: bytes, rng: random.Random) -> bytes:
    """A frame with one to four faults."""
    data = bytearray(frame)
    for _ in range(rng.choice((1, 1, 2, 4))):
        place = rng.randrange(len(data)) if data else 0
        match rng.randrange(6):
            case 0 if data:
                data[place] ^= 1 << rng.randrange(8)
            case 1 if data:
                del data[place : place + rng.randrange(1, 5)]
            case 2:
                data[place:place] = rng.randbytes(rng.randrange(1, 5))
            case 3:
                data[place:place] = data[place : place + rng.randrange(1, 9)]
            case 4 if data:
                data[place] = rng.randrange(256)
            case 5:
                del data[place:]
    return bytes(data)


def main() -> int:
    """Run the drill, and say what came of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--megabytes", type=float, default=1000.0)
    parser.add_argument("--frames", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    reports = [
        hostile_bytes(speaker, options.megabytes, options.frames, options.seed) for speaker in SPEAKERS
    ]
    sys.stdout.write("\n".join(map(str, reports)) + "\n")
    return 1 if any(report.faults for report in reports) else 0


if __name__ == "__main__":
    sys.exit(main())
