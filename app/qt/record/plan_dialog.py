"""Dialog of the series plan, as text and as progress of each series. It does not block the window."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDialog, QGridLayout, QPlainTextEdit, QWidget

from app.presenters.base import Chip, Tone
from app.presenters.record.presenter import RecordPresenter
from app.presenters.record.state import PlanEdited, PlanState
from app.qt.theme import TextRole
from app.qt.widgets.inputs import CheckBox, make_button
from app.qt.widgets.layouts import STRETCH, make_column, make_row, make_scroll_area
from app.qt.widgets.text import label, show_chip
from messages.i18n import N_, gettext

_HELP = N_(
    "Series and repeats, in the order in which they are to be measured: 1FFM0 x3, 1FFM1 x3. "
    "* and ? stand for any part: * x3 is every series of the stand three times. "
    "What is done is counted from the folder of runs; what lies in its trash does not count."
)
_COLUMNS = 4


class PlanDialog(QDialog):
    def __init__(self, presenter: RecordPresenter, parent: QWidget) -> None:
        super().__init__(parent)
        self._presenter = presenter
        self._text = QPlainTextEdit()
        self._text.setAccessibleName(gettext("Series plan"))
        self._text.setMaximumHeight(96)
        self._text.setTabChangesFocus(True)
        self._message = label(wrap=True)
        self._simulated = CheckBox(gettext("Simulated runs count, too"))
        self._simulated.clicked.connect(presenter.count_simulated)
        self._series = QGridLayout()
        hint = gettext("Plan anew; runs that are there count (Ctrl+Enter)")
        self._save = make_button(gettext("Use this plan"), self._use, hint, primary=True)
        self._save.setDefault(True)
        self._save.setShortcut("Ctrl+Return")
        self._close = make_button(gettext("Close"), self.close)
        self._lay_out()
        self.setWindowTitle(gettext("Series plan"))
        self.resize(560, 520)

    def open_with(self, plan: PlanState) -> None:
        self._text.setPlainText(plan.text.replace(" x", "\u00a0x"))  # no repeats on a line of their own
        self.show_plan(plan)
        self.show()
        self.raise_()
        self._text.setFocus()

    def show_plan(self, plan: PlanState) -> None:
        self._simulated.setChecked(plan.counts_simulated)
        words = gettext("{done} of {planned} runs are there", done=plan.done, planned=plan.planned)
        if plan.error:
            show_chip(self._message, Chip(plan.error, Tone.BAD))
        else:
            show_chip(self._message, Chip(words if plan.planned else gettext("Nothing is planned")))
        while (item := self._series.takeAt(0)) is not None:
            if (gone := item.widget()) is not None:
                gone.deleteLater()
        for number, one in enumerate(plan.progress):
            shown = label(f"{one.series}  {one.dots}", muted=one.is_full)
            shown.setAccessibleName(one.description)
            self._series.addWidget(shown, number // _COLUMNS, number % _COLUMNS)

    def _use(self) -> None:
        self._presenter.dispatch(PlanEdited(self._text.toPlainText()))
        if not self._presenter.state.plan.error:
            self.close()

    def _lay_out(self) -> None:
        inside = QWidget()
        self._series.setHorizontalSpacing(16)
        self._series.setAlignment(Qt.AlignmentFlag.AlignTop)
        inside.setLayout(self._series)
        make_column(
            label(gettext("Series plan"), TextRole.HEADING),
            label(gettext(_HELP), muted=True, wrap=True),
            self._text,
            make_row((self._message, 1), self._simulated, spacing=12),
            (make_scroll_area(inside, is_column=False), 1),
            make_row(STRETCH, self._close, self._save, spacing=12),
            spacing=12,
            margins=(16, 16),
            of=self,
        )
