"""Disk space: what a run needs, and when it is refused, warned of, and ended."""

import pytest

from app.acquisition import disk_space
from app.acquisition.disk_space import DiskDemand, DiskSpaceMonitor, check_disk_space
from app.acquisition.errors import DiskSpaceError
from app.acquisition.messages import RunSettings
from app.runs.disk import free_bytes, has_free_space
from messages.message import EMPTY

DEMAND = DiskDemand(rate_hz=10_000.0, wire_bytes_per_s=90_000.0)
PULLBACK = RunSettings("/runs", duration_s=60.0, pretrigger_s=1.0, trigger_timeout_s=600.0)
AT_ONCE = RunSettings("/runs", duration_s=60.0, trigger="none")


@pytest.fixture
def disk(monkeypatch):
    """Sets the free bytes that the system tells."""

    def set_free(size: float | None) -> None:
        monkeypatch.setattr(disk_space, "free_bytes", lambda _: None if size is None else int(size))

    return set_free


def test_what_a_run_takes():
    # 60 s of rows at 41 B, the received bytes twice (journal and copy), 24 B for each of 250 reads a second
    rows, wire, reads, closing = 600_000 * 41, 2 * 60 * 90_000, 60 * 6000, 4 << 20
    assert DEMAND.of_run(AT_ONCE) == rows + wire + reads + closing
    assert DEMAND.of_waiting(AT_ONCE) == 0.0
    assert DEMAND.of_run(PULLBACK) == pytest.approx((rows + wire + reads) * 61 / 60 + closing)
    assert DEMAND.of_waiting(PULLBACK) == 600 * (90_000 + 6000)


def test_a_run_without_room_is_refused_with_figures(disk, tmp_path):
    disk(DEMAND.of_run(AT_ONCE) - 1)
    with pytest.raises(
        DiskSpaceError, match=r"the disk has 40\.0 MB left, and this run takes 40\.0 MB\. Free"
    ):
        check_disk_space(tmp_path, AT_ONCE, DEMAND)
    disk(DEMAND.of_run(AT_ONCE))
    assert str(check_disk_space(tmp_path, AT_ONCE, DEMAND)) == ""
    disk(None)
    assert str(check_disk_space(tmp_path, AT_ONCE, DEMAND)) == ""


@pytest.mark.parametrize("files", [1, 5])
def test_a_run_is_refused_where_the_disk_takes_too_few_files(disk, tmp_path, monkeypatch, files):
    disk(DEMAND.of_run(AT_ONCE))
    monkeypatch.setattr(disk_space, "free_files", lambda _: files)
    with pytest.raises(DiskSpaceError, match=f"takes only {files} more files, and this run 6. Remove some"):
        check_disk_space(tmp_path, AT_ONCE, DEMAND)


@pytest.mark.parametrize("files", [None, 0, 6])
def test_a_disk_that_knows_no_number_of_files_is_recorded_to(disk, tmp_path, monkeypatch, files):
    disk(DEMAND.of_run(AT_ONCE))
    monkeypatch.setattr(disk_space, "free_files", lambda _: files)
    assert str(check_disk_space(tmp_path, AT_ONCE, DEMAND)) == ""


def test_a_long_wait_without_room_is_said_at_arming(disk, tmp_path):
    disk(DEMAND.of_run(PULLBACK) + 300 * DEMAND.journal_bytes_per_s)
    assert "if the release comes within 5 minutes" in str(check_disk_space(tmp_path, PULLBACK, DEMAND))
    disk(DEMAND.of_run(PULLBACK) + DEMAND.of_waiting(PULLBACK))
    assert str(check_disk_space(tmp_path, PULLBACK, DEMAND)) == ""


def test_a_disk_that_fills_up_is_warned_of_once_and_the_run_ended_in_time(tmp_path):
    monitor, journal_bytes = DiskSpaceMonitor(tmp_path), 10_000_000
    monitor.begin(tmp_path, DEMAND)
    monitor.stop()
    per_s = DEMAND.run_bytes_per_s + DEMAND.journal_bytes_per_s

    def check(spare_s: float):
        monitor.free_bytes = int(journal_bytes + (4 << 20) + spare_s * per_s)
        return monitor.check(journal_bytes)

    assert check(61) == EMPTY
    assert "enough for 59 s more" in str(check(59))
    assert check(59) == EMPTY
    with pytest.raises(DiskSpaceError, match="which closing this run takes"):
        check(2.9)
    monitor.free_bytes = None
    assert monitor.check(journal_bytes) == EMPTY


def test_the_room_of_a_folder_that_is_not_there_yet_is_that_of_the_one_above(tmp_path):
    free = free_bytes(tmp_path / "not" / "yet")
    assert free == pytest.approx(free_bytes(tmp_path), rel=0.05)
    assert has_free_space(tmp_path / "not" / "yet", 1000)
    assert not has_free_space(tmp_path, 1 << 60)
