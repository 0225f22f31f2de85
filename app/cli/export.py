"""`slipstand export`: runs and their coefficients for other programs."""

import tempfile
from collections.abc import Sequence
from pathlib import Path

import msgspec
import typer

from app.cli import output as out
from app.cli.errors import CommandError, alternatives
from app.cli.run_file_options import ExportOptions
from app.runs.exchange.export_formats import FORMATS
from app.runs.exchange.exporting import ExportOutcome, ExportRequest, export_runs
from app.runs.listing import resolve_run_files
from app.runs.origin import SIMULATED

_TEXTS = ("csv", "json", "latex")
_STDOUT = Path("-")


def export(options: ExportOptions) -> None:
    output = None if options.output == _STDOUT else options.output
    name = options.format_name or _format_by_ending(output)
    chosen = {"format": name, "content": options.content, "replace": options.force}
    request = msgspec.convert(chosen, ExportRequest)
    if output is None:
        _check_stdout(request, as_json=options.as_json)
    runs = resolve_run_files(options.runs)
    with tempfile.TemporaryDirectory(prefix="slipstand-") as folder:
        shown = Path(folder) / f"shown{request.writer.suffix}"
        target = shown if output is None else _target(output, runs, request)
        with out.progress_bar("exporting", total=len(runs)) as update:
            outcomes = export_runs(runs, target, request, progress=update)
        _report(outcomes, listed=output is not None, as_json=options.as_json)
        if output is None and shown.exists():
            out.print_document(shown.read_text("utf-8"), is_json=name == "json")
    if any(outcome.error for outcome in outcomes):
        raise typer.Exit(1)


def _format_by_ending(output: Path | None) -> str:
    """Format by the ending of the file. Raises CommandError where that tells none."""
    if output is None:
        raise CommandError("nothing says what to write. Give -o FILE.xlsx, or --format csv for stdout")
    suffix = output.suffix.lower()
    for name, writer in FORMATS.items():
        if writer.suffix == suffix:
            return name
    endings = alternatives([writer.suffix for writer in FORMATS.values()])
    raise CommandError(f"-o {output.name} has no known ending. Use {endings}, or give --format")


def _check_stdout(request: ExportRequest, *, as_json: bool) -> None:
    """Refuse what stdout cannot hold. Raises CommandError."""
    if request.format not in _TEXTS:
        raise CommandError(f"--format {request.format} is no text for stdout. Give -o FILE")
    if request.format == "csv" and request.content == "both":
        raise CommandError("csv has samples and coefficients in two tables. Give --content, or -o FILE")
    if as_json:
        raise CommandError("--json lists the files that are written. Give -o FILE, or --format json alone")


def _target(output: Path, runs: Sequence[Path], request: ExportRequest) -> Path:
    """The file or folder to write. Raises CommandError for a file that cannot be."""
    target = output.expanduser().resolve()
    is_file = request.is_one_file or len(runs) == 1 or target.suffix.lower() == request.writer.suffix
    return out.output_file(output, request.replace) if is_file and not target.is_dir() else target


def _report(outcomes: Sequence[ExportOutcome], *, listed: bool, as_json: bool) -> None:
    for outcome in outcomes:
        if outcome.error:
            out.print_status(f"error: {outcome.error}")
        elif outcome.note:
            out.print_status(f"{outcome.run}: {outcome.note}")
        if outcome.is_simulated:
            out.print_status(f"{outcome.run}: {SIMULATED}, of a simulated stand and not of a real one")
    if as_json:
        texts = [{"error": str(outcome.error), "note": str(outcome.note)} for outcome in outcomes]
        documents = [msgspec.to_builtins(outcome) for outcome in outcomes]
        out.print_json([document | text for document, text in zip(documents, texts, strict=True)])
    elif listed:
        for file in dict.fromkeys(file for outcome in outcomes for file in outcome.files):
            out.print_line(file)
