"""Runs, folders and amplifiers used last: newest first, few, saved at once."""

from pathlib import Path

from app.presenters.recent import FOLDERS_MAX, RUNS_MAX, RecentItems
from config.schema import ConfigError, RecentUse


def test_the_newest_comes_first_and_once() -> None:
    recent = RecentItems()
    for name in ("a", "b", "a"):
        recent.add_run(name)
    assert recent.runs == ("a", "b")
    for number in range(20):
        recent.add_run(str(number))
        recent.add_folder(str(number))
    assert (len(recent.runs), len(recent.folders)) == (RUNS_MAX, FOLDERS_MAX)
    assert recent.runs[0] == "19"


def test_a_run_that_is_gone_is_forgotten() -> None:
    recent = RecentItems(RecentUse(runs=("a", "b")))
    recent.remove_runs(["a"])
    assert recent.runs == ("b",)


def test_changes_are_saved_and_only_those() -> None:
    saved: list[RecentUse] = []
    recent = RecentItems(save=saved.append)
    recent.add_run("a")
    recent.add_run("a")
    tables, logger = str(Path("/tables")), str(Path("/logger"))
    recent.set_export_target("/tables/table.csv")
    recent.set_import_file("/logger/a.csv")
    assert saved == [
        RecentUse(runs=("a",)),
        RecentUse(runs=("a",), export_folder=tables),
        RecentUse(runs=("a",), export_folder=tables, import_folder=logger),
    ]


def test_the_recordings_are_always_among_the_folders() -> None:
    recent = RecentItems(RecentUse(folders=("/b", "/a")))
    assert recent.folders_with("/a") == ("/b", "/a")
    assert recent.folders_with("/c") == ("/b", "/a", "/c")


def test_a_file_that_cannot_be_written_is_reported_and_the_item_holds() -> None:
    def save(_: RecentUse) -> None:
        raise ConfigError("disk full")

    errors: list[ConfigError] = []
    recent = RecentItems(save=save, report_error=errors.append)
    recent.add_run("a")
    assert (recent.runs, [str(error) for error in errors]) == (("a",), ["disk full"])
