"""A short form of the drill in `unplug`."""

import sys

import pytest

from tests.drills.unplug import unplug
from tests.drills.unplug_pair import unplug_pair

LONG_S = 12.0
"""A busy computer pulls the cable and sees the return late."""


@pytest.mark.parametrize(
    ("kind", "tcp"),
    [
        pytest.param(
            "unplug",
            False,
            marks=pytest.mark.skipif(sys.platform == "win32", reason="Windows has no pseudo-terminals"),
        ),
        ("power", True),
    ],
)
def test_a_run_goes_on_over_a_pulled_cable(tmp_path, kind, tcp):
    report = unplug(1, tmp_path, kind, tcp, seed=2, duration_s=LONG_S)
    assert not report.faults, report
    assert report.runs == 1
    assert report.missing + report.missing_estimated > 0


def test_a_run_goes_on_with_one_of_two_devices(tmp_path):
    report = unplug_pair(1, tmp_path, "power", tcp=True, seed=2, duration_s=LONG_S)
    assert not report.faults, report
    assert report.runs == 1
    assert report.missing + report.missing_estimated > 0
