"""The right column of Campaign: runs of a series, next test, effects, repeatability, exclusions, warnings."""

from functools import partial

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QGridLayout, QHBoxLayout, QLabel, QLineEdit, QVBoxLayout, QWidget

from analysis.formatting import THIN_SPACE
from app.presenters.base import Chip, Tone
from app.presenters.campaign.presenter import CampaignPresenter
from app.presenters.campaign.state import CampaignSummary, NextTest, RepeatabilityRow, RunRow
from app.qt.theme import TextRole
from app.qt.widgets.inputs import make_button
from app.qt.widgets.layouts import STRETCH, make_column, make_row
from app.qt.widgets.text import label, show_chip
from messages.i18n import gettext

_SPREAD_SHOWN = 8


class Sections(QWidget):
    """Built anew whenever the campaign was summed up."""

    def __init__(self, summary: CampaignSummary, presenter: CampaignPresenter) -> None:
        super().__init__()
        self._presenter = presenter
        layout = QVBoxLayout(self)
        layout.setContentsMargins(16, 16, 16, 16)
        layout.setSpacing(8)
        if summary.next_test is not None:
            self._add_next(layout, summary.next_test)
        self._add_effects(layout, summary)
        self._add_spread(layout, summary.repeatability)
        self._add_left_out(layout, summary.excluded)
        _add_lines(layout, gettext("Without a result"), summary.faults, Tone.BAD)
        _add_lines(layout, gettext("To know"), summary.warnings, Tone.WARN)
        layout.addStretch(1)

    def _add_next(self, layout: QVBoxLayout, test: NextTest) -> None:
        _section(layout, gettext("Next test"))
        if test.series:
            layout.addWidget(label(test.series, TextRole.NUMBER))
        layout.addWidget(label(test.reason, wrap=True))
        for text in test.expectations:
            layout.addWidget(label(text, muted=True, wrap=True))
        if test.series:
            show_record = self._presenter.navigator.show_record
            record = make_button(gettext("Record"), show_record, gettext("Go to Record"))
            layout.addWidget(record, 0, Qt.AlignmentFlag.AlignLeft)

    def _add_effects(self, layout: QVBoxLayout, summary: CampaignSummary) -> None:
        if not summary.effects:
            return
        _section(layout, gettext("What f<sub>d</sub> depends on"))
        for effect in summary.effects:
            line = make_row(
                label(effect.cause, TextRole.STRONG),
                STRETCH,
                label(effect.conclusion, TextRole.STRONG if effect.is_found else TextRole.TEXT),
                spacing=6,
            )
            layout.addLayout(line)
            layout.addWidget(label(effect.sentence, muted=True, wrap=True))

    def _add_spread(self, layout: QVBoxLayout, rows: tuple[RepeatabilityRow, ...]) -> None:
        if not rows:
            return
        _section(layout, gettext("How f<sub>d</sub> repeats"))
        grid = QGridLayout()
        grid.setHorizontalSpacing(12)
        grid.setVerticalSpacing(4)
        for column, title in enumerate(
            (gettext("series"), gettext("runs"), gettext("scatter"), gettext("Birge"))
        ):
            grid.addWidget(label(title, TextRole.LABEL, muted=True), 0, column, _side(column))
        line = 1
        for row in rows[:_SPREAD_SHOWN]:
            for column, text in enumerate((row.label, str(row.runs), row.scatter, row.birge_ratio)):
                grid.addWidget(label(text), line, column, _side(column))
            if row.status.tone is not Tone.OK:
                grid.addWidget(_chip(row.status, wrap=True), line + 1, 0, 1, 4)
            line += 2
        grid.setColumnStretch(0, 1)
        layout.addLayout(grid)
        more = len(rows) - _SPREAD_SHOWN
        if more > 0:
            words = gettext("{count} more series repeat as well or better.", count=more)
            layout.addWidget(label(words, TextRole.LABEL, muted=True, wrap=True))

    def _add_left_out(self, layout: QVBoxLayout, lines: tuple[RunRow, ...]) -> None:
        if not lines:
            return
        _section(layout, gettext("Left out"))
        for line in lines:
            row = QHBoxLayout()
            row.addWidget(label(f"{line.name}: {line.reason}", wrap=True), 1)
            if line.can_return:
                back = make_button(gettext("Take in"), partial(self._presenter.include_run, line.path))
                back.setAccessibleName(gettext("Let {run} count again", run=line.name))
                row.addWidget(back, 0, Qt.AlignmentFlag.AlignTop)
            layout.addLayout(row)


def _add_lines(layout: QVBoxLayout, title: str, lines: tuple[str, ...], tone: Tone) -> None:
    if not lines:
        return
    _section(layout, title)
    for text in lines:
        layout.addWidget(_chip(Chip(text, tone), wrap=True))


def _section(layout: QVBoxLayout, title: str) -> None:
    layout.addSpacing(8)
    layout.addWidget(label(title, TextRole.HEADING))


def _chip(chip: Chip, *, wrap: bool = False) -> QLabel:
    made = label(wrap=wrap)
    show_chip(made, chip)
    return made


def _side(column: int) -> Qt.AlignmentFlag:
    return Qt.AlignmentFlag.AlignRight if column else Qt.AlignmentFlag.AlignLeft


class SelectedRuns(QWidget):
    """Hidden while no series is chosen."""

    def __init__(self, presenter: CampaignPresenter) -> None:
        super().__init__()
        self._presenter = presenter
        self._title = label(role=TextRole.HEADING)
        self._lines = QVBoxLayout()
        self._lines.setSpacing(8)
        self._reason = QLineEdit()
        self._reason.setPlaceholderText(gettext("Why a run is left out"))
        self._reason.setAccessibleName(gettext("Reason for leaving a run out"))
        layout = QVBoxLayout(self)
        layout.setContentsMargins(16, 16, 16, 8)
        layout.setSpacing(8)
        layout.addWidget(self._title)
        layout.addLayout(self._lines)
        layout.addWidget(self._reason)
        self.hide()

    def show_runs(self, series: str, runs: tuple[RunRow, ...]) -> None:
        self.setVisible(bool(runs))
        self._title.setText(gettext("Runs of {series}", series=series))
        while (item := self._lines.takeAt(0)) is not None:
            if (widget := item.widget()) is not None:
                widget.deleteLater()
        for run in runs:
            self._lines.addWidget(self._line(run))

    def clear_reason(self) -> None:
        self._reason.clear()

    def _line(self, run: RunRow) -> QWidget:
        made = QWidget()
        open_run = partial(self._presenter.navigator.open_run, run.path)
        name = make_button(run.name, open_run, gettext("Show this run on Identify"))
        name.setProperty("role", "row")
        out = make_button(
            gettext("Leave out"),
            lambda: self._presenter.exclude_run(run.path, self._reason.text()),
            gettext("Leave this run out, for the reason below"),
        )
        out.setAccessibleName(gettext("Leave {run} out", run=run.name))
        chip = _chip(run.status)
        below = make_row(
            label(f"f<sub>d</sub> = {run.friction}{THIN_SPACE}{run.uncertainty}"),
            chip,
            STRETCH,
            out,
            spacing=6,
        )
        make_column(name, below, spacing=2, of=made)
        return made
