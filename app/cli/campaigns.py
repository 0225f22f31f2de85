"""Runs given on the command line as a campaign."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import typer

from analysis.campaign.campaign import Campaign
from app.cli import output as out
from app.cli.errors import CommandError
from app.runs.batch.executors import ExecutorOptions
from app.runs.campaign.collect import CollectedRuns, CollectOptions, collect_runs
from app.runs.listing import resolve_run_files


def load_campaign(
    paths: Sequence[Path],
    crew: ExecutorOptions,
    *,
    save: bool = False,
    excluded: Mapping[str, str] | None = None,
) -> tuple[CollectedRuns, "Campaign"]:
    """Gather run files and folders of runs, and sum them up. Raises RunError.

    Parameters
    ----------
    save
        Keep new analyses in their runs.
    excluded
        Why runs do not count, by their absolute paths, beside those that say so themselves.
    """
    with out.progress_bar("gathering", total=1.0) as update:
        gathered = collect_runs(paths, CollectOptions(crew, save=save, excluded=dict(excluded or {})), update)
    return gathered, gathered.campaign()


def exit_with_failures(failures: Iterable[tuple[str, str]]) -> None:
    """Say on stderr which runs gave no result and why, and end with exit code 1 where there are any."""
    failed = False
    for run, reason in failures:
        out.print_status(f"error: {run}: {reason}")
        failed = True
    if failed:
        raise typer.Exit(1)


def excluded_runs(paths: Sequence[Path], given: Sequence[str]) -> dict[str, str]:
    """Reasons by absolute path of RUN or RUN=REASON, where RUN is a path, a file's name or its stem.

    Raises
    ------
    CommandError
        A name that is none of a run there, or of several.
    """
    files = resolve_run_files([path.expanduser().absolute() for path in paths]) if given else []
    reasons = {}
    for each in given:
        name, _, reason = each.partition("=")
        reasons[str(_named(name.strip(), files))] = reason.strip() or "no reason given"
    return reasons


def _named(name: str, files: Sequence[Path]) -> Path:
    path = Path(name).expanduser().absolute()
    found = [file for file in files if path == file] or [
        file for file in files if name in (file.name, file.stem)
    ]
    if len(found) == 1:
        return found[0]
    if found:
        raise CommandError(
            f"--exclude {name} names {len(found)} runs: {', '.join(map(str, found))}. Give a path"
        )
    raise CommandError(
        f"--exclude {name} is none of the {len(files)} runs. Give a path, or the name of a file"
    )
