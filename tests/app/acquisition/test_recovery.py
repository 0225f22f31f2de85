"""Runs rebuilt from journals are bit-identical to runs that were closed."""

import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from raw_bytes_kit import load_raw_bytes
from recovery_kit import (
    COUNTS,
    IDENTIFIER,
    PER_FRAME,
    RATE_HZ,
    RELEASED,
    TIME_BASE,
    Desk,
    assert_same,
    datasets,
    reads,
    wire,
)

from app.acquisition.errors import RecoveryError
from app.acquisition.journal import recovery
from app.acquisition.journal.recovery import RecoveryState, recover_folder, recover_journal
from app.acquisition.messages import EndReason
from app.runs.edits import edit_run
from app.runs.errors import DamagedRunError
from app.runs.journal import MAGIC, RecordKind, encode_record, read_journal, unfinished_journals
from app.runs.lock import recording_lock
from app.runs.reader import load_counts, open_run
from drivers.samples import SampleStatus
from messages.message import message
from tests.app.acquisition.test_hanging_disk import HangingFile
from tests.waiting import wait_until

pytestmark = pytest.mark.usefixtures("no_thread_is_left")

DRIVERS = ("slipstand-binary", "csv")


def recorded(desk, all_reads, *, armed_at=0, until=3000, **settings):
    """Feed reads, armed from sample `armed_at` on, up to the one that brings sample `until`."""
    for read in all_reads:
        if desk.recording is None and desk.history.next_index >= armed_at:
            desk.arm(**settings)
        desk.take(read)
        if desk.history.next_index >= until:
            break


def kept_journal(desk):
    """A second name for the journal, which stays when its run is safe."""
    copy = desk.folder / "kept" / "again.journal"
    copy.parent.mkdir()
    os.link(desk.journal, copy)
    return copy


@pytest.mark.parametrize("protocol", DRIVERS)
@pytest.mark.parametrize(
    ("faults", "armed_at", "history_s", "settings"),
    [
        (0, 0, 10.0, {}),
        (25, 270, 10.0, {}),
        (25, 300, 0.3, {"pretrigger_s": 0.5}),
        (10, 300, 0.2, {"trigger": "none", "duration_s": 2.0}),
    ],
)
def test_a_recovered_run_is_the_closed_one_to_the_bit(
    tmp_path, writer, protocol, faults, armed_at, history_s, settings
):
    """Closed as usual, and rebuilt from its own journal: every dataset and attribute is compared."""
    desk = Desk(tmp_path, writer, protocol, history_s=history_s)
    pending = reads(wire(protocol, faults), **({"broken_after": 15_000} if faults else {}))
    recorded(desk, pending, armed_at=armed_at, until=armed_at + 60, **settings)
    copy = kept_journal(desk)
    for read in pending:
        desk.take(read)
    ended = desk.ended()
    assert not desk.journal.exists()
    assert ended.ended == "duration"

    (recovered,) = recover_folder(copy.parent)
    assert (recovered.state, recovered.samples) == (RecoveryState.RECOVERED, ended.samples)
    assert not copy.exists()
    assert_same(datasets(recovered.run), datasets(ended.path))
    if faults:
        assert ended.missing + ended.missing_estimated + ended.damaged > 0


@pytest.mark.parametrize("ahead", [1, 3, 40])
def test_what_is_in_the_journal_before_it_is_decoded_changes_no_bit(tmp_path, writer, ahead):
    """The engine is so many reads behind its port all the time; marks and the beginning are told late."""
    desk = Desk(tmp_path, writer, "slipstand-binary", history_s=0.4)
    pending = reads(wire("slipstand-binary", 25), broken_after=15_000)
    recorded(desk, pending, armed_at=300, until=310, pretrigger_s=0.3)
    copy = kept_journal(desk)
    for number, read in enumerate(pending):
        desk.hear(read)
        if number >= ahead:
            desk.decode()
    ended = desk.ended()
    (recovered,) = recover_folder(copy.parent)
    assert recovered.samples == ended.samples
    assert not open_run(recovered.run).end.message
    assert_same(datasets(recovered.run), datasets(ended.path))


