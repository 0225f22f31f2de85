"""Notices about runs that a crash has left unfinished, or that went on without a window."""

import datetime
from dataclasses import dataclass
from pathlib import Path

from analysis.formatting import with_unit
from app.presenters.base import Notice, NoticeAction, Progress, Tone
from app.presenters.results import end_status, sentence
from app.runs.unattended import UnattendedRun
from messages.i18n import N_, gettext, ngettext

_LATER = N_("Later")


@dataclass(frozen=True, slots=True)
class RecoveryReport:
    """Paths of recovered runs and of replaced files, and errors."""

    runs: tuple[str, ...] = ()
    replaced_files: tuple[str, ...] = ()
    errors: tuple[str, ...] = ()


def offer_recovery(text: str, tone: Tone = Tone.BAD) -> Notice:
    return Notice(text, tone, NoticeAction.RECOVER, _LATER)


def recovery_question(count: int) -> Notice:
    text = ngettext("A run was cut short by a crash.", "{count} runs were cut short by a crash.", count)
    text += " " + gettext("All that came is in a journal, and the run can be rebuilt from it.")
    return offer_recovery(text, Tone.WARN)


def unattended_notice(run: UnattendedRun, today: datetime.date) -> Notice:
    """Tell how a recording ended that was begun by a program that is gone."""
    end, ended = run.end_time.astimezone(), end_status(run.ended)
    time = f"{end:%H:%M:%S}" if end.date() == today else f"{end:%Y-%m-%d %H:%M}"
    if run.path:
        template = N_("The program ended while it recorded, and the recording went on: {name} is stored.")
        text = gettext(template, name=Path(run.path).name)
    else:
        template = N_("The program ended while it recorded {series}: there is no run.")
        text = gettext(template, series=run.series or gettext("a run"))
    at = gettext("{ended}, at {time}", ended=ended.text, time=time)
    parts = (text, sentence(at) + ".", sentence(run.message))
    action = NoticeAction.OPEN_RUN if run.path else None
    return Notice(" ".join(filter(None, parts)), ended.tone, action, path=run.path)


def recovery_progress(progress: Progress | None = None) -> Notice:
    if progress is None or progress.fraction is None:
        return Notice(gettext("Recovering runs"), Tone.PLAIN)
    return Notice(f"{progress.text}: {with_unit(f'{100 * progress.fraction:.0f}', '%')}", Tone.PLAIN)


def recovery_outcome(recovered: RecoveryReport) -> Notice:
    names, parts = [Path(path).name for path in recovered.runs], []
    if len(names) == 1:
        parts.append(gettext("Recovered {name}", name=names[0]))
    elif names:
        parts.append(ngettext("Recovered {count} run", "Recovered {count} runs", len(names)))
    kept = gettext("What was there before is kept as {name}")
    parts += [kept.format(name=Path(path).name) for path in recovered.replaced_files]
    parts += recovered.errors
    tone = Tone.BAD if recovered.errors else Tone.OK
    return Notice(sentence(". ".join(parts or [gettext("Nothing was left to recover")])), tone)
