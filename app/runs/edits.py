"""Edits of a run's metadata: each is added to the history, none takes anything away."""

import datetime
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import h5py
import msgspec

from app.runs.errors import MetadataError, UnsuitableRunError
from app.runs.facts import Change, append_change, apply_change, read_changes, read_metadata, read_original
from app.runs.metadata import RunMetadata
from app.runs.rewrite import rewrite
from config.schema import Stand


def edit_run(path: Path, author: str, **fields: Any) -> Change:
    """Give some fields of `RunMetadata` new values; the old ones stay in the file.

    Raises
    ------
    MetadataError
        A field that cannot be edited, or a value that cannot be.
    RunError
        The file could not be replaced; it is as it was.
    """
    change = Change(_now(), author, msgspec.to_builtins(fields))
    return _append(path, lambda _file: change)


def fields_of_series(stand: Stand, code: str) -> dict[str, Any]:
    """Fields for `edit_run` of another series: it brings its pullback and plate mass. Raises SeriesError."""
    series = stand.series(code)
    return {"series": series.code, "plate_mass_kg": series.plate_mass_kg, "pullback_m": series.pullback_m}


def undo_edit(path: Path, author: str) -> Change:
    """Give back what stood there before the last edit that is not undone yet; the edit stays in the history.

    Raises
    ------
    UnsuitableRunError
        There is nothing to undo.
    RunError
        The file could not be replaced; it is as it was.
    """

    def back(file: h5py.File) -> Change:
        changes = read_changes(file)
        number = last_undoable(changes)
        if number is None:
            raise UnsuitableRunError(f"{path}: there is no edit to undo. It is as it was recorded")
        before = metadata_after(read_original(file), changes[:number])
        old = {name: getattr(before, name) for name in changes[number].fields}
        return Change(_now(), author, msgspec.to_builtins(old), undoes=number)

    return _append(path, back)


def last_undoable(changes: Sequence[Change]) -> int | None:
    """Number of the last edit that is neither undone nor an undoing; None where there is none."""
    undone = {change.undoes for change in changes}
    live = [i for i, change in enumerate(changes) if change.undoes is None and i not in undone]
    return live[-1] if live else None


def metadata_after(original: RunMetadata, changes: Sequence[Change]) -> RunMetadata:
    """Metadata with changes applied one after another. Raises ValueError."""
    for change in changes:
        original = apply_change(original, change)
    return original


def _append(path: Path, make: Callable[[h5py.File], Change]) -> Change:
    made: list[Change] = []

    def add(file: h5py.File) -> None:
        change = make(file)
        try:
            apply_change(read_metadata(file), change)
        except ValueError as error:
            raise MetadataError(f"{path}: {error}") from None
        append_change(file, change)
        made.append(change)

    rewrite(path, add)
    return made[0]


def _now() -> datetime.datetime:
    return datetime.datetime.now().astimezone()