@pytest.mark.parametrize("hangs", ["write", "sync"])
def test_a_journal_that_goes_on_elsewhere_is_rebuilt_from_its_first_sample(tmp_path, writer, hangs):
    desk = Desk(tmp_path, writer, "slipstand-binary")
    pending = reads(wire("slipstand-binary"))
    recorded(desk, pending, armed_at=300, until=700, trigger="none", duration_s=60.0)
    journal = desk._journal
    old, file = journal._thread, journal._file
    wait_until(lambda: journal.written == journal.size)
    file._fallback_folders = [tmp_path / "other"]
    disk = HangingFile(file._file)
    if hangs == "write":
        file._file = disk
        desk.take(next(pending))
        assert disk.is_asked.wait(10.0)
        assert journal.leave_hanging_disk()
    else:
        journal._file = file.successor()
        journal.left = desk.journal
    for read in pending:
        desk.take(read)
    desk.recording.end(EndReason.WRITE_ERROR, message("it hung"))
    desk.ended()
    disk.is_there.set()
    old.join(10.0)
    file.close()
    file.release()
    parts = []
    for name, path in (("before", desk.journal), ("since", journal.path)):
        place = tmp_path / name
        place.mkdir()
        shutil.copy(path, place)
        (found,) = recover_folder(place)
        parts.append(open_run(found.run))
    before, since = parts
    begins = len(COUNTS) - len(since)
    armed = int(np.flatnonzero((load_counts(before)[0] == COUNTS).all(axis=1))[0])
    assert np.array_equal(load_counts(before), COUNTS[armed : armed + len(before)])
    assert np.array_equal(load_counts(since)[PER_FRAME:], COUNTS[begins + PER_FRAME :])
    assert begins + PER_FRAME <= armed + len(before), "no sample is in neither"
    assert since.end.ended == EndReason.WRITE_ERROR
    assert since.end.losses.samples == len(since)
    assert since.end.events.release_s == pytest.approx((RELEASED - begins) / RATE_HZ, abs=0.02)


def test_what_a_dying_engine_had_not_decoded_is_recovered(tmp_path, writer):
    desk = Desk(tmp_path, writer, "slipstand-binary")
    pending = reads(wire("slipstand-binary"))
    recorded(desk, pending, until=2000, duration_s=60.0)
    decoded = desk.history.next_index
    for _ in range(5):
        desk.hear(next(pending))
    desk.kill()
    (recovered,) = recover_folder(tmp_path)
    run = open_run(recovered.run)
    counts = load_counts(run)
    last = decoded - (RELEASED - round(RATE_HZ))
    assert len(run) > last + 20
    np.testing.assert_array_equal(counts, COUNTS[decoded - last :][: len(run)])


@pytest.mark.parametrize("protocol", DRIVERS)
def test_a_run_whose_engine_died_has_every_sample_and_all_that_was_known(tmp_path, writer, protocol):
    desk = Desk(tmp_path, writer, protocol)
    recorded(desk, reads(wire(protocol)), until=2600, duration_s=60.0)
    last = desk.history.next_index
    desk.kill()
    early = open_run(next(tmp_path.glob("*.h5")))
    assert early.end.ended == "interrupted"

    (recovered,) = recover_folder(tmp_path)
    run = open_run(recovered.run)
    assert recovered.state is RecoveryState.RECOVERED
    assert recovered.kept == ""
    assert [path.name for path in tmp_path.iterdir()] == [early.path.name]
    assert (run.path, run.identifier) == (early.path, IDENTIFIER)
    first = RELEASED - round(RATE_HZ)
    assert len(run) == run.losses.samples == pytest.approx(last - first, abs=2)
    assert len(run) >= len(early)
    left_out = protocol == "csv"  # the first line may be the end of one
    np.testing.assert_array_equal(load_counts(run), COUNTS[left_out:][last - len(run) : last])
    assert run.end.ended == "interrupted"
    assert "rebuilt from its journal" in str(run.end.message)
    assert run.events.release_s == 1.0
    assert run.events.pulled_back_s < 0.8
    assert run.end.dwell_s == pytest.approx(1.0 - run.events.pulled_back_s)
    assert run.end.held_m - run.end.zero_m == pytest.approx(run.metadata.pullback_m, rel=0.05)
    assert run.end.time_base == TIME_BASE
    assert run.metadata.operator == "J. Ng"
    received = b"".join(data for data, _ in load_raw_bytes(run).chunks())
    assert received in b"".join(wire(protocol))
    assert len(received) > 0.5 * len(b"".join(wire(protocol)))


