"""The live identification beside a run of the real engine: its values arrive, its failure stops nothing."""

import contextlib
import os
import signal
import sys
from pathlib import Path

import pytest
from engine_kit import connect, port_of, pull_when_asked, run_in, stand, until

from app.acquisition.live_client import DIED_NOTE
from app.acquisition.messages import Arm, EndReason, LiveResult, PullbackState, RunEnded, StateChanged, Stop
from messages.message import EMPTY
from tests.drills.processes import children_of, gone
from tests.waiting import PATIENCE_S, wait_until

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks for processes in /proc")


def live_process_of(engine_pid):
    """Number of the process that an engine has for the live identification."""

    def found():
        for process_id in children_of(engine_pid):
            with contextlib.suppress(OSError):  # ended meanwhile
                if b"app.acquisition.live_client" in Path(f"/proc/{process_id}/cmdline").read_bytes():
                    return process_id
        return None

    return wait_until(found)


def test_friction_is_told_while_the_motion_dies_away(tmp_path):
    with (
        stand(on_demand=True, hold_s=5.0, decay_s=PATIENCE_S) as simulated,
        connect(port_of(simulated)) as engine,
    ):
        engine.send(Arm(run_in(tmp_path, duration_s=PATIENCE_S)))
        pull_when_asked(engine, simulated)
        results = [until(engine, LiveResult) for _ in range(11)]
        engine.send(Stop())
        assert until(engine, RunEnded).ended is EndReason.STOPPED

    last = results[-1].friction_dynamic
    assert last is not None
    assert last.value == pytest.approx(0.1, abs=4.0 * last.standard_uncertainty)
    assert not any(result.message for result in results)


def test_a_run_without_trigger_is_identified_too(tmp_path):
    with stand(hold_s=5.0) as simulated, connect(port_of(simulated)) as engine:
        engine.send(Arm(run_in(tmp_path, trigger="none", duration_s=None)))
        assert until(engine, LiveResult).message == EMPTY
        engine.send(Stop())
        until(engine, RunEnded)


def test_a_run_goes_on_without_it_and_says_so(tmp_path):
    with stand() as simulated, connect(port_of(simulated)) as engine:
        engine.send(Arm(run_in(tmp_path, duration_s=1.0)))
        until(engine, StateChanged, state=PullbackState.ZERO)
        os.kill(live_process_of(engine.process_id), signal.SIGKILL)
        assert until(engine, LiveResult, message=DIED_NOTE)
        assert until(engine, RunEnded).ended is EndReason.DURATION
        engine.send(Arm(run_in(tmp_path, duration_s=0.5)))
        until(engine, StateChanged, state=PullbackState.ZERO)
        anew = live_process_of(engine.process_id)
        until(engine, RunEnded)
    assert gone(anew)


def test_it_does_not_outlive_an_engine_that_is_killed(tmp_path):
    with stand() as simulated:
        engine = connect(port_of(simulated))
        engine.send(Arm(run_in(tmp_path)))
        until(engine, StateChanged, state=PullbackState.ZERO)
        live = live_process_of(engine.process_id)
        os.kill(engine.process_id, signal.SIGKILL)
        assert gone(live)
        engine.close()
