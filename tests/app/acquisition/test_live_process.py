"""The live identification as a process: reads a ring, follows commands, ends with its parent."""

import datetime
import os
import signal
import sys
import time

import numpy as np
import pytest

from analysis.synthetic import Truth, simulate_readings
from app.acquisition.live_client import DIED_NOTE, LiveIdentifier, spawn_live
from app.acquisition.live_follower import RunFollower
from app.acquisition.messages import FollowRun, LiveResult
from app.acquisition.ring import create_ring, open_ring
from app.runs.metadata import create_metadata
from config.files import load_gauges, load_stand
from drivers.clock import TimeBase
from drivers.samples import SampleStatus
from tests.drills.processes import gone
from tests.waiting import wait_until

PATIENCE_S = 300.0
"""Compiling anew on a busy machine takes more than a minute."""
BEFORE = 700
GAUGES = load_gauges()
TIMED = TimeBase(1.0, 1e-4)
TRUTH = Truth(rate_hz=1000.0, duration_s=6.0, offsets_m=(0.0, 0.0))


@pytest.fixture(scope="module")
def ring(tmp_path_factory):
    with create_ring(tmp_path_factory.mktemp("ring") / "live.ring", 1 << 15, 1000.0, GAUGES) as made:
        yield made


@pytest.fixture(scope="module")
def time_bases():
    """The latest one is known to the engine."""
    return [TIMED]


@pytest.fixture(scope="module")
def identifier(ring, time_bases):
    made = LiveIdentifier(str(ring.path), lambda _: time_bases[-1])
    made.prepare()
    yield made
    made.stop()


@pytest.fixture(scope="module")
def metadata():
    start = datetime.datetime(2026, 11, 21, 12, tzinfo=datetime.UTC)
    return create_metadata(load_stand(), load_gauges(), start, series="1FFM0", rate_hz=1000.0)


def counts_of(table_m, relative_m):
    return np.column_stack(
        [
            values_m / gauge.gain_m_per_count + gauge.zero_count
            for values_m, gauge in ((table_m, GAUGES.table), (relative_m, GAUGES.relative))
        ]
    )


def fill(ring, damaged=slice(0, 0)):
    """Other samples, then the test of `TRUTH`; the row at which it begins."""
    _, table, relative = simulate_readings(TRUTH)
    table, relative = (np.concatenate((np.full(BEFORE, 0.5), column)) for column in (table, relative))
    status = np.zeros(len(table), np.uint8)
    status[BEFORE:][damaged] = SampleStatus.DAMAGED
    first_row = ring.written + BEFORE
    ring.append(counts_of(table, relative), status)
    return first_row


def result_of(identifier, first_row, metadata, now_s=0.0):
    end_s = time.perf_counter() + PATIENCE_S
    while time.perf_counter() < end_s:
        result = identifier.poll(first_row, metadata, now_s)
        if result is not None:
            assert result.message != DIED_NOTE
            return result
        time.sleep(0.01)
    raise AssertionError("no result")


@pytest.mark.parametrize("damaged", [slice(0, 0), slice(2500, 2530)])
def test_a_run_in_the_ring_is_identified(identifier, ring, metadata, damaged):
    first_row = fill(ring, damaged)

    result = result_of(identifier, first_row, metadata)

    friction, period = result.friction_dynamic, result.period
    assert friction is not None
    assert period is not None
    assert friction.value == pytest.approx(0.1, abs=4.0 * friction.standard_uncertainty)
    assert period.value == pytest.approx(0.32, abs=4.0 * period.standard_uncertainty)
    assert result.law == "coulomb"
    assert result.time_s == pytest.approx(first_row / 1000.0 + 7.0, abs=0.01)
    assert result.slip_end_s == pytest.approx(first_row / 1000.0 + 1.0 + 3.28, abs=0.01)
    assert not result.is_enough
    identifier.end_run()


def test_answers_are_of_the_run_that_is_followed(identifier, ring, metadata):
    first_row = fill(ring)
    identifier.poll(first_row, metadata, 0.0)
    identifier.end_run()

    assert result_of(identifier, first_row + 1, metadata).friction_dynamic is not None
    identifier.end_run()
    time.sleep(0.2)
    assert identifier.poll(None, metadata, 0.0) is None


def test_what_nobody_took_of_a_run_is_not_told_of_the_next(identifier, ring, metadata):
    identifier.poll(fill(ring), metadata, 0.0)
    wait_until(lambda: identifier._latest is not None)

    identifier.end_run()

    assert identifier.poll(None, metadata, 0.0) is None


def test_the_clock_may_be_timed_anew_meanwhile(identifier, ring, metadata, time_bases):
    first_row = fill(ring)
    before = result_of(identifier, first_row, metadata)
    time_bases.append(TimeBase(1.001, 1e-5))
    identifier.poll(first_row, metadata, 2.0)
    more = 100
    ring.append(np.zeros((more, 2)), np.ones(more, np.uint8))

    after = result_of(identifier, first_row, metadata, 2.0)

    share = 1e-6 / (1e-6 + 1e-10)  # of the timed clock beside the nominal one
    assert after.period.value == pytest.approx(before.period.value * (1.0 + 0.001 * share), rel=2e-5)
    assert after.period.standard_uncertainty < before.period.standard_uncertainty
    identifier.end_run()


def test_it_ends_with_its_pipe_in_the_middle_of_its_start():
    process = spawn_live()
    identifier = LiveIdentifier("no.ring", lambda _: TIMED, lambda: process)
    identifier.prepare()

    identifier.stop()

    assert gone(process.pid)


@pytest.mark.skipif(sys.platform == "win32", reason="signals end processes otherwise there")
def test_a_process_that_dies_is_told_of_once_and_replaced_at_the_next_arming(tmp_path, metadata):
    started = []

    def start():
        started.append(spawn_live())
        return started[-1]

    watch = LiveIdentifier(str(tmp_path / "no.ring"), lambda _: TIMED, start)
    watch.prepare()
    os.kill(started[0].pid, signal.SIGKILL)
    assert gone(started[0].pid)
    said = []
    while not said:
        result = watch.poll(1000, metadata, 2.0)
        said += [result] if result is not None else []
    assert said == [LiveResult(2.0, message=DIED_NOTE)]
    assert watch.poll(1000, metadata, 2.1) is None

    watch.prepare()
    watch.prepare()
    watch.end_run()
    watch.stop()

    assert len(started) == 2
    assert gone(started[1].pid)


def test_without_room_for_a_process_the_run_goes_on(metadata):
    def start():
        raise OSError(11, "Resource temporarily unavailable")

    watch = LiveIdentifier("no.ring", lambda _: TIMED, start)

    watch.prepare()

    assert watch.poll(1000, metadata, 2.0) is None
    watch.stop()


def test_a_run_by_the_clock_is_neither_followed_nor_read_for_hours(tmp_path, metadata, monkeypatch):
    with create_ring(tmp_path / "long.ring", 1 << 17, 1000.0, GAUGES) as ring, open_ring(ring.path) as reader:
        fill(ring)
        following = RunFollower(reader, FollowRun(str(ring.path), BEFORE, metadata, TIMED))
        assert following.answer() is not None
        _rest(ring, 29_000)
        assert following.answer() is not None
        _rest(ring, 5_000)
        following.answer()
        _rest(ring, 5_000)
        monkeypatch.setattr(reader, "read_since", lambda row: pytest.fail(f"rows from {row} on were read"))
        assert following.answer() is None


def _rest(ring, count):
    still = np.zeros(count)
    ring.append(counts_of(still, still), np.zeros(count, np.uint8))
