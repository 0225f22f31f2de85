"""A short form of the drill in `power_loss`."""

import pytest

from tests.drills.power_loss import power_loss
from tests.drills.system_calls import has_strace


@pytest.mark.skipif(not has_strace(), reason="strace is absent, or may not be used here")
def test_all_that_was_synced_or_told_comes_back_after_a_power_cut(tmp_path):
    report = power_loss(15, tmp_path, seed=1)
    assert not report.faults, report
    assert report.states == 15
    assert report.samples > 0
    assert report.recovered > 0
