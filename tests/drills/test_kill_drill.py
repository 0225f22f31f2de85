"""Short forms of the drills in `kill_engine` and `kill_window`."""

import sys

import pytest

from tests.drills.kill_engine import kill_engine
from tests.drills.kill_window import kill_window

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no pseudo-terminals")


@pytest.mark.parametrize("kind", ["pullback", "none"])
def test_a_killed_engine_loses_a_tenth_of_a_second_at_most(tmp_path, kind):
    report = kill_engine(2, tmp_path, 2000.0, kind, seed=3)
    assert not report.faults, report
    assert report.kills == 2


def test_a_killed_window_leaves_its_run_finished_and_stored(tmp_path):
    report = kill_window(2, tmp_path, seed=3)
    assert not report.faults, report
    assert report.kills == 2
