"""Several pullbacks over one connection, armed automatically."""

import contextlib
import sys
import threading
import time

import pytest
from engine_kit import FILES, port_of, run_in, stand

from app.acquisition import engine_client
from app.acquisition.engine_client import record_runs
from app.acquisition.messages import Connected, EndReason, PullbackState, StateChanged
from app.runs.metadata import Conditions
from app.runs.reader import open_run
from app.simulated_stand.options import Gesture

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no pseudo-terminals")


def test_three_runs_over_one_connection_count_up_and_know_the_plate(tmp_path):
    run = run_in(tmp_path, conditions=Conditions(run_in_number=4, plate_id="P-7"))
    events = []
    with stand(recentre_every=3, on_demand=True) as simulated:

        def on_event(event):
            events.append(event)
            if isinstance(event, StateChanged) and event.state in (
                PullbackState.PULLING,
                PullbackState.RECENTRE,
            ):
                simulated.ask(Gesture.PULL)

        ended = list(record_runs(port_of(simulated), run, *FILES, on_event, count=3))
    assert [one.ended for one in ended] == [EndReason.DURATION] * 3
    assert [one.remaining for one in ended] == [2, 1, 0]
    assert len([event for event in events if isinstance(event, Connected)]) == 1
    runs = [open_run(one.path) for one in ended]
    assert [one.metadata.conditions.run_in_number for one in runs] == [4, 5, 6]
    assert {one.metadata.conditions.plate_id for one in runs} == {"P-7"}
    assert len({one.identifier for one in runs}) == 3
    # Each run begins a pretrigger before its own release, and its zero is where the plate was left.
    assert {one.release_s for one in ended} == {1.0}
    begun_m = [one.relative_reading[:50].mean() for one in runs]
    assert begun_m[0] == pytest.approx(0.0, abs=50e-6)
    assert begun_m[1] < -5e-3
    assert begun_m[2] == pytest.approx(2 * begun_m[1], abs=50e-6)
    assert [path.suffix for path in tmp_path.iterdir()] == [".h5"] * 3


def test_a_plate_too_far_off_is_said_at_once_with_where_it_belongs(tmp_path):
    asked = []

    def listen(event):
        if isinstance(event, StateChanged) and event.state is PullbackState.RECENTRE:
            asked.append(event.position)

    with stand(plate_offset_m=0.016, recentre_every=1) as simulated:
        (ended,) = record_runs(port_of(simulated), run_in(tmp_path), *FILES, listen)
    assert asked[0].plate_m == pytest.approx(0.016, abs=1e-4)
    told = next(position for position in asked if position.plate_wanted_m is not None)
    assert (told.plate_wanted_m, told.side) == (0.0, 0)
    assert "was not pushed back before the pull" in str(ended.message)


def test_interrupted_between_two_runs_the_first_is_kept_and_nothing_else(tmp_path, monkeypatch):
    interrupted = threading.Event()
    monkeypatch.setattr(engine_client, "_interrupts", lambda: contextlib.nullcontext(interrupted))
    with stand() as simulated:
        ended = []
        for one in record_runs(port_of(simulated), run_in(tmp_path), *FILES, count=5):
            ended.append(one)
            time.sleep(0.1)
            interrupted.set()
    assert [one.ended for one in ended] == [EndReason.DURATION, EndReason.INTERRUPTED]
    assert [bool(one.path) for one in ended] == [True, False]
    assert [path.suffix for path in tmp_path.iterdir()] == [".h5"]
