"""Disks that are full, for tests of what is written to them."""

import errno
import threading


class FailingFile:
    """A file on a disk that takes `room` more bytes; then it fails, once `fails` is set."""

    def __init__(
        self, file, room: int, code: int = errno.ENOSPC, fails: threading.Event | None = None
    ) -> None:
        self._file = file
        self._room = room
        self._code = code
        self._fails = fails

    def write(self, data) -> int:
        if self._room <= 0:
            if self._fails is not None:
                self._fails.wait(60.0)
            raise OSError(self._code, "injected")
        taken = self._file.write(bytes(data)[: self._room])
        self._room -= taken
        return taken

    def fileno(self) -> int:
        return self._file.fileno()

    def close(self) -> None:
        self._file.close()
