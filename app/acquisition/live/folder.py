"""The folder of an engine's live ring: for this user alone, and gone when the engine is."""

import contextlib
import shutil
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from app.runs.lock import FileLock, is_held

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
