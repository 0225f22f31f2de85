"""The live ring: the latest samples, written by the engine and read by whoever looks, in a mapped file.

The writer announces how far it is about to write, writes, then announces how far it has written. A reader
copies rows and looks afterwards whether the writer has announced to overwrite any of them; nobody waits.
A plain file is mapped rather than `multiprocessing.shared_memory`, whose resource tracker removes a block
when any process that looked at it ends.
"""

import contextlib
import mmap
import shutil
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from app.acquisition.errors import RingError
from app.runs.lock import FileLock, is_held

Floats = NDArray[np.float64]

_MAGIC = np.uint64(0x31474E495250494C)  # "LIPRING1"
_HEADER_BYTES = 4096
_ROW_BYTES = 3 * 8 + 1
_LAPPED_TRIES = 3
_HELD_S = 60.0
_HELD_ROWS = (1 << 16, 1 << 21)


@dataclass(frozen=True, eq=False, slots=True)
class RingRows:
    """Consecutive rows of a ring.

    Attributes
    ----------
    first_row : int
        Number of the first row, counted from the first sample of the stream.
    time_s : (n,) float64
        Seconds since the first sample of the stream.
    table_m, relative_m : (n,) float64
        Displacements (m), NaN where absent.
    status : (n,) uint8
        `drivers.samples.SampleStatus` flags.
    lost : int
        Rows between the one asked for and `first_row`: overwritten before they could be read.
    """

    first_row: int
    time_s: Floats
    table_m: Floats
    relative_m: Floats
    status: NDArray[np.uint8]
    lost: int = 0

    def __len__(self) -> int:
        return len(self.status)


class _MappedRing:
    """The file's header and columns as arrays."""

    def __init__(self, mapped: mmap.mmap) -> None:
        self.mapped = mapped
        self.columns: list[NDArray[Any]] = []
        self.header: NDArray[np.uint64] = np.frombuffer(mapped, np.uint64, 8)
        self.rate: Floats = np.frombuffer(mapped, np.float64, 1, offset=64)

    def map_columns(self) -> None:
        n = self.capacity
        at = [_HEADER_BYTES + i * 8 * n for i in range(4)]
        self.columns = [np.frombuffer(self.mapped, np.float64, n, offset=start) for start in at[:3]]
        self.columns.append(np.frombuffer(self.mapped, np.uint8, n, offset=at[3]))

    @property
    def capacity(self) -> int:
        return int(self.header[1])

    @property
    def announced(self) -> int:
        return int(self.header[2])

    @property
    def written(self) -> int:
        return int(self.header[3])

    def close(self) -> None:
        del self.header, self.rate, self.columns
        # A caller that still holds a view keeps the mapping alive; it is unmapped with the view.
        with contextlib.suppress(BufferError):
            self.mapped.close()


class RingWriter:
    """The one writer of a ring; make it with `create_ring`."""

    def __init__(self, ring: _MappedRing, path: Path) -> None:
        self._ring = ring
        self.path = path

    @property
    def capacity(self) -> int:
        """Rows that the ring holds."""
        return self._ring.capacity

    def append(self, time_s: Floats, table_m: Floats, relative_m: Floats, status: NDArray[np.uint8]) -> None:
        """Add rows (n,) each; the oldest ones are overwritten."""
        ring, n, capacity = self._ring, len(status), self._ring.capacity
        end = ring.written + n
        ring.header[2] = end
        kept = min(n, capacity)
        first = (end - kept) % capacity
        split = min(kept, capacity - first)
        arrays: tuple[NDArray[Any], ...] = (time_s, table_m, relative_m, status)
        for column, values in zip(ring.columns, arrays, strict=True):
            latest = values[n - kept :]
            column[first : first + split] = latest[:split]
            column[: kept - split] = latest[split:]
        ring.header[3] = end

    def close(self) -> None:
        """Unmap and remove the file; readers keep what they have mapped."""
        self._ring.close()
        with contextlib.suppress(OSError):  # Windows keeps a mapped file; its folder's owner removes it
            self.path.unlink()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class RingReader:
    """Reads a ring that another process writes; make it with `open_ring`, use it with `with` or `close`."""

    def __init__(self, ring: _MappedRing) -> None:
        self._ring = ring

    @property
    def rate_hz(self) -> float:
        """Nominal samples a second."""
        return float(self._ring.rate[0])

    @property
    def capacity(self) -> int:
        """Rows that the ring holds."""
        return self._ring.capacity

    @property
    def written(self) -> int:
        """Rows written since the stream began; the number of the next one."""
        return self._ring.written

    def read_since(self, row: int) -> RingRows:
        """Rows from number `row` on; where the writer has overtaken it, from the oldest that is left.

        Go on with `first_row + len(rows)`.
        """
        for _ in range(_LAPPED_TRIES):
            end = self.written
            first = min(max(row, end - self.capacity), end)
            columns = self._copy(first, end)
            overwritten = max(0, self._ring.announced - self.capacity - first)
            if overwritten < max(end - first, 1):
                break
        kept = [column[overwritten:] for column in columns]
        first += min(overwritten, end - first)
        return RingRows(first, kept[0], kept[1], kept[2], kept[3], lost=max(0, first - row))

    def close(self) -> None:
        """Unmap the file."""
        self._ring.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _copy(self, first: int, end: int) -> list[Any]:
        capacity = self.capacity
        start, count = first % capacity, end - first
        split = min(count, capacity - start)
        return [
            np.concatenate([column[start : start + split], column[: count - split]])
            for column in self._ring.columns
        ]


