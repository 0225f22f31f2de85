"""Work on many runs, in words: how far it is, and which runs they are."""

from collections.abc import Callable, Sequence
from pathlib import Path

from app.presenters.base import Progress
from app.presenters.worker import ReportProgress
from messages.i18n import gettext, ngettext

_ROUNDING = 1e-9


def batch_progress(
    report: ReportProgress, template: str, paths: Sequence[str]
) -> Callable[[float, str], None]:
    """Give what `app.runs.batch` calls with the share that is done.

    Parameters
    ----------
    report
        Is told which of the runs is waited for.
    words
        With `{name}`, `{number}` and `{all}`; translated here.
    paths
        The runs, in their order.
    """

    def tell(share: float, _what: str) -> None:
        number = min(int(share * len(paths) + _ROUNDING), len(paths) - 1)
        name = Path(paths[number]).stem
        report(Progress(gettext(template, name=name, number=number + 1, all=len(paths)), share))

    return tell


def run_count_text(paths: Sequence[str]) -> str:
    """Name the run where it is one, say how many where they are several."""
    return Path(paths[0]).stem if len(paths) == 1 else ngettext("{count} run", "{count} runs", len(paths))
