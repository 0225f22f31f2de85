"""Short forms of the drills in `resources` and `clock`."""

import sys

import pytest

from tests.drills.clock import set_clock
from tests.drills.preload import has_compiler
from tests.drills.resources import lacking


@pytest.mark.skipif(sys.platform != "linux", reason="limits are set as Linux takes them")
@pytest.mark.parametrize("program", ["record", "window"])
def test_a_program_without_open_files_ends_with_a_line(tmp_path, program):
    report = lacking(program, "10 files", tmp_path)
    assert not report.faults, report
    assert report.code == 1


@pytest.mark.skipif(not has_compiler(), reason="there is no C compiler, or this is not Linux")
def test_a_run_keeps_its_times_while_the_clock_is_set(tmp_path):
    report = set_clock("seven hours back", tmp_path)
    assert not report.faults, report
    assert report.samples > 0