def ring_capacity(rate_hz: float) -> int:
    """Rows that a ring should hold: those of a minute, within bounds."""
    fewest, most = _HELD_ROWS
    return min(max(round(_HELD_S * rate_hz), fewest), most)


def create_ring(path: Path, capacity: int, rate_hz: float) -> RingWriter:
    """Create the file of a ring for `capacity` rows at `rate_hz`. Raises RingError."""
    size = _HEADER_BYTES + _ROW_BYTES * capacity
    try:
        with path.open("x+b") as file:
            file.truncate(size)
            mapped = mmap.mmap(file.fileno(), size)
    except OSError as error:
        raise RingError(
            "{path}: no room for live samples ({error}). Free {size} MiB there",
            path=path,
            error=error,
            size=size >> 20,
        ) from None
    ring = _MappedRing(mapped)
    ring.header[1:4] = (capacity, 0, 0)
    ring.rate[0] = rate_hz
    ring.map_columns()
    ring.header[0] = _MAGIC
    return RingWriter(ring, path)


def open_ring(path: Path | str) -> RingReader:
    """Map a ring that an engine writes. Raises RingError."""
    try:
        with Path(path).open("rb") as file:
            mapped = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except (OSError, ValueError) as error:
        raise RingError(
            "{path}: no live samples there ({error}). Start the engine again", path=path, error=error
        ) from None
    if len(mapped) < _HEADER_BYTES or np.frombuffer(mapped, np.uint64, 1)[0] != _MAGIC:
        raise RingError("{path} is not a ring of live samples. Start the engine again", path=path)
    ring = _MappedRing(mapped)
    ring.map_columns()
    return RingReader(ring)


_PREFIX = "slipstand-live-"
_LOCK = "engine.lock"
_SETTLED_S = 60.0
"""A younger folder may belong to an engine that has not locked it yet."""


@contextlib.contextmanager
def live_folder() -> Iterator[Path]:
    """Make a folder that nobody else may enter; folders of engines that were killed are removed.

    POSIX systems give it mode 0700. Windows gives it the rights of the user's own temporary folder, which
    lets in nobody but the user and administrators.
    """
    _sweep(Path(tempfile.gettempdir()))
    folder = Path(tempfile.mkdtemp(prefix=_PREFIX))
    lock = FileLock(folder / _LOCK)
    try:
        with lock:
            yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)  # Windows keeps a mapped file; the client removes it


def _sweep(parent: Path) -> None:
    """Remove what engines left that were killed; what is not ours cannot be removed, and stays."""
    for folder in parent.glob(f"{_PREFIX}*"):
        with contextlib.suppress(OSError):
            is_settled = time.time() - folder.stat().st_mtime > _SETTLED_S
            if is_settled and not folder.is_symlink() and not is_held(folder / _LOCK):
                shutil.rmtree(folder, ignore_errors=True)
