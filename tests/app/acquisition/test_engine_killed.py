"""Killed processes: how the others react, and what is left of the run."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from engine_kit import FILES, connect, port_of, run_in, stand, until

from app.acquisition.journal.recovery import RecoveryState, recover_folder
from app.acquisition.messages import Arm, EndReason, Failed, PullbackState, RunEnded, RunStarted, StateChanged
from app.runs.reader import load_counts, open_run
from app.runs.unattended import read_notes
from app.runs.validator import Validator
from tests.drills.processes import children_of, descendants_of, gone
from tests.waiting import wait_until

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks at processes as Linux lists them")


def test_a_killed_writer_ends_the_run_of_which_nothing_is_lost(tmp_path):
    with stand() as simulated, connect(port_of(simulated)) as engine:
        engine.send(Arm(run_in(tmp_path, duration_s=60.0)))
        until(engine, RunStarted)
        time.sleep(0.3)
        (writer,) = [pid for pid in children_of(engine.process_id) if b"runs.writer" in command_of(pid)]
        os.kill(writer, signal.SIGKILL)
        ended = until(engine, RunEnded)
        assert ended.ended is EndReason.WRITE_ERROR
        assert f"slipstand recover {tmp_path}" in str(ended.message)
        left = open_run(ended.path)
        (recovered,) = recover_folder(tmp_path)
        run = open_run(ended.path)
        assert (recovered.state, recovered.run, recovered.kept) == (RecoveryState.RECOVERED, ended.path, "")
        assert len(run) == ended.samples >= len(left)
        np.testing.assert_array_equal(load_counts(run)[: len(left)], load_counts(left))
        assert run.end.ended == "write-error"
        assert run.events.release_s == ended.release_s == 1.0

        engine.send(Arm(run_in(tmp_path / "next", trigger="none", duration_s=0.3)))
        assert until(engine, RunEnded).ended is EndReason.DURATION, "a new writer takes the next run"


def command_of(process_id: int) -> bytes:
    return Path(f"/proc/{process_id}/cmdline").read_bytes()


def test_a_killed_engine_is_noticed_at_once_and_leaves_no_process(tmp_path, shared):
    with connect(port_of(shared)) as engine:
        engine.send(Arm(run_in(tmp_path, duration_s=60.0)))
        until(engine, RunStarted)
        children = descendants_of(engine.process_id)
        assert len(children) >= 1
        os.kill(engine.process_id, signal.SIGKILL)
        event = wait_until(lambda: next((one for one in engine.poll() if isinstance(one, Failed)), None))
        assert f"slipstand recover {tmp_path}" in str(event.message)
        assert all(gone(child) for child in children)
    (recovered,) = recover_folder(tmp_path)
    assert recovered.state is RecoveryState.RECOVERED
    run = open_run(recovered.run)
    assert (run.end.ended, run.events.release_s) == ("interrupted", 1.0)
    assert run.end.zero_m is not None
    assert recovered.samples == len(run) == run.losses.samples > 1000
    assert [path.suffix for path in tmp_path.iterdir()] == [".h5"]


OWNER = """
import sys
from app.acquisition.engine_client import EngineClient
from app.acquisition.messages import Arm, Connected, PortSettings, RunSettings, StateChanged
from app.simulated_stand.client import SimulatedStand
from app.simulated_stand.options import SimulatedStandOptions
from app.runs.validator import Validator
stand_file, gauges_file, folder, until = sys.argv[1:]
stand = SimulatedStand.start(SimulatedStandOptions(rate_hz=1000.0))
validator = Validator.start()
port = PortSettings(url=stand.port, protocol="slipstand-binary")
engine = EngineClient.start(port, stand_file, gauges_file)
while True:
    event = engine.wait(1.0)
    if isinstance(event, Connected):
        engine.send(Arm(RunSettings(directory=folder, series="1FFM0", duration_s=2.0)))
    if isinstance(event, StateChanged) and event.state == until:
        print(until, flush=True)
"""


@pytest.mark.parametrize(("until", "ended"), [("zero", ""), ("slipping", "duration")])
def test_a_killed_window_leaves_no_process_but_what_finishes_a_run(tmp_path, until, ended):
    """Stand, engine, writer, live identification and validator notice it by the end of their pipes.

    The stand goes on while the engine reads it. Of a run before its pull nothing is kept.
    """
    owner = subprocess.Popen(
        [sys.executable, "-c", OWNER, *FILES, str(tmp_path), until], stdout=subprocess.PIPE, text=True
    )
    with owner:
        assert owner.stdout.readline().strip() == until
        running = descendants_of(owner.pid)
        said = b" ".join(command_of(pid) for pid in running)
        for module in (b"simulated_stand", b"acquisition.engine", b"runs.writer", b"runs.validator"):
            assert module in said
        owner.kill()
    assert all(gone(process_id) for process_id in running)
    assert [open_run(path).end.ended for path in tmp_path.iterdir()] == [ended] * bool(ended)
    (note,) = read_notes(tmp_path).values()
    assert (note.ended, bool(note.path)) == (ended or "interrupted", bool(ended))


def test_an_examiner_ends_with_who_asked_it():
    code = (
        "from app.runs.validator import Validator; import time;"
        "validator = Validator.start(); print(validator.pid, flush=True); time.sleep(600)"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as owner:
        validator = int(owner.stdout.readline())
        owner.kill()
    assert gone(validator)
    with Validator.start() as mine:
        assert mine.pid is not None
        ended = mine.pid
    assert gone(ended)


def test_all_processes_end_with_a_window_that_is_closed(tmp_path):
    with stand() as simulated, connect(port_of(simulated)) as engine:
        engine.send(Arm(run_in(tmp_path)))
        until(engine, StateChanged, state=PullbackState.ZERO)
        running = [simulated.process_id, engine.process_id, *descendants_of(engine.process_id)]
    assert all(gone(process_id) for process_id in running)
    assert list(tmp_path.glob("*.journal*")) == []
