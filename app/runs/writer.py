"""Write run files while they are recorded, so that a crash at any moment leaves them readable.

The writer is a process of its own: HDF5 can crash the process that it runs in,
above all at the close after a full disk, and the engine and its journal must survive.
"""

import datetime
import math
import os
import time
import zlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NoReturn

import h5py
import msgspec
import numpy as np
from isal import isal_zlib
from numpy.typing import NDArray

from app.child_process import CommandReader, EventSender, ignore_session_signals, reserve_stdout
from app.log import start_log
from app.runs import disk, schema
from app.runs.blocks import BlockLayout, Columns, RunBlock, StoredRun, count_flags
from app.runs.columns import checksum
from app.runs.creation import column_paths, create_file
from app.runs.errors import DiskFullError, RunError, RunExistsError, WriteError
from app.runs.fields import fill_fields
from app.runs.journal import JournalSpan, RecordKind, UnreadableJournalError, read_journal
from app.runs.lock import FileLock, LockHeldError, recording_lock
from app.runs.metadata import EndMetadata, RunMetadata
from app.runs.paths import next_run_number, run_stem
from app.runs.writer_client import ERRORS, Closed, Failed, FrameDecoder, Opened, OpenRun, Reply, WriterCommand
from config.durable_files import remove_file, replace_file, sync_folder
from drivers.samples import Losses
from messages.i18n import N_

_FLUSH_S = 0.1  # longest loss of samples in the file by a crash; each flush costs two writes of metadata
_NAMES_MAX = 10_000


def create_run_in(
    folder: Path,
    metadata: RunMetadata,
    layout: BlockLayout | None = None,
    journal: JournalSpan | None = None,
    identifier: str = "",
) -> "RunWriter":
    """Create a run in `folder`, named by start, series and number: `20261121T143205_1FFM0_001.h5`.

    Runs of a series are numbered in their order. Raises RunError.
    """
    disk.make_folder(folder)
    stem = run_stem(metadata.start_time, metadata.series)
    first = next_run_number(folder, metadata.series)
    for number in range(first, first + _NAMES_MAX):
        try:
            path = folder / f"{stem}_{number:03d}{schema.SUFFIX}"
            return create_run(path, metadata, layout, journal, identifier)
        except RunExistsError:
            continue
    raise RunExistsError(
        "{folder}: all names {stem}_NNN are taken. Choose another folder", folder=folder, stem=stem
    )


def create_run(
    path: Path,
    metadata: RunMetadata,
    layout: BlockLayout | None = None,
    journal: JournalSpan | None = None,
    identifier: str = "",
) -> "RunWriter":
    """Create a run file with everything that is known before the first sample. Raises RunError.

    The raw bytes of `journal` are copied into it at the end. `identifier` is the UUID, a new one if empty.
    """
    path, layout, lock = path.absolute(), layout or BlockLayout(), recording_lock(path.absolute())
    try:
        lock.acquire()
        file = create_file(path, metadata, layout, identifier, has_wire=journal is not None)
    except LockHeldError:
        raise RunExistsError(
            "{path} is being recorded by another program. Choose another name", path=path
        ) from None
    except (OSError, RuntimeError) as error:
        lock.release()
        raise disk.storage_error(path, error) from None
    except BaseException:
        lock.release()
        raise
    return RunWriter(file, column_paths(metadata, layout), layout, lock, journal)


def write_run(
    path: Path,
    metadata: RunMetadata,
    blocks: RunBlock | Iterable[RunBlock],
    end: EndMetadata,
    *,
    replace: bool = False,
) -> StoredRun:
    """Write a whole run, or no file; `path` must not exist unless `replace`. Raises RunError.

    A long run is given as several blocks, of which no two are held.
    """
    path = path.absolute()
    target = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}") if replace else path
    rest = iter([blocks] if isinstance(blocks, RunBlock) else blocks)
    first = next(rest)
    writer = create_run(target, metadata, BlockLayout.of(first))
    try:
        writer.append(first)
        for block in rest:
            writer.append(block)
        stored = writer.close(end)
        if replace:
            replace_file(target, path)
            sync_folder(path.parent)
    except BaseException as error:
        remove_file(target)
        if isinstance(error, OSError):
            raise disk.storage_error(path, error) from None
        raise
    return msgspec.structs.replace(stored, path=str(path))


