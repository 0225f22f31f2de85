"""Formats of the table and the endings of their files, apart from what writes them: that loads scipy."""

from typing import Final

TEXTS: Final = ("text", "csv", "json", "markdown", "latex")
FORMATS: Final = (*TEXTS, "xlsx")
FORMAT_OF_ENDING: Final = {
    ".xlsx": "xlsx",
    ".csv": "csv",
    ".json": "json",
    ".md": "markdown",
    ".tex": "latex",
    ".txt": "text",
}
"""The one that a dialog proposes is first."""
