"""From what a report says to PDF/A, without a network and the same bytes each time."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib.resources import as_file, files
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import msgspec

from app.reports.figures.style import typeface_files
from app.reports.test_report.blocks import Report
from app.runs.disk import atomic_write
from app.runs.errors import WriteError

if TYPE_CHECKING:
    from typst import Compiler

PDF_STANDARD: Final = "a-2a"
"""PDF/A-2 with the structure that screen readers need: text and tables stay readable for decades."""
_LONG_WORD = re.compile(r"\S{48}(?=\S)")
_BREAK = "\u200b"
_ALWAYS = frozenset("\n\u200b\u00a0\u202f")


def write_report(report: Report, path: Path, *, replace: bool = False) -> None:
    """Write a report to a PDF file. Raises RunError."""
    with atomic_write(path, replace=replace) as made:
        made.write_bytes(render_pdf(report))


def render_pdf(report: Report) -> bytes:
    """Typeset a report as PDF/A. Raises WriteError."""
    with _compiler(report) as compiler:
        made = compiler.compile(format="pdf", pdf_standards=[PDF_STANDARD])
    return made if isinstance(made, bytes) else b""


def render_pages(report: Report, dots_per_inch: float = 100.0) -> list[bytes]:
    """Typeset a report as a PNG a page, to look at. Raises WriteError."""
    with _compiler(report) as compiler:
        made = compiler.compile(format="png", ppi=dots_per_inch)
    return made if isinstance(made, list) else [made or b""]  # a single page comes by itself


def printable(text: str) -> str:
    """Text that the typeface has a sign for; any other is told by its number, `[U+1F600]`.

    Words without end are allowed to break.
    """
    known = _signs()
    shown = "".join(
        sign if sign in _ALWAYS or ord(sign) in known else f"[U+{ord(sign):04X}]"
        for sign in text.replace("\r\n", "\n").replace("\r", "\n").replace("\t", " ")
    )
    return _LONG_WORD.sub(lambda word: word[0] + _BREAK, shown)


@contextmanager
def _compiler(report: Report) -> "Iterator[Compiler]":
    """What typesets this report. Raises WriteError where it cannot."""
    import typst

    document = msgspec.json.encode(_printable(msgspec.to_builtins(report))).decode()
    with as_file(files("app.reports.test_report") / "template.typ") as template:
        try:
            yield typst.Compiler(
                input=str(template),
                font_paths=[str(typeface_files()[0].parent)],
                ignore_system_fonts=True,
                sys_inputs={"report": document},
            )
        except typst.TypstError as error:
            said = " ".join(str(error).split())[:200]
            raise WriteError(
                "the report cannot be typeset ({said}). Report this with the runs", said=said
            ) from None


def _printable(value: Any, key: str = "") -> Any:
    """All texts of a document but drawings, which are no texts."""
    if isinstance(value, dict):
        return {name: _printable(item, name) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [_printable(item) for item in value]
    return printable(value) if isinstance(value, str) and key not in ("svg", "type") else value


@cache
def _signs() -> frozenset[int]:
    """Code points that every cut of the typeface has."""
    from matplotlib.ft2font import FT2Font

    cuts = [frozenset(FT2Font(str(file)).get_charmap()) for file in typeface_files()]
    return frozenset.intersection(*cuts)
