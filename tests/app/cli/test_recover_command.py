"""`slipstand recover`, and the commands that mention it."""

import pytest
from cli_kit import assert_one_error_line
from recovery_kit import Desk, reads, wire

from app.runs.lock import recording_lock
from app.runs.reader import open_run
from app.runs.writer_client import WriterClient


@pytest.fixture
def cut_short(tmp_path):
    """A run whose engine was killed."""
    with WriterClient.start() as writer:
        desk = Desk(tmp_path, writer, "slipstand-binary")
        desk.arm(duration_s=60.0)
        for read in reads(wire("slipstand-binary")):
            desk.take(read)
            if desk.history.next_index > 2600:
                break
        desk.kill()
    return next(tmp_path.glob("*.h5"))


def test_recover_rebuilds_the_run_and_says_so(slipstand, cut_short):
    outcome = slipstand("recover", cut_short.parent)
    run = open_run(cut_short)
    assert (outcome.code, outcome.err) == (0, "")
    assert outcome.out == f"{cut_short}: {len(run)} samples recovered, ended: interrupted\n"
    again = slipstand("recover", cut_short.parent)
    assert (again.code, again.out.startswith("No journals in")) == (0, True)


def test_recover_as_json(slipstand, cut_short):
    (found,) = slipstand("recover", cut_short.parent, "--json").json
    assert (found["state"], found["run"]) == ("recovered", str(cut_short))
    assert found["samples"] == len(open_run(cut_short))
    assert slipstand("recover", cut_short.parent, "--json").json == []


def test_garbage_is_one_error_line_and_does_not_stop_the_rest(slipstand, cut_short):
    garbage = cut_short.with_name("a.journal")
    garbage.write_bytes(b"nothing of ours")
    outcome = slipstand("recover", cut_short.parent)
    assert outcome.code == 1
    assert outcome.err == f"error: {garbage} is not a journal of Slipstand. Nothing was done to it\n"
    assert "samples recovered" in outcome.out
    assert [path.name for path in cut_short.parent.glob("*.journal")] == ["a.journal"]
    assert_one_error_line(slipstand("recover", cut_short), "no such folder")


def test_a_journal_of_a_living_engine_is_let_alone(slipstand, cut_short):
    (journal,) = cut_short.parent.glob("*.journal")
    before = journal.read_bytes()
    with recording_lock(journal):
        outcome = slipstand("recover", cut_short.parent)
        assert "cut short" not in slipstand("runs", cut_short.parent).err
    assert (outcome.code, "is being recorded" in outcome.out) == (0, True)
    assert journal.read_bytes() == before


def test_runs_and_analyze_say_how_to_rebuild_what_was_cut_short(slipstand, cut_short):
    listed = slipstand("runs", cut_short.parent)
    assert f"slipstand recover {cut_short.parent}" in listed.err
    assert len(listed.err.splitlines()) == 1
    analyzed = slipstand("analyze", cut_short, "--json")
    assert f"slipstand recover {cut_short.parent}" in analyzed.err
    assert analyzed.json
    slipstand("recover", cut_short.parent)
    assert slipstand("runs", cut_short.parent).err == ""
    assert slipstand("analyze", cut_short, "--json").err == ""


def test_record_mentions_it_before_it_begins(slipstand, cut_short):
    outcome = slipstand(
        "record", "--port", "/dev/no-such-port", "--protocol", "csv", "--directory", cut_short.parent
    )
    assert f"slipstand recover {cut_short.parent}" in outcome.err
    assert outcome.code == 1


def test_without_a_recordings_folder_there_is_nothing_to_do(slipstand, tmp_path, monkeypatch):
    monkeypatch.setenv("SLIPSTAND_RECORDINGS", str(tmp_path / "none"))
    outcome = slipstand("recover")
    assert (outcome.code, outcome.out.startswith("No journals in")) == (0, True)


def test_journals_that_had_to_move_are_found_without_being_asked_for(slipstand, cut_short, monkeypatch):
    monkeypatch.setattr("app.cli.recover.recordings_directory", lambda: cut_short.parent / "none")
    monkeypatch.setattr("app.cli.recover.journal_fallback_folders", lambda: [cut_short.parent])
    assert f"slipstand recover {cut_short.parent}" in slipstand("runs", cut_short.parent.parent).err
    (found,) = slipstand("recover", "--json").json
    assert (found["state"], found["run"]) == ("recovered", str(cut_short))
