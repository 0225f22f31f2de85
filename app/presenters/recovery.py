"""Runs that a crash has left unfinished: what the window says of them, and the work that finishes them."""

from dataclasses import dataclass
from pathlib import Path

from app.presenters.base import Notice, Progress, ReportProgress, Tone
from app.presenters.results import sentence
from messages.i18n import N_, gettext, ngettext, translate

RECOVER = N_("Recover")
LATER = N_("Later")


@dataclass(frozen=True, slots=True)
class RecoverFolder:
    """A task for the worker: finish all runs of a folder, with journals that had to move elsewhere."""

    folder: str


@dataclass(frozen=True, slots=True)
class RecoveryReport:
    """What came of it."""

    runs: tuple[str, ...] = ()
    """Paths of the runs that are whole now."""
    replaced_files: tuple[str, ...] = ()
    errors: tuple[str, ...] = ()


def recover_runs(task: RecoverFolder, report: ReportProgress) -> RecoveryReport:
    """Do it, in the worker's process."""
    from app.acquisition.journal.recovery import Recovery, RecoveryState, recover_folder
    from app.runs.paths import journal_folders

    found: list[Recovery] = []
    for folder in journal_folders(Path(task.folder)):
        found += recover_folder(
            folder,
            lambda journal, share: report(Progress(gettext("Recovering {name}", name=journal.stem), share)),
            original_folder=Path(task.folder),
        )
    return RecoveryReport(
        runs=tuple(one.run for one in found if one.run),
        replaced_files=tuple(one.kept for one in found if one.kept),
        errors=tuple(translate(one.message) for one in found if one.state is RecoveryState.FAILED),
    )


def recovery_question(count: int) -> Notice:
    """Ask at the start what is to become of `count` unfinished runs."""
    text = ngettext("A run was cut short by a crash.", "{count} runs were cut short by a crash.", count)
    text += " " + gettext("All that came is in a journal, and the run can be rebuilt from it.")
    return Notice(text, Tone.WARN, RECOVER, LATER)


def recovery_progress(progress: Progress | None = None) -> Notice:
    """Say that it is being done, and how far."""
    if progress is None or progress.fraction is None:
        return Notice(gettext("Recovering runs"), Tone.PLAIN)
    return Notice(f"{progress.text}: {progress.fraction:.0%}", Tone.PLAIN)


def recovery_outcome(recovered: RecoveryReport) -> Notice:
    """Say what came of it."""
    said = [_count(recovered.runs)] if recovered.runs else []
    said += [
        gettext("What was there before is kept as {name}", name=Path(path).name)
        for path in recovered.replaced_files
    ]
    said += recovered.errors
    tone = Tone.BAD if recovered.errors else Tone.OK
    return Notice(sentence(". ".join(said or [gettext("Nothing was left to recover")])), tone)


def _count(runs: tuple[str, ...]) -> str:
    return (
        gettext("Recovered {name}", name=Path(runs[0]).name)
        if len(runs) == 1
        else ngettext("Recovered {count} run", "Recovered {count} runs", len(runs))
    )