class RunWriter:
    """An open run file, made by `create_run`. After a WriteError it must not be used again."""

    def __init__(
        self,
        file: h5py.File,
        paths: list[str],
        layout: BlockLayout,
        lock: FileLock,
        journal: JournalSpan | None,
    ) -> None:
        self.path = Path(file.filename)
        self.losses = Losses()
        self.flushed_samples = 0
        """Rows that the file holds whatever happens next."""
        self.usable = True
        """False once HDF5 failed: the file then stays as it was flushed last, and must be left alone."""
        self._file = file
        self._columns = [file[path] for path in paths]
        self._checksums = dict.fromkeys(paths, 0)
        self._layout = layout
        self._lock = lock
        self._journal = journal
        self._raw_bytes_checksum = 0
        self._pending: list[Columns] = []
        self._pending_bytes = 0
        self._flushed_at = time.perf_counter()
        self._reserved_size = 0

    def append(self, block: RunBlock) -> None:
        """Add rows; they are on disk within 100 ms if this or `flush_if_due` is called meanwhile.

        Raises DiskFullError (a `usable` writer can be closed without the rows), WriteError, ValueError.
        """
        columns = block.columns(self._layout)
        pending_bytes = self._pending_bytes + sum(column.nbytes for column in columns)
        self._reserve(pending_bytes, ahead=pending_bytes + disk.MARGIN_BYTES)
        self._pending.append(columns)
        self._pending_bytes = pending_bytes
        self.losses += count_flags(block.status)
        self.flush_if_due()

    def flush_if_due(self) -> None:
        if self.flush_due_s <= 0.0:
            self.flush()

    @property
    def flush_due_s(self) -> float:
        """Time until rows must be brought to disk, negative if it is over; infinite where there are none."""
        return self._flushed_at + _FLUSH_S - time.perf_counter() if self._pending else math.inf

    def flush(self) -> None:
        """Bring all rows to disk, then the number of stored rows. Raises WriteError."""
        try:
            self._write_pending()
            self._file.flush()
            self._file[schema.STORED][()] = self.losses.samples
            self._file.flush()
            self.flushed_samples = self.losses.samples
        except (OSError, RuntimeError) as error:
            self.usable = False
            raise disk.storage_error(self.path, error) from None
        self._flushed_at = time.perf_counter()

    def close(self, end: EndMetadata) -> StoredRun:
        """Complete the file, read it back, bring it to disk. Raises WriteError: keep the journal then."""
        try:
            raw_bytes_stored = self._copy_raw_bytes()
            self.flush()
            for path, value in self._checksums.items():
                self._file[schema.checksum_path(path)][()] = value
            fill_fields(self._file, schema.END_FIELDS, end)
            self._file.flush()
            size = self._file.id.get_filesize()
            self._file.close()
            disk.truncate(self.path, size)
            self._verify()
            disk.sync_file(self.path)
            sync_folder(self.path.parent)
        except (OSError, RuntimeError) as error:
            self.usable = False
            raise disk.storage_error(self.path, error) from None
        finally:
            self._lock.release()
        return StoredRun(str(self.path), self.losses.samples, raw_bytes_stored)

    def interrupt(self, ended: str, message: str = "") -> StoredRun:
        """Close with the statistics of the stored rows. Raises WriteError."""
        now = datetime.datetime.now().astimezone()
        return self.close(EndMetadata(ended=ended, end_time=now, losses=self.losses, message=message))

    def discard(self) -> None:
        self._file.close()
        self.path.unlink()
        self._lock.release()

    def _write_pending(self) -> None:
        """Write all pending rows in one call: a call of HDF5 costs as much as hundreds of rows."""
        if not self._pending:
            return
        first = len(self._columns[0])
        for path, dataset, blocks in zip(
            self._checksums, self._columns, zip(*self._pending, strict=True), strict=True
        ):
            column = np.concatenate(blocks)
            dataset.resize((first + len(column),))
            dataset[first:] = column
            self._checksums[path] = zlib.crc32(column.data, self._checksums[path])
        self._pending, self._pending_bytes = [], 0

    def _reserve(self, upcoming: int, ahead: int = 0) -> None:
        """Reserve room for what is written next, and `ahead` bytes where there is room for them too.

        Rows that come when the disk has become full take what was reserved ahead. Raises DiskFullError,
        WriteError.
        """
        size = self._file.id.get_filesize()
        chunks = sum(dataset.chunks[0] * dataset.dtype.itemsize for dataset in self._columns)
        needed = upcoming + chunks + disk.MARGIN_BYTES
        if size + needed <= self._reserved_size:
            return
        try:
            self._reserved_size = disk.reserve_space(self.path, size, needed + ahead)
        except DiskFullError:
            self._reserved_size = disk.reserve_space(self.path, size, needed)

    def _copy_raw_bytes(self) -> bool:
        """Copy the journal's bytes; False without a readable journal or without room for them."""
        if self._journal is None:
            return False
        try:
            self._reserve(self._journal.size())
            self._raw_bytes_checksum = _append_raw_bytes(self._file, self._journal)
        except (DiskFullError, UnreadableJournalError):
            return False
        return True

    def _verify(self) -> None:
        """Read the datasets again that the journal is removed for."""
        expected = self._checksums | {schema.WIRE_DATA.path: self._raw_bytes_checksum}
        with h5py.File(self.path, "r", locking="best-effort") as file:
            for path, value in expected.items():
                dataset = file[path]
                is_whole = path == schema.WIRE_DATA.path or len(dataset) == self.losses.samples
                if not is_whole or checksum(dataset) != value:
                    self.flushed_samples = 0
                    template = N_(
                        "{path}: {dataset} does not read back as written. Check the disk, and run"
                        " `slipstand recover`: the journal of the run holds all that came"
                    )
                    raise WriteError(template, path=self.path, dataset=dataset.name)


