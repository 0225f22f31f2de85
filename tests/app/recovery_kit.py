"""A recording made of device bytes, with the real journal and the real writer, in one process."""

import datetime
import time
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np

from app.acquisition.journal.journal import create_journal
from app.acquisition.journal.records import JournalHeader
from app.acquisition.messages import PortSettings, RunEnded, RunSettings
from app.acquisition.recording import Recording, RecordingContext
from app.acquisition.stream.connection import ReadQueue
from app.acquisition.stream.live_stream import DecodedRead, ReadHistory
from app.runs.blocks import calibrate
from app.runs.metadata import create_metadata
from app.runs.writer_client import WriterClient
from app.simulated_stand.motion import RepeatedPullback, released_motion, stand_truth
from app.simulated_stand.options import SimulatedStandOptions, Timetable
from app.simulated_stand.signal import StandSignal
from config.files import load_gauges, load_stand
from drivers.clock import TimeBase
from drivers.devices.csv_lines.codec import encode_lines
from drivers.devices.csv_lines.columns import LineFormat
from drivers.devices.slipstand_binary.codec import encode_frames
from drivers.registry import find_driver
from drivers.samples import Losses

RATE_HZ = 500.0
TIMETABLE = Timetable(rest_s=0.8, pull_s=0.6, hold_s=0.6, decay_s=3.0, recentre_s=0.5)
RELEASED = round(TIMETABLE.release_s * RATE_HZ)
IDENTIFIER = "6b1f0f6e-0000-4000-8000-000000000001"
TIME_BASE = TimeBase(1.00003, 2e-5)
PER_FRAME = 4


def stand_counts(samples: int) -> np.ndarray:
    options = SimulatedStandOptions(seed=5)
    true = stand_truth(options, load_stand())
    motion = RepeatedPullback(true.pullback_m, released_motion(true, TIMETABLE), TIMETABLE)
    return StandSignal(motion, load_gauges(), options, RATE_HZ).take(samples)[0]


COUNTS = stand_counts(2800)


def wire(protocol: str, faults: int = 0) -> list[bytes]:
    """Frames or lines of all counts; `faults` of them are lost or damaged."""
    times_us = np.arange(len(COUNTS)) * 2000
    if protocol == "csv":
        units = encode_lines(LineFormat(), times_us * 1e-6, COUNTS)
    else:
        frames = encode_frames(7, times_us[::PER_FRAME], COUNTS)
        units = [frame.tobytes() for frame in frames]
    random = np.random.default_rng(1)
    for place in random.choice(np.arange(20, len(units)), faults, replace=False).tolist():
        units[place] = units[place][:-5] + units[place][-4:] if place % 2 else b""
    return units


def reads(units: list[bytes], seed: int = 0, broken_after: int | None = None) -> Iterator[tuple[int, bytes]]:
    """The bytes in pieces of any length, each with its time; one without bytes where the link broke."""
    random = np.random.default_rng(seed)
    data = b"".join(units)
    ns_per_byte = len(COUNTS) / RATE_HZ * 1e9 / len(data)
    start = 0
    while start < len(data):
        end = start + int(random.integers(1, 400))
        if broken_after is not None and start <= broken_after < end:
            yield 10**9 + round(start * ns_per_byte), b""
        yield 10**9 + round(end * ns_per_byte), data[start:end]
        start = end


class Desk:
    """An engine's inside: bytes in, a recording from arming on; `kill` leaves all as a dead engine does."""

    def __init__(self, folder: Path, writer: WriterClient, protocol: str, *, history_s: float = 10.0) -> None:
        self.folder = folder
        self.port = PortSettings("port", protocol)
        self._writer = writer
        self._source = find_driver(protocol).make_source({}, RATE_HZ)
        self._losses = Losses()
        self._gauges = load_gauges()
        self.intake = ReadQueue()
        self.history = ReadHistory(round(history_s * RATE_HZ))
        self.recording: Recording | None = None
        self.journal = folder / "run.journal"

    def arm(self, **settings: object) -> None:
        run = RunSettings(
            **({"directory": str(self.folder), "series": "1FFM0", "duration_s": 1.0} | settings)
        )
        now = datetime.datetime.now().astimezone()
        metadata = create_metadata(
            load_stand(), self._gauges, now, series=run.series, rate_hz=RATE_HZ, operator="J. Ng", note="dry"
        )
        header = JournalHeader(self.port, run, metadata, IDENTIFIER, "test")
        self._journal = create_journal(self.journal, header)
        around = RecordingContext(
            self.intake, self.history, self._writer, lambda *_: TIME_BASE, lambda _: None
        )
        self.recording = Recording(run, metadata, RATE_HZ, self._journal, around)

    def take(self, read: tuple[int, bytes]) -> None:
        self.hear(read)
        self.decode()

    def hear(self, read: tuple[int, bytes]) -> None:
        """What the thread does that reads the port: others may wait to be decoded."""
        self.intake.put(*read)

    def decode(self) -> None:
        read = self.intake.take(0.0)
        assert read is not None
        arrival_ns, data = read.arrival_ns, read.data
        rows = tuple(calibrate(block, self._gauges) for block in self._source.decode(data, arrival_ns))
        before, self._losses = self._losses, Losses(**_fields(self._source.losses))
        chunk = DecodedRead(data, arrival_ns, rows, self._losses - before)
        self.history.add(chunk)
        if self.recording is not None:
            self.recording.add([chunk])
            self.recording.poll()

    def ended(self) -> RunEnded:
        for _ in range(2000):
            if self.recording is not None and (ended := self.recording.poll()):
                return ended
            time.sleep(0.005)
        raise AssertionError("the run was not closed")

    def kill(self) -> None:
        """Stop as a killed engine would, but for what its threads have in hand."""
        time.sleep(0.05)
        while b'"Opened"' in self.journal.read_bytes() and b'"Named"' not in self.journal.read_bytes():
            time.sleep(0.01)
            self.recording.poll()
        self._journal.close()
        self._journal.release()
        self._writer.stop()


def _fields(losses: Losses) -> dict[str, int]:
    return {name: getattr(losses, name) for name in Losses.__slots__}


def datasets(path: Path | str) -> dict[str, np.ndarray]:
    """Everything that a run file holds, by name."""
    found: dict[str, np.ndarray] = {}

    def take(name: str, member: h5py.Dataset | h5py.Group) -> None:
        if isinstance(member, h5py.Dataset):
            found[name] = np.asarray(member[()])
        for key, value in member.attrs.items():
            found[f"{name}@{key}"] = np.asarray(value)

    with h5py.File(path, "r") as file:
        file.visititems(take)
    return found


def assert_same(made: dict[str, np.ndarray], expected: dict[str, np.ndarray]) -> None:
    """Equal to the bit, by name; references between datasets are places in their own file."""
    assert made.keys() == expected.keys()
    for name, values in expected.items():
        assert made[name].dtype == values.dtype, name
        if "DIMENSION_LIST" in name or "REFERENCE_LIST" in name:
            continue
        if values.dtype.kind == "O":
            assert made[name].tolist() == values.tolist(), name
        else:
            assert made[name].tobytes() == values.tobytes(), name
