"""Runs from journals whose engine died.

Each is built anew, verified and put in its place, and only then its journal goes. A journal whose engine
lives is not touched; one that cannot be read stays.
"""

import contextlib
import os
import shutil
import time
from collections.abc import Callable, Iterator
from enum import StrEnum
from pathlib import Path

import msgspec

from app.acquisition.errors import RecoveryError
from app.acquisition.journal.rebuild import RebuiltRun, rebuild
from app.acquisition.journal.records import JournalSummary, read_summary
from app.runs.creation import remove_abandoned
from app.runs.disk import has_free_space, storage_error, sync_folder
from app.runs.errors import RunError
from app.runs.file_operations import (
    ExistingRun,
    contains_all_samples,
    find_run_by_uuid,
    inspect_run,
    move_to_free_name,
    replace_by_recovered,
)
from app.runs.journal import find_journals
from app.runs.lock import LockHeldError, is_being_recorded, recording_lock
from app.runs.schema import SUFFIX

Progress = Callable[[float], None]

_ROOM_RATIO = 8
"""Bytes of a run file for each of its journal, at most: a device may send few bytes for a row."""
_WRITER_S = 20.0
"""The writer of a dead engine closes its file by itself, which takes as long as that is large."""


class RecoveryState(StrEnum):
    """What became of a journal."""

    RECOVERED = "recovered"
    WHOLE = "whole"
    """The run file holds all of it already; only the journal was left over."""
    EMPTY = "empty"
    """It ended before the first byte came; it was removed."""
    BEING_RECORDED = "being-recorded"
    FAILED = "failed"


class Recovery(msgspec.Struct, frozen=True):
    """What became of one journal; it is gone unless `state` says being-recorded or failed."""

    journal: str
    state: RecoveryState
    run: str = ""
    samples: int = 0
    ended: str = ""
    kept: str = ""
    """Where the earlier file of the run is now, if it held anything that the new one does not."""
    message: str = ""


def recover_folder(
    folder: Path,
    progress: Callable[[Path, float], None] | None = None,
    *,
    original_folder: Path | None = None,
) -> list[Recovery]:
    """Recover all journals in a folder and those below it; one that fails does not stop the rest.

    Parameters
    ----------
    progress : callable, optional
        Told each journal, and the share of it that is done.
    home : Path, optional
        Where runs go that were meant for it, but whose journals had to move to `folder`.

    Raises
    ------
    RecoveryError
        There is no such folder.
    """
    if not folder.is_dir():
        raise RecoveryError("{folder}: there is no such folder. Give a folder with runs", folder=folder)
    done = []
    for journal in find_journals(folder):

        def tell(share: float, journal: Path = journal) -> None:
            if progress is not None:
                progress(journal, share)

        try:
            done.append(recover_journal(journal, tell, original_folder=original_folder))
        except (RecoveryError, RunError, OSError) as error:
            message = " ".join(str(error).split())
            done.append(Recovery(str(journal), RecoveryState.FAILED, message=message))
    remove_abandoned(folder)
    return done


def recover_journal(
    journal: Path, progress: Progress = lambda _: None, *, original_folder: Path | None = None
) -> Recovery:
    """Build the run of one journal, put it in its place, and remove the journal.

    Its place is beside the journal, or `home` where it was meant for that, and that takes it.

    Raises
    ------
    RecoveryError
        No run can be built from it; it stays.
    RunError
        The run cannot be written; the journal stays.
    """
    if is_being_recorded(journal):
        return _being_recorded(journal)
    try:
        with recording_lock(journal):
            story = read_summary(journal)
            recovered = _recover(story, _place(story, original_folder), progress)
            journal.unlink()
            sync_folder(journal.parent)
    except LockHeldError:
        return _being_recorded(journal)
    except OSError as error:
        raise storage_error(journal, error) from None
    return recovered


def _being_recorded(journal: Path) -> Recovery:
    message = f"{journal} is being recorded. Wait until that run has ended"
    return Recovery(str(journal), RecoveryState.BEING_RECORDED, message=message)


def _place(story: JournalSummary, home: Path | None) -> Path:
    """Folder for the run. What the journal says of it is only compared, never followed."""
    if home is not None and home.is_dir() and Path(story.header.run.directory).absolute() == home.absolute():
        size = story.path.stat().st_size
        if os.access(home, os.W_OK) and has_free_space(home, _ROOM_RATIO * size):
            return home
    return story.path.parent


