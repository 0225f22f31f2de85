"""`slipstand figures`: the paper's Figs. 2 to 5 from runs, for print."""

from pathlib import Path

import msgspec

from analysis.campaign.campaign import Campaign
from app.cli import output as out
from app.cli.campaigns import exit_with_failures, load_campaign
from app.cli.errors import CommandError
from app.cli.option_values import executor_options
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
    numbers, executor = _numbers(options.figure), executor_options(options.jobs)
    folder = _folder(options.output, options.format_name, options.force)
    folder.check()
    gathered, campaign = load_campaign(options.paths, executor)
    chosen = _chosen(options.paths, options.series or [], gathered, campaign)
    written, notes = _write(folder, numbers, chosen, gathered, campaign) if gathered.runs else ([], [])
    if options.as_json:
        failures = msgspec.to_builtins(gathered.failures)
        out.print_json({"figures": msgspec.to_builtins(written), "notes": notes, "failures": failures})
    else:
        for one in written:
            out.print_line(f"{one.file}  {one.caption}")
    for note in notes:
        out.print_status(f"note: {note}")
    exit_with_failures((failure.run, str(failure.reason)) for failure in gathered.failures)


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


def _chosen(paths: list[Path], series: list[str], gathered: CollectedRuns, campaign: Campaign) -> list[Path]:
    """Runs given by name, and those that stand for folders."""
    named = {str(path.expanduser().absolute()) for path in paths if not path.is_dir()}
    chosen = [Path(run.name) for run in gathered.runs if run.name in named]
    if series or any(path.is_dir() for path in paths):
        chosen += representative_runs(campaign, gathered.runs, series) if campaign.rows else []
    return list(dict.fromkeys(chosen))


def _write(
    folder: FigureFolder,
    numbers: list[str],
    chosen: list[Path],
    gathered: CollectedRuns,
    campaign: Campaign,
) -> tuple[list[FigureFile], list[str]]:
    """Write everything that is wanted; returns what was written, and what there was nothing for."""
    with out.progress_bar("drawing", total=1.0) as update:
        return write_figures(folder, numbers, chosen, campaign, gathered.stands.values(), update)
