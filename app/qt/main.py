"""Main function of the window."""

import datetime
import gc
import os
import signal
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

from PySide6.QtCore import QLibraryInfo, QLocale, Qt, QTimer, QTranslator
from PySide6.QtGui import QIcon
from PySide6.QtWidgets import QApplication, QMessageBox

from analysis.catalogue import DISPLACEMENT_UNITS, use_displacement_unit
from app.child_process import allow_open_files, end_signals
from app.log import start_log
from app.presenters.composition import make_window_presenter, read_personal
from app.presenters.error_reports import ErrorReporter, error_report
from app.presenters.window import WindowPresenter
from app.qt.theme import SCHEMES, Theme
from app.qt.window import MainWindow
from config.files import load_window_layout, save_window_layout
from config.schema import ConfigError, Settings, WindowLayout
from messages.i18n import LANGUAGE_VARIABLE, language, translate, use_language

_WARM_UP_MS = 2000
"""Delay before the analysis is loaded: engine and simulated stand, needed earlier, start first."""
_INTERRUPTED = 130
_OPEN_FILES, _OPEN_FILES_LEAST = 1024, 64
"""Files that the window may have open at once: processes of an analysis, each with its pipes, are most."""
_ICON = Path(__file__).with_name("slipstand.svg")


def run_window(simulated: bool = False, series: str = "1FFM0", run: str = "") -> int:
    """Open the window, and return the exit code when it has been closed.

    0 closed; 1 could not open, with one line on stderr; 130 closed by Ctrl-C or SIGTERM. With `simulated` it
    connects at once to a simulated stand that runs `series`; with `run` it shows that run file on Identify.
    """
    if run and not Path(run).is_file():
        return _refuse(f"{run}: there is no such file. Give a run file, or a command: slipstand --help")
    if not _has_display():
        return _refuse("there is no display here. Use the commands, `slipstand --help`, or set DISPLAY")
    if (files := allow_open_files(_OPEN_FILES)) < _OPEN_FILES_LEAST:
        return _refuse(
            f"the window may open {files} files at once, and needs {_OPEN_FILES_LEAST}."
            " Allow more: ulimit -n 256"
        )
    errors, personal = ErrorReporter(), read_personal()
    start_log("window", personal.settings.log_level)
    errors.install_hooks()
    _use(personal.settings)
    app = QApplication(sys.argv[:1])
    app.setApplicationName("Slipstand")
    app.setDesktopFileName("slipstand")  # by which a desktop finds the icon of a window
    app.setWindowIcon(QIcon(str(_ICON)))
    _translate_dialogs(app)
    theme = Theme(app, SCHEMES[personal.settings.theme])
    try:
        presenter = make_window_presenter(personal=personal, errors=errors)
    except ConfigError as error:
        box = QMessageBox(QMessageBox.Icon.Critical, "Slipstand", str(error))
        box.setTextFormat(Qt.TextFormat.PlainText)
        box.exec()
        return _refuse(str(error))
    interrupts = _close_on_interrupt(presenter)  # first: Qt drops what is raised in its callbacks
    window = MainWindow(theme, presenter, _load_layout(errors))
    window.closed.connect(lambda layout: _save_layout(layout, errors))
    if run:
        first = partial(presenter.open_run, run)
    elif simulated:
        first = partial(presenter.open_simulated, series)
    else:
        first = None
    code = _run(app, window, presenter, first)
    code = _INTERRUPTED if interrupts else code
    while (late := errors.next_report()) is not None:
        sys.stderr.write(f"error: {translate(late.message)}\n")
    return code


def _use(settings: Settings) -> None:
    """Choose language, unit and size; SLIPSTAND_LANGUAGE is preferred to the settings."""
    use_displacement_unit(DISPLACEMENT_UNITS[settings.displacement_unit])
    of_system = QLocale.system().name().partition("_")[0]
    chosen = of_system if settings.language == "system" else settings.language
    use_language(os.environ.get(LANGUAGE_VARIABLE, chosen))
    if settings.scale != 1.0:
        os.environ.setdefault("QT_SCALE_FACTOR", f"{settings.scale:g}")


def _translate_dialogs(app: QApplication) -> None:
    """Translate Qt's own dialogs, as far as Qt has the language."""
    translator = QTranslator(app)
    folder = QLibraryInfo.path(QLibraryInfo.LibraryPath.TranslationsPath)
    if translator.load(f"qtbase_{language()}", folder):
        app.installTranslator(translator)


def _load_layout(errors: ErrorReporter) -> WindowLayout:
    try:
        return load_window_layout()
    except ConfigError as error:
        errors.report(error_report(error))
        return WindowLayout()


def _save_layout(layout: WindowLayout, errors: ErrorReporter) -> None:
    try:
        save_window_layout(layout, datetime.datetime.now().astimezone().date())
    except ConfigError as error:
        errors.report(error_report(error))


def _run(
    app: QApplication, window: MainWindow, presenter: WindowPresenter, first: Callable[[], None] | None
) -> int:
    """Show the window until it is closed; `first` is called once it is there."""
    window.show()
    if first is None:
        window.show_last_screen_soon()
        QTimer.singleShot(0, window, presenter.connect_at_start)
    else:
        QTimer.singleShot(0, window, first)
    QTimer.singleShot(_WARM_UP_MS, window, presenter.warm_up)
    QTimer.singleShot(_WARM_UP_MS, window, exempt_from_collection)
    QTimer.singleShot(0, window, presenter.ask_to_recover)
    return app.exec()


def exempt_from_collection() -> None:
    """Leave all that exists out of later garbage collections: they take place between frames."""
    gc.collect()
    gc.freeze()


def _has_display() -> bool:
    """Tell whether Qt can open a window; without a display Qt ends the process without a message."""
    chosen = {"DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM"} & os.environ.keys()
    return sys.platform != "linux" or any(os.environ[name] for name in chosen)


def _refuse(reason: str) -> int:
    sys.stderr.write(f"error: {reason}\n")
    return 1


def _close_on_interrupt(presenter: WindowPresenter) -> list[int]:
    """Let signals that ask to end, as Ctrl-C, close the window; the returned list takes those received."""
    received: list[int] = []

    def close(number: int, _frame: object) -> None:
        received.append(number)
        presenter.close_window()

    for number in end_signals():
        signal.signal(number, close)
    return received
