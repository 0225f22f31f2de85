"""The engine as a process, reading a simulated stand over a real serial line, into real run files."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from app.acquisition.client import EngineClient, record_run
from app.acquisition.errors import EngineFailedError
from app.acquisition.messages import (
    Arm,
    Connected,
    EndReason,
    Failed,
    Health,
    PortSettings,
    PullbackState,
    Quit,
    RunEnded,
    RunSettings,
    RunStarted,
    StateChanged,
    Stop,
)
from app.runs.reader import Run, open_run, read_counts, read_run_wire
from app.simulated_stand.client import SimulatedStand
from app.simulated_stand.options import SimulatedStandOptions
from app.simulated_stand.truth import Truth
from config.files import settings_file
from drivers.samples import SampleStatus

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no pseudo-terminals")

QUICK = {"rest_s": 0.5, "pull_s": 0.3, "hold_s": 0.4, "decay_s": 1.6, "recentre_s": 0.4, "rate_hz": 1000.0}
RELEASE_S = 1.2
CHECKED_CSV = {"columns": "time_us,table,relative,crc"}
FILES = (str(settings_file("stand.toml")), str(settings_file("gauges.toml")))


def stand(**options) -> SimulatedStand:
    return SimulatedStand.start(SimulatedStandOptions(**(QUICK | {"seed": 1} | options)))


@pytest.fixture(scope="module")
def shared():
    """One stand for all tests that leave it as it was."""
    with stand() as simulated:
        yield simulated


def port_of(simulated: SimulatedStand, protocol="slipstand-binary", **settings) -> PortSettings:
    return PortSettings(url=simulated.port, protocol=protocol, **settings)


def run_in(folder: Path, **settings) -> RunSettings:
    return RunSettings(**({"directory": str(folder), "series": "1FFM0", "duration_s": 0.5} | settings))


def connect(port: PortSettings) -> EngineClient:
    engine = EngineClient.start(port, *FILES)
    until(engine, Connected)
    return engine


def until(engine: EngineClient, kind, patience_s=60.0, **fields):
    """Events up to the first of a kind with these fields; that one is returned."""
    deadline = time.monotonic() + patience_s
    while time.monotonic() < deadline:
        event = engine.wait(0.1)
        if isinstance(event, kind) and all(getattr(event, name) == value for name, value in fields.items()):
            return event
        assert not isinstance(event, Failed), event
    raise AssertionError(f"no {kind.__name__} {fields} within {patience_s:g} s")


def index_of_first(run: Run, truth: Truth) -> int:
    """Device sample that a run begins with: its counts appear only there in the stand's own signal."""
    from app.simulated_stand.motion import RepeatedPullback, released_motion
    from app.simulated_stand.signal import StandSignal
    from config.files import load_gauges

    motion = RepeatedPullback(
        truth.stand.pullback_m, released_motion(truth.stand, truth.timetable), truth.timetable
    )
    signal_at = StandSignal(motion, load_gauges(), truth.options, truth.wire.rate_hz)
    sent, _ = signal_at.take(truth.wire.samples)
    counts, good = read_counts(run), run.status & 3 == 0
    first_good = int(np.flatnonzero(good)[0])
    (start,) = np.flatnonzero((sent == counts[first_good]).all(axis=1)) - first_good
    np.testing.assert_array_equal(counts[good], sent[start : start + len(counts)][good])
    return int(start)


def lost_within(truth: Truth, first: int, end: int) -> int:
    """Samples that the truth calls damaged or lost, between two device samples."""
    lost = {d.first_index + k for d in truth.wire.damage for k in range(d.samples)}
    return sum(first <= index < end for index in lost)


def gone(process_id: int, patience_s: float = 20.0) -> bool:
    """Wait until a process has ended; one that waits to be collected has."""
    end = time.monotonic() + patience_s
    while time.monotonic() < end:
        try:
            os.kill(process_id, 0)
        except ProcessLookupError:
            return True
        stat = Path(f"/proc/{process_id}/stat")
        if stat.exists() and stat.read_text().rpartition(")")[2].split()[0] == "Z":
            return True
        time.sleep(0.02)
    return False


def closed_run(folder: Path, patience_s: float = 20.0) -> Run:
    """Wait for the one run of a folder to be complete."""
    end = time.monotonic() + patience_s
    while time.monotonic() < end:
        files = sorted(path.suffix for path in folder.iterdir())
        if files == [".h5"]:
            return open_run(next(folder.glob("*.h5")))
        time.sleep(0.05)
    raise AssertionError(f"no complete run: {list(folder.iterdir())}")


