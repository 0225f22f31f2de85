"""MATLAB: samples as vectors, facts and coefficients as structs."""

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from app.runs.disk import atomic_write
from app.runs.exchange.content import ExportedRun, coefficient_documents, run_metadata_document

_NAME_LENGTH = 63


def write_run(exported: ExportedRun, path: Path, *, replace: bool = False) -> None:
    """Write a version 5 MAT file: a column vector a channel, and the structs `units`, `run`, `coefficients`.

    `coefficients.friction_dynamic.value` is a coefficient; what is absent is an empty array. Raises
    RunExistsError, DiskFullError, WriteError.
    """
    named = {_field_name(column.name): column for column in exported.samples}
    variables: dict[str, Any] = {name: column.values for name, column in named.items()}
    variables["units"] = {name: column.unit for name, column in named.items()}
    variables["run"] = _plain(run_metadata_document(exported.run) | {"name": exported.name})
    if exported.analysis is not None:
        variables["coefficients"] = _plain(exported.analysis["results"])
        variables["analysis"] = _plain({k: v for k, v in exported.analysis.items() if k != "results"})
    _write(variables, path, replace)


def write_coefficients(runs: Iterable[ExportedRun], path: Path, *, replace: bool = False) -> None:
    """Write the struct array `coefficients`, one element a quantity of a run.

    Raises RunExistsError, DiskFullError, WriteError.
    """
    rows = [_plain(row) for row in coefficient_documents(runs)]
    _write({"coefficients": rows}, path, replace)


def _write(variables: dict[str, Any], path: Path, replace: bool) -> None:
    from scipy.io import savemat  # a third of a second that only this format needs

    with atomic_write(path.absolute(), replace=replace) as made:
        savemat(
            made, variables, appendmat=False, long_field_names=True, do_compression=True, oned_as="column"
        )


def _plain(value: Any) -> Any:
    """MATLAB knows no null: what is absent is an empty array; names that it cannot have are mended."""
    if isinstance(value, dict):
        return {_field_name(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return [] if value is None else value


def _field_name(key: str) -> str:
    """As MATLAB's own `makeValidName` does it: letters, digits, underscores, a letter first."""
    name = re.sub(r"[^A-Za-z0-9_]", "_", str(key))[: _NAME_LENGTH - 1]
    return name if name[:1].isalpha() else f"x{name}"
