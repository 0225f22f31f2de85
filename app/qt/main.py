"""Opens the window and runs it until it is closed."""

import signal
import sys

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication

from app.presenters.wiring import make_window_presenter
from app.qt.theme import Theme
from app.qt.window import MainWindow

_WARM_UP_MS = 2000
"""Engine and simulated stand start first: an analysis is needed seconds after them."""


def run_window(simulated: bool = False, series: str = "1FFM0") -> int:
    """Open the window, and return the exit code when it has been closed.

    Parameters
    ----------
    simulated : bool
        Connect to the simulated stand at once.
    series : str
        Series that the simulated stand runs.

    Raises
    ------
    ConfigError
        A settings file cannot be used.
    """
    app = QApplication.instance() or QApplication(sys.argv[:1])
    if not isinstance(app, QApplication):
        raise TypeError("a Qt application without widgets runs already: end it first")
    app.setApplicationName("Slipstand")
    presenter = make_window_presenter()
    window = MainWindow(Theme(app), presenter)
    interrupts = _close_on_interrupt(window)
    window.show()
    QTimer.singleShot(_WARM_UP_MS, presenter.warm_up)
    if simulated:
        QTimer.singleShot(0, lambda: presenter.open_simulated(series))
    code = app.exec()
    return 130 if interrupts else code


def _close_on_interrupt(window: MainWindow) -> list[int]:
    """Let Ctrl-C and SIGTERM close the window like a click does; what came is in the list returned."""
    came: list[int] = []

    def close(number: int, _frame: object) -> None:
        came.append(number)
        window.close()

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, close)
    return came
