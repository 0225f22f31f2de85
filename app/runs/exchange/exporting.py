"""From run files to exported ones: what to read, whether to analyse, and where it goes."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import msgspec

from analysis.record import AnalysisError
from app.runs.analysis_input import to_record
from app.runs.analyze import AnalysisRequest, analyze_run
from app.runs.errors import RunError, UnsuitableRunError
from app.runs.exchange import (
    csv_files,
    json_files,
    latex_files,
    mat_files,
    parquet_files,
    uff58_files,
    xlsx_files,
)
from app.runs.exchange.content import ExportedRun, sample_columns
from app.runs.reader import Run, open_run
from app.runs.saved_analyses import latest_valid
from app.runs.validator import Validator
from messages.message import option

WriteRun = Callable[..., None]
WriteCoefficients = Callable[..., None]


@dataclass(frozen=True, slots=True)
class ExportFormat:
    """How a format is written."""

    suffix: str
    write_run: WriteRun
    """Takes an `ExportedRun`, a path and `replace`."""
    write_coefficients: WriteCoefficients | None
    """Takes several `ExportedRun`, a path and `replace`; None where the format holds samples alone."""
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


Content = Literal["both", "samples", "coefficients"]


class ExportRequest(msgspec.Struct, frozen=True):
    """What to export of runs, and in which format."""

    format: Literal["csv", "json", "parquet", "mat", "uff58", "xlsx", "latex"]
    content: Content = "both"
    replace: bool = False

    @property
    def writer(self) -> ExportFormat:
        return formats()[self.format]

    @property
    def is_one_file(self) -> bool:
        """Tell whether all runs go into one file: a table of their coefficients."""
        return self.content == "coefficients" or not self.writer.holds_samples


class ExportOutcome(msgspec.Struct, frozen=True):
    """What became of one run: the files made, or why there is none."""

    run: str
    files: list[str] = []
    error: str = ""
    note: str = ""
    """What was left out, in a sentence."""


def load_exported_run(path: Path, content: Content, validator: Validator) -> tuple[ExportedRun, str]:
    """Read a run and its coefficients: the newest analysis kept in it that is not stale, else a new one.

    Returns the run, and why there are no coefficients where they were wanted beside samples. Raises
    RunError, AnalysisError (coefficients alone are wanted, and there are none).
    """
    run = open_run(path, validator=validator)
    samples = () if content == "coefficients" else sample_columns(run)
    if content == "samples":
        return ExportedRun(run, None, samples), ""
    try:
        return ExportedRun(run, _document(run), samples), ""
    except (AnalysisError, UnsuitableRunError) as error:
        if content == "coefficients":
            raise
        return ExportedRun(run, None, samples), f"no coefficients: {error}"


def export_runs(
    paths: Sequence[Path],
    output: Path,
    request: ExportRequest,
    *,
    progress: Callable[[int, str], None] = lambda _done, _name: None,
) -> list[ExportOutcome]:
    """Export runs, in the order given; one that fails is reported and does not stop the rest.

    `output` is the file to write, or a folder, made if absent, for the samples of several runs. `progress` is
    called with the number done and the name of the next run. Raises RunError (nothing can be written at all:
    no such format content, output in the way).
    """
    if request.content == "coefficients" and request.writer.write_coefficients is None:
        raise UnsuitableRunError(
            "{format} holds samples, not coefficients. Choose csv, json, xlsx or latex", format=request.format
        )
    if request.content == "samples" and not request.writer.holds_samples:
        raise UnsuitableRunError(
            "{format} holds coefficients, not samples. Choose csv, json or parquet", format=request.format
        )
    with Validator.start() as validator:
        if request.is_one_file:
            return _into_one(paths, output, request, validator, progress)
        targets = _targets(paths, output, request)
        outcomes = []
        for done, (path, target) in enumerate(zip(paths, targets, strict=True)):
            progress(done, path.name)
            outcomes.append(_export_one(path, target, request, validator))
        return outcomes


def _targets(paths: Sequence[Path], output: Path, request: ExportRequest) -> list[Path]:
    if len(paths) == 1 and not output.is_dir():
        return [output]
    if output.exists() and not output.is_dir():
        raise UnsuitableRunError(
            "{output} is a file, but {count} runs need a folder. Choose another {option}",
            option=option("-o"),
            output=output,
            count=len(paths),
        )
    output.mkdir(parents=True, exist_ok=True)
    return [output / (name + request.writer.suffix) for name in unique_names(path.stem for path in paths)]


def _export_one(path: Path, target: Path, request: ExportRequest, validator: Validator) -> ExportOutcome:
    name = str(path.absolute())
    try:
        exported, note = load_exported_run(path, request.content, validator)
        request.writer.write_run(exported, target, replace=request.replace)
    except RunError as error:
        return ExportOutcome(name, error=str(error))
    return ExportOutcome(
        name, [str(file) for file in output_files(request.format, target, exported)], note=note
    )


def _into_one(
    paths: Sequence[Path],
    output: Path,
    request: ExportRequest,
    validator: Validator,
    progress: Callable[[int, str], None],
) -> list[ExportOutcome]:
    found: list[ExportedRun] = []
    outcomes = []
    for done, path in enumerate(paths):
        progress(done, path.name)
        try:
            found.append(load_exported_run(path, "coefficients", validator)[0])
            outcomes.append(ExportOutcome(str(path.absolute()), [str(output.absolute())]))
        except (RunError, AnalysisError) as error:
            outcomes.append(ExportOutcome(str(path.absolute()), error=str(error)))
    write = request.writer.write_coefficients
    if found and write is not None:
        write(found, output, replace=request.replace)
    return outcomes


def _document(run: Run) -> dict[str, object]:
    in_metres = (run.metadata.quantity, run.metadata.unit) == ("displacement", "m")
    kept = latest_valid(run.analyses, to_record(run, metres_only=in_metres))
    if kept is not None:
        return kept.document
    return analyze_run(run.path, AnalysisRequest(kind="two-mass" if in_metres else "one-mass")).document
