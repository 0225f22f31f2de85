"""The right column of Campaign: runs of a series, next test, causes, the stand, repeatability, warnings."""

from collections.abc import Iterator
from functools import partial

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QGridLayout, QLabel, QLayout, QLineEdit, QVBoxLayout, QWidget

from analysis.formatting import THIN_SPACE
from app.presenters.base import Chip, Tone
from app.presenters.campaign.presenter import CampaignPresenter
from app.presenters.campaign.state import CampaignSummary, RepeatabilityRow, RunRow
from app.qt.theme import TextRole
from app.qt.widgets.inputs import make_button
from app.qt.widgets.layouts import STRETCH, Item, clear, make_column, make_row
from app.qt.widgets.text import label, show_chip
from messages.i18n import gettext

_REPEATABILITY_SHOWN = 8


def make_sections(summary: CampaignSummary, presenter: CampaignPresenter) -> QWidget:
    """Make the sections of a campaign; those without content are left out."""
    sections: tuple[tuple[str, list[Item]], ...] = (
        (gettext("Next test"), list(_next_test(summary, presenter))),
        (gettext("What f<sub>d</sub> depends on"), list(_effects(summary))),
        (gettext("Effects of the stand"), [_chip(chip, wrap=True) for chip in summary.stand_effects]),
        (gettext("How f<sub>d</sub> repeats"), list(_repeatability(summary.repeatability))),
        (gettext("Left out"), [_excluded_row(run, presenter) for run in summary.excluded]),
        (gettext("Without a result"), [_chip(Chip(text, Tone.BAD), wrap=True) for text in summary.faults]),
        (gettext("To know"), [_chip(Chip(text, Tone.WARN), wrap=True) for text in summary.warnings]),
    )
    column: list[Item] = []
    for title, parts in sections:
        if parts:
            heading = label(title, TextRole.HEADING)
            heading.setContentsMargins(0, 8, 0, 0)
            column += [heading, *parts]
    made = QWidget()
    make_column(*column, STRETCH, spacing=8, margins=(16, 16), of=made)
    return made


def _next_test(summary: CampaignSummary, presenter: CampaignPresenter) -> Iterator[Item]:
    test = summary.next_test
    if test is None:
        return
    if test.series:
        yield label(test.series, TextRole.NUMBER)
    yield label(test.reason, wrap=True)
    yield from (label(text, muted=True, wrap=True) for text in test.expectations)
    if test.series:
        button = make_button(gettext("Record"), presenter.navigator.show_record, gettext("Go to Record"))
        yield make_row(button, STRETCH)


def _effects(summary: CampaignSummary) -> Iterator[Item]:
    for effect in summary.effects:
        conclusion = label(effect.conclusion, TextRole.STRONG if effect.is_found else TextRole.TEXT)
        yield make_row(label(effect.cause, TextRole.STRONG), STRETCH, conclusion, spacing=6)
        yield label(effect.sentence, muted=True, wrap=True)


def _repeatability(rows: tuple[RepeatabilityRow, ...]) -> Iterator[Item]:
    if not rows:
        return
    grid = QGridLayout()
    grid.setHorizontalSpacing(12)
    grid.setVerticalSpacing(4)
    grid.setColumnStretch(0, 1)
    titles = (gettext("series"), gettext("runs"), gettext("scatter"), gettext("Birge"))
    for column, title in enumerate(titles):
        grid.addWidget(label(title, TextRole.LABEL, muted=True), 0, column, _side(column))
    for number, row in enumerate(rows[:_REPEATABILITY_SHOWN]):
        line = 2 * number + 1
        for column, text in enumerate((row.label, str(row.runs), row.scatter, row.birge_ratio)):
            grid.addWidget(label(text), line, column, _side(column))
        if row.status.tone is not Tone.OK:
            grid.addWidget(_chip(row.status, wrap=True), line + 1, 0, 1, 4)
    yield grid
    more = len(rows) - _REPEATABILITY_SHOWN
    if more > 0:
        text = gettext("{count} more series repeat as well or better.", count=more)
        yield label(text, TextRole.LABEL, muted=True, wrap=True)


def _excluded_row(run: RunRow, presenter: CampaignPresenter) -> QLayout:
    row = make_row((label(f"{run.name}: {run.reason}", wrap=True), 1), spacing=6)
    if run.can_return:
        button = make_button(gettext("Take in"), partial(presenter.include_run, run.path))
        button.setAccessibleName(gettext("Let {run} count again", run=run.name))
        row.addWidget(button, 0, Qt.AlignmentFlag.AlignTop)
    return row


def _chip(chip: Chip, *, wrap: bool = False) -> QLabel:
    made = label(wrap=wrap)
    show_chip(made, chip)
    return made


def _side(column: int) -> Qt.AlignmentFlag:
    return Qt.AlignmentFlag.AlignRight if column else Qt.AlignmentFlag.AlignLeft


class SelectedRuns(QWidget):
    """Runs of the selected series; hidden without one."""

    def __init__(self, presenter: CampaignPresenter) -> None:
        super().__init__()
        self._presenter = presenter
        self._title = label(role=TextRole.HEADING)
        self._rows = QVBoxLayout()
        self._rows.setSpacing(8)
        self._reason = QLineEdit()
        self._reason.setPlaceholderText(gettext("Why a run is left out"))
        self._reason.setAccessibleName(gettext("Reason for leaving a run out"))
        layout = make_column(self._title, self._rows, self._reason, spacing=8, of=self)
        layout.setContentsMargins(16, 16, 16, 8)
        self.hide()

    def show_runs(self, series: str, runs: tuple[RunRow, ...]) -> None:
        self.setVisible(bool(runs))
        self._title.setText(gettext("Runs of {series}", series=series))
        clear(self._rows)
        for run in runs:
            self._rows.addWidget(self._row(run))

    def clear_reason(self) -> None:
        self._reason.clear()

    def _row(self, run: RunRow) -> QWidget:
        open_run = partial(self._presenter.navigator.open_run, run.path)
        name = make_button(run.name, open_run, gettext("Show this run on Identify"))
        name.setProperty("role", "row")
        exclude = make_button(
            gettext("Leave out"),
            lambda: self._presenter.exclude_run(run.path, self._reason.text()),
            gettext("Leave this run out, for the reason below"),
        )
        exclude.setAccessibleName(gettext("Leave {run} out", run=run.name))
        friction = label(f"f<sub>d</sub> = {run.friction}{THIN_SPACE}{run.uncertainty}")
        made = QWidget()
        below = make_row(friction, _chip(run.status), STRETCH, exclude, spacing=6)
        make_column(name, below, spacing=2, of=made)
        return made
