"""A short form of the drill in `disk_full`."""

import subprocess
import sys

import pytest

from app.acquisition.messages import EndReason
from tests.drills.disk_full import bench_in, disk_full, may_mount, recorded

small_disk = pytest.mark.skipif(not may_mount(), reason="this user may not mount a small disk")
linux = pytest.mark.skipif(sys.platform != "linux", reason="only Linux limits files of a running process")


@pytest.mark.parametrize(
    "way", [pytest.param("limit", marks=linux), pytest.param("filled", marks=small_disk)]
)
def test_a_full_disk_ends_the_run_and_loses_nothing(tmp_path, way):
    report = disk_full(1, tmp_path, way, seed=4)
    assert not report.faults, report
    assert report.runs == 1
    assert report.recovered == report.samples > 0


@small_disk
def test_a_read_only_folder_is_refused_and_the_connection_stays(tmp_path):
    with bench_in(tmp_path, "filled") as bench:
        subprocess.run(["mount", "-o", "remount,ro", str(bench.folder)], check=True)
        refused = recorded(bench, bench.folder)
        assert (refused.ended, refused.path) == (EndReason.WRITE_ERROR, "")
        assert "Read-only file system). Choose a folder that you may write to" in str(refused.message)
        (tmp_path / "elsewhere").mkdir()
        assert recorded(bench, tmp_path / "elsewhere").ended is EndReason.DURATION
