"""Edits can be undone, one after another; nothing is removed."""

import pytest
from runs_kit import small_run

from app.runs.edits import edit_run, undo_edit
from app.runs.errors import MetadataError, UnsuitableRunError
from app.runs.metadata import Conditions
from app.runs.reader import open_run


@pytest.fixture
def run_path(tmp_path, metadata):
    small_run(tmp_path / "run.h5", metadata)
    return tmp_path / "run.h5"


def test_edits_are_undone_from_the_last_to_the_first(run_path, metadata):
    edit_run(run_path, "Ada", note="first", plate_mass_kg=30.0)
    edit_run(run_path, "Ada", note="second", conditions=Conditions(temperature_c=3.0))
    undo_edit(run_path, "Bob")
    assert open_run(run_path).metadata == metadata.replace(note="first", plate_mass_kg=30.0)
    undo_edit(run_path, "Bob")
    run = open_run(run_path)
    assert run.metadata == metadata
    assert [change.undoes for change in run.changes] == [None, None, 1, 0]
    with pytest.raises(UnsuitableRunError, match="no edit to undo"):
        undo_edit(run_path, "Bob")


def test_an_edit_after_an_undoing_is_the_next_to_be_undone(run_path, metadata):
    edit_run(run_path, "Ada", note="first")
    undo_edit(run_path, "Ada")
    edit_run(run_path, "Ada", series="2SSM0")
    undo_edit(run_path, "Ada")
    assert open_run(run_path).metadata == metadata
    assert len(open_run(run_path).changes) == 4


def test_why_a_run_does_not_count_is_an_edit_that_is_undone_whatever_was_edited_since(run_path, metadata):
    edit_run(run_path, "Ada", excluded="touched")
    edit_run(run_path, "Ada", note="first")
    assert open_run(run_path).metadata == metadata.replace(excluded="touched", note="first")
    undo_edit(run_path, "Ada", ("excluded",))
    assert open_run(run_path).metadata == metadata.replace(note="first")
    with pytest.raises(UnsuitableRunError, match="no edit to undo"):
        undo_edit(run_path, "Ada", ("excluded",))
    undo_edit(run_path, "Ada")
    assert open_run(run_path).metadata == metadata


def test_what_was_edited_again_since_stays_when_an_earlier_edit_is_undone(run_path, metadata):
    edit_run(run_path, "Ada", series="2SSM0", plate_mass_kg=30.0)
    edit_run(run_path, "Ada", plate_mass_kg=31.0)
    undo_edit(run_path, "Ada", ("series",))
    assert open_run(run_path).metadata == metadata.replace(plate_mass_kg=31.0)


@pytest.mark.parametrize("reason", ["two\nlines", "x" * 201])
def test_a_reason_is_one_line(run_path, metadata, reason):
    with pytest.raises(MetadataError, match=r"excluded = .* is not a line of text"):
        edit_run(run_path, "Ada", excluded=reason)
    assert open_run(run_path).metadata == metadata


def test_a_new_run_that_does_not_count_says_so(tmp_path, metadata):
    left_out = metadata.replace(excluded="made up")
    small_run(tmp_path / "made.h5", left_out)
    assert open_run(tmp_path / "made.h5").metadata == left_out


@pytest.mark.parametrize("text", ["a\0b", "\ud800"])
def test_a_text_that_the_file_cannot_hold_is_refused(run_path, text):
    with pytest.raises(MetadataError, match="title"):
        edit_run(run_path, "Ada", title=text)
    assert open_run(run_path).changes == ()


@pytest.mark.usefixtures("symbolic_links")
def test_an_edit_through_a_link_changes_the_run_and_leaves_the_link(run_path):
    link = run_path.with_name("link.h5")
    link.symlink_to(run_path.name)
    edit_run(link, "Ada", note="by its link")
    assert link.is_symlink()
    assert open_run(run_path).metadata.note == "by its link"
