"""Which files of a folder are taken, and when."""

import os

import pytest

from app.runs.exchange.arrivals import READABLE, Arrivals


@pytest.fixture
def arrivals(tmp_path):
    return Arrivals(tmp_path, READABLE)


def test_a_file_is_taken_once_when_it_has_not_changed_between_two_looks(tmp_path, arrivals) -> None:
    file = tmp_path / "a.csv"
    file.write_text("1")
    assert arrivals.look() == []
    file.write_text("12")
    assert arrivals.look() == []
    assert arrivals.look() == [file]
    assert not arrivals.take(file)
    assert arrivals.look() == []


def test_a_file_that_changes_after_it_was_taken_is_taken_again(tmp_path, arrivals) -> None:
    file = tmp_path / "a.csv"
    file.write_text("1")
    arrivals.look()
    arrivals.look()
    arrivals.take(file)
    file.write_text("12")
    arrivals.look()
    assert arrivals.look() == [file]
    assert arrivals.take(file)


def test_files_come_in_the_order_of_their_last_change_and_others_are_passed_over(tmp_path, arrivals) -> None:
    names = ("b.csv", "a.CSV", "c.tdms", ".hidden.csv", "~$open.xlsx", "note.pdf", "empty.csv")
    for age, name in enumerate(names):
        (tmp_path / name).write_text("" if name == "empty.csv" else "1")
        os.utime(tmp_path / name, (1e9 + age, 1e9 + age))
    (tmp_path / "folder.csv").mkdir()
    assert [path.name for path in arrivals.look(at_once=True)] == ["b.csv", "a.CSV", "c.tdms"]
