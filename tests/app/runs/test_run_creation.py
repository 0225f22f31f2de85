import os
import subprocess
import sys

import h5py
import msgspec
import numpy as np
import pytest
from interrupted_writes import KeptWrites
from runs_kit import ENDING, block

from app.runs import creation, schema
from app.runs.creation import remove_abandoned
from app.runs.journal import MAGIC, JournalSpan, encode_record
from app.runs.lock import FileLock
from app.runs.reader import open_run
from app.runs.validation import stored_rows, validate_file
from app.runs.writer import create_run, create_run_in


class Interrupted(BaseException):
    pass


def test_a_file_has_its_name_only_when_it_is_whole(tmp_path, metadata, monkeypatch):
    """HDF5 writes the head of a file first: a kill while it is made left a file that nothing could open."""
    seen = []

    def interrupted(file, _):
        file.flush()
        seen.extend(tmp_path.glob("*.h5"))
        raise Interrupted

    monkeypatch.setattr(creation, "_create_chunk_indices", interrupted)
    with pytest.raises(Interrupted):
        create_run(tmp_path / "run.h5", metadata)
    assert not seen
    assert not list(tmp_path.iterdir())


def test_what_a_killed_process_was_making_is_removed(tmp_path, metadata):
    """The child makes a run with the metadata that are sent to it, and is gone before that has its name."""
    command = (
        "import os, sys, msgspec; from pathlib import Path; from app.runs import creation;"
        " from app.runs.metadata import RunMetadata; from app.runs.writer import create_run;"
        " creation.give_new_name = lambda *_: os._exit(7);"
        " create_run(Path(sys.argv[1]), msgspec.json.decode(sys.stdin.buffer.read(), type=RunMetadata))"
    )
    killed = subprocess.run(
        [sys.executable, "-c", command, str(tmp_path / "run.h5")],
        input=msgspec.json.encode(metadata),
        check=False,
    )
    assert killed.returncode == 7
    left = sorted(path.name for path in tmp_path.iterdir())
    assert [name[:8] for name in left] == [".run.h5.", "run.h5.r"]
    with FileLock(tmp_path / "run.h5.recording"):
        remove_abandoned(tmp_path)
        assert len(list(tmp_path.iterdir())) == 2  # somebody makes it just now
    (tmp_path / "run.h5.recording").touch()
    remove_abandoned(tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_file_system_without_links_overwrites_nothing_either(tmp_path, metadata, monkeypatch):
    def no_links(*_):
        raise OSError("not supported")

    monkeypatch.setattr(os, "link", no_links)
    paths = []
    for _ in range(2):
        writer = create_run_in(tmp_path, metadata)
        writer.append(block(0, 10))
        writer.close(ENDING)
        paths.append(writer.path)
    assert sorted(tmp_path.iterdir()) == paths
    assert [len(open_run(path)) for path in paths] == [10, 10]


def test_a_kill_at_any_write_leaves_a_file_with_all_that_was_flushed(tmp_path, metadata, monkeypatch):
    journal = tmp_path / "run.journal"
    chunks = [np.random.default_rng(i).bytes(700) for i in range(1000)]
    journal.write_bytes(MAGIC + b"".join(encode_record(data, i) for i, data in enumerate(chunks)))
    kept = []

    def opened(path, mode, really=creation._open):
        if mode == "x":
            return really(path, mode)
        kept.append(KeptWrites(path))
        return h5py.File(kept[0], mode, alignment_threshold=2096, alignment_interval=4096)

    monkeypatch.setattr(creation, "_open", opened)
    monkeypatch.setattr(schema, "CHUNK", 512)
    writer = create_run(tmp_path / "run.h5", metadata, journal=JournalSpan(str(journal)))
    flushed = {}
    for first in range(0, 1200, 400):
        writer.append(block(first, 400))
        writer.flush()
        flushed[len(kept[0].writes)] = first + 400
    writer.close(ENDING)
    kept[0].close()

    path, tried = tmp_path / "killed.h5", 0
    for number, image in kept[0].states():
        path.write_bytes(image)
        safe = max((rows for writes, rows in flushed.items() if writes <= number), default=0)
        with h5py.File(path) as file:
            validate_file(file)
            rows = stored_rows(file)
            assert rows >= safe, number
            assert np.array_equal(file[schema.TIME][:rows], block(0, rows).time_s), number
        tried += 1
    assert tried > 100
    assert open_run(path).end == ENDING


def test_a_file_of_somebody_else_that_is_named_like_a_lock_stays(tmp_path):
    voice = tmp_path / "voice.recording"
    voice.write_bytes(b"RIFF")
    (tmp_path / "folder.recording").mkdir()
    (tmp_path / "run.h5.recording").touch()
    remove_abandoned(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"voice.recording", "folder.recording"}
