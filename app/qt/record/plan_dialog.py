"""The series plan as a text, with what it comes to. It stays open beside the window and stops nothing."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QDialog,
    QGridLayout,
    QHBoxLayout,
    QPlainTextEdit,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from app.presenters.base import Chip, Tone
from app.presenters.record.presenter import RecordPresenter
from app.presenters.record.state import PlanEdited, PlanState
from app.qt.theme import TextRole
from app.qt.widgets.layouts import make_scroll_area
from app.qt.widgets.text import label, show_chip
from messages.i18n import N_, gettext

_HOW = N_(
    "Series and repeats, in the order in which they are to be measured: 1FFM0 x3, 1FFM1 x3. "
    "* and ? stand for any part: * x3 is every series of the stand three times. "
    "What is done is counted from the folder of runs; what lies in its trash does not count."
)
_COLUMNS = 4


class PlanDialog(QDialog):
    """Edits the plan, and shows all of it with what is done."""

    def __init__(self, presenter: RecordPresenter, parent: QWidget) -> None:
        super().__init__(parent)
        self._presenter = presenter
        self._text = QPlainTextEdit()
        self._text.setAccessibleName(gettext("Series plan"))
        self._text.setMaximumHeight(96)
        self._text.setTabChangesFocus(True)
        self._message = label(wrap=True)
        self._all = QGridLayout()
        self._save = QPushButton(gettext("Use this plan"))
        self._save.setDefault(True)
        self._save.setProperty("primary", "true")
        self._save.setToolTip(gettext("Plan anew; runs that are there count (Ctrl+Enter)"))
        self._save.setShortcut("Ctrl+Return")
        self._close = QPushButton(gettext("Close"))
        self._save.clicked.connect(self._use)
        self._close.clicked.connect(self.close)
        self._lay_out()
        self.setWindowTitle(gettext("Series plan"))
        self.resize(560, 520)

    def open_with(self, plan: PlanState) -> None:
        """Show the plan as it stands, to be edited."""
        self._text.setPlainText(plan.text.replace(" x", "\u00a0x"))  # no repeats on a line of their own
        self.show_plan(plan)
        self.show()
        self.raise_()
        self._text.setFocus()

    def show_plan(self, plan: PlanState) -> None:
        """Show what is done, and what is wrong with what was typed."""
        words = gettext("{done} of {planned} runs are there", done=plan.done, planned=plan.planned)
        if plan.error:
            show_chip(self._message, Chip(plan.error, Tone.BAD))
        else:
            show_chip(self._message, Chip(words if plan.planned else gettext("Nothing is planned")))
        while (item := self._all.takeAt(0)) is not None:
            if (gone := item.widget()) is not None:
                gone.deleteLater()
        for number, one in enumerate(plan.progress):
            shown = label(f"{one.series}  {one.dots}", muted=one.is_full)
            shown.setAccessibleName(one.description)
            self._all.addWidget(shown, number // _COLUMNS, number % _COLUMNS)

    def _use(self) -> None:
        self._presenter.dispatch(PlanEdited(self._text.toPlainText()))
        if not self._presenter.state.plan.error:
            self.close()

    def _lay_out(self) -> None:
        layout = QVBoxLayout(self)
        layout.setContentsMargins(16, 16, 16, 16)
        layout.setSpacing(12)
        layout.addWidget(label(gettext("Series plan"), TextRole.HEADING))
        layout.addWidget(label(gettext(_HOW), muted=True, wrap=True))
        layout.addWidget(self._text)
        layout.addWidget(self._message)
        inside = QWidget()
        self._all.setHorizontalSpacing(16)
        self._all.setAlignment(Qt.AlignmentFlag.AlignTop)
        inside.setLayout(self._all)
        layout.addWidget(make_scroll_area(inside, is_column=False), 1)
        buttons = QHBoxLayout()
        buttons.addStretch(1)
        buttons.addWidget(self._close)
        buttons.addWidget(self._save)
        layout.addLayout(buttons)
