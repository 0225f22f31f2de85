"""Writes one run file while it is being recorded, so that a crash at any moment leaves it readable."""

import datetime
import math
import os
import time
import zlib
from pathlib import Path

import h5py
import numpy as np

from app.runs import schema as names
from app.runs.blocks import BlockLayout, Columns, RunBlock, StoredRun, count_flags
from app.runs.checksums import checksum, keep_checksum
from app.runs.creation import create_file
from app.runs.disk import MARGIN_BYTES, reserve_space, storage_error, sync_file, sync_folder, truncate
from app.runs.errors import DiskFullError, RunExistsError, WriteError
from app.runs.file_template import column_paths
from app.runs.journal import JournalSpan, UnreadableJournalError
from app.runs.lock import FileLock, LockHeldError, recording_lock
from app.runs.metadata import EndMetadata, Events, RunMetadata
from app.runs.raw_bytes import copy_raw_bytes
from app.runs.schema import fill_text
from drivers.samples import Losses

_FLUSH_S = 0.1
_SAME_NAME_MAX = 10_000


def create_run_in(
    folder: Path,
    metadata: RunMetadata,
    layout: BlockLayout | None = None,
    journal: JournalSpan | None = None,
    identifier: str = "",
) -> "RunWriter":
    """Create a run under the next free name in `folder`, like `20261121T143205_1FFM0_001.h5`.

    Raises
    ------
    MetadataError, DiskFullError, WriteError
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise WriteError(f"{folder} is a file and cannot be written into. Choose a folder") from None
    except OSError as error:
        raise storage_error(folder, error) from None
    began = metadata.start_time.strftime("%Y%m%dT%H%M%S")
    stem = f"{began}_{metadata.series}" if metadata.series else began
    for number in range(1, _SAME_NAME_MAX):
        try:
            path = folder / f"{stem}_{number:03d}{names.SUFFIX}"
            return create_run(path, metadata, layout, journal, identifier)
        except RunExistsError:
            continue
    raise RunExistsError(f"{folder}: all names {stem}_NNN are taken. Choose another folder")


def create_run(
    path: Path,
    metadata: RunMetadata,
    layout: BlockLayout | None = None,
    journal: JournalSpan | None = None,
    identifier: str = "",
) -> "RunWriter":
    """Create a run file that must not exist yet, with all that is known before the first sample.

    Parameters
    ----------
    path : Path
        Its final name.
    metadata, layout
        What it carries and what its blocks hold.
    journal
        Bytes that are copied in at the end.
    identifier
        UUID of the run; a new one if empty.

    Raises
    ------
    RunExistsError, MetadataError, DiskFullError, WriteError
    """
    path, layout, lock = path.absolute(), layout or BlockLayout(), recording_lock(path.absolute())
    try:
        lock.acquire()
        file = create_file(path, metadata, layout, identifier)
    except LockHeldError:
        raise RunExistsError(f"{path} is being recorded by another program. Choose another name") from None
    except (OSError, RuntimeError) as error:
        lock.release()
        raise storage_error(path, error) from None
    except BaseException:
        lock.release()
        raise
    return RunWriter(file, column_paths(metadata, layout), layout, lock, journal)


class RunWriter:
    """An open run file, made by `create_run`. After a WriteError it must not be used again."""

    def __init__(
        self,
        file: h5py.File,
        column_paths: list[str],
        layout: BlockLayout,
        lock: FileLock,
        journal: JournalSpan | None,
    ) -> None:
        self.path = Path(file.filename)
        self.losses = Losses()
        """Account of the rows stored until now, from their flags."""
        self.flushed_samples = 0
        """Rows that the file holds whatever comes."""
        self._file = file
        self.usable = True
        """False once HDF5 failed: the file must then be left alone, it stays as it was flushed last."""
        self._column_paths = column_paths
        self._columns = [file[path] for path in column_paths]
        self._checksums = [0] * len(column_paths)
        self._layout = layout
        self._lock = lock
        self._journal = journal
        self._raw_bytes_checksum = 0
        self._pending: list[Columns] = []
        self._pending_bytes = 0
        self._flushed_at = time.monotonic()

    def append(self, block: RunBlock) -> None:
        """Add rows; they are on disk within 100 ms if this or `flush_if_due` is called meanwhile.

        Raises
        ------
        DiskFullError
            There is no room for them: the run can still be closed, without them, while it is `sound`.
        WriteError
            HDF5 failed.
        ValueError
            The block does not have the shape that the layout says.
        """
        columns = block.columns(self._layout)
        pending_bytes = self._pending_bytes + sum(column.nbytes for column in columns)
        self._reserve(pending_bytes)
        self._pending.append(columns)
        self._pending_bytes = pending_bytes
        _add(self.losses, count_flags(block.status))
        self.flush_if_due()

    def flush_if_due(self) -> None:
        """Bring to disk what is older than 100 ms. Raises WriteError."""
        if self._pending and time.monotonic() - self._flushed_at >= _FLUSH_S:
            self.flush()

    def flush(self) -> None:
        """Bring all rows to disk: first the rows, then the word that they are there. Raises WriteError."""
        try:
            self._write_pending()
            self._file.flush()
            self._file[names.STORED][()] = self.losses.samples
            self._file.flush()
            self.flushed_samples = self.losses.samples
        except (OSError, RuntimeError) as error:
            self.usable = False
            raise storage_error(self.path, error) from None
        self._flushed_at = time.monotonic()

    def close(self, ending: EndMetadata) -> StoredRun:
        """Complete the file, check it by reading it again, and bring it to disk.

        Raises
        ------
        WriteError
            It could not be completed, or does not read back: keep the journal.
        """
        try:
            raw_bytes_stored = self._copy_raw_bytes()
            self.flush()
            self._complete(ending)
            size = self._file.id.get_filesize()
            self._file.close()
            truncate(self.path, size)
            self._verify()
            sync_file(self.path)
            sync_folder(self.path.parent)
        except (OSError, RuntimeError) as error:
            self.usable = False
            raise storage_error(self.path, error) from None
        finally:
            self._lock.release()
        return StoredRun(str(self.path), self.losses.samples, raw_bytes_stored)

    def interrupt(self, ended: str, message: str = "") -> StoredRun:
        """Close with what the rows themselves tell. Raises WriteError."""
        now = datetime.datetime.now().astimezone()
        return self.close(EndMetadata(ended=ended, end_time=now, losses=self.losses, message=message))

    def discard(self) -> None:
        """Remove a file of which nothing is worth keeping."""
        self._file.close()
        self.path.unlink()
        self._lock.release()

    def _write_pending(self) -> None:
        """Hand the rows to HDF5, all at once: each call costs as much as hundreds of rows."""
        if not self._pending:
            return
        first = len(self._columns[0])
        for i, dataset in enumerate(self._columns):
            column = np.concatenate([columns[i] for columns in self._pending])
            dataset.resize((first + len(column),))
            dataset[first:] = column
            self._checksums[i] = zlib.crc32(column.data, self._checksums[i])
        self._pending, self._pending_bytes = [], 0

    def _reserve(self, upcoming: int) -> None:
        chunks = len(self._columns) * names.CHUNK * 8
        reserve_space(self.path, self._file.id.get_filesize(), upcoming + chunks + MARGIN_BYTES)

    def _copy_raw_bytes(self) -> bool:
        """Copy the journal's bytes; False where there are none to be had, or no room for them."""
        if self._journal is None:
            return False
        try:
            self._reserve(self._journal.size())
            self._raw_bytes_checksum = copy_raw_bytes(self._file, self._journal)
        except (DiskFullError, UnreadableJournalError):
            return False
        return True

    def _complete(self, ending: EndMetadata) -> None:
        """Fill in what is only known at the end, when all rows are on disk."""
        for path, value in zip(self._column_paths, self._checksums, strict=True):
            keep_checksum(self._file, path, value)
        _fill_ending(self._file, ending)
        self._file.flush()

    def _expected(self) -> dict[str, int]:
        """Checksum of each dataset that a journal may only be removed for."""
        columns = dict(zip(self._column_paths, self._checksums, strict=True))
        return columns | {names.WIRE_DATA: self._raw_bytes_checksum}

    def _verify(self) -> None:
        with h5py.File(self.path, "r", locking="best-effort") as file:
            for path, expected in self._expected().items():
                dataset = file[path]
                is_whole = path == names.WIRE_DATA or len(dataset) == self.losses.samples
                if not is_whole or checksum(dataset) != expected:
                    self.flushed_samples = 0
                    raise WriteError(
                        f"{self.path}: {dataset.name} does not read back as written. Check the disk, and"
                        " run `slipstand recover`: the journal of the run holds all that came"
                    )


