"""The main window: side bar, notice, and the screens, each built when first shown."""

import importlib
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from PySide6.QtCore import QSize, Qt, QTimer, Signal
from PySide6.QtGui import QCloseEvent, QFontDatabase, QGuiApplication, QHideEvent
from PySide6.QtWidgets import (
    QApplication,
    QDialog,
    QFileDialog,
    QFrame,
    QPlainTextEdit,
    QStackedWidget,
    QToolButton,
    QWidget,
)
from shiboken6 import isValid

from app.presenters.base import Notice
from app.presenters.screens import Screen
from app.presenters.window import WindowPresenter, WindowState
from app.qt.keyboard import KeyboardWindow
from app.qt.menu import fill_menu
from app.qt.settings_screen import SettingsScreen
from app.qt.stand_screen import StandScreen
from app.qt.start_screen import StartScreen
from app.qt.theme import SCHEMES, TextRole, Theme, font, set_property
from app.qt.widgets.icons import icon
from app.qt.widgets.inputs import connect_chosen, make_button
from app.qt.widgets.layouts import STRETCH, make_column, make_row
from app.qt.widgets.shortcuts import HelpDialog, add_shortcut, bind_button, list_shortcuts
from app.qt.widgets.text import label, set_text_or_hide
from app.qt.window_geometry import WindowGeometry
from config.schema import WindowLayout
from messages.i18n import N_, gettext

if TYPE_CHECKING:  # its import loads drivers, which the first paint does without
    from app.qt.find_dialog import FindDialog

TICK_MS = 16
_SMALLEST = QSize(1024, 640)
_AT_FOOT = (Screen.SETTINGS,)