@pytest.mark.parametrize("until", [20, 500, 950])
def test_an_engine_that_died_before_the_release_leaves_a_run_too(tmp_path, writer, until):
    """At rest, pulling, held: what came since arming is kept, as when the run is stopped."""
    desk = Desk(tmp_path, writer, "slipstand-binary")
    recorded(desk, reads(wire("slipstand-binary")), until=until)
    desk.kill()
    assert list(tmp_path.glob("*.h5")) == []
    (recovered,) = recover_folder(tmp_path)
    run = open_run(recovered.run)
    assert run.path.name.endswith("_1FFM0_001.h5")
    np.testing.assert_array_equal(load_counts(run), COUNTS[: desk.history.next_index])
    assert run.end.ended == "interrupted"
    assert run.losses.samples == len(run) == recovered.samples


def test_a_release_that_was_not_sure_yet_begins_the_run(tmp_path, writer):
    desk = Desk(tmp_path, writer, "slipstand-binary")
    for number, read in enumerate(reads(wire("slipstand-binary"))):
        if number == 0:
            desk.arm(pretrigger_s=0.25)
        desk.take(read)
        if desk.history.next_index > RELEASED + 0.06 * RATE_HZ:
            break
    desk.kill()
    (recovered,) = recover_folder(tmp_path)
    run = open_run(recovered.run)
    assert run.events.release_s == 0.25
    assert len(run) == pytest.approx(desk.history.next_index - RELEASED + 0.25 * RATE_HZ, abs=3)


