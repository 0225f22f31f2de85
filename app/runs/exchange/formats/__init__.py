"""Formats of foreign files: each module opens one kind as an `app.runs.exchange.tables.Table`."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Format:
    """A format that is no plain text."""

    name: str
    suffixes: tuple[str, ...]
    module: str
    """Module below `app.runs.exchange.formats` whose `open_table` reads it."""
    magic: bytes = b""
    """First bytes of such a file, where they tell it."""
    has_rows: bool = False
    """Whether it has lines and a header, as a sheet has."""
    has_own_time: bool = False
    """Whether it keeps times or a rate beside the columns."""


FORMATS = (
    Format("MATLAB", (".mat",), "matlab"),
    Format("Excel", (".xlsx",), "excel", has_rows=True),
    Format("Parquet", (".parquet",), "parquet", b"PAR1"),
)
SUFFIXES = (".csv", ".txt", ".tsv", ".dat", ".asc", *(suffix for one in FORMATS for suffix in one.suffixes))
"""Names of files that can be imported; a text may have any other."""
