"""Journals that lie in a folder of runs: each is of a run that was not finished, or is being recorded."""

from collections.abc import Iterator
from pathlib import Path

from app.runs.journal import MAGIC, SUFFIX
from app.runs.lock import is_being_recorded


def find_journals(folder: Path) -> Iterator[Path]:
    """Files named like journals, in a folder and those below it, by name; hidden ones are left out."""
    for path in sorted(folder.rglob(f"*{SUFFIX}")):
        if not any(part.startswith(".") for part in path.relative_to(folder).parts):
            yield path.absolute()


def unfinished_journals(folder: Path) -> list[Path]:
    """Journals in a folder itself whose engine is gone; empty where there is no such folder."""
    paths = sorted(folder.glob(f"*{SUFFIX}"))
    return [path for path in paths if _is_journal(path) and not is_being_recorded(path)]


def _is_journal(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            return file.read(len(MAGIC)) == MAGIC
    except OSError:  # gone meanwhile, or not ours to read
        return False
