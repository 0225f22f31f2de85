"""Run files at each moment of their writing: the writes of HDF5 are captured and replayed."""

from collections.abc import Iterator
from pathlib import Path

_PAGE = 4096
"""A write that a kill interrupts ends at the border of two pages."""


class KeptWrites:
    """A file for HDF5's file-object driver that keeps what is written to it."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file = path.open("r+b", buffering=0)
        self.before = path.read_bytes()
        self.writes: list[tuple[int, bytes]] = []

    def __repr__(self) -> str:
        return str(self._path)  # h5py calls the file so

    def read(self, size: int) -> bytes | None:
        return self._file.read(size)

    def readinto(self, buffer: bytearray) -> int | None:
        return self._file.readinto(buffer)

    def write(self, data: bytes) -> int | None:
        self.writes.append((self._file.tell(), bytes(data)))
        return self._file.write(data)

    def seek(self, position: int, whence: int = 0) -> int:
        return self._file.seek(position, whence)

    def tell(self) -> int:
        return self._file.tell()

    def truncate(self, size: int) -> int:
        return self._file.truncate(size)

    def flush(self) -> None:
        self._file.flush()

    def close(self) -> None:
        self._file.close()

    def states(self) -> Iterator[tuple[int, bytes]]:
        """Number of whole writes, and the file after them; where a page ends in the next one, also then."""
        image = bytearray(self.before)
        for number, (start, data) in enumerate(self.writes):
            torn = start + _PAGE - start % _PAGE
            for end in [torn, start + len(data)] if torn < start + len(data) else [start + len(data)]:
                image.extend(bytes(max(0, end - len(image))))
                image[start:end] = data[: end - start]
                yield number + (end == start + len(data)), bytes(image)
