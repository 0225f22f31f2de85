"""Formats of exported runs: each writes the samples of a run, or a table of coefficients, to a new file."""

import csv
import io
import itertools
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

import msgspec
import numpy as np

from analysis.catalogue import Place, QuantityDefinition, definition
from analysis.formatting import format_value
from app.runs.errors import UnsuitableRunError
from app.runs.exchange import content, ro_crate, uff58
from app.runs.exchange.content import COEFFICIENT_COLUMNS, ExportedRun, SampleColumn
from app.runs.metadata import RunSource
from app.runs.origin import SIMULATED, origin_rows

# --- CSV ---------------------------------------------------------------------------------

_ROWS_AT_ONCE = 10_000
_FORMULA = re.compile(
    r"^(?=[\t\r\n])|(?:^|(?<=[;\t\r\n]))(?=(?:[^\S\t\r\n]|[\ufeff\u200b])*[=+\-@＝＋－＠−﹢﹣﹦﹫])"
)
"""Where a spreadsheet could begin to read a formula: at the beginning, behind blanks that it may leave out,
and behind what it may take for the end of a cell; full-width signs count as signs in some countries."""


def write_csv_samples(exported: ExportedRun, path: Path) -> None:
    """Samples with all their digits; absent readings are empty."""
    names = [column.name for column in exported.samples]
    with path.open("x", encoding="utf-8", newline="") as file:
        file.write(",".join(names) + "\n")
        file.writelines(csv_lines(exported, names))


def csv_lines(exported: ExportedRun, names: Sequence[str], run: str | None = None) -> Iterator[str]:
    """Lines of the columns of these names, behind a cell that names the run if `run` does.

    Cells of a column that the run lacks are empty.
    """
    columns = {column.name: column for column in exported.samples}
    count = len(exported.samples[0].values)
    for first in range(0, count, _ROWS_AT_ONCE):
        rows = range(first, min(first + _ROWS_AT_ONCE, count))
        cells = [] if run is None else [[_quoted(run)] * len(rows)]
        cells += [_csv_numbers(columns.get(name), rows) for name in names]
        yield from (",".join(row) + "\n" for row in zip(*cells, strict=True))


def _quoted(text: str) -> str:
    """A cell as the writer of `csv` gives it."""
    cell, line = csv_cell(text), io.StringIO()
    csv.writer(line, lineterminator="").writerow([cell])
    return line.getvalue()


def write_csv_coefficients(runs: Iterable[ExportedRun], path: Path) -> None:
    """Write a line a quantity."""
    with path.open("x", encoding="utf-8", newline="") as file:
        _write_coefficient_lines(runs, file)


def _write_coefficient_lines(runs: Iterable[ExportedRun], file: TextIO) -> None:
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(COEFFICIENT_COLUMNS)
    writer.writerows([csv_cell(value) for value in row.values()] for row in content.coefficient_rows(runs))


def csv_cell(value: Any) -> str:
    """Text that no spreadsheet takes for a formula; numbers with all their digits."""
    if value is None:
        return ""
    return _FORMULA.sub("'", value) if isinstance(value, str) else repr(value)


def _csv_numbers(column: SampleColumn | None, rows: range) -> list[str]:
    if column is None:
        return [""] * len(rows)
    values = column.values[rows.start : rows.stop]
    if values.dtype.kind != "f":
        return [str(x) for x in values.tolist()]
    return ["" if x != x else repr(x) for x in values.astype(np.float64).tolist()]


# --- JSON --------------------------------------------------------------------------------


def _write_json_run(exported: ExportedRun, path: Path) -> None:
    write_json(path, json_run(exported))


def json_run(exported: ExportedRun) -> dict[str, Any]:
    """A run as JSON; numbers that are absent or not finite are null there."""
    samples = {
        column.name: {"unit": column.unit, "values": column.values.tolist()} for column in exported.samples
    }
    facts = content.run_metadata_document(exported.run)
    named = {"schema": "slipstand-run/1", "name": exported.name}
    return named | facts | {"samples": samples, "analysis": exported.analysis}


