"""Phosphor icons in the colours of the theme."""

import qtawesome
from PySide6.QtGui import QIcon


def icon(name: str, colour: str, *, active: str = "") -> QIcon:
    """Icon by its Phosphor name; `active` is its colour when checked."""
    options = {"color": colour}
    if active:
        options["color_on"] = active
    made: QIcon = qtawesome.icon(f"ph.{name}", **options)
    return made
