"""A short form of the drill in `disk_full`."""

import sys

import pytest

from tests.drills.disk_full import disk_full, may_mount

small_disk = pytest.mark.skipif(not may_mount(), reason="this user may not mount a small disk")
linux = pytest.mark.skipif(sys.platform != "linux", reason="only Linux limits files of a running process")


@pytest.mark.parametrize(
    "way", [pytest.param("limit", marks=linux), pytest.param("filled", marks=small_disk)]
)
def test_a_full_disk_ends_the_run_and_loses_nothing(way):
    report = disk_full(1, way, seed=4)
    assert not report.faults, report
    assert report.runs == 1
    assert report.recovered == report.samples > 0