def _write_json_coefficients(runs: Iterable[ExportedRun], path: Path) -> None:
    rows = list(content.coefficient_rows(runs))
    write_json(path, {"schema": "slipstand-coefficients/1", "coefficients": rows})


def write_json(path: Path, document: dict[str, Any]) -> None:
    """Write a JSON document."""
    path.write_bytes(msgspec.json.format(msgspec.json.encode(document), indent=1) + b"\n")


# --- Parquet -----------------------------------------------------------------------------


def _write_parquet_run(exported: ExportedRun, path: Path) -> None:
    write_parquet(parquet_table(exported), path)


def parquet_table(exported: ExportedRun) -> Any:
    """Absent readings are null; the facts are JSON under `slipstand` in the metadata of the table."""
    pa = content.import_optional("pyarrow", "Parquet")
    facts = content.run_metadata_document(exported.run) | {"analysis": exported.analysis}
    fields = [
        pa.field(column.name, pa.from_numpy_dtype(column.values.dtype), metadata={"units": column.unit})
        for column in exported.samples
    ]
    arrays = [pa.array(column.values, from_pandas=True) for column in exported.samples]
    schema = pa.schema(fields, metadata={"slipstand": msgspec.json.encode(facts)})
    return pa.Table.from_arrays(arrays, schema=schema)


def _write_parquet_coefficients(runs: Iterable[ExportedRun], path: Path) -> None:
    pa = content.import_optional("pyarrow", "Parquet")
    numbers = ("value", "standard_uncertainty", "interval_95_low", "interval_95_high")
    kinds = dict.fromkeys(COEFFICIENT_COLUMNS, pa.string()) | dict.fromkeys(numbers, pa.float64())
    schema = pa.schema(list((kinds | {"adequate": pa.bool_()}).items()))
    write_parquet(pa.Table.from_pylist(list(content.coefficient_rows(runs)), schema=schema), path)


def write_parquet(table: Any, path: Path) -> None:
    """Write a table of pyarrow."""
    content.import_optional("pyarrow.parquet", "Parquet").write_table(table, path)


# --- MATLAB ------------------------------------------------------------------------------

_MAT_NAME_LENGTH = 63


def _write_mat_run(exported: ExportedRun, path: Path) -> None:
    """A column vector a channel, and the structs `units`, `run`, `coefficients`, `analysis`."""
    named = {_mat_name(column.name): column for column in exported.samples}
    variables: dict[str, Any] = {name: column.values for name, column in named.items()}
    variables["units"] = {name: column.unit for name, column in named.items()}
    variables["run"] = _mat_value(content.run_metadata_document(exported.run) | {"name": exported.name})
    if exported.analysis is not None:
        variables["coefficients"] = _mat_value(exported.analysis["results"])
        variables["analysis"] = _mat_value({k: v for k, v in exported.analysis.items() if k != "results"})
    _write_mat(variables, path)


def _write_mat_coefficients(runs: Iterable[ExportedRun], path: Path) -> None:
    """The struct array `coefficients`, one element a quantity of a run."""
    _write_mat({"coefficients": [_mat_value(row) for row in content.coefficient_rows(runs)]}, path)


def _write_mat(variables: dict[str, Any], path: Path) -> None:
    from scipy.io import savemat  # a third of a second that only this format needs

    savemat(path, variables, appendmat=False, long_field_names=True, do_compression=True, oned_as="column")


