"""The formats of `slipstand export`, by name."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from app.runs.export import (
    csv_files,
    json_files,
    latex_files,
    mat_files,
    parquet_files,
    uff58_files,
    xlsx_files,
)
from app.runs.export.content import ExportedRun

WriteRun = Callable[..., None]
WriteCoefficients = Callable[..., None]


@dataclass(frozen=True, slots=True)
class ExportFormat:
    """How a format is written.

    Attributes
    ----------
    suffix : str
    write_run : callable
        Takes an `Exported`, a path and `replace`.
    write_coefficients : callable or None
        Takes several `Exported`, a path and `replace`; None where the format holds samples alone.
    holds_samples : bool
    """

    suffix: str
    write_run: WriteRun
    write_coefficients: WriteCoefficients | None
    holds_samples: bool = True


def formats() -> dict[str, ExportFormat]:
    """All formats, by the names of the command line."""
    return {
        "csv": ExportFormat(".csv", _csv_pair, csv_files.write_coefficients),
        "json": ExportFormat(".json", json_files.write_run, json_files.write_coefficients),
        "parquet": ExportFormat(".parquet", parquet_files.write_run, parquet_files.write_coefficients),
        "mat": ExportFormat(".mat", mat_files.write_run, mat_files.write_coefficients),
        "uff58": ExportFormat(".uff", uff58_files.write_run, None),
        "xlsx": ExportFormat(".xlsx", xlsx_files.write_run, xlsx_files.write_coefficients),
        "latex": ExportFormat(
            ".tex", latex_files.write_run, latex_files.write_coefficients, holds_samples=False
        ),
    }


def output_files(name: str, path: Path, exported: ExportedRun) -> list[Path]:
    """Files that `write_run` of a format makes for `path`."""
    return [path, coefficients_path(path)] if name == "csv" and exported.analysis else [path]


def coefficients_path(path: Path) -> Path:
    """Where the coefficients go that a CSV file of samples has no room for."""
    return path.with_name(f"{path.stem}.coefficients{path.suffix}")


def _csv_pair(exported: ExportedRun, path: Path, *, replace: bool = False) -> None:
    csv_files.write_samples(exported.samples, path, replace=replace)
    if exported.analysis is not None:
        csv_files.write_coefficients([exported], coefficients_path(path), replace=replace)


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
