"""`slipstand figures`: the paper's Figs. 2 to 5 from runs, for print."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli.campaigns import exit_with_failures, load_campaign
from app.cli.errors import CommandError
from app.cli.options import Dask, Force, Jobs, Json, RunsOrFolders, executor_options

if TYPE_CHECKING:
    from analysis.campaign.campaign import Campaign
    from app.reports.figures.figure_files import FigureFile, FigureFolder
    from app.runs.campaign.collect import CollectedRuns


def figures(
    paths: RunsOrFolders,
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder to write to, made if absent.")],
    format_name: Annotated[str, typer.Option("--format", help="png (300 dpi), svg or pdf.")] = "png",
    series: Annotated[
        list[str] | None,
        typer.Option(help="Of a folder: draw a run of this series; repeatable. The paper's 1FFM0 if absent."),
    ] = None,
    figure: Annotated[
        list[str] | None, typer.Option(help="Only this figure: 2, 3a, 3b, 4a, 4b, 5a or 5b; repeatable.")
    ] = None,
    jobs: Jobs = None,
    dask: Dask = "",
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Draw the paper's figures 2 to 5 from runs, for print.

    2 is f_s and f_d by contact, 3a to 5b are the motion of a run.
    Run files are all drawn; of a folder, the run of a series that is nearest to its mean.
    """
    import msgspec

    from app.cli import output as out

    numbers, crew = _numbers(figure), executor_options(jobs, dask)
    folder = _folder(output, format_name, force)
    folder.check()
    gathered, campaign = load_campaign(paths, crew)
    chosen = _chosen(paths, series or [], gathered, campaign)
    written, notes = _write(folder, numbers, chosen, gathered, campaign) if gathered.runs else ([], [])
    if as_json:
        failures = msgspec.to_builtins(gathered.failures)
        out.print_json({"figures": msgspec.to_builtins(written), "notes": notes, "failures": failures})
    else:
        for one in written:
            out.print_line(f"{one.file}  {one.caption}")
    for note in notes:
        out.print_status(f"note: {note}")
    exit_with_failures((failure.run, failure.reason) for failure in gathered.failures)


def _numbers(wanted: list[str] | None) -> list[str]:
    from app.reports.figures.figure_files import NUMBERS

    for number in wanted or []:
        if number not in NUMBERS:
            raise CommandError(f"--figure {number!r} is not known. Use {', '.join(NUMBERS)}")
    return [number for number in NUMBERS if not wanted or number in wanted]


def _folder(output: Path, format_name: str, force: bool) -> "FigureFolder":
    import msgspec

    from app.reports.figures.figure_files import FigureFolder
    from app.reports.figures.style import FORMATS

    if format_name not in FORMATS:
        raise CommandError(f"--format {format_name!r} is not known. Use {', '.join(FORMATS)}")
    target = output.expanduser().resolve()
    if target.exists() and not target.is_dir():
        raise CommandError(f"-o {target} is a file. Give a folder")
    return msgspec.convert({"path": str(target), "format": format_name, "replace": force}, FigureFolder)


def _chosen(
    paths: list[Path], series: list[str], gathered: "CollectedRuns", campaign: "Campaign"
) -> list[Path]:
    """Runs given by name, and those that stand for folders."""
    from app.reports.figures.figure_files import representative_runs

    named = {str(path.expanduser().absolute()) for path in paths if not path.is_dir()}
    chosen = [Path(run.name) for run in gathered.runs if run.name in named]
    if series or any(path.is_dir() for path in paths):
        chosen += representative_runs(campaign, gathered.runs, series) if campaign.rows else []
    return list(dict.fromkeys(chosen))


def _write(
    folder: "FigureFolder",
    numbers: list[str],
    chosen: list[Path],
    gathered: "CollectedRuns",
    campaign: "Campaign",
) -> tuple[list["FigureFile"], list[str]]:
    """Write everything that is wanted; returns what was written, and what there was nothing for."""
    from app.cli import output as out
    from app.reports.figures.figure_files import write_figures

    with out.progress_bar("drawing", total=1.0) as update:
        return write_figures(folder, numbers, chosen, campaign, gathered.stands.values(), update)
