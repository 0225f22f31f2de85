"""Opens the window and runs it until it is closed."""

import os
import signal
import sys

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication, QMessageBox

from app.presenters.window import WindowPresenter
from app.presenters.wiring import make_window_presenter
from app.qt.theme import Theme
from app.qt.window import MainWindow
from config.schema import ConfigError

_WARM_UP_MS = 2000
"""Engine and simulated stand start first: an analysis is needed seconds after them."""
_INTERRUPTED = 130


def run_window(simulated: bool = False, series: str = "1FFM0") -> int:
    """Open the window, and return the exit code when it has been closed.

    0 closed; 1 could not open, with one line on stderr; 130 closed by Ctrl-C or SIGTERM.

    Parameters
    ----------
    simulated : bool
        Connect to the simulated stand at once.
    series : str
        Series that the simulated stand runs.
    """
    if not _has_display():
        return _refuse("there is no display here. Use the commands, `slipstand --help`, or set DISPLAY")
    app = QApplication(sys.argv[:1])
    app.setApplicationName("Slipstand")
    theme = Theme(app)
    try:
        presenter = make_window_presenter()
    except ConfigError as error:
        QMessageBox.critical(None, "Slipstand", str(error))
        return _refuse(str(error))
    return _run(app, MainWindow(theme, presenter), presenter, series if simulated else None)


def _run(app: QApplication, window: MainWindow, presenter: WindowPresenter, simulated: str | None) -> int:
    interrupts = _close_on_interrupt(window)
    window.show()
    QTimer.singleShot(_WARM_UP_MS, window, presenter.warm_up)
    if simulated is not None:
        QTimer.singleShot(0, window, lambda: presenter.open_simulated(simulated))
    QTimer.singleShot(0, window, presenter.ask_to_recover)
    code = app.exec()
    return _INTERRUPTED if interrupts else code


def _has_display() -> bool:
    """Tell whether Qt can open a window; without a display it would end the process without a word."""
    chosen = {"DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM"} & os.environ.keys()
    return sys.platform != "linux" or any(os.environ[name] for name in chosen)


def _refuse(reason: str) -> int:
    sys.stderr.write(f"error: {reason}\n")
    return 1


def _close_on_interrupt(window: MainWindow) -> list[int]:
    """Let Ctrl-C and SIGTERM close the window like a click does; what came is in the list returned."""
    came: list[int] = []

    def close(number: int, _frame: object) -> None:
        came.append(number)
        window.close()

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, close)
    return came
