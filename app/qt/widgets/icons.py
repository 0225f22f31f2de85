"""Icons by their names in Phosphor."""

import qtawesome
from PySide6.QtGui import QIcon


def icon(name: str, colour: str, *, active: str = "") -> QIcon:
    """Make an icon in a colour, and in `active` while its button is checked."""
    options = {"color": colour}
    if active:
        options["color_on"] = active
    made: QIcon = qtawesome.icon(f"ph.{name}", **options)
    return made
