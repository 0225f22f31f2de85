"""Files that arrive in a folder: which of them are complete and were not taken yet."""

import fnmatch
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from app.runs.exchange.formats import SUFFIXES

Stamp = tuple[int, int]
"""Size in bytes, and time of the last change in ns."""
READABLE: Final = tuple(f"*{suffix}" for suffix in SUFFIXES)
"""Names of files that the import reads, and of runs."""


@dataclass(eq=False, slots=True)
class Arrivals:
    """Looks at a folder again and again."""

    folder: Path
    patterns: tuple[str, ...]
    _seen: dict[Path, Stamp] = field(default_factory=dict)
    _taken: dict[Path, Stamp] = field(default_factory=dict)

    def look(self, *, at_once: bool = False) -> list[Path]:
        """Files that have not changed since the last look, or `at_once` all, that were not taken like this.

        They are in the order of their last change. Raises OSError where the folder cannot be listed.
        """
        now = dict(self._stamps())
        ready = [
            path
            for path, stamp in now.items()
            if stamp[0] and self._taken.get(path) != stamp and (at_once or self._seen.get(path) == stamp)
        ]
        self._seen = now
        return sorted(ready, key=lambda path: (now[path][1], path.name))

    def take(self, path: Path) -> bool:
        """Mark a file as taken as it was seen; whether it was taken before and has changed since."""
        was_taken = path in self._taken
        self._taken[path] = self._seen[path]
        return was_taken

    def _stamps(self) -> Iterable[tuple[Path, Stamp]]:
        for path in self.folder.iterdir():
            name = path.name.lower()
            is_wanted = any(fnmatch.fnmatchcase(name, pattern.lower()) for pattern in self.patterns)
            if not is_wanted or name.startswith((".", "~$")):
                continue
            try:
                known = path.stat()
            except FileNotFoundError:  # it has gone since the folder was listed
                continue
            if path.is_file():
                yield path, (known.st_size, known.st_mtime_ns)