_BATCH_BYTES = 1 << 20
"""Bytes copied at once, whatever the length of a run."""
_PACKING_LEVEL = 1
"""Of ISA-L, 0 to 3: lines shrink to 0.40; to 0.50 at 0, in as long; to 0.37 at 3, in 1.3 times as long."""


def _append_raw_bytes(file: h5py.File, journal: JournalSpan) -> int:
    """Append a journal's raw bytes to an open file. Returns their CRC-32. Raises UnreadableJournalError."""
    wire, arrival, end = (file[column.path] for column in schema.WIRE_COLUMNS)
    checksum, received, rest = 0, 0, b""
    try:
        for reads, arrivals_ns in _batches(journal):
            data = b"".join(reads)
            checksum = zlib.crc32(data, checksum)
            rest = _append_chunks(wire, rest + data)
            _append(arrival, np.array(arrivals_ns, np.int64))
            _append(end, np.uint64(received) + np.cumsum(np.fromiter(map(len, reads), np.uint64)))
            received += len(data)
        _append(wire, np.frombuffer(rest, np.uint8))
    except UnreadableJournalError:
        for column in schema.WIRE_COLUMNS:
            file[column.path].resize((0,))
        raise
    return checksum


def _append_chunks(dataset: h5py.Dataset, data: bytes) -> bytes:
    """Append as many whole chunks of a compressed dataset as `data` fill; returns the rest.

    The dataset ends at a border of chunks. ISA-L takes half the time of zlib's fastest way, for fewer bytes.
    """
    (size,) = dataset.chunks
    first = len(dataset)
    whole = len(data) - len(data) % size
    dataset.resize((first + whole,))
    for start in range(0, whole, size):
        packed = isal_zlib.compress(data[start : start + size], _PACKING_LEVEL)
        dataset.id.write_direct_chunk((first + start,), packed)
    return data[whole:]


