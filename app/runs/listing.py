"""The library: what runs there are, found, filtered and sorted at once even where there are ten thousand."""

import contextlib
import hashlib
import os
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import msgspec
import platformdirs

from app.runs.columns import check_samples
from app.runs.disk import atomic_write, make_folder
from app.runs.errors import DamagedRunError, NotARunError, RunError, RunNotFoundError
from app.runs.lock import RECORDING_SUFFIX
from app.runs.paths import TRASH, recordings_directory
from app.runs.reader import check_openable, read_file
from app.runs.run_filter import RunFilter
from app.runs.schema import SUFFIX
from app.runs.summary import RunSummary
from app.runs.validator import Validator
from app.version import __version__

Progress = Callable[[int, int], None]
Stamp = tuple[int, int]
"""Size of a file, and time of its last change (ns): while they last, so does its summary."""
Index = dict[str, tuple[Stamp, RunSummary]]  # stamp and summary of each file, by path

_SAVE_S = 5.0
"""So often a listing is remembered while it goes on: an interrupted first one keeps most of its work."""
_SAVE_SHARE = 0.02  # of a listing's time that this takes at most: an index of a million runs takes seconds
_VERSION = "|".join((__version__, *RunSummary.__struct_fields__))
_INDEX_DECODER = msgspec.msgpack.Decoder(tuple[str, Index])


def index_path(folder: Path) -> Path:
    """Where the index of a folder is kept."""
    digest = hashlib.blake2b(str(folder.absolute()).encode("utf-8", "surrogateescape"), digest_size=8)
    cache = Path(platformdirs.user_cache_dir("slipstand", appauthor=False))
    return cache / "libraries" / f"{digest.hexdigest()}.msgpack"


def _load_index(folder: Path) -> Index:
    """The index of a folder; empty where there is none, or one that is damaged or of another version."""
    try:
        version, index = _INDEX_DECODER.decode(index_path(folder).read_bytes())
    except (OSError, msgspec.MsgspecError):
        return {}
    return index if version == _VERSION else {}


def _save_index(folder: Path, index: Index) -> None:
    """Remember an index. Where it cannot be written it is forgotten, which costs time alone."""
    path = index_path(folder)
    stored = {name: entry for name, entry in index.items() if _is_text(name)}
    with contextlib.suppress(RunError):
        make_folder(path.parent)
        with atomic_write(path, replace=True) as made:
            made.write_bytes(msgspec.msgpack.encode((_VERSION, stored)))


def _is_text(path: str) -> bool:
    """Tell whether a path can be stored: names of files may be any bytes on some systems."""
    try:
        path.encode()
    except UnicodeEncodeError:
        return False
    return True


def list_runs(
    folder: Path | None = None,
    wanted: RunFilter | None = None,
    *,
    progress: Progress | None = None,
    in_trash: bool = False,
) -> list[RunSummary]:
    """Summaries of all runs in a folder and those below it, oldest first, files with a fault last.

    `folder` is by default the recordings folder, which need not exist. `progress` is called with the numbers
    of new files examined and of all. With `in_trash` the runs in their trashes. Raises RunNotFoundError.
    """
    if folder is not None:
        check_folder_exists(folder)
    folder = (folder or recordings_directory()).absolute()
    found = _summaries(folder, progress or (lambda _done, _all: None), in_trash=in_trash)
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
    stamp: Stamp
    may_be_recorded: bool


def _files(folder: Path, *, in_trash: bool = False) -> Iterator[_File]:
    """Run files, each with its stamp, without opening any; with `in_trash` those in the trashes."""
    pending = [str(folder)]
    while pending:
        place = pending.pop()
        entries = _entries(place)
        pending += [entry.path for entry in entries if entry.is_dir(follow_symlinks=False)]
        yield from _run_files(_entries(f"{place}{os.sep}{TRASH}") if in_trash else entries)


def _entries(folder: str) -> list[os.DirEntry[str]]:
    try:
        with os.scandir(folder) as listing:
            return [entry for entry in listing if not entry.name.startswith(".")]
    except OSError:  # gone or closed to this user meanwhile
        return []


def _run_files(entries: list[os.DirEntry[str]]) -> Iterator[_File]:
    locked = {entry.name for entry in entries if entry.name.endswith(RECORDING_SUFFIX)}
    for entry in entries:
        if entry.name.endswith(SUFFIX) and _is_file(entry):
            with contextlib.suppress(OSError):  # gone meanwhile
                stat = entry.stat()
                stamp = (stat.st_size, stat.st_mtime_ns)
                yield _File(entry.path, stamp, entry.name + RECORDING_SUFFIX in locked)


def _is_file(entry: os.DirEntry[str]) -> bool:
    try:
        return entry.is_file()
    except OSError:  # a link that leads to itself, or where this user may not look
        return False


def _summaries(folder: Path, progress: Progress, *, in_trash: bool) -> list[RunSummary]:
    indexed = folder / TRASH if in_trash else folder
    known = _load_index(indexed)
    index: Index = {}
    changed: list[_File] = []
    for file in _files(folder, in_trash=in_trash):
        entry = known.get(file.path)
        if entry is not None and entry[0] == file.stamp and not file.may_be_recorded:
            index[file.path] = entry
        else:
            changed.append(file)
    found = [summary for _, summary in index.values()]
    save_at_s = time.perf_counter() + _SAVE_S
    with Validator() as validator:
        for done, file in enumerate(changed):
            progress(done, len(changed))
            summary, lasts = _summary(Path(file.path), validator)
            found.append(summary)
            if lasts:
                index[file.path] = (file.stamp, summary)
            if (began_s := time.perf_counter()) >= save_at_s:
                _save_index(indexed, index)
                took_s = time.perf_counter() - began_s
                save_at_s = began_s + max(_SAVE_S, took_s / _SAVE_SHARE)
    if changed or len(index) != len(known):
        _save_index(indexed, index)
    return found


def _summary(path: Path, validator: Validator) -> tuple[RunSummary, bool]:
    """Summary of a file, and whether it holds until the file changes."""
    try:
        check_openable(path)
        summary = validator.validate(path)
        if summary.analyses:  # their results are shown, and hold for these samples alone
            read_file(path, check_samples)
        return msgspec.structs.replace(summary, path=str(path)), True
    except (NotARunError, DamagedRunError) as error:
        return RunSummary(path=str(path), fault=error.message), True
    except RunError as error:
        return RunSummary(path=str(path), fault=error.message), False


def _order(run: RunSummary) -> tuple[bool, float, str]:
    start = run.start_time
    return bool(run.fault), start.timestamp() if start else 0.0, run.path
