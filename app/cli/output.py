"""What a command writes: JSON alone on stdout, everything for people on stderr or as text."""

import json
import sys
import textwrap
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from app.cli.errors import CommandError, alternatives
from messages.control_characters import json_escapes, show_control_characters
from messages.message import Message


def print_json(document: object) -> None:
    """Write one JSON document to stdout. Numbers that are not finite are a fault, not `NaN`."""
    text = json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False)
    sys.stdout.write(json_escapes(text) + "\n")
    sys.stdout.flush()


@contextmanager
def print_json_list() -> Iterator[Callable[[object], None]]:
    """Write a JSON list to stdout element by element, so that it need not be held; yields `add(element)`.

    The list is ended in good order whatever happens, and nothing is written where nothing came.
    """
    count = 0

    def add(element: object) -> None:
        nonlocal count
        text = json.dumps(element, indent=2, ensure_ascii=False, allow_nan=False)
        sys.stdout.write(("," if count else "[") + "\n" + textwrap.indent(json_escapes(text), "  "))
        count += 1

    try:
        yield add
    finally:
        if count:
            sys.stdout.write("\n]\n")
            sys.stdout.flush()


def print_document(text: str, *, is_json: bool) -> None:
    """Write a document to stdout; no character of it steers a terminal."""
    sys.stdout.write(json_escapes(text) if is_json else show_control_characters(text))


def print_line(text: str) -> None:
    """Write a line for people to stdout; no character of it steers the terminal."""
    sys.stdout.write(show_control_characters(text) + "\n")


def print_status(text: str) -> None:
    """Write a line about the work itself to stderr; no character of it steers the terminal."""
    sys.stderr.write(show_control_characters(text) + "\n")


def print_fields(rows: Iterable[tuple[str, object]], width: int) -> None:
    """Write a line for each label and value to stdout; the values begin in column `width`, or a blank on."""
    for label, value in rows:
        print_line(f"{label:{width - 1}} {value}")


def print_table(header: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> None:
    """Write columns for people to stdout, each as wide as its longest entry."""
    widths = [max(len(row[i]) for row in (header, *rows)) for i in range(len(header))]
    for row in (header, *rows):
        print_line("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())


def output_file(path: Path, force: bool, endings: Sequence[str] = (), option: str = "-o") -> Path:
    """Return the absolute path of a file to write. Raises CommandError rather than overwrite one."""
    if endings and path.suffix.lower() not in endings:
        raise CommandError(f"{option} {path.name} has no known ending. Use {alternatives(endings)}")
    path = path.expanduser().resolve()
    if path.is_dir():
        raise CommandError(f"{path} is a folder. Give the name of a file")
    if path.exists() and not force:
        raise CommandError(f"{path} exists already. Choose another name or add --force")
    if not path.parent.is_dir():
        raise CommandError(f"{path.parent} is not a folder. Make it first or choose another path")
    return path


@contextmanager
def progress_bar(description: str, total: float | None = None) -> Iterator[Any]:
    """Show a progress bar on stderr while a terminal is there; yields `update(completed, text)`."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    console = Console(stderr=True)
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TimeElapsedColumn())
    with Progress(
        *columns,
        console=console,
        transient=True,
        redirect_stdout=sys.stdout.isatty(),  # else what goes to a file would come out on stderr
        disable=not console.is_terminal,
    ) as bar:
        task = bar.add_task(show_control_characters(description), total=total)

        def update(completed: float, text: str | Message | None = None) -> None:
            bar.update(
                task,
                completed=completed,
                description=None if text is None else show_control_characters(str(text)),
            )

        yield update