def _add(losses: Losses, more: Losses) -> None:
    losses.samples += more.samples
    losses.missing += more.missing
    losses.damaged += more.damaged
    losses.overloaded += more.overloaded


def _fill_ending(file: h5py.File, ending: EndMetadata) -> None:
    for name in Events.__struct_fields__:
        file[names.event_path(name)][()] = _or_nan(getattr(ending.events, name))
    for name in Losses.__slots__:
        file[f"{names.LOSSES}/{name}"][()] = getattr(ending.losses, name)
    file[names.CLOCK_SCALE][()] = ending.clock_scale
    file[names.CLOCK_SCALE_UNCERTAINTY][()] = ending.clock_scale_uncertainty
    file[names.SKEW][()] = _or_nan(ending.skew_s)
    file[names.SKEW_UNCERTAINTY][()] = _or_nan(ending.skew_standard_uncertainty_s)
    file[names.DWELL][()] = _or_nan(ending.dwell_s)
    file[names.ZERO][()] = _or_nan(ending.zero_m)
    file[names.RELATIVE_ZERO][()] = _or_nan(ending.relative_zero_m)
    file[names.HELD][()] = _or_nan(ending.held_m)
    fill_text(file, names.MESSAGE, ending.message)
    fill_text(file, names.END_TIME, ending.end_time.isoformat())
    fill_text(file, names.ENDED, ending.ended)


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else value


def write_run(
    path: Path, metadata: RunMetadata, block: RunBlock, ending: EndMetadata, *, replace: bool = False
) -> StoredRun:
    """Write a closed run file, or none.

    Parameters
    ----------
    path
        Must not exist yet, unless `replace`.

    Raises
    ------
    RunExistsError, MetadataError, DiskFullError, WriteError
    """
    path = path.absolute()
    made = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}") if replace else path
    writer = create_run(made, metadata, BlockLayout.of(block))
    try:
        writer.append(block)
        stored = writer.close(ending)
        if replace:
            made.replace(path)
    except OSError as error:
        made.unlink(missing_ok=True)
        raise storage_error(path, error) from None
    except BaseException:
        made.unlink(missing_ok=True)
        raise
    return StoredRun(str(path), stored.samples, stored.raw_bytes_stored)
