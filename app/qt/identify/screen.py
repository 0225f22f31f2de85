"""The Identify screen: curves at the left, results at the right; or what is missing."""

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFrame, QPushButton, QSplitter, QStackedWidget, QTabBar, QWidget

from app.presenters.base import Chip, Tone
from app.presenters.identify.presenter import IdentifyPresenter
from app.presenters.identify.state import Cursors, IdentifyState, PlotTab
from app.qt.identify.cursors import CursorBar
from app.qt.identify.export_menu import ExportMenu, ReportLine
from app.qt.identify.plot_tabs import PlotTabs
from app.qt.identify.results_panel import ResultsPanel
from app.qt.identify.scan_plot import ScanPlot
from app.qt.theme import TextRole, Theme
from app.qt.widgets.inputs import ProgressBar, make_button
from app.qt.widgets.layouts import STRETCH, make_column, make_frame, make_row, make_scroll_area
from app.qt.widgets.shortcuts import bind_button
from app.qt.widgets.text import label, set_text_or_hide, show_chip
from app.qt.window_geometry import persist_layout
from messages.i18n import N_, gettext

_COLUMN_WIDTH, _WIDEST_COLUMN = 384, 640
_USUAL_PLOTS = 800
_NO_MOTION = N_("The other tabs need the fitted motion of both masses; this run has none.")
_NO_SLIPS = N_("Friction by slip needs three slips of gauge 2, in both directions.")
_EMPTY = N_("Here a recording is compared with its simulation. Record a pullback, or open a recording.")
_OTHER_KINDS = {None: "", "one-mass": N_("Analyse as one mass"), "two-mass": N_("Analyse as two masses")}


class IdentifyScreen(QWidget):
    """Draws `IdentifyState`; `ask_for_run` lets the operator choose a recording, `export_run` exports one."""

    def __init__(
        self,
        theme: Theme,
        presenter: IdentifyPresenter,
        ask_for_run: Callable[[], None],
        export_run: Callable[[str], None] = lambda _path: None,
    ) -> None:
        super().__init__()
        self._presenter = presenter
        self._shown = IdentifyState()
        self._shown_tab: tuple[PlotTab, Cursors | None] | None = None
        self._title = label(role=TextRole.HEADING)
        self._title.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self._open = make_button(gettext("Open another recording"), ask_for_run)
        self._kind = make_button("", presenter.analyse_as_alternative)
        self._cursors = QPushButton(gettext("Cursors"))
        self._cursors.setCheckable(True)
        bind_button(self._cursors, "C", gettext("Two cursors, and the differences between them"), self)
        self._export = ExportMenu(presenter.report, export_run)
        self._export.add_keys(self)
        self._report_line = ReportLine()
        presenter.report.attach(self._export)
        presenter.report.attach(self._report_line)
        self._tabs = QTabBar()
        self._no_motion = label(gettext(_NO_MOTION), TextRole.LABEL, muted=True, wrap=True)
        self._no_motion.setContentsMargins(16, 0, 16, 0)
        self._plots = PlotTabs(theme)
        self._readings = CursorBar()
        self._scan = ScanPlot(theme, presenter.poll)
        self._no_scan = label(muted=True, wrap=True)
        self._no_scan.setContentsMargins(16, 16, 16, 0)
        self._column = make_scroll_area(name=gettext("What was found"))
        self._waiting = _WaitingPage(presenter, ask_for_run)
        self._stack = QStackedWidget()
        self._stack.addWidget(self._waiting)
        self._stack.addWidget(self._results_page())
        top = make_row((self._title, 1), self._cursors, self._kind, self._export, self._open, spacing=8)
        top.setContentsMargins(4, 0, 0, 0)
        make_column(top, self._report_line, (self._stack, 1), spacing=8, margins=(8, 8), of=self)
        self._connect(presenter)

    def show_state(self, state: IdentifyState) -> None:
        old, self._shown = self._shown, state
        self._title.setText(state.title or gettext("No recording is open"))
        has_run = state.curves is not None and state.progress is None
        self._open.setVisible(has_run)
        self._cursors.setVisible(has_run)
        self._export.setVisible(has_run)
        self._kind.setVisible(has_run and state.alternative_kind is not None)
        if not has_run:
            self._waiting.show_state(state)
            self._stack.setCurrentIndex(0)
            return
        if state.curves is not old.curves:
            self._show_run(state)
        elif state.manual_fit is not old.manual_fit:
            self._plots.curves.show_manual_fit(state.manual_fit)
            self._scan.show_manual_fit(state.manual_fit, state.manual_fit_text)
        elif state.model_note != old.model_note:
            self._show_results(state)
        elif state.classical != old.classical:
            self._results.show_classical(state.classical)
        if (state.tab, state.cursors) != self._shown_tab:  # not for each step of a dragged handle
            self._show_tab(state)
        self._stack.setCurrentIndex(1)

    def _show_run(self, state: IdentifyState) -> None:
        if state.curves is None:
            return
        self._kind.setText(gettext(_OTHER_KINDS[state.alternative_kind]))
        self._plots.curves.show_curves(state.curves)
        self._plots.set_run_name(Path(state.title).stem)
        for index, tab in enumerate(PlotTab):
            is_drawn, reason = _drawn(tab, state)
            self._tabs.setTabEnabled(index, is_drawn)
            self._tabs.setTabToolTip(index, "" if is_drawn else gettext(reason))
        if state.slip_plots is not None:
            self._plots.slips.show_plots(state.slip_plots)
        self._no_motion.setVisible(state.motion is None)
        if state.motion is not None:
            self._plots.show_motion(state.motion, state.curves.slips)
        self._scan.show_scan(state.scan)
        set_text_or_hide(self._no_scan, state.no_scan_reason)
        self._show_results(state)

    def _show_results(self, state: IdentifyState) -> None:
        self._results = ResultsPanel(state, self._presenter.select_model)
        self._column.setWidget(self._results)

    def _show_tab(self, state: IdentifyState) -> None:
        self._shown_tab = state.tab, state.cursors
        self._tabs.setCurrentIndex(list(PlotTab).index(state.tab))
        self._plots.show_tab(state.tab, state.cursors)
        self._cursors.setChecked(state.cursors is not None)
        self._readings.show_cursors(state.cursors)

    def _toggle_cursors(self) -> None:
        self._presenter.toggle_cursors(self._plots.span())
        if self._cursors.isChecked():
            self._plots.setFocus()

    def _connect(self, presenter: IdentifyPresenter) -> None:
        self._tabs.currentChanged.connect(lambda index: presenter.set_tab(list(PlotTab)[index]))
        self._cursors.clicked.connect(self._toggle_cursors)
        self._plots.curves.span_changed.connect(presenter.set_visible_span)
        self._plots.cursor_moved.connect(presenter.move_cursor)
        self._plots.cursor_stepped.connect(presenter.step_cursor)
        self._plots.cursor_activated.connect(presenter.activate_cursor)
        self._scan.friction_set.connect(presenter.set_friction)
        self._scan.reset_requested.connect(presenter.reset_friction)

    def _results_page(self) -> QWidget:
        page = QSplitter(Qt.Orientation.Horizontal)
        for title in PlotTab:
            self._tabs.addTab(gettext(title.value))
        self._tabs.setDrawBase(False)
        self._tabs.setExpanding(False)
        self._tabs.setAccessibleName(gettext("What is drawn"))
        page.addWidget(make_frame(self._tabs, self._no_motion, self._readings, self._plots, spacing=6))
        side = make_frame(self._scan, self._no_scan, self._column, spacing=6)
        side.setMinimumWidth(_COLUMN_WIDTH)
        side.setMaximumWidth(_WIDEST_COLUMN)
        page.addWidget(side)
        page.setChildrenCollapsible(False)
        page.setHandleWidth(8)
        page.setStretchFactor(0, 1)
        page.setStretchFactor(1, 0)
        page.setSizes([_USUAL_PLOTS, _COLUMN_WIDTH])
        persist_layout(page, "identify")
        return page


