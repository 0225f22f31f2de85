"""The library: what runs there are, found, filtered and sorted at once even where there are ten thousand."""

import contextlib
import datetime
import hashlib
import os
import sqlite3
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Self

import msgspec
import platformdirs

from app.runs.errors import DamagedRunError, NotARunError, RunError, RunNotFoundError
from app.runs.lock import RECORDING_SUFFIX
from app.runs.paths import recordings_directory
from app.runs.reader import check_openable
from app.runs.schema import SUFFIX
from app.runs.summary import RunSummary
from app.runs.validator import Validator
from app.version import __version__

_ENCODER = msgspec.msgpack.Encoder()
_DECODER = msgspec.msgpack.Decoder(RunSummary)
_WAIT_S = 5.0
_TABLE = """
CREATE TABLE IF NOT EXISTS runs (
    path TEXT PRIMARY KEY, size INTEGER NOT NULL, changed_ns INTEGER NOT NULL, summary BLOB NOT NULL
) WITHOUT ROWID
"""


class FileState(msgspec.Struct, frozen=True, gc=False):
    """What tells that a file has not been changed."""

    size: int
    changed_ns: int


class SummaryCache:
    """Summaries by path, with the state of the file that each was made from. Use it in a `with` statement.

    A cache that is damaged or of another version is begun anew; one that cannot be written is kept in memory.
    """

    def __init__(self, path: str) -> None:
        """Open a database, or make it. Raises sqlite3.DatabaseError, MsgspecError."""
        self._database = _connect(path)
        try:
            self.entries = _states(self._database)
            """State and summary of each file by path, as they were when the cache was opened."""
        except BaseException:
            self.close()
            raise

    @classmethod
    def open(cls, folder: Path) -> Self:
        path = index_path(folder)
        for _ in range(2):
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                return cls(str(path))
            except (sqlite3.DatabaseError, msgspec.MsgspecError, OSError):
                with contextlib.suppress(OSError):
                    path.unlink()
        return cls(":memory:")

    def update(self, found: Iterable[tuple[FileState, RunSummary]]) -> None:
        """Remember summaries. A cache that cannot take them forgets them, which costs time alone."""
        rows = [
            (run.path, state.size, state.changed_ns, _ENCODER.encode(run))
            for state, run in found
            if _is_text(run.path)
        ]
        with contextlib.suppress(sqlite3.DatabaseError), self._database:
            self._database.executemany("INSERT OR REPLACE INTO runs VALUES (?, ?, ?, ?)", rows)

    def remove(self, paths: Iterable[str]) -> None:
        with contextlib.suppress(sqlite3.DatabaseError), self._database:
            self._database.executemany("DELETE FROM runs WHERE path = ?", [(path,) for path in paths])

    def close(self) -> None:
        self._database.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _states(database: sqlite3.Connection) -> dict[str, tuple[FileState, RunSummary]]:
    rows = database.execute("SELECT path, size, changed_ns, summary FROM runs")
    return {
        path: (FileState(size, changed_ns), _DECODER.decode(data)) for path, size, changed_ns, data in rows
    }


def _is_text(path: str) -> bool:
    """Tell whether a path can be stored: names of files may be any bytes on some systems."""
    try:
        path.encode()
    except UnicodeEncodeError:
        return False
    return True


def index_path(folder: Path) -> Path:
    """Where the cache of a folder is kept."""
    name = hashlib.blake2b(
        str(folder.absolute()).encode("utf-8", "surrogateescape"), digest_size=8
    ).hexdigest()
    return Path(platformdirs.user_cache_dir("slipstand", appauthor=False)) / "libraries" / f"{name}.sqlite"


def _connect(path: str) -> sqlite3.Connection:
    """Open a database that holds the table of this version, empty or not. Raises sqlite3.DatabaseError."""
    database = sqlite3.connect(path, timeout=_WAIT_S)
    try:
        version = _version()
        if database.execute("PRAGMA user_version").fetchone()[0] != version:
            with database:
                database.execute("DROP TABLE IF EXISTS runs")
                database.execute(_TABLE)
                database.execute(f"PRAGMA user_version = {version}")
    except BaseException:
        database.close()
        raise
    return database


def _version() -> int:
    """A number that changes with the program and with what a summary holds."""
    words = "|".join((__version__, *RunSummary.__struct_fields__))
    return int.from_bytes(hashlib.blake2b(words.encode(), digest_size=3).digest(), "big")


Progress = Callable[[int, int], None]
_BATCH = 100
"""Newly examined runs that are remembered together: what an interrupted first listing keeps."""


class RunFilter(msgspec.Struct, frozen=True):
    """Which runs of a library to show. Of a file with a fault, its name and date of change decide."""

    series: str | None = None
    since: datetime.date | None = None
    """Begun on this day or later."""
    until: datetime.date | None = None
    """Begun on this day or earlier."""
    operator: str | None = None
    text: str | None = None
    """Occurs in file name, title, note, operator, series or source, whatever the case."""
    stale: bool | None = None

    def matches(self, run: RunSummary) -> bool:
        return (
            (self.series is None or self.series.strip().upper() in _series(run))
            and (self.since is None or _day(run) >= self.since)
            and (self.until is None or _day(run) <= self.until)
            and (self.operator is None or self.operator.casefold() == run.operator.casefold())
            and (self.text is None or self.text.casefold() in _words(run))
            and (self.stale is None or self.stale == run.stale)
        )