def test_a_pullback_is_recorded_sample_by_sample(tmp_path):
    events = []
    with stand() as simulated:
        ended = record_run(port_of(simulated), run_in(tmp_path), *FILES, events.append)
    truth = simulated.truth()
    assert ended.ended is EndReason.DURATION
    assert (ended.samples, ended.rate_hz, ended.release_s) == (1500, 1000.0, 1.0)
    run = open_run(ended.path)
    first = index_of_first(run, truth)
    assert abs(first - round((RELEASE_S - 1.0) * 1000.0)) <= 2
    assert ended.missing + ended.damaged + ended.missing_estimated == 0
    np.testing.assert_allclose(run.time_s, np.arange(1500) / 1000.0, atol=1e-12)
    assert run.metadata.device.firmware == "simulated-1"
    assert run.metadata.port == simulated.port
    assert len(read_run_wire(run).data) > 1500 * 8
    states = [event.state for event in events if isinstance(event, StateChanged)]
    assert states[:5] == [
        PullbackState.CONNECTING,
        PullbackState.IDLE,
        PullbackState.ZERO,
        PullbackState.PULLING,
        PullbackState.HELD,
    ]
    assert any(isinstance(event, Health) and event.free_disk_bytes > 0 for event in events)
    assert [path.name for path in tmp_path.iterdir()] == [Path(ended.path).name]


def test_lines_of_values_are_recorded_alike(tmp_path):
    with stand(protocol="csv", rate_hz=500.0) as simulated:
        ended = record_run(port_of(simulated, "csv"), run_in(tmp_path), *FILES)
    assert (ended.ended, ended.samples, ended.rate_hz) == (EndReason.DURATION, 750, 500.0)
    first = index_of_first(open_run(ended.path), simulated.truth())
    assert abs(first - round((RELEASE_S - 1.0) * 500.0)) <= 2


@pytest.mark.parametrize("protocol", ["slipstand-binary", "csv"])
def test_every_damaged_sample_is_counted_and_marked(tmp_path, protocol):
    settings = CHECKED_CSV if protocol == "csv" else {}
    with stand(protocol=protocol, drop=0.01, flip=0.01, device=settings) as simulated:
        port = port_of(simulated, protocol, device=settings)
        ended = record_run(port, run_in(tmp_path, duration_s=1.5), *FILES)
    truth, run = simulated.truth(), open_run(ended.path)
    first = index_of_first(run, truth)
    lost = lost_within(truth, first, first + len(run))
    assert lost > 10
    assert ended.missing + ended.missing_estimated + ended.damaged == lost
    assert np.count_nonzero(run.status & (SampleStatus.MISSING | SampleStatus.DAMAGED)) == lost
    assert np.count_nonzero(np.isnan(run.table_reading)) == lost
    assert ended.samples == len(run) == 2500


def test_the_ring_shows_the_whole_stream_and_runs_follow_one_another(tmp_path, shared):
    with connect(port_of(shared)) as engine:
        rows = []
        for _ in range(2):
            engine.send(Arm(run_in(tmp_path, pretrigger_s=0.3, duration_s=0.5)))
            ended = until(engine, RunEnded)
            assert (ended.samples, ended.release_s) == (800, 0.3)
            rows.append(engine.new_rows())
            until(engine, StateChanged, state=PullbackState.IDLE)
        assert rows[0].first_row == 0
        assert rows[1].first_row == len(rows[0])
        time_s = np.concatenate([part.time_s for part in rows])
        np.testing.assert_allclose(time_s, np.arange(len(time_s)) / 1000.0, atol=1e-12)
        assert len(list(tmp_path.glob("*.h5"))) == 2


def test_stop_keeps_what_was_recorded(tmp_path, shared):
    with connect(port_of(shared)) as engine:
        engine.send(Arm(run_in(tmp_path, duration_s=None)))
        until(engine, RunStarted)
        engine.send(Arm(run_in(tmp_path)))
        assert "already" in until(engine, StateChanged, state=PullbackState.SLIPPING).note
        engine.send(Stop())
        ended = until(engine, RunEnded)
        assert ended.ended is EndReason.STOPPED
        assert ended.samples == len(open_run(ended.path)) > 1000


def test_quitting_ends_a_run_and_keeps_it(tmp_path, shared):
    engine = connect(port_of(shared))
    engine.send(Arm(run_in(tmp_path)))
    until(engine, StateChanged, state=PullbackState.HELD)
    engine.close()
    assert any(isinstance(event, RunEnded) for event in engine.poll())
    assert engine.has_ended
    assert len(closed_run(tmp_path)) > 500
    assert gone(engine.process_id)


def test_a_device_that_vanishes_ends_the_run_which_is_kept(tmp_path):
    with stand() as simulated, connect(port_of(simulated)) as engine:
        engine.send(Arm(run_in(tmp_path, duration_s=60.0)))
        until(engine, RunStarted)
        simulated.stop()
        ended = until(engine, RunEnded)
        assert ended.ended is EndReason.DEVICE_LOST
        assert simulated.port in ended.message
        assert len(open_run(ended.path)) == ended.samples > 1000
        for _ in range(100):
            if any(isinstance(event, Failed) for event in engine.poll()):
                break
            time.sleep(0.05)
        else:
            pytest.fail("the engine does not say that it ends")


def test_a_device_that_falls_silent_has_stalled(tmp_path):
    with stand() as simulated, connect(port_of(simulated)) as engine:
        engine.send(Arm(run_in(tmp_path, duration_s=60.0)))
        until(engine, RunStarted)
        os.kill(simulated.process_id, signal.SIGSTOP)
        try:
            ended = until(engine, RunEnded)
        finally:
            os.kill(simulated.process_id, signal.SIGCONT)
        assert ended.ended is EndReason.STALLED
        assert "silent" in ended.message


