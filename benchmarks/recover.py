"""Rebuilding the run of an hour from its journal: `python benchmarks/recover.py [--minutes M] [--rate HZ]`.

The journal is as a killed engine leaves it: a run of trigger `none`, reads of 20 ms, a mark each second,
no end. Beside it what cannot be done without: its records read and checked, its bytes decoded in one
piece, and its columns and bytes written by h5py.
"""

import argparse
import datetime
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import msgspec
import numpy as np

from app.acquisition.journal.records import JournalHeader, Known, Mark, Opened
from app.acquisition.journal.recovery import Recovery, RecoveryState, recover_folder
from app.acquisition.messages import PortSettings, RunSettings
from app.runs.blocks import BlockLayout
from app.runs.journal import MAGIC, RecordKind, encode_record, read_journal
from app.runs.metadata import create_metadata
from app.runs.reader import load_counts, open_run
from config.files import load_gauges, load_stand
from drivers.clock import TimeBase
from drivers.devices.slipstand_binary.codec import encode_frames
from drivers.registry import find_driver

PER_FRAME = 10
READ_S = 0.02
FIRST_READ_NS = 1_000_000_000


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--rate", type=float, default=2000.0, help="Hz")
    options = parser.parse_args()
    samples = round(options.minutes * 60.0 * options.rate / PER_FRAME) * PER_FRAME
    counts = np.random.default_rng(1).integers(-(1 << 22), 1 << 22, (samples, 2), dtype=np.int32)
    with tempfile.TemporaryDirectory() as place:
        journal = Path(place) / "20260101T000000.journal"
        write_journal(journal, counts, options.rate)
        found: list[Recovery] = []
        rows = floor(journal, counts, options.rate)
        rows.append(("recover", *timed(lambda: found.extend(recover_folder(journal.parent)))))
        check(found, counts)
    print(f"| {options.minutes:g} minutes at {options.rate:g} Hz | processor time, s | elapsed, s |")
    print("|---|---|---|")
    for name, processor_s, elapsed_s in rows:
        print(f"| {name} | {processor_s:.2f} | {elapsed_s:.2f} |")


def write_journal(path: Path, counts: np.ndarray, rate_hz: float) -> None:
    """What an engine would have written until it was killed."""
    start = datetime.datetime.now().astimezone()
    metadata = create_metadata(load_stand(), load_gauges(), start, series="1FFM0", rate_hz=rate_hz)
    run = RunSettings(directory=str(path.parent), trigger="none")
    port = PortSettings("port", "slipstand-binary", rate_hz=rate_hz)
    with path.open("wb") as file:
        file.write(MAGIC)

        def note(content: JournalHeader | Opened | Mark) -> None:
            file.write(encode_record(msgspec.json.encode(content), FIRST_READ_NS, RecordKind.NOTE))

        note(JournalHeader(port, run, metadata, "6b1f0f6e-0000-4000-8000-000000000002", "benchmark"))
        note(Opened(0, start, BlockLayout(), 0))
        sent, marked = 0, 0
        for number, data in enumerate(reads(counts, rate_hz)):
            file.write(encode_record(data, FIRST_READ_NS + round(number * READ_S * 1e9)))
            sent += len(data)
            whole = sent // frame_bytes() * PER_FRAME
            if whole >= marked:
                note(Mark(whole, 0, Known(), TimeBase()))
                marked += round(rate_hz)


def reads(counts: np.ndarray, rate_hz: float) -> list[bytes]:
    """The bytes of all samples, cut wherever the clock says."""
    times_us = np.arange(len(counts) // PER_FRAME) * round(PER_FRAME * 1e6 / rate_hz)
    data = encode_frames(0, times_us, counts).tobytes()
    size = round(rate_hz * READ_S / PER_FRAME * frame_bytes()) + 1  # hardly ever a whole frame
    return [data[first : first + size] for first in range(0, len(data), size)]


def frame_bytes() -> int:
    return len(encode_frames(0, np.zeros(1, int), np.zeros((PER_FRAME, 2), np.int32)).tobytes())


def floor(journal: Path, counts: np.ndarray, rate_hz: float) -> list[tuple[str, float, float]]:
    """What the parts take alone."""
    data = b"".join(record.data for record in read_journal(journal) if record.kind is RecordKind.WIRE)
    source = find_driver("slipstand-binary").make_source({}, rate_hz)
    source.prepare()
    return [
        ("reading and checking the records once", *timed(lambda: sum(1 for _ in read_journal(journal)))),
        ("decoding all bytes in one piece", *timed(lambda: list(source.decode(data, FIRST_READ_NS)))),
        ("writing columns and bytes by h5py", *timed(lambda: write_plain(journal.parent, counts, data))),
    ]


def write_plain(folder: Path, counts: np.ndarray, data: bytes) -> None:
    """Columns like those of a run, and the bytes packed as in one."""
    with h5py.File(folder / "plain", "w") as file:
        for name in ("time", "table", "relative"):
            file.create_dataset(name, data=np.arange(len(counts)) * 1e-3, chunks=(8192,))
        file.create_dataset("status", data=np.zeros(len(counts), np.uint8), chunks=(8192,))
        for channel in range(2):
            file.create_dataset(f"counts_{channel}", data=counts[:, channel], chunks=(8192,))
        packed = {"compression": "gzip", "compression_opts": 1}
        file.create_dataset("wire", data=np.frombuffer(data, np.uint8), chunks=(1 << 18,), **packed)


def check(found: list[Recovery], counts: np.ndarray) -> None:
    """Refuse figures of a run that is not whole."""
    (recovery,) = found
    if recovery.state is not RecoveryState.RECOVERED:
        raise SystemExit(f"not recovered: {recovery}")
    stored = load_counts(open_run(recovery.run, trusted=True))
    if stored is None or not np.array_equal(stored, counts):
        raise SystemExit(f"{recovery.samples} samples recovered that are not the {len(counts)} sent")


def timed(work: Callable[[], Any]) -> tuple[float, float]:
    """Processor time and elapsed time, s."""
    processor_s, start_s = time.process_time(), time.perf_counter()
    work()
    return time.process_time() - processor_s, time.perf_counter() - start_s


if __name__ == "__main__":
    main()
