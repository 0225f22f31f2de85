"""Short forms of the drill in `starved`."""

import sys

import pytest

from tests.drills.disk_full import disk_full
from tests.drills.kill_engine import kill_engine
from tests.drills.kill_window import kill_window
from tests.drills.starved import starved_runs
from tests.drills.starving import ROLES

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="finds and stops processes as Linux lists them"
)


def test_a_starved_engine_connects_and_records_all_that_reached_it(tmp_path):
    report = starved_runs(1, tmp_path, seed=2)
    assert not report.faults, report
    assert report.runs == 1
    assert report.stops > 0


@pytest.mark.parametrize("drill", [kill_window, kill_engine])
def test_a_kill_among_starved_programs_is_as_good_as_any(tmp_path, drill):
    report = drill(1, tmp_path, seed=3, starve=tuple(ROLES))
    assert not report.faults, report
    assert report.kills == 1


def test_a_full_disk_among_starved_programs_loses_nothing(tmp_path):
    report = disk_full(1, tmp_path, "limit", seed=4, starve=tuple(ROLES))
    assert not report.faults, report
    assert report.runs == 1
