"""Dialog that looks for amplifiers on all ports, and connects to one. It does not block the window."""

from PySide6.QtWidgets import QDialog, QWidget

from app.presenters.gauges.ports import PortsPresenter
from app.presenters.gauges.state import PortsState
from app.qt.gauges.ports_panel import PortsPanel
from app.qt.theme import TextRole
from app.qt.widgets.inputs import make_button
from app.qt.widgets.layouts import STRETCH, make_column, make_row
from app.qt.widgets.text import label
from messages.i18n import gettext

_SIZE = 640, 520


class FindDialog(QDialog):
    def __init__(self, presenter: PortsPresenter, parent: QWidget) -> None:
        super().__init__(parent)
        self._presenter = presenter
        self._is_probing = False
        panel = self._panel = PortsPanel(presenter)
        panel.add_keys(self)
        panel.chosen.connect(self.close)
        presenter.attach(panel)
        presenter.attach(self)
        self.finished.connect(presenter.cancel)
        title = label(gettext("Find my amplifier"), TextRole.HEADING)
        title.setContentsMargins(16, 12, 16, 0)
        foot = make_row(STRETCH, make_button(gettext("Close"), self.close), margins=(16, 12))
        make_column(title, (panel, 1), foot, spacing=8, of=self)
        self.setWindowTitle(gettext("Find my amplifier"))
        self.resize(*_SIZE)

    def show_state(self, state: PortsState) -> None:
        """Focus what can be connected once all ports were looked at, so that Enter connects it."""
        if self._is_probing and not state.progress:
            self._panel.focus_found()
        self._is_probing = bool(state.progress)

    def look(self) -> None:
        """Show the dialog, and look at the ports."""
        self.show()
        self.raise_()
        self._presenter.probe()
