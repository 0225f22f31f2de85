"""`slipstand export`: runs and their coefficients for other programs."""

from pathlib import Path
from typing import Annotated

import msgspec
import typer

from app.cli import output as out
from app.cli.options import Force, Json, Runs, choice
from app.runs.exchange.exporting import ExportRequest, export_runs


def export(
    runs: Runs,
    format_name: Annotated[
        str,
        choice("--format", "csv", "json", "parquet", "mat", "uff58", "xlsx", "latex", help="File format."),
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="File to write; a folder for the samples of several runs.")
    ],
    content: Annotated[
        str,
        choice(
            "--content",
            "both",
            "samples",
            "coefficients",
            help="samples, coefficients (one table of all runs), or both.",
        ),
    ] = "both",
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Write samples and coefficients of runs for other programs.

    The newest analysis kept in a run is taken, else it is analysed.
    """
    request = msgspec.convert({"format": format_name, "content": content, "replace": force}, ExportRequest)
    target = output.expanduser().resolve()
    if len(runs) == 1 or request.is_one_file:
        target = target if target.is_dir() and not request.is_one_file else out.output_file(output, force)
    with out.progress_bar("exporting", total=len(runs)) as update:
        outcomes = export_runs([run.expanduser() for run in runs], target, request, progress=update)
    for outcome in outcomes:
        if outcome.error:
            out.print_status(f"error: {outcome.error}")
        elif outcome.note:
            out.print_status(f"{outcome.run}: {outcome.note}")
    if as_json:
        out.print_json(msgspec.to_builtins(outcomes))
    else:
        for file in dict.fromkeys(file for outcome in outcomes for file in outcome.files):
            out.print_line(file)
    if any(outcome.error for outcome in outcomes):
        raise typer.Exit(1)