def test_a_wrong_rate_is_said_and_kept_as_the_scale_of_the_clock(tmp_path):
    with stand(clock_ppm=50_000.0) as simulated:
        run = run_in(tmp_path, trigger="none", duration_s=3.0)
        ended = record_run(port_of(simulated), run, *FILES)
    assert "instead of 1000" in ended.message
    ending = open_run(ended.path).ending
    assert ending.clock_scale == pytest.approx(1 / 1.05, abs=max(0.005, 5 * ending.clock_scale_uncertainty))


@pytest.mark.parametrize(
    ("port", "run", "words"),
    [
        ({"url": "/dev/no-such-port"}, {}, "no-such-port"),
        ({"protocol": "morse"}, {}, "morse"),
        ({"device": {"colour": "red"}}, {}, "colour"),
        ({}, {"series": "9XX"}, "9XX"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(tmp_path, shared, port, run, words):
    settings = {"url": shared.port, "protocol": "slipstand-binary"} | port
    with pytest.raises(EngineFailedError, match=words) as refused:
        record_run(PortSettings(**settings), run_in(tmp_path, **run), *FILES)
    assert "\n" not in str(refused.value)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_written_is_refused_before_the_pull(tmp_path, shared):
    (tmp_path / "file").write_text("")
    with pytest.raises(EngineFailedError, match="folder"):
        record_run(port_of(shared), run_in(tmp_path / "file"), *FILES)


def test_a_killed_engine_is_noticed_and_its_journal_stays(tmp_path, shared):
    with connect(port_of(shared)) as engine:
        engine.send(Arm(run_in(tmp_path, duration_s=60.0)))
        started = until(engine, RunStarted)
        os.kill(engine.process_id, signal.SIGKILL)
        for _ in range(200):
            if any(isinstance(event, Failed) for event in engine.poll()):
                break
            time.sleep(0.05)
        else:
            pytest.fail("nobody noticed")
    assert list(tmp_path.glob("*.journal"))
    deadline = time.monotonic() + 20.0
    while list(tmp_path.glob("*.recording")) and time.monotonic() < deadline:
        time.sleep(0.05)
    run = open_run(started.path)
    assert run.ending.ended == "interrupted"
    assert len(run) > 1000


OWNER = """
import sys
from app.acquisition.client import EngineClient
from app.acquisition.messages import Arm, Connected, PortSettings, RunSettings, RunStarted, StateChanged
url, folder, stand, gauges, word = sys.argv[1:]
engine = EngineClient.start(PortSettings(url=url, protocol="slipstand-binary"), stand, gauges)
while True:
    event = engine.wait(1.0)
    if isinstance(event, Connected):
        print(engine.process_id, flush=True)
        engine.send(Arm(RunSettings(directory=folder, series="1FFM0", duration_s=1.5)))
    if type(event).__name__ == word or (isinstance(event, StateChanged) and event.state == word):
        print(word, flush=True)
"""


@pytest.mark.parametrize(("word", "ended"), [("RunStarted", "duration"), ("held", "interrupted")])
def test_when_its_owner_is_killed_the_run_is_finished_and_stored(tmp_path, shared, word, ended):
    owner = subprocess.Popen(
        [sys.executable, "-c", OWNER, shared.port, str(tmp_path), *FILES, word],
        stdout=subprocess.PIPE,
    )
    with owner:
        engine_id = int(owner.stdout.readline())
        assert owner.stdout.readline().split() == [word.encode()]
        owner.send_signal(signal.SIGKILL)
    run = closed_run(tmp_path)
    assert run.ending.ended == ended
    assert len(run) == 2500 or ended == "interrupted"
    assert gone(engine_id)


RECORDER = """
import sys
from app.acquisition.client import record_run
from app.acquisition.messages import PortSettings, RunSettings
url, folder, stand, gauges = sys.argv[1:]
run = RunSettings(directory=folder, series="1FFM0", duration_s=60.0)
port = PortSettings(url=url, protocol="slipstand-binary")
ended = record_run(port, run, stand, gauges, lambda event: print(type(event).__name__, flush=True))
print(ended.ended, ended.samples, flush=True)
"""


def test_ctrl_c_ends_the_run_and_keeps_it(tmp_path, shared):
    recorder = subprocess.Popen(
        [sys.executable, "-c", RECORDER, shared.port, str(tmp_path), *FILES],
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    with recorder:
        for line in recorder.stdout:
            if line.strip() == "RunStarted":
                os.killpg(recorder.pid, signal.SIGINT)  # as a terminal does: to all of its processes
            last = line.split()
    assert last[0] == "interrupted"
    assert int(last[1]) == len(closed_run(tmp_path)) > 1000


def test_nothing_is_left_of_an_engine_that_was_never_connected():
    engine = EngineClient.start(PortSettings(url="/dev/no-such-port", protocol="csv"), *FILES)
    engine.send(Quit())
    engine.close()
    assert gone(engine.process_id)
    assert any(isinstance(event, Failed) for event in engine.poll())