def test_every_cut_of_a_journal_gives_its_whole_records(tmp_path, writer):
    """A power cut may tear the last record: all before it counts."""
    desk = Desk(tmp_path, writer, "slipstand-binary")
    recorded(desk, reads(wire("slipstand-binary")), until=2400, duration_s=60.0)
    desk.kill()
    whole = desk.journal.read_bytes()
    records = list(read_journal(desk.journal))
    for place in (len(records) // 2, len(records) - 2):
        for cut in (records[place].end, records[place].end + 5, records[place + 1].end - 1):
            folder = tmp_path / str(cut)
            folder.mkdir()
            (folder / "torn.journal").write_bytes(whole[:cut])
            (recovered,) = recover_folder(folder)
            data = b"".join(d for d, _ in load_raw_bytes(open_run(recovered.run)).chunks())
            expected = [r.data for r in records[: place + 1] if r.kind is RecordKind.WIRE]
            assert b"".join(expected).endswith(data)
            assert recovered.state is RecoveryState.RECOVERED


def test_a_journal_left_over_beside_a_whole_run_only_goes(tmp_path, writer, monkeypatch):
    desk = Desk(tmp_path, writer, "slipstand-binary")
    monkeypatch.setattr("app.acquisition.journal.journal.Journal.remove", lambda _: None)
    recorded(desk, reads(wire("slipstand-binary")))
    ended = desk.ended()
    before = open_run(ended.path).path.read_bytes()
    (recovered,) = recover_folder(tmp_path)
    assert (recovered.state, recovered.run) == (RecoveryState.WHOLE, ended.path)
    assert [path.name for path in tmp_path.iterdir()] == [open_run(ended.path).path.name]
    assert open_run(ended.path).path.read_bytes() == before


def interrupted(tmp_path, writer):
    desk = Desk(tmp_path, writer, "slipstand-binary")
    recorded(desk, reads(wire("slipstand-binary")), until=2600, duration_s=60.0)
    desk.kill()
    return next(tmp_path.glob("*.h5"))


def test_a_file_that_was_edited_meanwhile_is_kept_aside(tmp_path, writer):
    path = interrupted(tmp_path, writer)
    edit_run(path, "J. Ng", note="the cable was pulled")
    edited = path.read_bytes()
    (recovered,) = recover_folder(tmp_path)
    assert recovered.run == str(path)
    assert recovered.kept == f"{path}.before-recovery"
    assert (tmp_path / f"{path.name}.before-recovery").read_bytes() == edited
    assert open_run(path).metadata.note == "dry"


@pytest.mark.parametrize(
    "damage",
    [
        pytest.param(lambda whole: whole[:3000], id="truncated"),
        pytest.param(
            lambda whole: whole[:96] + bytes(len(whole) - 96), id="bad object header version number"
        ),
        pytest.param(lambda whole: whole.replace(b"TREE\1\0", bytes(6)), id="no index of chunks"),
    ],
)
def test_a_file_that_cannot_be_read_is_kept_aside(tmp_path, writer, damage):
    path = interrupted(tmp_path, writer)
    damaged = damage(path.read_bytes())
    path.write_bytes(damaged)
    with pytest.raises(DamagedRunError):
        open_run(path)
    (recovered,) = recover_folder(tmp_path)
    assert recovered.kept == f"{path}.before-recovery"
    assert (tmp_path / f"{path.name}.before-recovery").read_bytes() == damaged
    assert len(open_run(path)) == recovered.samples > 1000


def test_a_torn_file_that_its_journal_does_not_name_is_found_by_the_uuid_in_it(tmp_path, writer):
    """A power cut took what was written last: the name in the journal, and the beginning of the run file."""
    path = interrupted(tmp_path, writer)
    (journal,) = tmp_path.glob("*.journal")
    records = [record for record in read_journal(journal) if b'"Named"' not in record.data]
    journal.write_bytes(
        MAGIC + b"".join(encode_record(record.data, record.arrival_ns, record.kind) for record in records)
    )
    torn = bytes(96) + path.read_bytes()[96:]
    path.write_bytes(torn)
    (recovered,) = recover_folder(tmp_path)
    assert recovered.run == str(path)
    assert (tmp_path / f"{path.name}.before-recovery").read_bytes() == torn
    assert [one.name for one in tmp_path.glob("*.h5")] == [path.name]
    assert len(open_run(path)) == recovered.samples > 1000


def test_a_file_with_other_samples_is_kept_aside(tmp_path, writer, monkeypatch):
    path = interrupted(tmp_path, writer)
    monkeypatch.setattr(recovery, "contains_all_samples", lambda *_: False)
    (recovered,) = recover_folder(tmp_path)
    assert recovered.kept == f"{path}.before-recovery"


def test_a_run_that_was_renamed_is_found_by_its_identifier(tmp_path, writer):
    path = interrupted(tmp_path, writer)
    path = path.rename(tmp_path / "my first run.h5")
    (recovered,) = recover_folder(tmp_path)
    assert recovered.run == str(path)
    assert [other.name for other in tmp_path.iterdir()] == ["my first run.h5"]


def test_a_run_that_is_gone_is_made_anew_under_a_free_name(tmp_path, writer):
    path = interrupted(tmp_path, writer)
    path.write_bytes(b"another run took its name")
    (tmp_path / "run.journal").rename(tmp_path / "elsewhere.journal")
    path.rename(path.with_suffix(".gone"))
    path.with_suffix(".gone").unlink()
    (recovered,) = recover_folder(tmp_path)
    assert recovered.run == str(path)


def test_what_lives_is_not_touched(tmp_path, writer):
    path = interrupted(tmp_path, writer)
    journal = tmp_path / "run.journal"
    before = journal.read_bytes()
    assert unfinished_journals(tmp_path) == [journal]
    with recording_lock(journal):
        (left,) = recover_folder(tmp_path)
        assert left.state is RecoveryState.BEING_RECORDED
        assert unfinished_journals(tmp_path) == []
    assert journal.read_bytes() == before
    assert len(open_run(path)) > 1000


def test_a_file_that_its_writer_has_not_closed_is_waited_for(tmp_path, writer, monkeypatch):
    path = interrupted(tmp_path, writer)
    monkeypatch.setattr(recovery, "_WRITER_S", 0.2)
    with recording_lock(path):
        (left,) = recover_folder(tmp_path)
    assert left.state is RecoveryState.FAILED
    assert "still being written" in str(left.message)
    assert recover_folder(tmp_path)[0].state is RecoveryState.RECOVERED


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "not a journal"),
        (b"systemd or whatever", "not a journal"),
        (MAGIC, "before its first sample"),
        (MAGIC + b"\xff" * 500, "before its first sample"),
        (MAGIC + encode_record(b"bytes without a header", 1), "before its first sample"),
        (MAGIC + encode_record(b'{"type": "Unheard"}', 1, RecordKind.NOTE), "another version"),
        (MAGIC + encode_record(b"no json", 1, RecordKind.NOTE), "another version"),
    ],
)
def test_what_is_no_journal_stays_and_is_told_in_one_line(tmp_path, content, said):
    journal = tmp_path / "some.journal"
    journal.write_bytes(content)
    (left,) = recover_folder(tmp_path)
    assert left.state is RecoveryState.FAILED
    assert said in str(left.message)
    assert str(journal) in str(left.message)
    assert "\n" not in str(left.message)
    assert [(path, path.read_bytes()) for path in tmp_path.iterdir()] == [(journal, content)]


