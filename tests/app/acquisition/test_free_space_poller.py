"""Free space is read in a thread, so that a hanging disk holds up that thread alone."""

import threading
import time
from pathlib import Path

import pytest

from app.acquisition import disk_space
from app.acquisition.disk_space import DiskDemand, DiskSpaceMonitor
from tests.waiting import PATIENCE_S, wait_until

DEMAND = DiskDemand(1000.0, 9000.0)


@pytest.fixture
def disks(monkeypatch):
    """Free bytes by folder; one that is an Event is waited for."""
    known = {Path("/a"): 10, Path("/b"): 20, Path("/gone"): None, Path("/hangs"): threading.Event()}

    def free_bytes(folder):
        free = known[folder]
        if isinstance(free, threading.Event):
            free.wait(PATIENCE_S)
            return 30
        return free

    monkeypatch.setattr(disk_space, "free_bytes", free_bytes)
    monkeypatch.setattr(disk_space, "_POLL_PERIOD_S", 0.01)
    return known


@pytest.fixture
def space(disks):
    made = DiskSpaceMonitor(Path("/a"))
    yield made
    disks[Path("/hangs")].set()
    made.stop()
    made._thread.join(PATIENCE_S)
    assert not made._thread.is_alive()


def test_it_follows_what_is_free_and_one_folder_after_another(disks, space):
    wait_until(lambda: space.free_bytes == 10)
    disks[Path("/a")] = 11
    wait_until(lambda: space.free_bytes == 11)
    space.begin(Path("/b"), DEMAND)
    assert space.free_bytes == 20
    space.begin(Path("/gone"), DEMAND)
    assert space.free_bytes is None


def test_no_folder_has_no_figure_until_a_run_names_one(disks):
    space = DiskSpaceMonitor(None)
    time.sleep(0.05)
    assert space.free_bytes is None
    space.begin(Path("/b"), DEMAND)
    assert space.free_bytes == 20
    space.stop()


def test_a_disk_that_hangs_from_the_start_holds_nobody_up(disks):
    space = DiskSpaceMonitor(Path("/hangs"))
    assert space.free_bytes is None
    disks[Path("/hangs")].set()
    wait_until(lambda: space.free_bytes == 30)
    space.stop()


def test_a_disk_that_begins_to_hang_holds_nobody_up(disks, space):
    wait_until(lambda: space.free_bytes == 10)
    disks[Path("/a")] = disks[Path("/hangs")]
    time.sleep(0.05)
    assert space.free_bytes == 10, "what was known last"
    space.begin(Path("/b"), DEMAND)
    assert space.free_bytes == 20
    disks[Path("/hangs")].set()
    time.sleep(0.05)
    assert space.free_bytes == 20, "never what another folder has"
