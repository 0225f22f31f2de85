"""Parts that a report is made of; the template knows how each looks, and takes every text as it is."""

from typing import Literal

import msgspec


class Symbol(msgspec.Struct, frozen=True, tag="symbol"):
    """A symbol of the paper, set with its subscript: `f_d`; and a unit, where it heads a column."""

    text: str
    unit: str = ""


Cell = str | Symbol


class Facts(msgspec.Struct, frozen=True, tag="facts"):
    """What is known: names with values."""

    rows: list[tuple[str, str]]


class Grid(msgspec.Struct, frozen=True, tag="grid"):
    """A table with a header that is repeated on every page. `small` sets it in smaller type.

    `numbers` says how many of the last columns are numbers, set to the right.
    """

    header: list[Cell]
    rows: list[list[Cell]]
    numbers: int = 0
    small: bool = False
    note: str = ""


class Text(msgspec.Struct, frozen=True, tag="text"):
    """A paragraph."""

    text: str


class Points(msgspec.Struct, frozen=True, tag="points"):
    """Sentences, each on its own."""

    texts: list[str]


class Conclusion(msgspec.Struct, frozen=True, tag="verdict"):
    """The result in large type, `symbol relation value`, with what is to be thought of it."""

    symbol: Symbol
    value: str
    text: str
    tone: Literal["ok", "warn", "bad"]
    relation: str = "="


class Notice(msgspec.Struct, frozen=True, tag="notice"):
    """What must not be overlooked, marked at its side."""

    text: str
    tone: Literal["warn", "bad"] = "bad"


class Drawing(msgspec.Struct, frozen=True, tag="drawing"):
    """A figure as SVG, as wide as there is room, with what it shows."""

    svg: str
    caption: str


class Drawings(msgspec.Struct, frozen=True, tag="drawings"):
    """Figures two by two."""

    items: list[Drawing]


class Signatures(msgspec.Struct, frozen=True, tag="signatures"):
    """Places to sign."""

    roles: list[str]


Block = Facts | Grid | Text | Points | Conclusion | Notice | Drawing | Drawings | Signatures


class Section(msgspec.Struct, frozen=True):
    """A part of the report; `wide` is set on pages turned by a quarter."""

    title: str
    blocks: list[Block]
    wide: bool = False


class Report(msgspec.Struct, frozen=True):
    """All that a report says.

    Attributes
    ----------
    title, subtitle : str
    laboratory : str
        "" where it is not known.
    date : str
        ISO, of the report; the only thing that differs between two reports of the same runs.
    software : str
    sections : list of Section
    """

    title: str
    subtitle: str
    laboratory: str
    date: str
    software: str
    sections: list[Section]
