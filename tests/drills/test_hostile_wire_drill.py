"""A short form of the drill in `hostile_wire`."""

from tests.drills.hostile_wire import hostile_wire


def test_an_address_that_does_not_resolve_is_told_as_such(tmp_path):
    report = hostile_wire("unknown name", tmp_path)
    assert not report.faults, report
    assert "is not known in this network" in report.said
