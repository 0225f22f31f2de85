"""Ends of engine, device and parent process, and what is stored then."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from engine_kit import (
    FILES,
    closed_run,
    connect,
    port_of,
    run_in,
    stand,
    until,
)

from app.acquisition.engine_client import EngineClient
from app.acquisition.messages import (
    Arm,
    EndReason,
    Failed,
    PortSettings,
    PullbackState,
    Quit,
    Reconnected,
    Reconnecting,
    RunEnded,
    RunStarted,
    StandPosition,
    StateChanged,
    Stop,
)
from app.runs.lock import is_being_recorded
from app.runs.reader import open_run
from app.runs.unattended import read_notes
from app.simulated_stand.options import Gesture
from tests.drills.processes import gone
from tests.waiting import wait_until

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no pseudo-terminals")


def test_quitting_ends_a_run_and_keeps_it(tmp_path, shared):
    engine = connect(port_of(shared))
    engine.send(Arm(run_in(tmp_path)))
    until(engine, StateChanged, state=PullbackState.HELD)
    engine.close()
    assert any(isinstance(event, RunEnded) for event in engine.poll())
    assert engine.has_ended
    assert len(closed_run(tmp_path)) > 500
    assert gone(engine.process_id)


def test_a_stop_before_the_pull_leaves_neither_run_nor_journal(tmp_path):
    with stand(on_demand=True) as simulated, connect(port_of(simulated)) as engine:
        engine.send(Arm(run_in(tmp_path)))
        waiting = until(engine, StateChanged, state=PullbackState.PULLING)
        assert not waiting.position.keeps_run
        engine.send(Stop())
        ended = until(engine, RunEnded)
        assert (ended.ended, ended.path, ended.samples) == (EndReason.STOPPED, "", 0)
        until(engine, StateChanged, state=PullbackState.IDLE)
        assert list(tmp_path.iterdir()) == []


def test_a_run_is_worth_keeping_from_the_pull_on(tmp_path):
    with stand(on_demand=True) as simulated, connect(port_of(simulated)) as engine:
        engine.send(Arm(run_in(tmp_path)))
        until(engine, StateChanged, state=PullbackState.PULLING)
        simulated.ask(Gesture.PULL)
        position = StandPosition()
        while not position.keeps_run:
            position = until(engine, StateChanged).position
        engine.send(Stop())
        assert until(engine, RunEnded).path


def test_a_release_that_came_too_early_is_noticed_and_the_next_one_is_recorded(tmp_path):
    with stand(early_release_m=0.004) as simulated, connect(port_of(simulated)) as engine:
        engine.send(Arm(run_in(tmp_path)))
        until(engine, StateChanged, state=PullbackState.PULLING)
        early = until(engine, StateChanged, state=PullbackState.ZERO)
        assert early.position.early_release_m == pytest.approx(0.004, abs=0.1e-3)
        ended = until(engine, RunEnded)
        assert ended.ended is EndReason.DURATION
        assert ended.release_s == pytest.approx(1.0, abs=0.01)


def test_a_device_that_vanishes_ends_the_run_which_is_kept(tmp_path):
    with stand() as simulated, connect(port_of(simulated)) as engine:
        engine.send(Arm(run_in(tmp_path, duration_s=60.0)))
        until(engine, RunStarted)
        simulated.stop()
        assert simulated.port in str(until(engine, Reconnecting).message)
        ended = until(engine, RunEnded)
        assert ended.ended is EndReason.DEVICE_LOST
        assert simulated.port in str(ended.message)
        assert "not back within 10 s" in str(ended.message)
        assert len(open_run(ended.path)) == ended.samples > 1000
        until(engine, StateChanged, state=PullbackState.CONNECTING)  # it goes on looking


def test_a_device_that_is_unplugged_between_runs_is_found_again(tmp_path):
    with stand() as simulated, connect(port_of(simulated)) as engine:
        simulated.disturb("unplug 0.5")
        until(engine, Reconnecting)
        assert until(engine, Reconnected).gap_s >= 0.45
        until(engine, StateChanged, state=PullbackState.IDLE)
        engine.send(Arm(run_in(tmp_path, trigger="none", duration_s=0.3)))
        assert until(engine, RunEnded).ended is EndReason.DURATION


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
        assert "silent" in str(ended.message)


def test_a_device_that_turns_to_rubbish_has_stalled(tmp_path):
    with stand(tcp_port=0) as simulated, connect(port_of(simulated)) as engine:
        engine.send(Arm(run_in(tmp_path, trigger="none", duration_s=60.0)))
        until(engine, RunStarted)
        simulated.disturb("rubbish")
        ended = until(engine, RunEnded)
        assert ended.ended is EndReason.STALLED
        assert "has brought no sample for 3 s: received" in str(ended.message)
        assert "of the run are missing" in str(ended.message)
        assert open_run(ended.path).end.losses.discarded_bytes > 1000


def test_a_killed_engine_is_noticed_and_its_journal_stays(tmp_path, shared):
    with connect(port_of(shared)) as engine:
        engine.send(Arm(run_in(tmp_path, duration_s=60.0)))
        started = until(engine, RunStarted)
        os.kill(engine.process_id, signal.SIGKILL)
        wait_until(lambda: any(isinstance(event, Failed) for event in engine.poll()))
    assert list(tmp_path.glob("*.journal"))
    wait_until(lambda: not is_being_recorded(Path(started.path)))
    run = open_run(started.path)
    assert run.end.ended == "interrupted"
    assert len(run) > 1000


OWNER = """
import sys
from app.acquisition.engine_client import EngineClient
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
def test_when_its_owner_is_killed_the_run_is_finished_and_stored(tmp_path, word, ended):
    with stand(hold_s=0.4 if word == "RunStarted" else 30.0) as simulated:  # held until the kill has come
        owner = subprocess.Popen(
            [sys.executable, "-c", OWNER, simulated.port, str(tmp_path), *FILES, word],
            stdout=subprocess.PIPE,
        )
        with owner:
            engine_id = int(owner.stdout.readline())
            assert owner.stdout.readline().split() == [word.encode()]
            owner.send_signal(signal.SIGKILL)
        run = closed_run(tmp_path)
    assert run.end.ended == ended
    assert len(run) == 2500 or ended == "interrupted"
    assert gone(engine_id)
    (note,) = read_notes(tmp_path).values()
    assert (note.path, note.ended, note.series) == (str(run.path), ended, "1FFM0")


def test_a_run_whose_owner_quits_needs_no_note(tmp_path, shared):
    with connect(port_of(shared)) as engine:
        engine.send(Arm(run_in(tmp_path, trigger="none", duration_s=60.0)))
        until(engine, RunStarted)
    assert closed_run(tmp_path).end.ended == "stopped"
    assert read_notes(tmp_path) == {}


RECORDER = """
import sys
from app.acquisition.engine_client import record_runs
from app.acquisition.messages import PortSettings, RunSettings
url, folder, stand, gauges = sys.argv[1:]
run = RunSettings(directory=folder, series="1FFM0", duration_s=60.0)
port = PortSettings(url=url, protocol="slipstand-binary")
ended = next(record_runs(port, run, stand, gauges, lambda event: print(type(event).__name__, flush=True)))
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
