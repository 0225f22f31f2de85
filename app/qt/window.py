"""The main window: side bar, notice, and the screens, each built when first shown."""

from PySide6.QtCore import QSize, Qt, QTimer
from PySide6.QtGui import QCloseEvent, QKeySequence, QShortcut
from PySide6.QtWidgets import (
    QDialog,
    QFileDialog,
    QFrame,
    QHBoxLayout,
    QMainWindow,
    QStackedWidget,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from app.presenters.window import Screen, WindowPresenter, WindowState
from app.qt.icons import icon
from app.qt.theme import Theme, Type, font
from app.qt.widgets.notice import NoticeBar

TICK_MS = 16
_RAIL = {
    Screen.START: ("Start", "house"),
    Screen.RECORD: ("Record", "record"),
    Screen.IDENTIFY: ("Identify", "chart-line"),
    Screen.RUNS: ("Runs", "stack"),
    Screen.GAUGES: ("Gauges", "gauge"),
    Screen.STAND: ("Stand", "flask"),
}


class MainWindow(QMainWindow):
    """Draws `WindowState`, owns the timer that makes the presenters look for news.

    Parameters
    ----------
    theme : Theme
    presenter : WindowPresenter
        Closed with the window.
    """

    def __init__(self, theme: Theme, presenter: WindowPresenter) -> None:
        super().__init__()
        self._theme = theme
        self._presenter = presenter
        self._screens: dict[Screen, QWidget] = {}
        self._export: QDialog | None = None
        self._stack = QStackedWidget()
        self._notice = NoticeBar()
        self._rail = {screen: self._rail_button(screen, i) for i, screen in enumerate(Screen, start=1)}
        self._lay_out()
        self._notice.acted.connect(presenter.act_on_notice)
        self._notice.dismissed.connect(presenter.dismiss_notice)
        QShortcut(QKeySequence(QKeySequence.StandardKey.Open), self).activated.connect(self.ask_for_run)
        theme.changed.connect(self._restyle)
        self._restyle()
        self.setWindowTitle("Slipstand")
        self.setMinimumSize(1024, 640)
        self.resize(1280, 800)
        presenter.attach(self)
        self._timer = QTimer(self)
        self._timer.setTimerType(Qt.TimerType.PreciseTimer)
        self._timer.timeout.connect(presenter.tick)
        self._timer.start(TICK_MS)

    def show_state(self, state: WindowState) -> None:
        """Show the screen that is wanted, and the notice."""
        self._stack.setCurrentWidget(self._screen(state.screen))
        self._rail[state.screen].setChecked(True)
        self._notice.show_notice(state.notice)

    def ask_for_run(self) -> None:
        """Let the operator choose a recording. The dialog waits for nobody: recording goes on."""
        dialog = QFileDialog(self, "Open a recording", self._presenter.start.state.recordings)
        dialog.setNameFilters(["Runs (*.h5)", "All files (*)"])
        dialog.setFileMode(QFileDialog.FileMode.ExistingFile)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.fileSelected.connect(self._presenter.open_run)
        dialog.open()

    def closeEvent(self, event: QCloseEvent) -> None:  # noqa: N802
        """Disappear at once, then finish what is being recorded and end all processes."""
        self._timer.stop()
        self.hide()
        self._presenter.close()
        super().closeEvent(event)

    def _ask_for_export(self) -> None:
        """Let the operator choose what becomes of the selected runs, beside the window."""
        from app.qt.runs.export_dialog import ExportDialog

        if not self._presenter.runs.open_export():
            return
        if self._export is None:
            self._export = ExportDialog(self._presenter.runs.export, self)
            self._presenter.runs.export.attach(self._export)
        self._export.show()
        self._export.raise_()

    def _screen(self, screen: Screen) -> QWidget:
        if screen not in self._screens:
            made = self._make(screen)
            self._screens[screen] = made
            self._stack.addWidget(made)
        return self._screens[screen]

    def _make(self, screen: Screen) -> QWidget:
        """Build a screen. Those with plots import their library only now."""
        if screen is Screen.START:
            from app.qt.start.screen import StartScreen

            start = StartScreen(self._presenter.start, self.ask_for_run)
            self._presenter.start.attach(start)
            return start
        if screen is Screen.RECORD:
            from app.qt.record.screen import RecordScreen

            record = RecordScreen(self._theme, self._presenter.record)
            self._presenter.record.attach(record)
            return record
        if screen is Screen.RUNS:
            from app.qt.runs.screen import RunsScreen

            runs = RunsScreen(self._theme, self._presenter.runs, self._ask_for_export)
            self._presenter.runs.attach(runs)
            return runs
        if screen is Screen.GAUGES:
            from app.qt.gauges.screen import GaugesScreen

            gauges = GaugesScreen(self._theme, self._presenter.gauges)
            self._presenter.gauges.attach(gauges)
            return gauges
        if screen is Screen.STAND:
            from app.qt.stand.screen import StandScreen

            stand = StandScreen(self._presenter.stand)
            self._presenter.stand.attach(stand)
            return stand
        from app.qt.identify.screen import IdentifyScreen

        identify = IdentifyScreen(self._theme, self._presenter.identify, self.ask_for_run)
        self._presenter.identify.attach(identify)
        return identify

    def _rail_button(self, screen: Screen, number: int) -> QToolButton:
        name, _ = _RAIL[screen]
        button = QToolButton()
        button.setProperty("role", "rail")
        button.setText(name)
        button.setFont(font(Type.LABEL))
        button.setCheckable(True)
        button.setAutoExclusive(True)
        button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextUnderIcon)
        button.setIconSize(QSize(24, 24))
        button.setFixedWidth(72)
        button.setToolTip(f"{name} (Ctrl+{number})")
        button.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        button.clicked.connect(lambda: self._presenter.go_to(screen))
        QShortcut(QKeySequence(f"Ctrl+{number}"), self).activated.connect(button.click)
        return button

    def _restyle(self) -> None:
        tokens = self._theme.tokens
        for screen, button in self._rail.items():
            button.setIcon(icon(_RAIL[screen][1], tokens.muted, active=tokens.accent))

    def _lay_out(self) -> None:
        rail = QFrame()
        rail.setProperty("role", "rail")
        buttons = QVBoxLayout(rail)
        buttons.setContentsMargins(8, 8, 8, 8)
        buttons.setSpacing(4)
        for button in self._rail.values():
            buttons.addWidget(button)
        buttons.addStretch(1)
        content = QVBoxLayout()
        content.setSpacing(0)
        content.addWidget(self._notice)
        content.addWidget(self._stack, 1)
        middle = QWidget()
        layout = QHBoxLayout(middle)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(0)
        layout.addWidget(rail)
        layout.addLayout(content, 1)
        self.setCentralWidget(middle)
