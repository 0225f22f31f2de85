"""The live ring: counts of the latest samples in a mapped file, written by the engine, read by anybody.

The writer announces how far it is about to write, writes, then announces how far it has written. A reader
copies rows, then checks whether the writer has announced to overwrite any of them; neither waits. Readers
convert the counts by the calibration that the file holds.

A plain file is mapped rather than `multiprocessing.shared_memory`, whose resource tracker removes a block
when any process that looked at it ends.
"""

import contextlib
import mmap
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import msgspec
import numpy as np
from numpy.typing import NDArray

from app.acquisition.errors import RingError
from app.runs.blocks import CalibratedBlock, calibrate
from app.runs.lock import FileLock, is_held
from config.schema import Gauges
from drivers.arrays import Counts, Floats
from drivers.samples import SampleBlock
from messages.i18n import N_

_MAGIC = np.uint64(0x32474E495250494C)  # "LIPRING2"
_WORDS = 5  # of the header: magic, capacity, rows announced, rows written, bytes of the settings behind them
_PAGE_BYTES = 4096
_ROW_BYTES = 2 * 8 + 1
_LAPPED_TRIES = 3  # a reader that the writer has overtaken so often returns what is left
_HELD_S = 60.0  # time that the ring should hold, within `_HELD_ROWS`
_HELD_ROWS = (1 << 16, 1 << 21)


@dataclass(frozen=True, eq=False, slots=True)
class RingRows(CalibratedBlock):
    """Consecutive rows of a ring."""

    time_s: Floats  # (n,) seconds since the first sample of the stream
    lost: int = 0  # rows between the one asked for and the first one: overwritten before they could be read


def timed_rows(block: CalibratedBlock, rate_hz: float, lost: int = 0) -> RingRows:
    """Rows of a block, on the time axis of the stream."""
    return RingRows(
        block.first_index,
        block.counts,
        block.readings,
        block.relative_m,
        block.status,
        time_s=np.arange(block.first_index, block.end_index) / rate_hz,
        lost=lost,
    )


class _RingSettings(msgspec.Struct):
    rate_hz: float
    gauges: Gauges


class _Ring:
    """The mapped file, its header and columns as arrays; use it with `with` or `close`."""

    def __init__(self, mapped: mmap.mmap) -> None:
        self._mapped = mapped
        self._header = np.frombuffer(mapped, np.uint64, _WORDS)
        settings_end = 8 * _WORDS + int(self._header[4])
        settings = msgspec.json.decode(mapped[8 * _WORDS : settings_end], type=_RingSettings)
        self.capacity = int(self._header[1])
        self.rate_hz = settings.rate_hz
        self._gauges = settings.gauges
        start = _columns_start(settings_end)
        counts = np.frombuffer(mapped, np.float64, 2 * self.capacity, offset=start)
        status = np.frombuffer(mapped, np.uint8, self.capacity, offset=start + 16 * self.capacity)
        self._columns: tuple[NDArray[Any], ...] = (counts.reshape(-1, 2), status)

    @property
    def written(self) -> int:
        return int(self._header[3])

    def close(self) -> None:
        """Unmap the file. A caller that still holds a view keeps the mapping alive."""
        del self._header, self._columns
        with contextlib.suppress(BufferError):
            self._mapped.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class RingWriter(_Ring):
    """The one writer of a ring; make it with `create_ring`."""

    def __init__(self, mapped: mmap.mmap, path: Path) -> None:
        super().__init__(mapped)
        self.path = path

    def append(self, counts: Counts, status: NDArray[np.uint8]) -> None:
        """Add rows of counts (n, 2) and flags (n,); the oldest ones are overwritten."""
        n, capacity = len(status), self.capacity
        end = self.written + n
        self._header[2] = end
        kept = min(n, capacity)
        first = (end - kept) % capacity
        split = min(kept, capacity - first)
        for column, values in zip(self._columns, (counts, status), strict=True):
            latest = values[n - kept :]
            column[first : first + split] = latest[:split]
            column[: kept - split] = latest[split:]
        self._header[3] = end

    def close(self) -> None:
        """Unmap and remove the file; readers keep what they have mapped."""
        super().close()
        with contextlib.suppress(OSError):  # Windows keeps a mapped file; its folder's owner removes it
            self.path.unlink()


