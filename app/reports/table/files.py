"""The table in each format: texts to show or to write, and workbooks."""

import csv
import io
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import msgspec

from analysis.campaign.effects import Effect
from analysis.campaign.rows import STATIC_LOWER, STATIC_UPPER, SeriesRow
from analysis.catalogue import Place
from app.reports.table.text import (
    LEGEND,
    PublishedRowComparison,
    TableContent,
    note_sections,
    published_grid,
    repeats_grid,
    row_cells,
    table_headers,
    table_quantities,
    text_lines,
)
from app.runs.analysis_json import quantity_document, warning_documents
from app.runs.campaign.documents import effect_documents, pooled_document
from app.runs.disk import atomic_write
from app.runs.exchange.export_formats import Sheet, csv_cell, escape_latex, write_sheets

_UNLIMITED_WIDTH: Final = 1_000_000  # of a text that is not printed on a terminal


def as_text(content: TableContent, name: str, width: int, *, with_repeats: bool = False) -> str:
    """The table in one of `formats.TEXTS`; `width` is that of the terminal."""
    if name == "csv":
        header, rows = flat_table(content)
        file = io.StringIO()
        writer = csv.writer(file, lineterminator="\n")
        writer.writerows([header, *([csv_cell(value) for value in row] for row in rows)])
        return file.getvalue()
    if name == "json":
        document = msgspec.json.encode(table_document(content))
        return msgspec.json.format(document, indent=2).decode() + "\n"
    if name == "markdown":
        return _markdown(content, with_repeats)
    if name == "latex":
        return _latex(content)
    return "\n".join(text_lines(content, width, with_repeats=with_repeats)) + "\n"


def write_table(
    content: TableContent, path: Path, name: str, *, with_repeats: bool = False, replace: bool = False
) -> None:
    """Write the table in one of `formats.FORMATS`. Raises as `write_workbook`."""
    if name == "xlsx":
        write_workbook(content, path, replace=replace)
    else:
        write_text(as_text(content, name, _UNLIMITED_WIDTH, with_repeats=with_repeats), path, replace=replace)


def write_text(text: str, path: Path, *, replace: bool = False) -> None:
    """Write a file atomically. Raises RunExistsError, DiskFullError, WriteError."""
    with atomic_write(path, replace=replace) as made:
        made.write_bytes(text.encode())


def write_workbook(content: TableContent, path: Path, *, replace: bool = False) -> None:
    """Write a workbook: table, numbers, repeats, notes, and the published table if asked for.

    Raises ExtraMissingError, RunExistsError, DiskFullError, WriteError.
    """
    notes = ((title, sentence) for title, sentences in note_sections(content) for sentence in sentences)
    sheets: dict[str, Sheet] = {
        "Table 1": _main_grid_with_warning(content),
        "Numbers": flat_table(content),
        "Repeats": repeats_grid(content),
        "Notes": (("about", "sentence"), notes),
    }
    if content.published is not None:
        sheets["Published"] = published_grid(content)
    with atomic_write(path, replace=replace) as made:
        write_sheets(sheets, made)


def _main_grid(content: TableContent) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    return table_headers(content.columns), [row_cells(row, content.columns) for row in content.campaign.rows]


def _main_grid_with_warning(content: TableContent) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    header, rows = _main_grid(content)
    warning = content.origin.warning
    return header, [*rows, (warning,)] if warning else rows


def _markdown(content: TableContent, with_repeats: bool) -> str:
    warning = content.origin.warning
    lines = [f"**{_marked(warning)}**", ""] if warning else []
    lines += [*_markdown_table(*_main_grid(content)), "", LEGEND]
    if with_repeats:
        lines += ["", "## Repeats", "", *_markdown_table(*repeats_grid(content))]
    if content.published is not None:
        lines += ["", "## Measured minus published", "", *_markdown_table(*published_grid(content))]
    for title, sentences in note_sections(content):
        lines += ["", f"## {title}", "", *(f"- {_marked(sentence)}" for sentence in sentences)]
    return "\n".join(lines) + "\n"


def _markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    rule = "|" + "|".join("---" if place == 0 else "--:" for place in range(len(header))) + "|"
    body = [f"| {' | '.join(_marked(cell) for cell in row)} |" for row in rows]
    return [f"| {' | '.join(_marked(name) for name in header)} |", rule, *body]


def _marked(text: str) -> str:
    return "".join(f"\\{one}" if one in "\\`*_[]<>|#&" else " " if one in "\r\n" else one for one in text)


def _latex(content: TableContent) -> str:
    columns = [column.latex_heading(Place.TABLE) for column in table_quantities(content.columns)]
    lines = [
        "% by slipstand, for \\usepackage{booktabs}; in parentheses: standard uncertainty of the last digits",
        "% as wide as a page of A4 is high: for \\usepackage{rotating} and \\begin{sidewaystable}",
        r"\begingroup\footnotesize\setlength{\tabcolsep}{4pt}",
        rf"\begin{{tabular}}{{l{'r' * (len(columns) + 1)}}}",
        r"\toprule",
        " & ".join(("Series", "$n$", *columns)) + r" \\",
        r"\midrule",
        *_latex_warning(content.origin.warning, len(columns) + 2),
        *(" & ".join(map(_latex_cell, cells)) + r" \\" for cells in _main_grid(content)[1]),
        r"\bottomrule",
        r"\end{tabular}",
        r"\endgroup",
    ]
    for title, sentences in note_sections(content):
        lines += [f"% {title}: {' '.join(sentence.split())}" for sentence in sentences]
    return "\n".join(lines) + "\n"


