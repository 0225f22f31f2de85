"""Recovers runs from journals whose engine died.

Each run is rebuilt, verified and put in its place; then its journal is removed. A journal whose engine lives
is not touched; one that cannot be read stays.
"""

import contextlib
import logging
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
from app.runs.disk import has_free_space, is_writable, storage_error
from app.runs.errors import RunError
from app.runs.file_operations import (
    ExistingRun,
    contains_all_samples,
    find_run_by_uuid,
    inspect_run,
    move_to_free_name,
    replace_by_recovered,
)
from app.runs.journal import find_journals, has_record_behind
from app.runs.lock import LockHeldError, is_being_recorded, recording_lock
from app.runs.paths import next_run_number, run_stem
from app.runs.schema import SUFFIX
from config.durable_files import remove_file, sync_folder
from messages.i18n import N_
from messages.message import EMPTY, Message, as_message, message, message_of

_log = logging.getLogger(__name__)

Progress = Callable[[float], None]

_ROOM_RATIO = 8  # bytes of a run file for each of its journal, at most: a device may send few bytes for a row
_TEMPLATE_BYTES = 1 << 20  # of a run file, before its first row
_WRITER_S = 20.0
"""The writer of a dead engine closes its file by itself, which takes as long as that is large."""


class RecoveryState(StrEnum):
    """What became of a journal."""

    RECOVERED = "recovered"
    WHOLE = "whole"  # the run file holds all of it already; only the journal was left over
    EMPTY = "empty"  # it ended before the first whole read was in it; it was removed
    BEING_RECORDED = "being-recorded"
    FAILED = "failed"


class Recovery(msgspec.Struct, frozen=True):
    """Result for one journal; it is removed unless `state` is being-recorded or failed."""

    journal: str
    state: RecoveryState
    run: str = ""
    samples: int = 0
    ended: str = ""
    kept: str = ""  # where the earlier file of the run is now, if it held anything that the new one does not
    message: Message = EMPTY


def recover_folder(
    folder: Path,
    progress: Callable[[Path, float], None] | None = None,
    *,
    original_folder: Path | None = None,
) -> list[Recovery]:
    """Recover all journals in a folder and those below it; one that fails does not stop the rest.

    `progress` receives each journal, and the fraction of it that is done. Runs that were meant for
    `original_folder`, but whose journals had to move to `folder`, go to the former. Raises RecoveryError if
    there is no such folder.
    """
    if not folder.is_dir():
        raise RecoveryError("{folder}: there is no such folder. Give a folder with runs", folder=folder)
    done = []
    for journal in find_journals(folder):

        def report(share: float, journal: Path = journal) -> None:
            if progress is not None:
                progress(journal, share)

        try:
            done.append(recover_journal(journal, report, original_folder=original_folder))
        except (RecoveryError, RunError, OSError) as error:
            _log.warning("%s cannot be recovered: %s", journal, error)
            done.append(Recovery(str(journal), RecoveryState.FAILED, message=message_of(error)))
    remove_abandoned(folder)
    return done


def recover_journal(
    journal: Path, progress: Progress = lambda _: None, *, original_folder: Path | None = None
) -> Recovery:
    """Put the run of a journal in its place, remove the journal. Raises RecoveryError, RunError."""
    if is_being_recorded(journal):
        return _being_recorded(journal)
    try:
        with recording_lock(journal):
            summary = read_summary(journal)
            recovered = _recover(summary, _place(summary, original_folder), progress)
            remove_file(journal)
            sync_folder(journal.parent)
    except LockHeldError:
        return _being_recorded(journal)
    except OSError as error:
        raise storage_error(journal, error) from None
    return recovered


def _being_recorded(journal: Path) -> Recovery:
    wait = message("{journal} is being recorded. Wait until that run has ended", journal=journal)
    return Recovery(str(journal), RecoveryState.BEING_RECORDED, message=wait)


def _place(summary: JournalSummary, original_folder: Path | None) -> Path:
    """Folder for the run. The path in the journal is only compared, never followed."""
    wanted = Path(summary.header.run.directory).absolute()
    if original_folder is not None and original_folder.is_dir() and wanted == original_folder.absolute():
        size = summary.path.stat().st_size
        if is_writable(original_folder) and has_free_space(original_folder, _ROOM_RATIO * size):
            return original_folder
    return summary.path.parent


