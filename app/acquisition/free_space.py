"""How much is free on a disk, asked by a thread: a share that begins to hang holds nobody up."""

import threading
from pathlib import Path

from app.runs.disk import free_bytes

_EVERY_S = 0.5


class FreeSpacePoller:
    """Looks after the disk of one folder after another, twice a second.

    Parameters
    ----------
    folder : Path
        Need not exist.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._free = free_bytes(folder)
        self._changing = threading.Lock()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._look_on, name="free space", daemon=True)
        self._thread.start()

    @property
    def free_bytes(self) -> int | None:
        """Of the folder that is followed; None where nobody can tell."""
        return self._free

    def set_folder(self, folder: Path) -> None:
        """Look after another folder from now on; the first look is this one."""
        with self._changing:
            self._folder = folder
            self._free = free_bytes(folder)

    def stop(self) -> None:
        """End, without waiting for a disk that hangs."""
        self._stopping.set()

    def _look_on(self) -> None:
        while not self._stopping.wait(_EVERY_S):
            folder = self._folder
            free = free_bytes(folder)
            with self._changing:
                if folder == self._folder:
                    self._free = free