class RingReader(_Ring):
    """Reads a ring that another process writes; make it with `open_ring`."""

    def read_since(self, row: int) -> RingRows:
        """Rows from number `row` on, or the oldest that are left. Call it with their `end_index` next."""
        for _ in range(_LAPPED_TRIES):
            end = self.written
            first = min(max(row, end - self.capacity), end)
            counts, status = self._copy(first, end)
            overwritten = max(0, int(self._header[2]) - self.capacity - first)
            if overwritten < max(end - first, 1):
                break
        overwritten = min(overwritten, end - first)
        first += overwritten
        block = calibrate(SampleBlock(first, counts[overwritten:], status[overwritten:], 0), self._gauges)
        return timed_rows(block, self.rate_hz, max(0, first - row))

    def _copy(self, first: int, end: int) -> list[Any]:
        start, count = first % self.capacity, end - first
        split = min(count, self.capacity - start)
        return [
            np.concatenate([column[start : start + split], column[: count - split]])
            for column in self._columns
        ]


def ring_capacity(rate_hz: float) -> int:
    """Rows that a ring should hold: those of a minute, within bounds."""
    fewest, most = _HELD_ROWS
    return min(max(round(_HELD_S * rate_hz), fewest), most)


def create_ring(path: Path, capacity: int, rate_hz: float, gauges: Gauges) -> RingWriter:
    """Create the file of a ring for `capacity` rows at `rate_hz`. Raises RingError."""
    settings = msgspec.json.encode(_RingSettings(rate_hz, gauges))
    size = _columns_start(8 * _WORDS + len(settings)) + _ROW_BYTES * capacity
    try:
        with path.open("x+b") as file:
            if sys.platform == "linux":  # a page of a mapped file that finds no room ends the process
                os.posix_fallocate(file.fileno(), 0, size)
            file.truncate(size)
            mapped = mmap.mmap(file.fileno(), size)
    except OSError as error:
        template = N_("{path}: no room for live samples ({error}). Free {size} MiB there")
        raise RingError(template, path=path, error=error, size=size >> 20) from None
    mapped[8 * _WORDS : 8 * _WORDS + len(settings)] = settings
    np.frombuffer(mapped, np.uint64, _WORDS)[:] = (_MAGIC, capacity, 0, 0, len(settings))
    return RingWriter(mapped, path)


def open_ring(path: Path | str) -> RingReader:
    """Map a ring that an engine writes. Raises RingError."""
    try:
        with Path(path).open("rb") as file:
            mapped = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except (OSError, ValueError) as error:
        raise RingError(
            "{path}: no live samples there ({error}). Start the engine again", path=path, error=error
        ) from None
    if len(mapped) < _PAGE_BYTES or np.frombuffer(mapped, np.uint64, 1)[0] != _MAGIC:
        raise RingError("{path} is not a ring of live samples. Start the engine again", path=path)
    return RingReader(mapped)


def _columns_start(settings_end: int) -> int:
    return -(-settings_end // _PAGE_BYTES) * _PAGE_BYTES


MEMORY_FOLDER = Path("/dev/shm")
"""Files in memory on Linux. A mapped page of a disk may wait for the disk, and all threads with it."""
_MEMORY_BYTES = 1 << 26  # free there: more than the largest ring needs
_PREFIX = "slipstand-live-"
_LOCK = "engine.lock"
_SETTLED_S = 60.0  # a younger folder may belong to an engine that has not locked it yet


@contextlib.contextmanager
def live_folder() -> Iterator[Path]:
    """Make a folder for this user alone, and remove those of engines that were killed."""
    parent = _live_parent()
    for searched in {parent, Path(tempfile.gettempdir())}:
        _remove_abandoned(searched)
    folder = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=parent))
    try:
        with FileLock(folder / _LOCK):
            yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)  # Windows keeps a mapped file; the client removes it


def _live_parent() -> Path:
    """Folder in memory where the system has one with room, else that of temporary files."""
    with contextlib.suppress(OSError):
        is_writable = os.access(MEMORY_FOLDER, os.W_OK | os.X_OK)
        if is_writable and shutil.disk_usage(MEMORY_FOLDER).free >= _MEMORY_BYTES:
            return MEMORY_FOLDER
    return Path(tempfile.gettempdir())


def _remove_abandoned(parent: Path) -> None:
    """Remove folders of engines that were killed; those of other users cannot be removed, and stay."""
    for folder in parent.glob(f"{_PREFIX}*"):
        with contextlib.suppress(OSError):
            is_settled = time.time() - folder.stat().st_mtime > _SETTLED_S
            if is_settled and not folder.is_symlink() and not is_held(folder / _LOCK):
                shutil.rmtree(folder, ignore_errors=True)
