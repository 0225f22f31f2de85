"""The short form of the drill with hostile settings and CSV files."""

from tests.drills.hostile_texts import hostile_texts


def test_texts_are_taken_or_refused(tmp_path):
    report = hostile_texts(600, tmp_path, seed=5)
    assert not report.faults, str(report)
    assert report.refused > 200
