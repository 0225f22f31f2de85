"""`slipstand figures`: what is written, refused and left out."""

import os
from pathlib import Path

import pytest
from cli_kit import assert_one_error_line
from reports_kit import write_run


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("campaign")
    write_run(folder / "first.h5", seed=1)
    write_run(folder / "other.h5", "3SSM0", seed=2, friction_dynamic=0.8)
    return folder


def test_folder_gives_fig_2_and_the_papers_run(slipstand, folder, tmp_path):
    some = ("--figure", "4a", "--figure", "2", "--figure", "3b")
    said = slipstand("figures", folder, "-o", tmp_path / "out", "--format", "svg", *some, "--json")

    assert said.code == 0
    written = said.json["figures"]
    assert [one["figure"] for one in written] == ["2", "3b", "4a"]
    for one in written:
        file = Path(one["file"])
        assert file.is_absolute()
        assert file.read_bytes().startswith(b"<?xml")
        assert one["run"] == ("" if one["figure"] == "2" else str(folder / "first.h5"))
    assert not [file for file in (tmp_path / "out").iterdir() if file.name.startswith(".")]


def test_run_without_slip_leaves_out_what_it_cannot_show(slipstand, folder, tmp_path):
    said = slipstand("figures", folder / "other.h5", "-o", tmp_path, "--figure", "3a", "--figure", "5a")

    assert said.code == 0
    assert [file.name for file in tmp_path.iterdir()] == ["other-fig3a.png"]
    assert "no law of motion was fitted, Figs. 5a are left out" in said.err


def test_nothing_is_overwritten_without_force(slipstand, folder, tmp_path):
    (tmp_path / "fig2.png").write_text("mine", "utf-8")
    refused = slipstand("figures", folder, "-o", tmp_path, "--figure", "2")

    assert refused.code == 1
    assert "fig2.png exists already" in refused.err
    assert (tmp_path / "fig2.png").read_text("utf-8") == "mine"
    assert slipstand("figures", folder, "-o", tmp_path, "--figure", "2", "--force").code == 0
    assert (tmp_path / "fig2.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("options", "fault"),
    [
        (("--format", "gif"), "--format 'gif' is not known"),
        (("--figure", "9"), "--figure '9' is not known"),
        (("--series", "9XXM0"), "series '9XXM0' has no run"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(slipstand, folder, tmp_path, options, fault):
    said = slipstand("figures", folder, "-o", tmp_path / "out", *options)

    assert said.code == 1
    assert fault in said.err
    assert said.err.count("\n") == 1


def test_a_folder_that_cannot_be_made_and_one_without_runs_are_told(slipstand, folder, tmp_path):
    (tmp_path / "file").write_text("", "utf-8")
    unwritable = slipstand("figures", folder, "-o", tmp_path / "file" / "out")
    empty = slipstand("figures", tmp_path, "-o", tmp_path / "out")

    assert unwritable.code == empty.code == 1
    assert "cannot be written" in unwritable.err
    assert "there are no runs" in empty.err


def test_nothing_is_made_where_nothing_can_be_drawn(slipstand, folder, tmp_path):
    missing = slipstand("figures", tmp_path / "nowhere.h5", "-o", tmp_path / "out")
    without_slip = slipstand("figures", folder / "other.h5", "-o", tmp_path / "out", "--figure", "5a")

    assert_one_error_line(missing, "nowhere.h5: there is no such file")
    assert without_slip.code == 0
    assert without_slip.err.startswith("note: ")
    assert not (tmp_path / "out").exists()


def test_a_folder_that_takes_no_files_is_told_before_runs_are_read(slipstand, folder, tmp_path):
    locked = tmp_path / "locked"
    locked.mkdir()
    locked.chmod(0o555)
    if os.access(locked, os.W_OK):
        pytest.skip("this user may write everywhere")

    assert_one_error_line(slipstand("figures", folder, "-o", locked / "out"), "cannot be written")
