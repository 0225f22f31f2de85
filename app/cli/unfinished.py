"""Says on stderr that a crash has left runs unfinished, and how to finish them."""

from pathlib import Path

from app.cli import output as out


def tell_unfinished(folder: Path) -> None:
    """Mention journals in a folder, and where journals move to, whose engine is gone."""
    from app.runs.journals import unfinished_journals
    from app.runs.places import journal_refuges

    for place in (folder, *journal_refuges()):
        left = len(unfinished_journals(place))
        if left:
            runs = "1 run was" if left == 1 else f"{left} runs were"
            out.tell(f"{runs} cut short, with journals in {place}. Rebuild with: slipstand recover {place}")


def tell_cut_short(run: Path, ended: str) -> None:
    """Mention that a run, by why it ended, was cut short, where a journal lies beside it."""
    from app.runs.journals import unfinished_journals

    if ended in ("", "interrupted", "write-error", "disk-full") and unfinished_journals(run.parent):
        out.tell(
            f"{run} was cut short and a journal lies beside it, which may hold more of it."
            f" Rebuild with: slipstand recover {run.parent}"
        )
