"""Samples of several runs in one file: a table whose first column names the run, a list, or a workbook."""

import itertools
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import msgspec

from app.runs.exchange import content
from app.runs.exchange.content import ExportedRun
from app.runs.exchange.export_formats import (
    Sheet,
    coefficients_sheet,
    csv_lines,
    flat_facts,
    json_run,
    parquet_table,
    samples_sheet,
    unique_names,
    write_json,
    write_parquet,
    write_sheets,
)

_SHEET_NAME_LENGTH: Final = 31
_NOT_IN_SHEET_NAMES: Final = re.compile(r"[\[\]:*?/\\]")
_OTHER_SHEETS: Final = ("Coefficients", "Runs")


def _names(runs: Sequence[ExportedRun]) -> list[str]:
    return unique_names(exported.name for exported in runs)


def _write_csv(runs: Sequence[ExportedRun], path: Path) -> None:
    """Cells of columns that a run lacks are empty."""
    columns = list(dict.fromkeys(column.name for exported in runs for column in exported.samples))
    with path.open("x", encoding="utf-8", newline="") as file:
        file.write(",".join(["run", *columns]) + "\n")
        for name, exported in zip(_names(runs), runs, strict=True):
            file.writelines(csv_lines(exported, columns, name))


def _write_json(runs: Sequence[ExportedRun], path: Path) -> None:
    write_json(path, {"schema": "slipstand-runs/1", "runs": [json_run(exported) for exported in runs]})


def _write_parquet(runs: Sequence[ExportedRun], path: Path) -> None:
    """What is absent is null; the facts are a JSON list under `slipstand` in the metadata of the table."""
    pa = content.import_optional("pyarrow", "Parquet")
    tables = [parquet_table(exported) for exported in runs]
    named = [
        table.add_column(0, "run", pa.array([name] * len(table), pa.string()))
        for name, table in zip(_names(runs), tables, strict=True)
    ]
    facts = [msgspec.json.decode(table.schema.metadata[b"slipstand"]) for table in tables]
    joined = pa.concat_tables(named, promote_options="permissive")
    write_parquet(joined.replace_schema_metadata({"slipstand": msgspec.json.encode(facts)}), path)


def _write_workbook(runs: Sequence[ExportedRun], path: Path) -> None:
    """The sheets Coefficients and Runs, and one with the samples of each run."""
    short = (_NOT_IN_SHEET_NAMES.sub("_", name)[: _SHEET_NAME_LENGTH - 4] for name in _names(runs))
    names = unique_names(itertools.chain(_OTHER_SHEETS, short))[len(_OTHER_SHEETS) :]
    sheets: dict[str, Sheet] = {
        _OTHER_SHEETS[0]: coefficients_sheet(runs),
        _OTHER_SHEETS[1]: (("run", "fact", "value"), _facts(runs)),
    }
    write_sheets(
        sheets | {name: samples_sheet(exported) for name, exported in zip(names, runs, strict=True)}, path
    )


def _facts(runs: Sequence[ExportedRun]) -> Iterator[tuple[Any, ...]]:
    for name, exported in zip(_names(runs), runs, strict=True):
        yield from ((name, *row) for row in flat_facts("", content.run_metadata_document(exported.run)))


WRITERS: Final[dict[str, Callable[[Sequence[ExportedRun], Path], None]]] = {
    "csv": _write_csv,
    "json": _write_json,
    "parquet": _write_parquet,
    "xlsx": _write_workbook,
}
"""By the name of a format. The others hold one run a file."""
