"""Checks shared by the tests of the command line."""

from typing import Any


def assert_one_error_line(outcome: Any, said: str) -> None:
    """The command could not do it, and says so in one line on stderr that names the value."""
    assert outcome.code == 1
    assert outcome.out == ""
    lines = outcome.err.strip().splitlines()
    assert len(lines) == 1, outcome.err
    assert lines[0].startswith("error: ")
    assert said in lines[0]