def _recover(summary: JournalSummary, place: Path, progress: Progress) -> Recovery:
    if not summary.wire_bytes and not has_record_behind(summary.path, summary.end):
        return Recovery(str(summary.path), RecoveryState.EMPTY)
    _await_writer(summary, place)
    earlier = _earlier_file(summary, place)
    with _workshop(place, summary.path.stem) as folder:
        number = next_run_number(place, summary.header.metadata.series)
        made = folder / (earlier.name if earlier else f"{_stem(summary)}_{number:03d}{SUFFIX}")
        rebuilt = rebuild(summary, made, progress)
        if rebuilt is None:
            template = N_("{path} holds {bytes} bytes but no sample. Delete it if it is not needed")
            raise RecoveryError(template, path=summary.path, bytes=summary.wire_bytes)
        return _placed(summary, place, rebuilt, earlier)


def _placed(summary: JournalSummary, place: Path, rebuilt: RebuiltRun, earlier: Path | None) -> Recovery:
    made, path, kept = Path(rebuilt.stored.path), earlier, None
    if not rebuilt.stored.raw_bytes_stored:
        raise RecoveryError(
            "{path}: its bytes did not fit into the run. Free some space on the disk", path=summary.path
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
        journal=str(summary.path),
        state=state,
        run=str(path),
        samples=rebuilt.stored.samples,
        ended=rebuilt.ending.ended,
        kept=str(kept or ""),
        message=as_message(rebuilt.ending.message),
    )


def _is_whole(before: ExistingRun, rebuilt: RebuiltRun) -> bool:
    return before.samples == rebuilt.stored.samples and before.end == rebuilt.ending


def _earlier_file(summary: JournalSummary, folder: Path) -> Path | None:
    """The run file that the engine's writer began, recognised by its UUID."""
    if summary.opened is None:
        return None
    identifier = summary.header.identifier
    if summary.named is not None:
        beside = folder / Path(summary.named.path).name  # no other path of a file is followed
        if beside.suffix == SUFFIX and beside.is_file() and _identifier(beside) in (identifier, ""):
            return beside
    return find_run_by_uuid(folder, identifier) or _torn_file(summary, folder)


def _torn_file(summary: JournalSummary, folder: Path) -> Path | None:
    """A file of the run's name that a power cut tore: nothing reads it, but its UUID stands in it."""
    identifier = summary.header.identifier.encode()
    for path in sorted(folder.glob(f"{_stem(summary)}_*{SUFFIX}")):
        with path.open("rb") as file:
            is_of_run = identifier in file.read(_TEMPLATE_BYTES)
        if is_of_run and inspect_run(path) is None:
            return path
    return None


def _identifier(path: Path) -> str:
    earlier = inspect_run(path)
    return earlier.identifier if earlier else ""


def _await_writer(summary: JournalSummary, folder: Path) -> None:
    """Wait for the writer, which outlives its engine until its file is closed. Raises RecoveryError."""
    deadline = time.perf_counter() + _WRITER_S
    while summary.opened is not None and _is_being_written(summary, folder):
        if time.perf_counter() > deadline:
            raise RecoveryError(
                "{path}: its run file is still being written. Try again in a minute", path=summary.path
            )
        time.sleep(0.05)


def _is_being_written(summary: JournalSummary, folder: Path) -> bool:
    if summary.named is not None:
        return is_being_recorded(folder / Path(summary.named.path).name)
    runs = folder.glob(f"{_stem(summary)}_*{SUFFIX}")
    return any(is_being_recorded(run) for run in runs)


def _stem(summary: JournalSummary) -> str:
    """Begin of the name that the writer gives to the run file."""
    metadata = summary.header.metadata
    start = summary.opened.start_time if summary.opened else metadata.known_start_time
    return run_stem(start, metadata.series)


@contextlib.contextmanager
def _workshop(place: Path, journal: str) -> Iterator[Path]:
    """Make a hidden folder on the same disk; an existing one was left by an interrupted recovery."""
    folder = place / f".recovering-{journal}"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