class MainWindow(KeyboardWindow):
    """Shows `WindowState`; a timer calls the presenter's `tick`. The presenter is closed with the window."""

    closed = Signal(WindowLayout)

    def __init__(self, theme: Theme, presenter: WindowPresenter, place: WindowLayout | None = None) -> None:
        super().__init__()
        self._theme = theme
        self._presenter = presenter
        self._geometry = WindowGeometry(place or WindowLayout())
        self._shown = replace(presenter.state, is_closing=False)  # Ctrl-C may have come by now
        self._screens: dict[Screen, QWidget] = {}
        self._find: FindDialog | None = None
        self._stand: QDialog | None = None
        self._export: QDialog | None = None
        self._import: QDialog | None = None
        self._help: QDialog | None = None
        self._awaits_last_screen = False
        self._stack = QStackedWidget()
        self._notice = NoticeBar(presenter)
        self._rail = {screen: self._rail_button(screen) for screen in Screen}
        self._menu = self._menu_button()
        self._lay_out()
        self._add_keys()
        theme.changed.connect(self._restyle)
        self._restyle()
        self.setMinimumSize(self._geometry.within_screen(_SMALLEST))
        self._geometry.restore_window(self)
        presenter.attach(self)
        self._timer = QTimer(self)
        self._timer.setTimerType(Qt.TimerType.PreciseTimer)
        self._timer.timeout.connect(presenter.tick)
        self._timer.start(TICK_MS)

    def show_state(self, state: WindowState) -> None:
        old, self._shown = self._shown, state
        if state.theme != old.theme:
            self._theme.fix(SCHEMES[state.theme])
        screen = self._screen(state.screen)
        if self._stack.currentWidget() is not screen or state.screen is not old.screen:
            self._stack.setCurrentWidget(screen)
            self.focus_home()
        self._rail[state.screen].setChecked(True)
        self._notice.show_notice(state.notice, state.more_notices)
        if state.is_closing and not old.is_closing:
            QTimer.singleShot(0, self, self.close)
        self.setWindowTitle(state.title)

    def home(self) -> QWidget | None:
        return self._stack.currentWidget()

    def show_last_screen_soon(self) -> None:
        """Show the screen of the last session once the window is there; it is not forgotten before."""
        self._awaits_last_screen = True
        QTimer.singleShot(0, self, self.show_last_screen)

    def show_last_screen(self) -> None:
        """Show the screen of the last session, unless another one is shown by now."""
        self._awaits_last_screen = False
        known = [screen for screen in Screen if screen.value == self._geometry.screen]
        if known and self._shown.screen is Screen.START:
            self._presenter.show_screen(known[0])

    def ask_for_run(self) -> None:
        """Let the operator choose a run file; the dialog does not block a recording."""
        dialog = QFileDialog(self, gettext("Open a recording"), self._presenter.start.state.recordings)
        dialog.setNameFilters([gettext("Runs (*.h5)"), gettext("All files (*)")])
        dialog.setFileMode(QFileDialog.FileMode.ExistingFile)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        connect_chosen(dialog, self._presenter.open_run)
        dialog.open()

    def find_amplifier(self) -> None:
        from app.qt.find_dialog import FindDialog

        if self._find is None:
            self._find = FindDialog(self._presenter.gauges.ports, self)
        self._find.look()

    def ask_for_export(self) -> None:
        """Export the runs that are selected on Runs."""
        if self._presenter.runs.open_export():
            self._show_export()

    def export_run(self, path: str) -> None:
        self._presenter.runs.export_dialog.open((path,), str(Path(path).parent))
        self._show_export()

    def _show_export(self) -> None:
        from app.qt.runs.export_dialog import ExportDialog

        if self._export is None:
            self._export = ExportDialog(self._presenter.runs.export_dialog, self)
            self._presenter.runs.export_dialog.attach(self._export)
        self._export.show()
        self._export.raise_()

    def show_import(self) -> None:
        from app.qt.runs.import_dialog import ImportDialog

        if self._import is None:
            self._import = ImportDialog(self._theme, self._presenter.runs.import_dialog, self)
            self._presenter.runs.import_dialog.attach(self._import)
        self._import.show()
        self._import.raise_()

    def edit_stand(self) -> None:
        from app.qt.stand_settings_dialog import StandSettingsDialog

        if self._stand is None:
            self._stand = StandSettingsDialog(self._presenter.stand_settings, self)
            self._presenter.stand_settings.attach(self._stand)
        self._stand.show()
        self._stand.raise_()

    def show_help(self) -> None:
        if self._help is not None:
            self._help.close()
        screen = self._shown.screen
        title = gettext("On {screen}", screen=gettext(screen.label))
        groups = [
            (title, list_shortcuts(self._screens[screen])),
            (gettext("Everywhere"), list_shortcuts(self, own=True)),
        ]
        self._help = HelpDialog([(title, keys) for title, keys in groups if keys], self)
        self._help.destroyed.connect(lambda: setattr(self, "_help", None))
        self._help.show()

    def closeEvent(self, event: QCloseEvent) -> None:  # noqa: N802
        """Hide at once, then end a run that is being recorded and all processes; ask before that."""
        if not self._presenter.may_close():
            event.ignore()
            return
        self._timer.stop()
        shown = self._geometry.screen if self._awaits_last_screen else self._shown.screen.value
        self.closed.emit(self._geometry.capture(self, shown))
        self.hide()
        self._presenter.close()
        super().closeEvent(event)

    def _screen(self, screen: Screen) -> QWidget:
        if screen not in self._screens:
            self._screens[screen] = made = self._build_screen(screen)
            made.setAccessibleName(gettext(screen.label))
            made.setFocusPolicy(Qt.FocusPolicy.ClickFocus)  # without one Qt looks for another at the start
            self._stack.addWidget(made)
            self._geometry.restore_parts(made)
        return self._screens[screen]

    def _build_screen(self, screen: Screen) -> QWidget:
        """Build the view of a screen; one in a folder is imported now, since its plots load pyqtgraph."""
        window, presenter = self._presenter, self._presenter.presenters[screen]
        links: dict[Screen, tuple[Any, ...]] = {
            Screen.RECORD: (window.show_start,),
            Screen.IDENTIFY: (self.ask_for_run, self.export_run),
            Screen.RUNS: (self,),
        }
        view: Any
        match screen:
            case Screen.START:
                view = StartScreen(window.start, self.ask_for_run, self.find_amplifier)
            case Screen.STAND:
                view = StandScreen(window.stand)
            case Screen.SETTINGS:
                view = SettingsScreen(window.settings, self.edit_stand)
            case _:
                module = importlib.import_module(f"app.qt.{screen}.screen")
                more = links.get(screen, ())
                view = getattr(module, f"{screen.capitalize()}Screen")(self._theme, presenter, *more)
        presenter.attach(view)
        return cast(QWidget, view)

    def _menu_button(self) -> QToolButton:
        button = _make_rail_button(gettext("Menu"))
        button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonIconOnly)  # low, for low screens
        button.setAccessibleName(button.text())
        fill_menu(button, self, self.show_help)
        bind_button(button, "F10", gettext("About, documentation, log"), self)
        return button

    def _rail_button(self, screen: Screen) -> QToolButton:
        button = _make_rail_button(gettext(screen.label))
        button.setCheckable(True)
        button.setAutoExclusive(True)
        button.clicked.connect(lambda: self._presenter.show_screen(screen))
        return button

    def _add_keys(self) -> None:
        numbers = iter(range(1, len(Screen) + 1))
        for screen, button in self._rail.items():
            key = "Ctrl+," if screen in _AT_FOOT else f"Ctrl+{next(numbers)}"
            bind_button(button, key, gettext(screen.label), self)
        add_shortcut(self, "Ctrl+O", gettext("Open a recording"), self.ask_for_run)
        add_shortcut(self, "F1", gettext("Show these keys"), self.show_help)
        add_shortcut(self, "Ctrl+Q", gettext("Close the window and end the program"), self.close)

    def _restyle(self) -> None:
        tokens = self._theme.tokens
        for screen, button in self._rail.items():
            button.setIcon(icon(screen.icon, tokens.muted, active=tokens.accent))
        self._menu.setIcon(icon("list", tokens.muted))

    def _lay_out(self) -> None:
        rail, middle = QFrame(), QWidget()
        rail.setProperty("role", "rail")
        at_top = [button for screen, button in self._rail.items() if screen not in _AT_FOOT]
        at_foot = [self._rail[screen] for screen in _AT_FOOT]
        make_column(*at_top, STRETCH, *at_foot, self._menu, spacing=2, margins=(8, 8), of=rail)
        content = make_column(self._notice, (self._stack, 1))
        make_row(rail, (content, 1), of=middle)
        self.setCentralWidget(middle)