def _mat_value(value: Any) -> Any:
    """MATLAB knows no null: what is absent is an empty array; names that it cannot have are mended."""
    if isinstance(value, dict):
        return {_mat_name(key): _mat_value(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_mat_value(item) for item in value]
    return [] if value is None else value


def _mat_name(key: str) -> str:
    """As MATLAB's own `makeValidName` does it: letters, digits, underscores, a letter first."""
    name = re.sub(r"[^A-Za-z0-9_]", "_", str(key))[: _MAT_NAME_LENGTH - 1]
    return name if name[:1].isalpha() else f"x{name}"


# --- Excel -------------------------------------------------------------------------------

Sheet = tuple[Sequence[str], Iterable[Iterable[Any]]]

_SHEET_ROWS = 1_048_576
_CELL_CHARACTERS = 32_767
_COLUMN_WIDTH = 22
_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
"""What XML cannot hold."""


def _write_xlsx_run(exported: ExportedRun, path: Path) -> None:
    """The sheets Coefficients, Samples and Run."""
    facts = flat_facts("", content.run_metadata_document(exported.run))
    sheets: dict[str, Sheet] = {
        "Coefficients": coefficients_sheet([exported]),
        "Samples": samples_sheet(exported),
        "Run": (("fact", "value"), facts),
    }
    write_sheets(sheets, path)


def coefficients_sheet(runs: Iterable[ExportedRun]) -> Sheet:
    """A row a quantity of a run."""
    return COEFFICIENT_COLUMNS, (row.values() for row in content.coefficient_rows(runs))


def samples_sheet(exported: ExportedRun) -> Sheet:
    """A row a sample. Raises UnsuitableRunError for more than a sheet holds."""
    if len(exported.run) >= _SHEET_ROWS and exported.samples:
        raise UnsuitableRunError(
            "{path} has {count} samples, a sheet of xlsx at most {sheet_rows}. Export it as parquet or csv",
            path=exported.run.path,
            count=len(exported.run),
            sheet_rows=_SHEET_ROWS - 1,
        )
    samples = zip(*(column.values.tolist() for column in exported.samples), strict=True)
    return [column.name for column in exported.samples], samples


def _write_xlsx_coefficients(runs: Iterable[ExportedRun], path: Path) -> None:
    write_sheets({"Coefficients": coefficients_sheet(runs)}, path)


def write_sheets(sheets: Mapping[str, Sheet], path: Path) -> None:
    """Write a workbook; texts are texts, no cell becomes a formula. Raises ExtraMissingError."""
    openpyxl = content.import_optional("openpyxl", "Excel")
    cell_type = content.import_optional("openpyxl.cell", "Excel").WriteOnlyCell
    letter = content.import_optional("openpyxl.utils", "Excel").get_column_letter
    book = openpyxl.Workbook(write_only=True)
    for name, (header, rows) in sheets.items():
        sheet = book.create_sheet(name)
        sheet.freeze_panes = "A2"
        for column in range(1, len(header) + 1):
            sheet.column_dimensions[letter(column)].width = _COLUMN_WIDTH
        for row in itertools.chain((header,), rows):
            sheet.append([_xlsx_cell(cell_type, sheet, value) for value in row])
    book.save(path)


def flat_facts(prefix: str, facts: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Facts with dotted names, as `metadata.table_mass_kg`."""
    for name, value in facts.items():
        if isinstance(value, dict):
            yield from flat_facts(f"{prefix}{name}.", value)
        elif isinstance(value, list | tuple):
            yield f"{prefix}{name}", msgspec.json.encode(value).decode()
        else:
            yield f"{prefix}{name}", value


def _xlsx_cell(cell_type: Any, sheet: Any, value: Any) -> Any:
    """A number, truth, nothing, or a text that stays one even where it begins with an equals sign."""
    if value is None or value != value:
        return None
    if isinstance(value, bool):
        return value
    is_text = isinstance(value, str)
    cell = cell_type(sheet, _CONTROL.sub("\ufffd", value)[:_CELL_CHARACTERS] if is_text else repr(value))
    cell.data_type = "s" if is_text else "n"  # of itself openpyxl writes 16 digits, which are one too few
    return cell


# --- LaTeX -------------------------------------------------------------------------------

_LATEX_COLUMNS = tuple(
    definition(name)
    for name in (
        "period_s", "log_decrement", "damping_n1_per_s", "damping_n2_per_s", "stiffness_n_per_m",
        "residual_displacement_m", "friction_static", "friction_dynamic",
    )
)  # fmt: skip
_LATEX_ESCAPES = str.maketrans({
    "\\": r"\textbackslash{}", "{": r"\{", "}": r"\}", "$": r"\$", "&": r"\&", "#": r"\#", "%": r"\%",
    "_": r"\_", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "\n": " ", "\r": " ",
})  # fmt: skip


def _write_latex(runs: Iterable[ExportedRun], path: Path) -> None:
    """A table with a row a run: value and standard uncertainty; a dagger where the model does not fit."""
    header = ("Run", "Series", *(column.latex_heading(Place.TERMINAL) for column in _LATEX_COLUMNS))
    lines = [
        "% by slipstand, for \\usepackage{booktabs}; standard uncertainties; dagger: the model does not fit",
        rf"\begin{{tabular}}{{ll{'r' * len(_LATEX_COLUMNS)}}}",
        r"\toprule",
        " & ".join(header) + r" \\",
        r"\midrule",
        *(line for exported in runs for line in _latex_lines(exported)),
        r"\bottomrule",
        r"\end{tabular}",
    ]
    path.write_text("\n".join(lines) + "\n", "utf-8")


def _latex_lines(exported: ExportedRun) -> Iterator[str]:
    """Row of a run, with its origin as a comment; a simulated one is called so in print."""
    origin = (exported.analysis or {}).get("origin")
    cells = " & ".join(_latex_row(exported))
    if exported.run.metadata.source_type is RunSource.SIMULATED:
        cells = cells.replace(" & ", rf" \textbf{{{SIMULATED}}} & ", 1)
    yield cells + r" \\"
    if origin is not None:
        yield from (f"% {name}: {' '.join(text.split())}" for name, text in origin_rows(origin))


def escape_latex(text: str) -> str:
    """Text that LaTeX sets as it is."""
    return text.translate(_LATEX_ESCAPES)


def _latex_row(exported: ExportedRun) -> Iterator[str]:
    analysis = exported.analysis or {}
    results, model = analysis.get("results", {}), analysis.get("model") or {}
    yield escape_latex(exported.name) + ("" if model.get("adequate", True) else r"$^\dagger$")
    yield escape_latex(exported.run.metadata.series or "--")
    for column in _LATEX_COLUMNS:
        yield _latex_cell(column, results.get(column.name))


def _latex_cell(column: QuantityDefinition, result: dict[str, Any] | None) -> str:
    if result is None:
        return "--"
    scale = column.unit_at(Place.TERMINAL).scale
    return format_value(result["value"] * scale, (result["standard_uncertainty"] or 0.0) * scale).latex


# --- All formats -------------------------------------------------------------------------


def unique_names(exported: Iterable[str]) -> list[str]:
    """Names of files that do not meet: a second `run` becomes `run-2`."""
    taken: set[str] = set()
    names = []
    for name in exported:
        number, free = 2, name
        while free.casefold() in taken:
            free, number = f"{name}-{number}", number + 1
        taken.add(free.casefold())
        names.append(free)
    return names


# --- RO-Crate ----------------------------------------------------------------------------


def _write_ro_crate(runs: Iterable[ExportedRun], path: Path) -> None:
    exported, coefficients = list(runs), io.StringIO()
    _write_coefficient_lines(exported, coefficients)
    names = unique_names(one.name for one in exported)
    ro_crate.write_crate(exported, names, coefficients.getvalue(), path)


@dataclass(frozen=True, slots=True)
class ExportFormat:
    """How a format is written."""

    suffix: str
    write_run: Callable[[ExportedRun, Path], None]
    write_coefficients: Callable[[Iterable[ExportedRun], Path], None] | None
    """None where the format holds samples alone."""
    holds_samples: bool = True


FORMATS = {
    "csv": ExportFormat(".csv", write_csv_samples, write_csv_coefficients),
    "json": ExportFormat(".json", _write_json_run, _write_json_coefficients),
    "parquet": ExportFormat(".parquet", _write_parquet_run, _write_parquet_coefficients),
    "mat": ExportFormat(".mat", _write_mat_run, _write_mat_coefficients),
    "uff58": ExportFormat(".uff", uff58.write_run, None),
    "xlsx": ExportFormat(".xlsx", _write_xlsx_run, _write_xlsx_coefficients),
    "latex": ExportFormat(
        ".tex", lambda exported, path: _write_latex([exported], path), _write_latex, holds_samples=False
    ),
    "ro-crate": ExportFormat(
        ".zip", lambda exported, path: _write_ro_crate([exported], path), _write_ro_crate, holds_samples=False
    ),
}