def list_runs(
    folder: Path | None = None, wanted: RunFilter | None = None, *, progress: Progress | None = None
) -> list[RunSummary]:
    """Summaries of all runs in a folder and those below it, oldest first, files with a fault last.

    `folder` is by default the recordings folder, which need not exist. `progress` is called with the numbers
    of new files examined and of all. Raises RunNotFoundError.
    """
    if folder is not None:
        check_folder_exists(folder)
    folder = (folder or recordings_directory()).absolute()
    found = _summaries(folder, progress or (lambda _done, _all: None))
    return sorted(filter(wanted.matches, found) if wanted else found, key=_order)


def resolve_run_files(given: Iterable[Path]) -> list[Path]:
    """Run files in the order given, each once; of a folder those in it and below. Raises RunNotFoundError."""
    paths = [path.expanduser().absolute() for path in given]
    found = [file for path in paths for file in (sorted(find_run_files(path)) if path.is_dir() else [path])]
    if not found:
        places = ", ".join(map(str, paths)) or "nothing"
        raise RunNotFoundError(
            "{places}: there are no runs. Give run files or a folder of runs", places=places
        )
    return list(dict.fromkeys(found))


def check_folder_exists(folder: Path) -> None:
    """Raise RunNotFoundError unless there is such a folder."""
    if not folder.is_dir():
        raise RunNotFoundError("{folder}: there is no such folder. Give a folder with runs", folder=folder)


def find_run_files(folder: Path) -> Iterator[Path]:
    """Paths of all run files in a folder and those below it; hidden ones are left out."""
    return (Path(file.path) for file in _files(folder.absolute()))


class _File(msgspec.Struct, frozen=True, gc=False):
    path: str
    state: FileState
    may_be_recorded: bool


def _files(folder: Path) -> Iterator[_File]:
    """Run files, each with its state, without opening any."""
    pending = [str(folder)]
    while pending:
        try:
            with os.scandir(pending.pop()) as listing:
                entries = [entry for entry in listing if not entry.name.startswith(".")]
        except OSError:  # gone or closed to this user meanwhile
            continue
        locked = {entry.name for entry in entries if entry.name.endswith(RECORDING_SUFFIX)}
        for entry in entries:
            if entry.name.endswith(SUFFIX) and _is_file(entry):
                with contextlib.suppress(OSError):  # gone meanwhile
                    status = entry.stat()
                    state = FileState(status.st_size, status.st_mtime_ns)
                    yield _File(entry.path, state, entry.name + RECORDING_SUFFIX in locked)
            elif entry.is_dir(follow_symlinks=False):
                pending.append(entry.path)


def _is_file(entry: os.DirEntry[str]) -> bool:
    try:
        return entry.is_file()
    except OSError:  # a link that leads to itself, or where this user may not look
        return False


def _summaries(folder: Path, progress: Progress) -> list[RunSummary]:
    found: list[RunSummary] = []
    changed: list[_File] = []
    with SummaryCache.open(folder) as index:
        known = dict(index.entries)
        for file in _files(folder):
            state, summary = known.pop(file.path, (None, None))
            if summary is not None and state == file.state and not file.may_be_recorded:
                found.append(summary)
            else:
                changed.append(file)
        index.remove(known)  # what is left lies there no more
        found.extend(_validate_changed(changed, index, progress))
    return found


def _validate_changed(files: list[_File], index: SummaryCache, progress: Progress) -> Iterator[RunSummary]:
    fresh: list[tuple[FileState, RunSummary]] = []
    with Validator() as validator:
        for done, file in enumerate(files):
            progress(done, len(files))
            summary, lasts = _summary(Path(file.path), validator)
            yield summary
            if lasts:
                fresh.append((file.state, summary))
            if len(fresh) == _BATCH:
                index.update(fresh)
                fresh.clear()
    index.update(fresh)


def _summary(path: Path, validator: Validator) -> tuple[RunSummary, bool]:
    """Summary of a file, and whether it holds until the file changes."""
    try:
        check_openable(path)
        return msgspec.structs.replace(validator.validate(path), path=str(path)), True
    except (NotARunError, DamagedRunError) as error:
        return RunSummary(path=str(path), fault=error.message), True
    except RunError as error:
        return RunSummary(path=str(path), fault=error.message), False


def _series(run: RunSummary) -> list[str]:
    """Series codes that a run answers to, in capitals."""
    return Path(run.path).stem.upper().split("_") if run.fault else [(run.series or "").upper()]


def _words(run: RunSummary) -> str:
    parts = (run.path.rpartition(os.sep)[2], run.title, run.note, run.operator, run.series or "", run.source)
    return "\n".join(parts).casefold()


def _day(run: RunSummary) -> datetime.date:
    if run.start_time is not None:
        return run.start_time.astimezone().date()
    try:
        return datetime.datetime.fromtimestamp(Path(run.path).stat().st_mtime).astimezone().date()
    except OSError:
        return datetime.date.min


def _order(run: RunSummary) -> tuple[bool, float, str]:
    start = run.start_time
    return bool(run.fault), start.timestamp() if start else 0.0, run.path