def test_a_journal_without_bytes_goes_and_one_of_rubbish_stays(tmp_path, writer):
    desk = Desk(tmp_path, writer, "slipstand-binary")
    desk.arm()
    desk.take((1, b""))
    desk.kill()
    header = desk.journal.read_bytes()
    assert recover_journal(desk.journal).state is RecoveryState.EMPTY
    assert list(tmp_path.iterdir()) == []
    desk.journal.write_bytes(header + encode_record(b"one", 5)[:-1])
    assert recover_journal(desk.journal).state is RecoveryState.EMPTY, "a power cut tore the first record"
    desk.journal.write_bytes(header + encode_record(b"rubbish" * 100, 5))
    with pytest.raises(RecoveryError, match="no sample"):
        recover_journal(desk.journal)
    assert list(tmp_path.iterdir()) == [desk.journal]


def test_one_that_fails_does_not_stop_the_rest(tmp_path, writer):
    path = interrupted(tmp_path, writer)
    (tmp_path / "a.journal").write_bytes(b"garbage")
    states = [recovered.state for recovered in recover_folder(tmp_path)]
    assert states == [RecoveryState.FAILED, RecoveryState.RECOVERED]
    assert open_run(path).events.release_s == 1.0
    with pytest.raises(RecoveryError, match="no such folder"):
        recover_folder(tmp_path / "nowhere")


def test_rows_before_the_first_whole_frame_are_marked(tmp_path, writer):
    """A pretrigger longer than what was kept begins amid a frame, of which a part came before the journal."""
    desk = Desk(tmp_path, writer, "slipstand-binary", history_s=0.4)
    recorded(
        desk, reads(wire("slipstand-binary")), armed_at=600, until=2600, pretrigger_s=2.0, duration_s=60.0
    )
    desk.kill()
    early = open_run(next(tmp_path.glob("*.h5")))
    (recovered,) = recover_folder(tmp_path)
    run = open_run(recovered.run)
    absent = run.status & SampleStatus.MISSING != 0
    assert len(run) >= len(early)
    assert np.count_nonzero(absent) < 4
    assert not absent[4:].any()
    np.testing.assert_array_equal(load_counts(run)[4 : len(early)], load_counts(early)[4:])


@pytest.mark.parametrize("works_again", [True, False])
def test_a_run_whose_journal_had_to_move_comes_home(tmp_path, writer, monkeypatch, works_again):
    home, refuge = tmp_path / "home", tmp_path / "refuge"
    refuge.mkdir()
    home.mkdir()
    desk = Desk(home, writer, "slipstand-binary")
    recorded(desk, reads(wire("slipstand-binary")), until=2400, duration_s=60.0)
    desk.kill()
    (begun,) = home.glob("*.h5")
    shutil.move(desk.journal, refuge)
    if not works_again:
        monkeypatch.setattr("app.acquisition.journal.recovery.has_free_space", lambda *_: False)
    (recovered,) = recover_folder(refuge, original_folder=home)
    found = home if works_again else refuge
    assert Path(recovered.run).parent == found
    assert [path.name for path in found.iterdir()] == [begun.name], "it took the place of what was begun"
    assert recovered.samples == len(open_run(recovered.run)) > 1000


def test_no_folder_that_only_a_journal_names_is_written_to(tmp_path, writer):
    meant, refuge, home = tmp_path / "meant", tmp_path / "refuge", tmp_path / "home"
    for folder in (meant, refuge, home):
        folder.mkdir()
    desk = Desk(meant, writer, "slipstand-binary")
    recorded(desk, reads(wire("slipstand-binary")), until=2400, duration_s=60.0)
    desk.kill()
    shutil.move(desk.journal, refuge)
    (recovered,) = recover_folder(refuge, original_folder=home)
    assert Path(recovered.run).parent == refuge
    assert list(home.iterdir()) == []
