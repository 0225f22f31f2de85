"""The runs of the chosen series: look at one, or leave it out with a reason."""

from PySide6.QtWidgets import QLineEdit, QPushButton, QVBoxLayout, QWidget

from analysis.formatting import THIN_SPACE
from app.presenters.campaign.presenter import CampaignPresenter
from app.presenters.campaign.state import RunRow
from app.qt.theme import TextRole
from app.qt.widgets.layouts import STRETCH, make_column, make_row
from app.qt.widgets.text import label, show_chip
from messages.i18n import gettext


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
        name = QPushButton(run.name)
        name.setProperty("role", "row")
        name.setToolTip(gettext("Show this run on Identify"))
        name.clicked.connect(lambda: self._presenter.navigator.open_run(run.path))
        out = QPushButton(gettext("Leave out"))
        out.setAccessibleName(gettext("Leave {run} out", run=run.name))
        out.setToolTip(gettext("Leave this run out, for the reason below"))
        out.clicked.connect(lambda: self._presenter.exclude_run(run.path, self._reason.text()))
        chip = label()
        show_chip(chip, run.status)
        below = make_row(
            label(f"f<sub>d</sub> = {run.friction}{THIN_SPACE}{run.uncertainty}"),
            chip,
            STRETCH,
            out,
            spacing=6,
        )
        make_column(name, below, spacing=2, of=made)
        return made
