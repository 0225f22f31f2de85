"""What tells one run file from every other: its hash, its identifier, and the checksums of its columns."""

import hashlib
from pathlib import Path

import h5py
import msgspec
import numpy as np

from app.runs import format as names
from app.runs.errors import RunNotFoundError
from app.runs.format import read_text
from app.runs.reader import read_file


class Fingerprint(msgspec.Struct, frozen=True):
    """Of one run file.

    Attributes
    ----------
    name : str
        Of the file, without its folder.
    size_bytes : int
    sha256 : str
        Of the whole file; it changes when an analysis or an edit is added to the run.
    identifier : str
        UUID given when it was recorded, which never changes.
    columns : dict of str
        CRC-32 of each column of samples, hexadecimal, as kept when the run was closed: these never change
        either.
    """

    name: str
    size_bytes: int
    sha256: str
    identifier: str = ""
    columns: dict[str, str] = {}


def compute_fingerprint(path: Path) -> Fingerprint:
    """Take the fingerprint of a run file that was examined. Raises RunError."""
    hashed, size = file_sha256(path)
    identifier, columns = read_file(path, _kept)
    return Fingerprint(path.name, size, hashed, identifier, columns)


def file_sha256(path: Path) -> tuple[str, int]:
    """SHA-256 of a file, hexadecimal, and its size in bytes. Raises RunNotFoundError."""
    try:
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256")
            return digest.hexdigest(), file.tell()
    except OSError as error:
        raise RunNotFoundError(f"{path}: cannot be read ({error.strerror}). Check its rights") from None


def _kept(file: h5py.File) -> tuple[str, dict[str, str]]:
    group = file.get(names.CHECKSUMS)
    columns = (
        {} if group is None else {name: f"{int(np.uint32(value[()])):08x}" for name, value in group.items()}
    )
    return read_text(file, f"{names.ENTRY}/entry_identifier_uuid"), columns
