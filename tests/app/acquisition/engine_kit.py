"""Shared by the tests of the engine: a simulated stand, a connection, and waiting."""

import contextlib
import time
from pathlib import Path

import numpy as np

from app.acquisition.engine_client import EngineClient, record_runs
from app.acquisition.messages import (
    Connected,
    Failed,
    PortSettings,
    PullbackState,
    RunEnded,
    RunSettings,
    StateChanged,
)
from app.runs.reader import Run, load_counts, open_run
from app.simulated_stand.client import SimulatedStand
from app.simulated_stand.options import Gesture, SimulatedStandOptions
from app.simulated_stand.truth import Truth
from config.files import settings_file
from tests.waiting import PATIENCE_S, wait_until

QUICK = {"rest_s": 0.5, "pull_s": 0.3, "hold_s": 0.4, "decay_s": 1.6, "recentre_s": 0.4, "rate_hz": 1000.0}
RELEASE_S = 1.2
CHECKED_CSV = {"columns": "time_us,table,relative,crc"}
FILES = (str(settings_file("stand.toml")), str(settings_file("gauges.toml")))


def stand(**options) -> SimulatedStand:
    return SimulatedStand.start(SimulatedStandOptions(**(QUICK | {"seed": 1} | options)))


def port_of(simulated: SimulatedStand, protocol="slipstand-binary", **settings) -> PortSettings:
    return PortSettings(url=simulated.port, protocol=protocol, **settings)


def run_in(folder: Path, **settings) -> RunSettings:
    return RunSettings(**({"directory": str(folder), "series": "1FFM0", "duration_s": 0.5} | settings))


def connect(port: PortSettings) -> EngineClient:
    engine = EngineClient.start(port, *FILES)
    until(engine, Connected)
    return engine


def until(engine: EngineClient, kind, **fields):
    """Events up to the first of a kind with these fields; that one is returned."""
    end_s = time.perf_counter() + PATIENCE_S
    while time.perf_counter() < end_s:
        event = engine.wait(0.1)
        if isinstance(event, kind) and all(getattr(event, name) == value for name, value in fields.items()):
            return event
        assert not isinstance(event, Failed), event
    raise AssertionError(f"no {kind.__name__} {fields} within {PATIENCE_S:g} s")


def pull_when_asked(engine: EngineClient, simulated: SimulatedStand) -> None:
    """Pull a stand that is `on_demand` once, when the engine asks the operator to."""
    until(engine, StateChanged, state=PullbackState.PULLING)
    simulated.ask(Gesture.PULL)


def index_of_first(run: Run, truth: Truth) -> int:
    """Device sample that a run begins with: its counts appear only there in the stand's own signal."""
    from app.simulated_stand.motion import RepeatedPullback, released_motion
    from app.simulated_stand.signal import StandSignal
    from config.files import load_gauges

    motion = RepeatedPullback(
        truth.stand.pullback_m, released_motion(truth.stand, truth.timetable), truth.timetable
    )
    signal_at = StandSignal(motion, load_gauges(), truth.options, truth.wire.true_rate_hz)
    sent, _ = signal_at.take(truth.wire.samples)
    counts, good = load_counts(run), run.status & 3 == 0
    first_good = int(np.flatnonzero(good)[0])
    (start,) = np.flatnonzero((sent == counts[first_good]).all(axis=1)) - first_good
    np.testing.assert_array_equal(counts[good], sent[start : start + len(counts)][good])
    return int(start)


def lost_within(truth: Truth, first: int, end: int) -> int:
    """Samples that the truth calls damaged or lost, between two device samples."""
    lost = {d.first_index + k for d in truth.wire.damage for k in range(d.samples)}
    return sum(first <= index < end for index in lost)


def record_run(
    port: PortSettings, run: RunSettings, stand_file: str, gauges_file: str, on_event=None
) -> RunEnded:
    """Record one run and wait for its end."""
    with contextlib.closing(record_runs(port, run, stand_file, gauges_file, on_event)) as runs:
        return next(runs)


def closed_run(folder: Path) -> Run:
    """Wait for the one run of a folder to be complete."""
    wait_until(
        lambda: [path.suffix for path in folder.iterdir()] == [".h5"], lambda: list(folder.iterdir()), 0.05
    )
    return open_run(next(folder.glob("*.h5")))
