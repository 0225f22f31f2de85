"""Typesetting of a report as PDF/A: offline, reproducible to the byte."""

import re
from functools import cache
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any, Final

import msgspec
import typst
from matplotlib.ft2font import FT2Font

from analysis.formatting import unbreakable
from app.reports.figures.style import typeface_files
from app.reports.test_report.blocks import Report
from app.runs.disk import atomic_write
from app.runs.errors import WriteError

PDF_STANDARD: Final = "a-2a"  # PDF/A-2 level a: archival, with the structure that screen readers need
_LONG_WORD = re.compile(r"\S{48}(?=\S)")
_BREAK = "\u200b"
_ALWAYS = frozenset("\n\u200b\u00a0\u202f")


def write_report(report: Report, path: Path, *, replace: bool = False) -> None:
    """Write a report to a PDF file. Raises RunError."""
    with atomic_write(path, replace=replace) as made:
        made.write_bytes(render_pdf(report))


def render_pdf(report: Report) -> bytes:
    """Typeset a report as PDF/A. Raises WriteError."""
    made = typeset_report(report, format="pdf", pdf_standards=[PDF_STANDARD])
    return made if isinstance(made, bytes) else b""


def render_pages(report: Report, dots_per_inch: float) -> list[bytes]:
    """Typeset a report as a PNG image a page, for a printer. Raises WriteError."""
    made = typeset_report(report, format="png", ppi=dots_per_inch)
    return made if isinstance(made, list) else [made or b""]


def typeset_report(report: Report, **options: Any) -> bytes | list[bytes] | None:
    """Typeset a report; `options` are those of `typst.Compiler.compile`. Raises WriteError."""
    document = msgspec.json.encode(_printable(msgspec.to_builtins(report))).decode()
    with as_file(files("app.reports.test_report") / "template.typ") as template:
        try:
            compiler = typst.Compiler(
                input=str(template),
                font_paths=[str(typeface_files()[0].parent)],
                ignore_system_fonts=True,
                sys_inputs={"report": document},
            )
            return compiler.compile(**options)
        except typst.TypstError as error:
            said = " ".join(str(error).split())[:200]
            raise WriteError(
                "the report cannot be typeset ({said}). Report this with the runs", said=said
            ) from None


def printable(text: str) -> str:
    """Replace characters that the typeface lacks by their code point, `[U+1F600]`; let long words break."""
    known = _signs()
    shown = "".join(
        sign if sign in _ALWAYS or ord(sign) in known else f"[U+{ord(sign):04X}]"
        for sign in text.replace("\r\n", "\n").replace("\r", "\n").replace("\t", " ")
    )
    return _LONG_WORD.sub(lambda word: word[0] + _BREAK, unbreakable(shown))


def _printable(value: Any, key: str = "") -> Any:
    if isinstance(value, dict):
        return {name: _printable(item, name) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [_printable(item) for item in value]
    return printable(value) if isinstance(value, str) and key not in ("svg", "type") else value


@cache
def _signs() -> frozenset[int]:
    """Code points that every font file of the typeface has."""
    cuts = [frozenset(FT2Font(str(file)).get_charmap()) for file in typeface_files()]
    return frozenset.intersection(*cuts)
