"""A cache of run summaries, one SQLite file a library folder. It can be deleted at any time.

A row is believed while its file has the same size and time of change; everything else is looked at anew.
The cache lies in the user's cache folder, because a library may lie on a network share, where SQLite's
locks do not hold.
"""

import contextlib
import hashlib
import sqlite3
from collections.abc import Iterable
from pathlib import Path
from typing import Self

import msgspec
import platformdirs

from app.runs.summary import RunSummary
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

    A cache that is damaged, or of another version, is begun anew; one that cannot be written is kept in
    memory for this time.

    Attributes
    ----------
    known : dict
        File state and summary of each path, as they were when it was opened.
    """

    def __init__(self, path: str) -> None:
        """Open a database, or make it. Raises sqlite3.DatabaseError, MsgspecError."""
        self._database = _connect(path)
        try:
            self.entries = _states(self._database)
        except BaseException:
            self.close()
            raise

    @classmethod
    def open(cls, folder: Path) -> Self:
        """Open the cache of a library folder, or make it."""
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
        """Drop what is there no more."""
        with contextlib.suppress(sqlite3.DatabaseError), self._database:
            self._database.executemany("DELETE FROM runs WHERE path = ?", [(path,) for path in paths])

    def close(self) -> None:
        """Close the file."""
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