def _recover(story: JournalSummary, place: Path, progress: Progress) -> Recovery:
    if not story.wire_bytes and not story.is_torn:
        return Recovery(str(story.path), RecoveryState.EMPTY)
    _await_writer(story, place)
    earlier = _earlier_file(story, place)
    with _workshop(place, story.path.stem) as folder:
        made = folder / (earlier.name if earlier else f"{_stem(story)}_001{SUFFIX}")
        rebuilt = rebuild(story, made, progress)
        if rebuilt is None:
            raise RecoveryError(
                "{path} holds {bytes} bytes but no sample. Delete it if it is not needed",
                path=story.path,
                bytes=story.wire_bytes,
            )
        return _placed(story, place, rebuilt, earlier)


def _placed(story: JournalSummary, place: Path, rebuilt: RebuiltRun, earlier: Path | None) -> Recovery:
    made, path, kept = Path(rebuilt.stored.path), earlier, None
    if not rebuilt.stored.raw_bytes_stored:
        raise RecoveryError(
            "{path}: its bytes did not fit into the run. Free some space on the disk", path=story.path
        )
    state = RecoveryState.RECOVERED
    if path is None:
        path = move_to_free_name(made, place / made.name)
    else:
        before = inspect_run(path)
        holds_all = before is not None and contains_all_samples(made, path)
        if before is not None and holds_all and _is_whole(before, rebuilt):
            state = RecoveryState.WHOLE
        else:
            has_own = before is None or not holds_all or before.has_additions
            kept = replace_by_recovered(made, path, keep=has_own)
    return Recovery(
        journal=str(story.path),
        state=state,
        run=str(path),
        samples=rebuilt.stored.samples,
        ended=rebuilt.ending.ended,
        kept=str(kept or ""),
        message=rebuilt.ending.message,
    )


def _is_whole(before: ExistingRun, rebuilt: RebuiltRun) -> bool:
    """Tell whether the run was closed as it should, so that only its journal was left over."""
    return before.samples == rebuilt.stored.samples and before.end == rebuilt.ending


def _earlier_file(story: JournalSummary, folder: Path) -> Path | None:
    """The run file that the engine's writer began; known by its UUID, whatever the journal calls it."""
    if story.opened is None:
        return None
    identifier = story.header.identifier
    if story.named is not None:
        beside = folder / Path(story.named.path).name  # no other path of a file is followed
        if beside.suffix == SUFFIX and beside.is_file() and _identifier(beside) in (identifier, ""):
            return beside
    return find_run_by_uuid(folder, identifier)


def _identifier(path: Path) -> str:
    """UUID of a run file; empty where it cannot be read."""
    earlier = inspect_run(path)
    return earlier.identifier if earlier else ""


def _await_writer(story: JournalSummary, folder: Path) -> None:
    """Wait for the writer, which outlives its engine until its file is closed. Raises RecoveryError."""
    deadline = time.monotonic() + _WRITER_S
    while story.opened is not None and _is_being_written(story, folder):
        if time.monotonic() > deadline:
            raise RecoveryError(
                "{path}: its run file is still being written. Try again in a minute", path=story.path
            )
        time.sleep(0.05)


def _is_being_written(story: JournalSummary, folder: Path) -> bool:
    if story.named is not None:
        return is_being_recorded(folder / Path(story.named.path).name)
    runs = folder.glob(f"{_stem(story)}_*{SUFFIX}")
    return any(is_being_recorded(run) for run in runs)


def _stem(story: JournalSummary) -> str:
    """Begin of the name that the writer gives to the run file."""
    metadata = story.header.metadata
    start = story.opened.start_time if story.opened else metadata.start_time
    return "_".join(part for part in (start.strftime("%Y%m%dT%H%M%S"), metadata.series) if part)


@contextlib.contextmanager
def _workshop(place: Path, journal: str) -> Iterator[Path]:
    """A hidden folder on the same disk, so that what is made there can be moved at once.

    It is named after the journal, whose lock is held: one that is there was left by a recovery that was
    ended before it was done.
    """
    folder = place / f".recovering-{journal}"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
