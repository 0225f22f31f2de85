"""The engine's memory does not grow while it reads hours of samples."""

import gc
import sys
import time
from concurrent.futures import Future
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from app.acquisition.engine import Engine
from app.acquisition.live_client import LiveIdentifier
from app.acquisition.messages import (
    Arm,
    Connect,
    Health,
    PortSettings,
    PullbackState,
    Quit,
    RunEnded,
    RunSettings,
    StateChanged,
)
from app.acquisition.ring import create_ring
from app.acquisition.stream.connection import ReadQueue
from app.acquisition.stream.live_stream import LiveStream
from app.runs.blocks import StoredRun
from config.files import load_gauges, load_stand
from drivers.devices.slipstand_binary.codec import encode_frames
from drivers.devices.slipstand_binary.source import make_source
from drivers.host_time import host_ns
from drivers.port import PortInfo

RATE_HZ = 100.0
READ_SAMPLES = 10
READ_NS = round(READ_SAMPLES / RATE_HZ * 1e9)
SETTLED_READS, ALL_READS = 2_000, 8_000
"""The history, and the stretches of the fitted clock, are full by then; 13 minutes in all."""
READS_A_STEP = 16
QUIET_READS, COMMIT_S = 64, 0.3
"""Rows are held until the journal is on the disk: before each measurement, reads come no faster than that."""
BLOCKS_MAX = 600
"""Python's own blocks that may come and go. One kept of each read would be 6000, of each second 600."""


class Connection:
    """A device that is read by nobody but this test."""

    port = SimpleNamespace(url="fake://", info=PortInfo("fake://"))
    ended = None

    def __init__(self) -> None:
        self.opened_ns = self.start_ns = host_ns()  # of now: what came minutes ago would be called silence
        self.last_poll_ns = self.start_ns + 10**15

    def close(self, *, stop_device: bool = False) -> None: ...


class Owner:
    """Gives the commands, and before it is asked for the next one the reads that came meanwhile."""

    is_closed = False

    def __init__(self, intake: ReadQueue, folder: Path, began_ns: int) -> None:
        self._intake = intake
        self._began_ns = began_ns
        self._arm = Arm(RunSettings(str(folder), series="1FFM0", trigger="none", duration_s=7200.0), 1)
        self._quit = Quit()
        self._reads = 0
        self._is_recording = False
        self.blocks = {}
        self.events = []

    def wait(self, timeout_s: float) -> None:
        """A command is there at once."""

    def take(self, timeout_s: float = 0.0):
        if self._arm:
            arm, self._arm = self._arm, None
            return arm
        if self._reads in (SETTLED_READS, ALL_READS):
            gc.collect()
            self.blocks[self._reads] = sys.getallocatedblocks()
        if self._reads >= ALL_READS:
            quit_, self._quit = self._quit, None
            return quit_
        if not self._intake.is_empty:  # on a busy computer: no faster than the engine takes them
            return None
        if self._reads and not self._is_recording:  # the journal is being created
            return None
        if any(mark - QUIET_READS <= self._reads < mark for mark in (SETTLED_READS, ALL_READS)):
            time.sleep(COMMIT_S)
        for _ in range(READS_A_STEP):
            self._intake.put(self._began_ns + self._reads * READ_NS, frames(self._reads))
            self._reads += 1
        return None

    def send(self, event) -> None:
        if isinstance(event, StateChanged) and event.state is PullbackState.RECORDING:
            self._is_recording = True
        if not isinstance(event, Health):
            self.events.append(event)


def frames(read: int) -> bytes:
    index = np.arange(read * READ_SAMPLES, (read + 1) * READ_SAMPLES)
    counts = np.stack([index % 1000, -(index % 1000)], axis=1).astype(np.int32)
    times_us = np.array([read * READ_NS // 1000])
    return encode_frames(int(index[0]), times_us, counts).tobytes()


class CountingWriter:
    """Takes rows and forgets them."""

    failure = None
    start = classmethod(lambda cls: cls())

    def __init__(self) -> None:
        self.rows = 0

    def open(self, request) -> Future:
        return done(Path("/runs/run.h5"))

    def append(self, block) -> None:
        self.rows += len(block)

    def close(self, ending) -> Future:
        return done(StoredRun("/runs/run.h5", self.rows, True))

    def stop(self) -> None: ...


def done(value) -> Future:
    future = Future()
    future.set_result(value)
    return future


def test_what_an_engine_holds_does_not_grow_with_the_run(tmp_path, monkeypatch):
    monkeypatch.setattr("app.acquisition.engine.WriterClient", CountingWriter)
    monkeypatch.setattr(LiveIdentifier, "prepare", lambda _: None)
    source, intake = make_source({}, RATE_HZ), ReadQueue()
    source.prepare()
    connection = Connection()
    owner = Owner(intake, tmp_path, connection.start_ns)
    with create_ring(tmp_path / "live.ring", 1 << 12, RATE_HZ, load_gauges()) as ring:
        stream = LiveStream(connection, source, intake, load_gauges(), None)
        connect = Connect(PortSettings("fake://", "slipstand-binary"), "", "", low_latency=True)
        Engine(connect, load_stand(), load_gauges(), stream, ring, owner, owner).run()
    (ended,) = [event for event in owner.events if isinstance(event, RunEnded)]
    assert ended.samples == pytest.approx(ALL_READS * READ_SAMPLES, abs=READS_A_STEP * READ_SAMPLES)
    assert owner.blocks[ALL_READS] - owner.blocks[SETTLED_READS] < BLOCKS_MAX
    assert not list(tmp_path.glob("*.journal"))