def _batches(journal: JournalSpan) -> Iterator[tuple[list[bytes], list[int]]]:
    """Received bytes and their times of arrival, about a batch at a time. Raises UnreadableJournalError."""
    reads: list[bytes] = []
    arrivals_ns: list[int] = []
    size = 0
    try:
        for record in read_journal(Path(journal.path), journal.start):
            if record.kind is RecordKind.WIRE:
                reads.append(record.data)
                arrivals_ns.append(record.arrival_ns)
                size += len(record.data)
            if size >= _BATCH_BYTES:
                yield reads, arrivals_ns
                reads, arrivals_ns, size = [], [], 0
    except (OSError, ValueError) as error:
        raise UnreadableJournalError(str(error)) from None
    if reads:
        yield reads, arrivals_ns


def _append(dataset: h5py.Dataset, values: NDArray[np.generic]) -> None:
    first = len(dataset)
    dataset.resize((first + len(values),))
    dataset[first:] = values


_QUEUE_COMMANDS = 64
_IDLE_S = 5.0
_LEAST_WAIT_S = 0.001


def main() -> None:
    """Serve until stdin ends. Signals that end a session are left to the engine, whose end is seen here."""
    start_log("writer")
    ignore_session_signals("SIGTERM")
    commands: CommandReader[WriterCommand] = CommandReader.of_stdin(
        FrameDecoder().feed, queue_size=_QUEUE_COMMANDS
    )
    WriterServer(commands, EventSender(reserve_stdout())).serve()


class WriterServer:
    """Writes runs, one after another, until its input ends."""

    def __init__(self, commands: CommandReader[WriterCommand], replies: EventSender[Reply]) -> None:
        self._commands = commands
        self._replies = replies
        self._writer: RunWriter | None = None

    def serve(self) -> None:
        """Work until the input ends. After a failure Python must not close the file: HDF5 can hang."""
        try:
            while not self._commands.is_closed:
                due_s = self._writer.flush_due_s if self._writer else _IDLE_S
                self._execute(self._commands.take(min(max(due_s, _LEAST_WAIT_S), _IDLE_S)))
            self._finish("interrupted", "the program that recorded ended")
        except RunError as error:
            self._fail(error)
        except Exception as error:
            self._fail(WriteError("the run writer failed: {error}", error=error))
        self._replies.close()

    def _fail(self, error: RunError) -> NoReturn:
        """Close the run if that can be done, say what went wrong, and end."""
        writer = self._writer
        try:
            self._finish("disk-full" if isinstance(error, DiskFullError) else "write-error", str(error))
        except RunError as second:
            error = second
        reasons = (reason for reason, kind in ERRORS.items() if isinstance(error, kind))
        samples = writer.flushed_samples if writer else 0
        self._replies.send(Failed(next(reasons, "write-error"), error.message, samples))
        self._replies.close()
        os._exit(1)

    def _execute(self, command: WriterCommand | None) -> None:
        """Execute a command; bring older rows to disk while none comes."""
        writer = self._writer
        if isinstance(command, OpenRun):
            self._finish("interrupted", "another run was begun")
            self._writer = create_run_in(
                Path(command.folder), command.metadata, command.layout, command.journal, command.identifier
            )
            self._replies.send(Opened(str(self._writer.path)))
        elif command is None:
            if writer is not None:
                writer.flush_if_due()
        elif writer is None:
            raise WriteError("rows came for the writer before a run was opened. Open one first")
        elif isinstance(command, RunBlock):
            writer.append(command)
        else:
            stored = writer.close(command)
            self._writer = None
            self._replies.send(Closed(stored))

    def _finish(self, ended: str, message: str) -> None:
        writer, self._writer = self._writer, None
        if writer and writer.usable:
            writer.interrupt(ended, message)
