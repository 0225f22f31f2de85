"""From run files to exported ones: what to read, whether to analyse, and where it goes."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Literal

import msgspec

from analysis.record import AnalysisError
from app.runs.analysis_input import to_record
from app.runs.analysis_request import AnalysisRequest
from app.runs.analyze import analyze_run
from app.runs.disk import atomic_write, make_folder
from app.runs.errors import RunError, UnsuitableRunError
from app.runs.exchange.content import ExportedRun, sample_columns
from app.runs.exchange.export_formats import (
    FORMATS,
    ExportFormat,
    unique_names,
    write_csv_coefficients,
)
from app.runs.exchange.several_runs import WRITERS as TOGETHER
from app.runs.metadata import RunSource
from app.runs.reader import Run, open_run
from app.runs.saved_analyses import latest_valid
from app.runs.validator import Validator
from messages.i18n import N_
from messages.message import EMPTY, Message, message, message_of, option


def write_exported_run(name: str, exported: ExportedRun, path: Path, *, replace: bool = False) -> list[Path]:
    """Write a run, and its coefficients beside a CSV file. Returns the files. Raises RunError."""
    with atomic_write(path.absolute(), replace=replace) as made:
        FORMATS[name].write_run(exported, made)
    return [path, *_write_beside(name, [exported], path, replace=replace)]


def _write_together(
    name: str, exported: Sequence[ExportedRun], path: Path, *, replace: bool = False
) -> list[Path]:
    """Write several runs to one file as `write_exported_run` writes one."""
    with atomic_write(path.absolute(), replace=replace) as made:
        TOGETHER[name](exported, made)
    return [path, *_write_beside(name, exported, path, replace=replace)]


def _write_beside(name: str, exported: Sequence[ExportedRun], path: Path, *, replace: bool) -> Iterator[Path]:
    """Coefficients, where there are any, beside samples in CSV."""
    if name == "csv" and any(one.analysis is not None for one in exported):
        beside = path.with_name(f"{path.stem}.coefficients{path.suffix}")
        with atomic_write(beside.absolute(), replace=replace) as made:
            write_csv_coefficients(exported, made)
        yield beside


Progress = Callable[[int, str], None]
Content = Literal["both", "samples", "coefficients"]


class ExportRequest(msgspec.Struct, frozen=True):
    """What to export of runs, and in which format."""

    format: Literal["csv", "json", "parquet", "mat", "uff58", "xlsx", "latex", "ro-crate"]
    content: Content = "both"
    replace: bool = False

    @property
    def writer(self) -> ExportFormat:
        return FORMATS[self.format]

    @property
    def is_one_file(self) -> bool:
        """Tell whether all runs go into one file: a table of their coefficients."""
        return self.content == "coefficients" or not self.writer.holds_samples


class ExportOutcome(msgspec.Struct, frozen=True):
    """What became of one run: the files made, or why there is none."""

    run: str
    files: list[str] = []
    error: Message = EMPTY
    note: Message = EMPTY
    is_simulated: bool = False


def _load(path: Path, request: ExportRequest, validator: Validator) -> tuple[ExportedRun, Message]:
    """Read a run with its newest valid or new coefficients, or why there are none beside samples.

    Raises RunError, AnalysisError (coefficients alone are wanted, and there are none).
    """
    run = open_run(path, validator=validator)
    content: Content = "coefficients" if request.is_one_file else request.content
    samples = () if content == "coefficients" else sample_columns(run)
    if content == "samples":
        return ExportedRun(run, None, samples), EMPTY
    try:
        return ExportedRun(run, _document(run), samples), EMPTY
    except (AnalysisError, UnsuitableRunError) as error:
        if content == "coefficients":
            raise
        return ExportedRun(run, None, samples), message("no coefficients: {reason}", reason=error)


def export_runs(
    paths: Sequence[Path],
    output: Path,
    request: ExportRequest,
    *,
    progress: Progress = lambda _done, _name: None,
) -> list[ExportOutcome]:
    """Export runs, in the order given; one that fails is reported and does not stop the rest.

    `output` is the file to write, or a folder with a file a run. Several runs go into one file where it has
    the ending of its format. `progress` is called with the number done and the name of the next run. Raises
    RunError where nothing can be written at all.
    """
    if request.content == "coefficients" and request.writer.write_coefficients is None:
        raise UnsuitableRunError(
            "{format} holds samples, not coefficients. Choose csv, json, xlsx or latex", format=request.format
        )
    if request.content == "samples" and not request.writer.holds_samples:
        raise UnsuitableRunError(
            "{format} holds coefficients, not samples. Choose csv, json or parquet", format=request.format
        )
    gathers = request.is_one_file or _are_together(paths, output, request)
    targets = [output] * len(paths) if gathers else _targets(paths, output, request)
    gathered: list[ExportedRun] = []
    outcomes: list[ExportOutcome] = []
    with Validator.start() as validator:
        for done, (path, target) in enumerate(zip(paths, targets, strict=True)):
            progress(done, path.name)
            try:
                exported, note = _load(path, request, validator)
                files = [output.absolute()]
                if gathers:
                    gathered.append(exported)
                else:
                    files = write_exported_run(request.format, exported, target, replace=request.replace)
                simulated = exported.run.metadata.source_type is RunSource.SIMULATED
                names = list(map(str, files))
                outcomes.append(ExportOutcome(str(path.absolute()), names, note=note, is_simulated=simulated))
            except (RunError, AnalysisError) as error:
                outcomes.append(ExportOutcome(str(path.absolute()), error=message_of(error)))
    if gathered and not request.is_one_file:
        written = _write_together(request.format, gathered, output.absolute(), replace=request.replace)
        files_of_all = list(map(str, written))
        return [msgspec.structs.replace(one, files=files_of_all) if one.files else one for one in outcomes]
    if gathered and request.writer.write_coefficients is not None:
        with atomic_write(output.absolute(), replace=request.replace) as made:
            request.writer.write_coefficients(gathered, made)
    return outcomes


def _are_together(paths: Sequence[Path], output: Path, request: ExportRequest) -> bool:
    """Whether samples of several runs go into one file. Raises UnsuitableRunError where that holds one."""
    if len(paths) == 1 or output.is_dir() or output.suffix.lower() != request.writer.suffix:
        return False
    if request.format not in TOGETHER:
        template = N_("{format} holds one run a file, but {count} runs are given. Give a folder as {option}")
        raise UnsuitableRunError(template, format=request.format, count=len(paths), option=option("-o"))
    return True


def _targets(paths: Sequence[Path], output: Path, request: ExportRequest) -> list[Path]:
    if len(paths) == 1 and not output.is_dir():
        return [output]
    if output.exists() and not output.is_dir():
        template = N_("{output} is a file, but {count} runs need a folder. Choose another {option}")
        raise UnsuitableRunError(template, option=option("-o"), output=output, count=len(paths))
    make_folder(output)
    return [output / (name + request.writer.suffix) for name in unique_names(path.stem for path in paths)]


def _document(run: Run) -> dict[str, object]:
    in_metres = (run.metadata.quantity, run.metadata.unit) == ("displacement", "m")
    kept = latest_valid(run.analyses, to_record(run, metres_only=in_metres))
    if kept is not None:
        has_gauge_2 = run.relative_reading is not None
        return kept.document_of(run.path, run.metadata, run.identifier, has_gauge_2=has_gauge_2)
    return analyze_run(run.path, AnalysisRequest(kind="two-mass" if in_metres else "one-mass")).document
