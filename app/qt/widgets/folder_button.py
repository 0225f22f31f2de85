"""Buttons that choose a folder, from those used last or in a dialog, or show one in the system."""

from collections.abc import Callable

from PySide6.QtCore import QPoint, Qt, QUrl
from PySide6.QtGui import QDesktopServices
from PySide6.QtWidgets import QMenu, QPushButton

from app.qt.widgets.inputs import ask_for_folder
from app.qt.widgets.text import set_tool_tip
from messages.i18n import gettext


class FolderButton(QPushButton):
    """Calls `choose` with a folder; `title` is that of the dialog, `recent` returns those of the menu."""

    def __init__(
        self, title: str, recent: Callable[[], tuple[str, ...]], choose: Callable[[str], object]
    ) -> None:
        super().__init__(gettext("Folder…"))
        self._title = title
        self._recent = recent
        self._choose = choose
        self.folder = ""
        """The current folder."""
        self.clicked.connect(lambda _checked: self.ask())

    def ask(self) -> None:
        """Show the menu, or the dialog where there is nothing to choose from."""
        others = [folder for folder in self._recent() if folder != self.folder]
        if not others:
            self._ask_for_other()
            return
        menu = QMenu(self)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        for number, folder in enumerate(others, start=1):
            text = f"&{number}  {folder.replace('&', '&&')}"
            menu.addAction(text).triggered.connect(lambda _=False, folder=folder: self._choose(folder))
        menu.addSeparator()
        menu.addAction(gettext("Another folder…")).triggered.connect(self._ask_for_other)
        menu.popup(self.mapToGlobal(QPoint(0, self.height())))
        menu.setActiveAction(menu.actions()[0])

    def _ask_for_other(self) -> None:
        ask_for_folder(self, self._title, self.folder, self._choose)


class OpenFolderButton(QPushButton):
    """Shows a folder in the system's file manager; hidden without one."""

    def __init__(self) -> None:
        super().__init__(gettext("Open folder"))
        self._folder = ""
        self.clicked.connect(lambda _checked: QDesktopServices.openUrl(QUrl.fromLocalFile(self._folder)))
        self.hide()

    def show_folder(self, folder: str) -> None:
        self._folder = folder
        set_tool_tip(self, folder)
        self.setVisible(bool(folder))
