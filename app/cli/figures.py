"""`slipstand figures`: the paper's Figs. 2 to 5 from runs, for print."""

from pathlib import Path

import msgspec

from app.cli import output as out
from app.cli.campaigns import exit_with_failures, load_campaign
from app.cli.errors import CommandError
from app.cli.result_options import FiguresOptions
from app.reports.figures.figure_files import (
    NUMBERS,
    FigureFile,
    FigureFolder,
    representative_runs,
    write_figures,
)
from app.runs.campaign.collect import CollectedRuns


def figures(options: FiguresOptions) -> None:
    numbers = _numbers(options.figure)
    folder = _folder(options.output, options.format_name, options.force)
    folder.check()
    runs = load_campaign(options.paths, options.jobs)
    written, notes = _write(folder, numbers, options, runs) if runs.runs else ([], [])
    if options.as_json:
        failures = msgspec.to_builtins(runs.failures)
        out.print_json({"figures": msgspec.to_builtins(written), "notes": notes, "failures": failures})
    else:
        for one in written:
            out.print_line(f"{one.file}  {one.caption}")
    for note in notes:
        out.print_status(f"note: {note}")
    exit_with_failures(runs)


def _numbers(wanted: list[str] | None) -> list[str]:
    for number in wanted or []:
        if number not in NUMBERS:
            raise CommandError(f"--figure {number!r} is not known. Use {', '.join(NUMBERS)}")
    return [number for number in NUMBERS if not wanted or number in wanted]


def _folder(output: Path, format_name: str, force: bool) -> FigureFolder:
    target = output.expanduser().resolve()
    if target.exists() and not target.is_dir():
        raise CommandError(f"-o {target} is a file. Give a folder")
    return msgspec.convert({"path": str(target), "format": format_name, "replace": force}, FigureFolder)


def _write(
    folder: FigureFolder, numbers: list[str], options: FiguresOptions, runs: CollectedRuns
) -> tuple[list[FigureFile], list[str]]:
    """Draw runs given by name, and representative ones of folders; return figures and notes."""
    campaign, names = runs.campaign(), {run.name for run in runs.runs}
    chosen = [path for path in map(Path.absolute, map(Path.expanduser, options.paths)) if str(path) in names]
    if campaign.rows and (options.series or any(path.is_dir() for path in options.paths)):
        chosen += representative_runs(campaign, runs.runs, options.series or [])
    chosen = list(dict.fromkeys(chosen))
    with out.progress_bar("drawing", total=1.0) as update:
        return write_figures(folder, numbers, chosen, campaign, runs.stands.values(), update)
