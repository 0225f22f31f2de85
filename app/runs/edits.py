"""Edits of a run's metadata: each is added to the history, none takes anything away."""

import datetime
from pathlib import Path
from typing import Any

import h5py
import msgspec

from app.runs.errors import MetadataError
from app.runs.facts import Change, append_change, apply_change, read_metadata
from app.runs.rewrite import rewrite


def edit_run(path: Path, author: str, **fields: Any) -> None:
    """Give some fields of `RunMetadata` new values; the old ones stay in the file.

    Raises
    ------
    MetadataError
        A field that cannot be edited, or a value that cannot be.
    RunError
        The file could not be replaced; it is as it was.
    """
    change = Change(datetime.datetime.now().astimezone(), author, msgspec.to_builtins(fields))

    def add(file: h5py.File) -> None:
        try:
            apply_change(read_metadata(file), change)
        except ValueError as error:
            raise MetadataError(f"{path}: {error}") from None
        append_change(file, change)

    rewrite(path, add)
