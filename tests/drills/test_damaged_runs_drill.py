"""The short form of the drill with damaged run files."""

from tests.drills.damaged_runs import damaged_runs


def test_damaged_files_open_or_are_refused(tmp_path):
    report = damaged_runs(150, tmp_path, seed=5)
    assert not report.faults, str(report)
    assert report.refused > 75
