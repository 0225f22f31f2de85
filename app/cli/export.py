"""`slipstand export`: runs and their coefficients for other programs."""

import msgspec
import typer

from app.cli import output as out
from app.cli.run_file_options import ExportOptions
from app.runs.exchange.exporting import ExportRequest, export_runs
from app.runs.origin import SIMULATED


def export(options: ExportOptions) -> None:
    chosen = {"format": options.format_name, "content": options.content, "replace": options.force}
    request = msgspec.convert(chosen, ExportRequest)
    target = options.output.expanduser().resolve()
    if request.is_one_file or (len(options.runs) == 1 and not target.is_dir()):
        target = out.output_file(options.output, options.force)
    with out.progress_bar("exporting", total=len(options.runs)) as update:
        outcomes = export_runs([run.expanduser() for run in options.runs], target, request, progress=update)
    for outcome in outcomes:
        if outcome.error:
            out.print_status(f"error: {outcome.error}")
        elif outcome.note:
            out.print_status(f"{outcome.run}: {outcome.note}")
        if outcome.is_simulated:
            out.print_status(f"{outcome.run}: {SIMULATED}, of a simulated stand and not of a real one")
    if options.as_json:
        texts = [{"error": str(outcome.error), "note": str(outcome.note)} for outcome in outcomes]
        documents = [msgspec.to_builtins(outcome) for outcome in outcomes]
        out.print_json([document | text for document, text in zip(documents, texts, strict=True)])
    else:
        for file in dict.fromkeys(file for outcome in outcomes for file in outcome.files):
            out.print_line(file)
    if any(outcome.error for outcome in outcomes):
        raise typer.Exit(1)
