"""Drill: rubbish through each decoder; `python -m tests.drills.hostile_bytes --megabytes 1000`.

Half of the random bytes are drawn from those of good frames. Nothing may crash or hang, memory stays
bounded, the first good frame after the rubbish is found, and no frame with a checksum gives samples that
were never sent, apart from the one in 65,536 that chance lets pass. Each decoder is tried in a process of
its own, whose memory is watched.
"""

import argparse
import random
import subprocess
import sys
import time
from dataclasses import dataclass

import numpy as np

from drivers.envelope import HEADER_BYTES, MAGIC, MAX_DATA_BYTES
from drivers.samples import ABSENT, INCOMPLETE, SampleBlock
from drivers.stream import Decoder
from tests.drills.report import DrillReport
from tests.drills.speakers import SPEAKERS, Speaker

PIECE_BYTES = 1 << 16
GOOD_FRAMES = 40
"""Good frames after the rubbish, of which the decoder must give the samples of all but the first few."""
GIVEN_UP_FRAMES = 3
HELD_BYTES_MAX = 1 << 12
GROWTH_BYTES_MAX = 64_000_000
CRC_CHANCE = 1 / 65_536
_MUTATIONS_A_STREAM = 1000
_LOST = int(ABSENT | INCOMPLETE)


@dataclass(slots=True)
class HostileReport(DrillReport):
    """What came of it."""

    decoder: str
    megabytes: float = 0.0
    frames: int = 0
    samples_of_rubbish: int = 0
    never_sent: int = 0
    held_bytes: int = 0
    growth_bytes: int = 0
    """By which the memory of the process grew at most; 0 where the system does not tell."""
    seconds: float = 0.0

    def figures(self) -> str:
        return (
            f"{self.decoder}: {self.megabytes:g} MB of random bytes ({self.samples_of_rubbish} samples),"
            f" {self.frames} mutated frames ({self.never_sent} samples that were never sent);"
            f" {self.held_bytes} bytes held at most, memory grown by {self.growth_bytes / 1e6:.1f} MB,"
            f" {self.seconds:.0f} s"
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
    _check_recovery(speaker, speaker.decoder(), 0, "nothing", report)  # compiles what must be
    start_s, memory_bytes = time.process_time(), _most_memory_bytes()
    _random_bytes(speaker, round(megabytes * 1e6), np.random.default_rng(seed), report)
    for stream in range(-(-frames // _MUTATIONS_A_STREAM)):
        count = min(_MUTATIONS_A_STREAM, frames - stream * _MUTATIONS_A_STREAM)
        _mutated(speaker, count, random.Random(seed * 1_000_003 + stream), report)
    report.growth_bytes = _most_memory_bytes() - memory_bytes
    report.seconds = time.process_time() - start_s
    _judge(speaker, report)
    return report


def _judge(speaker: Speaker, report: HostileReport) -> None:
    if speaker.has_checksum and report.never_sent > 10 + 5 * report.frames * CRC_CHANCE:
        report.faults.append(f"{report.never_sent} samples were taken for good that were never sent")
    if report.held_bytes > _held_bytes_most(speaker):
        report.faults.append(f"{report.held_bytes} bytes were held")
    if report.growth_bytes > GROWTH_BYTES_MAX:
        report.faults.append(f"memory grew by {report.growth_bytes / 1e6:.0f} MB")


def _held_bytes_most(speaker: Speaker) -> int:
    """One envelope where frames are envelopes: chance lets a damaged length pass its CRC-16."""
    frame, *_ = speaker.frames(0, np.zeros((1, 2), np.int32))
    return HEADER_BYTES + MAX_DATA_BYTES if frame.startswith(MAGIC) else HELD_BYTES_MAX


def _random_bytes(speaker: Speaker, size: int, rng: np.random.Generator, report: HostileReport) -> None:
    """Any bytes, and in every other read bytes such as the protocol's own frames are made of."""
    decoder, number, arrival_ns = speaker.decoder(), 0, 0
    counts = rng.integers(-(1 << 15), 1 << 15, (500, 2), np.int32)
    own = np.frombuffer(b"".join(speaker.frames(0, counts)), np.uint8)
    while size > 0:
        length = min(size, int(rng.integers(1, PIECE_BYTES)))
        data = rng.bytes(length) if number % 2 else rng.choice(own, length).tobytes()
        size -= length
        number += 1
        arrival_ns += 10_000_000
        read = speaker.envelope(number, data)
        for block in decoder.feed(read, arrival_ns):
            report.samples_of_rubbish += int(np.count_nonzero((block.status & _LOST) == 0))
        report.held_bytes = max(report.held_bytes, decoder.unfinished_bytes)
    _check_recovery(speaker, decoder, arrival_ns, "random bytes", report)


def _check_recovery(
    speaker: Speaker, decoder: Decoder, arrival_ns: int, after: str, report: HostileReport
) -> None:
    """Good frames that follow must give their samples."""
    count = GOOD_FRAMES + speaker.following
    sent = np.arange(2 * count, dtype=np.int32).reshape(-1, 2) + (1 << speaker.count_bits - 3)
    frames = speaker.frames(speaker.leap, sent)
    wire = b"".join(speaker.envelope(speaker.leap + i, frame) for i, frame in enumerate(frames))
    blocks = decoder.feed(wire, arrival_ns + 50_000_000)
    given = {row for block in blocks for row in _good(block, speaker.gauges)}
    wanted = map(tuple, sent[GIVEN_UP_FRAMES:GOOD_FRAMES, : speaker.gauges].tolist())
    lost = [row for row in wanted if row not in given]
    if lost:
        report.faults.append(f"after {after}, {len(lost)} of {GOOD_FRAMES} good frames were not found")


def _mutated(speaker: Speaker, count: int, rng: random.Random, report: HostileReport) -> None:
    largest = 1 << speaker.count_bits - 1
    counts = np.array([[rng.randrange(-largest, largest) for _ in range(2)] for _ in range(count)], np.int32)
    sent = set(map(tuple, counts[:, : speaker.gauges].tolist()))
    frames = speaker.frames(0, counts)
    wire = b"".join(speaker.envelope(i, mutate(frame, rng)) for i, frame in enumerate(frames))
    decoder, place, arrival_ns = speaker.decoder(), 0, 0
    while place < len(wire):
        size = rng.randrange(1, 4000)
        arrival_ns += round(size * 5e4)
        for block in decoder.feed(wire[place : place + size], arrival_ns):
            report.never_sent += sum(row not in sent for row in _good(block, speaker.gauges))
        report.held_bytes = max(report.held_bytes, decoder.unfinished_bytes)
        place += size
    _check_recovery(speaker, decoder, arrival_ns, "mutated frames", report)


def _good(block: SampleBlock, gauges: int) -> list[tuple[int, ...]]:
    """Samples of which nothing is said to be lost; a gap of minutes has many of the others."""
    return list(map(tuple, block.counts[(block.status & _LOST) == 0, :gauges].tolist()))


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


def _most_memory_bytes() -> int:
    """What this process has taken at most until now; 0 where the system does not tell."""
    if sys.platform == "win32":
        return 0
    import resource

    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most if sys.platform == "darwin" else 1024 * most


def main() -> int:
    """Run the drill, each decoder in a process of its own, and say what came of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--decoder", choices=SPEAKERS, help="this one alone, in this process")
    parser.add_argument("--megabytes", type=float, default=1000.0)
    parser.add_argument("--frames", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    if options.decoder is None:
        command = [sys.executable, "-m", "tests.drills.hostile_bytes", *sys.argv[1:]]
        return max(subprocess.run([*command, "--decoder", name], check=False).returncode for name in SPEAKERS)
    report = hostile_bytes(SPEAKERS[options.decoder], options.megabytes, options.frames, options.seed)
    sys.stdout.write(f"{report}\n")
    return 1 if report.faults else 0


if __name__ == "__main__":
    sys.exit(main())
