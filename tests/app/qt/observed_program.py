"""The program, which tells what it shows: `python observed_program.py SOCKET [--simulated]`.

Whoever connects to the local socket receives all visible widgets as JSON. Nothing can be done to the program
there: keys and pointer come from the window system.
"""

import json
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[3]))

from looking import plain
from PySide6.QtCore import QPoint, QRect
from PySide6.QtNetwork import QLocalServer
from PySide6.QtWidgets import QApplication, QHeaderView, QMenu, QTableView, QWidget

from app.__main__ import main
from app.qt import main as window_main
from app.qt.window import MainWindow


def describe(widget: QWidget) -> dict[str, Any]:
    """Kind, text, name, place on the screen and state of a widget, and the parts that it draws itself."""
    text = widget.property("plainText") or widget.property("text") or widget.property("currentText")
    return {
        "kind": [one.__name__ for one in type(widget).__mro__[:-3]],
        "text": plain(str(text or "")),
        "name": widget.accessibleName(),
        "place": place(widget, widget.rect()),
        "enabled": widget.isEnabled(),
        "focused": QApplication.focusWidget() is widget,
        "primary": widget.property("primary") == "true",
        "title": widget.windowTitle(),
        "is_active": widget.isActiveWindow(),
        **parts_of(widget),
    }


def place(widget: QWidget, rect: QRect) -> tuple[int, int, int, int]:
    corner = widget.mapToGlobal(rect.topLeft())
    return corner.x(), corner.y(), rect.width(), rect.height()


def parts_of(widget: QWidget) -> dict[str, Any]:
    if isinstance(widget, QMenu):
        entries = [action for action in widget.actions() if action.text()]
        return {
            "parts": {e.text().replace("&", ""): place(widget, widget.actionGeometry(e)) for e in entries}
        }
    if isinstance(widget, QTableView) and not isinstance(widget, QHeaderView):
        return {"rows": rows_of(widget)}
    plots = getattr(widget, "plots", None)
    if isinstance(plots, list | tuple):
        return {"plots": [plot_of(widget, plot) for plot in plots]}
    return {}


def rows_of(table: QTableView) -> list[dict[str, Any]]:
    model, view, selection = table.model(), table.viewport(), table.selectionModel()
    found = []
    for row in range(model.rowCount()):
        cells = [index for column in range(model.columnCount()) for index in [model.index(row, column)]]
        shown = [index for index in cells if not table.isColumnHidden(index.column())]
        found.append(
            {
                "cells": [str(index.data() or "") for index in shown],
                "place": place(view, table.visualRect(shown[0])),
                "selected": selection.isSelected(shown[0]),
            }
        )
    return found


def plot_of(stack: QWidget, plot: Any) -> dict[str, Any]:
    canvas = plot.view.getViewWidget()
    corner = canvas.mapFromScene(plot.view.sceneBoundingRect().topLeft())
    size = plot.view.sceneBoundingRect().size().toSize()
    x, y = plot.view.viewRange()
    readout = plain(plot.readout.text)
    return {"place": place(canvas, QRect(QPoint(corner), size)), "x": x, "y": y, "readout": readout}


class ObservedWindow(MainWindow):
    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._server = QLocalServer(self)
        if not self._server.listen(SOCKET):
            sys.exit(f"{SOCKET}: {self._server.errorString()}")
        self._server.newConnection.connect(self._answer)

    def _answer(self) -> None:
        connection = self._server.nextPendingConnection()
        shown = [widget for widget in QApplication.allWidgets() if widget.isVisible()]
        connection.write(json.dumps([describe(widget) for widget in shown]).encode())
        connection.disconnectFromServer()


if __name__ == "__main__":
    SOCKET = sys.argv.pop(1)
    window_main.MainWindow = ObservedWindow  # type: ignore[misc]
    main()