def _drawn(tab: PlotTab, state: IdentifyState) -> tuple[bool, str]:
    """Whether a tab has something to show, and why it may have nothing."""
    if tab is PlotTab.FRICTION:
        return state.slip_plots is not None, _NO_SLIPS
    return tab is PlotTab.DISPLACEMENT or state.motion is not None, _NO_MOTION


class _WaitingPage(QFrame):
    """In place of the curves: progress, a failure, or what will be here."""

    def __init__(self, presenter: IdentifyPresenter, ask_for_run: Callable[[], None]) -> None:
        super().__init__()
        self.setProperty("role", "card")
        self._words = label(role=TextRole.HEADING, wrap=True)
        self._words.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._bar = ProgressBar()
        self._bar.setFixedWidth(320)
        self._cancel = make_button(gettext("Cancel"), presenter.cancel)
        self._kind = make_button("", presenter.analyse_as_alternative)
        self._open = make_button(gettext("Open a recording"), ask_for_run)
        layout = make_column(STRETCH, self._words, spacing=16, margins=(24, 24), of=self)
        for widget in (self._bar, self._cancel, self._kind, self._open):
            layout.addWidget(widget, 0, Qt.AlignmentFlag.AlignHCenter)
        layout.addStretch(1)

    def show_state(self, state: IdentifyState) -> None:
        progress = state.progress
        chip = Chip(state.failure or gettext(_EMPTY), Tone.BAD if state.failure else Tone.PLAIN)
        show_chip(self._words, chip if progress is None else Chip(progress.text))
        self._open.setVisible(progress is None)
        self._kind.setVisible(progress is None and state.alternative_kind is not None)
        self._kind.setText(gettext(_OTHER_KINDS[state.alternative_kind]))
        self._bar.show_progress(progress)
        self._cancel.setVisible(progress is not None)