def _latex_warning(text: str, columns: int) -> list[str]:
    """Row that says of what the table is not, where that must be said in print."""
    return [rf"\multicolumn{{{columns}}}{{l}}{{\textbf{{{escape_latex(text)}}}}} \\"] if text else []


def _latex_cell(text: str) -> str:
    shown = escape_latex(text).replace("..", "--").replace(">=", r"$\ge$").replace("<=", r"$\le$")
    if shown.startswith(("[", "*")):  # after the end of a row these would belong to it
        return f"{{{shown[0]}}}{shown[1:]}"
    return f"${shown[0]}$" + shown[1:] if shown.startswith("-") else shown or "--"


_SUFFIXES: Final = (
    "", "_standard_uncertainty", "_low_95", "_high_95", "_runs", "_between_runs", "_scatter",
    "_birge_ratio", "_outliers",
)  # fmt: skip
_PUBLISHED: Final = ("_printed", "_difference")
_LEADING: Final = ("series", "contact", "pullback_m", "table_mass_kg", "runs")


def flat_table(content: TableContent) -> tuple[list[str], list[list[Any]]]:
    """Header and rows of plain numbers in SI; None where undetermined."""
    names = [f"{name}{fact}" for name in _names(content) for fact in _SUFFIXES]
    header = [*_LEADING, *names, "msk64_degree", "warnings"]
    if content.published is not None:
        header += [f"{column.name}{fact}" for column in table_quantities() for fact in _PUBLISHED] + ["flags"]
    header += content.origin.facts_of(()).keys()
    return header, [list(_flat_row(row, content)) for row in content.campaign.rows]


def _names(content: TableContent) -> tuple[str, ...]:
    return (*(row.name for row in table_quantities(content.columns)), STATIC_LOWER, STATIC_UPPER)


def _flat_row(row: SeriesRow, content: TableContent) -> Iterator[Any]:
    key = row.series
    yield from (row.label, key.contact, key.pullback_m, key.table_mass_kg, len(row.runs))
    for pooled in (row.quantities.get(name) for name in _names(content)):
        if pooled is None:
            yield from [None] * len(_SUFFIXES)
        else:
            quantity = pooled.quantity
            yield from (quantity.value, quantity.standard_uncertainty, *quantity.interval_95, pooled.runs)
            yield from (pooled.between_runs, pooled.scatter, pooled.birge_ratio, " | ".join(pooled.outliers))
    yield from (row.msk64_degree, " | ".join(str(warning.message) for warning in row.warnings))
    if content.published is not None:
        printed = content.published.get(row.label)
        figures = {one.name: (one.published, one.difference) for one in printed.figures} if printed else {}
        for column in table_quantities():
            yield from figures.get(column.name, (None, None))
        yield ", ".join(printed.flags) if printed else None
    yield from content.origin.facts_of(row.runs).values()


SCHEMA: Final = "slipstand-table/1"


def table_document(content: TableContent) -> dict[str, Any]:
    """JSON of the table; undetermined values are absent."""
    campaign = content.campaign
    return {
        "schema": SCHEMA,
        "rows": [
            _row_document(row, (content.published or {}).get(row.label))
            | {"source": content.origin.source_of(row.runs)}
            for row in campaign.rows
        ],
        "effects": [_effect_document(effect) for effect in campaign.effects.effects],
        "scatter_beyond_effects": campaign.effects.scatter,
        "effects_of_stand": effect_documents(campaign.effects_of_stand),
        "ratios": msgspec.to_builtins(campaign.ratios),
        "msk64_degrees": list(campaign.msk64_degrees),
        "excluded": msgspec.to_builtins(campaign.excluded),
        "failures": [{"run": run, "error": error} for run, error in content.failures],
        "warnings": warning_documents(content.all_warnings()),
        "origin": content.origin.document(),
    }


def _effect_document(effect: Effect) -> dict[str, Any]:
    sizes = [{"step": str(size.step), "change": quantity_document(size.change)} for size in effect.sizes]
    document: dict[str, Any] = msgspec.to_builtins(effect)
    return document | {"sentence": str(effect.sentence), "sizes": sizes}


def _row_document(row: SeriesRow, printed: PublishedRowComparison | None) -> dict[str, Any]:
    found: dict[str, Any] = {
        "series": row.label,
        "contact": row.series.contact,
        "pullback_m": row.series.pullback_m,
        "table_mass_kg": row.series.table_mass_kg,
        "runs": list(row.runs),
        **{name: pooled_document(pooled) for name, pooled in row.quantities.items()},
        "warnings": warning_documents(row.warnings),
    }
    if row.msk64_degree:
        found["msk64_degree"] = row.msk64_degree
    if printed is not None:
        figures = {
            one.name: {"printed": one.published, "difference": one.difference} for one in printed.figures
        }
        found["published"] = {"figures": figures, "flags": list(printed.flags)}
    return found