def _make_rail_button(text: str) -> QToolButton:
    button = QToolButton()
    button.setProperty("role", "rail")
    button.setText(text)
    button.setFont(font(TextRole.LABEL))
    button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextUnderIcon)
    button.setIconSize(QSize(24, 24))
    button.setFixedWidth(72)
    button.setFocusPolicy(Qt.FocusPolicy.TabFocus)
    return button


_WORDS = {"bad": N_("Error"), "warn": N_("Note"), "ok": N_("Done"), "plain": ""}
_DETAILS_HEIGHT = 168


class NoticeBar(QFrame):
    """Shows one notice, or nothing; its details are folded away."""

    def __init__(self, presenter: WindowPresenter) -> None:
        super().__init__()
        self.setProperty("role", "notice")
        self._shown: Notice | None = None
        self._focused_before: QWidget | None = None
        self._kind = label()
        self._text = label(wrap=True)
        self._more = label(muted=True)
        self._fold = make_button("", lambda: self._unfold(self._details.isHidden()))
        self._copy = make_button(gettext("Copy"), self._copy_details)
        self._action = make_button("", presenter.execute_notice_action)
        self._dismiss = make_button("", presenter.dismiss_notice)
        self._details = _details_field()
        self._lay_out()
        self.hide()

    def show_notice(self, notice: Notice | None, more: int = 0) -> None:
        """Show a notice, None hides the bar; `more` notices wait behind it."""
        set_text_or_hide(self._more, gettext("{count} more", count=more) if more else "")
        is_new = notice != self._shown
        self._shown = notice
        if notice is not None and is_new:
            self._write(notice)
        self.setVisible(notice is not None)
        if is_new and notice is not None and notice.is_question:
            self._focused_before = QApplication.focusWidget()
            self._dismiss.setFocus()
        elif is_new:
            self._give_focus_back()

    def hideEvent(self, event: QHideEvent) -> None:  # noqa: N802
        self._give_focus_back()
        super().hideEvent(event)

    def _give_focus_back(self) -> None:
        """Give the focus back that a question has taken."""
        before, self._focused_before = self._focused_before, None
        if before is not None and isValid(before):
            before.setFocus()

    def _write(self, notice: Notice) -> None:
        for widget in (self, self._kind):
            set_property(widget, "tone", notice.tone.value)
        kind = gettext(_WORDS[notice.tone.value])
        self._kind.setText(kind)
        self._kind.setVisible(bool(kind))
        self._text.setText(notice.text)
        self.setAccessibleName(f"{kind}: {notice.text}" if kind else notice.text)
        self._action.setText(gettext(notice.action.value) if notice.action else "")
        self._action.setVisible(notice.action is not None)
        self._dismiss.setText(gettext(notice.dismiss))
        self._details.setPlainText(notice.details)
        self._fold.setVisible(bool(notice.details))
        self._unfold(False)

    def _unfold(self, unfolded: bool) -> None:
        self._details.setVisible(unfolded)
        self._copy.setVisible(unfolded)
        self._fold.setText(gettext("Hide details") if unfolded else gettext("Details"))

    def _copy_details(self) -> None:
        QGuiApplication.clipboard().setText(f"{self._text.text()}\n{self._details.toPlainText()}")

    def _lay_out(self) -> None:
        buttons = (self._action, self._fold, self._copy, self._dismiss)
        line = make_row(self._kind, (self._text, 1), self._more, *buttons, spacing=12)
        layout = make_column(line, self._details, spacing=8, of=self)
        layout.setContentsMargins(12, 8, 8, 8)


def _details_field() -> QPlainTextEdit:
    field = QPlainTextEdit()
    field.setReadOnly(True)
    field.setFont(QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont))
    field.setLineWrapMode(QPlainTextEdit.LineWrapMode.NoWrap)
    field.setTabChangesFocus(True)
    field.setFixedHeight(_DETAILS_HEIGHT)
    field.setAccessibleName(gettext("Details"))
    return field
