"""Edits of a run's metadata: each is added to the history, none takes anything away."""

import datetime
import functools
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import Any

import h5py
import msgspec

from app.runs import metadata_io
from app.runs.errors import MetadataError, UnsuitableRunError
from app.runs.fields import encode_text
from app.runs.rewrite import rewrite
from config.schema import Stand


def edit_run(path: Path, author: str, **fields: Any) -> metadata_io.Change:
    """Give fields of `RunMetadata` new values; the old ones stay in the file. Raises RunError."""
    change = metadata_io.Change(datetime.datetime.now().astimezone(), author, msgspec.to_builtins(fields))
    return _append(path, lambda _file: change)


def series_fields(stand: Stand, code: str) -> dict[str, Any]:
    """Fields for `edit_run` of another series: it brings its pullback and plate mass. Raises SeriesError."""
    series = stand.series(code)
    return {"series": series.code, "plate_mass_kg": series.plate_mass_kg, "pullback_m": series.pullback_m}


def undo_edit(path: Path, author: str, fields: Collection[str] = metadata_io.EDITABLE) -> metadata_io.Change:
    """Give back what stood there before the last edit of one of `fields` that is not undone yet.

    The edit stays in the history; what was edited again since stays as it is. Raises RunError.
    """

    def back(file: h5py.File) -> metadata_io.Change:
        changes = metadata_io.read_changes(file)
        numbers = [i for i in _undoable(changes) if not changes[i].fields.keys().isdisjoint(fields)]
        if not numbers:
            raise UnsuitableRunError("{path}: there is no edit to undo. It is as it was recorded", path=path)
        number = numbers[-1]
        before = functools.reduce(
            metadata_io.apply_change, changes[:number], metadata_io.read_recorded_metadata(file)
        )
        since = {name for i in _undoable(changes) if i > number for name in changes[i].fields}
        old = {name: getattr(before, name) for name in changes[number].fields if name not in since}
        return metadata_io.Change(
            datetime.datetime.now().astimezone(), author, msgspec.to_builtins(old), undoes=number
        )

    return _append(path, back)


def _undoable(changes: Sequence[metadata_io.Change]) -> list[int]:
    """Numbers of the edits that are neither undone nor an undoing."""
    undone = {change.undoes for change in changes}
    return [i for i, change in enumerate(changes) if change.undoes is None and i not in undone]


def _append(path: Path, make: Callable[[h5py.File], metadata_io.Change]) -> metadata_io.Change:
    made: list[metadata_io.Change] = []

    def add(file: h5py.File) -> None:
        change = make(file)
        for name, value in change.fields.items():
            if isinstance(value, str):
                encode_text(name, value)
        try:
            metadata_io.apply_change(metadata_io.read_metadata(file), change)
        except ValueError as error:
            raise MetadataError("{path}: {error}", path=path, error=error) from None
        metadata_io.append_change(file, change)
        made.append(change)

    rewrite(path, add)
    return made[0]
