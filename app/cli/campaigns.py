"""Runs given on the command line as a campaign."""

from collections.abc import Sequence
from pathlib import Path

import typer

from app.cli import output as out
from app.cli.errors import CommandError
from app.cli.option_values import executor_options
from app.cli.shared_options import JobOptions
from app.runs.campaign.collect import CollectedRuns, CollectOptions, collect_runs
from app.runs.listing import resolve_run_files


def load_campaign(
    paths: Sequence[Path], jobs: JobOptions, *, exclude: Sequence[str] | None = None, save: bool = False
) -> CollectedRuns:
    """Collect run files and folders of runs, without those that `--exclude` names. Raises RunError."""
    options = CollectOptions(executor_options(jobs), save=save, excluded=_excluded_runs(paths, exclude or []))
    with out.progress_bar("gathering", total=1.0) as update:
        return collect_runs(paths, options, update)


def exit_with_failures(runs: CollectedRuns) -> None:
    """Print on stderr which runs gave no result and why, and end with exit code 1 where there are any."""
    for failure in runs.failures:
        out.print_status(f"error: {failure.run}: {failure.reason}")
    if runs.failures:
        raise typer.Exit(1)


def _excluded_runs(paths: Sequence[Path], given: Sequence[str]) -> dict[str, str]:
    """Reasons by absolute path of RUN or RUN=REASON, where RUN is a path, a file's name or its stem."""
    files = resolve_run_files([path.expanduser().absolute() for path in paths]) if given else []
    reasons = {}
    for each in given:
        name, _, reason = each.partition("=")
        reasons[str(_named(name.strip(), files))] = reason.strip() or "no reason given"
    return reasons


def _named(name: str, files: Sequence[Path]) -> Path:
    path = Path(name).expanduser().absolute()
    found = [path] if path in files else [file for file in files if name in (file.name, file.stem)]
    if not found:
        fault = f"is none of the {len(files)} runs. Give a path, or the name of a file"
        raise CommandError(f"--exclude {name} {fault}")
    if len(found) > 1:
        runs = ", ".join(map(str, found))
        raise CommandError(f"--exclude {name} names {len(found)} runs: {runs}. Give a path")
    return found[0]
