"""The engine as a process, reading a simulated stand over a real serial line, into real run files."""

import itertools
import sys
from pathlib import Path

import numpy as np
import pytest
from engine_kit import (
    CHECKED_CSV,
    FILES,
    QUICK,
    RELEASE_S,
    connect,
    index_of_first,
    lost_within,
    port_of,
    record_run,
    run_in,
    stand,
    until,
)
from raw_bytes_kit import load_raw_bytes

from app.acquisition.disk_space import ROW_BYTES
from app.acquisition.errors import EngineFailedError
from app.acquisition.messages import (
    Arm,
    EndReason,
    Health,
    PortSettings,
    PullbackState,
    RunEnded,
    RunStarted,
    StateChanged,
    Stop,
)
from app.runs.reader import open_run
from drivers.samples import SampleStatus
from messages.message import message

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no pseudo-terminals")


REST_S = 2.5
"""Before the pull: a busy computer that begins to read late still has the whole pretrigger."""
PULL_AND_HOLD_S = RELEASE_S - QUICK["rest_s"]


def test_a_pullback_is_recorded_sample_by_sample(tmp_path):
    events = []
    with stand(rest_s=REST_S) as simulated:
        ended = record_run(port_of(simulated), run_in(tmp_path), *FILES, events.append)
    truth = simulated.truth()
    assert ended.ended is EndReason.DURATION
    assert (ended.samples, ended.rate_hz, ended.release_s) == (1500, 1000.0, 1.0)
    run = open_run(ended.path)
    first = index_of_first(run, truth)
    assert abs(first - round((REST_S + PULL_AND_HOLD_S - 1.0) * 1000.0)) <= 2
    # none, unless a busy computer let the port run full
    lost = lost_within(truth, first, first + len(run))
    assert ended.missing + ended.damaged + ended.missing_estimated == lost
    np.testing.assert_allclose(run.time_s, np.arange(1500) / 1000.0, atol=1e-12)
    assert run.metadata.device.firmware == "simulated-1"
    assert run.metadata.port == simulated.port
    assert len(load_raw_bytes(run).data) > 1500 * 8
    # that the pull has begun is told too, unless a busy computer sees both at once
    states = [state for state, _ in itertools.groupby(e.state for e in events if isinstance(e, StateChanged))]
    assert states[:5] == [
        PullbackState.CONNECTING,
        PullbackState.IDLE,
        PullbackState.ZERO,
        PullbackState.PULLING,
        PullbackState.HELD,
    ]
    health = [event for event in events if isinstance(event, Health)]
    assert health[-1].free_disk_bytes > 0
    assert health[-1].bytes_per_s > ROW_BYTES * health[-1].rate_hz / 2
    assert [path.name for path in tmp_path.iterdir()] == [Path(ended.path).name]


def test_lines_of_values_are_recorded_alike(tmp_path):
    with stand(protocol="csv", rate_hz=500.0, rest_s=REST_S) as simulated:
        ended = record_run(port_of(simulated, "csv"), run_in(tmp_path), *FILES)
    assert (ended.ended, ended.samples, ended.rate_hz) == (EndReason.DURATION, 750, 500.0)
    first = index_of_first(open_run(ended.path), simulated.truth())
    assert abs(first - round((REST_S + PULL_AND_HOLD_S - 1.0) * 500.0)) <= 2


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
        assert rows[0].first_index == 0
        assert rows[1].first_index == len(rows[0])
        time_s = np.concatenate([part.time_s for part in rows])
        np.testing.assert_allclose(time_s, np.arange(len(time_s)) / 1000.0, atol=1e-12)
        assert len(list(tmp_path.glob("*.h5"))) == 2


def test_stop_keeps_what_was_recorded(tmp_path, shared):
    with connect(port_of(shared)) as engine:
        engine.send(Arm(run_in(tmp_path, duration_s=None)))
        until(engine, RunStarted)
        engine.send(Arm(run_in(tmp_path)))
        until(
            engine,
            StateChanged,
            note=message("A run is being recorded already: stop it before the next one"),
        )
        engine.send(Stop())
        ended = until(engine, RunEnded)
        assert ended.ended is EndReason.STOPPED
        assert ended.samples == len(open_run(ended.path)) > 1000


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
    ended = record_run(port_of(shared), run_in(tmp_path / "file"), *FILES)
    assert (ended.ended, ended.path, ended.samples) == (EndReason.WRITE_ERROR, "", 0)
    assert "Choose a folder that you may write to" in str(ended.message)


def test_a_run_without_room_is_refused_and_the_next_one_recorded(tmp_path, shared):
    with connect(port_of(shared)) as engine:
        engine.send(Arm(run_in(tmp_path, trigger="none", duration_s=1e9)))
        refused = until(engine, RunEnded)
        assert (refused.ended, refused.path) == (EndReason.DISK_FULL, "")
        assert "Free some space or record to another disk" in str(refused.message)
        assert list(tmp_path.iterdir()) == []
        engine.send(Arm(run_in(tmp_path, trigger="none", duration_s=0.3)))
        assert until(engine, RunEnded).ended is EndReason.DURATION
