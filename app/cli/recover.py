"""`slipstand recover`: runs from the journals that a crash has left."""

from pathlib import Path

import msgspec
import typer

from app.acquisition.journal.recovery import Recovery, RecoveryState, recover_folder
from app.cli import output as out
from app.cli.run_file_options import RecoverOptions
from app.runs.journal import unfinished_journals
from app.runs.paths import journal_fallback_folders, recordings_directory


def recover(options: RecoverOptions) -> None:
    folder = options.directory.expanduser().absolute() if options.directory else recordings_directory()
    folders = [folder]
    if not options.directory:
        folders = [one for one in (folder, *journal_fallback_folders()) if one.is_dir()]
    found = []
    for one in folders:
        with out.progress_bar("recovering", total=1.0) as update:
            found += recover_folder(
                one, lambda journal, share: update(share, journal.name), original_folder=folder
            )
    if options.as_json:
        out.print_json([msgspec.to_builtins(one) | {"message": str(one.message)} for one in found])
    elif not found:
        out.print_line(f"No journals in {folder}: nothing was left unfinished there")
    for recovery in found:
        if recovery.state is RecoveryState.FAILED:
            out.print_status(f"error: {recovery.message}")
        elif not options.as_json:
            out.print_line(recovery_text(recovery))
    if any(recovery.state is RecoveryState.FAILED for recovery in found):
        raise typer.Exit(1)


def recovery_text(recovery: Recovery) -> str:
    """Say in one line what became of a journal."""
    match recovery.state:
        case RecoveryState.WHOLE:
            return f"{recovery.run}: was whole already; its journal is removed"
        case RecoveryState.EMPTY:
            return f"{recovery.journal}: no byte had come yet; removed"
        case RecoveryState.BEING_RECORDED:
            return str(recovery.message)
    aside = f"; what was there before is now {recovery.kept}" if recovery.kept else ""
    return f"{recovery.run}: {recovery.samples} samples recovered, ended: {recovery.ended}{aside}"


def print_unfinished_runs(folder: Path) -> None:
    """Mention journals in a folder, and where journals move to, whose engine is gone."""
    for place in (folder, *journal_fallback_folders()):
        left = len(unfinished_journals(place))
        if left:
            runs = "1 run was" if left == 1 else f"{left} runs were"
            out.print_status(
                f"{runs} cut short, with journals in {place}. Rebuild with: slipstand recover {place}"
            )


def print_interrupted_run(run: Path, ended: str) -> None:
    """Mention that a run, by why it ended, was cut short, where a journal lies beside it."""
    if ended in ("", "interrupted", "write-error", "disk-full") and unfinished_journals(run.parent):
        out.print_status(
            f"{run} was cut short and a journal lies beside it, which may hold more of it."
            f" Rebuild with: slipstand recover {run.parent}"
        )
