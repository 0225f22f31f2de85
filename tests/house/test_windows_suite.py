"""Parts of the tests under Wine: all but firmware are in one, and none counts that did not run."""

import pytest

from tools.windows.environment import PROJECT
from tools.windows.suite import PARTS, paths_of, read_result

_SAID = """\
3 workers [7 items]

scheduling tests via LoadFileScheduling

tests/a/test_b.py::test_passes[COM 1]
tests/a/test_c.py::test_fails
[gw0] [ 14%] PASSED tests/a/test_b.py::test_passes[COM 1]
[gw2] [ 28%] FAILED tests/a/test_c.py::test_fails
[gw0] [ 42%] SKIPPED tests/a/test_b.py::test_is_skipped
[gw1] [ 57%] PASSED tests/a/test_d.py::test_leaves_a_thread
[gw1] [ 57%] ERROR tests/a/test_d.py::test_leaves_a_thread
tests/a/test_b.py::test_hangs
"""


def test_every_test_file_is_of_one_part() -> None:
    parts = {part: paths_of(part) for part in PARTS}
    for file in PROJECT.glob("tests/**/test_*.py"):
        of = [part for part, paths in parts.items() if any(file.is_relative_to(path) for path in paths)]
        assert len(of) == (file.parent.name != "firmware"), f"{file}: {of}"


def test_what_ended_is_counted_and_the_rest_was_not_run() -> None:
    found = read_result("drivers", _SAID, 12.0, "0cdd80ff")
    assert (found.passed, found.skipped, found.not_run) == (1, 1, 3)
    assert found.failed == ("tests/a/test_c.py::test_fails", "tests/a/test_d.py::test_leaves_a_thread")


@pytest.mark.parametrize("said", ["", "ImportError"])
def test_a_process_that_said_nothing_passed_nothing(said: str) -> None:
    assert read_result("drivers", said, 1.0, "0cdd80ff").passed == 0
